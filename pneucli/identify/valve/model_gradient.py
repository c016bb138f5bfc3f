"""The valve map dp/dt(u, p) of a fitted model with its interval, the region that data cover, and its inverse.

The map holds the gradient of pressure that the model makes in a fixed volume at held commands.

Source: thesis 7.4; docs/valve-identification.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array, Mask
from pneucli.errors import InputError
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.physics.ports import PORTS
from pneucli.quantities import Z95
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model, ValveForm, parameter_value, with_parameters
from pneucli.simulate.run import base_vector, kernel_for, simulate

DIFFERENCE_STEP = 1e-3  # of a coordinate, for finite differences
REPEATABILITY = 1e-3  # of the gradient: the standard deviation with which the best valves come back to an opening


@dataclass(frozen=True)
class ModelGradient:
    """The quasi-static gradient of a fitted model over the commands and pressures of a map, and its error.

    Attributes:
        model: The fitted model, with the volume of the map and a null of 0 V.
        reference_test: A test of the valve.
        free: The fitted parameters.
        covariance: Their covariance in the coordinates of the fit, shape (k, k).
        commands: Lowest and highest command in V; 0 where a direction was not tested.
        ambient: Ambient pressure in Pa.
        supply: Supply pressure in Pa.
        relative_misfit: Standard deviation of the model from measured gradients, as a share of the gradient.
        shut_misfit: That of the flow through the shut valve, in Pa/s.
    """

    model: Model
    reference_test: Experiment
    free: tuple[FreeParameter, ...]
    covariance: Array
    commands: tuple[float, float]
    ambient: float
    supply: float
    relative_misfit: float = 0.0
    shut_misfit: float = 0.0

    @property
    def valve(self) -> ValveForm:
        """The paths that fill and vent the volume."""
        return self.model.valve_of_chamber(self.reference_test.recording.chamber)

    def __call__(self, u: Array, p: Array, supply: Array | float | None = None) -> Array:
        """Return the gradient in Pa/s at commands u (V), pressures p and supply (Pa), of the shape of u."""
        return self._fitted(u, p, np.broadcast_to(self.supply if supply is None else supply, u.shape))

    def fit_error(self, u: Array, p: Array) -> Array:
        """Return the standard error in Pa/s from the covariance of the fit, of the shape of u."""
        supply = np.full(u.shape, self.supply)
        rows = np.array([above(u, p, supply) - below(u, p, supply) for above, below in self._stepped])
        rows = rows.reshape(len(self.free), u.size) / (2 * DIFFERENCE_STEP)
        variance = np.einsum("in,ij,jn->n", rows, self.covariance, rows, optimize=True)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)).reshape(u.shape))

    def standard_error(self, u: Array, p: Array) -> Array:
        """Return the standard error in Pa/s: of the fit, of areas between knots, of the model's form."""
        relative = np.sqrt(REPEATABILITY**2 + self.valve.interpolation_uncertainty**2 + self.relative_misfit**2)
        return np.asarray(np.sqrt(self.fit_error(u, p) ** 2 + (relative * self(u, p)) ** 2 + self.shut_misfit**2))

    def command_grid(self, count: int) -> Array:
        """Return tested commands in V, of about this number; both ends and 0 of a switching valve."""
        low, high = self.commands
        return np.unique([low, 0.0, high]) if self.valve.form == "switching" else np.linspace(low, high, count)

    @cached_property
    def _fitted(self) -> QuasiStaticGradient:
        return QuasiStaticGradient(self.model, self.reference_test)

    @cached_property
    def _stepped(self) -> list[list[QuasiStaticGradient]]:
        """The gradients a step above and a step below the fit, for each parameter."""
        out = []
        for f in self.free:
            z = f.to_coordinate(parameter_value(self.model, f.name))
            values = [f.from_coordinate(z + step) for step in (DIFFERENCE_STEP, -DIFFERENCE_STEP)]
            models = [with_parameters(self.model, {f.name: value}) for value in values]
            out.append([QuasiStaticGradient(model, self.reference_test) for model in models])
        return out


