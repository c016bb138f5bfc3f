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

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal, get_args

import numpy as np

from pneucli.arrays import Array, Indices
from pneucli.errors import InputError, did_you_mean
from pneucli.tp import simplex as sx
from pneucli.tp.simplex import (
    distance_to_vertices,
    inverse,
    log_reciprocal_volume,
    spanned_simplex,
    tighten,
)

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


def convex_weights(frame: sx.AffineFrame, weight_type: WeightType) -> tuple[Array, Array]:
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
    >>> frame = sx.affine_frame(np.column_stack([grid / np.linalg.norm(grid)]), np.ones(1), 1e-10)
    >>> convex_weights(frame, "cno")[0][:, 0].round(6)
    array([1.  , 0.75, 0.5 , 0.25, 0.  ])
    """
    types = get_args(WeightType)
    if weight_type not in types:
        raise InputError(
            "weight type", repr(weight_type), ", ".join(types), did_you_mean(weight_type, types), code="E090"
        )
    h = sx.homogeneous(frame.points)
    simplex = _simplex(h, weight_type)
    return h @ simplex, np.asarray(np.linalg.solve(simplex, frame.back), dtype=np.float64)


def _simplex(h: Array, weight_type: WeightType) -> Array:
    d = h.shape[1] - 1
    if d == 0:
        return np.ones((1, 1))
    if d == 1:
        return sx.tighten(h, sx.spanned_simplex(h))
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
        "snnn": sx.regular_simplex,
        "ino": lambda rows: sx.tighten(rows, sx.spanned_simplex(rows)),
        "no": _normal,
        "cno": closest_simplex,
        "irno": _relaxed_normal,
        "mvs": lambda rows: smallest_simplices(rows)[0],
    }
    return makers[weight_type](h)


def _normal(h: Array) -> Array:
    simplex = sx.spanned_simplex(h)
    smallest = float((h @ simplex).min())
    if smallest < -1e-9:
        found = f"samples lie outside the simplex of their own extremes (smallest weight {smallest:.2g})"
        raise InputError(
            "weight type no", found, "samples whose hull is a simplex", "take cno, the closest to it", code="E090"
        )
    return sx.tighten(h, simplex)


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
