"""The map dp/dt(u, p) with its interval, where data covered it, and its inverse."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.valve.area_model import AreaModel
from pneucli.identify.valve.fit import JACOBIAN_MEMORY, Posterior
from pneucli.identify.valve.transients import Transients

Array = NDArray[np.float64]

Z95 = 1.959964
INVERSE_COMMANDS = 801  # commands at which the inverse is prepared
COVERAGE_DISTANCE = 0.1  # of the largest command: so far a tested one speaks for others
MAX_LEVELS = 200


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


@dataclass(frozen=True)
class InverseMap:
    """The command ``u`` (V, shape ``(ng, np)``) that makes ``p_gradient`` (Pa/s, ``(ng,)``) at ``p`` (Pa, ``(np,)``).

    ``reachable`` is False where no tested command gives that gradient (``u`` is then the nearest limit), and where no
    recording covered that command at that pressure.
    """

    p_gradient: Array
    p: Array
    u: Array
    reachable: NDArray[np.bool_]


@dataclass(frozen=True)
class Coverage:
    """The commands that were recorded (V, ``(k,)``) and the pressures (Pa, ``(k,)``) that each went through."""

    commands: Array
    lowest: Array
    highest: Array
    area_model: AreaModel

    def __call__(self, u: Array, p: Array) -> NDArray[np.bool_]:
        """Return whether recordings tell of commands ``u`` at pressures ``p``, arrays of one shape.

        A command of the same sign within 10 % of the range saw that pressure, or one below and one above did. Where
        the valve is shut, any command will do: the overlap lies between those that were tested.
        """
        saw = (self.lowest[:, None] <= p.ravel()) & (p.ravel() <= self.highest[:, None])
        at, flat = self.commands[:, None], u.ravel()
        alike = saw & (np.sign(at) == np.sign(flat))
        near = np.abs(at - flat) <= COVERAGE_DISTANCE * np.abs(self.commands).max()
        below, above = (alike & side for side in (at <= flat, at >= flat))
        between = below.any(axis=0) & above.any(axis=0)
        shut = self.area_model.model_gradient.valve(flat) == 0.0
        told = (alike & near).any(axis=0) | between | (shut & saw.any(axis=0))
        return np.asarray(told.reshape(u.shape))


def transient_coverage(law: AreaModel, data: Transients) -> Coverage:
    """Return where the stretches went."""
    return sample_coverage(data.u[data.valid], data.p[data.valid], law)


def sample_coverage(u: Array, p: Array, law: AreaModel) -> Coverage:
    """Return where samples of ``u`` (V) and ``p`` (Pa), each (n,), were; commands nearly alike count as one."""
    levels, which = np.unique(u, return_inverse=True)
    if levels.size > MAX_LEVELS:
        quantum = np.abs(u).max() / (MAX_LEVELS / 2)
        levels, which = np.unique(np.round(u / quantum), return_inverse=True)
        levels = quantum * levels
    lowest, highest = np.full(levels.size, np.inf), np.full(levels.size, -np.inf)
    np.minimum.at(lowest, which, p)
    np.maximum.at(highest, which, p)
    return Coverage(levels, lowest, highest, law)


def gradient_with_error(law: AreaModel, fit: Posterior, u: Array, p: Array, supply: Array) -> tuple[Array, Array]:
    """Return dp/dt and its standard error (Pa/s) at points ``u``, ``p``, ``supply`` of one shape."""
    variance, flat = np.empty(u.size), [a.ravel() for a in (u, p, supply)]
    some = max(1, JACOBIAN_MEMORY // (8 * law.size))
    for part in (slice(first, first + some) for first in range(0, u.size, some)):  # derivatives fill the memory
        rows = law.sensitivity(fit.theta, *(a[part] for a in flat))
        variance[part] = np.einsum("ni,ij,nj->n", rows, fit.covariance, rows, optimize=True)
    return law.gradient(fit.theta, u, p, supply), np.sqrt(np.maximum(variance, 0.0)).reshape(u.shape)


def gradient_map(law: AreaModel, fit: Posterior, u: Array, p: Array, covers: Coverage) -> GradientMap:
    """Return the map at the law's supply pressure."""
    uu, pp = np.meshgrid(u, p, indexing="ij")
    value, error = gradient_with_error(law, fit, uu, pp, np.full_like(uu, law.supply))
    return GradientMap(u, p, value, value - Z95 * error, value + Z95 * error, covers(uu, pp))


def invert_gradient(
    law: AreaModel, fit: Posterior, gradient: Array, p: Array, covers: Coverage
) -> tuple[Array, NDArray[np.bool_]]:
    """Return u (V) and whether it is reachable for each ``gradient`` (Pa/s) at ``p`` (Pa), arrays of one shape.

    The law rises with u up to noise in its corrections; its monotone envelope is inverted. What the shut valve gives,
    as far as the map can tell, is answered by the middle of the commands at which it is shut. A switching valve has
    nothing between its commands: the nearest gradient is answered, which is reached within its interval alone.
    """
    u, switches = law.command_grid(INVERSE_COMMANDS), law.model_gradient.valve.form == "switching"
    shut = u[law.model_gradient.valve(u) == 0.0]
    middle = 0.5 * (shut.min(initial=0.0) + shut.max(initial=0.0))
    command, within = np.empty(gradient.shape), np.empty(gradient.shape, dtype=bool)
    for at in np.unique(p):
        mine = p == at
        values, errors = gradient_with_error(law, fit, u, np.full(u.size, at), np.full(u.size, law.supply))
        envelope = 0.5 * (np.maximum.accumulate(values) + np.minimum.accumulate(values[::-1])[::-1])
        asked, span = gradient[mine], float(np.ptp(envelope))
        closed = int(np.argmin(np.abs(u - middle)))
        held = np.abs(asked - values[closed]) <= Z95 * errors[closed]
        if switches:
            nearest = np.argmin(np.abs(asked[:, None] - envelope), axis=1)
            command[mine], off = u[nearest], np.abs(asked - envelope[nearest])
            within[mine] = off <= Z95 * errors[nearest] + 1e-9 * span
            continue
        command[mine] = np.where(held, middle, np.interp(asked, envelope, u))
        within[mine] = (asked >= envelope[0] - 1e-9 * span) & (asked <= envelope[-1] + 1e-9 * span)
    return command, within & covers(command, p)


def inverse_map(law: AreaModel, fit: Posterior, p_gradient: Array, p: Array, covers: Coverage) -> InverseMap:
    """Return the inverse on the grid ``p_gradient`` x ``p``."""
    gg, pp = np.meshgrid(p_gradient, p, indexing="ij")
    return InverseMap(p_gradient, p, *invert_gradient(law, fit, gg, pp, covers))
