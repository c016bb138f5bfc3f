"""Compare two sets of recordings of one rig: which of its quantities changed by more than errors and repeats allow.

Both sets were fitted with the same model (:mod:`pneucli.changes.baseline`). Without a change their estimates differ by
their errors, and by the rig's repeatability: the variance of its parameters from one healthy date to another. Each
hypothesis is that one quantity changed: a parameter, all areas of a valve by one factor, or an effect that the model
lacks and that came, went or grew. It is tested with everything else held constant, which makes a small change
detectable. What the model lacks in both sets is in both baselines and does not count.

For the repeatability each healthy date is compared with the same old model; the variance between dates is divided by
the mean variance of the estimates. Few dates determine this ratio badly, so it is shrunk toward the distribution of
many ratios (of all rigs of a fleet, or of all quantities of the rig). Source: G. K. Smyth, Stat. Appl. Genet. Mol.
Biol. 3 (2004) 3.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import digamma, polygamma

from pneucli.arrays import Array
from pneucli.changes.baseline import Baseline
from pneucli.diagnose.evidence import effective_degrees_of_freedom
from pneucli.distributions import student_t_quantile, student_t_tail
from pneucli.identify.estimation.least_squares import pseudo_inverse

RepeatDifferences = Mapping[str, Sequence[float]]
"""By name: the difference from the old model, its error, and the error of the old model."""
VariancePrior = tuple[float, float]
"""The degrees of freedom and the ratio of variances that are known beforehand."""

RESIDUAL_LEVEL = "level"
MIN_RATIOS = 8  # ratios, for a prior
MAX_DEGREES_OF_FREEDOM = 1024.0  # as good as infinitely many
MIN_RATIO = 1e-12  # so that the logarithm is finite


@dataclass(frozen=True)
class Repeatability:
    """The variance of each quantity from one healthy date to another, by name, and its degrees of freedom."""

    variance: Mapping[str, float]
    degrees_of_freedom: Mapping[str, float]

    def variance_and_freedom(self, names: Sequence[str]) -> tuple[Array, Array]:
        """Return variances and degrees of freedom (n,); the variance is 0 for quantities without healthy dates."""
        variance = np.array([self.variance.get(n, 0.0) for n in names], dtype=np.float64)
        return variance, np.array(
            [self.degrees_of_freedom.get(n, MAX_DEGREES_OF_FREEDOM) for n in names], dtype=np.float64
        )


NO_DRIFT = Repeatability({}, {})


def quantity_names(whole: Baseline, part: Baseline) -> list[str]:
    """Return the names of the coordinates and typical effects of ``part``, a restriction of ``whole``.

    A typical effect is called by its effect and its index among those of this effect in ``whole``.
    """
    effects = [s.effect for s in whole.typical_effects]
    numbered = [f"{name}#{effects[:i].count(name)}" for i, name in enumerate(effects)]
    return [
        *(c.name for c in part.coordinates),
        *(numbered[whole.typical_effects.index(s)] for s in part.typical_effects),
    ]


def repeat_differences(whole: Baseline, old: Baseline, new: Baseline) -> dict[str, list[float]]:
    """Return by name the difference of a date from the old model, its error, and that of the old model.

    ``old`` and ``new`` are aligned, ``whole`` is the complete old baseline.
    """
    both = [
        (one.estimates, _standard_errors(one.influence), one.steps, _standard_errors(one.step_influence))
        for one in (old, new)
    ]
    (old_estimates, old_errors, old_steps, old_step_errors), (new_estimates, new_errors, new_steps, new_step_errors) = (
        both
    )
    is_free = [not a.at_bound and not b.at_bound for a, b in zip(old.coordinates, new.coordinates, strict=True)]
    is_free += [bool(p > 0.0) for p in np.minimum(old.power, new.power)]
    rows = np.column_stack(
        [
            np.append(new_estimates - old_estimates, new_steps - old_steps),
            np.append(new_errors, new_step_errors),
            np.append(old_errors, old_step_errors),
        ]
    )
    differences = {
        n: row.tolist() for n, row, use in zip(quantity_names(whole, old), rows, is_free, strict=True) if use
    }
    levels = [one.levels[np.isfinite(one.levels)] for one in (old, new)]
    errors_of = [float(one.std(ddof=1) / np.sqrt(one.size)) for one in levels]
    return differences | {RESIDUAL_LEVEL: [float(levels[1].mean() - levels[0].mean()), errors_of[1], errors_of[0]]}


def _standard_errors(influence: Array) -> Array:
    return np.asarray(np.sqrt(np.sum(influence**2, axis=0)))


def variance_ratios(repeats: Sequence[RepeatDifferences]) -> dict[str, tuple[float, float, float]]:
    """Return for each quantity the variance between dates over that of its estimates, its degrees of freedom, and the
    mean variance of the estimates. The old model counts as a date.
    """
    ratios = {}
    for name in dict.fromkeys(n for one in repeats for n in one):
        rows = np.array([one[name] for one in repeats if name in one], dtype=np.float64)
        mean_variance = float(np.mean(np.append(rows[:, 1], rows[0, 2]) ** 2))
        if mean_variance > 0.0 and np.isfinite(mean_variance):
            between = float(np.var(np.append(rows[:, 0], 0.0), ddof=1))
            ratios[name] = between / mean_variance, float(len(rows)), mean_variance
    return ratios


def fit_variance_prior(ratios: Iterable[tuple[float, float]]) -> VariancePrior | None:
    """Return the prior of many ratios (with their degrees of freedom); None where there are too few.

    It follows from the moments of their logarithms, which for a common true ratio are those of chi-square.
    """
    table = np.array([(max(ratio, MIN_RATIO), freedom) for ratio, freedom in ratios])
    if len(table) < MIN_RATIOS:
        return None
    logs = np.log(table[:, 0]) - digamma(table[:, 1] / 2) + np.log(table[:, 1] / 2)
    excess = float(np.var(logs, ddof=1) - np.mean(polygamma(1, table[:, 1] / 2)))
    freedom = min(2.0 * _trigamma_inverse(excess), MAX_DEGREES_OF_FREEDOM) if excess > 0.0 else MAX_DEGREES_OF_FREEDOM
    return freedom, float(np.exp(np.mean(logs) + digamma(freedom / 2) - np.log(freedom / 2)))


def _trigamma_inverse(value: float) -> float:
    """Return the inverse of the trigamma function, by Newton's method on its convex reciprocal."""
    x = 0.5 + 1.0 / value
    for _ in range(50):
        value_here = float(polygamma(1, x))
        step = value_here * (1.0 - value_here / value) / float(polygamma(2, x))
        x += step
        if abs(step) < 1e-8 * x:
            break
    return x


