"""The map dp/dt(u, p) of a fitted model with its interval, the region that data cover, and the inverse of the map.

Source: thesis 7.4; docs/valve-identification.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.identify.valve.model_gradient import ModelGradient
from pneucli.quantities import Z95
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment

INVERSE_COMMANDS = 801  # commands at which the inverse is prepared
COVERAGE_DISTANCE = 0.1  # of the largest command: the distance up to which a tested command covers others
MAX_LEVELS = 200  # of the command; more are rounded to this number


@dataclass(frozen=True)
class GradientMap:
    """dp/dt in Pa/s over ``u`` (V, shape ``(nu,)``) and ``p`` (Pa absolute, ``(np,)``), with its 95 % interval.

    ``gradient``, ``ci_low``, ``ci_high`` have shape ``(nu, np)``. ``covered`` marks points with data; elsewhere the
    model extrapolates.
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
    """The recorded commands (V, ``(k,)``) and the range of pressures (Pa, ``(k,)``) of each; the areas of the valve."""

    commands: Array
    lowest: Array
    highest: Array
    valve: Callable[[Array], Array]

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
        is_covered = (same_sign & is_close).any(axis=0) | between | ((self.valve(flat) == 0.0) & saw.any(axis=0))
        return np.asarray(is_covered.reshape(u.shape))


def coverage_of(tests: Sequence[Experiment], valve: Callable[[Array], Array]) -> Coverage:
    """Return the region that valve tests cover; commands that differ little count as one level.

    Args:
        tests: The valve tests, with commands that count from the null.
        valve: The area of the valve at commands in V.

    Returns:
        The coverage.

    """
    u, p = np.concatenate([test.inputs[:, (at.IN_U, at.IN_P1)] for test in tests]).T
    levels, which = np.unique(u, return_inverse=True)
    if levels.size > MAX_LEVELS:
        quantum = np.abs(u).max() / (MAX_LEVELS / 2)
        levels, which = np.unique(np.round(u / quantum), return_inverse=True)
        levels = quantum * levels
    lowest, highest = np.full(levels.size, np.inf), np.full(levels.size, -np.inf)
    np.minimum.at(lowest, which, p)
    np.maximum.at(highest, which, p)
    return Coverage(levels, lowest, highest, valve)


def gradient_map(model: ModelGradient, u: Array, p: Array, coverage: Coverage) -> GradientMap:
    """Evaluate the map.

    Args:
        model: The gradient of the fitted model.
        u: Commands in V from the null, shape ``(nu,)``.
        p: Absolute pressures in Pa, shape ``(np,)``.
        coverage: The region that data cover.

    Returns:
        The map at the supply pressure of the model.

    References:
        Thesis 7.4, figures 7.16 to 7.26; thesis 4 of chapter 8: gradient of valve and chamber, and its inverse.
    """
    uu, pp = np.meshgrid(u, p, indexing="ij")
    value, half = model(uu, pp), Z95 * model.standard_error(uu, pp)
    return GradientMap(u, p, value, value - half, value + half, coverage(uu, pp))


def invert_gradient(model: ModelGradient, gradient: Array, p: Array, coverage: Coverage) -> tuple[Array, Mask]:
    """Find the command for given gradients.

    The monotone envelope of the gradient over u is inverted. A gradient that equals that of the shut valve, within its
    interval, gets the middle of the overlap. A switching valve has no commands in between: the closest gradient is
    chosen, and is reachable only within its interval.

    Args:
        model: The gradient of the fitted model.
        gradient: Requested gradients in Pa/s.
        p: Absolute pressures in Pa, of the same shape.
        coverage: The region that data cover.

    Returns:
        The commands in V from the null, and whether each gradient is reachable.

    """
    u, is_switching = model.command_grid(INVERSE_COMMANDS), model.valve.form == "switching"
    shut = u[model.valve(u) == 0.0]
    closed_command = 0.5 * (shut.min(initial=0.0) + shut.max(initial=0.0))
    closed = int(np.argmin(np.abs(u - closed_command)))
    marks = np.arange(u.size) if is_switching else np.array([closed])  # the commands whose interval counts
    command, is_reachable = np.empty(gradient.shape), np.empty(gradient.shape, dtype=bool)
    pressures, which = np.unique(p, return_inverse=True)
    errors = Z95 * model.standard_error(*np.meshgrid(u[marks], pressures, indexing="ij"))
    for k, pressure in enumerate(pressures):
        at_pressure = which.reshape(p.shape) == k
        values = model(u, np.full(u.size, pressure))
        envelope = 0.5 * (np.maximum.accumulate(values) + np.minimum.accumulate(values[::-1])[::-1])
        requested, slack = gradient[at_pressure], 1e-9 * float(np.ptp(envelope))
        if is_switching:
            nearest = np.argmin(np.abs(requested[:, None] - envelope), axis=1)
            command[at_pressure], distance = u[nearest], np.abs(requested - envelope[nearest])
            is_reachable[at_pressure] = distance <= errors[nearest, k] + slack
            continue
        matches_closed = np.abs(requested - values[closed]) <= errors[0, k]
        command[at_pressure] = np.where(matches_closed, closed_command, np.interp(requested, envelope, u))
        is_reachable[at_pressure] = (requested >= envelope[0] - slack) & (requested <= envelope[-1] + slack)
    return command, is_reachable & coverage(command, p)


def inverse_map(model: ModelGradient, p_gradient: Array, p: Array, coverage: Coverage) -> InverseMap:
    """Evaluate the inverse on a grid.

    Args:
        model: The gradient of the fitted model.
        p_gradient: Gradients in Pa/s, shape ``(ng,)``.
        p: Absolute pressures in Pa, shape ``(np,)``.
        coverage: The region that data cover.

    Returns:
        The inverse.

    References:
        Thesis 7.4, figures 7.16 to 7.26; thesis 4 of chapter 8: gradient of valve and chamber, and its inverse.
    """
    gg, pp = np.meshgrid(p_gradient, p, indexing="ij")
    return InverseMap(p_gradient, p, *invert_gradient(model, gg, pp, coverage))
