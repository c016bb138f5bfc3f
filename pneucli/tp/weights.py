"""Types of convex weighting functions, and the invariants of each.

========  ============================================================================================
``snnn``  rows sum to 1 (SN), none is negative (NN); cheap and loose: a regular simplex around the data
``ino``   the minimum of every column is 0 (tightest homothetic simplex); directions of the widest points
``no``    the maximum of every column is 1: the vertices are samples; only where their hull is a simplex
``cno``   close to NO: minimises the sum over columns of -log(max), tightened as INO
``irno``  minimum 0 and all maxima equal
``mvs``   smallest enclosing simplex, tightened as INO
========  ============================================================================================

With two vertices all types are the same, ``w_2 = (a - a_min) / (a_max - a_min)``, and no optimiser runs.

References:
    P. Baranyi, Y. Yam, P. Varlaki, Tensor Product Model Transformation in Polytopic Model-Based Control (2013), ch. 3.
    Chan et al., IEEE Trans. Signal Process. 57 (2009) 4418-4432 (smallest simplex).
    V. Klee, Linear Algebra Appl. 84 (1986) 243-250 (its certificate).
    P. Baranyi, IEEE Trans. Ind. Electron. 51 (2004) 387-400, and thesis (4.6) (the types).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal, get_args

import numpy as np

from pneucli.arrays import Array, Indices
from pneucli.errors import InputError, did_you_mean

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

    >>> from pneucli.tp.weights import homogeneous
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

    >>> from pneucli.tp.weights import homogeneous
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
    >>> from pneucli.tp.weights import homogeneous
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


def _hull(points: Array) -> Indices:
    from scipy.spatial import ConvexHull  # noqa: PLC0415 - slow to import, and a diagnosis imports this module

    if points.shape[1] > _HULL_DIMENSIONS:
        return np.unique(points.round(12), axis=0, return_index=True)[1]
    return np.asarray(ConvexHull(points).vertices, dtype=np.intp)


WeightType = Literal["snnn", "ino", "no", "cno", "irno", "mvs"]

INVARIANT_TOLERANCE = 1e-12  # to which sums, signs, minima and maxima hold
_MAX_SEARCH_DIMENSION = 8  # measured: 3 s at 5, 8 s at 6
_CONTACT_TOLERANCE = 1e-7  # weight of a sample that touches a facet


@dataclass(frozen=True)
class Violation:
    """An invariant that does not hold: the parameter (from 0; None: the whole model), its value, and its limit."""

    parameter: int | None
    invariant: str
    value: float
    limit: float


def convex_weights(frame: AffineFrame, weight_type: WeightType) -> tuple[Array, Array]:
    """Return convex weights and vertices of a basis.

    Args:
        frame: The basis in its affine hull.
        weight_type: Type of the weights.

    Returns:
        Weights, shape (n, d + 1), and vertices, shape (d + 1, r), with ``weights @ vertices`` the basis.

    Raises:
        InputError: The type is unknown, does not exist for these points (``no``, rarely ``irno``), or needs a search
            with more than nine vertices.

    References:
        Thesis (4.6): weights that sum to one and are not negative.

    >>> grid = np.linspace(0.0, 1.0, 5)
    >>> frame = affine_frame(np.column_stack([grid / np.linalg.norm(grid)]), np.ones(1), 1e-10)
    >>> convex_weights(frame, "cno")[0][:, 0].round(6)
    array([1.  , 0.75, 0.5 , 0.25, 0.  ])
    """
    types = get_args(WeightType)
    if weight_type not in types:
        raise InputError(
            "weight type", repr(weight_type), ", ".join(types), did_you_mean(weight_type, types), code="E090"
        )
    h = homogeneous(frame.points)
    simplex = _simplex(h, weight_type)
    return h @ simplex, np.asarray(np.linalg.solve(simplex, frame.back), dtype=np.float64)


def _simplex(h: Array, weight_type: WeightType) -> Array:
    d = h.shape[1] - 1
    if d == 0:
        return np.ones((1, 1))
    if d == 1:
        return tighten(h, spanned_simplex(h))
    if d > _MAX_SEARCH_DIMENSION and weight_type in ("cno", "irno", "mvs"):
        wanted = f"at most {_MAX_SEARCH_DIMENSION + 1}: the search would not end"
        raise InputError(
            f"weight type {weight_type}",
            f"{d + 1} vertices",
            wanted,
            "bound the rank (noise has full rank)",
            code="E090",
        )
    makers: dict[WeightType, Callable[[Array], Array]] = {
        "snnn": regular_simplex,
        "ino": lambda rows: tighten(rows, spanned_simplex(rows)),
        "no": _normal,
        "cno": closest_simplex,
        "irno": _relaxed_normal,
        "mvs": lambda rows: smallest_simplices(rows)[0],
    }
    return makers[weight_type](h)


def _normal(h: Array) -> Array:
    simplex = spanned_simplex(h)
    smallest = float((h @ simplex).min())
    if smallest < -1e-9:
        found = f"samples lie outside the simplex of their own extremes (smallest weight {smallest:.2g})"
        raise InputError(
            "weight type no", found, "samples whose hull is a simplex", "take cno, the closest to it", code="E090"
        )
    return tighten(h, simplex)


def _relaxed_normal(h: Array) -> Array:
    simplex = equal_maxima_simplex(h)
    if simplex is None:
        raise InputError(
            "weight type irno", "no simplex with equal maxima was found", mend="take cno or mvs", code="E090"
        )
    return simplex


def violations(weights: Array, weight_type: WeightType, parameter: int) -> list[Violation]:
    """Return the invariants that weights violate.

    Args:
        weights: Weights at the nodes, shape (n, vertices).
        weight_type: Type of the weights.
        parameter: Number of the parameter, for the answer.

    Returns:
        The violations; an empty list where every invariant holds.

    >>> violations(np.eye(2), "cno", 0)
    []
    >>> [v.invariant for v in violations(np.array([[0.5, 0.4]]), "snnn", 0)]
    ['SN: rows sum to 1']
    """
    maxima, minima = weights.max(axis=0), weights.min(axis=0)
    found = {
        "SN: rows sum to 1": float(np.abs(weights.sum(axis=1) - 1).max()),
        "NN: not negative": float(-minima.min()),
    }
    if weights.shape[1] > 1:
        found |= _tightness(weights, weight_type, maxima, minima)
    limits = {"MVS: facet centroids supported": 1e-3}
    return [
        Violation(parameter, name, value, limits.get(name, INVARIANT_TOLERANCE))
        for name, value in found.items()
        if not value <= limits.get(name, INVARIANT_TOLERANCE)
    ]


def _tightness(weights: Array, weight_type: WeightType, maxima: Array, minima: Array) -> dict[str, float]:
    found = {}
    if weight_type != "snnn":
        found["INO: minima are 0"] = float(np.abs(minima).max())
    if weight_type == "no":
        found["NO: maxima are 1"] = float(np.abs(maxima - 1).max())
    if weight_type == "irno":
        found["RNO: maxima are equal"] = float(np.ptp(maxima))
    if weight_type == "mvs":
        found["MVS: facet centroids supported"] = max(_unsupported(weights, i) for i in range(weights.shape[1]))
    return found


def _unsupported(weights: Array, facet: int) -> float:
    """Return the distance, in weights, of a facet's centroid from the hull of the samples that touch the facet.

    It is 0 for every facet of a smallest enclosing simplex; otherwise tilting the facet about them reduces the volume.
    """
    from scipy.optimize import nnls  # noqa: PLC0415 - slow to import, and a diagnosis imports this module

    touching = weights[weights[:, facet] < _CONTACT_TOLERANCE]
    centroid = np.full(weights.shape[1], 1.0 / (weights.shape[1] - 1))
    centroid[facet] = 0.0
    return float(nnls(touching.T, centroid)[1])
