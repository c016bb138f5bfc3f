"""Fit a model to the training recordings: bounded least squares in units of the sensors' noise.

Each residual model compares one subsystem of a recording with the model (:mod:`pneucli.identify.residuals`).
Intervals come from the scores of blocks of samples (a sandwich estimator), so that correlated residuals do not feign
precision.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.figure import Figure
from pneucli.identify.estimation.blocks import copy_nonzero, group_scores, residual_slices
from pneucli.identify.estimation.least_squares import Approximation, minimise, pseudo_inverse, undetermined_coordinates
from pneucli.identify.estimation.objective import LeastSquaresProblem
from pneucli.identify.estimation.parameters import DIFFERENCE_STEP, FreeParameter
from pneucli.identify.residuals import ResidualModel
from pneucli.quantities import Z95
from pneucli.simulate.model import Model, parameter_value


class Iteration(NamedTuple):
    """One iteration: the effects of the fitted model, the number of search and iteration, and the rms residual.

    The residual is in units of the noise, over all channels and priors.
    """

    effects: tuple[str, ...]
    search: int
    round: int
    residual: float


_observer: ContextVar[Callable[[Iteration], None] | None] = ContextVar("watcher", default=None)
_search_count: ContextVar[int] = ContextVar("searches", default=0)


@contextmanager
def report_iterations_to(observer: Callable[[Iteration], None]) -> Iterator[None]:
    """Call an observer at each iteration of the fits in this thread, for as long as the context lasts.

    Args:
        observer: The function to call.

    """
    tokens = _observer.set(observer), _search_count.set(0)
    try:
        yield
    finally:
        _observer.reset(tokens[0])
        _search_count.reset(tokens[1])


def iteration_callback(effects: Sequence[str], residuals: int) -> Callable[[float], None]:
    """Start a search and return the callback that reports its iterations.

    Args:
        effects: Names of the model's effects.
        residuals: Number of residuals.

    Returns:
        The function to call with the sum of squares, first before the first iteration.

    """
    observer = _observer.get()
    if observer is None:
        return lambda cost: None
    search = _search_count.get() + 1
    _search_count.set(search)
    iterations = iter(range(1_000_000))

    def report(cost: float) -> None:
        observer(Iteration(tuple(effects), search, next(iterations), math.sqrt(cost / max(residuals, 1))))

    return report


def best_determined_mean(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the weights of the mean of some levels that the data determine best.

    A relative growth of dry friction multiplies all of it, Coulomb friction and what a Stribeck curve adds. Where the
    piston moves too slowly or too fast to tell these apart, neither is certain, and a mean of both is.

    Args:
        covariance: Covariance of the levels, shape (m, m).

    Returns:
        Weights, none negative, with the sum 1, shape (m,); of two levels those of the least variance, of more those
        that pairs in turn give.

    >>> best_determined_mean(np.array([[4.0, -1.0], [-1.0, 1.0]])).round(3).tolist()
    [0.286, 0.714]
    >>> best_determined_mean(np.array([[36.0, 3.0], [3.0, 0.25]])).tolist()
    [0.0, 1.0]
    """
    weights: NDArray[np.float64] = np.eye(len(covariance))[0]
    for j in range(1, len(covariance)):
        own, other, cross = weights @ covariance @ weights, covariance[j, j], weights @ covariance[:, j]
        spread = own + other - 2.0 * cross
        share = min(max((own - cross) / spread, 0.0), 1.0) if spread > 0.0 else 0.0
        weights *= 1.0 - share
        weights[j] = share
    return weights


