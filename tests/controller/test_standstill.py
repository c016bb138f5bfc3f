"""A piston whose seals are elastic: how it is told from one that sticks rigidly, and what is then done near rest."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.closed_loop.acceptance import NOMINAL_AXIS, check_acceptance
from pneucli.closed_loop.metrics import evaluate_run
from pneucli.closed_loop.scenarios import read_scenarios
from pneucli.closed_loop.simulation import simulate
from pneucli.controller import layout as at
from pneucli.controller import observers, reference
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


def test_a_rigid_piston_that_lands_on_the_other_side_again_and_again_is_put_up_with_too() -> None:
    """From the third landing on, so that a break-away that grows with the rest keeps up no limit cycle."""
    s, wide = state(LAST_SIGN=-1.0, MOVING_COUNT=0.0), []
    for k in range(12):
        still.breakaway_ramp((-1.0) ** k * 1e-3, s, C)
        wide += of(s, "DEADBAND_GAIN")
    assert wide[:4] == [1.0, 1.0, 1.5, 2.25]
    assert wide[-1] == 10.0


def test_the_speed_as_seen_is_that_of_the_readings_where_the_model_has_it_stick() -> None:
    s, speed = balanced(0.0, REF_REST_TIME=1.0, V=0.0), 5e-3
    h, begin = C[at.PARAMETERS.index("C_PERIOD")], of(s, "X")[0]
    for k in range(1, 101):
        observers.observe_motion(begin + speed * k * h, s, C)
    model, seen = of(s, "V", "V_SEEN")
    assert seen == pytest.approx(speed, rel=0.05)
    assert model < 0.9 * seen


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
    wanted = reference.requested_level((force + bias) / total, s, c)
    both = (force + bias - 2e-4 * wanted) / total
    p1, p2 = wanted + both, wanted - both
    assert 8e-4 * p1 - 6e-4 * p2 - bias == pytest.approx(force)
    volume_1, volume_2 = 2e-5 + 8e-4 * 0.1, 3e-5 + 6e-4 * 0.1
    assert 1.4 * (8e-4**2 * p1 / volume_1 + 6e-4**2 * p2 / volume_2) == pytest.approx(8e3)


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
