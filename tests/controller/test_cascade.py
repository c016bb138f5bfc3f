"""One sample of the controller, function by function, in round numbers: the text that is compiled and exported."""

import math

import numpy as np
import pytest

from pneucli.controller import cascade, codegen, observers, plant, standstill
from pneucli.controller import layout as at
from pneucli.controller import reference as shape

NODES = 5
ROUND = {
    "PERIOD": 1e-3,
    "U_MAX": 10.0,
    "TWO_VALVES": 0.0,
    "FEEDFORWARD": 1.0,
    "DISTURBANCE_OBSERVERS": 1.0,
    "HOLD": 1.0,
    "SWITCHING": 1.0,
    "INVERSE_MAP": 1.0,
    "PRESSURE_MODE": 0.0,
    "MASS": 2.0,
    "AREA_1": 8e-4,
    "AREA_2": 6e-4,
    "STROKE": 0.2,
    "DEAD_VOLUME_1": 2e-5,
    "DEAD_VOLUME_2": 3e-5,
    "AMBIENT": 1e5,
    "SUPPLY": 7e5,
    "GAMMA": 1.4,
    "GAMMA_R_T": 1.2e5,
    "K_GAS": 5e-3,
    "CRITICAL_RATIO": 0.5,
    "COULOMB": 10.0,
    "STATIC": 20.0,
    "STRIBECK": 0.01,
    "VISCOUS": 50.0,
    "V_FLOOR": 2e-3,
    "V_MAX": 0.5,
    "A_MAX": 5.0,
    "SHAPING_TIME": 4e-3,
    "KP": 900.0,
    "KD": 60.0,
    "KI": 2e4,
    "SECTOR_1": 20.0,
    "SECTOR_2": 40.0,
    "RAMP_RATE_PER_ERROR": 1e5,
    "RAMP_RATE_MIN": 14.0,
    "RAMP_RATE_MAX": 500.0,
    "MOTION_WINDOW": 0.02,
    "HOLDING_BAND": 1e-5,
    "MOTION_STEP": 1e-5,
    "OBS_X": 0.5,
    "OBS_V": 100.0,
    "OBS_LOAD": 1e5,
    "LOAD_STEP_MAX": 3.0,
    "P_KP": 100.0,
    "P_KI": 300.0,
    "OBS_P": 0.25,
    "OBS_FLOW": 20.0,
    "FLOW_STEP_MAX": 1e4,
    "PRESSURE_BAND": 1e3,
    "P_LOW": 1.05e5,
    "P_HIGH": 6.5e5,
    "P_MEAN": 3e5,
    "AIR_STIFFNESS": 0.0,
    "LEVEL_RATE": 1e6,
    "AREA_FILL": 2e-6,
    "AREA_VENT": 1e-6,
    "AREA_FILL_2": 2e-6,
    "AREA_VENT_2": 1e-6,
    "MIRRORED": 0.0,
    "OBS_SENSOR": 0.25,
    "SPOOL_SHARE": 1.0,
    "SPOOL_MEAN_SHARE": 1.0,
    "SPOOL_LEAD": 1.0,
    "PLAY": 0.0,
    "PLAY_DEADBAND": 0.0,
    "FLOW_DELAY": 0.0,
    "SENSOR_SHARE": 1.0,
    "SENSOR_DELAY": 0.0,
    "SCALE_1": 1.0,
    "SCALE_2": 1.0,
    "OFFSET_1": 0.0,
    "OFFSET_2": 0.0,
    "LEAK_1": 0.0,
    "LEAK_2": 0.0,
    "LEAK_12": 0.0,
    "LEAK_VALVE": 0.0,
    "VISCOUS_BACK": 50.0,
    "DECELERATION_RATIO": -1.0,
    "DRY_P1": 0.0,
    "DRY_P2": 0.0,
    "FRICTION_LEAD": 0.0,
    "PRESLIDING_DISTANCE": 5e-4,
    "RAMP_GROWTH_RATE": 10.0,
    "UNLOADING_RATE": 50.0,
    "CLOSING_RATE": 10.0,
    "ELASTIC_RATE": 4e4,
    "BRAKE_DAMPING": 100.0,
    "RELEASE_FORCE_MAX": 60.0,
    "BREAKAWAY_MAX": 40.0,
    "DEADBAND_GAIN_MAX": 10.0,
    "RELAY_BAND": 4e3,
    "RELAY_RATE": 4e5,
    "TRAVEL_LIMIT": 4e-3,
    "PRESSURE_LIMIT": 1e5,
    "FAMILY": 0.0,
    "FAMILY_MEMBERS": 0.0,
    "FAMILY_WIDTH": 0.0,
    "STROKE_NODES": 2.0,
    "TABLE_NODES": float(NODES),
}
ALONG = (1.0, 1.0, 1.0, 1.0, *6 * (0.0,))  # friction alike all over the stroke, nothing else
FILL, VENT = (1.0, 2.0, 4.0, 7.0, 10.0), (-2.0, -3.0, -5.0, -7.0, -9.0)


FILL_2, VENT_2 = (-1.0, -2.5, -4.0, -6.0, -8.0), (1.5, 2.5, 5.0, 8.0, 9.0)  # V, of a 5/3 valve's second outlet


def settings(**changed: float) -> np.ndarray:
    values = ROUND | changed
    numbers = (values[name[2:]] for name in at.PARAMETERS if name != "C_TABLE")
    second = (FILL_2, VENT_2) if values["MIRRORED"] > 0.5 else (FILL, VENT)
    return np.array([*numbers, *FILL, *VENT, *second[0], *second[1], *ALONG])


def state(**given: float) -> np.ndarray:
    s = np.zeros(len(at.STATE))
    known = {
        "STARTED": 1.0,
        "X": 0.1,
        "P1": 3e5,
        "P2": 3e5,
        "BREAKAWAY_FORCE": 20.0,
        "ANCHOR": 0.1,
        "MOVING_COUNT": 5.0,
        "RAMP_GAIN": 4.0,
        "DEADBAND_GAIN": 1.0,
        "LOOP_GAIN": 1.0,
    }
    known |= {"SENSOR_P1": 3e5, "SENSOR_P2": 3e5, "P1_REF": 3e5, "P2_REF": 3e5, "REST_TIME": 1.0}
    for name, value in (known | given).items():
        s[at.STATE.index(f"S_{name}")] = value
    observers.reset_prediction(s)
    return s


def of(s: np.ndarray, *names: str) -> list[float]:
    return [float(s[at.STATE.index(f"S_{name}")]) for name in names]


C = settings()
VOLUME_1, VOLUME_2 = 2e-5 + 8e-4 * 0.1, 3e-5 + 6e-4 * 0.1


# --- valve and piston


@pytest.mark.parametrize(("value", "wanted"), [(-2.0, -1.0), (0.3, 0.3), (9.0, 3.0), (-1.0, -1.0), (3.0, 3.0)])
def test_a_clamp_keeps_what_is_within(value: float, wanted: float) -> None:
    assert plant.clamp(value, -1.0, 3.0) == wanted


@pytest.mark.parametrize(("value", "wanted"), [(-2.0, -1.0), (0.0, 0.0), (9.0, 1.0)])
def test_a_sign_is_none_at_zero(value: float, wanted: float) -> None:
    assert plant.sign(value) == wanted


@pytest.mark.parametrize(
    ("reading", "can_be"),
    [(1.0, True), (2.0, True), (0.99, False), (2.01, False), (math.nan, False), (math.inf, False)],
)
def test_a_reading_is_usable_within_its_range(reading: float, can_be: bool) -> None:
    assert plant.is_plausible(reading, 1.0, 2.0) == can_be


@pytest.mark.parametrize(
    ("speed", "seen", "friction"), [(0.0, 30.0, 30.0), (0.01, 30.0, 20.0), (0.03, 30.0, 12.0), (0.0, 5.0, 10.0)]
)
def test_dry_friction_falls_from_the_breakaway_force_to_coulombs(speed: float, seen: float, friction: float) -> None:
    assert plant.dry_friction(speed, state(BREAKAWAY_FORCE=seen), C) == pytest.approx(friction)


def rate(filling: bool, p: float) -> float:
    """dp/dt that 1 m^2 makes (2.46), with the ratio written out; critical at 0.5."""
    up, down = (7e5, p) if filling else (p, 1e5)
    share = math.sqrt(1.0 - ((max(down / up, 0.5) - 0.5) / 0.5) ** 2)
    return 1.2e5 * 5e-3 / 1e-4 * up * 0.484 * share