def estimate_repeatability(
    repeats: Sequence[RepeatDifferences], prior: Mapping[str, VariancePrior] | None = None
) -> Repeatability:
    """Return the repeatability of a rig from healthy ``repeats``; ``prior`` by name.

    Without a prior of a quantity all quantities of the rig together give one.
    """
    ratios = variance_ratios(repeats)
    effects = fit_variance_prior((ratio, freedom) for ratio, freedom, _ in ratios.values()) or (0.0, 1.0)
    variance, freedom = {}, {}
    for name, (ratio, dates, mean_variance) in ratios.items():
        degrees, expected = (prior or {}).get(name, effects)
        shrunk = (degrees * expected + dates * ratio) / (degrees + dates)
        variance[name], freedom[name] = max(shrunk - 1.0, 0.0) * mean_variance, degrees + dates
    return Repeatability(variance, freedom)


def pool_priors(rigs: Iterable[Sequence[RepeatDifferences]]) -> dict[str, VariancePrior]:
    """Return the priors by name from the healthy repeats of many rigs of a kind."""
    by_name: dict[str, list[tuple[float, float]]] = {}
    for repeats in rigs:
        for name, (ratio, dates, _) in variance_ratios(repeats).items():
            by_name.setdefault(name, []).append((ratio, dates))
    priors = {name: fit_variance_prior(ratios) for name, ratios in sorted(by_name.items())}
    return {name: one for name, one in priors.items() if one is not None}


ALARM_RATE = 1e-3  # false alarms for each rig and comparison
UNEXPLAINED = "unexplained"  # the name of a change that no parameter and no effect explains
MIN_ONE_SIDED_SHARE = 0.5  # of a change: the least step of a one-sided effect on the side on which it is larger
MIN_LEVERAGE_COMPLEMENT = 1e-12  # one minus the leverage of a block, at least
LOG_NOISE_POWER_ERROR = 0.1  # standard error of the logarithm of the noise power, estimated from two recordings
_AREA = re.compile(r"(valve(?:_2)?\.effective_area)\(.+\)")


@dataclass(frozen=True)
class Hypothesis:
    """One quantity that may have changed, by ``name``: coordinates (k,) in a direction, or a typical effect."""

    name: str
    direction: Array | None = None
    effect_index: int | None = None


@dataclass(frozen=True)
class HypothesisTest:
    """The test of one hypothesis: the ``size`` of the change along its direction, and the ``error`` of the size.

    ``degrees_of_freedom``: the effective number of blocks behind the error.
    """

    hypothesis: Hypothesis
    size: float
    error: float
    degrees_of_freedom: float

    @property
    def t_statistic(self) -> float:
        """The size over its error."""
        return self.size / self.error if self.error > 0.0 else 0.0

    @property
    def p_value(self) -> float:
        """The two-sided p value of the size."""
        return float(2.0 * student_t_tail(abs(self.t_statistic), self.degrees_of_freedom))

    def minimum_detectable_size(self, p_value: float) -> float:
        """Return the size from which the p value is below ``p_value``."""
        return -float(student_t_quantile(0.5 * p_value, self.degrees_of_freedom)) * self.error


