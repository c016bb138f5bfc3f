"""Fit a model to the training recordings: bounded least squares in units of the sensors' noise.

Each recording is seen through one subsystem at a time (:mod:`pneucli.identify.views`). Intervals come from the scores
of blocks of samples (a sandwich estimator), so that correlated residuals do not feign precision.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from threading import Lock

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from pneucli.executors import workers
from pneucli.identify.least_squares import inverse, minimise
from pneucli.identify.parameters import STEP, Free, value_of, with_parameters
from pneucli.identify.views import View
from pneucli.identify.watch import watched
from pneucli.simulate.model import Model

Array = NDArray[np.float64]

BLOCK = 0.25  # s, longer than the residuals' memory
MOST_BLOCKS = 40  # of one recording
TOLERANCE = 1e-5
BEYOND = 1e100  # times the noise: more is not squared
MEMORY, PER_SAMPLE = 256 << 20, 200  # bytes, of all simulations that run at once, and of one for each sample
ROUGH = 0.02  # of the logarithm of the area: by how much a valve departs from a power law between knots


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter: value, standard error and 95 % interval in its own unit; whether it stands at a bound."""

    name: str
    unit: str
    value: float
    error: float
    ci95: tuple[float, float]
    at_bound: bool


@dataclass(frozen=True)
class Fit:
    """The fitted model, its parameters, and what tests on it need.

    ``residual`` (N,), ``jacobian`` (N, k) in units of the channels' noise and the fit's coordinates; ``blocks`` (N,)
    numbers the block of each residual; ``covariance`` (k, k) of the coordinates; ``errors`` of the starts are by view.
    """

    model: Model
    free: tuple[Free, ...]
    estimates: tuple[Estimate, ...]
    residual: Array
    jacobian: Array
    blocks: NDArray[np.int64]
    covariance: Array
    cost: float
    errors: Sequence[Mapping[str, Array]]

    @cached_property
    def bread(self) -> Array:
        """The inverse of the curvature that the data give (k, k)."""
        return inverse(self.jacobian.T @ self.jacobian)

    def beyond(self, change: Array) -> Array:
        """Return what the free parameters cannot do of a change of the residual, shape (N,)."""
        return np.asarray(change - self.jacobian @ (self.bread @ (self.jacobian.T @ change)))

    @cached_property
    def unexplained(self) -> Array:
        """The residual without what the free parameters could still take up, shape (N,)."""
        return self.beyond(self.residual)

    def __getitem__(self, name: str) -> Estimate:
        return next(e for e in self.estimates if e.name == name)