@pytest.mark.parametrize("p", [1.5e5, 3e5, 5.6e5])
@pytest.mark.parametrize("filling", [True, False])
def test_an_open_valve_makes_a_gradient_by_the_flow_law(p: float, filling: bool) -> None:
    assert plant.pressure_rate_per_area(filling, p, 1e-4, state(), C) == pytest.approx(rate(filling, p))


@pytest.mark.parametrize(
    ("share", "volts"),
    [(0.0, 1.0), (1 / 16, 2.0), (1 / 64, 1.5), (0.25, 4.0), (9 / 16, 7.0), (1.0, 10.0), (0.765625, 8.5)],
)
def test_an_area_is_looked_up_between_nodes_that_are_even_over_its_root(share: float, volts: float) -> None:
    assert plant.command_for_area(share * 2e-6, 2e-6, at.C_TABLE, C) == pytest.approx(volts)


@pytest.mark.parametrize(
    ("share", "volts"), [(0.25, 4.0), (-0.25, -5.0), (1.0, 10.0), (-1.0, -9.0), (5.0, 10.0), (-5.0, -9.0)]
)
def test_the_command_opens_the_valve_as_far_as_the_gradient_needs(share: float, volts: float) -> None:
    full = 2e-6 * rate(True, 3e5) if share > 0 else 1e-6 * rate(False, 3e5)
    assert plant.valve_command(share * full, 3e5, 1e-4, state(), C) == pytest.approx(volts)


def test_no_gradient_is_the_middle_between_both_closing_edges() -> None:
    assert plant.valve_command(0.0, 3e5, 1e-4, state(), C) == pytest.approx(0.5 * (1.0 - 2.0))


def test_what_the_valve_cannot_reach_is_cut_in_both_directions() -> None:
    fill, vent = 2e-6 * rate(True, 3e5), -1e-6 * rate(False, 3e5)
    assert plant.limit_gradient_1(2.0 * fill, 3e5, 1e-4, state(), C) == pytest.approx(fill)
    assert plant.limit_gradient_1(0.5 * fill, 3e5, 1e-4, state(), C) == pytest.approx(0.5 * fill)
    assert plant.limit_gradient_1(2.0 * vent, 3e5, 1e-4, state(), C) == pytest.approx(vent)
    assert plant.limit_gradient_1(0.5 * vent, 3e5, 1e-4, state(), C) == pytest.approx(0.5 * vent)


MIRRORED = settings(MIRRORED=1.0, AREA_FILL_2=1.5e-6, AREA_VENT_2=3e-6)


def opened_share(u: float, commands: tuple[float, ...]) -> float:
    """The share of the largest area at a command: the tables hold commands at equal steps of its root."""
    order = np.argsort(commands)
    return float(np.interp(u, np.array(commands)[order], np.linspace(0.0, 1.0, NODES)[order]) ** 2)


@pytest.mark.parametrize("share", [0.002, 0.25, 0.9, 1.5, -0.002, -0.25, -0.9, -1.5])
def test_the_command_of_a_5_3_valve_inverts_the_map_of_each_chamber(share: float) -> None:
    """Both paths at that command, each by its own table, make the rate that is asked for, or all that they can."""
    filling = share > 0.0
    area_1, area_2 = (2e-6, 3e-6) if filling else (1e-6, 1.5e-6)
    tables = (FILL, VENT_2) if filling else (VENT, FILL_2)
    full_1 = area_1 * rate(filling, 4e5) * 1e-4 / (2e-5 + 8e-4 * 0.12)
    full_2 = area_2 * rate(not filling, 2.5e5) * 1e-4 / (3e-5 + 6e-4 * 0.08)
    s, wanted = state(X=0.12, P1=4e5, P2=2.5e5), share * (full_1 + 0.75 * full_2)
    reached = plant.drive_mirrored_valve(wanted, 0.12, 4e5, 2.5e5, s, MIRRORED)
    u, rate_1, rate_2 = of(s, "U1", "RATE1", "RATE2")
    way = math.copysign(1.0, share)
    assert rate_1 == pytest.approx(way * full_1 * opened_share(u, tables[0]))
    assert rate_2 == pytest.approx(-way * full_2 * opened_share(u, tables[1]))
    assert reached == pytest.approx(way * min(abs(share), 1.0) * (full_1 + 0.75 * full_2))
    assert rate_1 - 0.75 * rate_2 == pytest.approx(reached, rel=1e-6)


def test_a_5_3_valve_that_shall_do_nothing_stands_between_both_closing_edges() -> None:
    s = state(RATE1=1.0, RATE2=1.0)
    assert plant.drive_mirrored_valve(0.0, 0.1, 3e5, 3e5, s, MIRRORED) == 0.0
    assert of(s, "RATE1", "RATE2", "U1") == [0.0, 0.0, -0.5]


# --- the start


def started(x: float, p1: float, p2: float) -> np.ndarray:
    s = np.zeros(len(at.STATE))
    observers.initialise_state(0.15, x, p1, p2, s, C)
    return s


def test_it_starts_at_rest_from_the_first_readings() -> None:
    s = started(0.12, 4e5, 3.5e5)
    assert of(s, "STARTED", "X", "P1", "P2", "X_REF", "X_SHAPED", "ANCHOR", "V", "LOAD") == [
        1.0, 0.12, 4e5, 3.5e5, 0.15, 0.12, 0.12, 0.0, 0.0,
    ]  # fmt: skip
    assert of(s, "P1_REF", "P2_REF", "BREAKAWAY_FORCE") == [4e5, 3.5e5, 20.0]
    assert of(s, "FORCE") == pytest.approx([8e-4 * 3e5 - 6e-4 * 2.5e5])


@pytest.mark.parametrize(
    ("x", "p1", "p2", "wanted"),
    [
        (math.nan, 4e5, 3.5e5, [0.1, 4e5, 3.5e5]),
        (0.41, 4e5, 3.5e5, [0.1, 4e5, 3.5e5]),
        (-0.21, 4e5, 3.5e5, [0.1, 4e5, 3.5e5]),
        (0.12, 0.2e5, 3.5e5, [0.12, 3e5, 3.5e5]),
        (0.12, 15e5, math.nan, [0.12, 3e5, 3e5]),
        (0.12, 4e5, 15e5, [0.12, 4e5, 4e5]),
        (-0.19, 0.31e5, 13.9e5, [-0.19, 0.31e5, 13.9e5]),
        (0.12, 4e5, 0.29e5, [0.12, 4e5, 4e5]),
    ],
)
def test_a_first_reading_that_cannot_be_one_is_replaced(x: float, p1: float, p2: float, wanted: list[float]) -> None:
    """By the middle of the stroke, the mean pressure, and chamber 2's by chamber 1's."""
    assert of(started(x, p1, p2), "X", "P1", "P2") == wanted


# --- the reference


def test_the_rate_of_a_ramp_is_reached_over_the_shaping_time() -> None:
    """Of 4 ms at 1 ms: both poles at 0.75, gains 1 - 0.75^2 and 0.25^2 / 1 ms, and half a sample ahead."""
    s, x = state(X_REF=0.1), 0.1
    rates = []
    for _ in range(80):
        x += 0.02e-3
        rates.append(shape.reference_rate(x, s, C))
    assert rates[0] == pytest.approx(0.02 * (0.4375 + 0.5 * 0.0625))
    assert rates[1] == pytest.approx(0.02 * (0.4375 + 0.0625 + 0.4375 * 0.5 + 0.5 * 0.0625 * 1.5))
    assert rates[-1] == pytest.approx(0.02, rel=1e-6)
    assert of(s, "X_REF", "RAW_RATE", "A_REF") == pytest.approx([x, 0.02, 0.0], abs=1e-7)


def test_the_rate_does_not_lag_behind_a_steady_acceleration() -> None:
    """Of 2 m/s^2: the rate is that of the sample, not of a shaping time ago, nor of half a sample."""
    s, time = state(X_REF=0.1), 1e-3 * np.arange(1, 101)
    rates = [shape.reference_rate(0.1 + t**2, s, C) for t in time]
    assert rates[-1] == pytest.approx(2.0 * time[-1], rel=1e-6)
    assert of(s, "A_REF") == pytest.approx([2.0], rel=1e-6)


def test_a_jump_of_the_reference_has_no_rate() -> None:
    """Of 10 mm in a sample: 10 m/s, where 10 times the largest acceleration allows 0.05 m/s of change."""
    s = state(X_REF=0.1)
    assert shape.reference_rate(0.11, s, C) == 0.0
    assert shape.reference_rate(0.11, s, C) == 0.0
    assert of(s, "X_REF", "RAW_RATE") == [0.11, 0.0]


