"""A plan on the virtual rig: commands from its file, as excitations of each bench."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.diagnosis import planned_recordings, read_commands
from pneucli.exam.cases import prepare_case
from pneucli.exam.conditions import parse
from pneucli.exam.rig.imposed_motion import MotionMachine
from pneucli.exam.rig.simulation import Excitation

COMMANDS = """time [s],u [V],x_ref [mm],recording
0.000,5.5,,plan_1
0.001,4.25,,plan_1
0.002,4.25,,
0.003,,100,plan_2
0.004,,101.5,plan_2
"""
PLANNED: dict[str, Any] = {
    "name": "plan_1",
    "experiment": "axis",
    "use": "train",
    "drive": "valve",
    "chamber": 1,
    "chamber_2": "valve",
    "gain": None,
    "start": {"x": 0.08, "p1": 3e5, "p2": 3e5},
    "by_hand": None,
    "force": 0.0,
}


@pytest.fixture
def commands(tmp_path: Path):
    file = tmp_path / "commands.csv"
    file.write_text(COMMANDS, encoding="utf-8")
    return read_commands(file)


def laboratory(condition: str = "5/3-5V", kind: str = "axis"):
    return prepare_case("rig", kind, (), "", 1.0, 1, parse(condition)).laboratory


def test_commands_are_read_in_si_by_recording_without_the_time_between(commands):
    assert commands["plan_1"]["u"].tolist() == [5.5, 4.25]
    assert commands["plan_2"]["x_ref"].tolist() == pytest.approx([0.1, 0.1015])
    assert set(commands["plan_1"]) == {"u"}


def test_raw_commands_become_openings_from_the_null_without_a_loop(commands):
    (take,) = planned_recordings(laboratory(), [PLANNED], commands)
    assert isinstance(take.excitation, Excitation)
    assert take.excitation.command.tolist() == pytest.approx([0.5, -0.75])
    assert take.excitation.gain == 0.0
    assert take.excitation.position == 0.08
    assert take.excitation.pressure_1 == pytest.approx(3e5)


def test_positions_are_followed_with_the_planned_gain(commands):
    planned = PLANNED | {"name": "plan_2", "drive": "position", "gain": 40.0, "use": "test"}
    (take,) = planned_recordings(laboratory(), [planned], commands)
    assert isinstance(take.excitation, Excitation)
    assert (take.excitation.gain, take.use) == (40.0, "test")
    assert take.excitation.command == pytest.approx([0.1, 0.1015])


def test_the_port_of_chamber_2_fills_with_the_opposite_sign(commands):
    vessel = PLANNED | {"experiment": "valve", "chamber": 2, "chamber_2": None}
    (take,) = planned_recordings(laboratory(), [vessel], commands)
    assert isinstance(take.excitation, Excitation)
    assert take.excitation.command == pytest.approx([-0.5, 0.75])


def test_a_machine_moves_between_the_extremes_of_the_reference_at_the_held_pressure(commands):
    strokes = PLANNED | {"name": "plan_2", "experiment": "friction", "drive": "machine", "speed": 0.02}
    commands["plan_2"]["p_ref"] = np.full(2, 4e5)
    (take,) = planned_recordings(laboratory("imposed", "friction"), [strokes], commands)
    assert isinstance(take.excitation, MotionMachine)
    assert take.excitation.positions == pytest.approx((0.1, 0.1015))
    assert (take.excitation.speeds, take.excitation.pressure) == ((0.02,), 4e5)


def test_a_valve_that_a_person_shuts_is_left_out(commands):
    assert planned_recordings(laboratory(), [PLANNED | {"by_hand": "Shut the ball valve."}], commands) == []


def test_a_weight_pulls_the_piston_and_moves_with_it(commands):
    lab, weight = laboratory(), PLANNED | {"by_hand": "Hang a weight.", "force": -19.62, "kind": "known-force"}
    (take,) = planned_recordings(lab, [weight], commands)
    assert isinstance(take.excitation, Excitation)
    par, hanging = lab.parameters, lab._rig_of(take)
    assert hanging.constant_force - par.constant_force == pytest.approx(19.62)  # toward x = 0
    assert hanging.mass - par.mass == pytest.approx(2.0)
    less = planned_recordings(lab, [PLANNED], commands)[0].excitation
    assert isinstance(less, Excitation)
    carried = par.piston_area_2 * (less.pressure_2 - take.excitation.pressure_2)
    assert carried == pytest.approx(19.62)  # the start is in balance
