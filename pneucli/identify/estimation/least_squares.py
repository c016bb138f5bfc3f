"""Bounded least squares by the Levenberg-Marquardt method on the normal equations.

scipy's ``least_squares`` factorises the whole Jacobian (N, k) in every iteration; with N = 1e5 residuals and k = 20
parameters that costs as much as the simulations. This solver factorises k by k matrices only. Bounds act by projection;
a parameter whose gradient points across its bound is fixed for that step.

References:
    Marquardt, D. W., J. SIAM 11 (1963) 431.

"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array

INITIAL_DAMPING = 1e-3
MAX_DAMPING = 1e8
MAX_DAMPING_TRIES = 8  # increases of the damping before the search gives up
MAX_APPROXIMATE_STEPS = 8  # with corrected derivatives, then new ones are evaluated
MAX_DECREASE_FOR_REUSE = 0.01  # of the cost: after a smaller decrease the derivatives have hardly changed
MIN_EXTENSION_RATIO = 1.5  # times the predicted decrease: a step that gains more was too short
MAX_STEP_DOUBLINGS = 6  # of a step that was too short
MIN_RELATIVE_CURVATURE = 1e-15  # of the largest: rounding makes as much
MIN_COMPONENT = 1e-6  # of a unit direction, by which it changes a coordinate
MIN_GAIN_RATIO = 0.25  # of the predicted decrease, as in trust regions: a step that gains less asks for new derivatives


@dataclass(frozen=True)
class Approximation:
    """How derivatives are corrected without a new evaluation.

    ``correct`` changes derivatives in place by a step, given by its start and its end, and by the change of the
    residuals over it. ``start_is_exact``: the initial derivatives are those at the start. ``suffices``: the search may
    end with corrected derivatives.
    """

    correct: Callable[[Array, Array, Array, Array], None]
    start_is_exact: bool = True
    suffices: bool = False


@dataclass(frozen=True)
class Solution:
    """The end of a search: coordinates z (k,), residuals (N,), derivatives (N, k), and the number of iterations.

    ``curvature`` (k, k) is that of the derivatives. ``stalled``: no step lowered the cost though the derivatives
    promise more than the tolerance. They are of one side, and the search may have met a kink.
    """

    z: Array
    residual: Array
    jacobian: Array
    curvature: Array
    iterations: int
    stalled: bool = False


class _Derivatives:
    """Derivatives, and their curvature from the first time that it is asked for: it costs more than a simulation."""

    def __init__(self, jacobian: Array) -> None:
        self.jacobian = jacobian
        self._curvature: Array | None = None

    def changed(self) -> None:
        """Forget the curvature, since the derivatives were changed in place."""
        self._curvature = None

    @property
    def curvature(self) -> Array:
        """The curvature J'J, shape (k, k); not finite where the model diverges."""
        if self._curvature is None:
            with np.errstate(over="ignore", invalid="ignore"):  # a diverging model has no derivatives
                self._curvature = np.asarray(self.jacobian.T @ self.jacobian)
        return self._curvature

    def gradient(self, residual: Array) -> Array:
        """Return the gradient J'r with residuals (N,), shape (k,); not finite where the model diverges."""
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(self.jacobian.T @ residual)


class Step(NamedTuple):
    """A step that lowers the cost: new coordinates, residuals there, next damping, and whether the cost fell as far
    as the derivatives predicted.
    """

    z: Array
    residual: Array
    damping: float
    as_predicted: bool


