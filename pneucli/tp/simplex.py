"""Simplices that enclose a cloud of points, as barycentric coordinates.

A simplex in d dimensions is held by the ``(d + 1, d + 1)`` matrix M with ``[Y 1] M = B``: B are the barycentric
coordinates of the points Y, shape ``(n, d)``; its rows sum to 1, and it is non-negative where the simplex encloses Y.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import LinearConstraint, minimize
from scipy.spatial import ConvexHull

Array = NDArray[np.float64]

_ROUNDING = 1e-13
_STARTS = 16  # measured: the smallest simplex of the two-parameter friction case is found from most of them
_HULL_DIMENSIONS = 5  # beyond, the hull costs more than it saves


@dataclass(frozen=True)
class AffineFrame:
    """The rows of a basis in coordinates of their own affine hull: ``basis = [points 1] @ back``.

    ``points``: shape ``(n, d)``, centred and white. ``back``: shape ``(d + 1, r)``.
    """

    points: Array
    back: Array


def affine_frame(basis: Array, values: Array, tolerance: float) -> AffineFrame:
    """Place the rows of ``basis`` (n, r), whose columns weigh ``values`` (r,), in their affine hull.

    Directions that carry less than ``tolerance`` of the first singular value, or that rounding hides, are left out:
    d = r - 1 where the constant lies in the span of the columns, else d = r.
    """
    safe = np.where(values > 0, values, 1.0)
    rows = basis * safe
    mean = rows.mean(axis=0)
    left, spread, right = np.linalg.svd(rows - mean, full_matrices=False)
    d = int(np.count_nonzero(spread > max(tolerance, _ROUNDING) * safe[0]))
    unit = np.sqrt(len(basis))
    back = np.vstack((spread[:d, None] * right[:d] / unit, mean)) / safe
    return AffineFrame(left[:, :d] * unit, back)


def homogeneous(points: Array) -> Array:
    """Append a column of ones."""
    return np.asarray(np.column_stack((points, np.ones(len(points)))), dtype=np.float64)


def tighten(h: Array, simplex: Array) -> Array:
    """Return the smallest homothetic simplex around the points ``h = [Y 1]``: every coordinate's minimum becomes 0."""
    least = (h @ simplex).min(axis=0)
    moved = simplex.copy()
    moved[-1] -= least
    return moved / float(1.0 - least.sum())


def regular_simplex(h: Array) -> Array:
    """Enclose the points by the simplex of one facet across each axis and one across their diagonal."""
    d = h.shape[1] - 1
    corners = np.vstack((np.eye(d), np.full(d, -1.0)))
    return tighten(h, _inverse(homogeneous(corners)))


def spanned_simplex(h: Array, first: int | None = None) -> Array:
    """Return the simplex of d + 1 of the points, chosen greedily for volume: each the farthest from those before.

    Starts at point ``first``, or at the one farthest from the mean. It need not enclose the others.
    """
    points = h[:, :-1]
    start = int(np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1))) if first is None else first
    chosen, rest = [start], points - points[start]
    for _ in range(points.shape[1]):
        length = np.linalg.norm(rest, axis=1)
        chosen.append(int(np.argmax(length)))
        direction = rest[chosen[-1]] / length[chosen[-1]]
        rest = rest - np.outer(rest @ direction, direction)
    return _inverse(h[chosen])


def smallest_simplices(h: Array) -> list[Array]:
    """Return locally smallest enclosing simplices, the smallest first.

    Maximises log abs det of the facets' gradients, the reciprocal volume, subject to non-negative coordinates, from
    several starts; it is not concave, so the first is the best found, not proven smallest.
    """
    extreme = h[_hull(h[:, :-1])]
    found = [_maximise(_reciprocal_volume, start, extreme) for start in _initial_simplices(extreme)]
    return sorted((tighten(h, m) for m in found), key=lambda m: -log_reciprocal_volume(m))


def log_reciprocal_volume(simplex: Array) -> float:
    """Return -log(d! volume)."""
    return float(np.linalg.slogdet(simplex[:-1, :-1])[1])


def closest_simplex(h: Array) -> Array:
    """Return the enclosing simplex that minimises the sum over vertices of -log(max coordinate): CNO.

    With the point nearest each vertex held fixed the problem is convex; points and simplex are improved in turn, from
    every locally smallest simplex.
    """
    extreme = h[_hull(h[:, :-1])]
    found = [tighten(h, _alternate_minimisation(start, extreme)) for start in _distinct_volumes(smallest_simplices(h))]
    return min(found, key=lambda m: distance_to_vertices(h @ m))


def distance_to_vertices(weights: Array) -> float:
    """Return the sum over columns of abs(log max): 0 where every vertex is reached."""
    return float(np.abs(np.log(weights.max(axis=0))).sum())


