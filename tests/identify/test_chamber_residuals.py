"""The pressure residuals: which channels a single effect explains alone, and their derivatives."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.identify.estimation.objective import LeastSquaresProblem
from pneucli.identify.estimation.parameters import base_parameters, effect_parameters
from pneucli.identify.residuals import ChamberPressures, ResidualModel, base
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.simulate.preparation import prepare
from pneucli.simulate.rig_quantities import rig_quantities
from tests.simulate.synthetic_experiments import RIG, VALVE, held_commands, make_experiment, model, time_grid

TIME = time_grid(1.0)


@pytest.mark.parametrize(("effect", "channels"), [("heat-transfer", ("temperature",)), ("chamber-leak", ())])
def test_only_heat_transfer_changes_the_modelled_gas_temperature(effect: str, channels: tuple[str, ...]) -> None:
    measured = {"u": 1.0, "p_supply": 7e5, "p1": 3e5}
    e = make_experiment("valve", TIME, measured | {"temperature": 293.15})
    e.noise.update({"p1": NoiseModel(400.0), "temperature": NoiseModel(1.0)})
    assert ChamberPressures(e).exclusive_channels(catalogue()[effect]) == channels
    assert ChamberPressures(make_experiment("valve", TIME, measured)).exclusive_channels(catalogue()[effect]) == ()


def test_one_simulation_gives_the_derivatives_of_weighted_and_whitened_residuals_that_differences_give(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    time = time_grid(0.4)
    u = held_commands(time, (0.0, 6.0, -3.0, 7.0), 0.1)
    made = make_experiment(
        "axis", time, {"u": u, "u2": -u, "p1": 3e5, "p2": 4e5, "x": 0.1, "v": 0.0}, "valve", (0, 200)
    )
    lost = made.recording["p2"].copy()
    lost[50:90] = np.nan
    recording = replace(made.recording, signals={**made.recording.signals, "p2": lost})
    noise = {"p1": NoiseModel(200.0), "p2": NoiseModel(300.0)}
    pressures = ChamberPressures(
        replace(made, recording=recording, noise=noise).without_mechanics(), weights={"p1": 0.4}
    )
    scaled = model(["pressure-scale"], {"pressure-scale.scale": 1.01})
    free = [f for f in base_parameters(model(), [made]) if f.name in VALVE.parameters()]
    free += effect_parameters(catalogue()["pressure-scale"], scaled, rig_quantities(scaled, [made]))
    problem = LeastSquaresProblem(scaled, [pressures], free, [{"p1": np.full((1, time.size), 0.3)}])
    at_once = problem.jacobian(problem.start)
    monkeypatch.setattr(ChamberPressures, "differentiable", ResidualModel.differentiable)
    by_differences = problem.jacobian(problem.start)
    for one, other in zip(at_once.T, by_differences.T, strict=True):
        assert np.linalg.norm(one - other) <= 1e-3 * np.linalg.norm(other)
    assert not at_once[time.size + 50 : time.size + 90].any()
    assert all(np.linalg.norm(column) > 0.0 for column in at_once.T)


def test_a_diverging_model_tells_nothing_of_initial_states_and_warns_of_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Warnings are errors in tests; without the derivative its cost is infinite, and a fit steps back."""
    reading = 3e5 + np.random.default_rng(1).normal(scale=400.0, size=TIME.size)
    e = prepare(make_experiment("valve", TIME, {"u": 1.0, "p_supply": 7e5, "p1": reading}).recording, RIG, 0.5)
    gone = {name: np.full(TIME.size, np.inf) for name in ("p1", "p2")}
    monkeypatch.setattr(base, "simulate", lambda *_: gone)
    assert not np.isfinite(base.initial_state_sensitivity(model(), e, {"p1": 1.0, "p2": 1.0})["p1"]).any()
