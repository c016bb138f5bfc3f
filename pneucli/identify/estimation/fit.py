"""Fit a model to the training recordings: bounded least squares in units of the sensors' noise.

Each recording is seen through one subsystem at a time (:mod:`pneucli.identify.residuals`). Intervals come from the scores
of blocks of samples (a sandwich estimator), so that correlated residuals do not feign precision.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from pneucli.identify.estimation.blocks import group_scores, residual_mask
from pneucli.identify.estimation.least_squares import minimise, pseudo_inverse
from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.identify.estimation.problem import LeastSquaresProblem
from pneucli.identify.estimation.progress import iteration_callback
from pneucli.identify.residuals import ResidualModel
from pneucli.simulate.model import Model, parameter_value

Array = NDArray[np.float64]

MAX_DERIVATIVE = 1e100  # times the noise: more is not squared


class StoppingRule(NamedTuple):
    """How far a fit goes: at most so many ``max_iterations``, until one lowers the cost by less than ``tolerance`` of it."""

    max_iterations: int
    tolerance: float


FULL_CONVERGENCE = StoppingRule(12, 1e-5)


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
    numbers the block of each residual; ``covariance`` (k, k) of the coordinates; ``initial_state_sensitivities`` of the starts are by view.
    """

    model: Model
    free: tuple[FreeParameter, ...]
    estimates: tuple[Estimate, ...]
    residual: Array
    jacobian: Array
    blocks: NDArray[np.int64]
    covariance: Array
    cost: float
    initial_state_sensitivities: Sequence[Mapping[str, Array]]

    @cached_property
    def inverse_hessian(self) -> Array:
        """The inverse of the curvature that the data give (k, k)."""
        return pseudo_inverse(self.jacobian.T @ self.jacobian)

    def project_out_nuisance(self, change: Array) -> Array:
        """Return what the free parameters cannot do of a change of the residual, shape (N,)."""
        return np.asarray(change - self.jacobian @ (self.inverse_hessian @ (self.jacobian.T @ change)))

    @cached_property
    def projected_residual(self) -> Array:
        """The residual without what the free parameters could still take up, shape (N,)."""
        return self.project_out_nuisance(self.residual)

    def __getitem__(self, name: str) -> Estimate:
        return next(e for e in self.estimates if e.name == name)


def fit(
    model: Model,
    views: Sequence[ResidualModel],
    free: Sequence[FreeParameter],
    *,
    stopping: StoppingRule = FULL_CONVERGENCE,
    initial_jacobian: Array | None = None,
) -> Fit:
    """Fit the free parameters from their starts to what the views leave over.

    ``initial_jacobian`` are the derivatives (N, k) at the start where a fit that ended there has left them.
    """
    problem = LeastSquaresProblem(model, views, free)
    if not free:
        residual = np.concatenate([*problem.data_residuals(model), problem.prior_residuals(np.zeros(0))])
        return _fit_summary(problem, np.zeros(0), residual, np.zeros((residual.size, 0)))
    found = minimise(
        *(problem.residuals, problem.jacobian, problem.start, problem.bounds()),
        max_iterations=stopping.max_iterations,
        tolerance=stopping.tolerance,
        callback=iteration_callback([e.name for e in model.effects], problem.blocks().size),
        initial_jacobian=None
        if initial_jacobian is None
        else np.vstack([initial_jacobian, problem.prior_jacobian(problem.start)]),
    )
    return _fit_summary(problem, found.z, found.residual, found.jacobian)


def _fit_summary(problem: LeastSquaresProblem, z: Array, residual: Array, jacobian: Array) -> Fit:
    blocks = problem.blocks()
    n = blocks.size
    if not problem.free:
        cost, none = float(residual @ residual), np.zeros((0, 0))
        return Fit(problem.model, (), (), residual[:n], jacobian[:n], blocks, none, cost, problem.errors)
    for column in jacobian.T:  # beyond all numbers nothing is known of it; written there alone, zeros take no memory
        column[~(np.abs(column) < MAX_DERIVATIVE)] = 0.0
    bread = pseudo_inverse(jacobian.T @ jacobian)
    scored = group_scores(jacobian[:n], residual[:n], blocks)
    meat = scored.T @ scored + jacobian[n:].T @ jacobian[n:]
    covariance = bread @ meat @ bread
    model = problem.model_at(z)
    return Fit(
        model,
        tuple(problem.free),
        parameter_estimates(problem.free, model, covariance),
        residual[:n],
        jacobian[:n],
        blocks,
        covariance,
        float(residual @ residual),
        problem.errors,
    )


def parameter_estimates(
    free: Sequence[FreeParameter], model: Model, covariance: Array, degrees_of_freedom: Array | None = None
) -> tuple[Estimate, ...]:
    """Return a fitted model's free parameters with their intervals, by the coordinates' covariance (k, k).

    ``degrees_of_freedom`` (k,) are the degrees of freedom with which that is known, without end where none are given.
    """
    within = np.asarray(
        student.ppf(0.975, np.full(len(free), np.inf) if degrees_of_freedom is None else degrees_of_freedom)
    )
    estimates = []
    for j, f in enumerate(free):
        value = parameter_value(model, f.name)
        z, error = f.to_coordinate(value), float(np.sqrt(max(covariance[j, j], 0.0)))
        edge = float(within[j]) * error
        low, high = f.from_coordinate(z - edge), f.from_coordinate(z + edge)
        at_bound = bool(z - f.to_coordinate(f.lower) < 1e-6 or f.to_coordinate(f.upper) - z < 1e-6)
        estimates.append(Estimate(f.name, f.unit, value, error * f.derivative(value), (low, high), at_bound))
    return tuple(estimates)


def without_data(found: Fit) -> Fit:
    """Return a fit with its model and parameters alone: the derivatives of a long recording fill the memory."""
    none = np.zeros((0, len(found.free)))
    return replace(
        found, residual=np.zeros(0), jacobian=none, blocks=np.zeros(0, dtype=np.int64), initial_state_sensitivities=()
    )


def merge_partial_fit(found: Fit, part: Fit, views: Sequence[ResidualModel], chosen: NDArray[np.bool_]) -> Fit:
    """Return a fit of all views from one of the ``chosen`` views, the others being left as ``found`` has them.

    Right where no parameter of the part reaches another view, and none of another view the part.
    """
    new = {f.name: f for f in part.free}
    free = [new.pop(f.name, f) for f in found.free] + list(new.values())
    rows = residual_mask(views, chosen)
    errors = iter(part.initial_state_sensitivities)
    known = [next(errors) if new else old for old, new in zip(found.initial_state_sensitivities, chosen, strict=True)]
    problem = LeastSquaresProblem(part.model, views, free, known)
    z = np.array([f.to_coordinate(parameter_value(part.model, f.name)) for f in free])
    residual = np.concatenate([found.residual, problem.prior_residuals(z)])
    jacobian = np.zeros((residual.size, len(free)), order="F")
    jacobian[rows.size :] = problem.prior_jacobian(z)
    residual[: rows.size][rows] = part.residual
    mine, theirs = [f.name for f in part.free], [f.name for f in found.free]
    for j, f in enumerate(free):
        column = jacobian[: rows.size, j]
        if f.name in mine:
            column[rows] = part.jacobian[:, mine.index(f.name)]
        else:
            column[:] = found.jacobian[:, theirs.index(f.name)]
    return _fit_summary(problem, z, residual, jacobian)
