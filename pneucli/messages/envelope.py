"""Which samples of a curve are drawn, so that few show every peak and every gap."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


def envelope_indices(curves: Sequence[NDArray[Any]], max_samples: int) -> NDArray[np.int64]:
    """Return the indices of the minima and maxima of curves, so that a plot of few samples shows every peak.

    The samples are divided into blocks of equal length; each curve gives the indices of its minimum and maximum in
    each block. NaN is ignored. The first and the last sample are included.

    Args:
        curves: Curves of the same shape (n,).
        max_samples: About how many indices to return; all n, where n is not larger.

    Returns:
        Rising indices.

    """
    n = curves[0].size
    if n <= max_samples:
        return np.arange(n)
    blocks = max(1, (max_samples - 2) // (2 * len(curves)))
    length = -(-n // blocks)
    start = length * np.arange(-(-n // length))
    chosen = [np.array([0, n - 1])]
    for curve in curves:
        padded = np.pad(np.asarray(curve, dtype=np.float64), (0, start.size * length - n), constant_values=np.nan)
        cut = padded.reshape(start.size, length)
        chosen.append(start + np.argmin(np.where(np.isnan(cut), np.inf, cut), axis=1))
        chosen.append(start + np.argmax(np.where(np.isnan(cut), -np.inf, cut), axis=1))
    return np.unique(np.concatenate(chosen))


def with_gap_indices(indices: NDArray[np.int64], values: NDArray[Any]) -> NDArray[np.int64]:
    """Return rising indices with those of the first NaN of each gap in ``values`` (n,), so that no line crosses it."""
    missing = np.isnan(values)
    starts = np.flatnonzero(missing & ~np.concatenate([[False], missing[:-1]]))
    return np.union1d(indices, starts)
