"""The rules that make a controller from a model and requirements, each by itself."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pneucli.controller.layout import COMPONENT_SWITCHES, DELAY_LINE_SAMPLES
from pneucli.design import cascade_design
from pneucli.design.bandwidths import (
    DELAY_UNCERTAINTY,
    SPOOL_LEAD,
    UNMODELLED_DELAY,
    Bandwidths,
    Timing,
    choose_bandwidths,
    valve_compensation,
)
from pneucli.design.cascade_design import axis_parameters, inverse_table, stiction_parameters
from pneucli.design.effect_compensation import DwellStrengthening
from pneucli.design.gains import LOAD_OBSERVER_RATIO, controller_gains
from pneucli.design.reference_limits import (
    STOPPING_TIME_CONSTANTS,
    chamber_2_pressure,
    reachable_speed_and_gradient,
    reference_limits,
)
from pneucli.design.requirements import Requirements, read_requirements
from pneucli.errors import InputError
from pneucli.physics.effects import catalogue
from pneucli.simulate.valve_forms.area import ValveArea
from tests.design import axis

MODEL = axis.model()
PLAIN = Requirements()
VALUES = axis.controller().values
CORNERS = Bandwidths(100.0, 10.0, 80.0, 12.0)
HELD = 0.5e-3  # s: half a sample of 1 ms
PROMPT = Timing(0.0, 0.0, 0.0, 0.0, 0.0, UNMODELLED_DELAY)


def having(**values: float) -> Any:
    """The axis with the effects that these parameters belong to."""
    names = {name.partition(".")[0] for name in values}
    effects = tuple(catalogue()[name] for name in sorted(names | {e.name for e in MODEL.effects}))
    return replace(MODEL, effects=effects).with_values(values)


def corners(model: Any = MODEL, **wanted: Any) -> Bandwidths:
    return choose_bandwidths(model, replace(PLAIN, **wanted), {"C_COULOMB": 15.0, "C_MASS": 2.0})


def test_loops_stand_half_a_sample_of_the_hold_beside_what_no_model_tells_of_a_valve() -> None:
    """2 ms that no model tells: 0.7 / (2 + 0.5) ms at 1 ms, 0.7 / (2 + 1) ms at 2 ms."""
    assert (corners().pressure, corners(period=2e-3).pressure) == pytest.approx((280.0, 700.0 / 3.0))
    found = corners(period=2e-3)
    assert found == Bandwidths(found.pressure, found.pressure / 10.0, found.pressure, found.pressure / 7.5)


def test_a_sample_takes_away_at_most_four_fifths_of_an_error_of_pressure() -> None:
    assert corners(period=5e-3).pressure == pytest.approx(0.7 / 4.5e-3)
    assert corners(period=20e-3).pressure == pytest.approx(0.8 / 20e-3)


@pytest.mark.parametrize(
    ("name", "left"),
    [
        ("valve-lag.time_constant", 0.03 / SPOOL_LEAD),
        ("line-delay.delay", 0.03 * DELAY_UNCERTAINTY),
        ("pressure-lag.time_constant", 0.0),
        ("time-skew.delay", 0.015 * DELAY_UNCERTAINTY),
    ],
)
def test_what_is_not_predicted_of_a_lag_slows_them(name: str, left: float) -> None:
    late = corners(having(**{name: 0.03}), delay=0.01)
    assert late.pressure == pytest.approx(0.7 / (UNMODELLED_DELAY + HELD + left + 0.01 * DELAY_UNCERTAINTY), rel=0.02)


def test_of_a_switching_valves_dead_times_the_shorter_one_is_predicted() -> None:
    """Of 10 and 30 ms the 20 ms between them slow the loops, whichever edge is the slower one."""
    for opens, shuts in ((0.01, 0.03), (0.03, 0.01)):
        late = corners(having(**{"switching-time.open": opens, "switching-time.close": shuts}))
        left = 0.02 + 0.01 * DELAY_UNCERTAINTY
        assert late.pressure == pytest.approx(0.7 / (UNMODELLED_DELAY + HELD + left))


@pytest.mark.parametrize(("name", "over"), [("line-delay.delay", 1.0), ("time-skew.delay", 1.0)])
def test_a_delay_longer_than_what_is_remembered_counts_whole(name: str, over: float) -> None:
    late, longest = having(**{name: 0.03}), (DELAY_LINE_SAMPLES - 2) * 1e-4
    share = DELAY_UNCERTAINTY * (0.03 if name.startswith("line") else 0.015)
    assert corners(late, period=1e-4).pressure == pytest.approx(
        0.7 / (UNMODELLED_DELAY + 0.1 * HELD + share + over * (0.03 - longest))
    )


def test_a_spool_that_lags_is_led_by_what_a_sample_brings_of_its_way() -> None:
    found = valve_compensation(MODEL, PLAIN, replace(PROMPT, lag=4e-3, led_lag=2e-3, flow_delay=3e-3))
    assert found["C_SPOOL_SHARE"] == pytest.approx(1.0 - math.exp(-0.25))
    assert found["C_SPOOL_MEAN_SHARE"] == pytest.approx(1.0 - 4.0 * (1.0 - math.exp(-0.25)))  # over the sample
    assert found["C_SPOOL_LEAD"] == pytest.approx(1.0 - math.exp(-0.5))
    assert found["C_FLOW_DELAY"] == pytest.approx(3.0)
    at_once = valve_compensation(MODEL, PLAIN, PROMPT)
    assert {at_once[f"C_SPOOL_{name}"] for name in ("SHARE", "MEAN_SHARE", "LEAD")} == {1.0}


def test_stated_bandwidths_overrule() -> None:
    both = corners(pressure_bandwidth=20.0, position_bandwidth=3.0)
    assert (both.pressure, both.position) == (pytest.approx(40 * math.pi), pytest.approx(6 * math.pi))
    assert corners(pressure_bandwidth=20.0).position == pytest.approx(40 * math.pi / 10.0)


@pytest.mark.parametrize(("noise_x", "quantum_x"), [(1e-5, 0.0), (0.0, 12**0.5 * 1e-5), (0.6e-5, 0.8 * 12**0.5 * 1e-5)])
def test_noise_of_position_slows_the_observer_of_motion(noise_x: float, quantum_x: float) -> None:
    """So that 10 um are worth a tenth of the dry friction: sqrt(1.5 N / (2 kg 1e-5 m))."""
    slow = corners(noise_x=noise_x, quantum_x=quantum_x)
    assert slow.motion_observer == pytest.approx(math.sqrt(1.5 / 2e-5))
    assert slow.pressure == corners().pressure


def test_without_dry_friction_noise_has_no_measure() -> None:
    assert (
        choose_bandwidths(MODEL, replace(PLAIN, noise_x=1e-5), {"C_COULOMB": 0.0, "C_MASS": 2.0}).motion_observer
        == 280.0
    )


# --- gains


def test_the_position_loop_has_the_poles_of_the_rule() -> None:
    """(s + w)(s^2 + 2 d w s + w^2) with w = 10 and d = 0.7."""
    found = controller_gains(CORNERS, {"C_MASS": 2.0}, replace(PLAIN, damping=0.7), PROMPT)
    wanted = np.polymul([1.0, 10.0], [1.0, 14.0, 100.0])
    assert [1.0, found["C_KD"], found["C_KP"], found["C_KI"]] == pytest.approx(wanted)


def test_observers_have_their_poles_that_of_the_load_a_calmer_one() -> None:
    """Of x, v and load (a double integrator with a constant disturbance), and of a pressure with a constant flow."""
    h, mass = 1e-3, 2.0
    found = controller_gains(CORNERS, {"C_MASS": mass}, PLAIN, PROMPT)
    predict = np.array([[1.0, h, h * h / (2 * mass)], [0.0, 1.0, h / mass], [0.0, 0.0, 1.0]])
    innovation = np.array([[found["C_OBS_X"]], [found["C_OBS_V"]], [found["C_OBS_LOAD"]]])
    error = (np.eye(3) - innovation @ np.array([[1.0, 0.0, 0.0]])) @ predict
    poles = [math.exp(-80.0 * h)] * 2 + [math.exp(-LOAD_OBSERVER_RATIO * 100.0 * h)]
    assert np.poly(error) == pytest.approx(np.poly(poles), rel=1e-6)
    assert found["C_OBS_P"] == pytest.approx(1.0 - math.exp(-0.1))
    assert found["C_OBS_FLOW"] == pytest.approx((1.0 - math.exp(-0.012)) ** 2 / h)


def test_the_pressure_loop_is_a_pi_with_a_sixth_of_its_corner() -> None:
    found = controller_gains(CORNERS, {"C_MASS": 2.0}, PLAIN, PROMPT)
    assert (found["C_P_KP"], found["C_P_KI"]) == (100.0, pytest.approx((100.0 / 6) ** 2))


# --- the reference and standstill


def test_the_reference_keeps_to_what_the_valve_can_do() -> None:
    speed, rate = reachable_speed_and_gradient(VALUES)
    found = reference_limits(CORNERS, VALUES, PLAIN)
    assert found["C_V_MAX"] == pytest.approx(0.7 * speed)
    assert found["C_A_MAX"] == pytest.approx(found["C_V_MAX"] * 100.0 / STOPPING_TIME_CONSTANTS)
    assert found["C_SHAPING_TIME"] == pytest.approx(1e-2)
    fast = reference_limits(replace(CORNERS, pressure=1e4), VALUES, PLAIN)
    assert fast["C_A_MAX"] == pytest.approx(VALUES["C_AREA_1"] * rate / (2 * 10.0 * VALUES["C_MASS"]))
    assert fast["C_SHAPING_TIME"] == pytest.approx(4e-3)
    assert found["C_FLOW_STEP_MAX"] == pytest.approx(0.05 * rate)
    stated = reference_limits(CORNERS, VALUES, replace(PLAIN, max_speed=0.2, max_acceleration=3.0))
    assert (stated["C_V_MAX"], stated["C_A_MAX"]) == (0.2, 3.0)


@pytest.mark.parametrize("rod", [0.0, 0.3])
def test_the_speed_that_both_directions_reach_keeps_the_pressures_constant(rod: float) -> None:
    """At the worst place the slower direction feeds just what the motion takes (2.47), chamber 2's spring included."""
    known = VALUES | {"C_AREA_2": (1.0 - rod) * VALUES["C_AREA_1"]}
    speed, rate = reachable_speed_and_gradient(known)
    worst = []
    for x in np.linspace(0.2, 0.8, 25) * known["C_STROKE"]:
        p2 = float(chamber_2_pressure(known, np.array([x]))[0])
        a1, a2 = known["C_AREA_1"], known["C_AREA_2"]
        p1 = (a2 * p2 + (a1 - a2) * known["C_AMBIENT"]) / a1
        if not 1.3 * known["C_AMBIENT"] <= p1 <= 0.85 * known["C_SUPPLY"]:
            continue
        v1, v2 = known["C_DEAD_VOLUME_1"] + a1 * x, known["C_DEAD_VOLUME_2"] + a2 * (known["C_STROKE"] - x)
        most = []
        for up, down, area in (
            (known["C_SUPPLY"], p1, known["C_AREA_FILL"]), (p1, known["C_AMBIENT"], known["C_AREA_VENT"]),
        ):  # fmt: skip
            share = math.sqrt(
                1
                - (
                    (max(down / up, known["C_CRITICAL_RATIO"]) - known["C_CRITICAL_RATIO"])
                    / (1 - known["C_CRITICAL_RATIO"])
                )
                ** 2
            )
            most.append(known["C_GAMMA_R_T"] * known["C_K_GAS"] * 0.484 * share * up * area / v1)
        taken = known["C_GAMMA"] * (p1 * a1 / v1 + a2 / a1 * p2 * a2 / v2)
        worst.append((min(most) / taken, min(most)))
    assert speed == pytest.approx(min(s for s, _ in worst))
    assert rate == pytest.approx(min(r for _, r in worst))


