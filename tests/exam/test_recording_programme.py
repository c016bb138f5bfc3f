"""What is recorded of a rig, and how large it is: drawn at one place of every range, so that it can be calculated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from pneucli.exam.conditions import parse
from pneucli.exam.laboratory import Laboratory, RecordingPlan
from pneucli.exam.recording_programme import RecordingProgramme
from pneucli.exam.rig.excitations import (
    back_and_forth_reference,
    closed_loop,
    single_acting,
    stick_slip,
    two_sine_reference,
)
from pneucli.exam.rig.parameters import FIVE_THREE, ONE_CHAMBER, TWO_VALVES, Parameters
from pneucli.exam.rig.sensors import Sensors
from pneucli.exam.rig_scaling import RigScaling
from tests.exam.chosen import Chosen

PAR = Parameters()._replace(
    overlap=0.2, effective_area=2e-6, piston_area_1=8e-4, piston_area_2=6e-4, constant_force=30.0,
    spring_stiffness=200.0, spring_rest=0.05,
)  # fmt: skip
SIMILAR = RigScaling(length=2.0, area=1.0, pressure=3.0, supply=1.0, command=0.5)


RNG: Any = Chosen()


def programme(
    conditions: str = "usual", arrangement: int = ONE_CHAMBER, vessel: float | None = 2e-4, kind: str = "axis"
) -> RecordingProgramme:
    par = PAR._replace(arrangement=arrangement)
    return RecordingProgramme(
        Laboratory("r", par, Sensors(), vessel, kind != "valve"), par, SIMILAR, parse(conditions), RNG
    )


def listed(takes: Sequence[RecordingPlan]) -> list[tuple[str, str, str, int]]:
    return [(t.name, t.experiment, t.use, t.chamber) for t in takes]


STEPS = [f"step_+{0.5 * v}V" for v in (0.6, 1.2, 2.5, 4.0, 6.0, 8.0, 10.0)]


def bench(tested: bool, chamber: int = 1) -> list[tuple[str, str, str, int]]:
    before = "" if chamber == 1 else "chamber_2_"
    uses = ["test" if tested and k == 3 else "train" for k in range(7)]
    steps = [(before + name, "valve", use, chamber) for name, use in zip(STEPS, uses, strict=True)]
    return [*steps, (f"{before}stairs_1", "valve", "train", chamber), (f"{before}stairs_2", "valve", "test", chamber)]


def numbered(name: str, experiment: str, count: int) -> list[tuple[str, str, str, int]]:
    return [(f"{name}_{k}", experiment, "test" if k == count else "train", 1) for k in range(1, count + 1)]


def test_the_takes_of_each_kind_of_rig() -> None:
    assert listed(programme(kind="valve").plans("valve")) == bench(tested=True)
    assert listed(programme(vessel=None, kind="friction").plans("friction")) == [
        *numbered("stickslip", "friction", 2), *numbered("driven", "friction", 3),
    ]  # fmt: skip
    assert listed(programme().plans("axis")) == [*bench(tested=False), *numbered("axis", "axis", 4)]
    both = programme(arrangement=FIVE_THREE).plans("axis")
    assert listed(both) == [*bench(False), *bench(False, 2), *numbered("axis", "axis", 4)]


def test_levels_are_shares_of_the_rigs_own_largest_command() -> None:
    found = {t.name: t.excitation.command for t in programme(kind="valve").plans("valve")}
    assert [np.abs(found[name]).max() for name in STEPS] == pytest.approx([0.3, 0.6, 1.25, 2.0, 3.0, 4.0, 5.0])
    assert [np.abs(found[f"stairs_{k}"]).max() for k in (1, 2)] == pytest.approx([4 * 0.8, 4 * 0.6])


def test_a_switching_valve_is_given_a_step_and_pulses() -> None:
    one = programme("switching", kind="axis")
    takes = one.plans("axis")
    assert listed(takes)[:4] == numbered("pulses", "valve", 4)
    assert np.abs(takes[0].excitation.command).max() == PAR.command_range


LOAD = 30.0 + 200.0 * (0.1 - 0.05)


def test_an_axis_is_driven_in_a_closed_loop_that_balances_its_load() -> None:
    """Gain of 160 V/m over twice the length at half the command; 1.84 bar times three."""
    move = programme()._driven(8000)
    wanted = closed_loop(PAR, two_sine_reference(RNG, 8000, PAR.stroke), 160.0 * 0.5 / 2.0, 1.84e5 * 3.0, LOAD)
    assert np.array_equal(move.command, wanted.command)
    assert (move.gain, move.pressure_1, move.pressure_2) == (wanted.gain, wanted.pressure_1, wanted.pressure_2)
    assert move.command.size == 8000


def test_a_thick_rod_has_the_higher_pressure_on_its_side() -> None:
    move = programme("differential")._driven(100)
    assert move.pressure_1 == pytest.approx(PAR.ambient + 0.75 * 1.84e5 * 3.0)


def test_a_spring_returns_the_piston_against_an_open_chamber() -> None:
    move = programme("return-spring")._driven(100)
    wanted = single_acting(PAR, two_sine_reference(RNG, 100, PAR.stroke), 40.0, LOAD)
    assert (move.chamber_2_open, move.pressure_1, move.gain) == (True, wanted.pressure_1, wanted.gain)
    assert move.pressure_1 == pytest.approx(PAR.ambient + LOAD / 8e-4)
    assert move.pressure_2 == PAR.ambient


@pytest.mark.parametrize("arrangement", [FIVE_THREE, TWO_VALVES])
def test_two_driven_chambers_have_half_the_gain_and_nearly_twice_the_pressure(arrangement: int) -> None:
    """A second valve of its own swings by 6 % of the command over 2.2 s about the opposite of the first."""
    move = programme(arrangement=arrangement)._driven(4000)
    assert move.gain == pytest.approx(0.5 * 40.0)
    assert move.pressure_1 == pytest.approx(PAR.ambient + 1.8 * 1.84e5 * 3.0)
    swing = 0.06 * PAR.command_range * np.sin(2 * np.pi * (1e-3 * np.arange(4000) / 2.2 + 0.6))
    assert move.command_2 == pytest.approx(swing if arrangement == TWO_VALVES else np.zeros(1), abs=1e-12)


@pytest.mark.parametrize(("conditions", "arrangement", "top"), [("ends", 0, 0.5), ("ends+return-spring", 0, 1.14)])
def test_at_its_ends_the_reference_goes_beyond_them_but_where_air_is_shut_in(
    conditions: str, arrangement: int, top: float
) -> None:
    one = programme(conditions, arrangement)
    wanted = back_and_forth_reference(RNG, 5000, 0.65, (-0.14 * PAR.stroke, top * PAR.stroke))
    assert one._reference(5000) == pytest.approx(wanted)
    open_ = programme(conditions, FIVE_THREE)._reference(5000)
    assert open_ == pytest.approx(back_and_forth_reference(RNG, 5000, 0.65, (-0.14 * PAR.stroke, 1.14 * PAR.stroke)))
    assert programme("ends", FIVE_THREE)._driven(100).pressure_1 == pytest.approx(
        PAR.ambient + 1.8 * 1.4 * 1.84e5 * 3.0
    )


def test_stick_slip_fills_at_two_rates_from_15_percent_of_the_stroke() -> None:
    moves = [t.excitation for t in programme(kind="friction")._stick_slip()]
    position = 0.15 * PAR.stroke
    load = 30.0 + 200.0 * (position - 0.05)
    for move, rate in zip(moves, (6.8e3, 12e3), strict=True):
        wanted = stick_slip(PAR, rate * 3.0, position, load=load)
        assert move.command[0] == wanted.command[0]
        assert (move.position, move.pressure_1) == (position, wanted.pressure_1)


# --- references


def test_a_wandering_reference_is_two_sines_from_the_middle_scaled_by_the_stroke() -> None:
    """57 mm and 14 mm of 200, of 3.2 s and 3.1 times as fast."""
    time = 1e-3 * np.arange(500)
    phase = -2 * np.pi * time / 3.2
    wanted = 0.1 + 0.057 * np.sin(phase) + 0.014 * np.sin(3.1 * phase)
    assert two_sine_reference(RNG, 500) == pytest.approx(wanted)
    assert two_sine_reference(RNG, 500, 0.4) == pytest.approx(2.0 * wanted)


def test_to_and_fro_each_level_is_held_for_its_share_of_the_time() -> None:
    from pneucli.exam.rig.excitations import FOLLOWING_TIME

    found = back_and_forth_reference(RNG, 20_000, 0.6, (-0.01, 0.2))
    rest = 1.04 * (0.6 + FOLLOWING_TIME) * 0.6 / 0.4
    assert found[0] == pytest.approx(0.1)
    corners = np.cumsum([0.0, 0.6, FOLLOWING_TIME + rest, 0.6, FOLLOWING_TIME + rest])
    heights = np.interp(1e-3 * np.arange(4000), corners, [0.1, -0.01, -0.01, 0.2, 0.2])
    assert found[:4000] == pytest.approx(heights)
    assert np.mean(found == -0.01) == pytest.approx(
        0.5 * (FOLLOWING_TIME + rest) / (0.6 + FOLLOWING_TIME + rest), abs=0.03
    )
    assert back_and_forth_reference(RNG, 10, 0.6, (0.05, 0.2))[0] == pytest.approx(0.125)
