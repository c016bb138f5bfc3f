"""A time that an effect is: its cost has several minima, and the fit must end in the lowest."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.identify.estimation.fit import fit
from pneucli.identify.estimation.model_fit import fit_with_effect
from pneucli.identify.estimation.parameters import base_parameters
from pneucli.identify.residuals import ChamberPressures
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.simulate.run import simulate
from tests.simulate.synthetic_experiments import RIG, make_experiment, model, time_grid

TIME = time_grid(1.5)
NOISE = 300.0  # Pa
VESSEL = replace(RIG, vessel_volume=160e-6)
VOLUME = {"rig.vessel_volume": 160e-6}


def recorded(command: np.ndarray, delay: float) -> ChamberPressures:
    """A vessel's pressure behind a hose of a delay in s, with white noise."""
    blank = make_experiment("valve", TIME, {"u": command, "p1": 3e5}, rig=VESSEL)
    true = simulate(model(["line-delay"], {"line-delay.delay": delay} | VOLUME, VESSEL), blank)["p1"]
    read = true + NOISE * np.random.default_rng(1).normal(size=TIME.size)
    made = make_experiment("valve", TIME, {"u": command, "p1": read}, rig=VESSEL)
    made.inputs[:, :] = blank.inputs
    return ChamberPressures(replace(made, noise={"p1": NoiseModel(NOISE)}))


@pytest.mark.parametrize("delay", [0.0256, 0.0102])
def test_a_delay_behind_a_command_that_comes_again_is_not_taken_for_a_shorter_one(delay: float):
    """Pulses every 15 ms: a delay shorter or longer by that explains much as well, in a valley of its own."""
    rng = np.random.default_rng(2)
    levels = np.repeat(rng.uniform(0.7, 1.3, size=200), 15)[: TIME.size]
    command = 5.0 * levels * np.sign(np.sin(2 * np.pi * TIME / 0.015))
    view = recorded(command, delay)
    first = model(values=VOLUME, rig=VESSEL)
    base = fit(first, [view], base_parameters(first, [view.experiment]))
    found = fit_with_effect(base, [view], catalogue()["line-delay"])
    assert found["line-delay.delay"].value == pytest.approx(delay, rel=0.02)
