"""The evidence of visited sets: what raises it, what it costs, and what is named."""

import math

import pytest

from benchmarks.evidence import named, presence
from pneucli.diagnose.evidence import KAPPA, PRIOR_ODDS, VisitedSet, set_probabilities

READINGS = 10_000.0


def visited(*effects: str, noise: float, size: float = 1.0) -> VisitedSet:
    """A set whose one channel has a variance of ``noise`` times that of its sensor."""
    return VisitedSet(effects, {"p": (READINGS, READINGS * math.log(noise))}, dict.fromkeys(effects, size), noise)


def test_an_effect_that_leaves_noise_alone_is_sure_and_one_that_explains_nothing_is_not() -> None:
    sets = set_probabilities([visited(noise=3.0), visited("a", noise=1.0), visited("b", noise=3.0)])
    assert sets[0].visited.effects == ("a",)
    assert named(sets) == [("a",)]
    assert presence(sets)["b"] < 0.01


def test_a_disturbed_channel_counts_as_a_few_readings() -> None:
    """From 9 to 4 times the noise is little where something unknown is left: less than the prior asks."""
    best = {one.visited.effects: one for one in set_probabilities([visited(noise=9.0), visited("a", noise=4.0)])}
    share = 1.0 - 1.0 / 9.0  # of the model that stays
    readings = 1.0 / ((1.0 - share) / READINGS + share / KAPPA)
    expected = 0.5 * readings * math.log(9.0 / 4.0) + math.log(PRIOR_ODDS)
    assert best[("a",)].log_evidence == pytest.approx(expected, rel=1e-6)


def test_twins_are_named_together_and_chambers_are_one_family() -> None:
    sides = [visited(f"leak:{i}", noise=1.0) for i in (1, 2)]
    sets = set_probabilities([visited(noise=4.0), *sides, visited("hose", noise=1.0)])
    assert {*named(sets)[0]} == {"leak", "hose"}
    assert len(named(sets)) == 1
    assert presence(sets)["leak"] == pytest.approx(2.0 / 3.0, rel=1e-3)


def test_a_tenth_of_the_typical_size_costs_a_factor_and_less_costs_no_more() -> None:
    def evidence(size: float) -> float:
        sets = set_probabilities([visited(noise=1.0), visited("a", noise=1.0, size=size)])
        return next(one.log_evidence for one in sets if one.visited.effects)

    assert evidence(0.1) == pytest.approx(evidence(1.0) - 2.0)
    assert evidence(1e-6) == evidence(0.1)
    assert evidence(7.0) == evidence(1.0)


def test_the_given_model_stays_where_nothing_helps() -> None:
    sets = set_probabilities([visited(noise=1.0), visited("a", noise=0.999), visited("b", noise=1.0)])
    assert sets[0].visited.effects == ()
    assert named(sets) == []


def test_nothing_is_said_of_a_search_that_did_not_happen() -> None:
    assert set_probabilities([]) == []
    assert named([]) == []
