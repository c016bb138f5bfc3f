"""A piston whose seals are elastic: how it is told from one that sticks rigidly, and what is then done near rest."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.closed_loop.acceptance import NOMINAL_AXIS, check_acceptance
from pneucli.closed_loop.metrics import evaluate_run
from pneucli.closed_loop.scenarios import read_scenarios
from pneucli.closed_loop.simulation import simulate
from pneucli.controller import layout as at
from pneucli.controller import observers, pressure_level, standstill
from pneucli.controller import standstill as still
from pneucli.design.air_spring import level_for_stiffness, stiffness_per_pressure
from pneucli.design.cascade_design import design_cascade
from pneucli.figure import read
from pneucli.messages import design as words
from pneucli.physics.effects import catalogue
from pneucli.simulate import layout as out
from pneucli.simulate import layout as sim
from tests.controller.test_cascade import C, balanced, of, settings, state
from tests.design import axis

COULOMB, REACH = 10.0, 1e-5


def stirred(force: float, way: float, **given: float) -> np.ndarray:
    s = state(**({"REF_REST_TIME": 1.0, "V": 1e-3, "EXCURSION": way, "X_SHAPED": 0.1} | given))
    observers.detect_motion(force, s, C)
    return s


@pytest.mark.parametrize(
    ("force", "way", "given", "told"),
    [
        (0.4 * COULOMB, 3 * REACH, {}, 1.0),
        (-0.4 * COULOMB, -3 * REACH, {"V": -1e-3}, 1.0),
        (0.6 * COULOMB, 3 * REACH, {}, 0.0),  # a rigid one may slide on
        (0.4 * COULOMB, 3 * REACH, {"PEAK_FORCE": 1.1 * COULOMB}, 0.0),  # it was pushed loose before
        (0.4 * COULOMB, 1 * REACH, {}, 0.0),  # noise goes as far
        (0.4 * COULOMB, 3 * REACH, {"REF_REST_TIME": 0.0}, 0.0),  # it shall move
        (
            0.4 * COULOMB,
            3 * REACH,
            {"FROM_HOLD": 1.0, "FIRST_FORCE": 0.4 * COULOMB},
            0.0,
        ),  # a load: the air pushes no more
        (
            -0.4 * COULOMB,
            -3 * REACH,
            {"FROM_HOLD": 1.0, "V": -1e-3, "LOAD": -0.4 * COULOMB},
            0.0,
        ),  # nor does it where the load rises
        (0.4 * COULOMB, 3 * REACH, {"FIRST_FORCE": 0.4 * COULOMB}, 1.0),  # it was not held
        (0.4 * COULOMB, 6e-4, {"ELASTIC": 1.0}, 0.0),  # no spring gives way so far
        (0.4 * COULOMB, 3 * REACH, {"ELASTIC": 1.0, "X_SHAPED": 0.101}, 0.0),  # a load took it away
    ],
)
def test_what_moves_under_a_force_that_friction_surely_holds_is_elastic(
    force: float, way: float, given: dict[str, float], told: float
) -> None:
    assert of(stirred(force, way, **given), "ELASTIC") == [told]


@pytest.mark.parametrize(
    ("force", "given", "told"),
    [
        (1.1 * COULOMB, {}, -1.0),  # a spring would have given way
        (-1.1 * COULOMB, {}, -1.0),
        (0.9 * COULOMB, {}, 1.0),
        (1.1 * COULOMB, {"STILL_X": 0.0999}, 1.0),  # it did
        (1.1 * COULOMB, {"LOAD": 1.1 * COULOMB}, 1.0),  # the air pushes as before
        (0.4 * COULOMB, {"ELASTIC": -1.0, "EXCURSION": 3 * REACH}, -1.0),  # what is refuted is not found again
        (0.4 * COULOMB, {"ELASTIC": -1.0, "REF_REST_TIME": 0.0}, 0.0),  # until it moves on
    ],
)
def test_what_stands_while_the_air_pushes_by_friction_more_or_less_is_rigid(
    force: float, given: dict[str, float], told: float
) -> None:
    assert of(stirred(force, 0.0, **({"ELASTIC": 1.0, "STILL_X": 0.1, "V": 0.0} | given)), "ELASTIC") == [told]


@pytest.mark.parametrize("elastic", [True, False])
@pytest.mark.parametrize(("before", "after"), [(2.0, 3.0), (9.0, 10.0), (100.0, 100.0)])
def test_an_overshoot_never_narrows_a_dead_band(elastic: bool, before: float, after: float) -> None:
    """Half of a swing may be wider than an overshoot makes it."""
    s = state(LAST_SIGN=1.0, DEADBAND_GAIN=before, RAMP_GAIN=0.5)
    (still.drive_elastic_piston if elastic else still.slow_down_after_overshoot)(-2e-5, s, C)
    assert of(s, "DEADBAND_GAIN") == [after]


def test_the_way_counts_from_where_it_last_turned() -> None:
    assert of(stirred(1.0, 3 * REACH, V=-1e-3), "EXCURSION", "PEAK_FORCE") == pytest.approx([-1e-6, 0.0])


def test_no_more_force_is_put_on_while_the_pressures_are_behind() -> None:
    """By more than static friction: 20 N on 8 cm^2 are 25 kPa."""
    for ahead, grows in ((26e3, False), (24e3, True)):
        s = balanced(8.0, REF_REST_TIME=1.0, V=0.0, MOVING_COUNT=0.0, ELASTIC=1.0, RELEASE_FORCE=3.0)
        s[at.STATE.index("S_P1_REF")] = of(s, "P1")[0] + ahead
        standstill.drive_elastic_piston(1e-4, s, C)
        assert (of(s, "RELEASE_FORCE")[0] > 3.0) == grows


@pytest.mark.parametrize(
    ("way", "given", "soft"),
    [
        (-3 * REACH, {}, 0.7),  # it turned: the loop swings on the seals
        (-3 * REACH, {"LOOP_GAIN": 0.06}, 0.05),
        (3 * REACH, {}, 1.0),  # it goes on
        (-REACH, {}, 1.0),  # noise turns as well
        (-3 * REACH, {"ELASTIC": 0.0}, 1.0),
        (-3 * REACH, {"REF_REST_TIME": 0.0}, 1.0),
        (0.0, {"X_SHAPED": 0.101, "LOOP_GAIN": 0.2}, 1.0),  # a load took it away: all firmness is needed
    ],
)
def test_a_loop_that_swings_on_elastic_seals_loses_firmness_at_each_turn(
    way: float, given: dict[str, float], soft: float
) -> None:
    assert of(stirred(1.0, way, **({"ELASTIC": 1.0} | given)), "LOOP_GAIN") == pytest.approx([soft])


def test_how_long_it_had_not_stirred_is_kept_for_the_first_sample_in_which_it_does() -> None:
    still_, begins, goes_on = (
        stirred(0.0, 0.0, MOVING_COUNT=stirs, REST_TIME=0.05, ANCHOR=anchor)
        for stirs, anchor in ((0.0, 0.1), (0.0, 0.099), (1.0, 0.099))
    )
    assert [of(s, "REST_TIME")[0] for s in (still_, begins, goes_on)] == pytest.approx([0.051, 0.05, 0.0])


@pytest.mark.parametrize(
    ("given", "tells"),
    [
        ({"REF_REST_TIME": 1.0}, False),
        ({"REF_REST_TIME": 0.0}, True),
        ({"REF_REST_TIME": 1.0, "ELASTIC": 0.0}, True),
        ({"REF_REST_TIME": 0.0, "MOVING_COUNT": 0.0}, True),
        ({"REF_REST_TIME": 1.0, "ELASTIC": 0.0, "MOVING_COUNT": 0.0}, False),
    ],
)
def test_an_elastic_piston_near_its_rest_tells_no_load(given: dict[str, float], tells: bool) -> None:
    assert bool(observers.load_observable(state(**({"ELASTIC": 1.0, "X_SHAPED": 0.1} | given)))) == tells


def test_the_force_on_one_that_sticks_grows_in_proportion_to_what_it_has_grown_by() -> None:
    """10 1/s of 8 N, and at least twice static friction a second."""
    s = state(MOVING_COUNT=0.0, FORCE_RAMP=8.0)
    standstill.drive_elastic_piston(2e-5, s, C)
    assert of(s, "RELEASE_FORCE", "FORCE_RAMP") == pytest.approx([0.08, 8.08])
    s = state(MOVING_COUNT=0.0)
    standstill.drive_elastic_piston(-2e-5, s, C)
    assert of(s, "RELEASE_FORCE") == pytest.approx([-0.04])


def test_each_landing_on_the_other_side_puts_up_with_half_as_much_again() -> None:
    s = state(LAST_SIGN=1.0)
    standstill.drive_elastic_piston(-2e-5, s, C)
    assert of(s, "DEADBAND_GAIN") == [1.5]
    s = state(LAST_SIGN=1.0, DEADBAND_GAIN=9.0)
    standstill.drive_elastic_piston(-2e-5, s, C)
    assert of(s, "DEADBAND_GAIN") == [10.0]


def test_a_rigid_piston_that_lands_on_the_other_side_again_and_again_is_put_up_with_too() -> None:
    """From the third landing on, so that a break-away that grows with the rest keeps up no limit cycle."""
    s, wide = state(LAST_SIGN=-1.0, MOVING_COUNT=0.0), []
    for k in range(12):
        still.breakaway_ramp((-1.0) ** k * 1e-3, s, C)
        wide += of(s, "DEADBAND_GAIN")
    assert wide[:4] == [1.0, 1.0, 1.5, 2.25]
    assert wide[-1] == 10.0


def test_what_moves_past_closing_in_is_braked_by_no_more_than_twice_dry_friction() -> None:
    assert standstill.braking_force(1e-4, state(V=5e-4), C) == 0.0  # slower than 10 1/s x 0.1 mm
    assert standstill.braking_force(1e-4, state(V=3e-3), C) == pytest.approx(-100.0 * 2e-3)
    assert standstill.braking_force(0.0, state(V=-1.0), C) == pytest.approx(2.0 * COULOMB)


@pytest.mark.parametrize(
    ("error", "speed", "gain", "held"),
    [
        (0.9, 0.0, 1.0, True),
        (1.5, 0.0, 1.0, True),  # it stands within the tolerance, 2 bands
        (1.5, 2.0, 1.0, False),  # it slides: a better place may come
        (1.7, 0.0, 1.0, False),  # too near to where it would be let go
        (1.9, 0.0, 2.0, True),
    ],
)
def test_what_stands_within_the_tolerance_is_left_alone(error: float, speed: float, gain: float, held: bool) -> None:
    band, step, window = (C[at.PARAMETERS.index(f"C_{n}")] for n in ("HOLDING_BAND", "MOTION_STEP", "MOTION_WINDOW"))
    s = balanced(8.0, REF_REST_TIME=1.0, V=speed * step / window, DEADBAND_GAIN=gain)
    assert bool(standstill.update_hold(of(s, "X")[0] + error * band, s, C)) == held


@pytest.mark.parametrize(("seen", "held"), [(2.1e-3, False), (-2.1e-3, False), (1e-3, True)])
def test_what_slides_under_less_friction_than_the_model_has_is_not_held(seen: float, held: bool) -> None:
    s = balanced(8.0, REF_REST_TIME=1.0, V=0.0, V_SEEN=seen)
    assert bool(standstill.update_hold(of(s, "X")[0], s, C)) == held


def test_the_speed_as_seen_is_that_of_the_readings_where_the_model_has_it_stick() -> None:
    s, speed = balanced(0.0, REF_REST_TIME=1.0, V=0.0), 5e-3
    h, begin = C[at.PARAMETERS.index("C_PERIOD")], of(s, "X")[0]
    for k in range(1, 101):
        observers.observe_motion(begin + speed * k * h, s, C)
    model, seen = of(s, "V", "V_SEEN")
    assert seen == pytest.approx(speed, rel=0.05)
    assert model < 0.9 * seen


def test_held_an_elastic_piston_keeps_its_force() -> None:
    s = balanced(8.0, REF_REST_TIME=1.0, V=0.0, ELASTIC=1.0, RELEASE_FORCE=3.0)
    assert still.update_hold(0.1, s, C)
    assert of(s, "FORCE", "RELEASE_FORCE") == pytest.approx([8.0, 3.0])


@pytest.mark.parametrize("load", [-30.0, 30.0])
def test_a_load_that_pushes_less_far_than_soft_seals_reach_is_seen_at_once(load: float) -> None:
    """It was taken for elastic seals, under which no load is observed, until it had pushed as far as those reach."""
    model, requirements = axis.arranged("5/3")
    model = replace(model, rig=replace(model.rig, stroke=0.45))
    c, time = design_cascade(model, requirements, axis.SEALED), 1e-3 * np.arange(2500)
    found = simulate(model, c, axis.scenario(c, np.full(2500, 0.225), np.where(time > 1.0, load, 0.0)), axis.BENCH)
    off = np.abs(found.model[:, sim.X] - 0.225)
    assert off.max() < 0.6 * c.values["C_PRESLIDING_DISTANCE"]  # 1.6 mm; it went past all of them
    assert off[-500:].max() < 10e-6
    assert of(found.states, "LOAD")[0] == pytest.approx(load, rel=0.1)


@pytest.mark.parametrize("known", [False, True])
def test_an_axis_with_elastic_seals_comes_to_rest_known_or_not(known: bool) -> None:
    """40 kN/m, 0.5 mm before it slides."""
    model, time = axis.model(), 1e-3 * np.arange(4000)
    values = {"presliding.stiffness": 4e4, "presliding.damping": 80.0}
    actual = replace(model, effects=(*model.effects, catalogue()["presliding"])).with_values(values)
    c = design_cascade(actual if known else model, axis.REQUIREMENTS, axis.SEALED)
    found = simulate(actual, c, axis.scenario(c, np.where(time < 0.5, 0.1, 0.13)), axis.BENCH)
    x = found.model[-500:, sim.X]
    assert np.abs(x - 0.13).max() < 50e-6
    assert np.ptp(x) < 5e-6


# --- the pressure level: a second reference where two valves drive the chambers, and what no arrangement can have


MODEL, WANTED = axis.arranged("two")
TIME = 1e-3 * np.arange(4000)


def controller(**stated: float):
    return design_cascade(MODEL, replace(WANTED, **stated))


def stiffness(c, x: np.ndarray, p1: np.ndarray, p2: np.ndarray) -> np.ndarray:
    one, two = stiffness_per_pressure(c.values, x)
    return one * p1 + two * p2


def driven(c, reference=0.1, level_set=None, force=0.0):
    reference = np.broadcast_to(reference, TIME.shape).astype(float)
    scenario = replace(axis.scenario(c, reference, force), level=level_set)
    return simulate(MODEL, c, scenario, axis.BENCH, seed=1)


@pytest.mark.parametrize("force", [0.0, 60.0, -60.0])
def test_the_level_asked_for_makes_the_pressures_as_stiff_as_wished(force: float) -> None:
    c, s = settings(TWO_VALVES=1.0, AIR_STIFFNESS=8e3), state()
    total, bias = 8e-4 + 6e-4, (8e-4 - 6e-4) * 1e5
    wanted = pressure_level.requested_level((force + bias) / total, s, c)
    both = (force + bias - 2e-4 * wanted) / total
    p1, p2 = wanted + both, wanted - both
    assert 8e-4 * p1 - 6e-4 * p2 - bias == pytest.approx(force)
    volume_1, volume_2 = 2e-5 + 8e-4 * 0.1, 3e-5 + 6e-4 * 0.1
    assert 1.4 * (8e-4**2 * p1 / volume_1 + 6e-4**2 * p2 / volume_2) == pytest.approx(8e3)


def test_it_moves_at_its_rate_and_within_what_supply_allows() -> None:
    c, s = settings(TWO_VALVES=1.0, LEVEL_RATE=1e6), state()
    pressure_level.set_level(6.9e5, s, c)
    assert pressure_level.update_level(0.0, s, c) == pytest.approx(3e5 + 1e3)  # from the pressures as they are
    for _ in range(1000):
        pressure_level.update_level(0.0, s, c)
    assert of(s, "LEVEL") == [pytest.approx(6.5e5)]


@pytest.mark.parametrize("reading", [np.nan, -1.0, 1e9])
def test_a_level_that_cannot_be_is_passed_over(reading: float) -> None:
    s = state(LEVEL_SET=4e5)
    pressure_level.set_level(reading, s, settings())
    assert of(s, "LEVEL_SET") == [4e5]


def test_a_stated_level_is_kept_while_the_piston_moves() -> None:
    c = controller(pressure_level=4.5e5)
    reference = np.where(TIME < 1.0, 0.1, 0.12)
    found = driven(c, reference)
    mean = 0.5 * (found.model[-300:, out.P1] + found.model[-300:, out.P2])
    assert np.mean(mean) == pytest.approx(4.5e5, rel=0.03)
    assert evaluate_run(found, MODEL, c).steady_um <= 10.0


def test_a_stated_stiffness_is_there_at_either_end_of_the_stroke() -> None:
    c = controller(air_stiffness=8e3)
    for x in (0.05, 0.1, 0.15):
        found = driven(c, x)
        made = stiffness(c, found.model[-200:, out.X], found.model[-200:, out.P1], found.model[-200:, out.P2])
        assert np.mean(made) == pytest.approx(8e3, rel=0.05)


def test_a_higher_level_lets_a_load_move_the_piston_less() -> None:
    """While it runs: the same load, the level low and then high."""
    push = np.where((TIME > 2.5) & (TIME < 3.2), 150.0, 0.0)
    moved = []
    for asked in (2.2e5, 5.5e5):
        c = controller()
        found = driven(c, 0.1, np.full(TIME.size, asked), push)
        mean = np.mean(0.5 * (found.model[2300:2500, out.P1] + found.model[2300:2500, out.P2]))
        assert mean == pytest.approx(asked, rel=0.05)
        moved.append(np.max(np.abs(found.model[2500:2560, out.X] - 0.1)))
    assert moved[1] < 0.9 * moved[0]


def test_a_reset_keeps_the_level() -> None:
    c = controller()
    duty = np.zeros(TIME.size)
    duty[2000] = at.OPERATING_MODES.index("reset")
    scenario = replace(
        axis.scenario(c, np.full(TIME.size, 0.1)), level=np.where(TIME < 1.5, 5e5, 0.0), operating_mode=duty
    )
    kept = replace(scenario, level=np.full(TIME.size, 5e5))
    for one, wanted in ((scenario, c.values["C_P_MEAN"]), (kept, 5e5)):
        found = simulate(MODEL, c, one, axis.BENCH, seed=1).model[-100:]
        assert np.mean(0.5 * (found[:, out.P1] + found[:, out.P2])) == pytest.approx(wanted, rel=0.05)


@pytest.mark.parametrize(
    ("arrangement", "stated", "name", "why"),
    [
        ("one-chamber", {"air_stiffness": 4e4}, "air_stiffness", "sealed"),
        ("5/3", {"pressure_level": 5e5}, "pressure_level", "leaks and overlap"),
        ("two", {"air_stiffness": 9e4}, "air_stiffness", "supply"),
        ("two", {"air_stiffness": 8e3}, "", ""),
        ("two", {"pressure_level": 5e5}, "", ""),
    ],
)
def test_what_cannot_be_had_is_said_with_its_cause(
    arrangement: str, stated: dict[str, float], name: str, why: str
) -> None:
    model, wanted = axis.arranged(arrangement)
    wanted = replace(wanted, **stated)
    c = design_cascade(model, wanted, axis.SEALED)
    still = [s for s in read_scenarios([], c, "") if s.name == "steps"]
    found = check_acceptance(c, wanted, still, axis.BENCH, [(NOMINAL_AXIS, model)])
    assert [m.demand for m in found.violations] == [name] * bool(name)
    assert all(why in m.cause for m in found.violations)
    assert [d.name for d in found.criteria][2:] == list(stated)
    rows = [m.__dict__ for m in found.violations]
    told = list(read(words.Gate, {"missed": rows, "model_error": None, "model_error_limit": 2.0}).violations)
    assert len(told) == len(rows)


def test_the_level_of_a_stiffness_is_the_formula_turned_round() -> None:
    c = controller()
    x = np.array([0.04, 0.1, 0.16])
    mean = level_for_stiffness(c.values, 1.5e4, x)
    one, two = stiffness_per_pressure(c.values, x)
    assert (one + two) * mean == pytest.approx(np.full(3, 1.5e4))  # of equal areas