def test_where_no_pressure_lies_within_range_all_places_count() -> None:
    """Chamber 2 at 6.9 bar needs as much in chamber 1: taken as 0.85 of the supply, all along the stroke."""
    high = VALUES | {"C_TWO_VALVES": 1.0, "C_P_MEAN": 6.9e5}
    a1, a2, p1 = VALUES["C_AREA_1"], VALUES["C_AREA_2"], 0.85 * VALUES["C_SUPPLY"]
    scale, speeds, rates = VALUES["C_GAMMA_R_T"] * VALUES["C_K_GAS"] * 0.484, [], []
    for x in np.linspace(0.2, 0.8, 25) * VALUES["C_STROKE"]:
        v1, v2 = VALUES["C_DEAD_VOLUME_1"] + a1 * x, VALUES["C_DEAD_VOLUME_2"] + a2 * (VALUES["C_STROKE"] - x)
        share = math.sqrt(1.0 - ((0.85 - VALUES["C_CRITICAL_RATIO"]) / (1.0 - VALUES["C_CRITICAL_RATIO"])) ** 2)
        flows = VALUES["C_AREA_FILL"] * VALUES["C_SUPPLY"] * share, VALUES["C_AREA_VENT"] * p1
        rates.append(scale * min(flows) / v1)
        speeds.append(rates[-1] / (VALUES["C_GAMMA"] * (p1 * a1 / v1 + 6.9e5 * a2 * a2 / (a1 * v2))))
    assert reachable_speed_and_gradient(high) == (pytest.approx(min(speeds)), pytest.approx(min(rates)))