def test_a_period_longer_than_the_shaping_time_takes_the_rate_as_it_is() -> None:
    s = state(X_REF=0.1)
    assert shape.reference_rate(0.10001, s, settings(SHAPING_TIME=5e-4)) == pytest.approx(0.01 + 0.5e-3 * 10.0)
    assert of(s, "V_REF", "A_REF") == pytest.approx([0.01, 10.0])


def shaped(reference: np.ndarray, **changed: float) -> tuple[np.ndarray, np.ndarray]:
    """Shaped position and velocity at each sample, from rest at the first reference."""
    s, c, rows = state(X_REF=reference[0], X_SHAPED=reference[0]), settings(**changed), []
    for x in reference:
        before = of(s, "X_SHAPED", "V_SHAPED")
        shape.shape_reference(float(x), s, c)
        now = of(s, "X_SHAPED", "V_SHAPED", "A_SHAPED")
        assert now[2] == pytest.approx((now[1] - before[1]) / 1e-3)
        assert now[0] == pytest.approx(before[0] + 0.5e-3 * (before[1] + now[1]))
        rows.append(now)
    return np.array(rows)[:, 0], np.array(rows)[:, 1]


@pytest.mark.parametrize("height", [0.03, -0.03])
def test_a_step_is_shaped_within_speed_and_acceleration_and_arrives_without_overshoot(height: float) -> None:
    x, v = shaped(np.where(np.arange(1500) < 10, 0.1, 0.1 + height))
    assert np.abs(np.diff(v)).max() <= 5.0 * 1e-3 * (1 + 1e-9)
    assert np.abs(v).max() <= 0.5
    assert x[-1] == pytest.approx(0.1 + height, abs=1e-7)
    way = (x - 0.1) / height
    assert way.max() <= 1.0 + 1e-3
    # time-optimal: twice the root of way over acceleration, and a few times the shaping time
    arrived = np.argmax(way > 0.99)
    assert 10 + 2e3 * np.sqrt(0.03 / 5.0) * 0.9 < arrived < 10 + 2e3 * np.sqrt(0.03 / 5.0) + 20


def test_a_long_way_is_gone_at_the_largest_speed() -> None:
    _, v = shaped(np.where(np.arange(1500) < 10, 0.02, 0.18), V_MAX=0.2)
    assert v.max() == pytest.approx(0.2)
    assert np.count_nonzero(v > 0.1999) > 500


def test_a_reference_that_keeps_to_the_limits_is_followed_exactly() -> None:
    time = 1e-3 * np.arange(3000)
    reference = 0.1 + 0.01 * np.sin(2 * np.pi * np.maximum(time - 0.1, 0.0) * 0.5)
    x, _ = shaped(reference)
    assert np.abs(x - reference)[1000:].max() < 1e-7  # a sample of it is 31 um


def test_closing_in_on_a_moving_reference_adds_to_its_speed() -> None:
    """The largest speed is that of closing in: a ramp of 0.3 m/s is caught up with at up to 0.5 m/s."""
    time = 1e-3 * np.arange(400)
    _, v = shaped(0.02 + 0.3 * time + 0.03 * (time > 0.1), V_MAX=0.2)
    assert v.max() == pytest.approx(0.5, rel=0.02)


def test_rest_is_counted_from_when_the_shaped_reference_has_arrived() -> None:
    s = state(X_REF=0.1, X_SHAPED=0.1)
    for _ in range(3):
        shape.shape_reference(0.1, s, C)
    assert of(s, "REF_REST_TIME") == pytest.approx([3e-3])
    shape.shape_reference(0.1 + 1e-7, s, C)  # it moves
    assert of(s, "REF_REST_TIME") == [0.0]


@pytest.mark.parametrize(("off", "v"), [(0.6e-5, 0.0), (0.0, 2.1e-3)])
def test_rest_needs_position_and_speed(off: float, v: float) -> None:
    """Half the reach off, or faster than the least speed, even after a sample of braking at 5 mm/s in 1 ms."""
    s = state(X_REF=0.1, X_SHAPED=0.1 + off, V_SHAPED=v, REF_REST_TIME=1.0)
    shape.shape_reference(0.1, s, settings(A_MAX=1e-3))
    assert of(s, "REF_REST_TIME") == [0.0]


# --- observers


def observed(p1: float, p2: float, **given: float) -> np.ndarray:
    s = state(**given)
    observers.observe_pressures(p1, p2, s, C)
    return s


def test_pressures_are_predicted_from_flows_and_motion() -> None:
    s = observed(math.nan, math.nan, RATE1=1e5, FLOW1=2e5, RATE2=-3e5, FLOW2=1e5, V=0.5)
    assert of(s, "P1", "P2") == pytest.approx([
        3e5 + 1e-3 * (3e5 - 1.4 * 3e5 * 8e-4 * 0.5 / VOLUME_1),
        3e5 + 1e-3 * (-2e5 + 1.4 * 3e5 * 6e-4 * 0.5 / VOLUME_2),
    ])  # fmt: skip
    assert of(s, "FLOW1", "FLOW2") == [2e5, 1e5]


def test_readings_correct_pressures_by_a_share_and_flows_by_what_is_left_over() -> None:
    s = observed(3e5 + 400.0, 3e5 - 200.0)
    assert of(s, "P1", "P2") == pytest.approx([3e5 + 100.0, 3e5 - 50.0])
    assert of(s, "FLOW1", "FLOW2") == pytest.approx([8e3, -4e3])


def test_a_flow_estimate_changes_by_no_more_than_its_step() -> None:
    assert of(observed(3.2e5, 2.8e5), "FLOW1", "FLOW2") == [1e4, -1e4]
    assert of(observed(2.8e5, 3.2e5), "FLOW1", "FLOW2") == [-1e4, 1e4]


@pytest.mark.parametrize(("p", "used"), [(0.29e5, False), (0.31e5, True), (13.9e5, True), (14.1e5, False)])
def test_readings_out_of_range_are_bridged(p: float, used: bool) -> None:
    assert (of(observed(p, 3e5), "P1") != [3e5]) == used
    assert (of(observed(3e5, p), "P2") != [3e5]) == used


def test_the_force_of_the_pressures_is_over_ambient() -> None:
    assert plant.pressure_force(state(P1=4e5, P2=3e5), C) == pytest.approx(8e-4 * 3e5 - 6e-4 * 2e5)


def balanced(force: float, **given: float) -> np.ndarray:
    """A state whose pressures push with this force in N."""
    return state(**({"P1": 1e5 + (force + 6e-4 * 2e5) / 8e-4} | given))


def moved(s: np.ndarray, x: float = math.nan, **changed: float) -> np.ndarray:
    observers.observe_motion(x, s, settings(**changed))
    return s


def test_a_moving_piston_is_predicted_with_friction_and_load() -> None:
    """40 N + 10 N of load less 50 N s/m x 0.1 m/s and the dry friction at 0.1 m/s, on 2 kg."""
    s = moved(balanced(40.0, V=0.1, LOAD=10.0, ANCHOR=0.09))
    v = 0.1 + 1e-3 * (50.0 - 5.0 - (10.0 + 10.0 / 101.0)) / 2.0
    assert of(s, "V", "X") == pytest.approx([v, 0.1 + 0.5e-3 * (0.1 + v)])


def test_friction_stops_but_does_not_turn() -> None:
    assert of(moved(balanced(0.0, V=1e-3, ANCHOR=0.09)), "V") == [0.0]
    assert of(moved(balanced(-60.0, V=1e-3, ANCHOR=0.09)), "V") == [0.0]
    assert of(moved(balanced(-60.0, V=0.0, ANCHOR=0.09)), "V")[0] < 0.0


def test_at_a_resting_reference_a_piston_that_is_not_seen_to_stir_rests_whatever_pushes_it() -> None:
    s = moved(balanced(100.0, V=0.0, ANCHOR=0.1, MOVING_COUNT=0.0, REF_REST_TIME=1.0))
    assert of(s, "V", "X", "MOVING_COUNT") == [0.0, 0.1, 0.0]


def test_what_holds_a_piston_back_from_a_reference_that_moves_is_a_load() -> None:
    """More than its friction pushes it and it stays: friction that the model lacks holds it, until it is overcome."""
    s = balanced(100.0, V=0.0, ANCHOR=0.1, MOVING_COUNT=0.0)
    for _ in range(200):
        moved(s, 0.1)
    assert -100.0 - 20.0 < of(s, "LOAD")[0] <= -100.0 + 20.0
    s = balanced(15.0, V=0.0, ANCHOR=0.1, MOVING_COUNT=0.0)  # within the friction of the model
    for _ in range(200):
        moved(s, 0.1)
    assert of(s, "LOAD") == [0.0]


