"""The map dp/dt(u, p) with its interval, the region that data cover, and the inverse of the map.

Source: thesis 7.4; docs/valve-identification.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.identify.valve.area_model import AreaModel
from pneucli.identify.valve.fit import JACOBIAN_MEMORY, Posterior
from pneucli.identify.valve.transients import Transients
from pneucli.quantities import Z95

INVERSE_COMMANDS = 801  # commands at which the inverse is prepared
COVERAGE_DISTANCE = 0.1  # of the largest command: the distance up to which a tested command covers others
MAX_LEVELS = 200  # of the command; more are rounded to this number


@dataclass(frozen=True)
class GradientMap:
    """dp/dt in Pa/s over ``u`` (V, shape ``(nu,)``) and ``p`` (Pa absolute, ``(np,)``), with its 95 % interval.

    ``gradient``, ``ci_low``, ``ci_high`` have shape ``(nu, np)``. ``covered`` marks points with data; elsewhere the
    fitted area model extrapolates.
    """

    u: Array
    p: Array
    gradient: Array
    ci_low: Array
    ci_high: Array
    covered: Mask


@dataclass(frozen=True)
class InverseMap:
    """The command ``u`` (V, ``(ng, np)``) for a gradient ``p_gradient`` (Pa/s, ``(ng,)``) at ``p`` (Pa, ``(np,)``).

    ``reachable`` is False where no tested command gives that gradient (``u`` is then the closest limit), and where no
    data cover that command at that pressure.
    """

    p_gradient: Array
    p: Array
    u: Array
    reachable: Mask


@dataclass(frozen=True)
class Coverage:
    """The recorded commands (V, ``(k,)``) and the range of pressures (Pa, ``(k,)``) of each."""

    commands: Array
    lowest: Array
    highest: Array
    area_model: AreaModel

    def __call__(self, u: Array, p: Array) -> Mask:
        """Return whether data cover commands ``u`` at pressures ``p``, arrays of one shape.

        They do where a command of the same sign within 10 % of the range saw that pressure, or one below and one above
        did. Where the valve is shut, any command covers the pressure, since the overlap lies between the tested
        commands.
        """
        saw = (self.lowest[:, None] <= p.ravel()) & (p.ravel() <= self.highest[:, None])
        level, flat = self.commands[:, None], u.ravel()
        same_sign = saw & (np.sign(level) == np.sign(flat))
        is_close = np.abs(level - flat) <= COVERAGE_DISTANCE * np.abs(self.commands).max()
        below, above = (same_sign & side for side in (level <= flat, level >= flat))
        between = below.any(axis=0) & above.any(axis=0)
        shut = self.area_model.model_gradient.valve(flat) == 0.0
        is_covered = (same_sign & is_close).any(axis=0) | between | (shut & saw.any(axis=0))
        return np.asarray(is_covered.reshape(u.shape))


def transient_coverage(area_model: AreaModel, data: Transients) -> Coverage:
    """Return the coverage of transients.

    Args:
        area_model: The area model.
        data: The transients.

    Returns:
        The coverage.

    """
    return sample_coverage(data.u[data.valid], data.p[data.valid], area_model)


def sample_coverage(u: Array, p: Array, area_model: AreaModel) -> Coverage:
    """Return the coverage of samples; commands that differ little count as one level.

    Args:
        u: Commands in V, shape (n,).
        p: Pressures in Pa, shape (n,).
        area_model: The area model.

    Returns:
        The coverage.

    """
    levels, which = np.unique(u, return_inverse=True)
    if levels.size > MAX_LEVELS:
        quantum = np.abs(u).max() / (MAX_LEVELS / 2)
        levels, which = np.unique(np.round(u / quantum), return_inverse=True)
        levels = quantum * levels
    lowest, highest = np.full(levels.size, np.inf), np.full(levels.size, -np.inf)
    np.minimum.at(lowest, which, p)
    np.maximum.at(highest, which, p)
    return Coverage(levels, lowest, highest, area_model)


def gradient_with_error(
    area_model: AreaModel, posterior: Posterior, u: Array, p: Array, supply: Array
) -> tuple[Array, Array]:
    """Evaluate dp/dt and its standard error.

    Args:
        area_model: The area model.
        posterior: Its fitted parameters.
        u: Commands in V from the null.
        p: Absolute pressures in Pa, of the same shape.
        supply: Supply pressures in Pa, of the same shape.

    Returns:
        Gradient and standard error in Pa/s, of the same shape.

    """
    variance, flat = np.empty(u.size), [a.ravel() for a in (u, p, supply)]
    rows_per_part = max(1, JACOBIAN_MEMORY // (8 * area_model.size))
    for part in (
        slice(first, first + rows_per_part) for first in range(0, u.size, rows_per_part)
    ):  # bounds the memory of the derivatives
        rows = area_model.sensitivity(posterior.theta, *(a[part] for a in flat))
        variance[part] = np.einsum("ni,ij,nj->n", rows, posterior.covariance, rows, optimize=True)
    return area_model.gradient(posterior.theta, u, p, supply), np.sqrt(np.maximum(variance, 0.0)).reshape(u.shape)


def gradient_map(area_model: AreaModel, posterior: Posterior, u: Array, p: Array, coverage: Coverage) -> GradientMap:
    """Evaluate the map at the supply pressure of the area model.

    Args:
        area_model: The area model.
        posterior: Its fitted parameters.
        u: Commands in V from the null, shape ``(nu,)``.
        p: Absolute pressures in Pa, shape ``(np,)``.
        coverage: The region that data cover.

    Returns:
        The map.

    References:
        Thesis 7.4, figures 7.16 to 7.26; thesis 4 of chapter 8: gradient of valve and chamber, and its inverse.
    """
    uu, pp = np.meshgrid(u, p, indexing="ij")
    value, error = gradient_with_error(area_model, posterior, uu, pp, np.full_like(uu, area_model.supply))
    return GradientMap(u, p, value, value - Z95 * error, value + Z95 * error, coverage(uu, pp))


def invert_gradient(
    area_model: AreaModel, posterior: Posterior, gradient: Array, p: Array, coverage: Coverage
) -> tuple[Array, Mask]:
    """Find the command for given gradients.

    The gradient rises with u except for noise in its corrections; its monotone envelope is inverted. A gradient that
    equals that of the shut valve, within its interval, gets the middle of the overlap. A switching valve has no
    commands in between: the closest gradient is chosen, and is reachable only within its interval.

    Args:
        area_model: The area model.
        posterior: Its fitted parameters.
        gradient: Requested gradients in Pa/s.
        p: Absolute pressures in Pa, of the same shape.
        coverage: The region that data cover.

    Returns:
        The commands in V from the null, and whether each gradient is reachable.

    """
    u, is_switching = area_model.command_grid(INVERSE_COMMANDS), area_model.model_gradient.valve.form == "switching"
    shut = u[area_model.model_gradient.valve(u) == 0.0]
    closed_command = 0.5 * (shut.min(initial=0.0) + shut.max(initial=0.0))
    command, is_reachable = np.empty(gradient.shape), np.empty(gradient.shape, dtype=bool)
    for pressure in np.unique(p):
        at_pressure = p == pressure
        values, errors = gradient_with_error(
            area_model, posterior, u, np.full(u.size, pressure), np.full(u.size, area_model.supply)
        )
        envelope = 0.5 * (np.maximum.accumulate(values) + np.minimum.accumulate(values[::-1])[::-1])
        requested, span = gradient[at_pressure], float(np.ptp(envelope))
        closed = int(np.argmin(np.abs(u - closed_command)))
        matches_closed = np.abs(requested - values[closed]) <= Z95 * errors[closed]
        if is_switching:
            nearest = np.argmin(np.abs(requested[:, None] - envelope), axis=1)
            command[at_pressure], distance = u[nearest], np.abs(requested - envelope[nearest])
            is_reachable[at_pressure] = distance <= Z95 * errors[nearest] + 1e-9 * span
            continue
        command[at_pressure] = np.where(matches_closed, closed_command, np.interp(requested, envelope, u))
        is_reachable[at_pressure] = (requested >= envelope[0] - 1e-9 * span) & (requested <= envelope[-1] + 1e-9 * span)
    return command, is_reachable & coverage(command, p)


def inverse_map(
    area_model: AreaModel, posterior: Posterior, p_gradient: Array, p: Array, coverage: Coverage
) -> InverseMap:
    """Evaluate the inverse on a grid.

    Args:
        area_model: The area model.
        posterior: Its fitted parameters.
        p_gradient: Gradients in Pa/s, shape ``(ng,)``.
        p: Absolute pressures in Pa, shape ``(np,)``.
        coverage: The region that data cover.

    Returns:
        The inverse.

    References:
        Thesis 7.4, figures 7.16 to 7.26; thesis 4 of chapter 8: gradient of valve and chamber, and its inverse.
    """
    gg, pp = np.meshgrid(p_gradient, p, indexing="ij")
    return InverseMap(p_gradient, p, *invert_gradient(area_model, posterior, gg, pp, coverage))
