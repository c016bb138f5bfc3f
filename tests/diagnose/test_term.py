"""An effect in its place: what it leaves there, and what is not told from it."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.diagnose.candidate import Candidate
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.equivalence import Term
from pneucli.diagnose.score import Bounds, ChannelCost, FittedModel, RecordingCost
from tests.diagnose.candidates import BLOCKS, SAMPLES, candidate, costing, diagnosis_data, model_fit

BENCH = diagnosis_data(held_out=False)
BEFORE = model_fit(cost=SAMPLES + 10000.0)  # 10000 beyond noise


def leaving(effect: str, beyond: float) -> Candidate:
    """A candidate that leaves so much beyond noise."""
    return candidate(effect, SAMPLES + beyond, before=BEFORE)


def place(beyond: float, **rivals: float) -> Term:
    """Stribeck friction that leaves so much, and what passed in its place with what that leaves."""
    return Term(leaving("stribeck", beyond), tuple(leaving(n.replace("_", "-"), much) for n, much in rivals.items()))


def test_the_remaining_variance_is_that_of_the_residuals_and_no_less_than_noise() -> None:
    """4000 residuals cost 14000 before, so their variance is 3.5."""
    assert place(3000.0).remaining_variance(BENCH) == pytest.approx(7000.0 / 14000.0)
    for beyond in (0.0, -500.0):
        assert place(beyond).remaining_variance(BENCH) == pytest.approx(1.0 / 3.5)


def test_each_recording_counts_by_its_readings_and_not_by_its_cost() -> None:
    """A fitted recording 100 times as loud falls to a quarter, an equally long one that is held out does not fall."""

    def costing(fitted: float, held_out: float) -> FittedModel:
        costs = np.repeat([100.0 * fitted, 100.0 * held_out], BLOCKS)
        counts = np.full(2 * BLOCKS, 100.0)
        channels = tuple(ChannelCost(100.0 * BLOCKS * level, 100.0 * BLOCKS) for level in (fitted, held_out))
        return FittedModel(BEFORE.fit, costs[:BLOCKS], costs[BLOCKS:], costs, counts, channels)

    def left(before: tuple[float, float], after: tuple[float, float]) -> float:
        step = replace(leaving("stribeck", 0.0), reduced=costing(*before), full=costing(*after))
        return Term(step, ()).remaining_variance(diagnosis_data())

    assert left((400.0, 4.0), (100.0, 4.0)) == pytest.approx(0.5)
    assert left((4.0, 400.0), (4.0, 100.0)) == pytest.approx(0.5)
    assert left((4.0, 4.0), (1.0, 8.0)) == pytest.approx(0.25**0.5 * 2.0**0.5)
    assert left((1.0, 1.0), (0.5, 0.9)) == 1.0


def test_only_the_channel_that_the_effect_explains_best_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """A leak of chamber 1 removes three quarters of the variance of p1; p2 and the temperature stay. A rival that
    removes that much of p2 removes nothing of p1.
    """
    costs = {"before": (400.0, 300.0), "leak": (100.0, 290.0), "rival": (400.0, 75.0)}

    def read(self: DiagnosisData, one: FittedModel, effect: object) -> dict[str, list[RecordingCost]]:
        p1, p2 = costs[names[id(one)]]
        return {"p1": [RecordingCost(p1, 100.0, Bounds.none())], "p2": [RecordingCost(p2, 100.0, Bounds.none())]}

    monkeypatch.setattr(DiagnosisData, "recording_costs", read)
    before, leak, rival = (costing(BEFORE.fit, np.zeros(BLOCKS)) for _ in costs)
    names = dict(zip(map(id, (before, leak, rival)), costs, strict=True))
    step = replace(leaving("stribeck", 0.0), reduced=before, full=leak)
    term = Term(step, (replace(leaving("extra-mass", 0.0), reduced=before, full=rival),))
    assert term.remaining_variance(diagnosis_data()) == pytest.approx(0.25)
    assert term.remaining_variance(diagnosis_data(), term.rivals[0]) == pytest.approx(1.0)
    assert not term.equivalents(diagnosis_data(), complete=False)


@pytest.mark.parametrize(("before", "after", "left"), [(300.0, 120.0, 0.4), (104.0, 100.0, 0.5)])
def test_the_remaining_variance_is_that_of_exclusive_channels_where_they_measure(
    monkeypatch: pytest.MonkeyPatch, before: float, after: float, left: float
) -> None:
    """Of 100 readings the variance falls from 3 to 1.2; where they are hardly more than noise the forces tell."""
    found = place(3000.0)
    read = {
        id(one): [RecordingCost(cost, 100.0, Bounds.none()), RecordingCost(0.0, 0.0, Bounds.none())]
        for one, cost in ((BEFORE, before), (found.candidate.full, after))
    }
    monkeypatch.setattr(DiagnosisData, "exclusive_channel_costs", lambda self, model_fit, effect: read[id(model_fit)])
    assert found.remaining_variance(BENCH) == pytest.approx(left)


@pytest.mark.parametrize(("ratio", "told"), [(1.48, False), (1.45, True)])
def test_with_an_unmodelled_effect_similar_remaining_variances_are_equivalent(ratio: float, told: bool) -> None:
    """Ten readings: a ratio of exp(3.84 / 10) = 1.468 is exceeded by chance once in twenty."""
    found = place(1000.0, extra_mass=ratio * 5000.0 - SAMPLES, presliding=9500.0)
    assert [t.effect.name for t in found.equivalents(BENCH, complete=False)] == ["extra-mass"] * told


@pytest.mark.parametrize(("removed", "told"), [(0.14, True), (0.13, False)])
def test_with_an_unmodelled_effect_similar_removed_variances_are_equivalent(removed: float, told: bool) -> None:
    """The one removes 0.2 of the variance; what removes 0.2 / exp(3.84 / 10) = 0.136 or more is not told from it."""
    before = SAMPLES + 10000.0
    found = place(0.8 * before - SAMPLES, extra_mass=(1.0 - removed) * before - SAMPLES)
    assert [t.effect.name for t in found.equivalents(BENCH, complete=False)] == ["extra-mass"] * told


def test_with_a_white_residual_the_same_difference_distinguishes() -> None:
    assert place(1000.0, extra_mass=1400.0).equivalents(BENCH, complete=True) == []


def test_a_bounded_reading_counts_by_the_width_of_its_bounds() -> None:
    """A law that bounds half of the readings, as widely as a normal error of their size spreads, explains nothing."""
    width = np.sqrt(2.0 * np.pi * np.e * 3.0)  # of a uniform distribution with the entropy of a variance of 3
    half = Bounds(np.full(50, 1.0), np.full(50, width))
    assert RecordingCost(100.0, 100.0, half).log_variance() == pytest.approx(50.0 * np.log(4.0))
    certain = Bounds(np.full(50, 1.0), np.zeros(50))
    assert RecordingCost(400.0, 100.0, certain).log_variance() == pytest.approx(100.0 * np.log(4.0))
    assert RecordingCost(400.0, 100.0, Bounds.none()).log_variance() == pytest.approx(100.0 * np.log(4.0))
