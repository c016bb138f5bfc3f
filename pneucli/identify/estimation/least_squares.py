"""Bounded least squares by Levenberg and Marquardt's method on the normal equations.

scipy's ``least_squares`` factorises the whole Jacobian (N, k) in every round; with N = 1e5 residuals and k = 20
parameters that costs as much as the simulations. Here only k by k matrices are solved. Source: D. W. Marquardt,
J. SIAM 11 (1963) 431; bounds by projection, parameters that press against one are held.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

INITIAL_DAMPING = 1e-3
MAX_DAMPING = 1e8
MAX_DAMPING_TRIES = 8  # of one direction, with ever more damping
MAX_DECREASE_FOR_REUSE = 0.01  # of the sum: after a step that lowers it by less derivatives have hardly changed
MIN_EXTENSION_RATIO = 1.5  # times the promised fall: a step that gains more was too short
MAX_STEP_DOUBLINGS = 6  # of such a step
MIN_GAIN_RATIO = 0.25  # of the promised fall: a step that gains less asks for derivatives anew (usual in trust regions)


class NormalEquations(NamedTuple):
    """What is to be solved of residuals r and derivatives J, where J would fill the memory: J'r (k,), J'J (k, k)."""

    gradient: Array
    curvature: Array


J = TypeVar("J", Array, NormalEquations)


@dataclass(frozen=True)
class Solution(Generic[J]):
    """Where the search ended: z (k,), residuals (N,), their derivatives (N, k), and the rounds it took."""

    z: Array
    residual: Array
    jacobian: J
    iterations: int


class Step(NamedTuple):
    """A step that lowers the sum: where it leads, the residuals there, the next damping, and whether the sum fell as
    far as the derivatives promised.
    """

    z: Array
    residual: Array
    damping: float
    as_predicted: bool


def minimise(
    residuals: Callable[[Array], Array],
    jacobian: Callable[[Array], J],
    start: Array,
    bounds: tuple[Array, Array],
    *,
    max_iterations: int,
    tolerance: float,
    callback: Callable[[float], None] = lambda cost: None,
    initial_jacobian: J | None = None,
) -> Solution[J]:
    """Minimise the sum of squares from ``start`` (k,) within ``bounds``.

    ``jacobian`` returns the derivatives (N, k) of the residuals, or the normal equations; ``initial_jacobian`` are those at the
    start where they are known. Ends when the first step with new derivatives lowers the sum by less than ``tolerance``
    of it (the derivatives stay those before that step), or after ``max_iterations`` of them; ``callback`` is told the sum, at
    the start and then. Near the end, where steps are short, derivatives serve for more than one.
    """
    z, damping = np.clip(start, *bounds), INITIAL_DAMPING
    r, j = residuals(z), jacobian(z) if initial_jacobian is None else initial_jacobian
    callback(_sum_of_squares(r))
    for done in range(1, max_iterations + 1):
        new, fall = True, np.inf
        while (step := _step(residuals, z, r, j, bounds, damping, MAX_DAMPING_TRIES if new else 1)) is not None:
            fall = 1.0 - _sum_of_squares(step.residual) / _sum_of_squares(r)
            z, r, damping = step.z, step.residual, step.damping
            if fall < tolerance or fall > MAX_DECREASE_FOR_REUSE or not step.as_predicted:
                break
            new = False
        callback(_sum_of_squares(r))
        if new and (step is None or fall < tolerance):
            return Solution(z, r, j, done)
        del j  # before the next one is made: it is what most memory goes into
        j = jacobian(z)
    return Solution(z, r, j, max_iterations)


def _step(
    residuals: Callable[[Array], Array],
    z: Array,
    r: Array,
    j: Array | NormalEquations,
    bounds: tuple[Array, Array],
    damping: float,
    tries: int,
) -> Step | None:
    """Return the next step, None where none of so many ``tries``, with ever more damping, lowers the sum."""
    gradient, curvature = j if isinstance(j, NormalEquations) else normal_equations(r, j)
    told = np.isfinite(gradient) & np.isfinite(curvature.diagonal()) & (curvature.diagonal() > 0)
    held = ((z <= bounds[0]) & (gradient > 0)) | ((z >= bounds[1]) & (gradient < 0)) | ~told
    free = np.flatnonzero(~held)
    if not free.size:
        return None
    cost, inner, g = _sum_of_squares(r), curvature[np.ix_(free, free)], gradient[free]
    for _ in range(tries):
        moved = z.copy()
        moved[free] -= np.linalg.lstsq(inner + damping * np.diag(np.diag(inner)), g, rcond=1e-14)[0]
        moved = np.clip(moved, *bounds)
        tried = residuals(moved)
        if _sum_of_squares(tried) < cost:
            step = (moved - z)[free]
            promised = -float(2.0 * g @ step + step @ inner @ step)
            if cost - _sum_of_squares(tried) > MIN_EXTENSION_RATIO * promised:
                moved, tried = _extend_step(residuals, z, moved, tried, bounds)
            return Step(
                moved, tried, max(damping / 9.0, 1e-9), cost - _sum_of_squares(tried) > MIN_GAIN_RATIO * promised
            )
        damping = max(damping * 8.0, 1e-4)
        if damping > MAX_DAMPING:
            break
    return None


def normal_equations(residual: Array, jacobian: Array) -> NormalEquations:
    """Return the normal equations of residuals (N,) and their derivatives (N, k)."""
    with np.errstate(over="ignore", invalid="ignore"):  # a model that runs away has no derivatives
        return NormalEquations(jacobian.T @ residual, jacobian.T @ jacobian)


def pseudo_inverse(curvature: Array) -> Array:
    """Return the inverse of a curvature (k, k), 0 for what is not told; whatever the sizes of the coordinates."""
    size = np.sqrt(curvature.diagonal())
    size = np.where(size > 0.0, size, 1.0)
    scaled = curvature / size[:, None] / size
    return np.asarray(np.linalg.pinv(scaled, hermitian=True) / size[:, None] / size)


def _sum_of_squares(residual: Array) -> float:
    """Return the sum of squares; infinite for a model that runs away."""
    with np.errstate(over="ignore", invalid="ignore"):
        cost = float(residual @ residual)
    return cost if np.isfinite(cost) else np.inf


def _extend_step(
    residuals: Callable[[Array], Array], z: Array, moved: Array, tried: Array, bounds: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Return where a step from z to ``moved``, doubled as long as the sum falls, leads, and the residuals there.

    Noise in the derivatives adds to the curvature and makes steps too short: the sum tells.
    """
    for _ in range(MAX_STEP_DOUBLINGS):
        beyond = np.clip(2.0 * moved - z, *bounds)
        more = residuals(beyond)
        if not _sum_of_squares(more) < _sum_of_squares(tried):
            break
        moved, tried = beyond, more
    return moved, tried
