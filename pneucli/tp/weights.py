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
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pneucli.errors import InputError, did_you_mean
from pneucli.tp import simplex as sx
from pneucli.tp import simplex_search

Array = NDArray[np.float64]
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
        "cno": simplex_search.closest_simplex,
        "irno": _relaxed_normal,
        "mvs": lambda rows: simplex_search.smallest_simplices(rows)[0],
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
    simplex = simplex_search.equal_maxima_simplex(h)
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
