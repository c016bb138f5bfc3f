"""The quasi-static gradient of the fitted model, and its sensitivity to the model's parameters.

Source: g and m of docs/valve-identification.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.physics.ports import PORTS
from pneucli.simulate import layout as at
from pneucli.simulate.derivatives import Directions
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model, ValveForm, with_parameters
from pneucli.simulate.run import base_vector, kernel_for, simulate

NO_SHAPES = np.zeros((0, 0))
DIFFERENCE_STEP = 1e-3  # of a coordinate, for finite differences
PRIOR_WIDENING = 3.0  # times the standard error: the prior width of a parameter in the fit to the curves
MIN_COORDINATE_ERROR = 1e-3  # of a coordinate: the smallest prior width


@dataclass(frozen=True)
class ModelGradient:
    """The quasi-static gradient of a fitted model, as a function of those parameters that the tests can observe.

    ``start`` (k,) and ``covariance`` (k, k) are the model's, in the coordinates of the fit.
    """

    model: Model
    reference_test: Experiment
    free: tuple[FreeParameter, ...]
    start: Array
    covariance: Array
    _changes: dict[bytes, Directions] = field(default_factory=dict, init=False)

    @property
    def valve(self) -> ValveForm:
        """The paths that fill and vent the vessel."""
        return self.model.valve_of_chamber(self.reference_test.recording.chamber)

    @property
    def prior_whitening(self) -> Array:
        """The matrix that scales changes of the model's parameters to units of their prior, shape (k, k).

        The prior is wider than the model's own errors, because the model was fitted to these curves too and they must
        not count twice. A direction that neither determines, such as the area between two commands, keeps the model's
        smoothness.
        """
        return whitening_matrix(
            _limited_covariance(PRIOR_WIDENING**2 * self.covariance, self.bounds), MIN_COORDINATE_ERROR
        )

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the coordinates."""
        lower, upper = ([f.to_coordinate(getattr(f, end)) for f in self.free] for end in ("lower", "upper"))
        return np.array(lower), np.array(upper)

    def at_coordinates(self, z: Array) -> QuasiStaticGradient:
        """Return the gradient at coordinates z (k,)."""
        values = {f.name: f.from_coordinate(c) for f, c in zip(self.free, z, strict=True)}
        return QuasiStaticGradient(with_parameters(self.model, values), self.reference_test)

    def memory_gradient(self, test: Experiment) -> Array:
        """Return the contribution of the model's memory to dp/dt, and its derivatives, shape ``(1 + k, n)`` in Pa/s.

        A model without memory has no derivatives: shape ``(1, n)``.
        """
        if not has_memory(self.model):
            return np.zeros((1, test.time.size))
        nominal = memory_gradient(self.model, test)
        memory_change = [
            memory_gradient(self.at_coordinates(self.start + step).model, test)
            for step in DIFFERENCE_STEP * np.eye(self.start.size)
        ]
        return np.array([nominal, *((shifted - nominal) / DIFFERENCE_STEP for shifted in memory_change)])

    def sensitivity(self, z: Array, u: Array, p: Array, supply: Array) -> Array:
        """Return the derivatives by the coordinates, shape ``u.shape + (k,)``; by central differences but for areas."""
        out, areas = np.empty((*u.shape, z.size)), self._area_coordinates
        if areas:
            out[..., areas] = self.at_coordinates(z).area_derivatives(u, p, supply, self._area_changes(z))
        for j in set(range(z.size)) - set(areas):
            above, below = (
                self.at_coordinates(self._shifted(z, j, step)) for step in (DIFFERENCE_STEP, -DIFFERENCE_STEP)
            )
            out[..., j] = (above(u, p, supply) - below(u, p, supply)) / (2 * DIFFERENCE_STEP)
        return out

    @cached_property
    def _area_coordinates(self) -> list[int]:
        names = self.model.valve_parameters()
        return [j for j, f in enumerate(self.free) if f.name in names]

    def _area_changes(self, z: Array) -> Directions:
        """Return the changes of the areas at coordinates z (k,); those of the last coordinates are kept."""
        key = z.tobytes()
        changes = self._changes.get(key)
        if changes is None:
            steps = (DIFFERENCE_STEP, -DIFFERENCE_STEP)
            models = [
                [(step, self.at_coordinates(self._shifted(z, j, step)).model) for step in steps]
                for j in self._area_coordinates
            ]
            changes = Directions(self.at_coordinates(z).model, models)
            self._changes.clear()
            self._changes[key] = changes
        return changes

    @staticmethod
    def _shifted(z: Array, j: int, step: float) -> Array:
        shifted = z.copy()
        shifted[j] += step
        return shifted

    def standard_error(self, u: Array, p: Array, supply: Array) -> Array:
        """Return the standard error in Pa/s from the covariance of the model's parameters, of the shape of u."""
        rows = self.sensitivity(self.start, u, p, supply)
        return np.asarray(np.sqrt(np.maximum(np.einsum("...i,ij,...j->...", rows, self.covariance, rows), 0.0)))


