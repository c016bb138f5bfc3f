"""An effect in its place: what it leaves there, and what is not told from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pneucli.diagnose.candidate import Candidate
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.equivalence import MIN_REMAINING_SHARE, Term
from pneucli.diagnose.score import FittedModel
from tests.diagnose.candidates import BLOCKS, SAMPLES, candidate, diagnosis_data, model_fit

BENCH = diagnosis_data(held_out=False)
BEFORE = model_fit(cost=SAMPLES + 10000.0)  # 10000 beyond noise


def leaving(effect: str, beyond: float) -> Candidate:
    """A trial that leaves so much beyond noise."""
    return candidate(effect, SAMPLES + beyond, before=BEFORE)


def place(beyond: float, **rivals: float) -> Term:
    """Stribeck friction that leaves so much, and what passed in its place with what that leaves."""
    return Term(leaving("stribeck", beyond), tuple(leaving(n.replace("_", "-"), much) for n, much in rivals.items()))


def test_the_remaining_share_is_of_the_excess_cost() -> None:
    assert place(2500.0).remaining_share(BENCH) == pytest.approx(0.25)
    assert place(0.0).remaining_share(BENCH) == MIN_REMAINING_SHARE
    assert place(-500.0).remaining_share(BENCH) == MIN_REMAINING_SHARE


def test_the_remaining_share_is_the_larger_of_fitted_and_held_out() -> None:
    """A stand-in takes all of the ones and half of the others; where no more than noise was, nothing is asked."""

    def costing(fitted: float, held_out: float) -> Candidate:
        costs = np.repeat([100.0 + fitted, 100.0 + held_out], BLOCKS)
        counts = np.full(2 * BLOCKS, 100.0)
        one = leaving("stribeck", 0.0)
        return replace(one, full=FittedModel(one.full.fit, costs[:BLOCKS], costs[BLOCKS:], costs, counts))

    def left(before: tuple[float, float], after: tuple[float, float]) -> float:
        return Term(replace(costing(*after), reduced=costing(*before).full), ()).remaining_share(diagnosis_data())

    assert left((50.0, 50.0), (0.0, 25.0)) == pytest.approx(0.5)
    assert left((50.0, 50.0), (25.0, 5.0)) == pytest.approx(0.5)
    assert left((50.0, 4.0), (10.0, 8.0)) == pytest.approx(0.2)
    assert left((4.0, 4.0), (0.0, 0.0)) == 1.0


@pytest.mark.parametrize(("before", "after", "left"), [(300.0, 120.0, 0.1), (104.0, 100.0, 0.25)])
def test_the_remaining_share_is_that_of_exclusive_channels_where_they_measure(
    monkeypatch: pytest.MonkeyPatch, before: float, after: float, left: float
) -> None:
    """Of 100 readings 200 beyond noise, of which 20 stay; of hardly more than noise the forces tell: a quarter."""
    found = place(2500.0)
    read = {id(BEFORE): [(before, 100.0), (0.0, 0.0)], id(found.candidate.full): [(after, 100.0), (0.0, 0.0)]}
    monkeypatch.setattr(DiagnosisData, "exclusive_channel_costs", lambda self, model_fit, effect: read[id(model_fit)])
    assert found.remaining_share(BENCH) == pytest.approx(left)


@pytest.mark.parametrize(("ratio", "told"), [(1.48, False), (1.45, True)])
def test_with_an_unmodelled_effect_similar_remaining_shares_are_equivalent(ratio: float, told: bool) -> None:
    """Ten readings: a ratio of exp(3.84 / 10) = 1.468 is exceeded by chance once in twenty."""
    found = place(1000.0, extra_mass=ratio * 1000.0, presliding=9000.0)
    assert [t.effect.name for t in found.equivalents(BENCH, complete=False)] == ["extra-mass"] * told


@pytest.mark.parametrize(("beyond", "told"), [(8600.0, True), (8700.0, False)])
def test_with_an_unmodelled_effect_similar_removed_shares_are_equivalent(beyond: float, told: bool) -> None:
    """Of 10000 the one takes 2000; what takes 1362 or more, that over exp(3.84 / 10), is not told from it."""
    found = place(8000.0, extra_mass=beyond)
    assert [t.effect.name for t in found.equivalents(BENCH, complete=False)] == ["extra-mass"] * told


def test_with_a_white_residual_the_same_difference_distinguishes() -> None:
    assert place(1000.0, extra_mass=1400.0).equivalents(BENCH, complete=True) == []
