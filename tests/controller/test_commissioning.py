"""Commissioning: null, delay and gain on a machine that differs from the model, limits, and the watch at standstill."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pneucli.closed_loop import commissioning as runs
from pneucli.closed_loop.commissioning import Commissioned, commissioned, with_time
from pneucli.closed_loop.simulation import ClosedLoopSetup, Run, simulate
from pneucli.controller import commissioning as chart
from pneucli.controller import layout as at
from pneucli.controller import operation
from pneucli.controller.parameters import Controller
from pneucli.design.cascade_design import design_cascade
from pneucli.simulate import layout as sim
from pneucli.simulate.model import Model
from tests.controller.test_cascade import C, settings, state
from tests.design import axis

LAG, DELAY = runs.added_times()
SAMPLES, BEGUN = 12_000, 200
STEPS = np.repeat([0.1, 0.13, 0.07], [6000, 3000, 3000])  # m
NULL_ERROR, TIME_ERROR = 0.06, 1.2e-3  # V, s: what noise of 400 Pa leaves of a null and of a delay
MAX_REST_ERROR = 50e-6  # m


@cache
def family(arrangement: str = "one-chamber") -> tuple[Model, Controller]:
    model, wanted = axis.arranged(arrangement)
    made = design_cascade(model, wanted, axis.SEALED)
    return model, runs.with_commissioning(
        model, made, lambda slower: design_cascade(slower, wanted, axis.SEALED), axis.BENCH
    )


def driven(
    model: Model,
    c: Controller,
    *,
    begun: bool = True,
    seed: int = 0,
    setup: ClosedLoopSetup = axis.BENCH,
    **more: object,
) -> Run:
    mode = np.zeros(SAMPLES)
    mode[BEGUN] = at.OPERATING_MODES.index("commission") * begun
    scenario = axis.scenario(c, STEPS, **({"operating_mode": mode} | more))
    return simulate(model, c, scenario, setup, seed)


def without_family(c: Controller) -> Controller:
    """The controller without the gains that the watch at standstill would go to."""
    return replace(c.with_values(C_FAMILY_MEMBERS=0.0), family=())


def error_at_rest(run: Run) -> float:
    error = np.abs(run.model[:, sim.X] - STEPS)
    return float(max(error[8500:9000].max(), error[11_500:].max()))


def moved(run: Run, until: int) -> tuple[float, float]:
    """How far the piston moved, and the pressures changed, from the first sample of the relay test on."""
    part = run.model[BEGUN + 300 : until]
    away = np.abs(part - part[0]).max(axis=0)
    return float(away[sim.X]), float(max(away[sim.P1], away[sim.P2]))


def ended(run: Run) -> int:
    """The sample at which the test ended: from then on the reference is followed."""
    return SAMPLES - round(float(run.states[at.S_COMMISSIONING_TIME]) / 1e-3)


@pytest.mark.parametrize("arrangement", axis.ARRANGEMENTS)
def test_a_machine_like_its_model_keeps_its_gains(arrangement: str) -> None:
    model, c = family(arrangement)
    run = driven(model, c)
    found = commissioned(run.states)
    assert (found.state, found.member) == ("commissioned", 1)
    assert found.null_1 == pytest.approx(0.0, abs=NULL_ERROR)
    assert found.null_2 == pytest.approx(0.0, abs=NULL_ERROR)
    assert found.gain == pytest.approx(1.0, abs=0.15)
    assert error_at_rest(run) < 10e-6


@pytest.mark.parametrize(
    ("arrangement", "null"),
    [
        *((arrangement, null) for arrangement in axis.ARRANGEMENTS for null in (-0.2, 0.2)),
        ("one-chamber", 0.5),
        ("5/3", 0.5),
    ],
)
def test_it_finds_the_null_of_each_valve(arrangement: str, null: float) -> None:
    model, c = family(arrangement)
    run = driven(model.with_values({"valve.null": null}), c)
    found = commissioned(run.states)
    assert found.null_1 == pytest.approx(null, abs=NULL_ERROR)
    assert found.null_2 == pytest.approx(null if arrangement == "two" else 0.0, abs=NULL_ERROR)
    assert error_at_rest(run) < 10e-6


def test_two_valves_that_leak_by_a_null_of_half_a_volt_end_at_a_limit() -> None:
    """The valve whose turn it is not fills its chamber meanwhile."""
    model, c = family("two")
    in_state(driven(model.with_values({"valve.null": 0.5}), c), 11, c)


def test_a_null_of_half_a_volt_moves_the_valve_at_rest_before_it_and_not_after() -> None:
    model, c = family()
    off = model.with_values({"valve.null": 0.5})
    before, after = driven(off, c, begun=False), driven(off, c)
    assert np.ptp(before.log[11_500:, at.L_U1]) > 2.0 * np.ptp(after.log[11_500:, at.L_U1])


@pytest.mark.parametrize("arrangement", axis.ARRANGEMENTS)
def test_a_hose_of_10_ms_swings_by_millimetres_before_it_and_holds_after(arrangement: str) -> None:
    model, c = family(arrangement)
    slow = with_time(model, *DELAY, 10e-3)
    before, after = driven(slow, without_family(c), begun=False), driven(slow, c)
    found = commissioned(after.states)
    assert error_at_rest(before) > 1e-3
    assert error_at_rest(after) < 0.1 * error_at_rest(before)
    assert found.delay == pytest.approx(10e-3 + 2e-3, abs=TIME_ERROR)  # 2 ms without the hose
    assert found.overshoot > 0.7 * found.delay


@pytest.mark.parametrize("arrangement", axis.ARRANGEMENTS)
def test_pressures_read_15_ms_late_hold_after_it(arrangement: str) -> None:
    model, c = family(arrangement)
    slow = with_time(model, "time-skew", "delay", 15e-3)
    assert error_at_rest(driven(slow, c, begun=False)) > 4.0 * MAX_REST_ERROR
    assert error_at_rest(driven(slow, c)) < MAX_REST_ERROR


@pytest.mark.parametrize("arrangement", axis.ARRANGEMENTS)
def test_a_lag_is_told_from_a_delay(arrangement: str) -> None:
    model, c = family(arrangement)
    found = commissioned(driven(with_time(model, *LAG, 10e-3), c).states)
    assert found.delay == pytest.approx(10e-3 + 2e-3, abs=TIME_ERROR)
    assert found.overshoot < 0.5 * found.delay
    numbers = c.family[found.member]
    assert numbers[0] == pytest.approx(found.delay, abs=TIME_ERROR)
    assert numbers[1] < 0.5 * numbers[0]


@pytest.mark.parametrize(
    ("kind", "sensor"), [(LAG, ("pressure-lag", "time_constant")), (DELAY, ("time-skew", "delay"))]
)
def test_the_relay_cannot_tell_late_sensors_from_a_slow_spool_or_a_hose(
    kind: tuple[str, str], sensor: tuple[str, str]
) -> None:
    model, c = family()
    found, other = (commissioned(driven(with_time(model, *one, 10e-3), c).states) for one in (kind, sensor))
    assert other.delay == pytest.approx(found.delay, abs=TIME_ERROR)
    assert (other.overshoot > 0.5 * other.delay) == (found.overshoot > 0.5 * found.delay) == (kind == DELAY)


@pytest.mark.parametrize("arrangement", axis.ARRANGEMENTS)
@pytest.mark.parametrize(
    ("kind", "size"), [(LAG, 10e-3), (DELAY, 5e-3), (DELAY, 20e-3), (("time-skew", "delay"), 20e-3)]
)
@pytest.mark.parametrize("null", [0.0, 0.5])
def test_it_stays_within_the_limits(arrangement: str, kind: tuple[str, str], size: float, null: float) -> None:
    model, c = family(arrangement)
    run = driven(with_time(model, *kind, size).with_values({"valve.null": null}), c)
    steps_at = int(np.argmax(STEPS[0] != STEPS))  # a loop that backs off at rest counts its time anew
    travel, pressure = moved(run, min(ended(run), steps_at))
    assert travel < c.values["C_TRAVEL_LIMIT"]
    assert pressure < c.values["C_PRESSURE_LIMIT"]


def in_state(run: Run, wanted: int, c: Controller) -> Commissioned:
    """Check that a test ended without a result: shut valves, gains and nulls as before."""
    found = commissioned(run.states)
    assert found.state == runs.STATES[wanted]
    assert (found.member, found.null_1, found.null_2) == (0, 0.0, 0.0)
    assert np.all(run.log[-1000:, at.L_U1] == 0.5 * (c.fill[0] + c.vent[0]))
    return found


def test_a_piston_without_friction_reaches_the_limit_of_travel_and_stays_within_it() -> None:
    model, c = family()
    loose = model.with_values({"friction.coulomb": 0.0, "stribeck.static": 0.1, "friction.viscous": 0.0})
    c = c.with_values(C_TRAVEL_LIMIT=0.2e-3)
    run = driven(loose, c, level=None)
    in_state(run, 11, c)
    assert moved(run, ended(run))[0] < 0.2e-3


def test_the_limit_of_pressure_ends_it() -> None:
    model, c = family()
    c = c.with_values(C_PRESSURE_LIMIT=9e3)
    run = driven(model, c)
    in_state(run, 12, c)
    assert moved(run, ended(run))[1] < 9e3


def test_a_valve_that_does_not_move_is_named() -> None:
    model, c = family()
    stuck = replace(model, valve=model.valve.scaled(1e-6))
    in_state(driven(stuck, c), 13, c)


def test_a_fault_of_the_second_valve_leaves_both_shut_at_the_nulls_of_the_design() -> None:
    """Its test is complete, and both nulls are found, when the rate tells that the machine is another one."""
    model, c = family("two")
    weak = replace(model, valve_2=model.chamber_2_valve.scaled(0.35)).with_values({"valve.null": 0.2})
    run = driven(weak, c)
    in_state(run, 17, c)
    assert np.any(run.log[:, at.L_U2] != run.log[-1, at.L_U2])  # it was tested
    assert np.all(run.log[-1000:, at.L_U2] == 0.5 * (c.fill_2[0] + c.vent_2[0]))


@pytest.mark.parametrize(
    ("noise", "names"), [({"noise_x": 20e-6}, 15), ({"noise_p": 2e3}, 15), ({"noise_p": 600.0}, 4)]
)
def test_noise_beyond_what_the_test_can_bear_is_named(noise: dict[str, float], names: int) -> None:
    model, c = family()
    found = commissioned(driven(model, c, setup=replace(axis.BENCH, **noise)).states)
    assert found.state == runs.STATES[names]


@pytest.mark.parametrize("reading", ["x", "p1", "p2"])
def test_a_missing_reading_ends_it(reading: str) -> None:
    model, c = family()
    in_state(driven(model, c, dropouts=((reading, 0.8, 20.0),)), 14, c)
    assert commissioned(driven(model, c, dropouts=((reading, 0.8, 0.804),)).states).state == "commissioned"


def test_disabling_stops_it_and_enabling_goes_on_as_designed() -> None:
    model, c = family()
    mode = np.zeros(SAMPLES)
    mode[BEGUN], mode[900:1000], mode[1500:1600] = 5.0, 2.0, 2.0
    run = driven(model, c, operating_mode=mode)
    assert np.all(run.log[1001:1500, at.L_U1] == 0.5 * (c.fill[0] + c.vent[0]))  # stopped: shut until disabled again
    assert commissioned(run.states).state == "as designed"
    assert error_at_rest(run) < 10e-6


def test_a_disabled_controller_does_not_begin() -> None:
    s = np.concatenate([state(), np.zeros(at.MAX_LAW_STATES)])
    operation.enable(0.0, s)
    chart.commission(0.0, 0.0, s, C)
    assert s[at.S_COMMISSIONING] == 0.0


def test_limits_are_those_of_the_caller_else_those_of_the_design() -> None:
    s = state()
    chart.commission(1e-3, 0.0, s, C)
    assert (s[at.S_TRAVEL_LIMIT], s[at.S_PRESSURE_LIMIT]) == (1e-3, 1e5)
    chart.commission(0.0, 2e4, s, C)
    assert (s[at.S_TRAVEL_LIMIT], s[at.S_PRESSURE_LIMIT]) == (4e-3, 2e4)


def test_a_second_commissioning_adds_to_the_first() -> None:
    model, c = family()
    mode = np.zeros(SAMPLES)
    mode[[BEGUN, 3000]] = 5.0
    found = commissioned(driven(model.with_values({"valve.null": 0.3}), c, operating_mode=mode).states)
    assert found.state == "commissioned"
    assert found.null_1 == pytest.approx(0.3, abs=NULL_ERROR)


def test_a_shifted_table_keeps_its_end_and_its_order() -> None:
    for shift in (0.4, -0.4):
        c = settings()
        before = c[at.C_TABLE : at.C_TABLE + 5].copy()
        chart.shift_table(shift, at.C_TABLE, c)
        after = c[at.C_TABLE : at.C_TABLE + 5]
        assert after[:4] == pytest.approx(before[:4] + shift)
        assert after[4] == before[4]
    c = settings()
    chart.shift_table(5.0, at.C_TABLE + 5, c)  # venting, -2 to -9 V
    assert list(c[at.C_TABLE + 5 : at.C_TABLE + 10]) == [3.0, 2.0, 0.0, -2.0, -9.0]


# --- the watch at standstill


def watched(x: np.ndarray, members: tuple[float, ...] = (2e-3, 5e-3)) -> tuple[np.ndarray, np.ndarray]:
    """Feed positions to the watch of a controller with a family of one gain, C_KP; return the state and parameters."""
    row = [float(at.C_KP), *(v for delay in members for v in (delay, 0.0, 1e3 * delay))]
    c = settings(FAMILY=0.0, FAMILY_MEMBERS=float(len(members)), FAMILY_WIDTH=1.0)
    c[at.C_FAMILY] = c.size
    c = np.concatenate([c, row])
    s = state(COMMISSIONING=4.0, REF_REST_TIME=2.0, MEMBER=1.0, SWING_EDGE=float(x[0]), SWING_PEAK=float(x[0]))
    for value in x:
        chart.watch_limit_cycle(value, s, c)
    return s, c


def swing(seconds: float, size: float = 100e-6, decay: float = 0.0, frequency: float = 2.0) -> np.ndarray:
    time = 1e-3 * np.arange(round(1e3 * seconds))
    return 0.1 + size * np.exp(-decay * time) * np.sin(2 * np.pi * frequency * time)


def test_a_limit_cycle_goes_to_the_next_longer_delay_and_then_holds_within_it() -> None:
    s, c = watched(swing(1.3))  # the first half swing, from the middle, is a short one
    assert (s[at.S_COMMISSIONING], s[at.S_MEMBER], c[at.C_KP]) == (5.0, 2.0, 5.0)
    assert s[at.S_SWING_AMPLITUDE] == pytest.approx(200e-6, rel=0.02)
    assert s[at.S_SWING_PERIOD] == pytest.approx(0.5, rel=0.02)
    s, c = watched(swing(12.0), (2e-3, 9e-3, 5e-3))  # the second, of a lag, is for a longer delay than the last
    assert (s[at.S_COMMISSIONING], s[at.S_MEMBER], c[at.C_KP]) == (6.0, 3.0, 5.0)
    assert s[at.S_DEADBAND_GAIN] * c[at.C_HOLDING_BAND] == pytest.approx(100e-6, rel=0.02)


def test_a_swing_slower_than_the_loop_is_one_that_sticks_and_is_held_within() -> None:
    s, c = watched(swing(12.0, frequency=0.4))
    assert (s[at.S_COMMISSIONING], s[at.S_MEMBER], c[at.C_KP]) == (4.0, 1.0, settings()[at.C_KP])
    assert s[at.S_DEADBAND_GAIN] * c[at.C_HOLDING_BAND] == pytest.approx(100e-6, rel=0.02)


TIME = 1e-3 * np.arange(5000)
LOADED_ONCE = 0.1 + sum(
    size * np.where(after > 0.0, np.exp(-4.0 * after) * np.cos(8.0 * after), 0.0)
    for size, after in ((1e-3, TIME - 1.0), (-1e-3, TIME - 3.0))
)


@pytest.mark.parametrize(
    "x", [swing(5.0, size=50e-3, decay=3.0), swing(5.0, size=9e-6), 0.1 + 1e-3 * TIME / 5.0, swing(0.85), LOADED_ONCE]
)
def test_what_decays_or_is_small_or_drifts_or_is_short_is_no_limit_cycle(x: np.ndarray) -> None:
    assert watched(x)[0][at.S_COMMISSIONING] == 4.0


def test_a_limit_cycle_in_the_loop_is_backed_off() -> None:
    """The family mistakes a hose of 20 ms for none; the member after that is for the hose."""
    model, c = family()
    slow = with_time(model, *DELAY, 20e-3)
    hose = next(i for i, row in enumerate(c.family) if i and row[0] > 20e-3 and row[1] > 17e-3)
    plain, member = c.family[1], c.family[hose]
    delay = commissioned(driven(slow, c).states)
    wrong = replace(c, family=(c.family[0], (delay.delay, delay.overshoot, *plain[2:]), (1.0, 1.0, *member[2:])))
    wrong = wrong.with_values(C_FAMILY_MEMBERS=2.0)
    alone = replace(wrong, family=wrong.family[:2]).with_values(C_FAMILY_MEMBERS=1.0)
    with_watch, without = driven(slow, wrong), driven(slow, alone)
    assert commissioned(with_watch.states).state == "slower after a limit cycle"
    assert commissioned(without.states).state == "a limit cycle persists"
    assert error_at_rest(with_watch) < 0.1 * error_at_rest(without)


@pytest.mark.parametrize("arrangement", axis.ARRANGEMENTS)
def test_an_untold_hose_of_15_ms_is_backed_off_without_a_commissioning(arrangement: str) -> None:
    model, c = family(arrangement)
    slow = with_time(model, *DELAY, 15e-3)
    before, after = (driven(slow, one, begun=False) for one in (without_family(c), c))
    found = commissioned(after.states)
    assert (found.state, found.delay) == ("slower after a limit cycle", 0.0)
    assert error_at_rest(after) < 0.2 * error_at_rest(before)
    assert commissioned(before.states) == Commissioned("as designed", 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0.0, 0.0)


def test_what_moves_a_piston_that_was_held_for_good_is_no_part_of_a_swing_before() -> None:
    """A ring, a long hold, then a load that is gone are no limit cycle."""
    x = swing(0.9)
    s, c = watched(x)
    before = s[at.S_SWING_COUNT]
    chart.watch_limit_cycle(x[-1], s, c)
    assert before == s[at.S_SWING_COUNT] > 0.0
    s[[at.S_HOLD, at.S_REST_TIME]] = 1.0, 1e3
    chart.watch_limit_cycle(x[-1], s, c)
    assert s[at.S_SWING_COUNT] == 0.0


def test_a_machine_like_its_model_keeps_its_gains_without_a_commissioning() -> None:
    model, c = family()
    assert commissioned(driven(model, c, begun=False).states).state == "as designed"