@dataclass
class Problem:
    """Residuals of the views in units of their noise, and their derivatives.

    The residuals are whitened for the ``errors`` that starts have with the model as it is at first, or ``known`` ones.
    """

    model: Model
    views: Sequence[View]
    free: Sequence[Free]
    known: Sequence[Mapping[str, Array]] | None = None

    def __post_init__(self) -> None:
        self.errors = self.known or _parallel(lambda view: view.carried(self.model), self.views, self.at_once)
        self.start = np.array([f.inward(f.start) for f in self.free])
        self.centre = np.array([f.inward(f.start if f.centre is None else f.centre) for f in self.free])
        self.tight = np.array([1.0 / f.prior for f in self.free])
        self._last: tuple[Array, Array] | None = None  # coordinates and their residuals

    @property
    def at_once(self) -> int:
        """How many simulations run at once: as many as there are cores, unless the recordings are very long."""
        longest = max((view.experiment.time.size for view in self.views), default=1)
        return int(np.clip(MEMORY // (PER_SAMPLE * longest), 1, workers()))

    def model_at(self, z: Array) -> Model:
        """Return the model at coordinates z (k,)."""
        return with_parameters(self.model, {f.name: f.outward(c) for f, c in zip(self.free, z, strict=True)})

    def data(self, model: Model) -> list[Array]:
        """Return the residuals of each view in units of noise."""
        return _parallel(
            lambda job: scaled(job[0], model, job[1]), list(zip(self.views, self.errors, strict=True)), self.at_once
        )

    def residuals(self, z: Array) -> Array:
        """Return all residuals (N + p,), what is known beforehand last."""
        if self._last is None or not np.array_equal(self._last[0], z):
            self._last = z.copy(), np.concatenate([*self.data(self.model_at(z)), self.prior(z)])
        return self._last[1]

    def prior(self, z: Array) -> Array:
        """Return what is known beforehand as residuals: starts with a prior, and a valve near a power law."""
        rough = [valve.roughness() / ROUGH for valve in self.model_at(z).valves]
        return np.concatenate([self.tight * (z - self.centre), *rough])

    def jacobian(self, z: Array) -> Array:
        """Return the derivatives (N + p, k) by differences; only the views that feel a parameter are run."""
        base = self.model_at(z)
        offsets = np.cumsum([0, *(view.experiment.time.size * len(view.channels) for view in self.views)])
        nominal = np.split(self.residuals(z), offsets[1:])
        adding, known = Lock(), self.prior_jacobian(z)
        # column by column: of a view that does not feel a parameter, not a page is touched
        out = np.zeros((offsets[-1] + len(known), z.size), order="F")
        out[offsets[-1] :] = known
        jobs = []
        for j in range(z.size):
            for step in self._steps(z, j):
                moved = z.copy()
                moved[j] += step
                model = self.model_at(moved)
                jobs += [(i, j, step, model) for i, view in enumerate(self.views) if view.tells(base, model)]

        def column(job: tuple[int, int, float, Model]) -> None:
            i, j, step, model = job
            change = (scaled(self.views[i], model, self.errors[i]) - nominal[i]) / step
            for c, part in enumerate(np.split(change, len(self.views[i].channels))):
                if part.any():  # what never changes never takes memory
                    first = offsets[i] + c * part.size
                    with adding:
                        out[first : first + part.size, j] += part / len(self._steps(z, j))

        _parallel(column, jobs, self.at_once)
        return out

    def prior_jacobian(self, z: Array) -> Array:
        """Return the derivatives (p, k) of what is known beforehand."""
        known = self.prior(z)
        columns = [(self.prior(z + STEP * row) - known) / STEP for row in np.eye(z.size)]
        return np.array(columns).reshape(z.size, known.size).T

    def _steps(self, z: Array, j: int) -> tuple[float, ...]:
        """Return the differences for one coordinate: to both sides of an edge, since only one side may tell."""
        step = self.free[j].step
        if step > STEP:
            return (step, -step)
        return (step,) if z[j] + step < self.bounds()[1][j] else (-step,)

    def bounds(self) -> tuple[Array, Array]:
        """Return the coordinates' bounds."""
        return (
            np.array([f.inward(f.lower) for f in self.free]),
            np.array([f.inward(f.upper) for f in self.free]),
        )

    def blocks(self) -> NDArray[np.int64]:
        """Return the number of the block of each residual (N,): one stretch of time of one view, all channels."""
        return block_numbers(self.views)


def scaled(view: View, model: Model, errors: Mapping[str, Array]) -> Array:
    """Return a view's residuals in units of noise, times their weights, whitened for ``errors`` of starts."""
    residual = view.residual(model, errors)
    return np.concatenate([view.weights.get(c, 1.0) * (residual[c] / view.noise[c]) for c in view.channels])


def block_numbers(views: Sequence[View]) -> NDArray[np.int64]:
    """Return the number of the block of each residual, in the order of :func:`scaled` over the views."""
    numbers, first = [], 0
    for view in views:
        time = view.experiment.time
        length = max(BLOCK, (time[-1] - time[0]) / MOST_BLOCKS)
        mine = first + ((time - time[0]) / length).astype(np.int64)
        numbers.append(np.tile(mine, len(view.channels)))
        first = int(mine[-1]) + 1
    return np.concatenate(numbers)


def fit(
    model: Model,
    views: Sequence[View],
    free: Sequence[Free],
    *,
    rounds: int = 12,
) -> Fit:
    """Fit the free parameters from their starts to what the views leave over."""
    problem = Problem(model, views, free)
    if not free:
        residual = np.concatenate([*problem.data(model), problem.prior(np.zeros(0))])
        return _summary(problem, np.zeros(0), residual, np.zeros((residual.size, 0)))
    found = minimise(
        *(problem.residuals, problem.jacobian, problem.start, problem.bounds()),
        rounds=rounds,
        tolerance=TOLERANCE,
        each_round=watched([e.name for e in model.effects], problem.blocks().size),
    )
    return _summary(problem, found.z, found.residual, found.jacobian)


def _summary(problem: Problem, z: Array, residual: Array, jacobian: Array) -> Fit:
    blocks = problem.blocks()
    n = blocks.size
    if not problem.free:
        cost, none = float(residual @ residual), np.zeros((0, 0))
        return Fit(problem.model, (), (), residual[:n], jacobian[:n], blocks, none, cost, problem.errors)
    for column in jacobian.T:  # beyond all numbers nothing is known of it; written there alone, zeros take no memory
        column[~(np.abs(column) < BEYOND)] = 0.0
    bread = inverse(jacobian.T @ jacobian)
    meat = _block_meat(residual[:n], jacobian[:n], blocks) + jacobian[n:].T @ jacobian[n:]
    covariance = bread @ meat @ bread
    model = problem.model_at(z)
    return Fit(
        model,
        tuple(problem.free),
        estimates_of(problem.free, model, covariance),
        residual[:n],
        jacobian[:n],
        blocks,
        covariance,
        float(residual @ residual),
        problem.errors,
    )


def estimates_of(free: Sequence[Free], model: Model, covariance: Array) -> tuple[Estimate, ...]:
    """Return a fitted model's free parameters with their intervals, by the coordinates' covariance (k, k)."""
    estimates = []
    for j, f in enumerate(free):
        value = value_of(model, f.name)
        z, error = f.inward(value), float(np.sqrt(max(covariance[j, j], 0.0)))
        edge = norm.ppf(0.975) * error
        low, high = f.outward(z - edge), f.outward(z + edge)
        at_bound = bool(z - f.inward(f.lower) < 1e-6 or f.inward(f.upper) - z < 1e-6)
        estimates.append(Estimate(f.name, f.unit, value, error * f.slope(value), (low, high), at_bound))
    return tuple(estimates)


def without_data(found: Fit) -> Fit:
    """Return a fit with its model and parameters alone: the derivatives of a long recording fill the memory."""
    none = np.zeros((0, len(found.free)))
    return replace(found, residual=np.zeros(0), jacobian=none, blocks=np.zeros(0, dtype=np.int64), errors=())


def joined(found: Fit, part: Fit, views: Sequence[View], chosen: NDArray[np.bool_]) -> Fit:
    """Return a fit of all views from one of the ``chosen`` views, the others being left as ``found`` has them.

    Right where no parameter of the part reaches another view, and none of another view the part.
    """
    new = {f.name: f for f in part.free}
    free = [new.pop(f.name, f) for f in found.free] + list(new.values())
    rows = np.repeat(chosen, [v.experiment.time.size * len(v.channels) for v in views])
    residual, jacobian = found.residual.copy(), np.zeros((found.residual.size, len(free)), order="F")
    residual[rows] = part.residual
    mine, theirs = [f.name for f in part.free], [f.name for f in found.free]
    for j, f in enumerate(free):
        if f.name in mine:
            jacobian[rows, j] = part.jacobian[:, mine.index(f.name)]
        else:
            jacobian[:, j] = found.jacobian[:, theirs.index(f.name)]
    parts = iter(part.errors)
    errors = [next(parts) if new else old for old, new in zip(found.errors, chosen, strict=True)]
    problem = Problem(part.model, views, free, errors)
    z = np.array([f.inward(value_of(part.model, f.name)) for f in free])
    return _summary(
        problem, z, np.concatenate([residual, problem.prior(z)]), np.vstack([jacobian, problem.prior_jacobian(z)])
    )


def _block_meat(residual: Array, jacobian: Array, blocks: NDArray[np.int64]) -> Array:
    """Return the sum of outer products of the blocks' scores (k, k)."""
    scores = np.array([np.bincount(blocks, weights=column * residual) for column in jacobian.T])
    return np.asarray(scores @ scores.T)


def _parallel(work: Callable[..., object], jobs: Sequence[object], at_once: int) -> list:  # type: ignore[type-arg]
    with ThreadPoolExecutor(at_once) as pool:
        return list(map(work, jobs) if at_once == 1 else pool.map(work, jobs))