@pytest.mark.parametrize("x", [0.05, 0.1, 0.17])
def test_a_closed_chamber_2_is_an_isentropic_spring(x: float) -> None:
    volume = VALUES["C_DEAD_VOLUME_2"] + VALUES["C_AREA_2"] * (VALUES["C_STROKE"] - x)
    middle = VALUES["C_DEAD_VOLUME_2"] + VALUES["C_AREA_2"] * VALUES["C_STROKE"] / 2
    p = chamber_2_pressure(VALUES, np.array([x]))
    assert p * volume ** VALUES["C_GAMMA"] == pytest.approx(VALUES["C_P_MEAN"] * middle ** VALUES["C_GAMMA"])
    two = chamber_2_pressure({**VALUES, "C_TWO_VALVES": 1.0}, np.array([x]))
    assert two.tolist() == [VALUES["C_P_MEAN"]]


KNOWN = {
    "C_STATIC": 20.0, "C_COULOMB": 16.0, "C_V_MAX": 0.5, "C_AREA_1": 8e-4, "C_SUPPLY": 7e5, "C_AMBIENT": 1e5,
    "C_STROKE": 0.2, "C_MASS": 2.0, "C_KD": 30.0, "C_KI": 1e4,
}  # fmt: skip


def still(**wanted: Any) -> dict[str, float]:
    return stiction_parameters(CORNERS, KNOWN, replace(PLAIN, **wanted), 0.0, DwellStrengthening(1.0, 0.0))