def ratio_interval(ratio: float, factor: float, covariance: NDArray[np.float64]) -> tuple[float, float]:
    """Return the 95 % interval of a ratio whose product with a factor is what the data determine.

    A symmetric interval of the ratio grows without limit as the factor becomes uncertain, though the product may be
    certainly not 0. Here a value g belongs to the interval if the product less g times the factor does not differ from
    0; the interval contains 0 exactly where that of the product does.

    Args:
        ratio: Estimate of the ratio.
        factor: Estimate of the factor, in any unit.
        covariance: Covariance of ratio and factor, shape (2, 2).

    Returns:
        Lower and upper end; infinite where the factor may be 0.

    References:
        E. C. Fieller, J. R. Stat. Soc. B 16 (1954) 175-185.

    >>> [round(end, 3) for end in ratio_interval(0.4, 2.0, np.array([[0.09, -0.45], [-0.45, 2.25]]))]
    [0.162, inf]
    >>> [round(end, 3) for end in ratio_interval(0.4, 2.0, np.diag([0.04, 0.0]))]
    [0.008, 0.792]
    """
    (ratio_variance, cross), (_, factor_variance) = covariance.tolist()
    with_product = factor * cross + ratio * factor_variance  # covariance of product and factor
    product_variance = factor**2 * ratio_variance + 2.0 * ratio * factor * cross + ratio**2 * factor_variance
    square = factor**2 - Z95**2 * factor_variance  # of g in the inequality square g^2 - 2 middle g + constant <= 0
    middle = ratio * factor**2 - Z95**2 * with_product
    constant = (ratio * factor) ** 2 - Z95**2 * product_variance
    root = math.sqrt(max(middle**2 - square * constant, 0.0))
    if square > 0.0:
        return (middle - root) / square, (middle + root) / square
    if constant <= 0.0:
        return -math.inf, math.inf
    return (constant / (middle + root), math.inf) if ratio > 0.0 else (-math.inf, constant / (middle - root))


MAX_DERIVATIVE = 1e100  # times the noise: its square is still a finite number


class StoppingRule(NamedTuple):
    """When a fit stops: after ``max_iterations``, or once one lowers the cost by less than the share ``tolerance``."""

    max_iterations: int
    tolerance: float


FULL_CONVERGENCE = StoppingRule(12, 1e-5)
NO_ITERATION = StoppingRule(0, 0.0)


@dataclass(frozen=True)
class Estimate:
    """One fitted parameter: value, standard error and 95 % interval in its own unit, and whether it lies at a bound.

    ``open_end`` is the end of the interval that is such a bound of the search and no limit of physics: beyond it the
    fit might go on.
    """

    name: str
    unit: str
    value: float
    error: float
    ci95: tuple[float, float]
    at_bound: bool
    open_end: Literal["lower", "upper"] | None = None

    @property
    def figure(self) -> Figure:
        """The value as answers state it: an open end is infinite, since the parameter is at least, or at most, that."""
        low, high = self.ci95
        ends = (-math.inf if self.open_end == "lower" else low, math.inf if self.open_end == "upper" else high)
        return Figure(self.value, *ends, self.unit)


@dataclass(frozen=True)
class Fit:
    """The fitted model, its parameters, and the arrays that tests on it need.

    ``residual`` (N,) and ``jacobian`` (N, k) are in units of the channels' noise and of the fit's coordinates.
    ``blocks`` (N,) labels the block of each residual. ``covariance`` (k, k) is that of the coordinates.
    ``initial_state_sensitivities`` holds one mapping a residual model. ``undetermined`` names the parameters
    that neither data nor priors determine, alone or together with others.
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
    undetermined: frozenset[str] = frozenset()

    @cached_property
    def curvature(self) -> Array:
        """The curvature of the data, shape (k, k)."""
        return np.asarray(self.jacobian.T @ self.jacobian)

    @cached_property
    def inverse_hessian(self) -> Array:
        """The inverse of the curvature of the data, shape (k, k)."""
        return pseudo_inverse(self.curvature)

    def inverse_hessian_holding(self, held: NDArray[np.bool_]) -> Array:
        """Return the inverse (k, k) where some parameters (k,) are held, 0 in their rows and columns."""
        if not held.any():
            return self.inverse_hessian
        out, moving = np.zeros_like(self.curvature), np.flatnonzero(~held)
        out[np.ix_(moving, moving)] = pseudo_inverse(self.curvature[np.ix_(moving, moving)])
        return out

    def with_derivatives(self, jacobian: Array) -> Fit:
        """Return the fit with the same derivatives (N, k) elsewhere in memory."""
        moved = replace(self, jacobian=jacobian)
        moved.__dict__["curvature"] = self.curvature
        return moved

    def project_out_nuisance(self, change: Array, inverse_hessian: Array | None = None) -> Array:
        """Project a change of the residuals on the complement of the free parameters.

        Args:
            change: Change of the residuals in units of noise, shape (N,).
            inverse_hessian: That of :meth:`inverse_hessian_holding`, where parameters are held; shape (k, k).

        Returns:
            The part of the change that no free parameter can reproduce to first order, shape (N,).

        References:
            Frisch, R. and Waugh, F. V., Econometrica 1 (1933) 387.

        """
        inverse = self.inverse_hessian if inverse_hessian is None else inverse_hessian
        return np.asarray(change - self.jacobian @ (inverse @ self.transposed_product(change)))

    def transposed_product(self, change: Array) -> Array:
        """Return J'c (k,) for a change c of the residuals (N,); most changes are 0 in most recordings."""
        changed = np.flatnonzero(change)
        rows = slice(changed[0], changed[-1] + 1) if changed.size else slice(0)
        return np.asarray(self.jacobian[rows].T @ change[rows])

    @cached_property
    def projected_residual(self) -> Array:
        """The residuals without the part that the free parameters could still absorb, shape (N,)."""
        return self.project_out_nuisance(self.residual)

    @cached_property
    def projected_scores(self) -> Array:
        """The derivatives times the projected residuals, summed by block, shape (B, k)."""
        return group_scores(self.jacobian, self.projected_residual, self.blocks)

    def __getitem__(self, name: str) -> Estimate:
        return next(e for e in self.estimates if e.name == name)


