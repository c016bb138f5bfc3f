"""A manoeuvre is refused where any model exceeds a limit or the reserve before it, and the refusal names the model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pneucli.plan.bench import described_benches
from pneucli.plan.first import extreme_models, typical_model
from pneucli.plan.limits import limits_of
from pneucli.plan.manoeuvres import candidate_manoeuvres
from pneucli.plan.safety import Safety
from pneucli.plan.simulation import simulate_manoeuvre
from pneucli.recording import Rig

RIG = Rig(supply_pressure=7e5, piston_area_1=8e-4, stroke=0.2, dead_volume_1=3e-5, dead_volume_2=3e-5, moving_mass=2.0)
BENCHES = described_benches(RIG)
MODEL = typical_model(RIG, BENCHES)
LIMITS = limits_of(RIG, BENCHES)
HOLD = next(m for m in candidate_manoeuvres(BENCHES[-1], LIMITS) if m.kind == "hold")
SPEED = float(np.abs(simulate_manoeuvre(HOLD, MODEL).v).max())


def test_a_rival_that_exceeds_a_limit_refuses_what_the_best_model_allows() -> None:
    models = extreme_models(MODEL)
    limits = replace(LIMITS, max_speed=1.3 * SPEED)
    alone, all_models = Safety(RIG, limits, {"typical model": MODEL}), Safety(RIG, limits, models)
    assert alone(HOLD)
    assert not all_models(HOLD)
    (refused,) = all_models.refused
    assert refused.model == "fast valve, little friction"
    assert refused.violations[0].quantity == "v"


def test_a_simulation_has_to_leave_a_reserve() -> None:
    assert Safety(RIG, replace(LIMITS, max_speed=1.2 * SPEED), {"best": MODEL})(HOLD)
    assert not Safety(RIG, replace(LIMITS, max_speed=1.05 * SPEED), {"best": MODEL})(HOLD)


def test_a_refusal_is_noted_once() -> None:
    safety = Safety(RIG, replace(LIMITS, max_speed=0.1 * SPEED), {"best": MODEL})
    assert not safety(HOLD)
    assert not safety(HOLD)
    assert len(safety.refused) == 1