@pytest.mark.parametrize(
    ("wanted", "tolerance"),
    [({}, 1e-5), ({"quantum_x": 1e-5}, 2e-5), ({"noise_x": 5e-6}, 2e-5), ({"tolerance": 4e-5, "noise_x": 1.0}, 4e-5)],
)
def test_the_tolerance_is_what_the_sensor_can_tell(wanted: dict[str, float], tolerance: float) -> None:
    found = still(**wanted)
    assert found["C_HOLDING_BAND"] == pytest.approx(0.5 * tolerance)
    assert found["C_RAMP_RATE_PER_ERROR"] == pytest.approx(
        5.0 / (5.0 * 0.5 * tolerance)
    )  # the slow pace, five reaches off
    least = tolerance if "tolerance" not in wanted else max(1e-5, 4.0 * wanted["noise_x"])
    assert found["C_MOTION_STEP"] == pytest.approx(0.5 * least)


@pytest.mark.parametrize(("tolerance", "gain"), [(None, 10.0), (2e-5, 5.0), (2e-4, 1.0 / 0.9)])
def test_a_dead_band_grows_as_far_whatever_the_tolerance_or_to_it(tolerance: float | None, gain: float) -> None:
    assert still(tolerance=tolerance)["C_DEADBAND_GAIN_MAX"] == pytest.approx(gain)


def test_forces_at_standstill_are_multiples_of_the_breakaway_force() -> None:
    """Of 20 N; at a corner of 100 rad/s a quarter of it a second, and ten times it where it surely holds."""
    found = still()
    assert found["C_RAMP_RATE_MIN"] == pytest.approx(5.0)
    assert found["C_RAMP_RATE_MAX"] == pytest.approx(200.0)
    assert found["C_PRESSURE_BAND"] == pytest.approx(2.0 / 8e-4)
    assert found["C_LOAD_STEP_MAX"] == pytest.approx(max(5.0, 5.6))
    assert (
        stiction_parameters(CORNERS, KNOWN | {"C_STATIC": 40.0}, PLAIN, 0.0, DwellStrengthening(1.0, 0.0))[
            "C_LOAD_STEP_MAX"
        ]
        == 10.0
    )


