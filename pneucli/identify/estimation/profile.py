"""The profile of the cost over a delay or a time constant, and its lowest minimum."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pneucli.arrays import Array
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.score_test import residual_changes
from pneucli.identify.residuals import ResidualModel
from pneucli.physics.declaration import Effect, consists_of_times
from pneucli.physics.scales import RigQuantities

TIME_SCAN_POINTS = 33  # values of a time constant or delay, from its smallest typical value to its bound
SCAN_STRIDE = 2  # every second value is tried, then those beside the best one: minima are far wider than a step


def lower_profile_minimum(
    fitted: Fit, residual_models: Sequence[ResidualModel], effect: Effect, quantities: RigQuantities
) -> dict[str, float] | None:
    """Search the profile of a delay or time constant for a lower minimum.

    The residual over a shift in time behaves like a correlation: it has several minima, and a fit ends in the
    nearest one. The profile is the cost over that time, all other parameters adjusting to first order.

    Args:
        fitted: The fit with the effect.
        residual_models: The residual models it was fitted to.
        effect: The effect; only one with a single time of null 0 s is searched.
        quantities: The quantities that scale the effect's range.

    Returns:
        The value of the parameter with a lower cost than the fit's; None where there is none.

    """
    if len(effect.main_parameters) != 1 or not consists_of_times(effect):
        return None
    (time,) = effect.main_parameters
    name, size = f"{effect.name}.{time.name}", time.range_on(quantities)
    times = np.geomspace(min(size.typical), size.upper, TIME_SCAN_POINTS)
    inverse = fitted.inverse_hessian_holding(np.array([f.name == name for f in fitted.free], dtype=bool))
    gradient = fitted.jacobian.T @ fitted.residual

    def adjusted_cost(change: Array) -> float:
        """Return the squares that remain of changed residuals where the other parameters adjust; of a diverging model
        infinitely many.
        """
        residual, slope = fitted.residual + change, gradient + fitted.transposed_product(change)
        cost = float(residual @ residual - slope @ inverse @ slope)
        return cost if math.isfinite(cost) else math.inf

    def scan(places: Sequence[int]) -> dict[int, float]:
        values = [{name: float(times[i])} for i in places]
        changes = residual_changes(effect, fitted, residual_models, values)
        return {i: adjusted_cost(change) for i, change in zip(places, changes, strict=True)}

    profile = scan(range(0, TIME_SCAN_POINTS, SCAN_STRIDE))
    best = min(profile, key=profile.__getitem__)
    profile |= scan([i for i in (best - 1, best + 1) if 0 <= i < TIME_SCAN_POINTS])
    best = min(profile, key=profile.__getitem__)
    lower = profile[best] < adjusted_cost(np.zeros_like(fitted.residual))
    return {name: float(times[best])} if lower else None
