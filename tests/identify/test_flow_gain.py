"""What an error of the flow becomes in the pressures: checked against commands that are off by so much."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.identify.residuals import ChamberPressures, ForceBalance
from pneucli.identify.residuals.chambers import flow_gain_sensitivity
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.preparation import prepare
from pneucli.simulate.run import simulate
from tests.simulate.synthetic_experiments import held_commands, make_experiment, model, time_grid

TIME = time_grid(2.0)
COMMANDS = held_commands(TIME, [2.0, -2.0, 1.0, -1.0], 0.5)
NOISE = 500.0  # Pa


def seen(u: np.ndarray) -> Experiment:
    """A chamber that such commands fill and vent, restarted from the same readings every half second."""
    given = {"u": u, "x": np.full(TIME.size, 0.1)}
    exact = make_experiment("axis", TIME, {**given, "v": np.zeros(TIME.size), "p1": 2e5}, chamber_2="open")
    readings = np.full(TIME.size, 2e5) + np.random.default_rng(1).normal(scale=NOISE, size=TIME.size)
    return prepare(replace(exact.recording, signals={**given, "p1": readings}), exact.rig, 0.5)


@pytest.mark.parametrize(("number", "sign"), [(0, 1.0), (1, -1.0)])
def test_an_error_of_the_flow_is_what_commands_of_that_sense_do_that_are_off(number: int, sign: float) -> None:
    """One command of a hundred is off: the line through the present ones is right within some hundredths."""
    nominal, off = seen(COMMANDS), seen(np.where(sign * COMMANDS > 0.0, 0.99, 1.0) * COMMANDS)
    change = simulate(model(), nominal)["p1"] - simulate(model(), off)["p1"]
    found = 0.01 * flow_gain_sensitivity(model(), nominal)["p1"][number] * nominal.noise["p1"].rms
    assert np.abs(change).max() > NOISE / 10.0
    assert np.linalg.norm(found - change) < 0.03 * np.linalg.norm(change)


def test_while_the_valve_is_shut_no_error_of_the_flow_grows() -> None:
    assert not flow_gain_sensitivity(model(), seen(np.zeros(TIME.size)))["p1"].any()


def test_what_has_no_flow_has_no_error_of_it() -> None:
    e = seen(COMMANDS)
    assert set(ChamberPressures(e).flow_gain_sensitivity(model())) == {"p1"}
    assert ForceBalance(e).flow_gain_sensitivity(model()) == {}