def equal_maxima_simplex(h: Array) -> Array | None:
    """Return the enclosing simplex whose coordinates all range from 0 to one common maximum: IRNO.

    Not unique: the largest maximum found, from every locally smallest simplex. None where no start converges.
    """
    found = [m for start in _distinct_volumes(smallest_simplices(h)) if (m := _equalise_maxima(h, start)) is not None]
    return max(found, key=lambda m: float((h @ m).max()), default=None)


def _equalise_maxima(h: Array, simplex: Array, iterations: int = 500) -> Array | None:
    gradients = simplex[:-1]
    for _ in range(iterations):
        gradients = gradients / np.ptp(h[:, :-1] @ gradients, axis=0)
        gradients = gradients - gradients.mean(axis=1, keepdims=True)
        if np.ptp(np.ptp(h[:, :-1] @ gradients, axis=0)) < 1e-13:
            least = (h[:, :-1] @ gradients).min(axis=0)
            functions = np.concatenate((gradients, -least[None, :]))
            return functions / float(-least.sum())
    return None


def _alternate_minimisation(simplex: Array, extreme: Array) -> Array:
    """Improve the simplex and the points nearest its vertices in turn, until these stay."""
    for _ in range(20):
        nearest = extreme[np.argmax(extreme @ simplex, axis=0)]
        better = _maximise(partial(_closeness, nearest), simplex, extreme)
        gain = distance_to_vertices(extreme @ simplex) - distance_to_vertices(extreme @ better)
        if gain < 1e-9:
            return simplex
        simplex = better
    return simplex


Objective = Callable[[Array], tuple[float, Array]]


def _reciprocal_volume(simplex: Array) -> tuple[float, Array]:
    gradients = simplex[:-1, :-1]
    slope = np.zeros_like(simplex)
    slope[:-1, :-1] = _inverse(gradients).T
    return float(np.linalg.slogdet(gradients)[1]), slope


def _closeness(nearest: Array, simplex: Array) -> tuple[float, Array]:
    """Sum of log coordinates, each at the point that is nearest its vertex."""
    at = np.einsum("ij,ji->i", nearest, simplex)
    return float(np.log(np.maximum(at, 1e-300)).sum()), (nearest / at[:, None]).T


def _maximise(objective: Objective, start: Array, h: Array) -> Array:
    """Maximise over simplices that enclose ``h``, from one that does; the last column follows from the others.

    All points stay constraints throughout: adding them only as they are violated was measured, and is slower.
    """
    d = h.shape[1] - 1
    dependent = np.column_stack((np.eye(d), -np.ones(d)))

    def whole(free: Array) -> Array:
        simplex: Array = free.reshape(d + 1, d) @ dependent
        simplex[-1, -1] += 1.0
        return simplex

    def cost(free: Array) -> float:
        return -objective(whole(free))[0]

    def slope(free: Array) -> Array:
        return -np.asarray(objective(whole(free))[1] @ dependent.T).ravel()

    constant = np.tile(np.eye(d + 1)[-1], len(h))
    enclosing = LinearConstraint(np.kron(h, dependent.T), lb=-constant)
    free = start[:, :d].ravel()
    best = minimize(
        cost, free, jac=slope, method="SLSQP", constraints=enclosing, options={"ftol": 1e-12, "maxiter": 200}
    )
    return tighten(h, whole(best.x))


def _initial_simplices(h: Array) -> list[Array]:
    """Enclosing simplices, from spanned ones; stirred, since those of symmetric points may be saddles.

    The stirring mixes coordinates of the simplex, not of the points, so turning the points changes nothing.
    """
    rng = np.random.default_rng(0)
    picks = np.unique(np.linspace(0, len(h) - 1, min(_STARTS, len(h))).round().astype(int))
    d = h.shape[1] - 1
    starts = []
    for spanned in _distinct_volumes([spanned_simplex(h, int(i)) for i in picks]):
        free = spanned[:, :d] @ (np.eye(d) + 0.1 * rng.standard_normal((d, d)))
        last = np.eye(d + 1)[-1] - free.sum(axis=1)
        starts.append(tighten(h, np.concatenate((free, last[:, None]), axis=1)))
    return starts


def _distinct_volumes(simplices: list[Array]) -> list[Array]:
    """Drop those of the same volume as one before."""
    volumes = [round(log_reciprocal_volume(m), 6) for m in simplices]
    return [m for i, m in enumerate(simplices) if volumes[i] not in volumes[:i]]


def _inverse(matrix: Array) -> Array:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def _hull(points: Array) -> NDArray[np.intp]:
    if points.shape[1] > _HULL_DIMENSIONS:
        return np.unique(points.round(12), axis=0, return_index=True)[1]
    return np.asarray(ConvexHull(points).vertices, dtype=np.intp)
