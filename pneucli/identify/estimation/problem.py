"""The residuals of the views in units of their noise, and their derivatives: what a fit minimises."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from pneucli.executors import thread_count
from pneucli.identify.estimation.blocks import block_labels
from pneucli.identify.estimation.parameters import DIFFERENCE_STEP, FreeParameter
from pneucli.identify.residuals import ResidualModel
from pneucli.simulate.model import Model, with_parameters

Array = NDArray[np.float64]

SIMULATION_MEMORY, BYTES_PER_SAMPLE = (
    256 << 20,
    200,
)  # bytes, of all simulations that run at once, and of one for each sample
POWER_LAW_SIGMA = 0.02  # of the logarithm of the area: by how much a valve departs from a power law between knots


@dataclass
class LeastSquaresProblem:
    """Residuals of the views in units of their noise, and their derivatives.

    The residuals are whitened for the ``errors`` that starts have with the model as it is at first, or
    ``given_sensitivities`` ones.
    """

    model: Model
    residual_models: Sequence[ResidualModel]
    free: Sequence[FreeParameter]
    given_sensitivities: Sequence[Mapping[str, Array]] | None = None

    def __post_init__(self) -> None:
        self.errors = self.given_sensitivities or _parallel(
            lambda view: view.initial_state_sensitivity(self.model), self.residual_models, self.max_parallel
        )
        self.start = np.array([f.to_coordinate(f.start) for f in self.free])
        self.centre = np.array([f.to_coordinate(f.start if f.prior_mean is None else f.prior_mean) for f in self.free])
        self.tight = np.array([1.0 / f.prior_sigma for f in self.free])
        self._last: tuple[Array, Array] | None = None  # coordinates and their residuals

    @property
    def max_parallel(self) -> int:
        """How many simulations run at once: as many as there are cores, unless the recordings are very long."""
        longest = max((view.experiment.time.size for view in self.residual_models), default=1)
        return int(np.clip(SIMULATION_MEMORY // (BYTES_PER_SAMPLE * longest), 1, thread_count()))

    def model_at(self, z: Array) -> Model:
        """Return the model at coordinates z (k,)."""
        return with_parameters(self.model, {f.name: f.from_coordinate(c) for f, c in zip(self.free, z, strict=True)})

    def data_residuals(self, model: Model) -> list[Array]:
        """Return the residuals of each view in units of noise."""
        return _parallel(
            lambda job: whitened_residual(job[0], model, job[1]),
            list(zip(self.residual_models, self.errors, strict=True)),
            self.max_parallel,
        )

    def residuals(self, z: Array) -> Array:
        """Return all residuals (N + p,), what is known beforehand last."""
        if self._last is None or not np.array_equal(self._last[0], z):
            self._last = z.copy(), np.concatenate([*self.data_residuals(self.model_at(z)), self.prior_residuals(z)])
        return self._last[1]

    def prior_residuals(self, z: Array) -> Array:
        """Return what is known beforehand as residuals: starts with a prior, and a valve near a power law."""
        rough = [valve.roughness() / POWER_LAW_SIGMA for valve in self.model_at(z).valves]
        return np.concatenate([self.tight * (z - self.centre), *rough])

    def jacobian(self, z: Array) -> Array:
        """Return the derivatives (N + p, k) by differences; only the views that feel a parameter are run."""
        base = self.model_at(z)
        offsets = np.cumsum([0, *(view.experiment.time.size * len(view.channels) for view in self.residual_models)])
        nominal = np.split(self.residuals(z), offsets[1:])
        adding, prior = Lock(), self.prior_jacobian(z)
        # column by column: of a view that does not feel a parameter, not a page is touched
        out = np.zeros((offsets[-1] + len(prior), z.size), order="F")
        out[offsets[-1] :] = prior
        jobs = []
        for j in range(z.size):
            for step in self._steps(z, j):
                moved = z.copy()
                moved[j] += step
                model = self.model_at(moved)
                jobs += [
                    (i, j, step, model) for i, view in enumerate(self.residual_models) if view.differs(base, model)
                ]

        def column(job: tuple[int, int, float, Model]) -> None:
            i, j, step, model = job
            change = (whitened_residual(self.residual_models[i], model, self.errors[i]) - nominal[i]) / step
            for c, part in enumerate(np.split(change, len(self.residual_models[i].channels))):
                if part.any():  # what never changes never takes memory
                    first = offsets[i] + c * part.size
                    with adding:
                        out[first : first + part.size, j] += part / len(self._steps(z, j))

        _parallel(column, jobs, self.max_parallel)
        return out

    def prior_jacobian(self, z: Array) -> Array:
        """Return the derivatives (p, k) of what is known beforehand."""
        known = self.prior_residuals(z)
        columns = [
            (self.prior_residuals(z + DIFFERENCE_STEP * row) - known) / DIFFERENCE_STEP for row in np.eye(z.size)
        ]
        return np.array(columns).reshape(z.size, known.size).T

    def _steps(self, z: Array, j: int) -> tuple[float, ...]:
        """Return the differences for one coordinate: to both sides of an edge, since only one side may tell."""
        step = self.free[j].step
        if step > DIFFERENCE_STEP:
            return (step, -step)
        return (step,) if z[j] + step < self.bounds()[1][j] else (-step,)

    def bounds(self) -> tuple[Array, Array]:
        """Return the coordinates' bounds."""
        return (
            np.array([f.to_coordinate(f.lower) for f in self.free]),
            np.array([f.to_coordinate(f.upper) for f in self.free]),
        )

    def blocks(self) -> NDArray[np.int64]:
        """Return the number of the block of each residual (N,): one stretch of time of one view, all channels."""
        return block_labels(self.residual_models)


def whitened_residual(view: ResidualModel, model: Model, sensitivities: Mapping[str, Array]) -> Array:
    """Return a view's residuals in units of noise, times their weights, whitened for ``sensitivities`` of starts."""
    return in_noise_units(view, view.residual(model, sensitivities))


def in_noise_units(view: ResidualModel, residual: Mapping[str, Array]) -> Array:
    """Return a view's residuals by channel in units of noise, times their weights, channel after channel (N,)."""
    return np.concatenate([view.weights.get(c, 1.0) * (residual[c] / view.noise[c]) for c in view.channels])


def _parallel(work: Callable[..., object], jobs: Sequence[object], at_once: int) -> list:  # type: ignore[type-arg]
    """Return what work makes of each job; a thread has every n-th, since to hand over single ones costs as much."""

    def several(some: Sequence[object]) -> list[object]:
        return [work(job) for job in some]

    if at_once == 1:
        return several(jobs)
    done: list[object] = [None] * len(jobs)
    with ThreadPoolExecutor(at_once) as pool:
        for first, part in enumerate(pool.map(several, [jobs[n::at_once] for n in range(at_once)])):
            done[first::at_once] = part
    return done