def minimise(
    residuals: Callable[[Array], Array],
    jacobian: Callable[[Array], Array],
    start: Array,
    bounds: tuple[Array, Array],
    *,
    max_iterations: int,
    tolerance: float,
    callback: Callable[[float], None] = lambda cost: None,
    initial_jacobian: Array | None = None,
    approximation: Approximation | None = None,
) -> Solution:
    """Minimise a sum of squares within bounds.

    Derivatives serve for more than one step while the steps gain as predicted: near the minimum, or, with an
    ``approximation``, everywhere. The search ends where a step with new derivatives gains little.

    Args:
        residuals: Function of the coordinates (k,) to the residuals (N,).
        jacobian: Function of the coordinates to the derivatives (N, k).
        start: Coordinates to start from, shape (k,).
        bounds: Lower and upper bounds, each of shape (k,).
        max_iterations: Largest number of evaluations of ``jacobian``.
        tolerance: Relative decrease of the cost below which a step with new derivatives ends the search.
        callback: Function that receives the cost at the start and after each iteration.
        initial_jacobian: The derivatives at the start, where they are available.
        approximation: How derivatives are corrected without a new evaluation.

    Returns:
        The solution; its derivatives are those from which the last step was taken.

    References:
        D. W. Marquardt, J. SIAM 11 (1963) 431-441.

    >>> line = lambda z: np.array([z[0] - 1.0, 2.0 * (z[0] - 1.0)])
    >>> slope = lambda z: np.array([[1.0], [2.0]])
    >>> bounds = np.array([2.0]), np.array([9.0])
    >>> minimise(line, slope, np.array([5.0]), bounds, max_iterations=9, tolerance=1e-9).z.tolist()
    [2.0]
    """
    z, damping = np.clip(start, *bounds), INITIAL_DAMPING
    r, j = residuals(z), _Derivatives(jacobian(z) if initial_jacobian is None else initial_jacobian)
    is_new = initial_jacobian is None or approximation is None or approximation.start_is_exact
    callback(_sum_of_squares(r))
    for done in range(1, max_iterations + 1):
        step, decrease, steps = None, np.inf, 0
        tries = MAX_DAMPING_TRIES if is_new or (approximation is not None and approximation.suffices) else 1
        while (step := _step(residuals, z, r, j, bounds, damping, tries, tolerance)) is not None:
            decrease = 1.0 - _sum_of_squares(step.residual) / _sum_of_squares(r)
            before, change = z, step.residual - r
            z, r, damping, steps = step.z, step.residual, step.damping, steps + 1
            if decrease < tolerance or not step.as_predicted:
                break
            if approximation is not None and steps < MAX_APPROXIMATE_STEPS:
                approximation.correct(j.jacobian, before, z, change)
                j.changed()
            elif decrease > MAX_DECREASE_FOR_REUSE:
                break
            is_new, tries = False, 1
        callback(_sum_of_squares(r))
        is_settled = step is None or decrease < tolerance
        if is_settled and (is_new or (approximation is not None and approximation.suffices)):
            stalled = _promised_decrease(z, r, j, bounds) > tolerance * _sum_of_squares(r)
            return Solution(z, r, j.jacobian, j.curvature, done, stalled)
        del j  # frees the largest array before the next one is allocated
        j, is_new = _Derivatives(jacobian(z)), True
    return Solution(z, r, j.jacobian, j.curvature, max_iterations)


def _step(
    residuals: Callable[[Array], Array],
    z: Array,
    r: Array,
    j: _Derivatives,
    bounds: tuple[Array, Array],
    damping: float,
    tries: int,
    tolerance: float,
) -> Step | None:
    """Return the next step; None where ``tries`` increases of the damping find no lower cost.

    Where the derivatives promise less than the ``tolerance`` for a step, no shorter one is tried: it would end the
    search even if it gained that.
    """
    free, g, free_curvature, room = _free_equations(z, r, j, bounds)
    if not free.size:
        return None
    cost = _sum_of_squares(r)
    if _promised(g, free_curvature, room) < tolerance * cost:
        tries = 1
    for done in range(tries):
        trial = z.copy()
        trial[free] += bounded_step(free_curvature + damping * np.diag(np.diag(free_curvature)), g, room)
        trial = np.clip(trial, *bounds)
        step = (trial - z)[free]
        predicted_decrease = -float(2.0 * g @ step + step @ free_curvature @ step)
        if done > 0 and predicted_decrease < tolerance * cost:
            break
        trial_residual = residuals(trial)
        if _sum_of_squares(trial_residual) < cost:
            if cost - _sum_of_squares(trial_residual) > MIN_EXTENSION_RATIO * predicted_decrease:
                trial, trial_residual = _extend_step(residuals, z, trial, trial_residual, bounds)
            return Step(
                trial,
                trial_residual,
                max(damping / 9.0, 1e-9),
                cost - _sum_of_squares(trial_residual) > MIN_GAIN_RATIO * predicted_decrease,
            )
        damping = max(damping * 8.0, 1e-4)
        if damping > MAX_DAMPING:
            break
    return None


def _free_equations(
    z: Array, r: Array, j: _Derivatives, bounds: tuple[Array, Array]
) -> tuple[NDArray[np.intp], Array, Array, tuple[Array, Array]]:
    """Return which coordinates may move, (f,), their gradient and curvature, and the room to their bounds."""
    gradient, curvature = j.gradient(r), j.curvature
    is_determined = np.isfinite(gradient) & np.isfinite(curvature.diagonal()) & (curvature.diagonal() > 0)
    is_fixed = ((z <= bounds[0]) & (gradient > 0)) | ((z >= bounds[1]) & (gradient < 0)) | ~is_determined
    free = np.flatnonzero(~is_fixed)
    room = bounds[0][free] - z[free], bounds[1][free] - z[free]
    return free, gradient[free], curvature[np.ix_(free, free)], room


