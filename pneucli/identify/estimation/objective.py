"""The least-squares problem of a fit (docs/method.md): residuals in units of noise, priors, and derivatives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.executors import map_in_threads, simulations_at_once
from pneucli.identify.estimation.blocks import block_labels, channel_slices, clear, residual_counts, residual_slices
from pneucli.identify.estimation.parameters import DIFFERENCE_STEP, FreeParameter
from pneucli.identify.residuals import ResidualModel
from pneucli.identify.residuals.base import Places
from pneucli.simulate.derivatives import Directions
from pneucli.simulate.model import Model, with_parameters

POWER_LAW_SIGMA = 0.02  # of the logarithm of the area: prior departure of a valve from a power law between knots


@dataclass
class LeastSquaresProblem:
    """The objective of the fit: residuals in units of their noise, those of prior knowledge, and all derivatives.

    The residuals are whitened for the errors of the initial states, as the start model has them, or for
    ``given_sensitivities``.
    """

    model: Model
    residual_models: Sequence[ResidualModel]
    free: Sequence[FreeParameter]
    given_sensitivities: Sequence[Mapping[str, Array]] | None = None

    def __post_init__(self) -> None:
        self.errors = self.given_sensitivities or map_in_threads(
            lambda one: one.initial_state_sensitivity(self.model),
            self.residual_models,
            self.max_parallel,
        )
        self.start = np.array([f.to_coordinate(f.start) for f in self.free])
        self.centre = np.array([f.to_coordinate(f.start if f.prior_mean is None else f.prior_mean) for f in self.free])
        self.tight = np.array([1.0 / f.prior_sigma for f in self.free])
        self._bounds = (
            np.array([f.to_coordinate(f.lower) for f in self.free]),
            np.array([f.to_coordinate(f.upper) for f in self.free]),
        )
        self._last: tuple[Array, Array] | None = None  # coordinates and their residuals
        self.backward = False  # whether differences are toward lower coordinates

    @property
    def max_parallel(self) -> int:
        """How many simulations run at once."""
        return simulations_at_once([one.experiment.time for one in self.residual_models])

    @property
    def data_size(self) -> int:
        """Number N of the residuals of the data."""
        return sum(residual_counts(self.residual_models))

    def model_at(self, z: Array) -> Model:
        """Return the model at coordinates z (k,)."""
        return with_parameters(self.model, {f.name: f.from_coordinate(c) for f, c in zip(self.free, z, strict=True)})

    def data_residuals(self, model: Model) -> list[Array]:
        """Return the residuals of each residual model in units of noise."""
        return map_in_threads(
            lambda job: whitened_residual(job[0], model, job[1]),
            list(zip(self.residual_models, self.errors, strict=True)),
            self.max_parallel,
        )

    def residuals(self, z: Array) -> Array:
        """Return all residuals (N + p,) at coordinates z (k,); those of the priors come last."""
        if self._last is None or not np.array_equal(self._last[0], z):
            self._last = z.copy(), np.concatenate([*self.data_residuals(self.model_at(z)), self.prior_residuals(z)])
        return self._last[1]

    def prior_residuals(self, z: Array) -> Array:
        """Return the residuals of the priors: on parameters, and on a valve's departure from a power law."""
        return np.concatenate([self.tight * (z - self.centre), self._roughness(self.model_at(z))])

    @staticmethod
    def _roughness(model: Model) -> Array:
        """Return the departure of the valves from a power law between knots, over what is expected."""
        return np.concatenate([valve.roughness() / POWER_LAW_SIGMA for valve in model.valves])

    def zero_derivatives(self) -> Array:
        """Return zeros for the derivatives (N + p, k).

        Column by column: pages of residual models that a parameter does not change are never touched.
        """
        return np.zeros((self.data_size + self.prior_residuals(self.start).size, len(self.free)), order="F")

    def jacobian(self, z: Array, out: Array | None = None) -> Array:
        """Return the derivatives (N + p, k), in ``out`` if it is given; evaluate only residual models that change."""
        out = self.zero_derivatives() if out is None else out
        out[self.data_size :] = self.prior_jacobian(z)
        self.evaluate_columns(z, range(z.size), out)
        return out

    def evaluate_columns(self, z: Array, columns: Sequence[int], out: Array) -> None:
        """Write the derivatives of the data by some coordinates to those columns of derivatives (N + p, k).

        They come from simulations with dual numbers where a residual model allows that, others from differences.
        """
        base = self.model_at(z)
        rows = residual_slices(self.residual_models)
        nominal = self.residuals(z)
        shifted = {j: [(step, self._moved(base, z, j, step)) for step in self._steps(z, j)] for j in columns}
        directions = Directions(base, [shifted[j] for j in columns])
        smooth = np.array([self._is_smooth(z, j, base) for j in columns], dtype=bool)
        clear(out, columns, channel_slices(self.residual_models))
        jobs = list[Callable[[], None]]()

        def difference(i: int, j: int) -> None:
            one = self.residual_models[i]
            for step, model in shifted[j]:
                change = whitened_residual(one, model, self.errors[i]) - nominal[rows[i]]
                for channel in channel_slices([one]):
                    if change[channel].any():  # zeros that are not written take no memory
                        out[rows[i], j][channel] += change[channel] / (step * len(shifted[j]))

        def simulate(i: int, some: Sequence[int]) -> None:
            places = Places(out.T, np.array(columns), rows[i].start)
            self.residual_models[i].write_derivatives(directions, self.errors[i], some, places)

        for i, one in enumerate(self.residual_models):
            changed = np.array([one.differs(base, shifted[j][0][1]) for j in columns], dtype=bool)
            simulated = changed & smooth & one.differentiable(directions)
            if simulated.any():
                jobs.append(partial(simulate, i, np.flatnonzero(simulated).tolist()))
            jobs += [partial(difference, i, columns[place]) for place in np.flatnonzero(changed & ~simulated).tolist()]
        map_in_threads(lambda job: job(), jobs, self.max_parallel)

    def _is_smooth(self, z: Array, j: int, model: Model) -> bool:
        """Return whether the equations are smooth at a coordinate.

        They are not at an edge, and may not be at a bound, where an effect may be switched off. A valve's areas enter
        through a table, whose differences see to that.
        """
        if self.free[j].name in model.valve_parameters():
            return True
        step, (lower, upper) = self.free[j].step, self.bounds()
        return step <= DIFFERENCE_STEP and bool(lower[j] + step < z[j] < upper[j] - step)

    def _moved(self, base: Model, z: Array, j: int, step: float) -> Model:
        """Return the model ``base`` at coordinates z (k,) with one of them moved by a step."""
        return with_parameters(base, {self.free[j].name: self.free[j].from_coordinate(z[j] + step)})

    def correct_jacobian(self, jacobian: Array, before: Array, after: Array, change: Array) -> None:
        """Correct derivatives (N + p, k) in place by the change of the residuals (N + p,) over a step between two
        coordinates (k,).

        The corrected derivatives reproduce the step. What they miss is shared among the columns in proportion to the
        squares of their lengths, which does not depend on the units of the parameters; zeros stay zeros.

        References:
            L. K. Schubert, Math. Comput. 24 (1970) 27-30 (Broyden's update of a sparse Jacobian).

        """
        move = after - before
        columns = np.flatnonzero(move)
        for rows in channel_slices(self.residual_models):
            parts = [(j, jacobian[rows, j]) for j in columns]
            power = np.array([float(part @ part) for _, part in parts])
            total = float(power @ move[columns] ** 2)
            if not (total > 0.0 and np.isfinite(total)):
                continue
            missed = change[rows] - sum(move[j] * part for (j, part), p in zip(parts, power, strict=True) if p)
            for j, p in zip(columns, power, strict=True):
                if p:
                    jacobian[rows, j] += (p * move[j] / total) * missed

    def prior_jacobian(self, z: Array) -> Array:
        """Return the derivatives (p, k) of the residuals of the priors."""
        base = self.model_at(z)
        own, roughness = base.valve_parameters(), self._roughness(base)
        out = np.vstack([np.diag(self.tight), np.zeros((roughness.size, z.size))])
        for j in (j for j, f in enumerate(self.free) if f.name in own):
            moved = self._roughness(self._moved(base, z, j, DIFFERENCE_STEP))
            out[z.size :, j] = (moved - roughness) / DIFFERENCE_STEP
        return out

    def _steps(self, z: Array, j: int) -> tuple[float, ...]:
        """Return the difference steps of one coordinate: to both sides of an edge, else upward, inward at a bound."""
        step = self.free[j].step
        if step > DIFFERENCE_STEP:
            return (step, -step)
        if self.backward:
            return (-step,) if z[j] - step > self.bounds()[0][j] else (step,)
        return (step,) if z[j] + step < self.bounds()[1][j] else (-step,)

    def bounds(self) -> tuple[Array, Array]:
        """Return the lower and upper bounds of the coordinates, each (k,)."""
        return self._bounds

    def blocks(self) -> NDArray[np.int64]:
        """Return the block of each residual (N,): a span of time of one residual model, all channels."""
        return block_labels(self.residual_models)


def whitened_residual(residual_model: ResidualModel, model: Model, sensitivities: Mapping[str, Array]) -> Array:
    """Evaluate a residual model in units of noise, weighted, and whitened for errors of the initial states.

    Args:
        residual_model: The residual model.
        model: The model to compare with the recording.
        sensitivities: Effect of the initial-state errors by channel, each (k, n), in units of noise.

    Returns:
        The residuals, channel after channel, shape (N,).

    """
    return in_noise_units(residual_model, residual_model.residual(model, sensitivities))


def in_noise_units(residual_model: ResidualModel, residual: Mapping[str, Array]) -> Array:
    """Divide residuals by the noise of their channels and apply the weights.

    Args:
        residual_model: The residual model.
        residual: Residuals by channel in SI units, each (n,).

    Returns:
        The residuals, channel after channel, shape (N,).

    """
    weights, noise = residual_model.weights, residual_model.noise
    return np.concatenate([weights.get(c, 1.0) * (residual[c] / noise[c]) for c in residual_model.channels])
