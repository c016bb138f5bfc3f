"""What supports an effect: chance, size, and the data held out as far as they show it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.diagnose import hypothesis_tests
from pneucli.diagnose.candidate import Candidate
from pneucli.diagnose.evidence import ScoreGain, score_gain
from pneucli.diagnose.hypothesis_tests import passing_candidates
from pneucli.diagnose.score import FittedModel
from pneucli.physics.effects import catalogue
from tests.simulate.synthetic_experiments import model

VIEW = SimpleNamespace(experiment=SimpleNamespace(recording=SimpleNamespace(period=1e-3)))
BENCH: Any = SimpleNamespace(
    hypothesis_count=50,
    has_held_out_data=True,
    train=[VIEW],
    base_effects=(),
    sensitive_cost=lambda model_fit, _: (float(model_fit.train_costs.sum()), 2000),
)
BEFORE: Any = SimpleNamespace(train_costs=np.full(40, 100.0), cost=8000.0, residual_count=4000, effect_names=[])
SURELY = ScoreGain(400.0, 300.0, 1e-9, 30.0)
RARELY = ScoreGain(90.0, 0.0, 0.16, 1.0)  # one block of many
OFTEN = ScoreGain(90.0, -10.0, 0.16, 30.0)
WORSE = ScoreGain(-5.0, -20.0, 0.8, 1.0)


@pytest.fixture(autouse=True)
def nothing_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hypothesis_tests, "lack_of_fit", lambda diagnosis_data, model_fit: ([], []))


def candidate(test: ScoreGain, p_value: float) -> Candidate:
    fitted: Any = SimpleNamespace(estimates=(), free=(), model=model(["dwell-breakaway"]))
    model_fit = FittedModel(fitted, np.full(40, 90.0), np.zeros(0), np.full(40, 90.0), np.full(40, 100.0))
    return Candidate(catalogue()["dwell-breakaway"], BEFORE, model_fit, SURELY, test, p_value)


@pytest.mark.parametrize(
    ("test", "p_value", "named"),
    [
        (SURELY, 1e-5, True),
        (OFTEN, 1e-12, False),  # shown all over the data held out, and not certain there
        (RARELY, 1e-12, True),  # shown there once, which no bootstrap is certain of
        (RARELY, 1e-5, False),  # the same where chance does as much once in 2000 of such families
        (WORSE, 1e-12, False),  # the data held out speak against it
    ],
)
def test_the_held_out_gain_must_be_significant_unless_the_effect_acts_rarely(
    test: ScoreGain, p_value: float, named: bool
):
    """50 hypotheses: a chance of 1e-5 is one of 5e-4 for the family, beyond the 1e-4 asked of what is rarely shown."""
    assert bool(passing_candidates(BENCH, BEFORE, [candidate(test, p_value)])) == named


def test_effective_blocks_count_where_a_gain_occurs():
    before, once = np.full(40, 100.0), np.full(40, 100.0)
    once[7] = 0.0
    all_over = 90.0 + np.random.default_rng(1).normal(size=40)
    assert score_gain(before, once).effective_blocks < 2.0
    assert score_gain(before, all_over).effective_blocks > 10.0
