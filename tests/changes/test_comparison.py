"""What changed: chances where nothing did, all else being as it was, and blocks that vouch for themselves."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from pneucli.arrays import Array
from pneucli.changes.baseline import Baseline, Coordinate, TypicalEffect, align
from pneucli.changes.comparison import (
    MAX_DEGREES_OF_FREEDOM,
    Comparison,
    Hypothesis,
    Repeatability,
    RepeatDifferences,
    estimate_repeatability,
    fit_variance_prior,
    pool_priors,
    quantity_names,
    repeat_differences,
)
from pneucli.figure import Figure
from pneucli.quantities import Z95
from pneucli.stages.diff import interval_difference

BLOCKS = 60


def linear(rng: np.random.Generator, theta: tuple[float, float], effect: float = 0.0, noise: float = 1.0) -> Baseline:
    """A straight line through noisy readings, two parameters and one effect (a parabola) that the model lacks."""
    t = np.linspace(-1.0, 1.0, 20 * BLOCKS)
    jacobian, parabola = np.column_stack([np.ones_like(t), t]), t**2 + 0.3
    measured = jacobian @ theta + effect * parabola + noise * rng.standard_normal(t.size)
    bread = np.linalg.inv(jacobian.T @ jacobian)
    found = bread @ jacobian.T @ measured
    residual, bias = jacobian @ found - measured, bread @ jacobian.T @ parabola
    new = parabola - jacobian @ bias
    power, block = float(new @ new), np.repeat(np.arange(BLOCKS), 20)

    def by_block(values: Array) -> Array:
        return np.bincount(block, values)

    return Baseline(
        tuple(Coordinate(n, "N", float(v), False, False) for n, v in zip("ab", found, strict=True)),
        (TypicalEffect("bend", {"bend.size": 1.0}),),
        -np.column_stack([by_block(c * residual) for c in jacobian.T]) @ bread,
        bread,
        np.array([-float(new @ residual) / power]),
        -by_block(new * residual)[:, None] / power,
        np.array([power]),
        bias[:, None],
        np.log(by_block(residual**2) / 20),
        np.array([[power]]),
        -np.column_stack([by_block(c * new) for c in jacobian.T])[None] @ bread,
        by_block(new**2)[:, None] / power,
    )


def test_without_a_change_the_p_values_are_uniform() -> None:
    """400 pairs and two parameters: a chance below 0.05 in 5 % of them, within four standard errors."""
    rng = np.random.default_rng(1)
    pairs = [Comparison(linear(rng, (1.0, 2.0)), linear(rng, (1.0, 2.0))) for _ in range(400)]
    for name in ("a", "b", "bend"):
        chances = [next(t.p_value for t in c.test_all() if t.hypothesis.name == name) for c in pairs]
        assert np.mean(np.array(chances) < 0.05) == pytest.approx(0.05, abs=4 * np.sqrt(0.05 * 0.95 / 400))


@pytest.mark.parametrize(("theta", "effect", "name"), [((1.3, 2.0), 0.0, "a"), ((1.0, 2.5), 0.0, "b"),
                                                       ((1.0, 2.0), 1.0, "bend")])  # fmt: skip
def test_the_changed_quantity_is_first_with_its_size(theta: tuple[float, float], effect: float, name: str) -> None:
    rng = np.random.default_rng(2)
    first = Comparison(linear(rng, (1.0, 2.0)), linear(rng, theta, effect)).test_all()[0]
    size = {"a": 0.3, "b": 0.5, "bend": 1.0}[name]
    assert (first.hypothesis.name, first.p_value < 1e-6) == (name, True)
    assert first.size == pytest.approx(size, abs=4 * first.error)


def test_an_effect_missing_on_both_sides_is_no_change() -> None:
    rng = np.random.default_rng(3)
    tested = Comparison(linear(rng, (1.0, 2.0), 5.0), linear(rng, (1.0, 2.0), 5.0)).test_all()
    assert min(t.p_value for t in tested) > 1e-3


def test_a_second_change_is_detected_given_the_first() -> None:
    rng = np.random.default_rng(4)
    both = Comparison(linear(rng, (1.0, 2.0)), linear(rng, (1.5, 2.6)))
    (a,) = [h for h in both.hypotheses if h.name == "a"]
    beside = both.with_accepted(a).test_all()[0]
    assert (beside.hypothesis.name, beside.size) == ("b", pytest.approx(0.6, abs=4 * beside.error))


def test_a_larger_residual_is_detected_and_a_slightly_different_noise_is_not() -> None:
    rng = np.random.default_rng(5)
    old = linear(rng, (1.0, 2.0))
    assert Comparison(old, linear(rng, (1.0, 2.0), noise=2.0)).residual_level_test().p_value < 1e-6
    assert Comparison(old, linear(rng, (1.0, 2.0), noise=1.04)).residual_level_test().p_value > 0.05
    fewer = replace(old, levels=old.levels[:30])
    assert Comparison(fewer, linear(rng, (1.0, 2.0), noise=2.0)).residual_level_test().p_value < 1e-6


def test_a_single_block_does_not_prove_an_effect() -> None:
    """Its power stands in one block, which a step of it fits perfectly: nothing else says that it is there."""
    rng = np.random.default_rng(6)
    old, new = linear(rng, (1.0, 2.0)), linear(rng, (1.0, 2.0))
    share = np.zeros((BLOCKS, 1))
    share[7] = 1.0 - 1e-9
    only = np.where(share > 0.5, 8.0, 0.0)
    lone = replace(new, steps=np.array([8.0]), step_influence=only, block_power_share=share)
    tested = Comparison(old, lone).test(Hypothesis("bend", effect_index=0))
    assert tested is not None
    assert tested.p_value > 1e-3


def test_quantities_of_one_side_only_are_excluded() -> None:
    rng = np.random.default_rng(7)
    old, new = linear(rng, (1.0, 2.0)), linear(rng, (1.0, 2.0))
    fewer = new.restricted_to(["b"], [])
    one, other = align(old, fewer)
    assert [c.name for c in one.coordinates] == [c.name for c in other.coordinates] == ["b"]
    assert one.steps.size == other.steps.size == 0
    assert Comparison(one, other).test_all()[0].p_value > 1e-3


def test_a_parameter_at_its_bound_has_no_hypothesis_and_areas_have_a_common_one() -> None:
    rng = np.random.default_rng(8)
    names = ("valve.effective_area(+1 V)", "valve.effective_area(+2 V)")
    sides = [linear(rng, (1.0, 2.0)) for _ in range(2)]
    valves = [
        replace(s, coordinates=tuple(replace(c, name=n) for c, n in zip(s.coordinates, names, strict=True)))
        for s in sides
    ]
    assert [h.name for h in Comparison(*valves).hypotheses] == [*names, "valve.effective_area", "bend"]
    bound = replace(sides[0], coordinates=(replace(sides[0].coordinates[0], at_bound=True), sides[0].coordinates[1]))
    assert [h.name for h in Comparison(bound, sides[1]).hypotheses] == ["b", "bend"]


def test_a_one_sided_effect_cannot_fall_below_its_null() -> None:
    rng = np.random.default_rng(9)
    sides = [linear(rng, (1.0, 2.0), effect) for effect in (0.0, -1.0, 1.0)]
    none, below, there = (replace(s, typical_effects=(replace(s.typical_effects[0], one_sided=True),)) for s in sides)

    def chance(old: Baseline, new: Baseline) -> float:
        return next(t.p_value for t in Comparison(old, new).test_all() if t.hypothesis.name == "bend")

    assert chance(none, below) == 1.0
    assert chance(none, there) < 1e-6
    assert chance(there, none) < 1e-6  # it was there, and has gone


def test_a_reference_with_an_effect_in_it_is_as_if_the_model_had_had_it() -> None:
    """Two effects whose signatures overlap, of which one is in the new model: the other has its own step."""
    rng = np.random.default_rng(10)
    old, noise = two_bends(rng, (0.0, 0.0)), rng.standard_normal(20 * BLOCKS)
    for i, size in ((0, 2.0), (1, 1.0)):
        whole, inside = two_bends(noise, (1.0, 2.0)), two_bends(noise, (1.0, 2.0), inside=i)
        one, beside = (r.restricted_to(["a", "b"], inside.typical_effects) for r in (inside, whole.with_effect_free(i)))
        assert beside.estimates == pytest.approx(one.estimates)
        assert beside.steps == pytest.approx(one.steps)
        assert beside.white_noise_covariance == pytest.approx(one.white_noise_covariance)
        assert beside.power == pytest.approx(one.power)
        comparison = Comparison(*align(old.with_effect_free(i), one))
        tested = comparison.test(Hypothesis("other", effect_index=0))
        assert tested is not None
        assert tested.size == pytest.approx(size, abs=4 * tested.error)
        assert tested.p_value < 1e-6
    unknown = replace(old, gram=None)  # an older version kept less
    assert unknown.with_effect_free(0) is unknown


def two_bends(rng: np.random.Generator | Array, sizes: tuple[float, float], inside: int | None = None) -> Baseline:
    """As :func:`linear`, with a parabola and a cubic that overlap, one of which the model may have."""
    t = np.linspace(-1.0, 1.0, 20 * BLOCKS)
    jacobian, bends = np.column_stack([np.ones_like(t), t]), np.column_stack([t**2 + 0.3, t**2 + t**3])
    noise = rng if isinstance(rng, np.ndarray) else rng.standard_normal(t.size)
    measured = jacobian @ [1.0, 2.0] + bends @ sizes + noise
    lacking = [0, 1] if inside is None else [1 - inside]
    jacobian, bends = np.column_stack([jacobian, *([] if inside is None else [bends[:, inside]])]), bends[:, lacking]
    bread = np.linalg.inv(jacobian.T @ jacobian)
    found, bias = bread @ jacobian.T @ measured, bread @ jacobian.T @ bends
    residual, new = jacobian @ found - measured, bends - jacobian @ bias
    block = np.repeat(np.arange(BLOCKS), 20)
    power = np.sum(new**2, axis=0)

    def by_block(rows: Array) -> Array:
        return np.array([rows[block == b].sum(axis=0) for b in range(BLOCKS)])

    return Baseline(
        tuple(Coordinate(n, "N", float(v), False, False) for n, v in zip("abc", found, strict=False)),
        tuple(TypicalEffect(f"bend{i}", {f"bend{i}.size": 1.0}) for i in lacking),
        -by_block(jacobian * residual[:, None]) @ bread,
        bread,
        -(new.T @ residual) / power,
        -by_block(new * residual[:, None]) / power,
        power,
        bias,
        np.log(by_block(residual**2) / 20),
        new.T @ new,
        np.array([-by_block(jacobian * new[:, [i]]) @ bread for i in range(len(lacking))]),
        by_block(new**2) / power,
    )


# --- whether two estimates differ by more than their intervals allow


@pytest.mark.parametrize(
    ("b", "beyond"), [(15.1, True), (14.9, False), (5.1, False), (4.9, True)]
)  # half width of the difference: the root of 3^2 + 4^2
def test_beyond_means_that_the_interval_of_the_difference_excludes_zero(b: float, beyond: bool) -> None:
    found = interval_difference(Figure(10.0, 7.0, 13.0), Figure(b, b - 4.0, b + 4.0))
    assert found is not None
    assert found.excludes(0.0) is beyond
    assert found.high - found.value == pytest.approx(5.0)


def test_the_ends_that_face_each_other_count() -> None:
    """a may be 10 at most, b 40 at least: what lies on the far sides does not matter."""
    found = interval_difference(Figure(8.0, -1e9, 10.0), Figure(43.0, 40.0, 1e9))
    assert found is not None
    assert found.low == pytest.approx(35.0 - np.hypot(2.0, 3.0))
    assert found.excludes(0.0)


def test_without_an_end_of_an_interval_there_is_no_answer() -> None:
    assert interval_difference(Figure(1.0, 0.9, np.inf), Figure(2.0, 1.9, 2.1)) is None


def test_one_in_twenty_repeats_differs_beyond_the_intervals() -> None:
    draws = np.random.default_rng(5).normal(0.0, [1.0, 3.0], (4000, 2))
    found = [interval_difference(Figure(a, a - Z95, a + Z95), Figure(b, b - 3 * Z95, b + 3 * Z95)) for a, b in draws]
    assert np.mean([one is not None and one.excludes(0.0) for one in found]) == pytest.approx(0.05, abs=0.01)


def test_an_interval_that_is_practically_endless_tells_nothing() -> None:
    found = interval_difference(Figure(1.0, 0.9, 1e300), Figure(2.0, 1.9, 2.1))
    assert found is not None
    assert not found.excludes(0.0)
    assert interval_difference(Figure(0.0, -1.7e308, 1.7e308), Figure(1.0, -1.7e308, 1.7e308)) is None


# --- how well a rig repeats: nothing is added where dates differ by their errors, and what drifts no longer alarms


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
