"""The gradient of pressure that the transients determine: the model's own valve with smooth corrections.

.. math:: dp/dt = g(u, p) exp(h(u, r)) + l(p)

g is the quasi-static gradient of the fitted model (:mod:`pneucli.identify.valve.model_gradient`) and r the ratio of the
lower to the higher pressure across the valve. h is a polynomial in r shared by the commands of one sign, plus one of
low degree for each command, interpolated linearly in log |u|; l is a leak. Where h and l exceed their errors, the model
does not describe the valve. Source: thesis 7.4; docs/valve-identification.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array, Integers
from pneucli.caches import compiled
from pneucli.identify.valve.model_gradient import ModelGradient

Gradient = Callable[[Array, Array, Array], Array]

SHARED_COEFFICIENTS = 9  # of the correction that a direction shares
OWN_COEFFICIENTS = 3  # of the correction of one command
LEAK_COEFFICIENTS = 4  # of the leak
MAX_LOG_CORRECTION = 5.0  # of h: exp(5), more than a hundredfold flow, is no correction


@compiled(nogil=True, error_model="numpy")
def polynomial(x: float, coefficients: Array) -> float:
    """Evaluate sum c_k x^k by Horner's scheme.

    Args:
        x: Argument.
        coefficients: Coefficients from the lowest power up, shape (k,).

    Returns:
        The sum.

    >>> polynomial(2.0, np.array([1.0, 10.0, 100.0]))
    421.0

    """
    value = coefficients[-1]
    for k in range(coefficients.size - 2, -1, -1):
        value = value * x + coefficients[k]
    return float(value)


@compiled(nogil=True, error_model="numpy")
def _correction(coefficients: Array, opposite: float, p: float) -> float:
    """Return exp(h) from the coefficients of h, bounded; a number that is none stays."""
    h = polynomial(2.0 * (p / opposite if p < opposite else opposite / p) - 1.0, coefficients)
    if h > MAX_LOG_CORRECTION:
        h = MAX_LOG_CORRECTION
    elif h < -MAX_LOG_CORRECTION:
        h = -MAX_LOG_CORRECTION
    return math.exp(h)


@compiled(nogil=True, error_model="numpy")
def _write_correction(coefficients: Array, opposite: Array, p: Array, out: Array) -> None:
    """Write exp(h) from the coefficients of h (n, k)."""
    for i in range(p.size):
        out[i] = _correction(coefficients[i], opposite[i], p[i])


@compiled(nogil=True, error_model="numpy")
def _corrected_gradient(
    values: Array, coefficients: Array, opposite: Array, p: Array, leak: Array, limits: tuple[float, float, float]
) -> Array:
    """Return the corrected gradients of the model (n,); ``limits``: ambient and supply pressure, scale of the leak."""
    ambient, supply, scale = limits
    out = np.empty(p.size)
    for i in range(p.size):
        x = (p[i] - ambient) / (supply - ambient)
        if x < 0.0:
            x = 0.0
        elif x > 1.0:
            x = 1.0
        out[i] = values[i] * _correction(coefficients[i], opposite[i], p[i]) + scale * polynomial(x, leak)
    return out


def _flat(values: Array) -> Array:
    return np.ascontiguousarray(values, dtype=np.float64).reshape(-1)


@dataclass(frozen=True)
class Direction:
    """The held commands of one sign: ``nodes`` are |u| in V, increasing; ``sign`` +1 fills, -1 vents."""

    sign: int
    nodes: Array

    @property
    def size(self) -> int:
        """Number of coefficients: the shared correction and one for each node."""
        return SHARED_COEFFICIENTS + OWN_COEFFICIENTS * self.nodes.size

    def node_weights(self, u: Array) -> Array:
        """Return the weight of each node at u, shape ``u.shape + (nodes,)``: linear in log |u|, constant outside."""
        position = np.log(np.clip(self.sign * u, self.nodes[0], self.nodes[-1]))
        return np.stack([np.interp(position, np.log(self.nodes), unit) for unit in np.eye(self.nodes.size)], axis=-1)


@dataclass(frozen=True)
class AreaModel:
    """The gradient for parameters ``theta``: coordinates of the model, corrections of each direction, leak.

    Pressures are absolute, in Pa; ``scale`` is the gradient (Pa/s) of a leak coefficient of 1.
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
        """Return the index of each direction's first parameter."""
        return [
            len(self.model_gradient.free) + sum(d.size for d in self.directions[:k])
            for k in range(len(self.directions))
        ]

    def command_grid(self, count: int) -> Array:
        """Return ``count`` commands (V) over the tested range, or all commands of a switching valve."""
        largest = {d.sign: float(d.nodes[-1]) for d in self.directions}
        ends = -largest.get(-1, 0.0), largest.get(1, 0.0)
        return np.unique([*ends, 0.0]) if self.model_gradient.valve.form == "switching" else np.linspace(*ends, count)

    def prior_groups(self) -> dict[str, Integers]:
        """Return the indices of corrections with a common prior width: ``shared``, ``own`` and ``leak``."""
        offsets = list(zip(self.offsets(), self.directions, strict=True))
        shared = [np.arange(offset, offset + SHARED_COEFFICIENTS) for offset, _ in offsets]
        own_coefficients = [np.arange(offset + SHARED_COEFFICIENTS, offset + d.size) for offset, d in offsets]
        leak = np.arange(self.size - LEAK_COEFFICIENTS, self.size)
        return {"shared": np.concatenate(shared), "own": np.concatenate(own_coefficients), "leak": leak}

    def initial_theta(self) -> Array:
        """Return the parameters (k,) of the model without corrections."""
        return np.concatenate([self.model_gradient.start, np.zeros(self.size - len(self.model_gradient.free))])

    def correction_coefficients(self, theta: Array, u: Array) -> Array:
        """Return the coefficients of h over 2 r - 1, shape ``(*u.shape, SHARED_COEFFICIENTS)``."""
        coefficients = np.zeros((*u.shape, SHARED_COEFFICIENTS))
        for offset, d in zip(self.offsets(), self.directions, strict=True):
            in_direction = np.sign(u) == d.sign
            own_coefficients = theta[offset + SHARED_COEFFICIENTS : offset + d.size].reshape(-1, OWN_COEFFICIENTS)
            of_direction = np.repeat(
                theta[None, offset : offset + SHARED_COEFFICIENTS], np.count_nonzero(in_direction), axis=0
            )
            of_direction[:, :OWN_COEFFICIENTS] += d.node_weights(u[in_direction]) @ own_coefficients
            coefficients[in_direction] = of_direction
        return coefficients

    def opposite_pressure(self, u: Array, supply: Array) -> Array:
        """Return the pressure in Pa on the other side of the valve."""
        return np.asarray(np.where(u > 0, supply, self.ambient))

    def pressure_ratio(self, u: Array, p: Array, supply: Array) -> Array:
        """Return the ratio r of the lower to the higher pressure across the valve."""
        opposite = self.opposite_pressure(u, supply)
        return np.minimum(p, opposite) / np.maximum(p, opposite)

    def correction_of_gradient(self, theta: Array) -> Callable[[Array, Array, Array, Array], Array]:
        """Return what corrects the gradients of the model.

        Its arguments are the gradients (n,) in Pa/s, the coefficients of h (n, k), and the pressures (n,) in Pa on the
        other side of the valve and in the vessel.
        """
        leak, limits = np.ascontiguousarray(theta[-LEAK_COEFFICIENTS:]), (self.ambient, self.supply, self.scale)
        return lambda values, coefficients, opposite, p: np.asarray(
            _corrected_gradient(values, coefficients, opposite, p, leak, limits)
        )

    def correction_factor(self, coefficients: Array, p: Array, opposite: Array) -> Array:
        """Return exp(h), bounded, since an intermediate step of the fit may overflow; coefficients last, as above."""
        out = np.empty(p.shape)
        rows = coefficients.reshape(p.size, -1)
        _write_correction(rows, _flat(opposite), _flat(p), out.reshape(-1))
        return out

    def gradient(self, theta: Array, u: Array, p: Array, supply: Array) -> Array:
        """Return dp/dt in Pa/s; all arrays have one shape."""
        model_values = self.model_gradient.at_coordinates(self.model_coordinates(theta))(u, p, supply)
        rows = self.correction_coefficients(theta, u).reshape(u.size, -1)
        opposite = self.opposite_pressure(u, supply)
        correct = self.correction_of_gradient(theta)
        return correct(_flat(model_values), rows, _flat(opposite), _flat(p)).reshape(u.shape)

    def model_coordinates(self, theta: Array) -> Array:
        """Return the coordinates of the model's parameters."""
        return theta[: len(self.model_gradient.free)]

    def coordinate_shift(self, theta: Array) -> Array:
        """Return the change of the model's coordinates from their fitted values."""
        return np.asarray(self.model_coordinates(theta) - self.model_gradient.start)

    def sensitivity(self, theta: Array, u: Array, p: Array, supply: Array) -> Array:
        """Return the derivative of the gradient by theta, shape ``u.shape + (size,)``."""
        z = self.model_coordinates(theta)
        r = 2 * self.pressure_ratio(u, p, supply) - 1
        opposite = self.opposite_pressure(u, supply)
        correction = self.correction_factor(self.correction_coefficients(theta, u), p, opposite)
        flow = self.model_gradient.at_coordinates(z)(u, p, supply) * correction
        powers = r[..., None] ** np.arange(SHARED_COEFFICIENTS)
        out = np.zeros((*u.shape, self.size))
        out[..., : z.size] = correction[..., None] * self.model_gradient.sensitivity(z, u, p, supply)
        for offset, d in zip(self.offsets(), self.directions, strict=True):
            in_direction = np.sign(u) == d.sign
            own_coefficients = (
                d.node_weights(u[in_direction])[..., :, None] * powers[in_direction][..., None, :OWN_COEFFICIENTS]
            )
            columns = [
                powers[in_direction],
                own_coefficients.reshape(*own_coefficients.shape[:-2], OWN_COEFFICIENTS * d.nodes.size),
            ]
            out[in_direction, offset : offset + d.size] = flow[in_direction][..., None] * np.concatenate(
                columns, axis=-1
            )
        out[..., -LEAK_COEFFICIENTS:] = self.scale * self._relative(p)[..., None] ** np.arange(LEAK_COEFFICIENTS)
        return out

    def _relative(self, p: Array) -> Array:
        return np.asarray(np.minimum(np.maximum((p - self.ambient) / (self.supply - self.ambient), 0.0), 1.0))
