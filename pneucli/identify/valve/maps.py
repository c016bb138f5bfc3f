"""The map dp/dt(u, p) with its interval, its inverse, and what both become on another volume."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.valve.fit import Fit
from pneucli.identify.valve.law import Law

Array = NDArray[np.float64]

Z95 = 1.959964
FINE = 801  # commands at which the inverse is prepared


@dataclass(frozen=True)
class GradientMap:
    """dp/dt in Pa/s over ``u`` (V, shape ``(nu,)``) and ``p`` (Pa absolute, ``(np,)``), with its 95 % interval.

    ``gradient``, ``ci_low``, ``ci_high`` have shape ``(nu, np)``. ``covered``: a recording was there; elsewhere
    the fitted law continues the map.
    """

    u: Array
    p: Array
    gradient: Array
    ci_low: Array
    ci_high: Array
    covered: NDArray[np.bool_]

    def scaled(self, factor: float) -> GradientMap:
        """Return the map with every gradient times ``factor`` (old volume over new, thesis 2.22)."""
        low, high = self.ci_low * factor, self.ci_high * factor
        return replace(self, gradient=self.gradient * factor, ci_low=low, ci_high=high)


@dataclass(frozen=True)
class InverseMap:
    """The command ``u`` (V, shape ``(ng, np)``) that makes ``p_gradient`` (Pa/s, ``(ng,)``) at ``p`` (Pa, ``(np,)``).

    Where no tested command gives that gradient, ``reachable`` is False and ``u`` the nearest limit.
    """

    p_gradient: Array
    p: Array
    u: Array
    reachable: NDArray[np.bool_]

    def scaled(self, factor: float) -> InverseMap:
        """Return the inverse for gradients times ``factor``: the same commands."""
        return replace(self, p_gradient=self.p_gradient * factor)


def gradient_with_error(law: Law, fit: Fit, u: Array, p: Array, supply: Array) -> tuple[Array, Array]:
    """Return dp/dt and its standard error (Pa/s) at points ``u``, ``p``, ``supply`` of one shape."""
    rows = law.sensitivity(fit.theta, u, p, supply)
    variance = np.einsum("...i,ij,...j->...", rows, fit.covariance, rows)
    return law.gradient(fit.theta, u, p, supply), np.sqrt(np.maximum(variance, 0.0))


def gradient_map(law: Law, fit: Fit, u: Array, p: Array, covered: NDArray[np.bool_]) -> GradientMap:
    """Return the map at the law's supply pressure."""
    uu, pp = np.meshgrid(u, p, indexing="ij")
    value, error = gradient_with_error(law, fit, uu, pp, np.full_like(uu, law.supply))
    return GradientMap(u, p, value, value - Z95 * error, value + Z95 * error, covered)


def commands_for(law: Law, theta: Array, gradient: Array, p: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return u (V) and whether it is reachable for each ``gradient`` (Pa/s) at ``p`` (Pa), arrays of one shape.

    The law rises with u up to noise in its corrections; its monotone envelope is inverted. Zero flow is answered by
    the middle of the commands that give none.
    """
    top = {d.sign: d.nodes[-1] for d in law.directions}
    u = np.linspace(-top.get(-1, 0.0), top.get(1, 0.0), FINE)
    command, reachable = np.empty(gradient.shape), np.empty(gradient.shape, dtype=bool)
    for at in np.unique(p):
        mine = p == at
        values = law.gradient(theta, u, np.full(FINE, at), np.full(FINE, law.supply))
        envelope = 0.5 * (np.maximum.accumulate(values) + np.minimum.accumulate(values[::-1])[::-1])
        asked, span = gradient[mine], float(np.ptp(envelope))
        left, right = (np.searchsorted(envelope, asked, side) for side in ("left", "right"))
        flat = right > left
        middle = 0.5 * (u[np.minimum(left, FINE - 1)] + u[np.clip(right - 1, 0, FINE - 1)])
        command[mine] = np.where(flat, middle, np.interp(asked, envelope, u))
        reachable[mine] = (asked >= envelope[0] - 1e-9 * span) & (asked <= envelope[-1] + 1e-9 * span)
    return command, reachable


def inverse_map(law: Law, theta: Array, p_gradient: Array, p: Array) -> InverseMap:
    """Return the inverse on the grid ``p_gradient`` x ``p``."""
    gg, pp = np.meshgrid(p_gradient, p, indexing="ij")
    return InverseMap(p_gradient, p, *commands_for(law, theta, gg, pp))
