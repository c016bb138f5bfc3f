"""The bore of a hose: found where its volume and inertia show, and left out where the flow is only late."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.identify.estimation.fit import Fit, fit
from pneucli.identify.estimation.model_fit import fit_with_effect
from pneucli.identify.estimation.parameters import base_parameters
from pneucli.identify.residuals import ChamberPressures
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.simulate.run import simulate
from tests.simulate.synthetic_experiments import RIG, make_experiment, model, time_grid

TIME = time_grid(3.0)
NOISE = 200.0  # Pa
VESSEL = replace(RIG, vessel_volume=160e-6)
VOLUME = {"rig.vessel_volume": 160e-6}


def fitted_hose(**true: float) -> Fit:
    """The fit of a hose to the pressure of a vessel behind one, at random commands, with white noise."""
    rng = np.random.default_rng(3)
    command = np.resize(np.repeat(rng.uniform(-8.0, 8.0, size=61), 50), TIME.size)
    values = {f"line-delay.{name}": value for name, value in true.items()} | VOLUME
    blank = make_experiment("valve", TIME, {"u": command, "p1": 3e5}, rig=VESSEL)
    read = simulate(model(["line-delay"], values, VESSEL), blank)["p1"] + NOISE * rng.normal(size=TIME.size)
    made = make_experiment("valve", TIME, {"u": command, "p1": read}, rig=VESSEL)
    made.inputs[:, :] = blank.inputs
    view, first = ChamberPressures(replace(made, noise={"p1": NoiseModel(NOISE)})), model(values=VOLUME, rig=VESSEL)
    base = fit(first, [view], base_parameters(first, [view.experiment]))
    return fit_with_effect(base, [view], catalogue()["line-delay"])


@pytest.mark.parametrize(("delay", "bore"), [(6e-3, 4e-3), (3e-3, 3e-3), (8e-3, 5e-3)])
def test_a_hose_is_found_with_its_bore(delay: float, bore: float) -> None:
    found = fitted_hose(delay=delay, bore=bore)
    assert found["line-delay.delay"].value == pytest.approx(delay, rel=0.05)
    assert found["line-delay.bore"].value == pytest.approx(bore, rel=0.05)


def test_a_flow_that_is_only_late_has_no_bore() -> None:
    found = fitted_hose(delay=6e-3)
    assert found["line-delay.delay"].value == pytest.approx(6e-3, rel=0.02)
    assert "line-delay.bore" not in found.model.values