@dataclass(frozen=True)
class Start:
    """Derivatives at the start of a fit, which ``write`` writes to zeros (N, k).

    ``is_exact``: they are those at the start; else they are those of a similar model, except for the columns ``own``,
    which the fit evaluates. ``sensitivities`` are that model's to the initial states, one mapping a residual model.
    """

    write: Callable[[Array], None]
    sensitivities: Sequence[Mapping[str, Array]]
    is_exact: bool = True
    own: tuple[int, ...] = ()


def fit(
    model: Model,
    residual_models: Sequence[ResidualModel],
    free: Sequence[FreeParameter],
    *,
    stopping: StoppingRule = FULL_CONVERGENCE,
    start: Start | None = None,
    is_draft: bool = False,
) -> Fit:
    """Fit the free parameters from their start values by bounded least squares.

    Args:
        model: The model to start from.
        residual_models: The residual models whose squares are summed.
        free: The free parameters with start values, bounds and priors.
        stopping: When to stop.
        start: Derivatives at the start, where another fit has them.
        is_draft: Whether derivatives of a similar model suffice to the end; new ones are evaluated for the columns
            ``start.own`` alone. A draft has no covariance.

    Returns:
        The fit, with a covariance by blocks.

    """
    is_draft = is_draft and start is not None
    problem = LeastSquaresProblem(
        model, residual_models, free, start.sensitivities if start is not None and is_draft else None
    )
    if not free:
        residual = np.concatenate([*problem.data_residuals(model), problem.prior_residuals(np.zeros(0))])
        return _fit_summary(problem, np.zeros(0), residual, np.zeros((residual.size, 0)))
    derivatives = _Derivatives(problem, start, is_draft=is_draft)
    search = partial(
        minimise,
        problem.residuals,
        derivatives.evaluate,
        bounds=problem.bounds(),
        max_iterations=stopping.max_iterations,
        tolerance=stopping.tolerance,
        callback=iteration_callback([e.name for e in model.effects], problem.blocks().size),
        approximation=Approximation(
            derivatives.correct, start_is_exact=start is None or start.is_exact, suffices=is_draft
        )
        if any(one.is_simulated for one in residual_models)
        else None,
    )
    solution = search(problem.start, initial_jacobian=None if start is None else derivatives.array)
    if solution.stalled and not is_draft:  # an overlap may end at a held command: beyond it the valve is shut
        problem.backward = True
        solution = search(solution.z)
    curvature = None if is_draft else solution.curvature
    return _fit_summary(
        problem, solution.z, solution.residual, solution.jacobian, curvature, has_covariance=not is_draft
    )


