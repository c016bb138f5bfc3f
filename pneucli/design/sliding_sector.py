"""The sliding sector from the vertices of the TP friction model (thesis 5.4, 6.2).

The piston is ``dv/dt = F / m - a22(v) v``; a22 lies between two vertices a1 < a2. The sector lies between the lines
``s_r = x2 + lambda_r x1`` of the position error x1 and its rate x2. The same equivalent force on both lines needs
``lambda2 - lambda1 = a2 - a1``, and with the width ``alpha = lambda2 / lambda1`` follows
``lambda1 = (a2 - a1) / (alpha - 1)`` (6.18-6.20).

How steep it becomes rests on a22(0) = (breakaway force / v0 + viscous) / m, where v0 is the speed below which friction
is no longer resolved. That is a choice, not physics: the vertices as identified carry that of the friction model's
grid; a controller that samples with T can follow a line only if lambda T is small.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pneucli.errors import InputError

Array = NDArray[np.float64]

MAX_SLOPE_PER_SAMPLE = (
    0.2  # lambda T: from its start to a line, a sampled controller overshoots by less than that share
)


@dataclass(frozen=True)
class SlidingSector:
    """Lines of slope ``lambda_1 < lambda_2`` (1/s) from vertices ``a_1 < a_2`` (1/s), for a mass (kg) and a period (s).

    ``speed_floor``: the speed (m/s) below which a22 counts as constant, so that a22(0) = a_2.
    """

    a_1: float
    a_2: float
    lambda_1: float
    lambda_2: float
    mass: float
    period: float
    speed_floor: float

    @property
    def middle(self) -> float:
        """Slope of the middle line in 1/s (5.14)."""
        return 0.5 * (self.lambda_1 + self.lambda_2)

    @property
    def steepness(self) -> float:
        """The steeper line's slope times the period."""
        return self.lambda_2 * self.period

    @property
    def warning(self) -> str:
        """What is wrong with it for a sampled controller; empty where nothing is."""
        if self.steepness <= MAX_SLOPE_PER_SAMPLE:
            return ""
        return (
            f"too steep for the sample time (lambda2 T = {self.steepness:.3g}, at most {MAX_SLOPE_PER_SAMPLE}; a22(0) = "
            f"{self.a_2:.3g} 1/s with friction resolved down to {self.speed_floor:.2g} m/s): the resolved one is taken"
        )

    def equivalent_force(self, v: ArrayLike, x2: ArrayLike, acceleration: ArrayLike = 0.0) -> Array:
        """Return the equivalent force in N (6.16), mean of both lines, and a moving reference's acceleration.

        For a constant one, x2 = v and both lines give the same force.
        """
        v, x2 = np.asarray(v, dtype=np.float64), np.asarray(x2, dtype=np.float64)
        mean = 0.5 * (self.a_1 + self.a_2)
        return np.asarray(self.mass * (mean * v - self.middle * x2 + np.asarray(acceleration)))

    def switching_term(self, x1: ArrayLike, x2: ArrayLike, boundary_layer: float = 0.0) -> Array:
        """Return the switching term, -1 to 1: minus the sign outside the sector, continuous across it (5.13).

        Toward the origin the sector narrows to nothing; within ``boundary_layer`` (m) the term fades instead, see :meth:`boundary_layer`.
        """
        s1 = np.asarray(x2) + self.lambda_1 * np.asarray(x1)
        s2 = np.asarray(x2) + self.lambda_2 * np.asarray(x1)
        least = max((self.lambda_1 + self.lambda_2) * boundary_layer, np.finfo(float).tiny)
        return np.asarray(-(s1 + s2) / np.maximum(np.abs(s1) + np.abs(s2), least))

    def boundary_layer(self, max_force: float) -> float:
        """Return the error in m below which a force of ``max_force`` N crosses the whole sector within one sample."""
        return max_force * self.period / (self.mass * self.lambda_1)

    def force(
        self, x1: ArrayLike, x2: ArrayLike, v: ArrayLike, max_force: float, acceleration: ArrayLike = 0.0
    ) -> Array:
        """Return equivalent and switching force in N; ``max_force`` is M of (5.13)."""
        return self.equivalent_force(v, x2, acceleration) + max_force * self.switching_term(
            x1, x2, self.boundary_layer(max_force)
        )


def sector_from_vertices(
    vertices: ArrayLike, mass: float, period: float, static: float, width: float = 2.0
) -> SlidingSector:
    """Return the sector of a TP friction model; ``vertices`` of a22 in 1/s, ``static``: breakaway force in N.

    Raises InputError where the vertices do not differ or the width is not above 1.
    """
    values = np.asarray(vertices, dtype=np.float64).ravel()
    low, high = float(values.min()), float(values.max())
    if width <= 1.0:
        raise InputError("[design] sector_ratio", f"{width:g}", "above 1")
    if high - low <= 1e-9 * max(abs(high), 1.0):
        raise InputError("the friction model", "its vertices are equal: a22 does not depend on speed", "dry friction")
    lambda_1 = (high - low) / (width - 1.0)
    return SlidingSector(low, high, lambda_1, width * lambda_1, mass, period, speed_floor(high, mass, static, low))


def limit_slope(sector: SlidingSector, static: float, max_slope: float) -> SlidingSector:
    """Return the sector with a22(0) resolved only as far as the slope ``max_slope`` (1/s) allows, or the same one."""
    if sector.lambda_2 <= max_slope:
        return sector
    width = sector.lambda_2 / sector.lambda_1
    high = sector.a_1 + max_slope * (1.0 - 1.0 / width)
    floor = speed_floor(high, sector.mass, static, sector.a_1)
    return SlidingSector(sector.a_1, high, max_slope / width, max_slope, sector.mass, sector.period, floor)


def speed_floor(a_0: float, mass: float, static: float, a_1: float) -> float:
    """Return the speed in m/s at which dry friction makes the damping a_0 (1/s) beside that of the other vertex."""
    return static / (mass * (a_0 - a_1)) if a_0 > a_1 else math.inf
