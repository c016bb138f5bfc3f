"""Samples on a grid (thesis figure 4.1): of a function, or directly from scattered measurements."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse.linalg import splu

from pneucli.arrays import Array, Indices
from pneucli.errors import InputError


def as_grids(grids: Sequence[ArrayLike]) -> tuple[Array, ...]:
    """Return grids as arrays.

    Args:
        grids: Nodes of each parameter, in its own unit.

    Returns:
        One array (n_k,) for each parameter.

    Raises:
        InputError: A grid has fewer than two nodes, is not finite, or does not rise strictly.

    >>> as_grids([[0, 1], [2, 3, 4]])
    (array([0., 1.]), array([2., 3., 4.]))
    """
    arrays = tuple(np.asarray(g, dtype=np.float64) for g in grids)
    for k, grid in enumerate(arrays):
        if grid.ndim != 1 or grid.size < 2 or not np.all(np.isfinite(grid)) or not np.all(np.diff(grid) > 0):
            raise InputError(
                f"grid of parameter {k}", f"{grid!r}", "at least two finite nodes, strictly rising", code="E090"
            )
    return arrays


def sample(function: Callable[..., ArrayLike], grids: Sequence[ArrayLike]) -> Array:
    """Evaluate a function on a grid (the analytical method).

    Args:
        function: Takes one array for each parameter, each of shape (n_1, ..., n_N); returns this shape followed by that
            of the matrix.
        grids: Nodes of each parameter, N arrays (n_k,).

    Returns:
        Samples, shape (n_1, ..., n_N, ...).

    Raises:
        InputError: The returned shape differs, or a value is not finite; at 0/0 the function must supply the limit.

    References:
        Thesis figure 4.1.

    >>> sample(lambda x, y: x * y, [[0, 1], [2, 3]])
    array([[0., 0.],
           [2., 3.]])
    """
    axes = as_grids(grids)
    samples = np.asarray(function(*np.meshgrid(*axes, indexing="ij")), dtype=np.float64)
    sizes = tuple(g.size for g in axes)
    if samples.shape[: len(sizes)] != sizes:
        raise InputError(
            "sampled function", f"shape {samples.shape}", f"shape {sizes} and then the matrix", code="E090"
        )
    require_finite(samples, axes)
    return samples


def require_finite(samples: Array, grids: Sequence[Array]) -> None:
    """Require finite samples.

    Args:
        samples: Samples, shape (n_1, ..., n_N, ...).
        grids: Nodes of each parameter, N arrays (n_k,).

    Returns:
        Nothing; every sample is finite.

    Raises:
        InputError: A sample is not finite; the message names its node.

    >>> require_finite(np.ones((2, 2)), [np.arange(2.0), np.arange(2.0)])
    """
    bad = ~np.isfinite(samples)
    if bad.any():
        index = np.argwhere(bad)[0]
        node = ", ".join(f"{g[i]:g}" for g, i in zip(grids, index, strict=False))
        raise InputError(
            f"sample at ({node})", f"{samples[tuple(index)]}", "a finite value", "supply the limit there", code="E090"
        )


def locate(grid: Array, at: Array) -> tuple[Indices, Array]:
    """Locate values between the nodes of a grid.

    Args:
        grid: Nodes, rising, shape (n,).
        at: Values within the grid.

    Returns:
        Index of the node to the left of each value, and the share of the interval on its left.

    >>> locate(np.array([0.0, 1.0, 3.0]), np.array([0.5, 2.5]))
    (array([0, 1]), array([0.5 , 0.75]))
    """
    left = np.clip(np.searchsorted(grid, at, side="right") - 1, 0, grid.size - 2)
    return left, (at - grid[left]) / (grid[left + 1] - grid[left])


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