class _Derivatives:
    """The derivatives (N + p, k) of a fit in one array, which may be most of the memory.

    Those at a ``start`` are written to it at once; a draft then evaluates the start's own columns alone.
    """

    def __init__(self, problem: LeastSquaresProblem, start: Start | None, *, is_draft: bool) -> None:
        self._problem = problem
        self._columns = start.own if start is not None and is_draft else None
        self._edges = [j for j, f in enumerate(problem.free) if f.step > DIFFERENCE_STEP]
        self.array = problem.zero_derivatives()
        if start is not None:
            start.write(self.array[: problem.data_size])
            self.array[problem.data_size :] = problem.prior_jacobian(problem.start)
            problem.evaluate_columns(problem.start, start.own, self.array)

    def evaluate(self, z: Array) -> Array:
        """Return the array with new derivatives at coordinates z (k,)."""
        if self._columns is None:
            return self._problem.jacobian(z, self.array)
        self._problem.evaluate_columns(z, self._columns, self.array)
        return self.array

    def correct(self, jacobian: Array, before: Array, after: Array, change: Array) -> None:
        """Correct derivatives by the change of the residuals over a step."""
        self._problem.correct_jacobian(jacobian, before, after, change)
        if self._edges:  # a step tells nothing of the next one where a residual is not smooth
            self._problem.evaluate_columns(after, self._edges, jacobian)


def _fit_summary(
    problem: LeastSquaresProblem,
    z: Array,
    residual: Array,
    jacobian: Array,
    curvature: Array | None = None,
    *,
    has_covariance: bool = True,
) -> Fit:
    """Return the fit that ends at coordinates z (k,); ``curvature`` is that of the derivatives where it is known."""
    blocks = problem.blocks()
    n = blocks.size
    if not problem.free:
        cost, none = float(residual @ residual), np.zeros((0, 0))
        return Fit(problem.model, (), (), residual[:n], jacobian[:n], blocks, none, cost, problem.errors)
    for column in jacobian.T:  # an overflow identifies nothing; zeros that are not written take no memory
        if not (column.min(initial=0.0) > -MAX_DERIVATIVE and column.max(initial=0.0) < MAX_DERIVATIVE):
            column[~(np.abs(column) < MAX_DERIVATIVE)], curvature = 0.0, None
    covariance, undetermined = np.zeros((z.size, z.size)), np.zeros(z.size, dtype=bool)
    if has_covariance:
        curvature = jacobian.T @ jacobian if curvature is None else curvature
        inverse_hessian, undetermined = pseudo_inverse(curvature), undetermined_coordinates(curvature)
        scores = group_scores(jacobian[:n], residual[:n], blocks)
        covariance = inverse_hessian @ (scores.T @ scores + jacobian[n:].T @ jacobian[n:]) @ inverse_hessian
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
        frozenset(f.name for f, is_open in zip(problem.free, undetermined, strict=True) if is_open),
    )


def parameter_estimates(free: Sequence[FreeParameter], model: Model, covariance: Array) -> tuple[Estimate, ...]:
    """Return value, standard error and 95 % interval of each free parameter of a fitted model.

    Args:
        free: The free parameters.
        model: The fitted model.
        covariance: Covariance of the fit's coordinates, shape (k, k).

    Returns:
        One estimate a parameter; the interval is symmetric in the fit's coordinate, but for a parameter that multiplies
        another one (:func:`ratio_interval`). It ends at the bounds.

    """
    estimates, slopes = [], np.array([f.derivative(parameter_value(model, f.name)) for f in free])
    for j, f in enumerate(free):
        value = parameter_value(model, f.name)
        z, error = f.to_coordinate(value), float(np.sqrt(max(covariance[j, j], 0.0)))
        ends = f.from_coordinate(z - Z95 * error), f.from_coordinate(z + Z95 * error)
        if (level := multiplied_level(f, free, model, covariance)) is not None:
            rows = np.vstack([np.eye(len(free))[j], level.weights]) * slopes
            ends = ratio_interval(value, level.value, rows @ covariance @ rows.T)
        low, high = max(ends[0], min(f.lower, value)), min(ends[1], max(f.upper, value))
        at_lower, at_upper = z - f.to_coordinate(f.lower) < 1e-6, f.to_coordinate(f.upper) - z < 1e-6
        is_open = at_lower and f.lower != 0.0 and not f.lower_is_limit, at_upper and not f.upper_is_limit
        open_end: Literal["lower", "upper"] | None = "lower" if is_open[0] else "upper" if is_open[1] else None
        deviation = error * f.derivative(value)
        estimates.append(Estimate(f.name, f.unit, value, deviation, (low, high), bool(at_lower or at_upper), open_end))
    return tuple(estimates)


