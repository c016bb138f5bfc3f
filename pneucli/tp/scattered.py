"""Samples on a grid from scattered measurements: the direct method (thesis figure 4.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse.linalg import splu

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.tp.sampling import as_grids, locate


@dataclass(frozen=True)
class Gridded:
    """Samples from measurements and the number of measurements behind each node.

    Attributes:
        samples: Shape (n_1, ..., n_N, ...).
        support: Shape (n_1, ..., n_N): measurements near the node, each weighted by its nearness and by
            ``(median sigma / sigma)^2``; at 0 the node is interpolated, or extrapolated beyond all measurements.
    """

    samples: Array
    support: Array


def fit_samples(
    points: ArrayLike,
    values: ArrayLike,
    grids: Sequence[ArrayLike],
    sigma: ArrayLike | None = None,
    smoothing: float = 1e-3,
) -> Gridded:
    """Fit samples on a grid to scattered measurements (the direct method).

    The multilinear interpolant through the nodes is fitted by least squares; repeated measurements average out.

    Args:
        points: Parameters of each measurement, shape (m, N), or (m,) for one parameter.
        values: Measured values, shape (m, ...).
        grids: Nodes of each parameter, N arrays (n_k,).
        sigma: Standard deviation of each measurement, shape (m,); only ratios matter. None: all equal.
        smoothing: Weight of squared second differences between neighbouring nodes, relative to one measurement. A wave
            of L nodes shrinks by about ``smoothing (6.3 / L)^4`` over the measurements a node; a small weight only
            fills nodes without a measurement.

    Returns:
        The samples, and how many measurements support each node.

    Raises:
        InputError: A point is outside the grids, a number is not finite, ``sigma`` or ``smoothing`` is not positive.

    References:
        Thesis figure 4.1.

    >>> fit = fit_samples([0.0, 0.5, 1.0, 2.0], [1.0, 2.0, 3.0, 5.0], [[0, 1, 2]])
    >>> fit.samples.round(6), fit.support
    (array([1., 3., 5.]), array([1.5, 1.5, 1. ]))
    """
    axes = as_grids(grids)
    where = np.asarray(points, dtype=np.float64).reshape(-1, len(axes))
    measured = np.asarray(values, dtype=np.float64)
    if not (np.all(np.isfinite(where)) and np.all(np.isfinite(measured)) and len(where) == len(measured)):
        raise InputError(
            "measurements", "points and values of unequal length or not finite", mend="leave those out", code="E090"
        )
    if smoothing <= 0:
        raise InputError("smoothing", f"{smoothing}", "above 0: nodes without a measurement need it", code="E090")
    basis = _row_products([_linear_basis(g, where[:, k], k) for k, g in enumerate(axes)])
    trust = np.ones(len(where)) if sigma is None else _relative_weights(np.asarray(sigma, dtype=np.float64))
    nodes = _smooth_fit(
        basis, trust, measured.reshape(len(where), -1), np.sqrt(smoothing) * _second_difference_matrix(axes)
    )
    sizes = tuple(g.size for g in axes)
    return Gridded(nodes.reshape(sizes + measured.shape[1:]), (basis.T @ trust).reshape(sizes))


def _relative_weights(sigma: Array) -> Array:
    if not np.all(sigma > 0):
        raise InputError("sigma", f"{sigma.min()}", "above 0", code="E090")
    return np.asarray((np.median(sigma) / sigma) ** 2)


def _linear_basis(grid: Array, at: Array, parameter: int) -> sparse.csr_array:
    """Return linear interpolation as a matrix, shape ``(m, n)``."""
    if at.min() < grid[0] or at.max() > grid[-1]:
        found, wanted = f"[{at.min():g}, {at.max():g}]", f"within [{grid[0]:g}, {grid[-1]:g}]"
        raise InputError(
            f"measurements, parameter {parameter}", found, wanted, "widen the grid or leave those out", code="E090"
        )
    left, right = locate(grid, at)
    rows = np.tile(np.arange(at.size), 2)
    columns = np.concatenate((left, left + 1))
    return sparse.csr_array((np.concatenate((1 - right, right)), (rows, columns)), shape=(at.size, grid.size))


def _row_products(factors: list[sparse.csr_array]) -> sparse.csr_array:
    """Return the row by row Kronecker product: ``(m, n_1), (m, n_2), ... -> (m, n_1 n_2 ...)``."""

    def pair(a: sparse.csr_array, b: sparse.csr_array) -> sparse.csr_array:
        data = a.data.reshape(a.shape[0], -1, 1) * b.data.reshape(b.shape[0], 1, -1)
        columns = a.indices.reshape(a.shape[0], -1, 1) * b.shape[1] + b.indices.reshape(b.shape[0], 1, -1)
        rows = np.repeat(np.arange(a.shape[0]), data[0].size)
        return sparse.csr_array((data.ravel(), (rows, columns.ravel())), shape=(a.shape[0], a.shape[1] * b.shape[1]))

    return reduce(pair, factors)


def _second_difference_matrix(grids: Sequence[Array]) -> sparse.csr_array:
    """Return second differences along every axis; they are 0 where samples are linear in each parameter."""
    rows = []
    for k, grid in enumerate(grids):
        before = int(np.prod([g.size for g in grids[:k]]))
        after = int(np.prod([g.size for g in grids[k + 1 :]]))
        rows.append(
            sparse.kron(sparse.eye_array(before), sparse.kron(_second_differences(grid), sparse.eye_array(after)))
        )
    return sparse.csr_array(sparse.vstack(rows))


def _second_differences(grid: Array) -> sparse.csr_array:
    """Return twice the deviation of inner nodes from the line between neighbours: 1, -2, 1 where equidistant."""
    if grid.size < 3:
        return sparse.csr_array((0, grid.size))
    share = (grid[1:-1] - grid[:-2]) / (grid[2:] - grid[:-2])
    inner = np.arange(share.size)
    columns = np.concatenate((inner, inner + 1, inner + 2))
    values = np.concatenate((2 * (1 - share), np.full(share.size, -2.0), 2 * share))
    return sparse.csr_array((values, (np.tile(inner, 3), columns)), shape=(share.size, grid.size))


def _smooth_fit(basis: sparse.csr_array, trust: Array, values: Array, bending: sparse.csr_array) -> Array:
    """Solve the normal equations; one refinement by the residual regains what squaring lost."""
    weighted = sparse.csr_array(basis.T * trust)
    solver = splu(sparse.csc_array(weighted @ basis + bending.T @ bending))
    nodes = solver.solve(weighted @ values)
    correction = weighted @ (values - basis @ nodes) - bending.T @ (bending @ nodes)
    return np.asarray(nodes + solver.solve(correction))
