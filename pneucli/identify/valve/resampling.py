"""Resampling of readings at uneven stamps, and the error that it causes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pneucli.recording import Recording

Array = NDArray[np.float64]

MAX_JITTER_RATIO = 0.1  # median departure of the steps from the period, over it: jitter and a few gaps stay below
# rms error of a straight line between readings, over its largest error for readings twice as far apart
INTERPOLATION_ERROR_RATIO = 30.0**-0.5
MAX_RESAMPLING_ERROR = 1 / 3  # of the noise: resampling then adds 5 % to the noise
LEAVE_ONE_OUT_VARIANCE = 1.5  # variances of the noise: a reading minus the mean of its neighbours has 1 + 1/2


def is_unevenly_sampled(recording: Recording) -> bool:
    """Return whether the stamps depart from one period by more than jitter.

    Args:
        recording: The recording.

    Returns:
        Whether the median departure exceeds ``MAX_JITTER_RATIO`` of the period.

    """
    steps = np.diff(recording.time)
    return float(np.median(np.abs(steps - recording.period))) > MAX_JITTER_RATIO * recording.period


def interpolation_error(recording: Recording, signal: str) -> float:
    """Estimate the rms error of straight lines between the readings of a signal.

    Each reading is left out and interpolated from its neighbours: the difference is the curvature over twice the
    distance plus noise, whose variance is subtracted.

    Args:
        recording: The recording.
        signal: Name of the signal.

    Returns:
        The error in the signal's SI unit; 0 for an even clock.

    """
    if not is_unevenly_sampled(recording):
        return 0.0
    finite = np.isfinite(recording[signal])
    time, y = recording.time[finite], recording[signal][finite]
    if y.size < 3:
        return np.inf
    share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    interpolation_residual = y[1:-1] - y[:-2] - share * (y[2:] - y[:-2])
    noise = recording.noise.get(signal)
    excess = float(np.mean(interpolation_residual**2)) - LEAVE_ONE_OUT_VARIANCE * (noise.rms**2 if noise else 0.0)
    return float(INTERPOLATION_ERROR_RATIO * max(excess, 0.0) ** 0.5)


def resample(rows: Array, period: float) -> Array:
    """Resample rows to an even clock: the command is held, all other signals are interpolated linearly.

    Args:
        rows: Time, command and further signals, shape (m, n).
        period: The new period in s.

    Returns:
        The resampled rows.

    >>> rows = np.array([[0.0, 1.0, 3.0], [5.0, 6.0, 7.0], [0.0, 10.0, 30.0]])
    >>> resample(rows, 1.5).tolist()  # time, held command, interpolated signal
    [[0.0, 1.5, 3.0], [5.0, 6.0, 7.0], [0.0, 15.0, 30.0]]
    """
    time, u, *others = rows
    clock = np.arange(time[0], time[-1] + period / 2, period)
    held_command = u[np.searchsorted(time, clock + period * 1e-6, side="right") - 1]
    return np.stack([clock, held_command, *(np.interp(clock, time, row) for row in others)])