class Level(NamedTuple):
    """What a ratio multiplies: the mean of parameters with ``weights`` (k,), and its value in their unit."""

    weights: Array
    value: float


def multiplied_level(
    ratio: FreeParameter, free: Sequence[FreeParameter], model: Model, covariance: Array
) -> Level | None:
    """Return the level that a ratio multiplies, as the data determine it best; None where it is none or not fitted.

    Args:
        ratio: The parameter.
        free: The free parameters of the fit.
        model: The fitted model.
        covariance: Covariance of the fit's coordinates, shape (k, k).

    Returns:
        The level, a mean of the fitted parameters that ``ratio`` multiplies.

    """
    columns = [j for name in ratio.multiplies for j, f in enumerate(free) if f.name == name]
    if not columns:
        return None
    values = np.array([parameter_value(model, free[j].name) for j in columns])
    slopes = np.array([free[j].derivative(v) for j, v in zip(columns, values, strict=True)])
    weights = np.zeros(len(free))
    weights[columns] = best_determined_mean(covariance[np.ix_(columns, columns)] * np.outer(slopes, slopes))
    return Level(weights, float(weights[columns] @ values))


def without_data(found: Fit) -> Fit:
    """Drop residuals and derivatives from a fit; those of a long recording fill the memory.

    Args:
        found: The fit.

    Returns:
        The fit with its model, parameters and covariance alone.

    """
    none = np.zeros((0, len(found.free)))
    return replace(
        found, residual=np.zeros(0), jacobian=none, blocks=np.zeros(0, dtype=np.int64), initial_state_sensitivities=()
    )


def merge_partial_fit(
    found: Fit, part: Fit, residual_models: Sequence[ResidualModel], chosen: NDArray[np.bool_]
) -> Fit:
    """Merge a fit of the chosen residual models into a fit of all.

    The result equals a joint fit where no parameter of the part changes another residual model, and no parameter of the
    others changes the part.

    Args:
        found: The fit of all residual models.
        part: The fit of the chosen ones.
        residual_models: All residual models.
        chosen: Which of them the part was fitted to, shape (models,).

    Returns:
        The fit of all residual models; those that were not chosen keep their residuals.

    """
    new = {f.name: f for f in part.free}
    free = [new.pop(f.name, f) for f in found.free] + list(new.values())
    rows = residual_slices(residual_models)
    own_rows = [part_rows for part_rows, is_chosen in zip(rows, chosen, strict=True) if is_chosen]
    part_rows = residual_slices([one for one, is_chosen in zip(residual_models, chosen, strict=True) if is_chosen])
    errors = iter(part.initial_state_sensitivities)
    sensitivities = [
        next(errors) if new else old for old, new in zip(found.initial_state_sensitivities, chosen, strict=True)
    ]
    problem = LeastSquaresProblem(part.model, residual_models, free, sensitivities)
    z = np.array([f.to_coordinate(parameter_value(part.model, f.name)) for f in free])
    residual = np.concatenate([found.residual, problem.prior_residuals(z)])
    jacobian = problem.zero_derivatives()
    jacobian[found.residual.size :] = problem.prior_jacobian(z)
    for to, source in zip(own_rows, part_rows, strict=True):
        residual[to] = part.residual[source]
    own, former = [f.name for f in part.free], [f.name for f in found.free]
    for j, f in enumerate(free):
        if f.name in own:
            copy_nonzero(part.jacobian[:, own.index(f.name)], part_rows, jacobian[:, j], own_rows)
        else:
            copy_nonzero(found.jacobian[:, former.index(f.name)], rows, jacobian[:, j], rows)
    return replace(_fit_summary(problem, z, residual, jacobian), blocks=found.blocks)  # one array for all candidates
