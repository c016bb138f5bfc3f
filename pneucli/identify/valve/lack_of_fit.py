"""Lack of fit of the model's valve: where its gradient lies outside the intervals of both the map and the model."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.identify.valve.maps import GradientMap
from pneucli.identify.valve.model_gradient import ModelGradient
from pneucli.quantities import Z95

MIN_GRADIENT_RATIO = 0.01  # of the largest gradient; relative differences of smaller ones are not counted
MIN_RELATIVE_DIFFERENCE = 0.02  # of the gradient: a difference beyond it and both intervals counts as a misfit
MAX_SHARE_OUTSIDE = 0.05  # share of points with a misfit beyond which the lack of fit is significant


@dataclass(frozen=True)
class LackOfFit:
    """The model compared with the measured map at points ``u`` (V from the null) and ``p`` (Pa), arrays ``(nu, np)``.

    All gradients in Pa/s; ``model_error`` is the standard error of the model, ``half_interval`` half the 95 % interval
    of ``measured``; ``covered`` marks points with data.
    """

    u: Array
    p: Array
    model: Array
    model_error: Array
    measured: Array
    half_interval: Array
    covered: Mask

    @property
    def difference(self) -> Array:
        """Measured minus modelled gradient in Pa/s."""
        return self.measured - self.model

    @cached_property
    def outside(self) -> Mask:
        """Where the difference exceeds both 95 % intervals."""
        distance = np.abs(self.difference)
        return np.asarray(self.covered & (distance > Z95 * self.model_error) & (distance > self.half_interval))

    @cached_property
    def has_flow(self) -> Mask:
        """Where the gradient is large enough for a relative difference."""
        magnitude = np.abs(self.measured)
        return np.asarray(
            self.covered & (magnitude > MIN_GRADIENT_RATIO * magnitude.max(where=self.covered, initial=0.0))
        )

    @property
    def relative_difference(self) -> Array:
        """The difference relative to the measured gradient, 0 where it does not count."""
        return np.asarray(np.abs(self.difference) / np.where(self.has_flow, np.abs(self.measured), np.inf))

    @property
    def median(self) -> float | None:
        """Median relative difference where data cover the map and air flows; None without such points."""
        return self._quantile(0.5)

    @property
    def p95(self) -> float | None:
        """95th percentile of the relative difference; None without such points."""
        return self._quantile(0.95)

    @property
    def share_outside(self) -> float | None:
        """Share of those points outside both intervals; None without such points."""
        return float(np.mean(self.outside[self.has_flow])) if self.has_flow.any() else None

    @property
    def is_significant(self) -> bool:
        """Whether more than 5 % of the points differ by more than both intervals and 2 % of the gradient."""
        distance = self.outside & (self.relative_difference > MIN_RELATIVE_DIFFERENCE)
        return bool(self.has_flow.any() and np.mean(distance[self.has_flow]) > MAX_SHARE_OUTSIDE)

    def _quantile(self, q: float) -> float | None:
        return float(np.quantile(self.relative_difference[self.has_flow], q)) if self.has_flow.any() else None


def compare_with_map(model: ModelGradient, supply_pressure: float, grid: GradientMap) -> LackOfFit:
    """Compare the quasi-static gradient of the model with the measured map.

    Args:
        model: The gradient of the fitted model.
        supply_pressure: Supply pressure of the map in Pa.
        grid: The measured map.

    Returns:
        The comparison at the points of the map.

    """
    u, p = np.meshgrid(grid.u, grid.p, indexing="ij")
    supply = np.full(u.shape, supply_pressure)
    modelled, error = model.at_coordinates(model.start)(u, p, supply), model.standard_error(u, p, supply)
    return LackOfFit(u, p, modelled, error, grid.gradient, 0.5 * (grid.ci_high - grid.ci_low), grid.covered)
