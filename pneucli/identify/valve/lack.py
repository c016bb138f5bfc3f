"""What the model says of the map, and where that is further from the measured one than either interval: lack of fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.valve.maps import Z95, GradientMap
from pneucli.identify.valve.trend import Trend

Array = NDArray[np.float64]

SLIGHT = 0.01  # of the largest gradient: below it a share of the gradient says little
NOTED = 0.02  # of the gradient: a difference beyond that, and both intervals, at
OFTEN = 0.05  # of the points is worth a warning


@dataclass(frozen=True)
class LackOfFit:
    """The model against the map at its points, arrays ``(nu, np)`` in Pa/s; ``error`` is the model's own, standard.

    ``outside``: the difference is more than each of both 95 % intervals allows for.
    """

    model: Array
    error: Array
    difference: Array
    outside: NDArray[np.bool_]
    counted: NDArray[np.bool_]
    relative: Array

    @property
    def median(self) -> float | None:
        """Median of |difference| over the measured gradient, where data covered the map and something flows."""
        return self._quantile(0.5)

    @property
    def p95(self) -> float | None:
        """95th percentile of the same."""
        return self._quantile(0.95)

    @property
    def share_outside(self) -> float | None:
        """Share of those points that lie outside both intervals."""
        return float(np.mean(self.outside[self.counted])) if self.counted.any() else None

    @property
    def noticeable(self) -> bool:
        """Whether the model is off by more than both intervals and 2 % of the gradient at more than 5 % of them."""
        off = self.outside & (self.relative > NOTED)
        return bool(self.counted.any() and np.mean(off[self.counted]) > OFTEN)

    def _quantile(self, q: float) -> float | None:
        return float(np.quantile(self.relative[self.counted], q)) if self.counted.any() else None


def lack_of_fit(model: Trend, supply_pressure: float, grid: GradientMap) -> LackOfFit:
    """Hold the model's valve at rest against the measured map, which is at this supply pressure in Pa."""
    u, p = np.meshgrid(grid.u, grid.p, indexing="ij")
    supply = np.full(u.shape, supply_pressure)
    modelled, error = model.at(model.start)(u, p, supply), model.error(u, p, supply)
    difference = grid.gradient - modelled
    outside = (np.abs(difference) > Z95 * error) & (np.abs(difference) > 0.5 * (grid.ci_high - grid.ci_low))
    size = np.abs(grid.gradient)
    counted = grid.covered & (size > SLIGHT * size.max())
    relative = np.abs(difference) / np.where(counted, size, np.inf)
    return LackOfFit(modelled, error, difference, outside & grid.covered, counted, relative)
