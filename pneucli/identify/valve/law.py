"""The pressure gradient of a vessel behind a proportional valve, as a smooth function that data can bend.

dp/dt = kappa R T / V  A(u) exp(h(u, r)) p_u sqrt(2 / (R T)) Psi'(r) + l(p)

Per direction A(u) = A_U ((|u| - overlap) / (U - overlap))^exponent, U the largest command tested. Psi' is the flow
function of the base model (thesis 2.42, 2.46), r the ratio of downstream to upstream pressure. The correction h is a
polynomial in r, one shared by the commands of a direction and one per tested command, linear in log |u| between
them; l is a gradient that flows at every command. With h = l = 0 this is the base model; with both it follows what
was measured, whatever the flow function.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.physics.gas import CRITICAL_RATIO, PSI_MAX

Array = NDArray[np.float64]

SHARED, OWN, LEAK = 9, 3, 4  # coefficients of the shared and a command's own correction, and of l
LAMINAR = 0.002  # below this 1 - r the flow is linear in it: the root's infinite slope has no physics
EDGE = 5e-4  # of the largest command: half width over which the area leaves zero


def flow_function(r: Array) -> Array:
    """Return Psi'(r) (thesis 2.42, 2.43), linear to zero over the last ``LAMINAR`` before r = 1."""
    s = (np.minimum(np.maximum(r, CRITICAL_RATIO), 1 - LAMINAR) - CRITICAL_RATIO) / (1 - CRITICAL_RATIO)
    return np.asarray(PSI_MAX * np.sqrt(1 - s * s) * np.minimum(1.0, (1 - r) / LAMINAR))


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
        """Number of parameters: log area, overlap, exponent, shared shape, own shapes."""
        return 3 + SHARED + OWN * self.nodes.size

    def opening(self, u: Array, overlap: float) -> Array:
        """Return |u| - overlap in V, a smooth positive floor below it."""
        d, edge = self.sign * u - overlap, EDGE * self.nodes[-1]
        return np.asarray(0.5 * (d + np.sqrt(d * d + edge * edge)))

    def weights(self, u: Array) -> Array:
        """Return the share of each node at u, shape ``u.shape + (nodes,)``: hats in log |u|, constant outside."""
        position = np.log(np.clip(self.sign * u, self.nodes[0], self.nodes[-1]))
        return np.stack([np.interp(position, np.log(self.nodes), e) for e in np.eye(self.nodes.size)], axis=-1)


@dataclass(frozen=True)
class Law:
    """The gradient for parameters ``theta``: those of each direction in turn, then ``LEAK`` coefficients of l.

    ``gain`` = kappa R T sqrt(2 / (R T)) / V in m/(s m^3) (V = 1 where the volume is unknown: areas are then areas
    per volume); pressures absolute in Pa; ``scale`` is the gradient (Pa/s) that a leak coefficient of 1 stands for.
    """

    directions: tuple[Direction, ...]
    gain: float
    ambient: float
    supply: float
    scale: float

    @property
    def size(self) -> int:
        """Number of parameters."""
        return sum(d.size for d in self.directions) + LEAK

    def offsets(self) -> list[int]:
        """Return where each direction's parameters begin."""
        return [sum(d.size for d in self.directions[:k]) for k in range(len(self.directions))]

    def groups(self) -> dict[str, NDArray[np.int64]]:
        """Return the indices of the corrections that share one prior width: ``shared``, ``own`` and ``leak``."""
        starts = list(zip(self.offsets(), self.directions, strict=True))
        shared = [np.arange(o + 3, o + 3 + SHARED) for o, _ in starts]
        own = [np.arange(o + 3 + SHARED, o + d.size) for o, d in starts]
        leak = np.arange(self.size - LEAK, self.size)
        return {"shared": np.concatenate(shared), "own": np.concatenate(own), "leak": leak}

    def factors(self, theta: Array, u: Array) -> tuple[Array, Array]:
        """Return what depends on u alone: log area (-inf where shut) and shape coefficients ``(SHARED, *u.shape)``."""
        log_area, shape = np.full(u.shape, -np.inf), np.zeros((SHARED, *u.shape))
        for o, d in zip(self.offsets(), self.directions, strict=True):
            mine = np.sign(u) == d.sign
            a, overlap, exponent = theta[o : o + 3]
            opening = d.opening(u[mine], overlap) / (d.nodes[-1] - overlap)
            log_area[mine] = a + exponent * np.log(opening)
            own = theta[o + 3 + SHARED : o + d.size].reshape(-1, OWN)
            shape[:, mine] = theta[o + 3 : o + 3 + SHARED, None]
            shape[:OWN, mine] += (d.weights(u[mine]) @ own).T
        return log_area, shape

    def ratio(self, u: Array, p: Array, supply: Array) -> tuple[Array, Array]:
        """Return the upstream pressure (Pa, negative where flow leaves the vessel) and the pressure ratio r."""
        other = np.where(u > 0, supply, self.ambient)
        upstream = np.maximum(p, other)
        return np.where(other >= p, upstream, -upstream), np.minimum(p, other) / upstream

    def flow(self, log_area: Array, shape: Array, u: Array, p: Array, supply: Array) -> Array:
        """Return the gradient that flow through the valve makes (Pa/s)."""
        signed, r = self.ratio(u, p, supply)
        correction = polynomial(2 * r - 1, shape)
        return np.asarray(self.gain * signed * flow_function(r) * np.exp(log_area + correction))

    def leak(self, theta: Array, p: Array) -> Array:
        """Return l(p) in Pa/s, a cubic in p, constant outside ambient to supply."""
        return np.asarray(self.scale * polynomial(self._relative(p), theta[-LEAK:]))

    def gradient(self, theta: Array, u: Array, p: Array, supply: Array) -> Array:
        """Return dp/dt in Pa/s; all arrays of one shape."""
        return self.flow(*self.factors(theta, u), u, p, supply) + self.leak(theta, p)

    def sensitivity(self, theta: Array, u: Array, p: Array, supply: Array) -> Array:
        """Return the derivative of the gradient to theta, shape ``u.shape + (size,)``."""
        flow = self.flow(*self.factors(theta, u), u, p, supply)
        r = 2 * self.ratio(u, p, supply)[1] - 1
        powers = r[..., None] ** np.arange(SHARED)
        out = np.zeros((*u.shape, self.size))
        for o, d in zip(self.offsets(), self.directions, strict=True):
            mine = np.sign(u) == d.sign
            overlap, exponent = theta[o + 1], theta[o + 2]
            opening, full = d.opening(u[mine], overlap), d.nodes[-1] - overlap
            slope = exponent * (1 / full - 1 / np.hypot(d.sign * u[mine] - overlap, EDGE * d.nodes[-1]))
            own = d.weights(u[mine])[..., :, None] * powers[mine][..., None, :OWN]
            columns = [np.ones_like(opening)[..., None], slope[..., None], np.log(opening / full)[..., None]]
            columns += [powers[mine], own.reshape(*opening.shape, -1)]
            out[mine, o : o + d.size] = flow[mine][..., None] * np.concatenate(columns, axis=-1)
        out[..., -LEAK:] = self.scale * self._relative(p)[..., None] ** np.arange(LEAK)
        return out

    def _relative(self, p: Array) -> Array:
        return np.asarray(np.minimum(np.maximum((p - self.ambient) / (self.supply - self.ambient), 0.0), 1.0))