def test_stirring_is_counted_beyond_a_quarter_of_the_reach_from_where_it_lately_was() -> None:
    assert of(moved(state(X=0.1 + 2.7e-6, ANCHOR=0.1, MOVING_COUNT=2.0)), "MOVING_COUNT") == [3.0]
    assert of(moved(state(X=0.1 - 2.7e-6, ANCHOR=0.1, MOVING_COUNT=2.0)), "MOVING_COUNT") == [3.0]
    assert of(moved(state(X=0.1 + 2.3e-6, ANCHOR=0.1, MOVING_COUNT=2.0)), "MOVING_COUNT") == [0.0]


def test_a_wide_tolerance_does_not_hide_that_it_stirs() -> None:
    s = moved(state(X=0.1 + 2.7e-6, ANCHOR=0.1, MOVING_COUNT=2.0), HOLDING_BAND=25e-6)
    assert of(s, "MOVING_COUNT") == [3.0]


def slid(s: np.ndarray, way: float, load: float, **given: float) -> np.ndarray:
    """Let the piston slide one way for 0.2 s under this load estimate in N, beyond what seals give way."""
    known = {"V_SHAPED": 0.1 * way, "V": 0.1 * way, "EXCURSION": 1e-3 * way, "LOAD": load} | given
    for _ in range(200):
        for name, value in known.items():
            s[at.STATE.index(f"S_{name}")] = value
        observers.learn_friction(s, C)
    return s


def turned(s: np.ndarray, way: float) -> np.ndarray:
    s[at.STATE.index("S_V_SHAPED")] = way
    observers.learn_friction(s, C)
    return s


@pytest.mark.parametrize(
    ("up", "back", "known", "added", "load"),
    [
        (-4.0, 4.0, 0.0, 0.4, 0.0),  # of 10 N
        (3.0, -3.0, 0.0, -0.3, 0.0),
        (5.0, 5.0, 0.0, 0.0, 5.0),  # a load
        (-1.0, 7.0, 0.0, 0.4, 3.0),  # both
        (-40.0, 40.0, 0.0, 1.0, 30.0),  # no more than twice
        (9.0, -9.0, 0.0, -0.5, -4.0),  # no less than half
        (-3.5, 3.5, 0.4, 0.75, 0.0),  # beyond what it had learnt
    ],
)
def test_what_holds_back_on_both_ways_is_friction_that_the_model_lacks(
    up: float, back: float, known: float, added: float, load: float
) -> None:
    s = turned(slid(slid(state(ADDED_FRICTION=known), 1.0, up), -1.0, back), 1.0)
    assert of(s, "ADDED_FRICTION", "LOAD") == pytest.approx([added, load])


def test_friction_is_learnt_from_slides_alone_that_no_rest_parts() -> None:
    slow, seals, rest = {"V": 1e-3}, {"EXCURSION": 4e-4}, {"REF_REST_TIME": 0.1}
    for given in (slow, seals, rest):
        s = turned(slid(slid(state(), 1.0, -4.0, **given), -1.0, 4.0, REF_REST_TIME=0.0), 1.0)
        assert of(s, "ADDED_FRICTION", "LOAD") == [0.0, 4.0]


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_rest_of_the_reference_gives_what_was_learnt_back_to_the_load(way: float) -> None:
    s = turned(slid(slid(state(), way, -4.0 * way), -way, 4.0 * way), way)
    assert of(s, "ADDED_FRICTION", "LOAD") == pytest.approx([0.4, 0.0])
    s[at.STATE.index("S_REF_REST_TIME")] = 0.04
    assert of(turned(s, way), "ADDED_FRICTION", "LOAD") == pytest.approx([0.4, 0.0])
    s[at.STATE.index("S_REF_REST_TIME")] = 0.06
    assert of(turned(s, 0.0), "ADDED_FRICTION", "LOAD") == pytest.approx([0.0, -4.0 * way])
    assert of(turned(s, 0.0), "LOAD") == pytest.approx([-4.0 * way])


def test_learnt_friction_scales_all_dry_friction() -> None:
    s = state(ADDED_FRICTION=0.5)
    assert plant.dry_friction_factor(0.1, 1.0, s, C) == pytest.approx(1.5)


def test_the_anchor_follows_over_the_time_of_lingering() -> None:
    assert of(moved(state(X=0.12, ANCHOR=0.1)), "ANCHOR") == pytest.approx([0.1 + 0.02 / 20])
    assert of(moved(state(X=0.12, ANCHOR=0.1), MOTION_WINDOW=1e-4), "ANCHOR") == pytest.approx([0.12])


def test_the_observed_position_stays_within_the_stroke() -> None:
    assert of(moved(balanced(0.0, X=0.2, V=0.3, ANCHOR=0.1)), "X") == [0.2]
    assert of(moved(balanced(0.0, X=0.0, V=-0.3, ANCHOR=0.1)), "X") == [0.0]


@pytest.mark.parametrize(("off", "load"), [(1e-5, 1.0), (1e-3, 3.0), (-1e-3, -3.0)])
def test_a_position_read_corrects_motion_and_load_which_changes_by_no_more_than_its_step(
    off: float, load: float
) -> None:
    s = moved(balanced(0.0, V=0.0, ANCHOR=0.09), 0.1 + off)
    assert of(s, "X", "V", "LOAD") == pytest.approx([0.1 + 0.5 * off, 100.0 * off, load])


def test_a_reading_that_comes_back_tells_where_the_piston_is_not_how_fast_it_came_there() -> None:
    """Of 10 mm after 99 samples without a reading one sample's share, 0.1 mm, is an innovation of motion and load."""
    s = balanced(0.0, V=0.0, ANCHOR=0.1)
    for _ in range(99):
        moved(s)
    s = moved(s, 0.11)
    assert of(s, "X", "V", "ANCHOR") == pytest.approx([0.11 - 0.5e-4, 100.0 * 1e-4, 0.1 + 9.9e-3])
    assert of(s, "LOAD", "UNSEEN") == [3.0, 0.0]


def test_the_load_of_a_piston_that_rests_is_not_told() -> None:
    s = moved(state(MOVING_COUNT=0.0, REF_REST_TIME=1.0), 0.1 + 1e-5)
    assert of(s, "LOAD") == [0.0]
    assert of(s, "X") == pytest.approx([0.1 + 0.5e-5])


@pytest.mark.parametrize(("x", "used"), [(-0.009, True), (-0.011, False), (0.209, True), (0.211, False)])
def test_positions_a_little_beyond_the_stroke_can_be(x: float, used: bool) -> None:
    assert (of(moved(state()), "V") != of(moved(state(), x), "V")) == used


# --- the sector and the sticking piston


def test_the_sector_is_the_mean_sign_of_both_lines_weighted_by_their_size() -> None:
    assert standstill.sector_switching_term(1e-3, 0.0, C) == 1.0
    assert standstill.sector_switching_term(-1e-3, -0.01, C) == -1.0
    assert standstill.sector_switching_term(1e-3, -0.025, C) == pytest.approx((-5.0 + 15.0) / 20.0)
    assert standstill.sector_switching_term(0.0, 0.0, C) == 0.0


def loosened(error: float, **given: float) -> np.ndarray:
    s = balanced(**({"force": 0.0, "MOVING_COUNT": 0.0, "RAMP_GAIN": 1.0, "LAST_SIGN": 1.0} | given))
    standstill.breakaway_ramp(error, s, C)
    return s


def test_far_below_breaking_away_the_force_rises_fast() -> None:
    """Sticking: rate 500 N/s toward the error."""
    assert of(loosened(1e-3), "RELEASE_FORCE", "LAST_SIGN") == pytest.approx([0.5, 1.0])
    assert of(loosened(-1e-3, LAST_SIGN=-1.0), "RELEASE_FORCE", "LAST_SIGN") == pytest.approx([-0.5, -1.0])


def test_near_breaking_away_it_rises_in_proportion_to_the_error_but_not_less_than_slowly() -> None:
    """From 92 % of what it took last: 1e5 N/(s m) x 1 mm = 100 N/s; at 0.1 mm the slow 14 N/s instead of 10."""
    assert of(loosened(1e-3, force=18.5), "RELEASE_FORCE") == pytest.approx([0.1])
    assert of(loosened(1e-4, force=18.5), "RELEASE_FORCE") == pytest.approx([0.014])
    assert of(loosened(1.0, force=18.5), "RELEASE_FORCE") == pytest.approx([0.5])
    assert of(loosened(1e-3, force=18.3), "RELEASE_FORCE") == pytest.approx([0.5])
    assert of(loosened(-1e-3, force=-18.5, LAST_SIGN=-1.0), "RELEASE_FORCE") == pytest.approx([-0.1])
    assert of(loosened(1e-3, force=10.0, LOAD=8.5), "RELEASE_FORCE") == pytest.approx([0.1])