def _promised_decrease(z: Array, r: Array, j: _Derivatives, bounds: tuple[Array, Array]) -> float:
    """Return the decrease of the cost that the derivatives promise for a step without damping."""
    free, gradient, curvature, room = _free_equations(z, r, j, bounds)
    return _promised(gradient, curvature, room) if free.size else 0.0


def _promised(gradient: Array, curvature: Array, room: tuple[Array, Array]) -> float:
    step = bounded_step(curvature, gradient, room)
    return -float(2.0 * gradient @ step + step @ curvature @ step)


def bounded_step(curvature: Array, gradient: Array, room: tuple[Array, Array]) -> Array:
    """Return the Newton step within bounds: what reaches one first stops there, and the others are solved for anew.

    If it were cut off alone, the others would still expect all of it, and the step might gain nothing.

    Args:
        curvature: Curvature, shape (k, k).
        gradient: Gradient, shape (k,).
        room: Least and largest step, each (k,), the first at most 0 and the second at least 0.

    Returns:
        The step, shape (k,).

    References:
        D. P. Bertsekas, SIAM J. Control Optim. 20 (1982) 221-246.

    >>> curvature = np.array([[2.0, 1.9], [1.9, 2.0]])
    >>> bounded_step(curvature, np.array([-2.0, 0.0]), (np.full(2, -1.0), np.full(2, 1.0))).tolist()
    [1.0, -0.95]
    """
    step, inside = np.zeros(gradient.size), np.ones(gradient.size, dtype=bool)
    while inside.any():
        right = gradient[inside] + curvature[np.ix_(inside, ~inside)] @ step[~inside]
        wanted = -np.linalg.lstsq(curvature[np.ix_(inside, inside)], right, rcond=1e-14)[0]
        limits = np.where(wanted < 0.0, room[0][inside], room[1][inside])
        way = np.divide(limits, wanted, out=np.full(wanted.size, np.inf), where=wanted != 0.0)
        first = int(np.argmin(way))
        if way[first] >= 1.0:
            step[inside] = wanted
            break
        place = np.flatnonzero(inside)[first]
        step[place], inside[place] = limits[first], False
    return step


def pseudo_inverse(curvature: Array) -> Array:
    """Invert a curvature whose coordinates may have very different scales.

    Args:
        curvature: The curvature, shape (k, k).

    Returns:
        The inverse in reciprocal units, shape (k, k); 0 along directions that the curvature does not determine.

    >>> pseudo_inverse(np.array([[4.0, 0.0], [0.0, 0.0]])).tolist()
    [[0.25, 0.0], [0.0, 0.0]]

    """
    scaled, size = _with_unit_diagonal(curvature)
    inverse = np.linalg.pinv(scaled, rcond=MIN_RELATIVE_CURVATURE, hermitian=True)
    return np.asarray(inverse / size[:, None] / size)


def undetermined_coordinates(curvature: Array) -> NDArray[np.bool_]:
    """Return the coordinates that a curvature does not determine, alone or together with others.

    Args:
        curvature: The curvature in any units, shape (k, k).

    Returns:
        True where a direction along which :func:`pseudo_inverse` is 0 changes the coordinate, shape (k,).

    >>> undetermined_coordinates(np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])).tolist()
    [True, True, False]

    """
    values, vectors = np.linalg.eigh(_with_unit_diagonal(curvature)[0])
    free = vectors[:, np.abs(values) <= MIN_RELATIVE_CURVATURE * np.max(np.abs(values))]
    return np.asarray(np.any(np.abs(free) > MIN_COMPONENT, axis=1))


def _with_unit_diagonal(curvature: Array) -> tuple[Array, Array]:
    """Return a curvature (k, k) in scales of its own, and these scales (k,)."""
    size = np.sqrt(curvature.diagonal())
    size = np.where(size > 0.0, size, 1.0)
    return curvature / size[:, None] / size, size


def _sum_of_squares(residual: Array) -> float:
    """Return the sum of squares; infinite for a diverging model."""
    with np.errstate(over="ignore", invalid="ignore"):
        cost = float(residual @ residual)
    return cost if np.isfinite(cost) else np.inf


def _extend_step(
    residuals: Callable[[Array], Array], z: Array, trial: Array, trial_residual: Array, bounds: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Double a step for as long as the cost falls; return its end and the residuals there.

    Noise in the derivatives adds to the curvature and makes steps too short.
    """
    for _ in range(MAX_STEP_DOUBLINGS):
        longer = np.clip(2.0 * trial - z, *bounds)
        longer_residual = residuals(longer)
        if not _sum_of_squares(longer_residual) < _sum_of_squares(trial_residual):
            break
        trial, trial_residual = longer, longer_residual
    return trial, trial_residual
