"""How sure an effect is: surer by all that tells it from a stand-in, and among equals no surer than the data are."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from pneucli.diagnose.confidence import NAMED, WEIGHTS, Evidence, probability, refused, shares
from pneucli.diagnose.decision import Reason
from pneucli.diagnose.trial import State
from tests.diagnose.trials import costing

MIDDLING = Evidence(share=0.5, significance=10.0, size=0.3)
WITHIN: dict[str, list[float]] = {
    "share": [0.05, 0.3, 0.6, 0.9],
    "significance": [2.0, 5.0, 20.0, 80.0],
    "size": [0.05, 0.2, 0.5, 0.9],
}
BEYOND: dict[str, list[tuple[float, float]]] = {
    "share": [(0.02, -0.5), (0.98, 1.0)],
    "significance": [(1.0, 0.0), (300.0, 1e9)],
    "size": [(0.03, 0.0), (1.0, 100.0)],
}


def sure(feature: str, value: float) -> float:
    return probability(MIDDLING._replace(**{feature: value}))


@pytest.mark.parametrize("feature", ["share", "significance", "size"])
def test_an_effect_is_surer_the_more_it_explains_and_the_larger_it_is(feature: str) -> None:
    found = [sure(feature, value) for value in WITHIN[feature]]
    assert found == sorted(found)
    assert found[0] < found[-1]


@pytest.mark.parametrize(("feature", "end", "beyond"), [(f, *ends) for f, pairs in BEYOND.items() for ends in pairs])
def test_beyond_what_exams_have_shown_the_law_says_no_more(feature: str, end: float, beyond: float) -> None:
    assert sure(feature, beyond) == sure(feature, end)


def test_a_share_that_is_not_known_speaks_neither_for_nor_against() -> None:
    assert probability(MIDDLING._replace(share=None)) == probability(MIDDLING._replace(share=0.5))


def test_where_nothing_is_left_the_same_evidence_is_surer() -> None:
    assert probability(MIDDLING._replace(complete=True)) > probability(MIDDLING)


def test_where_something_is_left_it_is_surer_of_an_imposed_motion() -> None:
    assert probability(MIDDLING._replace(imposed=True)) > probability(MIDDLING)
    complete = MIDDLING._replace(complete=True)
    assert probability(complete._replace(imposed=True)) == probability(complete)


def test_each_feature_has_its_weight() -> None:
    assert len(MIDDLING.features) == len(WEIGHTS)


def test_the_best_evidence_is_named_and_the_worst_is_not() -> None:
    best = Evidence(share=0.98, significance=300.0, size=1.0)
    worst = Evidence(share=0.02, significance=2.0, size=0.1)
    assert 1.0 > probability(best) > 0.9
    assert NAMED > 0.1 > probability(worst) > 0.0


@pytest.mark.parametrize("reason", sorted(set(get_args(Reason)) - {"supported"}))
def test_what_is_refused_is_more_likely_absent(reason: Reason) -> None:
    """A stand-in for something unknown is likelier than what a test refutes."""
    assert 0.0 < refused(reason) < NAMED
    assert refused(reason) <= refused("explained-by-unknown")


# --- among equals


BLOCKS = 40


def leaving(*costs: np.ndarray) -> list[State]:
    return [costing(None, cost) for cost in costs]


def scattered(seed: int) -> np.ndarray:
    return 100.0 + 20.0 * np.random.default_rng(seed).standard_normal(BLOCKS)


@pytest.mark.parametrize("number", [1, 2, 3, 5])
def test_shares_of_equals_sum_to_one(number: int) -> None:
    assert sum(shares(leaving(*(scattered(k) for k in range(number))))) == pytest.approx(1.0)


def test_one_that_is_better_in_every_block_has_all() -> None:
    assert shares(leaving(scattered(1), scattered(1) - 5.0)) == pytest.approx([0.0, 1.0], abs=1e-3)


def test_of_two_that_lead_in_other_blocks_the_better_in_all_has_more() -> None:
    lead = np.where(np.arange(BLOCKS) % 2, 20.0, -20.0)
    one, other = shares(leaving(scattered(1), scattered(1) + lead - 2.0))
    assert 0.02 < one < 0.5 < other < 0.98


def test_twins_share_equally() -> None:
    assert shares(leaving(scattered(1), scattered(1))) == pytest.approx([0.5, 0.5])


def test_what_rounding_leaves_between_twins_decides_nothing() -> None:
    """A total of a hundredth, of the same sign in every block: far less than a chi-square of one parameter."""
    assert shares(leaving(scattered(1), scattered(1) - 0.01 / BLOCKS)) == pytest.approx([0.5, 0.5], abs=0.05)
