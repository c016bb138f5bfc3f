"""Repeatability of a rig: the variation of its parameters from one healthy date to another, in excess of their errors.

Each healthy date is compared with the same old model. The variance between dates is divided by the mean variance of the
estimates. Few dates determine this ratio badly, so it is shrunk toward the distribution of many ratios (of all rigs of
a fleet, or of all quantities of the rig). Source: G. K. Smyth, Stat. Appl. Genet. Mol. Biol. 3 (2004) 3.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import digamma, polygamma

from pneucli.arrays import Array
from pneucli.changes.baseline import Baseline

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
