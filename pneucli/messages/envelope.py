"""Which samples of a curve are drawn, so that few show every peak and every gap."""

from collections.abc import Iterator, Sequence
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
    chosen = np.zeros(n, dtype=bool)
    chosen[[0, n - 1]] = True
    for curve in curves:
        for indices in _extremes(np.asarray(curve, dtype=np.float64), length):
            chosen[indices] = True
    return np.flatnonzero(chosen)


def _extremes(values: NDArray[np.float64], length: int) -> Iterator[NDArray[np.int64]]:
    """Yield the indices of the minimum and of the maximum of each block of so many values; NaN is ignored."""
    whole = values.size - values.size % length
    missing = np.isnan(values)
    gaps = bool(missing.any())
    for choose, never in ((np.argmin, np.inf), (np.argmax, -np.inf)):
        known = np.where(missing, never, values) if gaps else values
        yield np.arange(0, whole, length) + choose(known[:whole].reshape(-1, length), axis=1)
        if whole < values.size:
            yield whole + choose(known[whole:], keepdims=True)


def with_gap_indices(indices: NDArray[np.int64], values: NDArray[Any]) -> NDArray[np.int64]:
    """Return rising indices with those of the first NaN of each gap in ``values`` (n,), so that no line crosses it."""
    missing = np.isnan(values)
    if not missing.any():
        return indices
    starts = np.flatnonzero(missing & ~np.concatenate([[False], missing[:-1]]))
    return np.union1d(indices, starts)
