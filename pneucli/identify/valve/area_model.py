"""The law that is fitted to the curves: the model's own valve, bent as far as the curves ask for it.

dp/dt = trend(u, p) exp(h(u, r)) + l(p), where the trend is the quasi-static gradient of the fitted model
(:mod:`pneucli.identify.valve.model_gradient`) and r the ratio of downstream to upstream pressure. h is a polynomial in
r shared by the commands of one sign plus one of low degree per command, linear in log |u| between commands; l holds a
leak. What h and l say beyond their errors is what the model lacks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.valve.model_gradient import ModelGradient

Array = NDArray[np.float64]
Gradient = Callable[[Array, Array, Array], Array]

SHARED_COEFFICIENTS, OWN_COEFFICIENTS, LEAK_COEFFICIENTS = (
    9,
    3,
    4,
)  # coefficients of the shared and a command's own correction, and of l
MAX_LOG_CORRECTION = 5.0  # of h: a hundredfold flow is no correction


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
        return SHARED_COEFFICIENTS + OWN_COEFFICIENTS * self.nodes.size

    def node_weights(self, u: Array) -> Array:
        """Return the share of each node at u, shape ``u.shape + (nodes,)``: hats in log |u|, constant outside."""
        position = np.log(np.clip(self.sign * u, self.nodes[0], self.nodes[-1]))
        return np.stack([np.interp(position, np.log(self.nodes), e) for e in np.eye(self.nodes.size)], axis=-1)


@dataclass(frozen=True)
class AreaModel:
    """The gradient for parameters ``theta``: the trend's, those of each direction in turn, ``LEAK_COEFFICIENTS`` coefficients of l.

    Pressures absolute in Pa; ``scale`` is the gradient (Pa/s) that a leak coefficient of 1 stands for.
    """

    model_gradient: ModelGradient
    directions: tuple[Direction, ...]
    ambient: float
    supply: float
    scale: float

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.model_gradient.free) + sum(d.size for d in self.directions) + LEAK_COEFFICIENTS

    def offsets(self) -> list[int]:
        """Return where each direction's parameters begin."""
        return [
            len(self.model_gradient.free) + sum(d.size for d in self.directions[:k])
            for k in range(len(self.directions))
        ]

    def command_grid(self, count: int) -> Array:
        """Return commands in V over the tested range: ``count`` of them, or all that a switching valve has."""
        top = {d.sign: float(d.nodes[-1]) for d in self.directions}
        ends = -top.get(-1, 0.0), top.get(1, 0.0)
        return np.unique([*ends, 0.0]) if self.model_gradient.valve.form == "switching" else np.linspace(*ends, count)

    def prior_groups(self) -> dict[str, NDArray[np.int64]]:
        """Return the indices of the corrections that share one prior width: ``shared``, ``own`` and ``leak``."""
        starts = list(zip(self.offsets(), self.directions, strict=True))
        shared = [np.arange(o, o + SHARED_COEFFICIENTS) for o, _ in starts]
        own = [np.arange(o + SHARED_COEFFICIENTS, o + d.size) for o, d in starts]
        leak = np.arange(self.size - LEAK_COEFFICIENTS, self.size)
        return {"shared": np.concatenate(shared), "own": np.concatenate(own), "leak": leak}

    def initial_theta(self) -> Array:
        """Return theta (k,) of the model as it is, without corrections."""
        return np.concatenate([self.model_gradient.start, np.zeros(self.size - len(self.model_gradient.free))])

    def correction_coefficients(self, theta: Array, u: Array) -> Array:
        """Return the coefficients of h over 2 r - 1, shape ``(SHARED, *u.shape)``."""
        shape = np.zeros((SHARED_COEFFICIENTS, *u.shape))
        for o, d in zip(self.offsets(), self.directions, strict=True):
            mine = np.sign(u) == d.sign
            own = theta[o + SHARED_COEFFICIENTS : o + d.size].reshape(-1, OWN_COEFFICIENTS)
            shape[:, mine] = theta[o : o + SHARED_COEFFICIENTS, None]
            shape[:OWN_COEFFICIENTS, mine] += (d.node_weights(u[mine]) @ own).T
        return shape

    def opposite_pressure(self, u: Array, supply: Array) -> Array:
        """Return the pressure in Pa on the valve's other side."""
        return np.asarray(np.where(u > 0, supply, self.ambient))

    def pressure_ratio(self, u: Array, p: Array, supply: Array) -> Array:
        """Return the ratio r of the lower to the higher pressure across the valve."""
        other = self.opposite_pressure(u, supply)
        return np.minimum(p, other) / np.maximum(p, other)

    def corrected_gradient(self, theta: Array, shape: Array, trend: Array, u: Array, p: Array, supply: Array) -> Array:
        """Return the gradient in Pa/s from the trend's there."""
        return np.asarray(trend * self.correction_factor(shape, u, p, supply) + self.leak(theta, p))

    def correction_factor(self, shape: Array, u: Array, p: Array, supply: Array) -> Array:
        """Return exp(h), which a step of the fit that goes astray does not let grow beyond all numbers."""
        return np.asarray(
            np.exp(
                np.clip(
                    polynomial(2 * self.pressure_ratio(u, p, supply) - 1, shape),
                    -MAX_LOG_CORRECTION,
                    MAX_LOG_CORRECTION,
                )
            )
        )

    def leak(self, theta: Array, p: Array) -> Array:
        """Return l(p) in Pa/s, a cubic in p, constant outside ambient to supply."""
        return np.asarray(self.scale * polynomial(self._relative(p), theta[-LEAK_COEFFICIENTS:]))

    def gradient(self, theta: Array, u: Array, p: Array, supply: Array) -> Array:
        """Return dp/dt in Pa/s; all arrays of one shape."""
        trend = self.model_gradient.at_coordinates(self.model_coordinates(theta))(u, p, supply)
        return self.corrected_gradient(theta, self.correction_coefficients(theta, u), trend, u, p, supply)

    def model_coordinates(self, theta: Array) -> Array:
        """Return the trend's own coordinates."""
        return theta[: len(self.model_gradient.free)]

    def coordinate_shift(self, theta: Array) -> Array:
        """Return how far the trend's coordinates have moved from the model's."""
        return np.asarray(self.model_coordinates(theta) - self.model_gradient.start)

    def sensitivity(self, theta: Array, u: Array, p: Array, supply: Array) -> Array:
        """Return the derivative of the gradient to theta, shape ``u.shape + (size,)``."""
        z = self.model_coordinates(theta)
        r = 2 * self.pressure_ratio(u, p, supply) - 1
        bend = self.correction_factor(self.correction_coefficients(theta, u), u, p, supply)
        flow = self.model_gradient.at_coordinates(z)(u, p, supply) * bend
        powers = r[..., None] ** np.arange(SHARED_COEFFICIENTS)
        out = np.zeros((*u.shape, self.size))
        out[..., : z.size] = bend[..., None] * self.model_gradient.sensitivity(z, u, p, supply)
        for o, d in zip(self.offsets(), self.directions, strict=True):
            mine = np.sign(u) == d.sign
            own = d.node_weights(u[mine])[..., :, None] * powers[mine][..., None, :OWN_COEFFICIENTS]
            columns = [powers[mine], own.reshape(*own.shape[:-2], OWN_COEFFICIENTS * d.nodes.size)]
            out[mine, o : o + d.size] = flow[mine][..., None] * np.concatenate(columns, axis=-1)
        out[..., -LEAK_COEFFICIENTS:] = self.scale * self._relative(p)[..., None] ** np.arange(LEAK_COEFFICIENTS)
        return out

    def _relative(self, p: Array) -> Array:
        return np.asarray(np.minimum(np.maximum((p - self.ambient) / (self.supply - self.ambient), 0.0), 1.0))
