"""Blocks of time, and the scores of residuals in them: what an interval rests on where residuals are correlated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.residuals import ResidualModel

Array = NDArray[np.float64]

MIN_BLOCK_LENGTH = 0.25  # s, longer than the residuals' memory
MAX_BLOCKS = 40  # of one recording
ROWS_PER_CHUNK = 1 << 15  # rows of derivatives that are copied at once: all of them may be most of the memory


def block_labels(views: Sequence[ResidualModel]) -> NDArray[np.int64]:
    """Return the number of the block of each residual, in the order of :func:`scaled` over the views."""
    numbers, first = [], 0
    for view in views:
        time = view.experiment.time
        length = max(MIN_BLOCK_LENGTH, (time[-1] - time[0]) / MAX_BLOCKS)
        mine = first + ((time - time[0]) / length).astype(np.int64)
        numbers.append(np.tile(mine, len(view.channels)))
        first = int(mine[-1]) + 1
    return np.concatenate(numbers)


def residual_mask(views: Sequence[ResidualModel], chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which residuals (N,) belong to the chosen views."""
    return np.repeat(chosen, [v.experiment.time.size * len(v.channels) for v in views])


def group_scores(jacobian: Array, residual: Array, labels: NDArray[np.int64]) -> Array:
    """Return the sums of derivatives (N, k) times residuals (N,) over the samples of each label (N,), shape (B, k)."""
    runs = np.flatnonzero(np.diff(labels, prepend=-1))  # a label stays for many samples
    sums = [np.bincount(labels[runs], weights=np.add.reduceat(column * residual, runs)) for column in jacobian.T]
    return np.array(sums, dtype=np.float64).reshape(jacobian.shape[1], int(labels.max()) + 1).T


def group_curvatures(jacobian: Array, labels: NDArray[np.int64]) -> Array:
    """Return the curvature J^T J of the derivatives (N, k) at the samples of each label (N,), shape (B, k, k)."""
    k = jacobian.shape[1]
    out, order = np.zeros((int(labels.max()) + 1, k, k)), np.argsort(labels, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(labels[order])) + 1)
    for rows in (group[i : i + ROWS_PER_CHUNK] for group in groups for i in range(0, group.size, ROWS_PER_CHUNK)):
        part = jacobian[rows]
        out[labels[rows[0]]] += part.T @ part
    return out


def weighted_curvature(jacobian: Array, weights: Array) -> Array:
    """Return the curvature (k, k) of derivatives (N, k) times weights (N,)."""
    out = np.zeros((jacobian.shape[1], jacobian.shape[1]))
    for i in range(0, len(weights), ROWS_PER_CHUNK):
        part = jacobian[i : i + ROWS_PER_CHUNK] * weights[i : i + ROWS_PER_CHUNK, None]
        out += part.T @ part
    return out
