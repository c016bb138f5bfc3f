"""How well a rig repeats: nothing is added where dates differ by their errors, and what drifts no longer alarms."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from pneucli.changes.baseline import Baseline
from pneucli.changes.comparison import (
    MAX_DEGREES_OF_FREEDOM,
    Comparison,
    Repeatability,
    RepeatDifferences,
    estimate_repeatability,
    fit_variance_prior,
    pool_priors,
    quantity_names,
    repeat_differences,
)
from tests.changes.test_comparison import linear

NAMES = ("a", "b", "bend#0")


def dates(rng: np.random.Generator, number: int, drift: float) -> list[Baseline]:
    """A rig at some dates, whose parameter a is another at each."""
    return [linear(rng, (1.0 + drift * float(rng.standard_normal()), 2.0)) for _ in range(number)]


def repeats_of(references: Sequence[Baseline]) -> list[RepeatDifferences]:
    old = references[0]
    return [repeat_differences(old, old, new) for new in references[1:]]


def alarms(drift: float, healthy: int, prior: bool, rigs: int = 150) -> tuple[float, float]:
    """The share of rigs whose parameter a has a chance below 0.05 at a healthy date, and at one where it is tripled."""
    rng = np.random.default_rng(3)
    known = [dates(rng, healthy, drift) for _ in range(rigs)]
    together = pool_priors(map(repeats_of, known)) if prior else {}
    found = []
    for theta in (1.0, 3.0):
        chances = []
        for mine in known:
            new = linear(rng, (theta + drift * float(rng.standard_normal()), 2.0))
            seen = estimate_repeatability(repeats_of(mine), together) if healthy > 1 else Repeatability({}, {})
            tested = Comparison(mine[0], new, repeatability=seen, names=NAMES).test_all()
            chances.append(next(t.p_value for t in tested if t.hypothesis.name == "a"))
        found.append(float(np.mean(np.array(chances) < 0.05)))
    return found[0], found[1]


def test_a_known_drift_restores_the_stated_alarm_rate() -> None:
    unknown, _ = alarms(drift=0.3, healthy=1, prior=False)
    false, found = alarms(drift=0.3, healthy=3, prior=True)
    assert unknown > 0.5
    assert false == pytest.approx(0.05, abs=4 * np.sqrt(0.05 * 0.95 / 150))
    assert found > 0.9


def test_a_repeatable_rig_loses_no_power() -> None:
    false, found = alarms(drift=0.0, healthy=3, prior=True)
    assert false == pytest.approx(0.05, abs=4 * np.sqrt(0.05 * 0.95 / 150))
    assert found == 1.0


def test_the_prior_of_many_ratios_is_their_excess_scatter() -> None:
    rng = np.random.default_rng(4)
    alike = rng.chisquare(3, 4000) / 3 * 2.5
    freedom, ratio = fit_variance_prior([(float(r), 3.0) for r in alike]) or (0.0, 0.0)
    assert freedom > 100.0
    assert ratio == pytest.approx(2.5, rel=0.05)
    spread = alike * 5.0 / rng.chisquare(5, 4000)  # Smyth's own model: true ratios scatter with 5 degrees of freedom
    freedom, ratio = fit_variance_prior([(float(r), 3.0) for r in spread]) or (0.0, 0.0)
    assert freedom == pytest.approx(5.0, rel=0.15)
    assert ratio == pytest.approx(2.5, rel=0.1)


def test_few_ratios_give_no_prior() -> None:
    assert fit_variance_prior([(1.0, 3.0)] * 7) is None


def test_rigs_of_a_kind_give_a_prior_of_each_quantity() -> None:
    rng = np.random.default_rng(5)
    rigs = [repeats_of(dates(rng, 3, 0.3)) for _ in range(60)]
    assert set(pool_priors(rigs)) == {*NAMES, "level"}
    assert pool_priors(rigs)["a"][1] > 20.0  # a standard deviation of 0.3 beside errors of 0.04
    assert pool_priors(rigs)["b"][1] == pytest.approx(1.0, abs=0.6)


def test_a_date_has_the_difference_and_errors_of_each_quantity() -> None:
    rng = np.random.default_rng(6)
    old, new = linear(rng, (1.0, 2.0)), linear(rng, (1.5, 2.0))
    difference, error, error_old = repeat_differences(old, old, new)["a"]
    assert difference == pytest.approx(0.5, abs=0.2)
    assert error == pytest.approx(np.sqrt(new.white_noise_covariance[0, 0]), rel=0.3)
    assert error_old == pytest.approx(np.sqrt(old.white_noise_covariance[0, 0]), rel=0.3)
    bound = replace(new, coordinates=(replace(new.coordinates[0], at_bound=True), new.coordinates[1]))
    assert "a" not in repeat_differences(old, old, bound)


def test_a_typical_effect_keeps_its_index_in_a_restriction() -> None:
    whole = linear(np.random.default_rng(7), (1.0, 2.0))
    twice = replace(
        whole, typical_effects=(whole.typical_effects[0], replace(whole.typical_effects[0], values={"bend.size": 2.0}))
    )
    part = replace(twice, typical_effects=twice.typical_effects[1:])
    assert quantity_names(twice, part) == ["a", "b", "bend#1"]


def test_a_quantity_without_healthy_dates_has_no_variance() -> None:
    variance, freedom = Repeatability({"a": 4.0}, {"a": 3.0}).variance_and_freedom(["a", "c"])
    assert variance.tolist() == [4.0, 0.0]
    assert freedom.tolist() == [3.0, MAX_DEGREES_OF_FREEDOM]
