"""How well a rig repeats: what its parameters vary by from one healthy date to another, beyond their own errors.

Each healthy date was held against the same old model. Of every quantity the variance between dates is set over the mean
variance of the estimates; few dates tell little of it, so it is drawn towards what many such ratios say together (of
all rigs of a fleet, or of all quantities of the rig), as much as these agree. Source: G. K. Smyth, Stat. Appl. Genet.
Mol. Biol. 3 (2004) 3.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import digamma, polygamma

from pneucli.changes.baseline import Baseline

Array = NDArray[np.float64]
RepeatDifferences = Mapping[
    str, Sequence[float]
]  # by name: difference from the old model, its error, the error of the old one
VariancePrior = tuple[
    float, float
]  # degrees of freedom of what is known beforehand of a ratio of variances, and that ratio

RESIDUAL_LEVEL = "level"
MIN_RATIOS = 8  # ratios from which something is known beforehand
MAX_DEGREES_OF_FREEDOM = 1024.0  # degrees of freedom: as good as any number
MIN_RATIO = 1e-12  # of a ratio: its logarithm is taken


@dataclass(frozen=True)
class Repeatability:
    """The variance of each quantity from one healthy date to another, by name, and the degrees of freedom of it."""

    variance: Mapping[str, float]
    degrees_of_freedom: Mapping[str, float]

    def variance_and_freedom(self, names: Sequence[str]) -> tuple[Array, Array]:
        """Return variances and degrees of freedom (n,); what no healthy date has shown is taken not to vary."""
        variance = np.array([self.variance.get(n, 0.0) for n in names], dtype=np.float64)
        return variance, np.array(
            [self.degrees_of_freedom.get(n, MAX_DEGREES_OF_FREEDOM) for n in names], dtype=np.float64
        )


NO_DRIFT = Repeatability({}, {})


def quantity_names(whole: Baseline, part: Baseline) -> list[str]:
    """Return the names of the coordinates and starts of ``part``, one of ``whole`` with some left out.

    A start is called by its effect and its number among those that the effect has in ``whole``.
    """
    own = [s.effect for s in whole.typical_effects]
    numbered = [f"{name}#{own[:i].count(name)}" for i, name in enumerate(own)]
    return [
        *(c.name for c in part.coordinates),
        *(numbered[whole.typical_effects.index(s)] for s in part.typical_effects),
    ]


def repeat_differences(whole: Baseline, old: Baseline, new: Baseline) -> dict[str, list[float]]:
    """Return what a date says of the old model: for each quantity the difference, its error and that of the old one.

    ``old`` and ``new`` are aligned, ``whole`` is the old reference as it was.
    """
    both = [
        (one.estimates, _standard_errors(one.influence), one.steps, _standard_errors(one.step_influence))
        for one in (old, new)
    ]
    (places, errors, steps, step_errors), (moved, now, stepped, steps_now) = both
    known = [not a.at_bound and not b.at_bound for a, b in zip(old.coordinates, new.coordinates, strict=True)]
    known += [bool(p > 0.0) for p in np.minimum(old.power, new.power)]
    rows = np.column_stack(
        [
            np.append(moved - places, stepped - steps),
            np.append(now, steps_now),
            np.append(errors, step_errors),
        ]
    )
    told = {n: row.tolist() for n, row, use in zip(quantity_names(whole, old), rows, known, strict=True) if use}
    levels = [one.levels[np.isfinite(one.levels)] for one in (old, new)]
    errors_of = [float(one.std(ddof=1) / np.sqrt(one.size)) for one in levels]
    return told | {RESIDUAL_LEVEL: [float(levels[1].mean() - levels[0].mean()), errors_of[1], errors_of[0]]}


def _standard_errors(influence: Array) -> Array:
    return np.asarray(np.sqrt(np.sum(influence**2, axis=0)))


def variance_ratios(repeats: Sequence[RepeatDifferences]) -> dict[str, tuple[float, float, float]]:
    """Return for each quantity the variance between dates over that of its estimates, the dates' degrees of freedom,
    and the mean variance of its estimates. The old model is a date as well.
    """
    found = {}
    for name in dict.fromkeys(n for one in repeats for n in one):
        mine = np.array([one[name] for one in repeats if name in one], dtype=np.float64)
        known = float(np.mean(np.append(mine[:, 1], mine[0, 2]) ** 2))
        if known > 0.0 and np.isfinite(known):
            between = float(np.var(np.append(mine[:, 0], 0.0), ddof=1))
            found[name] = between / known, float(len(mine)), known
    return found


def fit_variance_prior(found: Iterable[tuple[float, float]]) -> VariancePrior | None:
    """Return what many ratios (with their degrees of freedom) say together; None where there are too few.

    By the moments of their logarithms: were they all of one true ratio, these would scatter as those of chi-square do.
    """
    table = np.array([(max(ratio, MIN_RATIO), freedom) for ratio, freedom in found])
    if len(table) < MIN_RATIOS:
        return None
    logs = np.log(table[:, 0]) - digamma(table[:, 1] / 2) + np.log(table[:, 1] / 2)
    beyond = float(np.var(logs, ddof=1) - np.mean(polygamma(1, table[:, 1] / 2)))
    freedom = min(2.0 * _trigamma_inverse(beyond), MAX_DEGREES_OF_FREEDOM) if beyond > 0.0 else MAX_DEGREES_OF_FREEDOM
    return freedom, float(np.exp(np.mean(logs) + digamma(freedom / 2) - np.log(freedom / 2)))


def _trigamma_inverse(value: float) -> float:
    """Return where the trigamma function has a value, by Newton's method on its inverse, which is convex."""
    x = 0.5 + 1.0 / value
    for _ in range(50):
        here = float(polygamma(1, x))
        step = here * (1.0 - here / value) / float(polygamma(2, x))
        x += step
        if abs(step) < 1e-8 * x:
            break
    return x


def estimate_repeatability(
    repeats: Sequence[RepeatDifferences], prior: Mapping[str, VariancePrior] | None = None
) -> Repeatability:
    """Return what the healthy ``repeats`` of a rig say of its drift; ``prior``: what is known beforehand, by name.

    Where nothing is known beforehand of a quantity, all quantities of the rig together tell.
    """
    found = variance_ratios(repeats)
    own = fit_variance_prior((ratio, freedom) for ratio, freedom, _ in found.values()) or (0.0, 1.0)
    variance, freedom = {}, {}
    for name, (ratio, dates, known) in found.items():
        degrees, expected = (prior or {}).get(name, own)
        drawn = (degrees * expected + dates * ratio) / (degrees + dates)
        variance[name], freedom[name] = max(drawn - 1.0, 0.0) * known, degrees + dates
    return Repeatability(variance, freedom)


def pool_priors(rigs: Iterable[Sequence[RepeatDifferences]]) -> dict[str, VariancePrior]:
    """Return by name what the healthy repeats of many rigs of a kind say together."""
    by_name: dict[str, list[tuple[float, float]]] = {}
    for repeats in rigs:
        for name, (ratio, dates, _) in variance_ratios(repeats).items():
            by_name.setdefault(name, []).append((ratio, dates))
    known = {name: fit_variance_prior(found) for name, found in sorted(by_name.items())}
    return {name: one for name, one in known.items() if one is not None}
