"""Fewer samples for a plot, with every peak kept."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


def envelope(curves: Sequence[NDArray[Any]], most: int) -> NDArray[np.int64]:
    """Return the rising indices, about ``most`` of them, at which the least and the largest of each curve stand.

    The samples are cut into stretches of equal number; each curve of shape (n,) gives two indices a stretch. First
    and last sample are kept; all samples are where there are no more than ``most``. NaN counts as neither.
    """
    n = curves[0].size
    if n <= most:
        return np.arange(n)
    stretches = max(1, (most - 2) // (2 * len(curves)))
    length = -(-n // stretches)
    start = length * np.arange(-(-n // length))
    chosen = [np.array([0, n - 1])]
    for curve in curves:
        padded = np.pad(np.asarray(curve, dtype=np.float64), (0, start.size * length - n), constant_values=np.nan)
        cut = padded.reshape(start.size, length)
        chosen.append(start + np.argmin(np.where(np.isnan(cut), np.inf, cut), axis=1))
        chosen.append(start + np.argmax(np.where(np.isnan(cut), -np.inf, cut), axis=1))
    return np.unique(np.concatenate(chosen))


def broken(values: NDArray[Any], segment: NDArray[Any]) -> NDArray[np.float64]:
    """Return values of shape (n,) with NaN in the last place of each ``segment`` (n,): a restart shows as a gap."""
    out = np.array(values, dtype=np.float64)
    out[np.flatnonzero(np.diff(segment))] = np.nan
    return out
