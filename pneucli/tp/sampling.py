"""Samples of a function on a grid (thesis figure 4.1)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

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
