"""Substitutes for pressures that a recording lacks."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.recording import Recording
from pneucli.simulate import layout as at
from pneucli.simulate.preparation import substitute_missing_inputs
from pneucli.simulate.run import run
from tests.simulate.synthetic_experiments import BALANCED, RIG, held_commands, make_experiment, model, time_grid

TIME = time_grid(4.0)
COMMANDS = held_commands(TIME, [2.0, -2.0, 3.0, -2.5, 1.5, -1.5, 2.5, -3.0], 0.5)


@pytest.fixture(scope="module")
def moved() -> np.ndarray:
    """The kernel's output for a piston that is driven to and fro against a gas shut in chamber 2."""
    return run(model(), make_experiment("axis", TIME, {"u": COMMANDS, "x": 0.1, "p1": BALANCED["p1"]}))


def filled(out: np.ndarray, recorded: set[str], chamber_2: str, **rig: float | None) -> np.ndarray:
    """Inputs of a recording of some signals, with what stands in for the others."""
    inputs = np.zeros((TIME.size, len(at.INPUTS)))
    for column, shown in ((at.IN_P1, at.P1), (at.IN_X, at.X), (at.IN_V, at.V)):
        inputs[:, column] = out[:, shown]
    signals = dict.fromkeys(recorded, np.zeros(TIME.size))
    substitute_missing_inputs(
        inputs, Recording("bench", "axis", "train", TIME, signals, chamber_2=chamber_2), replace(RIG, **rig)
    )
    return inputs


def test_trapped_gas_has_the_pressure_of_the_force_balance(moved: np.ndarray):
    """Within 2 % of the truth, whatever dry and viscous friction are."""
    assert filled(moved, {"p1", "x"}, "closed")[:, at.IN_P2] == pytest.approx(moved[:, at.P2], rel=0.02)


def test_behind_a_valve_p2_starts_at_the_pressure_that_holds_the_piston(moved: np.ndarray):
    """3 bar on 8.04 cm^2 are held by what ``BALANCED`` has on 7 cm^2; how p2 goes on, no reading tells."""
    assert filled(moved, {"p1", "x"}, "valve")[:, at.IN_P2] == pytest.approx(float(BALANCED["p2"]), rel=0.001)


@pytest.mark.parametrize(
    ("recorded", "chamber_2", "rig"),
    [({"p1"}, "closed", {}), ({"p1", "x"}, "open", {}),
     ({"p1", "x"}, "closed", {"stroke": None}),
     ({"p1", "x"}, "closed", {"piston_area_1": None, "piston_area_2": None})],
)  # fmt: skip
def test_other_missing_pressures_are_ambient(moved: np.ndarray, recorded: set[str], chamber_2: str, rig: dict):
    assert filled(moved, recorded, chamber_2, **rig)[:, at.IN_P2] == pytest.approx(RIG.ambient_pressure)


def test_without_any_pressure_an_axis_starts_amid_ambient_and_supply(moved: np.ndarray):
    inputs, amid = filled(moved, {"x"}, "valve"), 0.5 * (RIG.ambient_pressure + 7e5)
    held = RIG.ambient_pressure + RIG.piston_areas[0] / RIG.piston_areas[1] * (amid - RIG.ambient_pressure)
    assert inputs[:, at.IN_P1] == pytest.approx(amid)
    assert inputs[:, at.IN_P2] == pytest.approx(held)


def test_recorded_signals_are_not_substituted(moved: np.ndarray):
    inputs = filled(moved, {"p1", "p2", "p_supply"}, "closed")
    assert inputs[:, at.IN_P1] == pytest.approx(moved[:, at.P1])
    assert not inputs[:, [at.IN_P2, at.IN_SUPPLY]].any()
    assert filled(moved, {"p1", "p2"}, "closed")[:, at.IN_SUPPLY] == pytest.approx(7e5)
