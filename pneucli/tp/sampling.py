"""Samples on a grid: from a function, or directly from scattered measurements (thesis figure 4.1)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from pneucli.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Gridded:
    """Samples from measurements, shape ``(n_1, ..., n_N, ...)``, and what stands behind each node.

    ``support``, shape ``(n_1, ..., n_N)``: measurements that fall to the node, counted by their nearness (and by
    ``(median sigma / sigma)^2``); 0: the node is only interpolated, or beyond all data extrapolated straight on.
    """

    samples: Array
    support: Array


def as_grids(grids: Sequence[ArrayLike]) -> tuple[Array, ...]:
    """Return the grids as arrays; raise ``InputError`` unless each rises strictly, is finite and has two nodes."""
    arrays = tuple(np.asarray(g, dtype=np.float64) for g in grids)
    for k, grid in enumerate(arrays):
        if grid.ndim != 1 or grid.size < 2 or not np.all(np.isfinite(grid)) or not np.all(np.diff(grid) > 0):
            raise InputError(f"grid of parameter {k}", f"{grid!r}", "at least two finite nodes, strictly rising")
    return arrays


def sample(function: Callable[..., ArrayLike], grids: Sequence[ArrayLike]) -> Array:
    """Evaluate ``function`` on the grid: shape ``(n_1, ..., n_N, ...)``, the analytical method.

    ``function`` takes one array a parameter, each of shape ``(n_1, ..., n_N)``, and returns the same shape followed by
    that of the matrix. Raises ``InputError`` where the shape differs or a value is not finite: at 0/0 supply the limit.
    """
    axes = as_grids(grids)
    samples = np.asarray(function(*np.meshgrid(*axes, indexing="ij")), dtype=np.float64)
    sizes = tuple(g.size for g in axes)
    if samples.shape[: len(sizes)] != sizes:
        raise InputError("sampled function", f"shape {samples.shape}", f"shape {sizes} and then the matrix")
    require_finite(samples, axes)
    return samples


def require_finite(samples: Array, grids: Sequence[Array]) -> None:
    """Raise ``InputError`` naming the first node whose sample is not finite."""
    bad = ~np.isfinite(samples)
    if bad.any():
        index = np.argwhere(bad)[0]
        node = ", ".join(f"{g[i]:g}" for g, i in zip(grids, index, strict=False))
        raise InputError(f"sample at ({node})", f"{samples[tuple(index)]}", "a finite value", "supply the limit there")


def fit_samples(
    points: ArrayLike,
    values: ArrayLike,
    grids: Sequence[ArrayLike],
    sigma: ArrayLike | None = None,
    smoothing: float = 1e-3,
) -> Gridded:
    """Fit samples on the grid to scattered measurements, the direct method.

    Least squares of the multilinear interpolant through the nodes; repeated measurements average out. ``points``:
    shape ``(m, N)`` (or ``(m,)`` for one parameter); ``values``: ``(m, ...)``; ``sigma``: standard deviation of each
    measurement, ``(m,)``, only its ratios matter. ``smoothing`` weighs squared second differences between neighbouring
    nodes against a measurement: small, it only fills nodes without one; with it, waves of L nodes shrink by about
    ``smoothing (6.3 / L)^4`` over the measurements a node. Raises ``InputError`` for points that are outside the grids
    or not finite.
    """
    axes = as_grids(grids)
    where = np.asarray(points, dtype=np.float64).reshape(-1, len(axes))
    measured = np.asarray(values, dtype=np.float64)
    if not (np.all(np.isfinite(where)) and np.all(np.isfinite(measured)) and len(where) == len(measured)):
        raise InputError("measurements", "points and values of unequal length or not finite", mend="leave those out")
    if smoothing <= 0:
        raise InputError("smoothing", f"{smoothing}", "above 0: nodes without a measurement need it")
    basis = _row_products([_linear_basis(g, where[:, k], k) for k, g in enumerate(axes)])
    trust = np.ones(len(where)) if sigma is None else _relative_weights(np.asarray(sigma, dtype=np.float64))
    nodes = _smooth_fit(
        basis, trust, measured.reshape(len(where), -1), np.sqrt(smoothing) * _second_difference_matrix(axes)
    )
    sizes = tuple(g.size for g in axes)
    return Gridded(nodes.reshape(sizes + measured.shape[1:]), (basis.T @ trust).reshape(sizes))


def _relative_weights(sigma: Array) -> Array:
    if not np.all(sigma > 0):
        raise InputError("sigma", f"{sigma.min()}", "above 0")
    return np.asarray((np.median(sigma) / sigma) ** 2)


def _linear_basis(grid: Array, at: Array, parameter: int) -> sparse.csr_array:
    """Linear interpolation as a matrix, shape ``(m, n)``."""
    if at.min() < grid[0] or at.max() > grid[-1]:
        found, wanted = f"[{at.min():g}, {at.max():g}]", f"within [{grid[0]:g}, {grid[-1]:g}]"
        raise InputError(f"measurements, parameter {parameter}", found, wanted, "widen the grid or leave those out")
    left, right = locate(grid, at)
    rows = np.tile(np.arange(at.size), 2)
    columns = np.concatenate((left, left + 1))
    return sparse.csr_array((np.concatenate((1 - right, right)), (rows, columns)), shape=(at.size, grid.size))


def locate(grid: Array, at: Array) -> tuple[NDArray[np.intp], Array]:
    """Return the interval's left node and the share of the way through it, for values within the grid."""
    left = np.clip(np.searchsorted(grid, at, side="right") - 1, 0, grid.size - 2)
    return left, (at - grid[left]) / (grid[left + 1] - grid[left])


def _row_products(factors: list[sparse.csr_array]) -> sparse.csr_array:
    """Row by row Kronecker product: ``(m, n_1), (m, n_2), ... -> (m, n_1 n_2 ...)``."""

    def pair(a: sparse.csr_array, b: sparse.csr_array) -> sparse.csr_array:
        data = a.data.reshape(a.shape[0], -1, 1) * b.data.reshape(b.shape[0], 1, -1)
        columns = a.indices.reshape(a.shape[0], -1, 1) * b.shape[1] + b.indices.reshape(b.shape[0], 1, -1)
        rows = np.repeat(np.arange(a.shape[0]), data[0].size)
        return sparse.csr_array((data.ravel(), (rows, columns.ravel())), shape=(a.shape[0], a.shape[1] * b.shape[1]))

    return reduce(pair, factors)


def _second_difference_matrix(grids: Sequence[Array]) -> sparse.csr_array:
    """Second differences along every axis; 0 where the samples are linear in each parameter."""
    rows = []
    for k, grid in enumerate(grids):
        before = int(np.prod([g.size for g in grids[:k]]))
        after = int(np.prod([g.size for g in grids[k + 1 :]]))
        rows.append(
            sparse.kron(sparse.eye_array(before), sparse.kron(_second_differences(grid), sparse.eye_array(after)))
        )
    return sparse.csr_array(sparse.vstack(rows))


def _second_differences(grid: Array) -> sparse.csr_array:
    """Deviation of each inner node from the line between its neighbours, twice: 1, -2, 1 where equidistant."""
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