def test_what_it_took_last_counts_as_no_less_than_seven_tenths_of_static_friction() -> None:
    assert of(loosened(1e-3, force=13.9, BREAKAWAY_FORCE=10.0), "RELEASE_FORCE") == pytest.approx([0.5])
    assert of(loosened(1e-3, force=14.1, BREAKAWAY_FORCE=10.0), "RELEASE_FORCE") == pytest.approx([0.1])


def test_the_pace_is_eagers_share_of_it_and_never_more_than_all() -> None:
    assert of(loosened(1e-3, RAMP_GAIN=0.5), "RELEASE_FORCE") == pytest.approx([0.25])
    assert of(loosened(1e-3, RAMP_GAIN=4.0), "RELEASE_FORCE") == pytest.approx([0.5])


def test_it_pushes_by_no_more_than_its_largest_force() -> None:
    assert of(loosened(1e-3, RELEASE_FORCE=59.9), "RELEASE_FORCE") == [60.0]
    assert of(loosened(-1e-3, RELEASE_FORCE=-59.9, LAST_SIGN=-1.0), "RELEASE_FORCE") == [-60.0]


@pytest.mark.parametrize(("before", "after"), [(4.0, 2.0), (0.5, 0.25), (0.04, 0.03), (0.03, 0.03)])
def test_each_landing_on_the_other_side_halves_the_pace(before: float, after: float) -> None:
    assert of(loosened(1e-3, RAMP_GAIN=before, LAST_SIGN=-1.0), "RAMP_GAIN") == pytest.approx([after])
    assert of(loosened(1e-3, RAMP_GAIN=before, LAST_SIGN=1.0), "RAMP_GAIN") == pytest.approx([before])


def test_while_it_is_braked_no_force_is_put_on() -> None:
    s = loosened(1e-3, BRAKING_TIME=0.01, RELEASE_FORCE=0.3)
    assert of(s, "BRAKING_TIME", "RELEASE_FORCE") == pytest.approx([9e-3, 0.3])


def freed(error: float, stirs: float, **given: float) -> np.ndarray:
    return loosened(
        error, **({"MOVING_COUNT": stirs, "V": 1e-3, "RELEASE_FORCE": 15.0, "force": 17.0, "LOAD": 5.0} | given)
    )


def test_as_it_breaks_away_the_force_that_it_took_is_remembered_within_half_and_twice_the_static_one() -> None:
    assert of(freed(1e-3, 1.0), "BREAKAWAY_FORCE") == pytest.approx([22.0])
    assert of(freed(1e-3, 1.0, force=-17.0, LOAD=-5.0), "BREAKAWAY_FORCE") == pytest.approx([22.0])
    assert of(freed(1e-3, 1.0, force=100.0), "BREAKAWAY_FORCE") == [40.0]
    assert of(freed(1e-3, 1.0, force=0.0), "BREAKAWAY_FORCE") == [10.0]
    assert of(freed(1e-3, 2.0), "BREAKAWAY_FORCE") == [20.0]


def test_a_piston_that_turns_has_not_broken_away() -> None:
    """It had stirred 10 ms ago, less than half of the 20 ms in which that is noticed."""
    assert of(freed(1e-3, 1.0, REST_TIME=0.0099), "BREAKAWAY_FORCE", "BREAKAWAY_POSITION") == [20.0, 0.0]
    assert of(freed(1e-3, 1.0, REST_TIME=0.0101), "BREAKAWAY_FORCE", "BREAKAWAY_POSITION") == pytest.approx([22.0, 0.1])


# a piston of 2 kg, dry friction of 10 N at any speed, no damping; pressures follow at 100 1/s, the valves let them
COASTING = settings(
    MASS=2.0,
    COULOMB=10.0,
    VISCOUS=0.0,
    VISCOUS_BACK=0.0,
    P_KP=100.0,
    STRIBECK=1e-6,
    DECELERATION_RATIO=-1.0,
    LEVEL_RATE=1e9,
    GAMMA=0.0,
)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_what_nothing_drives_coasts_until_friction_has_taken_its_speed(way: float) -> None:
    """From 0.1 m/s against 10 N: 2 kg x (0.1 m/s)^2 / (2 x 10 N) = 1 mm."""
    s = balanced(0.0, V=0.1 * way, BREAKAWAY_FORCE=10.0)
    assert standstill.stopping_distance(s, COASTING) == pytest.approx(1e-3 * way, rel=1e-3)


def test_the_way_until_a_command_arrives_counts() -> None:
    s = balanced(0.0, V=0.1, BREAKAWAY_FORCE=10.0)
    s[at.S_PREDICTED_X] += 2e-3
    assert standstill.stopping_distance(s, COASTING) == pytest.approx(3e-3, rel=1e-3)


def test_what_drives_it_fades_as_the_pressures_follow() -> None:
    """40 N e^(-100 t) against 10 N: at rest again where 0.4 N s (1 - e^-q) = 0.1 N s q, that is at q = 3.92.

    There 2 kg have come by half of (4 (q - 1 + e^-q) - 0.5 q^2) mm; steps of 1 ms find a tenth less.
    """
    q = 3.92069
    way = (4e-3 * (q - 1.0 + math.exp(-q)) - 5e-4 * q * q) / 2.0
    assert 4.0 * (1.0 - math.exp(-q)) == pytest.approx(q, rel=1e-4)
    assert standstill.stopping_distance(balanced(40.0, V=0.0, BREAKAWAY_FORCE=10.0), COASTING) == pytest.approx(
        way, rel=0.12
    )


def coasted(rate: float, stiff: float, lag: float) -> float:
    """Integrate 2 kg from rest, 40 N against 10 N; valves behind a ``lag`` take ``rate`` (N/s), gas ``stiff`` x way."""
    h, opened, v, x, force = 1e-6, 0.0 if lag else 1.0, 0.0, 0.0, 40.0
    while v > 0.0 or force > 10.0:
        opened += (1.0 - opened) * h / lag if lag else 0.0
        v += h * (force - 10.0) / 2.0
        x += h * v
        force = max(force - h * (opened * rate + stiff * v), 0.0)
    return x


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(("gamma", "share"), [(0.0, 1.0), (1.4, 1.0), (0.0, 0.1), (1.4, 0.05)])
def test_what_drives_it_is_taken_away_no_faster_than_spool_valve_and_expanding_gas_allow(
    gamma: float, share: float, way: float
) -> None:
    """Pressures that would follow at once, by 800 N/s; gas of 1.4 (A1^2 p1 / V1 + A2^2 p2 / V2).

    A spool that goes ``share`` of its way in 1 ms has a lag of 1 ms (1 / share - 1), half a sample more than exactly.
    Steps of 5 ms find up to a tenth more.
    """
    c = settings(
        MASS=2.0, COULOMB=10.0, VISCOUS=0.0, VISCOUS_BACK=0.0, P_KP=1e4, STRIBECK=1e-6, GAMMA=gamma, SPOOL_SHARE=share,
        AREA_FILL=1e-9, AREA_VENT=1e-9,
    )  # fmt: skip
    s = balanced(40.0 * way, V=0.0, BREAKAWAY_FORCE=10.0)
    p1, p2 = of(s, "P1", "P2")
    stiff = gamma * (8e-4**2 * p1 / VOLUME_1 + 6e-4**2 * p2 / VOLUME_2)
    wanted = way * coasted(800.0, stiff, 1e-3 * (1.0 / share - 1.0))
    assert standstill.stopping_distance(s, c) == pytest.approx(wanted, rel=0.1)


def test_valves_that_open_fully_relieve_both_chambers() -> None:
    """Chamber 1 by its own valve; a 5/3 spool fills the one and vents the other, and so do two valves."""
    s = state()
    fill, vent = 2e-6 * rate(True, 3e5) * 1e-4, 1e-6 * rate(False, 3e5) * 1e-4
    first = {1.0: 8e-4 * fill / VOLUME_1, -1.0: 8e-4 * vent / VOLUME_1}
    second = {1.0: 6e-4 * vent / VOLUME_2, -1.0: 6e-4 * fill / VOLUME_2}
    for way in (1.0, -1.0):
        assert standstill.max_unloading_rate(way, s, settings(LEVEL_RATE=0.0)) == pytest.approx(first[way])
        both = first[way] + second[way]
        mirrored = first[way] + (second[way] if way < 0.0 else 6e-4 * vent / VOLUME_2)
        assert standstill.max_unloading_rate(way, s, settings(LEVEL_RATE=0.0, MIRRORED=1.0)) == pytest.approx(mirrored)
        assert standstill.max_unloading_rate(way, s, settings(LEVEL_RATE=0.0, TWO_VALVES=1.0)) == pytest.approx(both)
        assert standstill.max_unloading_rate(way, s, settings(LEVEL_RATE=1e7)) == pytest.approx(8e3)


