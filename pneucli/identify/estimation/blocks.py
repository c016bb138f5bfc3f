"""Blocks of time, and the scores of residuals in them: the units of a sandwich covariance of correlated residuals.

Source: docs/method.md, intervals; K.-Y. Liang, S. L. Zeger, Biometrika 73 (1986) 13-22.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.caches import compiled
from pneucli.identify.residuals import ResidualModel

MIN_BLOCK_LENGTH = 0.25  # s, longer than the residuals' memory
MAX_BLOCKS = 40  # of one recording
ROWS_PER_CHUNK = 1 << 11  # rows of derivatives that are copied at once: all of them may be most of the memory


def block_labels(residual_models: Sequence[ResidualModel]) -> NDArray[np.int64]:
    """Label each residual with its block of time.

    A block spans at least ``MIN_BLOCK_LENGTH``; all channels of one recording share its blocks.

    Args:
        residual_models: The residual models whose residuals are stacked, model after model and channel after channel.

    Returns:
        The block of each residual, shape (N,), counted from 0 over all models.

    """
    labels, first = [], 0
    for residual_model in residual_models:
        time = residual_model.experiment.time
        length = max(MIN_BLOCK_LENGTH, (time[-1] - time[0]) / MAX_BLOCKS)
        own_labels = first + ((time - time[0]) / length).astype(np.int64)
        labels.append(np.tile(own_labels, len(residual_model.channels)))
        first = int(own_labels[-1]) + 1
    return np.concatenate(labels)


def residual_counts(residual_models: Sequence[ResidualModel]) -> list[int]:
    """Return the number of residuals of each residual model."""
    return [one.experiment.time.size * len(one.channels) for one in residual_models]


def residual_slices(residual_models: Sequence[ResidualModel]) -> list[slice]:
    """Return the rows of each residual model in the stacked residuals."""
    ends = np.cumsum([0, *residual_counts(residual_models)]).tolist()
    return [slice(*rows) for rows in pairwise(ends)]


def channel_slices(residual_models: Sequence[ResidualModel]) -> list[slice]:
    """Return the rows of each channel of each residual model in the stacked residuals."""
    ends = np.cumsum([0, *(one.experiment.time.size for one in residual_models for _ in one.channels)]).tolist()
    return [slice(*rows) for rows in pairwise(ends)]


def clear(jacobian: Array, columns: Sequence[int], parts: Sequence[slice]) -> None:
    """Write zeros to parts of columns of derivatives where they are not zero: others take no memory, and shall not.

    Args:
        jacobian: Derivatives, shape (N, k), column after column in memory.
        columns: Which columns.
        parts: Which rows, part by part.

    >>> jacobian = np.ones((3, 2), order="F")
    >>> clear(jacobian, [1], [slice(0, 2)])
    >>> jacobian.tolist()
    [[1.0, 0.0], [1.0, 0.0], [1.0, 1.0]]
    """
    _clear(jacobian.T, np.array(columns, dtype=np.intp), np.array([(part.start, part.stop) for part in parts]))


@compiled(nogil=True)
def _clear(columns: Array, some: NDArray[np.intp], parts: NDArray[np.int64]) -> None:
    for j in some:
        for p in range(len(parts)):
            part, i = columns[j, parts[p, 0] : parts[p, 1]], 0
            while i < part.size and part[i] == 0.0:
                i += 1
            part[i:] = 0.0


def copy_nonzero(
    source: Array, source_rows: Sequence[slice], target: Array, target_rows: Sequence[slice], factor: float = 1.0
) -> None:
    """Copy parts of a column of derivatives to a column of zeros; zeros that are not written take no memory.

    Args:
        source: Derivatives, shape (N,).
        source_rows: Rows of each part in the source.
        target: Zeros, shape (M,).
        target_rows: Rows of each part in the target.
        factor: Factor on all derivatives.

    """
    for first, to in zip(source_rows, target_rows, strict=True):
        if source[first].any():
            target[to] = factor * source[first]


def group_scores(jacobian: Array, residual: Array, labels: NDArray[np.int64]) -> Array:
    """Sum derivatives times residuals over the samples of each group.

    Args:
        jacobian: Derivatives of the residuals, shape (N, k).
        residual: Residuals, shape (N,).
        labels: Group of each residual, shape (N,), with B - 1 as the largest.

    Returns:
        The scores, shape (B, k).

    >>> scores = group_scores(np.ones((4, 1)), np.array([1.0, 2.0, 4.0, 8.0]), np.array([0, 0, 1, 1]))
    >>> scores.tolist()
    [[3.0], [12.0]]

    """
    runs = np.flatnonzero(np.diff(labels, prepend=-1))  # a label stays for many samples
    sums = [np.bincount(labels[runs], weights=np.add.reduceat(column * residual, runs)) for column in jacobian.T]
    return np.array(sums, dtype=np.float64).reshape(jacobian.shape[1], int(labels.max()) + 1).T


class GroupSums(NamedTuple):
    """Sums over the samples of each group: scores J^T r (B, k), and curvatures J^T J (B, k, k)."""

    scores: Array
    curvatures: Array


def group_sums(jacobian: Array, residual: Array, groupings: Sequence[NDArray[np.int64]]) -> list[GroupSums]:
    """Sum scores and curvatures over the samples of each group of some groupings.

    Args:
        jacobian: Derivatives of the residuals, shape (N, k).
        residual: Residuals, shape (N,).
        groupings: Groups of each residual, each (N,), with B - 1 as the largest.

    Returns:
        The sums, for each grouping.

    >>> (sums,) = group_sums(np.array([[1.0], [2.0], [4.0]]), np.ones(3), [np.array([0, 0, 1])])
    >>> sums.scores.ravel().tolist(), sums.curvatures.ravel().tolist()
    ([3.0, 4.0], [5.0, 16.0])
    """
    k, counts = jacobian.shape[1], [int(labels.max()) + 1 for labels in groupings]
    firsts = np.cumsum([0, *counts])
    sums = np.zeros((firsts[-1], k + 1, k + 1))
    labels = np.array([one + first for one, first in zip(groupings, firsts, strict=False)])
    for rows, columns, part in _chunks(jacobian, residual):
        _add_products(part, np.array([*columns, k]), labels[:, rows], sums)
    parts = np.split(sums, firsts[1:-1])
    return [GroupSums(one[:, :k, k], one[:, :k, :k]) for one in parts]


@compiled(nogil=True)
def _add_products(part: Array, columns: NDArray[np.int64], labels: NDArray[np.int64], sums: Array) -> None:
    """Add the products of all columns of some rows (n, m) to the sums of the groups of each row, in one pass."""
    m, is_used = columns.size, np.zeros(len(sums), dtype=np.bool_)
    products, own = np.empty(m * (m + 1) // 2), np.empty((len(sums), m * (m + 1) // 2))
    for i in range(len(part)):
        place = 0
        for a in range(m):
            for b in range(a + 1):
                products[place + b] = part[i, a] * part[i, b]
            place += a + 1
        for g in range(len(labels)):
            label = labels[g, i]
            if not is_used[label]:
                is_used[label], own[label] = True, 0.0
            total = own[label]
            for j in range(products.size):
                total[j] += products[j]
    for label in np.flatnonzero(is_used):
        place = 0
        for a in range(m):
            for b in range(a + 1):
                sums[label, columns[a], columns[b]] += own[label, place + b]
                if a != b:
                    sums[label, columns[b], columns[a]] += own[label, place + b]
            place += a + 1


def weighted_curvature(jacobian: Array, weights: Array) -> Array:
    """Sum the curvature J^T W^2 J of derivatives that are multiplied by a weight for each residual.

    Args:
        jacobian: Derivatives of the residuals, shape (N, k).
        weights: Weights, shape (N,).

    Returns:
        The curvature, shape (k, k).

    >>> weighted_curvature(np.array([[1.0], [2.0]]), np.array([10.0, 0.5])).tolist()  # 10^2 + (2 x 0.5)^2
    [[101.0]]
    """
    out = np.zeros((jacobian.shape[1], jacobian.shape[1]))
    for _, columns, part in _chunks(jacobian, weights):
        weighted = part[:, :-1] * part[:, -1:]
        out[np.ix_(columns, columns)] += weighted.T @ weighted
    return out


def _chunks(jacobian: Array, residual: Array) -> Iterator[tuple[slice, list[int], Array]]:
    """Yield some rows at a time of derivatives (N, k), those columns that are not zero there, and last the residuals.

    A residual depends on the parameters of its own subsystem alone, a third of all. The parts are in the order of rows.
    """
    for first in range(0, len(residual), ROWS_PER_CHUNK):
        rows = slice(first, min(first + ROWS_PER_CHUNK, len(residual)))
        columns = [j for j in range(jacobian.shape[1]) if jacobian[rows, j].any()]
        part = np.empty((rows.stop - first, len(columns) + 1))
        for place, j in enumerate(columns):
            part[:, place] = jacobian[rows, j]
        part[:, -1] = residual[rows]
        yield rows, columns, part