def test_a_force_rises_faster_than_a_known_dwell_raises_what_holds_and_expects_no_more_than_static_friction() -> None:
    """Twice as much after a long rest, at 2/s to begin with: five times that rate is 200 N/s."""
    dwells, not_ = (
        stiction_parameters(CORNERS, KNOWN, PLAIN, 0.0, d)
        for d in (DwellStrengthening(2.0, 2.0), DwellStrengthening(1.0, 0.0))
    )
    assert (dwells["C_RAMP_RATE_MIN"], dwells["C_BREAKAWAY_MAX"]) == pytest.approx((200.0, 20.0))
    assert not_["C_BREAKAWAY_MAX"] == 40.0
    assert dwells["C_RELEASE_FORCE_MAX"] - not_["C_RELEASE_FORCE_MAX"] == pytest.approx(60.0)


@pytest.mark.parametrize(("period", "ratio", "steep"), [(1e-3, 2.0, 20.0), (1e-3, 4.0, 20.0), (0.02, 2.0, 10.0)])
def test_the_sector_is_no_steeper_than_sampling_and_the_pressure_loop_allow(
    period: float, ratio: float, steep: float
) -> None:
    found = still(period=period, sector_ratio=ratio)
    assert (found["C_SECTOR_1"], found["C_SECTOR_2"]) == (pytest.approx(steep / ratio), pytest.approx(steep))


def test_the_least_speed_is_two_quanta_a_sample_or_a_hundredth_of_the_largest() -> None:
    assert still()["C_V_FLOOR"] == pytest.approx(5e-3)
    assert still(quantum_x=1e-5)["C_V_FLOOR"] == pytest.approx(0.02)
    assert still()["C_MOTION_WINDOW"] == pytest.approx(0.06)


# --- the axis and the valve


def test_what_effects_know_of_the_axis_goes_into_the_controller() -> None:
    known = having(**{"extra-mass.mass": 0.5, "dead-volume.volume_added": 1e-5, "critical-ratio.critical_ratio": 0.3})
    found = axis_parameters(known, replace(PLAIN, period=2e-3, chamber_2="valve"), (2e-6, 1e-6, 4e-6, 3e-6), 2.5e5)
    rig, base = axis.RIG, MODEL.base_values()
    rt = base["rig.gas_constant"] * rig.gas_temperature
    assert found == {
        "C_PERIOD": 2e-3, "C_U_MAX": 10.0, "C_TWO_VALVES": 1.0,
        **dict.fromkeys(COMPONENT_SWITCHES, 1.0), "C_PRESSURE_MODE": 0.0,
        "C_MASS": pytest.approx(rig.moving_mass + 0.5), "C_AREA_1": rig.piston_area_1, "C_AREA_2": rig.piston_area_2,
        "C_STROKE": rig.stroke, "C_DEAD_VOLUME_1": pytest.approx(rig.dead_volume_1 + 1e-5),
        "C_DEAD_VOLUME_2": rig.dead_volume_2,
        "C_AMBIENT": rig.ambient_pressure, "C_SUPPLY": rig.supply_pressure, "C_GAMMA": base["rig.heat_capacity_ratio"],
        "C_GAMMA_R_T": pytest.approx(base["rig.heat_capacity_ratio"] * rt), "C_K_GAS": pytest.approx((2 / rt) ** 0.5),
        "C_CRITICAL_RATIO": 0.3, "C_COULOMB": axis.TRUTH["coulomb"], "C_STATIC": pytest.approx(axis.TRUTH["static"]),
        "C_STRIBECK": pytest.approx(axis.TRUTH["stribeck_velocity"]), "C_VISCOUS": axis.TRUTH["viscous"],
        "C_VISCOUS_BACK": axis.TRUTH["viscous"], "C_DECELERATION_RATIO": -1.0, "C_DRY_P1": 0.0, "C_DRY_P2": 0.0,
        **dict.fromkeys(("C_SCALE_1", "C_SCALE_2"), pytest.approx(1.0)), "C_OFFSET_1": pytest.approx(0.0, abs=1e-6),
        "C_OFFSET_2": pytest.approx(0.0, abs=1e-6),
        **dict.fromkeys(("C_LEAK_1", "C_LEAK_2", "C_LEAK_12", "C_LEAK_VALVE"), 0.0),
        "C_P_LOW": pytest.approx(1.01 * rig.ambient_pressure), "C_P_HIGH": pytest.approx(0.99 * rig.supply_pressure),
        "C_P_MEAN": 2.5e5, "C_AREA_FILL": 2e-6, "C_AREA_VENT": 1e-6, "C_AREA_FILL_2": 4e-6,
        "C_AREA_VENT_2": 3e-6, "C_MIRRORED": 0.0, "C_TABLE_NODES": 201.0, "C_STROKE_NODES": 101.0,
        "C_AIR_STIFFNESS": 0.0,
    }  # fmt: skip