def model_gradient_of(fitted: Fit, tests: Sequence[Experiment]) -> ModelGradient:
    """Build the gradient of a fitted model over the commands of valve tests.

    Args:
        fitted: The fit of the model, with a null of 0 V.
        tests: The valve tests.

    Returns:
        The gradient.

    Raises:
        InputError: The valve of the model never opens, or no command differs from zero.

    """
    model, rig = fitted.model, fitted.model.rig
    if not model.valve_of_chamber(tests[0].recording.chamber).commands:
        fault = "at no command does air flow the way it should, so the model's valve never opens"
        mend = "turn the sign of u, or see what pneucli ingest finds implausible"
        raise InputError("valve tests", fault, "u above the null command fills, u below it vents", mend, code="E065")
    u, p, supply = np.concatenate([test.inputs[:, (at.IN_U, at.IN_P1, at.IN_SUPPLY)] for test in tests]).T
    if not u.any():
        raise InputError("recordings", "u is zero throughout", "commands other than zero", code="E062")
    highest = rig.supply_pressure or float(np.median(supply))
    if not highest > rig.ambient_pressure:
        highest = float(p.max())  # no supply matters where a vessel is only vented
    commands = min(float(u.min()), 0.0), max(float(u.max()), 0.0)
    covariance = _limited_covariance(fitted.covariance, fitted.free)
    return ModelGradient(model, tests[0], fitted.free, covariance, commands, rig.ambient_pressure, highest)


def _limited_covariance(covariance: Array, free: Sequence[FreeParameter]) -> Array:
    """Return a covariance (k, k) with no variance above that of a uniform distribution between the bounds."""
    widest = np.array([f.to_coordinate(f.upper) - f.to_coordinate(f.lower) for f in free]) / np.sqrt(12.0)
    shrinkage = np.minimum(1.0, widest / np.maximum(np.sqrt(np.diag(covariance)), 1e-300))
    return np.asarray(covariance * np.outer(shrinkage, shrinkage))


def memory_gradient(model: Model, test: Experiment) -> Array:
    """Compute the contribution of effects with memory to dp/dt in a test.

    Heat transfer, a spool that lags, a supply that droops: the simulated gradient minus the quasi-static one.

    Args:
        model: The model.
        test: The valve test.

    Returns:
        The contribution in Pa/s, shape (n,); 0 for a model without memory.

    """
    if not any(PORTS[port].has_memory for effect in model.effects for port in effect.ports):
        return np.zeros(test.time.size)
    quasi_static, p = QuasiStaticGradient(model, test), simulate(model, test)["p1"]
    u, supply, steps = test.inputs[:-1, at.IN_U], test.inputs[:-1, at.IN_SUPPLY], np.diff(test.time)
    rate = np.diff(p) / steps - 0.5 * (quasi_static(u, p[:-1], supply) + quasi_static(u, p[1:], supply))
    last = np.arange(steps.size)
    last[test.restarts[test.restarts > 0] - 1] -= 1  # the jump at a restart is no gradient
    rate = rate[np.maximum(last, 0)]
    return np.append(rate, rate[-1])


@dataclass(frozen=True)
class QuasiStaticGradient:
    """The pressure gradient of a model at held commands, without memory, for the vessel of a valve test."""

    model: Model
    experiment: Experiment

    def __call__(self, u: Array, p: Array, supply: Array) -> Array:
        """Return the gradient as the sensor reads it.

        Args:
            u: Command in V from the null command.
            p: Pressure in Pa.
            supply: Supply pressure in Pa; all three of one shape.

        Returns:
            Gradient in Pa/s, of the same shape.

        References:
            Thesis 7.4.
        """
        out = np.empty(u.size)
        self._gradient(u.ravel(), p.ravel(), supply.ravel(), *self._fixed, out)
        return out.reshape(u.shape)

    @cached_property
    def _fixed(self) -> tuple[Array, Array, NDArray[np.uint8], float, Array]:
        kernel = kernel_for(self.model.effects)
        active = kernel.effect_switches(self.experiment.active_effects(self.model.effects))
        base, th = base_vector(self.model, self.experiment), kernel.effect_vector(self.model.effect_values())
        valve = self.model.valve_of_chamber(self.experiment.recording.chamber)
        largest = max(float(self.experiment.flags[at.U_MAX]), *map(abs, valve.commands))
        return base, th, active, largest, valve.table(largest)

    @cached_property
    def _gradient(self):  # type: ignore[no-untyped-def]
        return kernel_for(self.model.effects).functions.run_gradient


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
