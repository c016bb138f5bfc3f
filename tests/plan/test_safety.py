"""A manoeuvre is refused where any model exceeds a limit or the reserve before it, and the refusal names the model."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.physics.effects import catalogue
from pneucli.plan.bench import LOOP_RANGE, described_benches
from pneucli.plan.first import extreme_models, typical_model
from pneucli.plan.limits import (
    SHIFTED_BEST,
    SHIFTED_RIVAL,
    Safety,
    limits_of,
    models_to_check,
    shifted_models,
    violations,
    with_monotone_valves,
)
from pneucli.plan.manoeuvres import candidate_manoeuvres
from pneucli.plan.simulation import is_followed, simulate_manoeuvre, start_of
from pneucli.recording import Rig
from pneucli.simulate.model import Model
from pneucli.simulate.valve_forms import ValveArea
from pneucli.stages.plan import with_kept_loop

RIG = Rig(supply_pressure=7e5, piston_area_1=8e-4, stroke=0.2, dead_volume_1=3e-5, dead_volume_2=3e-5, moving_mass=2.0)
BENCHES = described_benches(RIG)
MODEL = typical_model(RIG, BENCHES)
LIMITS = limits_of(RIG, BENCHES)
SPRING = {"spring-force.stiffness": 2000.0, "spring-force.rest_position": -0.05}
HOLD = next(m for m in candidate_manoeuvres(BENCHES[-1], LIMITS) if m.kind == "hold")


@cache
def top_speed() -> float:
    return float(np.abs(simulate_manoeuvre(HOLD, MODEL).v).max())


def test_a_rival_that_exceeds_a_limit_refuses_what_the_best_model_allows() -> None:
    models = extreme_models(MODEL)
    limits = replace(LIMITS, max_speed=1.3 * top_speed())
    alone, all_models = Safety(RIG, limits, {"typical model": MODEL}), Safety(RIG, limits, models)
    assert alone(HOLD)
    assert not all_models(HOLD)
    (refused,) = all_models.refused
    assert refused.model == "fast valve, little friction"
    assert refused.violations[0].quantity == "v"


def test_a_simulation_has_to_leave_a_reserve() -> None:
    assert Safety(RIG, replace(LIMITS, max_speed=1.2 * top_speed()), {"best": MODEL})(HOLD)
    assert not Safety(RIG, replace(LIMITS, max_speed=1.05 * top_speed()), {"best": MODEL})(HOLD)


def test_a_spring_return_starts_in_balance_and_may_stand_on_its_end() -> None:
    spring = Model(RIG, (catalogue()["spring-force"],), {**MODEL.values, **SPRING}, valve=MODEL.valve)
    bench = replace(BENCHES[-1], template=replace(BENCHES[-1].template, chamber_2="open"))
    for x in (0.1, 0.0):
        hold = replace(HOLD, bench=replace(bench, start=replace(bench.start, x=x)))
        start = start_of(hold, spring)
        assert start.p1 - RIG.ambient_pressure == pytest.approx(2000.0 * (x + 0.05) / RIG.piston_area_1)
        motion = simulate_manoeuvre(hold, spring)
        assert np.abs(motion.v[:100]).max() < 1e-3
        assert (x == 0.0) == bool(motion.x[0] < LIMITS.position[0])
        assert not [one for one in violations(motion, LIMITS, RIG) if one.quantity == "x" and one.value < 0.05]


def test_a_load_that_pushes_outward_is_balanced_by_chamber_2() -> None:
    start = BENCHES[-1].balanced_start(0.1, -100.0)
    assert start.p1 * RIG.piston_areas[0] - start.p2 * RIG.piston_areas[1] == pytest.approx(
        RIG.ambient_pressure * (RIG.piston_areas[0] - RIG.piston_areas[1]) - 100.0
    )


def test_a_loop_that_is_too_fast_for_the_rig_gets_a_smaller_gain() -> None:
    bench = replace(next(b for b in BENCHES if b.drive == "position"), loop_range=LOOP_RANGE)
    wide, narrow = Safety(RIG, LIMITS, {"best": MODEL}), Safety(RIG, replace(LIMITS, max_speed=0.05), {"best": MODEL})
    assert with_kept_loop(bench, wide) is bench
    assert with_kept_loop(bench, narrow).loop_range > LOOP_RANGE
    assert not narrow.refused


def test_a_loop_that_is_too_weak_for_its_valve_moves_nothing() -> None:
    bench = replace(next(b for b in BENCHES if b.drive == "position"), loop_range=LOOP_RANGE)
    sine = next(m for m in candidate_manoeuvres(bench, LIMITS) if m.kind == "motion-sine")
    assert is_followed(sine, MODEL)
    assert not is_followed(replace(sine, bench=replace(bench, loop_range=1e3)), MODEL)


def fit(mass: float, error: float) -> Any:
    values = {"rig.moving_mass": mass, "friction.coulomb": 10.0}
    free = (
        FreeParameter("rig.moving_mass", "kg", mass, 0.0, 100.0, 1.0),
        FreeParameter("friction.coulomb", "N", 10.0, 0.0, 100.0, 10.0),
    )
    return SimpleNamespace(model=Model(Rig(), (), values), free=free, covariance=np.diag([error**2, 0.01]))


def test_shifted_parameters_lie_two_standard_errors_away_and_within_their_bounds() -> None:
    fitted = fit(1.0, 0.2)
    models = shifted_models(fitted, fitted.model, 40, seed=1)
    masses = np.array([m.values["rig.moving_mass"] for m in models])
    coulomb = np.array([m.values["friction.coulomb"] for m in models])
    assert np.abs(masses - 1.0).max() == pytest.approx(0.4)
    assert np.abs(coulomb - 10.0).max() == pytest.approx(2.0)  # 2 x 0.1 of a scale of 10 N
    assert np.std(masses) > 0.1


def test_the_best_model_and_each_rival_are_checked_off_by_their_intervals_as_well() -> None:
    best = fit(1.0, 0.2)
    models = models_to_check(best, {"a leak": best.model})
    assert len(models) == 2 + SHIFTED_BEST + SHIFTED_RIVAL
    assert models["best model"] is best.model
    values = {tuple(m.values.values()) for m in models.values()}
    assert len(values) == 1 + SHIFTED_BEST + SHIFTED_RIVAL


def test_a_valve_that_is_off_by_its_intervals_still_passes_less_near_its_null() -> None:
    """The area at 0.1 V, within the dead zone, may be off by orders of magnitude."""
    valve = ValveArea((-2.0, -1.0, -0.1, 0.1, 1.0, 2.0), (9e-7, 4e-7, 1e-3, 1e-3, 3e-7, 8e-7), 0.05, 0.05)
    model = with_monotone_valves(Model(Rig(), (), {}, valve))
    assert isinstance(model.valve, ValveArea)
    assert model.valve.areas == (9e-7, 4e-7, 4e-7, 3e-7, 3e-7, 8e-7)