@dataclass(frozen=True)
class Comparison:
    """Two baselines of one model, the old one first; ``accepted`` hypotheses are free in the tests.

    ``repeatability`` is the variation of a healthy rig from date to date, of the quantities by their ``names``:
    coordinates, then typical effects.
    """

    old: Baseline
    new: Baseline
    accepted: tuple[Hypothesis, ...] = ()
    repeatability: Repeatability = NO_DRIFT
    names: tuple[str, ...] = ()

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """All hypotheses; a parameter at a bound on one side has none."""
        return (*self._single(), *self._areas(), *self._effects())

    def _single(self) -> Iterator[Hypothesis]:
        for j, (a, b) in enumerate(zip(self.old.coordinates, self.new.coordinates, strict=True)):
            if not a.at_bound and not b.at_bound:
                yield Hypothesis(a.name, np.eye(len(self.old.coordinates))[j])

    def _areas(self) -> Iterator[Hypothesis]:
        matches = [_AREA.fullmatch(c.name) for c in self.old.coordinates]
        for name in dict.fromkeys(m[1] for m in matches if m):
            direction = np.array([float(m is not None and m[1] == name) for m in matches])
            if direction.sum() > 1.0:
                yield Hypothesis(name, direction)

    def _effects(self) -> Iterator[Hypothesis]:
        for i, effect_index in enumerate(self.old.typical_effects):
            if min(self.old.power[i], self.new.power[i]) > 0.0:
                yield Hypothesis(effect_index.effect, effect_index=i)

    def test_all(self) -> list[HypothesisTest]:
        """Return the tests of all hypotheses that are not accepted, the smallest p value first."""
        accepted = {(h.name, h.effect_index) for h in self.accepted}
        tests = [self.test(h) for h in self.hypotheses if (h.name, h.effect_index) not in accepted]
        return sorted((f for f in tests if f is not None), key=lambda f: (f.p_value, -abs(f.t_statistic)))

    def test(self, hypothesis: Hypothesis) -> HypothesisTest | None:
        """Return the test of one hypothesis; None where the data do not determine it.

        The differences of the estimates (k,) and of the effects' steps are weighted by their covariance for white
        residuals; their error comes from the blocks.
        """
        effect_indices = [h.effect_index for h in (*self.accepted, hypothesis) if h.effect_index is not None]
        if len(effect_indices) > 1:
            return None  # an accepted effect is in the model (Baseline.with_effect_free)
        drift_variance, drift_freedom = self.repeat_variance(effect_indices)
        weight = pseudo_inverse(
            _white_noise_covariance(self.old, effect_indices)
            + _white_noise_covariance(self.new, effect_indices)
            + np.diag(drift_variance)
        )
        columns = np.array([_direction(h, effect_indices, self.old) for h in (hypothesis, *self.accepted)]).T
        covariance = pseudo_inverse(columns.T @ weight @ columns)
        contrast = (covariance @ columns.T @ weight)[0]
        difference = _estimates(self.new, effect_indices) - _estimates(self.old, effect_indices)
        parts = np.concatenate([_block_contributions(one, effect_indices, contrast) for one in (self.old, self.new)])
        drift_parts = contrast**2 * drift_variance
        error = float(np.sqrt(np.sum(parts**2) + np.sum(drift_parts)))
        size = float(contrast @ difference)
        if not np.isfinite(error) or error <= 0.0:
            return None
        if hypothesis.effect_index is not None and not self._is_admissible(hypothesis.effect_index, size):
            size = 0.0
        own_freedom = drift_freedom[columns[:, 0] != 0.0].min()
        return HypothesisTest(
            hypothesis, size, error, min(_satterthwaite_freedom(parts, drift_parts, drift_freedom), own_freedom)
        )

    def repeat_variance(self, effect_indices: Sequence[int] = ()) -> tuple[Array, Array]:
        """Return the variance of a healthy difference of two dates in excess of its error, for all coordinates and the
        steps of ``effect_indices`` (k + n,), and its degrees of freedom.
        """
        k = len(self.old.coordinates)
        names = (
            [self.names[i] for i in (*range(k), *(k + i for i in effect_indices))]
            if self.names
            else [""] * (k + len(effect_indices))
        )
        variance, freedom = self.repeatability.variance_and_freedom(names)
        return 2.0 * variance, freedom

    def _is_admissible(self, effect_index: int, size: float) -> bool:
        """Whether the effect is present on the side on which it would be larger: a leak cannot fall below zero."""
        side = self.new if size > 0.0 else self.old
        return not side.typical_effects[effect_index].one_sided or float(
            side.steps[effect_index]
        ) > MIN_ONE_SIDED_SHARE * abs(size)

    def residual_level_test(self) -> HypothesisTest:
        """Return the test of the mean squared residual, paired by block where both have equally many."""
        old, new = self.old.levels, self.new.levels
        if old.size == new.size:
            difference = (new - old)[np.isfinite(new - old)]
            mean, error = float(difference.mean()), float(difference.std(ddof=1)) / np.sqrt(difference.size)
        else:
            old, new = old[np.isfinite(old)], new[np.isfinite(new)]
            mean = float(new.mean() - old.mean())
            error = float(np.hypot(new.std(ddof=1) / np.sqrt(new.size), old.std(ddof=1) / np.sqrt(old.size)))
        blocks = float(min(np.isfinite(self.old.levels).sum(), np.isfinite(self.new.levels).sum()))
        (drift_variance,), (drift_freedom,) = self.repeatability.variance_and_freedom([RESIDUAL_LEVEL])
        error = float(np.sqrt(error**2 + LOG_NOISE_POWER_ERROR**2 + 2.0 * drift_variance))
        return HypothesisTest(Hypothesis(UNEXPLAINED), mean, error, min(max(blocks - 1.0, 1.0), drift_freedom))

    def with_accepted(self, *hypotheses: Hypothesis) -> Comparison:
        """Return the comparison with further accepted hypotheses."""
        return replace(self, accepted=(*self.accepted, *hypotheses))


