"""What a fall of the residual is worth: blocks of time instead of samples, since residuals are correlated.

All costs are sums of squared residuals in units of noise, block by block; a block is a stretch of one view, longer
than the residual's memory (:func:`pneucli.identify.fit.block_numbers`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher
from scipy.stats import t as student
from statsmodels.stats.multitest import multipletests

from pneucli.identify.fit import Fit
from pneucli.identify.parameters import value_of
from pneucli.physics.declaration import Effect

Array = NDArray[np.float64]

RESAMPLES = 2000
SEED = 7


def block_costs(residual: Array, blocks: NDArray[np.int64]) -> Array:
    """Return the sum of squares of each block."""
    return np.bincount(blocks, weights=residual**2).astype(np.float64)


@dataclass(frozen=True)
class Gain:
    """The fall of a cost over all blocks, its one-sided 95 % lower bound, and the chance that there is none."""

    total: float
    low: float
    p_value: float

    @property
    def certain(self) -> bool:
        """Whether the lower bound excludes zero."""
        return self.low > 0.0


def gain(before: Array, after: Array) -> Gain:
    """Return how far the cost falls from ``before`` to ``after``, both by block; the interval by block bootstrap.

    The chance is that of a paired t test over the blocks, with as many degrees of freedom as blocks that matter
    (Vuong's test where neither model contains the other).
    """
    fall = before - after
    total = float(fall.sum())
    if fall.size < 2 or not np.any(fall):
        return Gain(total, min(total, 0.0), 1.0)
    rng = np.random.default_rng(SEED)
    drawn = fall[rng.integers(fall.size, size=(RESAMPLES, fall.size))].sum(axis=1)
    spread = float(np.std(fall, ddof=1) * np.sqrt(fall.size))
    freedom = effective_number(fall - fall.mean())
    return Gain(total, float(np.quantile(drawn, 0.05)), float(student.sf(total / max(spread, 1e-300), freedom)))


def effective_number(parts: Array) -> float:
    """Return how many equal normal parts vary as much as these do: rare large ones count as few."""
    squares = parts**2
    fourth = float((squares**2).sum())
    return max(3.0 * float(squares.sum()) ** 2 / fourth - 2.0, 1.0) if fourth > 0.0 else 1.0


def wald(found: Fit, effect: Effect) -> float:
    """Return the chance of the effect's fitted values where its nulls are true; NaN where it has no null.

    A Wald test with the covariance of blocks, halved where the null is a bound that can be left to one side only.
    """
    rows, distance, bounded = [], [], True
    names = [f.name for f in found.free]
    for p in effect.parameters:
        name = f"{effect.name}.{p.name}"
        if p.null is None or name not in names:
            continue
        row = np.zeros(len(names))
        row[names.index(name)] = 1.0
        null = p.null if not isinstance(p.null, str) else value_of(found.model, p.null)
        if isinstance(p.null, str) and p.null in names:
            row[names.index(p.null)] = -1.0
        rows.append(row)
        distance.append(value_of(found.model, name) - null)
        bounded &= p.lower == null
    if not rows:
        return float("nan")
    return _tail(found, np.array(rows), np.array(distance)) / (2.0 if bounded and len(rows) == 1 else 1.0)


def _tail(found: Fit, contrast: Array, distance: Array) -> float:
    slopes = np.array([f.slope(value_of(found.model, f.name)) for f in found.free])
    contrast = contrast * slopes
    covariance = contrast @ found.covariance @ contrast.T
    statistic = float(distance @ np.linalg.pinv(covariance, hermitian=True) @ distance) / len(distance)
    return float(fisher.sf(statistic, len(distance), _freedom(found, contrast)))


def _freedom(found: Fit, contrast: Array) -> float:
    """Return the number of blocks from which the contrast's variance is known."""
    influence = found.jacobian @ (found.bread @ contrast.T) * found.residual[:, None]
    parts = [np.bincount(found.blocks, weights=column).astype(np.float64) for column in influence.T]
    return min(effective_number(part) for part in parts)


def holm(p_values: Sequence[float], hypotheses: int) -> list[float]:
    """Return p values adjusted after Holm for a family of ``hypotheses``, of which these are the smallest."""
    family = [*p_values, *[1.0] * (hypotheses - len(p_values))]
    return [float(p) for p in multipletests(family, method="holm")[1][: len(p_values)]] if family else []