def test_near_breaking_away_is_what_the_force_comes_to_when_a_command_arrives() -> None:
    """18 N now, 18.5 N when what is under way has arrived: 92 % of 20 N lie between."""
    s = balanced(force=18.0, MOVING_COUNT=0.0, RAMP_GAIN=1.0, LAST_SIGN=1.0)
    s[at.S_PREDICTED_P1] += 0.5 / 8e-4
    standstill.breakaway_ramp(1e-3, s, C)
    assert of(s, "RELEASE_FORCE") == pytest.approx([0.1])


@pytest.mark.parametrize("band", [10e-6, 25e-6])
def test_a_freed_piston_is_let_go_where_it_coasts_to_its_reference(band: float) -> None:
    """It coasts 1 mm; within 20 um of that its force is taken away, however wide the tolerance."""
    coasting = COASTING.copy()
    coasting[at.C_HOLDING_BAND] = band
    s = {"V": 0.1, "force": 0.0, "RELEASE_FORCE": 15.0, "MOVING_COUNT": 2.0, "BREAKAWAY_FORCE": 10.0}
    for error, kept in ((1.03e-3, 15.0), (1.01e-3, 0.0), (-1e-3, 0.0)):
        standstill.breakaway_ramp(error, found := balanced(**s), coasting)
        assert of(found, "RELEASE_FORCE") == [kept]
        assert of(found, "BRAKING_TIME") == pytest.approx([0.0 if kept else COASTING[at.C_MOTION_WINDOW]])


@pytest.mark.parametrize(
    ("eager", "error", "before", "wide"),
    [
        (0.25, 30e-6, 0.0, 1.5),
        (0.25, 60e-6, 0.6e-4, 5.0),
        (0.25, 60e-6, 0.4e-4, 1.5),
        (0.25, 60e-6, 1.5e-4, 1.0),
        (0.5, 60e-6, 0.0, 1.0),
        (0.25, 101e-6, 0.0, 1.0),
    ],
)
def test_half_of_a_jump_that_half_the_pace_did_not_shorten_is_put_up_with_by_and_by(
    eager: float, error: float, before: float, wide: float
) -> None:
    """It landed 0.1 mm from where it was set free; not where it went less far than before, or is further off yet.

    At once where it landed about as far past the reference as it had been before it, and jumped so far before: a jump
    of more than twice the last one is one of a load.
    """
    s = state(
        X=0.1001,
        BREAKAWAY_POSITION=0.1,
        LAST_JUMP=before,
        RAMP_GAIN=eager,
        LAST_SIGN=1.0,
        MOVING_COUNT=0.0,
        BRAKING_TIME=1e-3,
    )
    standstill.breakaway_ramp(error, s, C)
    assert of(s, "DEADBAND_GAIN", "LAST_JUMP") == pytest.approx([wide, 1e-4])


def test_no_force_is_piled_up_that_the_pressures_cannot_make() -> None:
    assert of(loosened(1e-3, P1_REF=6.5e5), "RELEASE_FORCE") == [0.0]
    assert of(loosened(-1e-3, LAST_SIGN=-1.0, P1_REF=1.05e5), "RELEASE_FORCE") == [0.0]
    assert of(loosened(1e-3, P1_REF=1.05e5), "RELEASE_FORCE") == pytest.approx([0.5])
    two = settings(TWO_VALVES=1.0)
    for p2, stick in ((3e5, 0.5), (1.05e5, 0.0)):
        s = balanced(force=0.0, MOVING_COUNT=0.0, RAMP_GAIN=1.0, LAST_SIGN=1.0, P1_REF=6.5e5, P2_REF=p2)
        standstill.breakaway_ramp(1e-3, s, two)
        assert of(s, "RELEASE_FORCE") == pytest.approx([stick])


def test_far_from_the_reference_a_freed_piston_keeps_its_push() -> None:
    """It closes in at 10/s or faster."""
    assert of(freed(1e-3, 2.0, V=0.0101), "RELEASE_FORCE", "BRAKING_TIME") == [15.0, 0.0]


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_freed_piston_that_creeps_is_pushed_by_the_integral_of_its_error(way: float) -> None:
    """2 kg x 2e4 1/s^3 x 1 mm over 1 ms; no faster than a piston that sticks surely."""
    s = freed(1e-3 * way, 2.0, V=0.0099 * way, RELEASE_FORCE=15.0 * way, LAST_SIGN=way)
    assert of(s, "RELEASE_FORCE", "BRAKING_TIME") == pytest.approx([15.04 * way, 0.0])
    far = freed(0.1 * way, 2.0, V=0.0099 * way, RELEASE_FORCE=15.0 * way, LAST_SIGN=way)
    assert of(far, "RELEASE_FORCE") == pytest.approx([15.0 * way + 1e-3 * way * C[at.C_RAMP_RATE_MAX]])


@pytest.mark.parametrize("error", [1.9e-5, -1e-3])
def test_near_the_reference_or_beyond_it_a_freed_piston_is_stopped(error: float) -> None:
    assert of(freed(error, 2.0), "RELEASE_FORCE", "BRAKING_TIME") == [0.0, 0.02]


def test_a_piston_that_moves_against_its_push_is_not_freed_by_it() -> None:
    s = freed(1e-3, 2.0, V=-1e-3)
    assert of(s, "BRAKING_TIME") == [-1e-3]
    assert of(s, "RELEASE_FORCE")[0] > 15.0


# --- holding


def held(x_ref: float = 0.1, **given: float) -> tuple[bool, np.ndarray]:
    s = balanced(
        **(
            {
                "force": 30.0,
                "REST_TIME": 0.0,
                "REF_REST_TIME": 0.06,
                "LOAD": 4.0,
                "RELEASE_FORCE": 9.0,
                "RAMP_GAIN": 1.0,
            }
            | given
        )
    )
    return bool(standstill.update_hold(x_ref, s, C)), s


def test_near_a_resting_reference_it_is_held_and_half_of_its_force_is_loosened() -> None:
    found, s = held(0.1 + 0.9e-5, force=10.0)
    assert found
    assert of(s, "HOLD", "RAMP_GAIN", "RELEASE_FORCE", "FORCE") == pytest.approx([1.0, 1.0, 0.0, 10.0 - 7.0])


@pytest.mark.parametrize(("load", "kept"), [(-30.0, -26.0), (-50.0, -26.0), (5.0, 5.0)])
def test_a_piston_that_is_held_has_no_more_net_force_than_friction(load: float, kept: float) -> None:
    """6 N of the pressures and 20 N of friction: a load of 50 N would have moved it."""
    s = balanced(6.0, LOAD=load)
    standstill.enter_hold(s, C)
    net = 6.0 + kept
    assert of(s, "LOAD", "FORCE") == pytest.approx([kept, 6.0 - 0.5 * net])


def test_only_a_piston_that_rested_for_long_is_set_free_at_the_full_pace_again() -> None:
    """Ten times the 20 ms in which a stirring piston is noticed."""
    assert of(held(HOLD=1.0, REST_TIME=0.19)[1], "RAMP_GAIN") == [1.0]
    assert of(held(HOLD=0.0, REST_TIME=0.21)[1], "HOLD", "RAMP_GAIN", "REST_TIME") == [1.0, 1.0, 0.0]  # it stuck off it
    assert of(held(HOLD=1.0, REST_TIME=0.21)[1], "RAMP_GAIN") == [4.0]


@pytest.mark.parametrize(
    "given",
    [
        {"x_ref": 0.1 + 1.1e-5, "V": 1e-3},
        {"x_ref": 0.1 + 1.7e-5},
        {"REF_REST_TIME": 0.05},
        {"V": 2.1e-3},
        {"V": -2.1e-3},
    ],
)
def test_it_is_not_held_off_the_reference_early_or_in_motion(given: dict[str, float]) -> None:
    found, s = held(**given)
    assert not found
    assert of(s, "RELEASE_FORCE") == [9.0]


@pytest.mark.parametrize(("off", "stays"), [(1.7e-5, True), (-1.7e-5, True), (2.1e-5, False)])
def test_held_it_stays_so_a_little_within_twice_the_reach(off: float, stays: bool) -> None:
    found, s = held(0.1 + off, HOLD=1.0, FORCE=7.0)
    assert found == stays
    assert of(s, "FORCE", "RELEASE_FORCE") == [7.0, 9.0]


