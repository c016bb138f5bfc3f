"""Blocks of time, and the scores of residuals in them: what an interval rests on where residuals are correlated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.views import View

Array = NDArray[np.float64]

BLOCK = 0.25  # s, longer than the residuals' memory
MOST_BLOCKS = 40  # of one recording


def block_numbers(views: Sequence[View]) -> NDArray[np.int64]:
    """Return the number of the block of each residual, in the order of :func:`scaled` over the views."""
    numbers, first = [], 0
    for view in views:
        time = view.experiment.time
        length = max(BLOCK, (time[-1] - time[0]) / MOST_BLOCKS)
        mine = first + ((time - time[0]) / length).astype(np.int64)
        numbers.append(np.tile(mine, len(view.channels)))
        first = int(mine[-1]) + 1
    return np.concatenate(numbers)


def rows_of(views: Sequence[View], chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which residuals (N,) belong to the chosen views."""
    return np.repeat(chosen, [v.experiment.time.size * len(v.channels) for v in views])


def scores(jacobian: Array, residual: Array, labels: NDArray[np.int64]) -> Array:
    """Return the sums of derivatives (N, k) times residuals (N,) over the samples of each label (N,), shape (B, k)."""
    runs = np.flatnonzero(np.diff(labels, prepend=-1))  # a label stays for many samples
    sums = [np.bincount(labels[runs], weights=np.add.reduceat(column * residual, runs)) for column in jacobian.T]
    return np.array(sums, dtype=np.float64).reshape(jacobian.shape[1], int(labels.max()) + 1).T