def model_gradient_of(fitted: Fit, tests: Sequence[Experiment], *, with_memory: bool = True) -> ModelGradient:
    """Build the gradient of a fitted model, reduced to the parameters that the tests can observe.

    Args:
        fitted: The fit of the model.
        tests: The valve tests.
        with_memory: Whether to keep parameters that only the model's memory can show.

    Returns:
        The gradient.

    Raises:
        InputError: The valve of the model never opens.

    """
    if not fitted.model.valve_of_chamber(tests[0].recording.chamber).commands:
        fault = "at no command does air flow the way it should, so the model's valve never opens"
        mend = "turn the sign of u, or see what pneucli ingest finds implausible"
        raise InputError("valve tests", fault, "u above the null command fills, u below it vents", mend, code="E065")
    start = np.array([f.to_coordinate(e.value) for f, e in zip(fitted.free, fitted.estimates, strict=True)])
    full = ModelGradient(fitted.model, tests[0], fitted.free, start, fitted.covariance)
    is_observable = np.zeros(start.size, dtype=bool)
    for test in tests:
        u, p, supply = test.inputs[:, (at.IN_U, at.IN_P1, at.IN_SUPPLY)].T
        u = np.abs(u).max() * np.linspace(-1.0, 1.0, u.size)  # includes openings between the commands
        is_observable |= np.any(full.sensitivity(start, u, p, supply) != 0.0, axis=0)
        if with_memory:
            memory_change = full.memory_gradient(test)[1:]
            is_observable[: len(memory_change)] |= np.any(memory_change != 0.0, axis=1)
    free = tuple(f for f, keep in zip(fitted.free, is_observable, strict=True) if keep)
    reduced = ModelGradient(
        fitted.model, tests[0], free, start[is_observable], fitted.covariance[np.ix_(is_observable, is_observable)]
    )
    return replace(reduced, covariance=_limited_covariance(reduced.covariance, reduced.bounds))


def whitening_matrix(covariance: Array, min_error: float) -> Array:
    """Compute the matrix that turns errors of a covariance into independent ones of unit size.

    Args:
        covariance: Covariance, shape (k, k).
        min_error: Smallest standard error along any axis; it keeps the matrix finite.

    Returns:
        The matrix W, shape (k, k), with W C W^T = I.

    >>> np.abs(whitening_matrix(np.diag([4.0, 0.25]), 0.1)).round(3).tolist()
    [[0.0, 2.0], [0.5, 0.0]]

    """
    variance, axes = np.linalg.eigh(np.nan_to_num(0.5 * (covariance + covariance.T)))
    return np.asarray(axes.T / np.sqrt(np.maximum(variance, min_error**2))[:, None])


def _limited_covariance(covariance: Array, bounds: tuple[Array, Array]) -> Array:
    """Return a covariance (k, k) with no variance above that of a uniform distribution between the bounds."""
    error = np.sqrt(np.diag(covariance))
    widest = (bounds[1] - bounds[0]) / np.sqrt(12.0)
    shrinkage = np.minimum(1.0, widest / np.maximum(error, 1e-300))
    return np.asarray(covariance * np.outer(shrinkage, shrinkage))


def has_memory(model: Model) -> bool:
    """Return whether an effect of the model depends on the past.

    Args:
        model: The model.

    Returns:
        Whether a port of an effect has memory.

    """
    return any(PORTS[port].has_memory for effect in model.effects for port in effect.ports)


def memory_gradient(model: Model, test: Experiment) -> Array:
    """Compute the contribution of effects with memory to dp/dt in a test.

    Heat transfer, a spool that lags, a supply that droops: the simulated gradient minus the quasi-static one.

    Args:
        model: The model.
        test: The valve test.

    Returns:
        The contribution in Pa/s, shape (n,).

    """
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
        return self._run(u, p, supply, NO_SHAPES)[0]

    def area_derivatives(self, u: Array, p: Array, supply: Array, changes: Directions) -> Array:
        """Return the derivatives of the gradient by parameters of the valve's areas, of this model's changes.

        Args:
            u: Command in V from the null command.
            p: Pressure in Pa.
            supply: Supply pressure in Pa; all three of one shape.
            changes: The changes of the areas.

        Returns:
            Pa/s a unit of the parameter, shape ``u.shape + (parameters,)``.
        """
        return self._run(u, p, supply, changes.area_slopes(self.experiment.recording.chamber, self._largest))[1]

    def _run(self, u: Array, p: Array, supply: Array, shapes: Array) -> tuple[Array, Array]:
        out, derivatives = np.empty(u.size), np.empty((u.size, shapes.shape[1]))
        self._gradient(u.ravel(), p.ravel(), supply.ravel(), *self._fixed, out, shapes, derivatives)
        return out.reshape(u.shape), derivatives.reshape((*u.shape, shapes.shape[1]))

    @property
    def _largest(self) -> float:
        """The largest opening of the table of areas in V."""
        valve = self.model.valve_of_chamber(self.experiment.recording.chamber)
        return max(float(self.experiment.flags[at.U_MAX]), *map(abs, valve.commands))

    @cached_property
    def _fixed(self) -> tuple[Array, Array, NDArray[np.uint8], float, Array]:
        kernel = kernel_for(self.model.effects)
        active = kernel.effect_switches(self.experiment.active_effects(self.model.effects))
        base, th = base_vector(self.model, self.experiment), kernel.effect_vector(self.model.effect_values())
        valve = self.model.valve_of_chamber(self.experiment.recording.chamber)
        return base, th, active, self._largest, valve.table(self._largest)

    @cached_property
    def _gradient(self):  # type: ignore[no-untyped-def]
        return kernel_for(self.model.effects).functions.run_gradient