def _satterthwaite_freedom(parts: Array, drift_parts: Array, drift_freedom: Array) -> float:
    """Return the degrees of freedom of the sum of the variances of blocks (B,) and of drifts (n,) (F. E.
    Satterthwaite).
    """
    blocks = float(np.sum(parts**2))
    spread = blocks**2 / effective_degrees_of_freedom(parts) + float(np.sum(drift_parts**2 / drift_freedom))
    return (blocks + float(np.sum(drift_parts))) ** 2 / spread


def _direction(hypothesis: Hypothesis, effect_indices: Sequence[int], baseline: Baseline) -> Array:
    """Return the direction of a hypothesis in the coordinates and the steps of ``effect_indices``, shape (k + n,)."""
    k = len(baseline.coordinates)
    direction = np.zeros(k + len(effect_indices))
    if hypothesis.direction is not None:
        direction[:k] = hypothesis.direction
    else:
        direction[k + effect_indices.index(hypothesis.effect_index)] = 1.0
    return direction


def _estimates(one: Baseline, effect_indices: Sequence[int]) -> Array:
    """Return the estimates with the effects of ``effect_indices`` in the model, then their steps."""
    estimates = one.estimates.copy()
    for i in effect_indices:
        estimates -= one.bias[:, i] * one.steps[i]
    return np.append(estimates, one.steps[list(effect_indices)])


def _white_noise_covariance(one: Baseline, effect_indices: Sequence[int]) -> Array:
    """Return the covariance of :func:`_estimates` for white residuals."""
    k = len(one.coordinates)
    covariance = np.zeros((k + len(effect_indices), k + len(effect_indices)))
    covariance[:k, :k] = one.white_noise_covariance
    for n, i in enumerate(effect_indices):
        bias, variance = one.bias[:, i], 1.0 / one.power[i]
        covariance[:k, :k] += variance * np.outer(bias, bias)
        covariance[:k, k + n] = covariance[k + n, :k] = -variance * bias
        covariance[k + n, k + n] = variance
    return covariance


def _block_contributions(one: Baseline, effect_indices: Sequence[int], contrast: Array) -> Array:
    """Return the contribution of each block to a contrast of :func:`_estimates` (B,).

    For a step each block is compared with the step that the other blocks estimate (jackknife, HC3). A single block that
    shows an effect fits it perfectly and would otherwise have no error.
    """
    influence, columns = one.influence.copy(), []
    for i in effect_indices:
        step = one.step_influence[:, i]
        if (
            one.step_cross_influence is not None and one.block_power_share is not None
        ):  # an existing change is no scatter
            influence += one.steps[i] * one.step_cross_influence[i]
            step = (step - one.steps[i] * one.block_power_share[:, i]) / np.maximum(
                1.0 - one.block_power_share[:, i], MIN_LEVERAGE_COMPLEMENT
            )
        influence -= np.outer(step, one.bias[:, i])
        columns.append(step)
    parts = np.column_stack([influence, *columns]) @ contrast
    blocks, fitted = parts.size, len(one.coordinates) + len(effect_indices)
    return np.asarray(parts * np.sqrt(blocks / max(blocks - fitted, 1)))
