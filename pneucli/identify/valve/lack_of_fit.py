"""What the model says of the map, and where that is further from the measured one than either interval: lack of fit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.valve.maps import Z95, GradientMap
from pneucli.identify.valve.model_gradient import ModelGradient

Array = NDArray[np.float64]

MIN_GRADIENT_RATIO = 0.01  # of the largest gradient: below it a share of the gradient says little
MIN_RELATIVE_DIFFERENCE = 0.02  # of the gradient: a difference beyond that, and both intervals, at
MAX_SHARE_OUTSIDE = 0.05  # of the points is worth a warning


@dataclass(frozen=True)
class LackOfFit:
    """The model against what was measured at points ``u`` (V from the null) and ``p`` (Pa), arrays ``(nu, np)``.

    In Pa/s; ``model_error`` is the model's own, standard, ``half_interval`` half the width of the 95 % interval of
    ``measured``. ``covered`` where something was measured; ``has_flow`` where enough flows there.
    """

    u: Array
    p: Array
    model: Array
    model_error: Array
    measured: Array
    half_interval: Array
    covered: NDArray[np.bool_]

    @property
    def difference(self) -> Array:
        """What was measured less what the model says, in Pa/s."""
        return self.measured - self.model

    @cached_property
    def outside(self) -> NDArray[np.bool_]:
        """Where the difference is more than each of both 95 % intervals allows for."""
        off = np.abs(self.difference)
        return np.asarray(self.covered & (off > Z95 * self.model_error) & (off > self.half_interval))

    @cached_property
    def has_flow(self) -> NDArray[np.bool_]:
        """Where a share of the gradient says something."""
        size = np.abs(self.measured)
        return np.asarray(self.covered & (size > MIN_GRADIENT_RATIO * size.max(where=self.covered, initial=0.0)))

    @property
    def relative_difference(self) -> Array:
        """The size of the difference over that of the measured gradient, 0 where it is not counted."""
        return np.asarray(np.abs(self.difference) / np.where(self.has_flow, np.abs(self.measured), np.inf))

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
        return float(np.mean(self.outside[self.has_flow])) if self.has_flow.any() else None

    @property
    def is_significant(self) -> bool:
        """Whether the model is off by more than both intervals and 2 % of the gradient at more than 5 % of them."""
        off = self.outside & (self.relative_difference > MIN_RELATIVE_DIFFERENCE)
        return bool(self.has_flow.any() and np.mean(off[self.has_flow]) > MAX_SHARE_OUTSIDE)

    def _quantile(self, q: float) -> float | None:
        return float(np.quantile(self.relative_difference[self.has_flow], q)) if self.has_flow.any() else None


def compare_with_map(model: ModelGradient, supply_pressure: float, grid: GradientMap) -> LackOfFit:
    """Hold the model's valve at rest against the measured map, which is at this supply pressure in Pa."""
    u, p = np.meshgrid(grid.u, grid.p, indexing="ij")
    supply = np.full(u.shape, supply_pressure)
    modelled, error = model.at_coordinates(model.start)(u, p, supply), model.standard_error(u, p, supply)
    return LackOfFit(u, p, modelled, error, grid.gradient, 0.5 * (grid.ci_high - grid.ci_low), grid.covered)
