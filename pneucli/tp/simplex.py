"""Simplices that enclose a set of points, in barycentric coordinates.

A simplex in d dimensions is stored as the matrix M, shape (d + 1, d + 1), with ``[Y 1] M = B``: B holds the
barycentric coordinates of the points Y, shape (n, d). Its rows sum to 1, and it is non-negative where the simplex
encloses Y. All numbers are dimensionless. Source: thesis (4.6); types of weights after P. Baranyi, IEEE Trans. Ind.
Electron. 51 (2004) 387-400.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array

_ROUNDING = 1e-13


@dataclass(frozen=True)
class AffineFrame:
    """The rows of a basis in coordinates of their affine hull: ``basis = [points 1] @ back``.

    Attributes:
        points: Coordinates, centred and white, shape (n, d).
        back: The map back to the basis, shape (d + 1, r).
    """

    points: Array
    back: Array


def affine_frame(basis: Array, values: Array, tolerance: float) -> AffineFrame:
    """Express the rows of a basis in coordinates of their affine hull.

    Args:
        basis: Orthonormal columns, shape (n, r).
        values: Singular value of each column, its weight, shape (r,).
        tolerance: Directions below this share of the first singular value are left out, as are those below rounding.

    Returns:
        The frame, with d = r - 1 where a constant lies in the span of the columns, else d = r.

    >>> frame = affine_frame(np.array([[1.0, 0.0], [0.0, 1.0]]), np.ones(2), 1e-10)
    >>> frame.points.shape
    (2, 1)
    >>> (homogeneous(frame.points) @ frame.back).round(12)
    array([[1., 0.],
           [0., 1.]])
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
    """Append a column of ones.

    Args:
        points: Points in any unit, shape (n, d).

    Returns:
        Homogeneous coordinates, shape (n, d + 1).

    >>> homogeneous(np.array([[2.0, 3.0]]))
    array([[2., 3., 1.]])
    """
    return np.asarray(np.column_stack((points, np.ones(len(points)))), dtype=np.float64)


def tighten(h: Array, simplex: Array) -> Array:
    """Return the smallest simplex with the facets' directions of another one that encloses the points.

    Args:
        h: Points in homogeneous coordinates ``[Y 1]``, shape (n, d + 1).
        simplex: A simplex, shape (d + 1, d + 1).

    Returns:
        The simplex, shape (d + 1, d + 1), dimensionless; the minimum of every barycentric coordinate over the points
        is 0.

    >>> h = homogeneous(np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [0.5, 0.5]]))
    >>> (h @ tighten(h, regular_simplex(h))).min(axis=0).round(12) + 0.0
    array([0., 0., 0.])
    """
    minima = (h @ simplex).min(axis=0)
    moved = simplex.copy()
    moved[-1] -= minima
    return moved / float(1.0 - minima.sum())


def regular_simplex(h: Array) -> Array:
    """Enclose the points by a simplex with one facet across each axis and one across their diagonal.

    Args:
        h: Points in homogeneous coordinates, shape (n, d + 1).

    Returns:
        The simplex, shape (d + 1, d + 1), dimensionless.

    >>> h = homogeneous(np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [0.5, 0.5]]))
    >>> bool((h @ regular_simplex(h) > -1e-12).all())
    True
    """
    d = h.shape[1] - 1
    corners = np.vstack((np.eye(d), np.full(d, -1.0)))
    return tighten(h, inverse(homogeneous(corners)))


def spanned_simplex(h: Array, first: int | None = None) -> Array:
    """Return the simplex of d + 1 of the points, chosen greedily for volume.

    Each vertex is the point farthest from those before it; the simplex may not enclose the others.

    Args:
        h: Points in homogeneous coordinates, shape (n, d + 1).
        first: Index of the first vertex; None: the point farthest from the mean.

    Returns:
        The simplex, shape (d + 1, d + 1), dimensionless.

    >>> h = homogeneous(np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [0.5, 0.5]]))
    >>> (h @ spanned_simplex(h))[3].round(6).tolist()
    [0.25, 0.25, 0.5]
    """
    points = h[:, :-1]
    start = int(np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1))) if first is None else first
    chosen, rest = [start], points - points[start]
    for _ in range(points.shape[1]):
        length = np.linalg.norm(rest, axis=1)
        chosen.append(int(np.argmax(length)))
        direction = rest[chosen[-1]] / length[chosen[-1]]
        rest = rest - np.outer(rest @ direction, direction)
    return inverse(h[chosen])


def log_reciprocal_volume(simplex: Array) -> float:
    """Return the logarithm of the reciprocal volume of a simplex, up to d!.

    Args:
        simplex: The simplex, shape (d + 1, d + 1).

    Returns:
        -log(d! volume), dimensionless.

    >>> h = homogeneous(np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [0.5, 0.5]]))
    >>> round(log_reciprocal_volume(spanned_simplex(h)), 4)
    -1.3863
    """
    return float(np.linalg.slogdet(simplex[:-1, :-1])[1])


def distance_to_vertices(weights: Array) -> float:
    """Return how far the points are from the vertices.

    Args:
        weights: Barycentric coordinates, shape (n, d + 1).

    Returns:
        Sum over columns of abs(log max); 0 where the points reach every vertex.

    >>> distance_to_vertices(np.eye(3))
    0.0
    """
    return float(np.abs(np.log(weights.max(axis=0))).sum())


def inverse(matrix: Array) -> Array:
    """Return the inverse of a matrix.

    Args:
        matrix: Regular matrix, shape (n, n).

    Returns:
        The inverse, shape (n, n), in the reciprocal unit.

    >>> inverse(np.diag([2.0, 4.0]))
    array([[0.5 , 0.  ],
           [0.  , 0.25]])
    """
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)
