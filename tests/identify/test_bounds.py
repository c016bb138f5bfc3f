"""Bounds are as wide as what people have, and as the limits that textbooks use."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.identify.estimation.fit import Estimate
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.residuals import residual_models
from pneucli.messages.formatting import format_figure
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.recording import Recording, Rig
from pneucli.simulate import layout as at
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.simulate.run import run
from pneucli.simulate.valve_forms import ValveArea
from tests.simulate.spring_return import CYLINDER, recordings
from tests.simulate.synthetic_experiments import VALVE, make_experiment, model, time_grid

RT, KAPPA, AMBIENT, SUPPLY = 287.0 * 293.15, 1.4, 101_325.0, 7e5


@pytest.mark.parametrize(
    ("name", "share"), [("line-delay", 1.0), ("valve-lag", 1.0), ("time-skew", 0.5), ("pressure-lag", 0.5)]
)
def test_delays_and_lags_go_as_far_as_the_model_predicts(name: str, share: float) -> None:
    """Half of it where the reading at the restart is late: the other half predicts what it does not show."""
    time = time_grid(4.0)
    restarted = make_experiment("axis", time, {"u": np.sin(time), "p1": 3e5}, restarts=tuple(range(0, time.size, 800)))
    parameter = catalogue()[name].parameters[0]
    assert parameter.range_on(rig_quantities(model(), [restarted])).upper == pytest.approx(share * 0.8)
    alone = rig_quantities(model())
    assert parameter.range_on(alone).upper == pytest.approx(share * alone.response_time)


@pytest.mark.parametrize(("volume", "supply", "scale"), [(2e-4, 7e5, 1.0), (2e-2, 5e6, 20.0)])
def test_gas_at_the_bound_of_heat_transfer_is_isothermal(volume: float, supply: float, scale: float) -> None:
    """A vessel of 0.2 l at 7 bar, and one of 20 l at 50 bar, filled and vented at full opening."""
    rig = Rig(supply_pressure=supply, vessel_volume=volume)
    heat = catalogue()["heat-transfer"]
    wide = ValveArea(VALVE.commands, tuple(scale * a for a in VALVE.areas))
    plain = Model(rig, (), {"rig.vessel_volume": volume}, wide)
    facts = rig_quantities(plain)
    time = time_grid(4.0 * facts.fill_time, facts.fill_time / 500.0)
    u = np.where(time < 2.0 * facts.fill_time, 10.0, -10.0)
    filled = make_experiment("valve", time, {"u": u, "p1": AMBIENT, "p_supply": supply}, rig=rig)
    isothermal = run(replace(plain, values={**plain.values, "rig.polytropic_exponent": 1.0}), filled)[:, at.P1]

    def error(conductance: float) -> float:
        values = {**plain.values, "heat-transfer.conductance": conductance}
        return float(np.abs(run(replace(plain, effects=(heat,), values=values), filled)[:, at.P1] - isothermal).max())

    bound = heat.parameters[0].range_on(facts).upper
    assert error(bound) < 1e-3 * supply
    assert error(bound / 50.0) > 1e-2 * supply


def tank(delay: float) -> tuple[Recording, Rig]:
    """A tank of 1 l that fills in 0.12 s, adiabatic, behind a linear valve whose command comes late, read at 100 Hz."""
    rng, step, every = np.random.default_rng(4), 1e-4, 100
    time = step * np.arange(90_000)
    u = rng.choice([3.0, 5.0, 8.0, 10.0, -2.0, -4.0, -7.0, -10.0], 20).repeat(4_500)
    late = np.concatenate([np.zeros(round(delay / step)), u])[: u.size]
    p, course = AMBIENT, np.empty(u.size)
    for k, command in enumerate(late.tolist()):
        course[k] = p
        upper, lower = (SUPPLY, p) if command > 0.0 else (p, AMBIENT)
        ratio = min(lower / upper, 1.0)
        psi = 0.484 if ratio < 0.528 else 0.484 * np.sqrt(1.0 - ((ratio - 0.528) / 0.472) ** 2)
        p += step * KAPPA * RT / 1e-3 * 3e-6 * command * upper * np.sqrt(2.0 / RT) * psi
    chosen = slice(None, None, every)
    read = {"u": u[chosen], "p1": course[chosen] + 400.0 * rng.standard_normal(900), "p_supply": np.full(900, SUPPLY)}
    noise = {"p1": NoiseModel(400.0), "p_supply": NoiseModel(0.0), "u": NoiseModel(0.0)}
    return Recording("tank", "valve", "train", time[chosen], read, noise), Rig(vessel_volume=1e-3)


def test_a_dead_time_of_half_a_response_time_is_found() -> None:
    one, rig = tank(0.06)
    ready = [prepare(one, rig, 0.5)]
    views = residual_models(ready, whiten_initial_state=True)
    found = fit_model(guess_base_model(ready, rig), views, [catalogue()["time-skew"]])["time-skew.delay"]
    assert found.value == pytest.approx(0.06, abs=4e-3)
    assert (found.figure.low, found.figure.high) == found.ci95


def friction_by_pressure(coulomb: float) -> tuple[Estimate, Estimate]:
    """Dry friction and its growth with pressure, fitted where 2 N come for each bar."""
    held = replace(CYLINDER, coulomb=coulomb, seal=2e-5, stroke=0.3, preload=-90.0, start=0.1)
    ready = [prepare(one, held.rig(), 0.5) for one in recordings(held)[:2]]
    effects = [catalogue()[name] for name in ("spring-force", "pressure-friction")]
    found = fit_model(guess_base_model(ready, held.rig()), residual_models(ready), effects)
    return found["friction.coulomb"], found["pressure-friction.gain"]


def test_friction_may_be_by_pressure_for_the_most() -> None:
    dry, gain = friction_by_pressure(1.8)
    assert dry.value == pytest.approx(1.8, abs=0.1)
    assert dry.value * gain.value == pytest.approx(2.0, rel=0.05)
    assert not gain.at_bound


def test_friction_by_pressure_alone_grows_by_at_least_the_bound() -> None:
    """Any larger ratio describes these recordings as well or better."""
    _, gain = friction_by_pressure(0.0)
    assert format_figure(gain.figure).startswith("at least")
