"""Smooth functions of one signal that may explain a residual.

A model may lack a force, a friction or a flow that no catalogue names and that is a function of the position, of time
or of a pressure. Such a function is fitted to the residual of a channel as a penalised spline (Eilers and Marx,
Statistical Science 11, 1996), linearised and together with the model's own parameters. Its share is that of the squares
that it explains in recordings left out of the fit, one after the other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KNOTS = 60  # evenly spaced over the range of the signal

SIMPLE_SHAPES: dict[str, Callable[[Array], Array]] = {
    "constant": lambda q: np.array([np.ones_like(q)]),
    "proportional": lambda q: np.array([q]),
    "sign": lambda q: np.array([np.sign(q)]),
    "signed-square": lambda q: np.array([q * np.abs(q)]),
    "line": lambda q: np.array([np.ones_like(q), q]),
    "parabola": lambda q: np.array([np.ones_like(q), q, q**2]),
}


@dataclass(frozen=True)
class SmoothTerm:
    """A function of one signal in one channel.

    ``acts_as`` is the quantity as which it acts (:class:`pneucli.identify.residuals.base.DiscrepancyTerm`), ``share``
    the part of the left-out squares that it explains; ``values`` (KNOTS,) has its values in ``unit`` from ``low`` to
    ``high`` of the signal. It is a spline with the weight ``penalty``, or has one of the SIMPLE_SHAPES. ``term_index``
    is that of the discrepancy term.
    """

    signal: str
    acts_as: str
    unit: str
    term_index: int
    share: float
    low: float
    high: float
    values: Array
    penalty: float
    simple_shape: str | None = None

    @property
    def basis(self) -> Array:
        """The basis functions at the knots (k, KNOTS)."""
        if self.simple_shape is None:
            return np.eye(KNOTS)
        return SIMPLE_SHAPES[self.simple_shape](
            np.linspace(self.low, self.high, KNOTS) / max(abs(self.low), abs(self.high))
        )


def linear_bspline_basis(positions: Array) -> Array:
    """Return linear B-splines (KNOTS, n) at positions (n,) from 0 to 1; 0 where a position is NaN."""
    out = np.zeros((KNOTS, positions.size))
    finite = np.flatnonzero(np.isfinite(positions))
    knots = np.clip(positions[finite], 0.0, 1.0) * (KNOTS - 1)
    first = np.minimum(knots.astype(np.int64), KNOTS - 2)
    out[first, finite], out[first + 1, finite] = 1.0 - (knots - first), knots - first
    return out
