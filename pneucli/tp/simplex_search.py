"""Search for enclosing simplices that are optimal: the smallest, the closest to the points, with equal maxima.

Source of the types: thesis (4.6); P. Baranyi, IEEE Trans. Ind. Electron. 51 (2004) 387-400.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pneucli.tp.simplex import (
    distance_to_vertices,
    inverse,
    log_reciprocal_volume,
    spanned_simplex,
    tighten,
)

Array = NDArray[np.float64]
Objective = Callable[[Array], tuple[float, Array]]

_STARTS = 16  # measured: the smallest simplex of the two-parameter friction case is found from most of them
_HULL_DIMENSIONS = 5  # beyond, the hull costs more than it saves


def smallest_simplices(h: Array) -> list[Array]:
    """Return locally smallest enclosing simplices, the smallest first.

    The log of the reciprocal volume is maximised from several starts, subject to non-negative coordinates. It is not
    concave: the first simplex is the best that was found, not proven smallest.

    Args:
        h: Points in homogeneous coordinates, shape (n, d + 1).

    Returns:
        Simplices, each of shape (d + 1, d + 1).

    References:
        T.-H. Chan, C.-Y. Chi, Y.-M. Huang, W.-K. Ma, IEEE Trans. Signal Process. 57 (2009) 4418-4432.

    >>> from pneucli.tp.simplex import homogeneous
    >>> h = homogeneous(np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [0.5, 0.5]]))
    >>> bool(np.isclose(log_reciprocal_volume(smallest_simplices(h)[0]), -np.log(4.0)))
    True
    """
    extreme = h[_hull(h[:, :-1])]
    found = [_maximise(_reciprocal_volume, start, extreme) for start in _initial_simplices(extreme)]
    return sorted((tighten(h, m) for m in found), key=lambda m: -log_reciprocal_volume(m))


def closest_simplex(h: Array) -> Array:
    """Return the enclosing simplex whose vertices are closest to the points (CNO).

    It minimises the sum over vertices of -log(max coordinate). With the point nearest each vertex held fixed the
    problem is convex; points and simplex are improved in turn, from every locally smallest simplex.

    Args:
        h: Points in homogeneous coordinates, shape (n, d + 1).

    Returns:
        The simplex, shape (d + 1, d + 1), dimensionless.

    >>> from pneucli.tp.simplex import homogeneous
    >>> h = homogeneous(np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [0.5, 0.5]]))
    >>> (h @ closest_simplex(h)).max(axis=0).round(6)
    array([1., 1., 1.])
    """
    extreme = h[_hull(h[:, :-1])]
    found = [tighten(h, _alternate_minimisation(start, extreme)) for start in _distinct_volumes(smallest_simplices(h))]
    return min(found, key=lambda m: distance_to_vertices(h @ m))


def equal_maxima_simplex(h: Array) -> Array | None:
    """Return an enclosing simplex whose coordinates all range from 0 to a common maximum (IRNO).

    It is not unique: the one with the largest maximum is returned, of all locally smallest simplices as starts.

    Args:
        h: Points in homogeneous coordinates, shape (n, d + 1).

    Returns:
        The simplex, shape (d + 1, d + 1), dimensionless; None where no start converges.

    >>> angle = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    >>> from pneucli.tp.simplex import homogeneous
    >>> h = homogeneous(np.column_stack([np.cos(angle), np.sin(angle)]))
    >>> maxima = (h @ equal_maxima_simplex(h)).max(axis=0)
    >>> bool(np.ptp(maxima) < 1e-9)
    True
    """
    found = [m for start in _distinct_volumes(smallest_simplices(h)) if (m := _equalise_maxima(h, start)) is not None]
    return max(found, key=lambda m: float((h @ m).max()), default=None)


def _equalise_maxima(h: Array, simplex: Array, iterations: int = 500) -> Array | None:
    gradients = simplex[:-1]
    for _ in range(iterations):
        gradients = gradients / np.ptp(h[:, :-1] @ gradients, axis=0)
        gradients = gradients - gradients.mean(axis=1, keepdims=True)
        if np.ptp(np.ptp(h[:, :-1] @ gradients, axis=0)) < 1e-13:
            minima = (h[:, :-1] @ gradients).min(axis=0)
            functions = np.concatenate((gradients, -minima[None, :]))
            return functions / float(-minima.sum())
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


def _reciprocal_volume(simplex: Array) -> tuple[float, Array]:
    gradients = simplex[:-1, :-1]
    slope = np.zeros_like(simplex)
    slope[:-1, :-1] = inverse(gradients).T
    return float(np.linalg.slogdet(gradients)[1]), slope


def _closeness(nearest: Array, simplex: Array) -> tuple[float, Array]:
    """Return the sum of log coordinates, each at the point nearest its vertex, and its gradient."""
    at = np.einsum("ij,ji->i", nearest, simplex)
    return float(np.log(np.maximum(at, 1e-300)).sum()), (nearest / at[:, None]).T


def _maximise(objective: Objective, start: Array, h: Array) -> Array:
    """Maximise over simplices that enclose ``h``, from one that does; the last column follows from the others.

    All points stay constraints throughout: adding only violated ones was measured to be slower.
    """
    from scipy.optimize import LinearConstraint, minimize  # noqa: PLC0415 - slow to import, and a diagnosis imports this module

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
    """Return enclosing simplices from spanned ones, perturbed, since those of symmetric points may be saddles.

    The perturbation mixes coordinates of the simplex, not of the points, so a rotation of the points changes nothing.
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
    """Drop simplices with the volume of an earlier one."""
    volumes = [round(log_reciprocal_volume(m), 6) for m in simplices]
    return [m for i, m in enumerate(simplices) if volumes[i] not in volumes[:i]]


def _hull(points: Array) -> NDArray[np.intp]:
    from scipy.spatial import ConvexHull  # noqa: PLC0415 - slow to import, and a diagnosis imports this module

    if points.shape[1] > _HULL_DIMENSIONS:
        return np.unique(points.round(12), axis=0, return_index=True)[1]
    return np.asarray(ConvexHull(points).vertices, dtype=np.intp)