def test_without_effects_the_controller_knows_the_base_alone() -> None:
    plain = replace(MODEL, effects=(), values={"friction.coulomb": 15.0, "friction.viscous": 50.0})
    found = axis_parameters(plain, PLAIN, (2e-6, 1e-6, 4e-6, 3e-6), None)
    assert (found["C_STATIC"], found["C_TWO_VALVES"]) == (15.0, 0.0)
    assert found["C_MASS"] == axis.RIG.moving_mass
    assert found["C_CRITICAL_RATIO"] == plain.base_values()["valve.critical_ratio"]
    assert found["C_P_MEAN"] == pytest.approx(math.sqrt(axis.RIG.ambient_pressure * axis.RIG.supply_pressure))
    low = having(**{"stribeck.static": 5.0})
    assert axis_parameters(low, PLAIN, (2e-6, 1e-6, 4e-6, 3e-6), None)["C_STATIC"] == axis.TRUTH["coulomb"]


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_inverse_table_leads_back_to_its_areas(direction: float) -> None:
    """201 commands whose areas are even over the root, from the closing edge to the largest command tested."""
    commands, largest = inverse_table(MODEL, MODEL.valve, direction)
    assert len(commands) == 201
    assert commands[-1] == direction * 10.0
    assert largest == pytest.approx(axis.area(10.0), rel=1e-3)
    wanted = largest * (np.arange(201) / 200) ** 2
    assert np.abs([MODEL.valve(np.array([u]))[0] for u in commands] - wanted).max() < 2e-3 * largest
    assert commands[0] == pytest.approx(direction * axis.TRUTH["overlap"], abs=0.02)
    assert np.all(np.diff(direction * np.array(commands)) >= 0.0)


def test_each_direction_ends_at_its_own_largest_command() -> None:
    uneven = replace(MODEL, valve=ValveArea((-6.0, -3.0, 4.0, 8.0), (6e-7, 3e-7, 4e-7, 8e-7)))
    assert inverse_table(uneven, uneven.valve, 1.0)[0][-1] == 8.0
    assert inverse_table(uneven, uneven.valve, -1.0)[0][-1] == -6.0
    assert inverse_table(uneven, uneven.valve, -1.0)[1] == pytest.approx(6e-7)
    assert axis_parameters(uneven, PLAIN, (1.0, 1.0, 1.0, 1.0), None)["C_U_MAX"] == 8.0


@pytest.mark.parametrize(
    ("field", "key"),
    [
        ("piston_area_1", "cylinder.piston_area_1"),
        ("stroke", "cylinder.stroke"),
        ("dead_volume_1", "cylinder.dead_volume_1"),
        ("dead_volume_2", "cylinder.dead_volume_2"),
        ("moving_mass", "cylinder.moving_mass"),
        ("supply_pressure", "supply_pressure"),
    ],
)
def test_what_a_controller_needs_and_is_not_known_is_asked_for(field: str, key: str) -> None:
    poor = replace(MODEL, rig=replace(axis.RIG, **{field: None}))
    with pytest.raises(InputError, match=rf"(?s)\[rig\] {key}.*not known.*its value"):
        cascade_design.design_cascade(poor, axis.REQUIREMENTS)


def test_what_was_identified_need_not_be_stated() -> None:
    poor = replace(MODEL, rig=replace(axis.RIG, moving_mass=None, supply_pressure=None))
    cascade_design._require(poor.with_values({"rig.moving_mass": 2.0, "rig.supply_pressure": 7e5}))


@pytest.mark.parametrize("commands", [(2.0, 5.0), (-5.0, -2.0)])
def test_a_valve_known_in_one_direction_controls_nothing(commands: tuple[float, float]) -> None:
    one = replace(MODEL, valve=ValveArea(commands, (1e-7, 2e-7)))
    with pytest.raises(InputError, match=r"(?s)the valve.*both directions.*recordings that fill and that vent"):
        cascade_design._require(one)


