"""The law that is fitted to the curves: the model's own valve, bent as far as the curves ask for it.

dp/dt = trend(u, p) exp(h(u, r)) + l(p), where the trend is the quasi-static gradient of the fitted model
(:mod:`pneucli.identify.valve.model_gradient`) and r the ratio of downstream to upstream pressure. h is a polynomial in r shared
by the commands of one sign plus one of low degree per command, linear in log |u| between commands; l holds a leak.
What h and l say beyond their errors is what the model lacks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.valve.model_gradient import Trend

Array = NDArray[np.float64]
Gradient = Callable[[Array, Array, Array], Array]

SHARED, OWN, LEAK = 9, 3, 4  # coefficients of the shared and a command's own correction, and of l
FURTHEST = 5.0  # of h: a hundredfold flow is no correction


def polynomial(x: Array, coefficients: Array) -> Array:
    """Return sum c_k x^k; ``coefficients`` has the powers along its first axis."""
    value = coefficients[-1]
    for c in coefficients[-2::-1]:
        value = value * x + c
    return np.asarray(value)


@dataclass(frozen=True)
class Direction:
    """The commands of one sign that were held: ``nodes`` = |u| in V, increasing; ``sign`` +1 fills, -1 vents."""

    sign: int
    nodes: Array

    @property
    def size(self) -> int:
        """Number of corrections: shared shape, own shapes."""
        return SHARED + OWN * self.nodes.size

    def weights(self, u: Array) -> Array:
        """Return the share of each node at u, shape ``u.shape + (nodes,)``: hats in log |u|, constant outside."""
        position = np.log(np.clip(self.sign * u, self.nodes[0], self.nodes[-1]))
        return np.stack([np.interp(position, np.log(self.nodes), e) for e in np.eye(self.nodes.size)], axis=-1)


@dataclass(frozen=True)
class Law:
    """The gradient for parameters ``theta``: the trend's, those of each direction in turn, ``LEAK`` coefficients of l.

    Pressures absolute in Pa; ``scale`` is the gradient (Pa/s) that a leak coefficient of 1 stands for.
    """

    trend: Trend
    directions: tuple[Direction, ...]
    ambient: float
    supply: float
    scale: float

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.trend.free) + sum(d.size for d in self.directions) + LEAK

    def offsets(self) -> list[int]:
        """Return where each direction's parameters begin."""
        return [len(self.trend.free) + sum(d.size for d in self.directions[:k]) for k in range(len(self.directions))]

    def commands(self, count: int) -> Array:
        """Return commands in V over the tested range: ``count`` of them, or all that a switching valve has."""
        top = {d.sign: float(d.nodes[-1]) for d in self.directions}
        ends = -top.get(-1, 0.0), top.get(1, 0.0)
        return np.unique([*ends, 0.0]) if self.trend.valve.form == "switching" else np.linspace(*ends, count)

    def groups(self) -> dict[str, NDArray[np.int64]]:
        """Return the indices of the corrections that share one prior width: ``shared``, ``own`` and ``leak``."""
        starts = list(zip(self.offsets(), self.directions, strict=True))
        shared = [np.arange(o, o + SHARED) for o, _ in starts]
        own = [np.arange(o + SHARED, o + d.size) for o, d in starts]
        leak = np.arange(self.size - LEAK, self.size)
        return {"shared": np.concatenate(shared), "own": np.concatenate(own), "leak": leak}

    def start(self) -> Array:
        """Return theta (k,) of the model as it is, without corrections."""
        return np.concatenate([self.trend.start, np.zeros(self.size - len(self.trend.free))])

    def shape(self, theta: Array, u: Array) -> Array:
        """Return the coefficients of h over 2 r - 1, shape ``(SHARED, *u.shape)``."""
        shape = np.zeros((SHARED, *u.shape))
        for o, d in zip(self.offsets(), self.directions, strict=True):
            mine = np.sign(u) == d.sign
            own = theta[o + SHARED : o + d.size].reshape(-1, OWN)
            shape[:, mine] = theta[o : o + SHARED, None]
            shape[:OWN, mine] += (d.weights(u[mine]) @ own).T
        return shape

    def other(self, u: Array, supply: Array) -> Array:
        """Return the pressure in Pa on the valve's other side."""
        return np.asarray(np.where(u > 0, supply, self.ambient))

    def ratio(self, u: Array, p: Array, supply: Array) -> Array:
        """Return the ratio r of the lower to the higher pressure across the valve."""
        other = self.other(u, supply)
        return np.minimum(p, other) / np.maximum(p, other)

    def bent(self, theta: Array, shape: Array, trend: Array, u: Array, p: Array, supply: Array) -> Array:
        """Return the gradient in Pa/s from the trend's there."""
        return np.asarray(trend * self.bend(shape, u, p, supply) + self.leak(theta, p))

    def bend(self, shape: Array, u: Array, p: Array, supply: Array) -> Array:
        """Return exp(h), which a step of the fit that goes astray does not let grow beyond all numbers."""
        return np.asarray(np.exp(np.clip(polynomial(2 * self.ratio(u, p, supply) - 1, shape), -FURTHEST, FURTHEST)))

    def leak(self, theta: Array, p: Array) -> Array:
        """Return l(p) in Pa/s, a cubic in p, constant outside ambient to supply."""
        return np.asarray(self.scale * polynomial(self._relative(p), theta[-LEAK:]))

    def gradient(self, theta: Array, u: Array, p: Array, supply: Array) -> Array:
        """Return dp/dt in Pa/s; all arrays of one shape."""
        trend = self.trend.at(self.moved(theta))(u, p, supply)
        return self.bent(theta, self.shape(theta, u), trend, u, p, supply)

    def moved(self, theta: Array) -> Array:
        """Return the trend's own coordinates."""
        return theta[: len(self.trend.free)]

    def away(self, theta: Array) -> Array:
        """Return how far the trend's coordinates have moved from the model's."""
        return np.asarray(self.moved(theta) - self.trend.start)

    def sensitivity(self, theta: Array, u: Array, p: Array, supply: Array) -> Array:
        """Return the derivative of the gradient to theta, shape ``u.shape + (size,)``."""
        z = self.moved(theta)
        r = 2 * self.ratio(u, p, supply) - 1
        bend = self.bend(self.shape(theta, u), u, p, supply)
        flow = self.trend.at(z)(u, p, supply) * bend
        powers = r[..., None] ** np.arange(SHARED)
        out = np.zeros((*u.shape, self.size))
        out[..., : z.size] = bend[..., None] * self.trend.sensitivity(z, u, p, supply)
        for o, d in zip(self.offsets(), self.directions, strict=True):
            mine = np.sign(u) == d.sign
            own = d.weights(u[mine])[..., :, None] * powers[mine][..., None, :OWN]
            columns = [powers[mine], own.reshape(*own.shape[:-2], OWN * d.nodes.size)]
            out[mine, o : o + d.size] = flow[mine][..., None] * np.concatenate(columns, axis=-1)
        out[..., -LEAK:] = self.scale * self._relative(p)[..., None] ** np.arange(LEAK)
        return out

    def _relative(self, p: Array) -> Array:
        return np.asarray(np.minimum(np.maximum((p - self.ambient) / (self.supply - self.ambient), 0.0), 1.0))
