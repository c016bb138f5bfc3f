"""How sure an effect is: surer by all that tells it from a stand-in, and among equals no surer than the data are."""

from typing import get_args

import numpy as np
import pytest

from pneucli.diagnose import calibration
from pneucli.diagnose.calibration import MIN_NAMED_PROBABILITY, Evidence, likelihood_shares, presence_rate, probability
from pneucli.diagnose.candidate import Reason
from pneucli.diagnose.score import FittedModel
from tests.diagnose.candidates import costing

MIDDLING = Evidence(share=0.5, significance=10.0, size=0.3, left=0.3)
COMPLETE = MIDDLING._replace(complete=True)
WITHIN: list[tuple[Evidence, str, list[float]]] = [
    (COMPLETE, "share", [0.05, 0.3, 0.6, 0.9]),
    (COMPLETE, "significance", [2.0, 5.0, 20.0, 80.0]),
    (MIDDLING, "significance", [1.9, 2.0]),
    *[(one, "size", [0.1, 0.2, 0.5, 0.9]) for one in (COMPLETE, MIDDLING)],
    (MIDDLING, "left", [0.9, 0.5, 0.1, 0.02]),
]
BEYOND: list[tuple[Evidence, str, float, float]] = [
    (COMPLETE, "share", 0.02, -0.5),
    (COMPLETE, "share", 0.98, 1.0),
    (MIDDLING, "share", 0.0, 1.0),
    (MIDDLING, "significance", 2.0, 1e9),
    (COMPLETE, "size", 0.03, 0.0),
    (MIDDLING, "size", 0.1, 0.0),
    (COMPLETE, "size", 1.0, 100.0),
    (MIDDLING, "size", 1.0, 100.0),
    (MIDDLING, "left", 1.0, 20.0),
    (MIDDLING, "left", 0.01, 0.005),
]


def sure(evidence: Evidence, feature: str, value: float) -> float:
    return probability(evidence._replace(**{feature: value}))


@pytest.mark.parametrize(("evidence", "feature", "values"), WITHIN)
def test_the_probability_grows_with_share_significance_and_size(
    evidence: Evidence, feature: str, values: list[float]
) -> None:
    found = [sure(evidence, feature, value) for value in values]
    assert found == sorted(found)
    assert found[0] < found[-1]


@pytest.mark.parametrize(("evidence", "feature", "end", "beyond"), BEYOND)
def test_features_are_clipped_to_the_range_of_the_exams(
    evidence: Evidence, feature: str, end: float, beyond: float
) -> None:
    assert sure(evidence, feature, beyond) == pytest.approx(sure(evidence, feature, end), abs=1e-12)


def test_an_unknown_share_counts_as_one_half() -> None:
    assert probability(COMPLETE._replace(share=None)) == probability(COMPLETE._replace(share=0.5))


@pytest.mark.parametrize(
    ("evidence", "weights"),
    [(MIDDLING, calibration.WEIGHTS_DISCREPANCY), (COMPLETE, calibration.WEIGHTS_WHITE_RESIDUAL)],
)
def test_each_feature_has_its_weight(evidence: Evidence, weights: tuple[float, ...]) -> None:
    assert len(evidence.features) == len(weights)


def test_an_effect_whose_interval_contains_its_null_is_as_rare_as_on_the_exams() -> None:
    assert probability(MIDDLING._replace(significance=1.9)) == presence_rate("interval-contains-null")


def test_strong_evidence_is_above_one_half_and_weak_below() -> None:
    best = Evidence(share=0.98, significance=300.0, size=1.0, left=0.01)
    worst = Evidence(share=0.02, significance=2.0, size=0.1, left=0.98)
    for complete in (True, False):
        assert 1.0 > probability(best._replace(complete=complete)) > 0.9
        assert MIN_NAMED_PROBABILITY > 0.1 > probability(worst._replace(complete=complete)) > 0.0


@pytest.mark.parametrize("reason", sorted(set(get_args(Reason)) - {"supported"}))
def test_a_refused_effect_is_more_probably_absent(reason: Reason) -> None:
    assert 0.0 < presence_rate(reason) < MIN_NAMED_PROBABILITY


# --- among equals


BLOCKS = 40


def leaving(*costs: np.ndarray) -> list[FittedModel]:
    return [costing(None, cost) for cost in costs]


def scattered(seed: int) -> np.ndarray:
    return 100.0 + 20.0 * np.random.default_rng(seed).standard_normal(BLOCKS)


@pytest.mark.parametrize("number", [1, 2, 3, 5])
def test_shares_of_equals_sum_to_one(number: int) -> None:
    assert sum(likelihood_shares(leaving(*(scattered(k) for k in range(number))))) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("better", "shares", "within"),
    [(5.0, [0.0, 1.0], 1e-3), (0.0, [0.5, 0.5], 1e-6), (0.01 / BLOCKS, [0.5, 0.5], 0.05)],
)
def test_one_that_is_better_in_every_block_has_all_and_equal_ones_share(
    better: float, shares: list[float], within: float
) -> None:
    """A total of a hundredth, of the same sign in every block, is far less than a chi-square of one parameter."""
    assert likelihood_shares(leaving(scattered(1), scattered(1) - better)) == pytest.approx(shares, abs=within)


def test_of_two_that_lead_in_other_blocks_the_better_in_all_has_more() -> None:
    lead = np.where(np.arange(BLOCKS) % 2, 20.0, -20.0)
    one, other = likelihood_shares(leaving(scattered(1), scattered(1) + lead - 2.0))
    assert 0.02 < one < 0.5 < other < 0.98


def test_the_probability_does_not_depend_on_the_name_of_the_effect() -> None:
    assert "effects" not in Evidence._fields
    terms = {"constant", "relative_size", "remaining_variance"}
    assert set(calibration.CALIBRATION["weights"]["discrepancy"]) == terms


def test_the_reasons_with_a_presence_rate_are_reasons() -> None:
    assert set(calibration.PRESENCE_RATE_BY_REASON) <= set(get_args(Reason))
