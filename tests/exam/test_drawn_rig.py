"""The rig of a case as it is drawn: three fifths of every range, or another share where it decides."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from pneucli.exam import cases
from pneucli.exam.cases import draw_variant
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

RNG: Any = Chosen()
OFTEN: Any = Chosen(0.4)
PAR = Parameters()._replace(
    supply=7e5, ambient=1e5, piston_area_1=1e-3, piston_area_2=9e-4, stroke=0.2, mass=2.0, effective_area=2e-6,
    overlap=0.2, exponent=1.1,
)  # fmt: skip


def made(
    conditions: str, kind: str = "axis", par: Parameters = PAR, rng: Any = RNG
) -> tuple[Parameters, tuple[str, ...]]:
    return draw_variant(par, kind, parse(conditions), rng)


def test_the_usual_rig_has_one_driven_chamber_and_no_stated_effect() -> None:
    par, known = made("usual")
    assert known == ()
    ends = {"stop_stiffness": par.stop_stiffness, "stop_damping": par.stop_damping}
    assert par == PAR._replace(**ends)


@pytest.mark.parametrize(("rng", "pressed", "ratio"), [(RNG, 6.8e-4, 0.88), (OFTEN, 5.2e-4, 0.15)])
def test_an_end_gives_way_by_a_share_of_the_stroke_under_the_full_supply(
    rng: Any, pressed: float, ratio: float
) -> None:
    par, _ = made("usual", rng=rng)
    assert par.stop_stiffness == pytest.approx(600.0 / (0.2 * pressed))
    assert par.stop_damping == pytest.approx(2.0 * ratio * np.sqrt(par.stop_stiffness * 2.0))


def test_a_thick_rod_takes_about_half_of_the_area() -> None:
    assert made("differential")[0].piston_area_2 == pytest.approx(0.58e-3)


def test_a_spring_is_preloaded_by_a_share_of_the_full_force() -> None:
    """600 N: 0.198 of it at x = 0, and 0.22 more over the stroke."""
    par, known = made("return-spring")
    assert known == ("spring-force",)
    assert par.spring_stiffness == pytest.approx(0.22 * 600.0 / 0.2)
    assert -par.spring_stiffness * par.spring_rest == pytest.approx(0.198 * 600.0)


def test_a_weight_is_a_share_of_the_full_force_and_has_mass() -> None:
    """Outward on a friction rig; either way, drawn, on an axis."""
    weight = 0.128 * 600.0
    for kind, side in (("friction", 1.0), ("axis", -1.0)):
        par, known = made("hanging-load", kind)
        assert known == ("constant-force",)
        assert par.constant_force == pytest.approx(side * weight)
        assert par.mass == pytest.approx(2.0 + weight / 9.81)


def test_a_tank_of_litres_feeds_through_a_hose_of_metres() -> None:
    par, known = made("tank", "valve")
    assert known == ("line-delay", "critical-ratio")
    assert (par.supply_volume, par.regulator_conductance) == (pytest.approx(1.52e-3), 0.0)
    assert (par.line_delay, par.critical_ratio) == (pytest.approx(0.0114), pytest.approx(0.24))


@pytest.mark.parametrize(
    ("name", "code", "factor", "exponent"),
    [("5/3", FIVE_THREE, 1.024, 1.1 + 0.12 * 0.08), ("two-valves", TWO_VALVES, 1.05, 1.1 + 0.25 * 0.08)],
)
def test_a_second_path_is_nearly_the_first_ones(name: str, code: float, factor: float, exponent: float) -> None:
    par, _ = made(name)
    assert par.arrangement == code
    assert par.effective_area_2 == pytest.approx(2e-6 * factor)
    assert par.overlap_2 == pytest.approx(0.2 * factor)
    assert par.exponent_2 == pytest.approx(exponent)
    flat = PAR._replace(exponent=1.0)
    assert made(name, par=flat, rng=Chosen(0.1))[0].exponent_2 == 1.0


@pytest.mark.parametrize(("name", "null"), [("5/3", 0.0), ("5/3-5V", 5.0), ("5/3-null", 5.03)])
def test_an_unstated_null_is_close_to_the_usual_one(name: str, null: float) -> None:
    assert made(name)[0].command_null == pytest.approx(null)


def test_the_pipeline_file_states_switching_valves() -> None:
    assert [made(name)[0].switching for name in ("usual", "switching")] == [0.0, 1.0]


def test_the_usual_rig_is_drawn_within_these_ranges() -> None:
    par = cases.draw_rig("axis", False, RNG)
    area = 5.5e-4 + 0.6 * 6.5e-4
    wanted = {
        "supply": 7.24e5, "piston_area_1": area, "piston_area_2": area, "dead_volume_1": 32e-6, "dead_volume_2": 32e-6,
        "mass": 2.92, "coulomb": 18.8, "viscous": 66.0, "effective_area": 1.82e-6, "overlap": 0.212, "exponent": 1.15,
    }  # fmt: skip
    assert {name: getattr(par, name) for name in wanted} == pytest.approx(wanted)
    straight = cases.draw_rig("axis", True, RNG)
    assert (straight.overlap, straight.exponent) == (0.0, 1.0)
    assert cases.draw_rig("friction", False, RNG).overlap == 0.0
    assert [cases.is_linear(p, "axis") for p in (par, straight)] == [False, True]
    assert not cases.is_linear(straight, "friction")


def test_sensors_and_vessels_are_of_the_rigs_size() -> None:
    double = RigScaling(length=2.0, area=3.0, pressure=4.0)
    found = cases.draw_sensors(parse("rate-500Hz+bits-12+drift+outliers"), double, RNG, RNG)
    assert (found.rate, found.bits, found.drift, found.outliers) == (500.0, 12, 4.0, 5e-4)
    assert (found.pressure, found.pole, found.hum) == (1000.0, 0.0, 0.0)
    assert cases.draw_vessel(double, RNG) == pytest.approx(198e-6 * 6.0)


def test_a_wider_rig_has_the_same_commands_and_pressures() -> None:
    wide = RigScaling(area=3.0).scale_rig(PAR._replace(overlap=0.2))
    assert (wide.overlap, wide.stroke, wide.supply) == pytest.approx((0.2, PAR.stroke, PAR.supply))
    assert (wide.piston_area_1, wide.mass) == pytest.approx((3.0 * PAR.piston_area_1, 3.0 * PAR.mass))


def test_a_stroke_is_stated_wrong_in_half_of_the_cases() -> None:
    assert cases.draw_stated_stroke(0.2, RNG) is None
    assert cases.draw_stated_stroke(0.2, OFTEN) == pytest.approx(0.2 * 0.999)


def test_walls_and_the_critical_ratio_are_drawn_and_named_in_the_pipeline_file() -> None:
    par, known = made("wall-heat+free-b+5/3")
    assert known == ("heat-transfer", "critical-ratio")
    assert (par.wall_coefficient, par.critical_ratio) == (pytest.approx(44.0), pytest.approx(0.36))
    assert par.arrangement == FIVE_THREE


def test_a_valve_with_a_pressure_loop_spans_most_of_the_supply() -> None:
    """600 kPa: 89 % of it, fully open at an error of 9.6 % of it."""
    par, known = made("regulated-valve")
    assert known == ()
    assert (par.regulated_span, par.regulated_band) == (pytest.approx(5.34e5), pytest.approx(0.576e5))
    assert (par.valve_lag, par.command_null) == (pytest.approx(4.8e-3), 5.0)


def test_a_pump_delivers_about_what_the_valve_would_let_in_and_stalls_below_the_supply() -> None:
    par, _ = made("pump")
    assert par.pump_flow == pytest.approx(0.84 * 0.484 * 2e-6 * 7e5 * np.sqrt(2.0 / (287.0 * par.temperature)))
    assert 1.0 / par.pump_clearance == pytest.approx(0.94 * 6e5)
    assert cases.draw_stated_stall(par, RNG) == pytest.approx(par.ambient + 1.02 / par.pump_clearance)


def test_an_encoder_has_one_of_the_steps_of_linear_encoders_whatever_the_size_of_the_rig() -> None:
    fine = cases.draw_sensors(parse("encoder"), RigScaling(length=0.5), RNG, RNG)
    assert fine.position_step == pytest.approx(0.2e-6)
    steps = {
        cases.draw_sensors(parse("encoder"), RigScaling(), RNG, np.random.default_rng(k)).position_step
        for k in range(30)
    }
    assert steps == set(cases.ENCODER_STEPS)


def test_a_bench_tests_the_valve_unless_the_condition_says_that_there_was_none() -> None:
    has = [
        cases.has_bench(PAR, kind, parse(name))
        for kind, name in (("axis", "usual"), ("axis", "no-bench-test"), ("friction", "usual"))
    ]
    assert has == [True, False, False]


def test_nothing_of_an_arrangement_is_without_a_code() -> None:
    assert cases.ARRANGEMENT_CODES == {"5/3": FIVE_THREE, "two": TWO_VALVES}


# --- what is recorded of a rig, and how large it is: drawn at one place of every range, so that it can be calculated


RECORDING_PROGRAMME_PAR = Parameters()._replace(
    overlap=0.2, effective_area=2e-6, piston_area_1=8e-4, piston_area_2=6e-4, constant_force=30.0,
    spring_stiffness=200.0, spring_rest=0.05,
)  # fmt: skip
SIMILAR = RigScaling(length=2.0, area=1.0, pressure=3.0, supply=1.0, command=0.5)


def programme(
    conditions: str = "usual", arrangement: int = ONE_CHAMBER, vessel: float | None = 2e-4, kind: str = "axis"
) -> RecordingProgramme:
    par = RECORDING_PROGRAMME_PAR._replace(arrangement=arrangement)
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
    assert np.abs(takes[0].excitation.command).max() == RECORDING_PROGRAMME_PAR.command_range


LOAD = 30.0 + 200.0 * (0.1 - 0.05)


def test_an_axis_is_driven_in_a_closed_loop_that_balances_its_load() -> None:
    """Gain of 160 V/m over twice the length at half the command; 1.84 bar times three."""
    move = programme()._driven(8000)
    wanted = closed_loop(
        RECORDING_PROGRAMME_PAR,
        two_sine_reference(RNG, 8000, RECORDING_PROGRAMME_PAR.stroke),
        160.0 * 0.5 / 2.0,
        1.84e5 * 3.0,
        LOAD,
    )
    assert np.array_equal(move.command, wanted.command)
    assert (move.gain, move.pressure_1, move.pressure_2) == (wanted.gain, wanted.pressure_1, wanted.pressure_2)
    assert move.command.size == 8000


def test_a_thick_rod_has_the_higher_pressure_on_its_side() -> None:
    move = programme("differential")._driven(100)
    assert move.pressure_1 == pytest.approx(RECORDING_PROGRAMME_PAR.ambient + 0.75 * 1.84e5 * 3.0)


def test_a_spring_returns_the_piston_against_an_open_chamber() -> None:
    move = programme("return-spring")._driven(100)
    wanted = single_acting(
        RECORDING_PROGRAMME_PAR, two_sine_reference(RNG, 100, RECORDING_PROGRAMME_PAR.stroke), 40.0, LOAD
    )
    assert (move.chamber_2_open, move.pressure_1, move.gain) == (True, wanted.pressure_1, wanted.gain)
    assert move.pressure_1 == pytest.approx(RECORDING_PROGRAMME_PAR.ambient + LOAD / 8e-4)
    assert move.pressure_2 == RECORDING_PROGRAMME_PAR.ambient


@pytest.mark.parametrize("arrangement", [FIVE_THREE, TWO_VALVES])
def test_two_driven_chambers_have_half_the_gain_and_nearly_twice_the_pressure(arrangement: int) -> None:
    """A second valve of its own swings by 6 % of the command over 2.2 s about the opposite of the first."""
    move = programme(arrangement=arrangement)._driven(4000)
    assert move.gain == pytest.approx(0.5 * 40.0)
    assert move.pressure_1 == pytest.approx(RECORDING_PROGRAMME_PAR.ambient + 1.8 * 1.84e5 * 3.0)
    swing = 0.06 * RECORDING_PROGRAMME_PAR.command_range * np.sin(2 * np.pi * (1e-3 * np.arange(4000) / 2.2 + 0.6))
    assert move.command_2 == pytest.approx(swing if arrangement == TWO_VALVES else np.zeros(1), abs=1e-12)


@pytest.mark.parametrize(("conditions", "arrangement", "top"), [("ends", 0, 0.5), ("ends+return-spring", 0, 1.14)])
def test_at_its_ends_the_reference_goes_beyond_them_but_where_air_is_shut_in(
    conditions: str, arrangement: int, top: float
) -> None:
    one = programme(conditions, arrangement)
    wanted = back_and_forth_reference(
        RNG, 5000, 0.65, (-0.14 * RECORDING_PROGRAMME_PAR.stroke, top * RECORDING_PROGRAMME_PAR.stroke)
    )
    assert one._reference(5000) == pytest.approx(wanted)
    open_ = programme(conditions, FIVE_THREE)._reference(5000)
    assert open_ == pytest.approx(
        back_and_forth_reference(
            RNG, 5000, 0.65, (-0.14 * RECORDING_PROGRAMME_PAR.stroke, 1.14 * RECORDING_PROGRAMME_PAR.stroke)
        )
    )
    assert programme("ends", FIVE_THREE)._driven(100).pressure_1 == pytest.approx(
        RECORDING_PROGRAMME_PAR.ambient + 1.8 * 1.4 * 1.84e5 * 3.0
    )


def test_stick_slip_fills_at_two_rates_from_15_percent_of_the_stroke() -> None:
    moves = [t.excitation for t in programme(kind="friction")._stick_slip()]
    position = 0.15 * RECORDING_PROGRAMME_PAR.stroke
    load = 30.0 + 200.0 * (position - 0.05)
    for move, rate in zip(moves, (6.8e3, 12e3), strict=True):
        wanted = stick_slip(RECORDING_PROGRAMME_PAR, rate * 3.0, position, load=load)
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