def test_held_it_is_let_go_as_it_moves() -> None:
    assert not held(HOLD=1.0, V=0.01)[0]


# --- the position law


def asked(x_ref: float = 0.15, off: tuple[str, ...] = (), **given: float) -> tuple[float, np.ndarray]:
    s = state(**({"X_SHAPED": 0.1 + 1e-4, "V_SHAPED": 0.02, "A_SHAPED": 0.3, "V": 0.01, "LOAD": 5.0} | given))
    return float(cascade.position_control(x_ref, s, settings(**dict.fromkeys(off, 0.0)))), s


PID = 2.0 * (0.3 + 60.0 * 0.01 + 900.0 * 1e-4) + 50.0 * 0.02


def test_in_motion_the_force_is_pid_and_friction_ahead_less_the_load() -> None:
    """Stribeck friction at the shaped 20 mm/s: 10 N + 10 N / (1 + 4)."""
    force, s = asked(RELEASE_FORCE=8.0, RAMP_GAIN=0.1)
    assert force == pytest.approx(PID + 12.0 - 5.0)
    assert of(s, "RELEASE_FORCE", "RAMP_GAIN") == [0.0, 4.0]


@pytest.mark.parametrize(
    ("v", "behind", "level"),
    [
        (0.03, 0.0, 12.0), (0.06, 0.0, 11.0), (-0.06, 0.0, 11.0), (0.06, 1e-4, 11.0),
        (0.0, 1e-4, 20.0), (0.005, 1e-4, 15.0), (0.01, 1e-4, 12.0), (0.0, -1e-4, 12.0), (0.0, 0.0, 12.0),
    ],
)  # fmt: skip
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_friction_ahead_is_of_the_shaped_speed_within_a_factor_of_two_of_the_pistons_own(
    v: float, behind: float, level: float, way: float
) -> None:
    """10 N + 10 N / (1 + (v / 10 mm/s)^2) at the shaped 20 mm/s, or half of what it runs ahead, or twice of what it
    stays behind at: where it is ahead it need not be freed."""
    s = state(X_SHAPED=0.1 + way * behind, V_SHAPED=0.02 * way, V=v * way, BREAKAWAY_FORCE=20.0)
    level *= way
    assert cascade.friction_feedforward(s, settings(COULOMB=10.0, STRIBECK=0.01)) == pytest.approx(level)


def test_friction_in_proportion_to_the_speed_is_that_of_when_the_force_arrives() -> None:
    """Without dry friction: 50 N s/m at the 20 mm/s that become 23 mm/s within 10 ms."""
    s = state(X_SHAPED=0.1, V_SHAPED=0.02, A_SHAPED=0.3, V=0.02, BREAKAWAY_FORCE=0.0)
    force = cascade.position_control(0.15, s, settings(FRICTION_LEAD=0.01, COULOMB=0.0))
    assert force == pytest.approx(2.0 * 0.3 + 50.0 * 0.023)


def test_a_loop_that_swung_is_less_firm() -> None:
    firm, soft = (asked(0.15, REF_REST_TIME=0.06, LOOP_GAIN=soft, ELASTIC=1.0, V=0.0)[0] for soft in (1.0, 0.5))
    assert firm - soft == pytest.approx(0.5 * 2.0 * (60.0 * 0.02 + 900.0 * 1e-4))


@pytest.mark.parametrize("x", [0.04, 0.1])
def test_friction_ahead_is_that_of_where_the_piston_is(x: float) -> None:
    """Friction grows from one to threefold along the stroke of 0.2 m; the reference is ahead by 60 mm."""
    c = settings(FRICTION_LEAD=0.01)
    first = len(c) - len(ALONG)
    c[first + 1] = 3.0
    s = state(X=x, X_SHAPED=x + 0.06, V_SHAPED=0.02, V=0.02, BREAKAWAY_FORCE=10.0)
    assert cascade.friction_feedforward(s, c) == pytest.approx(10.0 * (1.0 + 2.0 * (x + 2e-4) / 0.2))


@pytest.mark.parametrize(("v", "share"), [(1e-3, 0.5), (-1e-3, -0.5), (4e-3, 1.0), (-4e-3, -1.0)])
def test_friction_ahead_fades_below_the_least_speed(v: float, share: float) -> None:
    force, _ = asked(V_SHAPED=v, V=v)
    friction = 10.0 + 10.0 / (1.0 + (v / 0.01) ** 2)
    assert force == pytest.approx(2.0 * (0.3 + 900.0 * 1e-4) + 50.0 * v + share * friction - 5.0)


def test_without_the_estimate_the_error_is_integrated_instead() -> None:
    force, s = asked(off=("DISTURBANCE_OBSERVERS",), INTEGRAL=7.0)
    grown = 7.0 + 1e-3 * 2.0 * 2e4 * 1e-4
    assert of(s, "INTEGRAL") == pytest.approx([grown])
    assert force == pytest.approx(PID + 12.0 + grown)


def test_with_nothing_ahead_mass_and_friction_are_left_to_the_loop() -> None:
    force, _ = asked(off=("FEEDFORWARD",))
    assert force == pytest.approx(2.0 * (60.0 * 0.01 + 900.0 * 1e-4) - 5.0)


STICKING = {
    "X_SHAPED": 0.15,
    "V_SHAPED": 0.0,
    "A_SHAPED": 0.0,
    "V": 0.0,
    "REF_REST_TIME": 0.06,
    "MOVING_COUNT": 0.0,
    "LOAD": 0.0,
}


def test_at_rest_off_the_reference_the_sector_pushes_too() -> None:
    force, s = asked(**STICKING, P1=1e5 + 6e-4 * 2e5 / 8e-4, RAMP_GAIN=1.0, LAST_SIGN=1.0)
    assert of(s, "RELEASE_FORCE") == pytest.approx([0.5])
    assert force == pytest.approx(2.0 * 900.0 * 0.05 + 0.5)


def test_held_the_force_is_left_as_it_was() -> None:
    force, _ = asked(0.1, REF_REST_TIME=0.06, V=0.0, V_SHAPED=0.0, HOLD=1.0, FORCE=3.5)
    assert force == 3.5
    assert asked(0.1, ("HOLD",), REF_REST_TIME=0.06, V=0.0, V_SHAPED=0.0, FORCE=3.5)[0] != 3.5


def test_without_switching_a_piston_that_sticks_off_the_reference_is_not_freed() -> None:
    assert of(asked(off=("SWITCHING",), **STICKING)[1], "RELEASE_FORCE") == [0.0]


# --- pressures that make the force, and anti-windup


def references(force: float, two: float = 0.0, **given: float) -> np.ndarray:
    s = state(**given)
    cascade.set_pressure_references(force, s, settings(TWO_VALVES=two))
    return s


@pytest.mark.parametrize("force", [-100.0, 0.0, 60.0])
def test_the_pressure_reference_makes_the_force_against_chamber_2_as_it_is(force: float) -> None:
    s = references(force)
    p1, p2, kept = of(s, "P1_REF", "P2_REF", "FORCE")
    assert p2 == 3e5
    assert 8e-4 * (p1 - 1e5) - 6e-4 * (p2 - 1e5) == pytest.approx(force)
    assert kept == pytest.approx(force)


@pytest.mark.parametrize("force", [-150.0, 0.0, 150.0])
def test_two_valves_make_the_force_about_the_mean_pressure(force: float) -> None:
    s = references(force, 1.0)
    p1, p2 = of(s, "P1_REF", "P2_REF")
    assert 8e-4 * (p1 - 1e5) - 6e-4 * (p2 - 1e5) == pytest.approx(force)
    assert p1 - 3e5 == pytest.approx(3e5 - p2)


@pytest.mark.parametrize(("force", "p1"), [(1e4, 6.5e5), (-1e4, 1.05e5)])
def test_what_the_pressures_cannot_make_is_not_kept(force: float, p1: float) -> None:
    s = references(force)
    assert of(s, "P1_REF") == [p1]
    assert of(s, "FORCE") == pytest.approx([8e-4 * (p1 - 1e5) - 6e-4 * 2e5])


def test_with_two_valves_chamber_1_makes_what_chamber_2_cannot() -> None:
    s = references(-290.0, 1.0)
    p1, p2 = of(s, "P1_REF", "P2_REF")
    assert (p1, p2) == (1.05e5, pytest.approx(3e5 + (290.0 + 6e-4 * 1e5 * 0 + 8e-4 * 2e5 - 6e-4 * 2e5) / 14e-4))


