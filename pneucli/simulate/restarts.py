"""Restarts: the samples at which the state of a model is set to the smoothed measurement (docs/method.md)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array

MAX_GAP_PERIODS = 20  # sampling periods


def restart_samples(time: Array, horizon: float | None, shortest: float = 0.0) -> NDArray[np.int64]:
    """Return the samples at which the model restarts: periodically, and after each gap of the record.

    Args:
        time: Time stamps in s, shape (n,).
        horizon: Time in s between restarts; None: at the start only.
        shortest: Shortest time in s between restarts.

    Returns:
        Indices of samples, rising, the first 0.

    >>> restart_samples(np.arange(0.0, 1.0, 0.01), 0.25)
    array([ 0, 25, 50, 75])
    """
    period = float(np.median(np.diff(time)))
    gaps = 1 + np.flatnonzero(np.diff(time) > MAX_GAP_PERIODS * period)
    grid = np.arange(0.0, time[-1] - time[0], max(horizon, shortest)) if horizon else np.zeros(1)
    return np.unique(np.concatenate([np.searchsorted(time, time[0] + grid - 1e-9), gaps])).astype(np.int64)


def segment_lengths(restarts: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """Return the number of samples of each segment, from one restart to the next.

    Args:
        restarts: Indices of the restarts, rising, shape (k,).
        n: Number of samples.

    Returns:
        Number of samples of each segment, shape (k,).

    >>> segment_lengths(np.array([0, 3]), 10)
    array([3, 7])
    """
    return np.diff(np.append(restarts, n))