# --- requirements


def test_requirements_are_read_with_their_units_over_what_is_known() -> None:
    table = {
        "period": "2 ms", "tolerance": "20 um", "pressure_bandwidth": "30 Hz", "damping": 0.7, "max_speed": "0.4 m/s",
        "max_acceleration": "3 m/s^2", "delay": "1 ms", "chamber_2": "valve", "position_bandwidth": "3 Hz",
        "sector_ratio": 3, "noise_x": "0 um", "quantum_x": "1 um",
    }  # fmt: skip
    assert read_requirements(table, "here", noise_p=400.0, noise_x=1.0) == Requirements(
        2e-3, pytest.approx(2e-5), 30.0, 3.0, 0.7, 3.0, 0.4, 3.0, 0.0, pytest.approx(1e-6), 400.0, 1e-3, "valve"
    )
    assert read_requirements({}, "here") == Requirements(
        1e-3, None, None, None, 1.0, 2.0, None, None, 0.0, 0.0, 0.0, 0.0, "closed"
    )


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ({"chamber_2": "ajar"}, r"here\.chamber_2: 'ajar'.*\"closed\", \"open\" or \"valve\""),
        ({"peroid": "1 ms"}, r"here\.peroid: unknown key.*period"),
        ({"period": "1 m"}, r"here\.period.*a quantity such as \"1 s\""),
        ({"damping": 0}, r"here\.damping: 0.*above 0"),
        ({"sector_ratio": 1}, r"here\.sector_ratio: 1.*above 1: the slope of one line"),
        ({"period": "2 s"}, r"here\.period: 2 s.*from 1·10⁻⁵ s to 1 s"),
        ({"period": "5 us"}, r"here\.period: 5·10⁻⁶ s.*from 1·10⁻⁵ s to 1 s"),
        ({"max_speed": "-1 m/s"}, r"here\.max_speed: −1.*above 0"),
    ],
)
def test_a_requirement_that_cannot_be_read_says_how_to_mend_it(table: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=f"(?s){says}"):
        read_requirements(table, "here")


@pytest.mark.parametrize("period", ["10 us", "1 s"])
def test_the_longest_and_the_shortest_period_are_allowed(period: str) -> None:
    assert read_requirements({"period": period}, "here").period in (1e-5, pytest.approx(1e-5), 1.0)


@pytest.mark.parametrize(
    "name", ["valve-lag.time_constant", "line-delay.delay", "pressure-lag.time_constant", "time-skew.delay"]
)
def test_loops_that_predict_nothing_are_slowed_by_every_lag_as_it_is(name: str) -> None:
    known, axis_numbers = having(**{name: 0.03}), {"C_COULOMB": 15.0, "C_MASS": 2.0}
    late = choose_bandwidths(known, PLAIN, axis_numbers, predicted=False)
    assert late.pressure == pytest.approx(0.7 / (0.03 + UNMODELLED_DELAY + HELD), rel=0.1)
    assert late.pressure < 0.8 * choose_bandwidths(known, PLAIN, axis_numbers).pressure


def test_what_is_elastic_gives_way_by_what_dry_friction_bends_it() -> None:
    """1.5 x 16 N over the stiffness that is known, else over 12 forces of the supply a stroke."""
    assert stiction_parameters(CORNERS, KNOWN, PLAIN, 4e4, DwellStrengthening(1.0, 0.0))[
        "C_PRESLIDING_DISTANCE"
    ] == pytest.approx(6e-4)
    assert still()["C_PRESLIDING_DISTANCE"] == pytest.approx(24.0 / (12.0 * 8e-4 * 6e5 / 0.2))


def test_the_force_on_a_seal_closes_an_error_at_the_closing_rate_or_faster_by_the_integral() -> None:
    """10 1/s of the stiffness, or 2 kg of the integral gain in 1/s^3."""
    for stiffness, gain, rate in ((4e4, 1e4, 4e5), (0.0, 1e4, 10.0 * 28800.0), (4e4, 3e5, 6e5)):
        found = stiction_parameters(CORNERS, KNOWN | {"C_KI": gain}, PLAIN, stiffness, DwellStrengthening(1.0, 0.0))
        assert found["C_ELASTIC_RATE"] == pytest.approx(rate)