@pytest.mark.parametrize(
    ("force", "integral", "left"),
    [
        (340.0, 50.0, 30.0),  # 20 N more than can be made: taken back
        (340.0, 15.0, 0.0),  # no more than there is
        (340.0, -50.0, -50.0),  # an integral that pulls the other way is not to blame
        (300.0, 50.0, 50.0),  # within reach
        (-136.0, -50.0, -30.0),
        (-136.0, 50.0, 50.0),
    ],
)
def test_anti_windup_takes_back_from_the_integral_what_was_not_reachable(
    force: float, integral: float, left: float
) -> None:
    """Between 1.05 and 6.5 bar in chamber 1 against 3 bar in chamber 2: from -116 N to 320 N."""
    assert of(references(force, INTEGRAL=integral), "INTEGRAL") == pytest.approx([left])


# --- valves


@pytest.mark.parametrize(
    ("hold", "error", "shut"), [(1.0, 999.0, True), (1.0, -999.0, True), (1.0, 1001.0, False), (0.0, 0.0, False)]
)
def test_a_valve_stays_shut_while_the_piston_is_held_and_its_pressure_near(
    hold: float, error: float, shut: bool
) -> None:
    assert bool(cascade.valve_stays_shut(error, state(HOLD=hold), C)) == shut


def driven(number: int = 1, off: tuple[str, ...] = (), two: float = 0.0, **given: float) -> np.ndarray:
    s = state(**({"P1_REF": 3e5, "P2_REF": 3e5} | given))
    (cascade.control_chamber_1 if number == 1 else cascade.control_chamber_2)(
        s, settings(TWO_VALVES=two, **dict.fromkeys(off, 0.0))
    )
    return s


COMPRESSED = 1.4 * 3e5 * 8e-4 * 0.1 / VOLUME_1  # Pa/s at 0.1 m/s
SPRING = 6e-4 / 8e-4 * 1.4 * 3e5 * 6e-4 * 0.1 / VOLUME_2


@pytest.mark.parametrize(("two", "motion"), [(0.0, COMPRESSED + SPRING), (1.0, COMPRESSED)])
def test_chamber_1_makes_up_for_motion_and_for_other_flows(two: float, motion: float) -> None:
    s = driven(two=two, V=0.1, FLOW1=2e4, P1_REF=3.01e5)
    wanted = 100.0 * 1e3 + motion - 2e4
    assert of(s, "RATE1") == pytest.approx([wanted])
    assert of(s, "U1") == pytest.approx([plant.valve_command(wanted, 3e5, VOLUME_1, state(), C)])


def test_chamber_2_makes_up_likewise_where_it_has_a_valve() -> None:
    s = driven(2, two=1.0, V=0.1, FLOW2=2e4, P2_REF=2.99e5)
    wanted = -100.0 * 1e3 - 1.4 * 3e5 * 6e-4 * 0.1 / VOLUME_2 - 2e4
    assert of(s, "RATE2") == pytest.approx([wanted])
    assert of(s, "U2") == pytest.approx([plant.valve_command(wanted, 3e5, VOLUME_2, state(), C)])
    assert of(driven(2, two=0.0, P2_REF=2e5), "U2", "RATE2") == [0.0, 0.0]


@pytest.mark.parametrize("number", [1, 2])
def test_a_pi_alone_integrates_its_error(number: int) -> None:
    given = {f"P{number}_REF": 3.01e5, f"INTEGRAL{number}": 5e3, "V": 0.1, f"FLOW{number}": 2e4}
    s = driven(number, ("FEEDFORWARD", "DISTURBANCE_OBSERVERS"), 1.0, **given)
    assert of(s, f"RATE{number}", f"INTEGRAL{number}") == pytest.approx([1.05e5, 5e3 + 1e-3 * 300.0 * 1e3])


@pytest.mark.parametrize("number", [1, 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_anti_windup_stops_the_integral_while_the_valve_is_wide_open(number: int, sign: float) -> None:
    s = driven(number, ("FEEDFORWARD", "DISTURBANCE_OBSERVERS"), 1.0, **{f"P{number}_REF": 3e5 + sign * 1e9})
    assert of(s, f"INTEGRAL{number}") == [0.0]
    assert of(s, f"U{number}") == pytest.approx([10.0 if sign > 0 else -9.0])
    assert 0.0 < sign * of(s, f"RATE{number}")[0] < 1e11


@pytest.mark.parametrize("number", [1, 2])
def test_held_and_near_its_pressure_a_valve_is_shut(number: int) -> None:
    s = driven(number, (), 1.0, HOLD=1.0, V=0.1, **{f"P{number}_REF": 3e5 + 900.0})
    assert of(s, f"RATE{number}", f"U{number}") == [0.0, -0.5]


def test_the_motion_alone_or_the_other_flows_alone_are_made_up_for() -> None:
    known = {"V": 0.1, "FLOW1": 2e4, "P1_REF": 3.01e5}
    assert of(driven(off=("FEEDFORWARD",), **known), "RATE1") == pytest.approx([100.0 * 1e3 - 2e4])
    assert of(driven(off=("DISTURBANCE_OBSERVERS",), **known), "RATE1") == pytest.approx(
        [100.0 * 1e3 + COMPRESSED + SPRING]
    )


@pytest.mark.parametrize(("share", "u"), [(0.25, 2.125), (-0.5, -4.75), (3.0, 10.0), (0.0, -0.5)])
def test_without_the_inverse_map_the_command_is_in_proportion(share: float, u: float) -> None:
    """All of what the open valve makes at mean pressure takes all of the command, whose null is -0.5 V here."""
    whole = plant.pressure_rate_per_area(share > 0.0, 3e5, VOLUME_1, state(), C) * (2e-6 if share > 0.0 else 1e-6)
    assert plant.valve_command(share * whole, 5e5, VOLUME_1, state(), settings(INVERSE_MAP=0.0)) == pytest.approx(u)


# --- the whole step


def test_the_first_sample_starts_it_and_a_missing_reference_is_where_it_stands() -> None:
    s = np.zeros(len(at.STATE))
    cascade.cascade_step(math.nan, 0.12, 3e5, 3e5, s, C)
    assert of(s, "STARTED", "X_REF") == [1.0, 0.12]
    cascade.cascade_step(0.15, 0.12, 3e5, 3e5, s, C)
    cascade.cascade_step(math.nan, 0.12, 3e5, 3e5, s, C)
    assert of(s, "X_REF") == [0.15]


def test_a_step_of_the_reference_opens_the_valve_toward_it() -> None:
    commands = {}
    for x_ref in (0.15, 0.05):
        s = np.zeros(len(at.STATE))
        for _ in range(12):
            cascade.cascade_step(x_ref, 0.1, 3e5, 3.6666667e5, s, C)
        commands[x_ref] = of(s, "U1")[0]
    assert commands[0.15] > 1.0
    assert commands[0.05] < -2.0


# --- its place in the simulation


@pytest.mark.parametrize(
    ("value", "quantum", "wanted"),
    [(0.126, 0.05, 0.15), (0.124, 0.05, 0.1), (-0.126, 0.05, -0.15), (0.126, 0.0, 0.126)],
)
def test_readings_are_rounded_to_the_nearest_quantum(value: float, quantum: float, wanted: float) -> None:
    assert codegen.quantize(value, quantum) == pytest.approx(wanted)


def test_a_missing_reading_stays_missing() -> None:
    assert math.isnan(codegen.quantize(math.nan, 0.05))


def test_a_sample_reads_logs_and_commands_late() -> None:
    cp = np.concatenate([C, [1e-4, 100.0, 1.0, 0.0]])
    cs = np.zeros(at.L_STATES + 2 * at.L_ROW)
    first, second = at.L_STATES, at.L_STATES + at.L_ROW
    cs[first + at.L_NOISE_X : first + at.L_NOISE_P2 + 1] = 0.4e-4, 160.0, -160.0
    assert codegen.control(0, 0.15, 0.1, 3e5, 3.7e5, cs, cp) == (-0.5, -0.5)  # shut
    assert cs[first + at.L_READ_X : first + at.L_READ_P2 + 1] == pytest.approx([0.1, 3.002e5, 3.698e5])
    assert codegen.control(1, 0.15, 0.1, 3e5, 3.7e5, cs, cp) == (cs[first + at.L_U1], cs[first + at.L_U2])
    logged = {
        "U1": at.L_U1, "U2": at.L_U2, "LOAD": at.L_LOAD, "P1_REF": at.L_P1_REF, "P2_REF": at.L_P2_REF,
        "FLOW1": at.L_FLOW1, "X_SHAPED": at.L_X_SHAPED, "V": at.L_V, "FORCE": at.L_FORCE,
    }  # fmt: skip
    for name, column in logged.items():
        assert cs[second + column] == of(cs, name)[0]
    assert cs[second + at.L_U1] != cs[first + at.L_U1]
