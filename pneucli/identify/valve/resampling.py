"""Readings at uneven stamps, put on an even clock, and the error that this brings."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pneucli.recording import Recording

Array = NDArray[np.float64]

MAX_JITTER_RATIO = (
    0.1  # median departure from the sampling period, over the period: jitter and a few gaps stay below it
)
INTERPOLATION_ERROR_RATIO = (
    30.0**-0.5
)  # rms of a parabola between two readings, over its value for readings twice as far apart
MAX_RESAMPLING_ERROR = 1 / 3  # of the noise, that resampling may err by: it adds 5 % to the noise
LEAVE_ONE_OUT_VARIANCE = 1.5  # variances of the noise in a reading less the mean of its neighbours


def is_unevenly_sampled(recording: Recording) -> bool:
    """Return whether the stamps depart from one period by more than jitter."""
    steps = np.diff(recording.time)
    return float(np.median(np.abs(steps - recording.period))) > MAX_JITTER_RATIO * recording.period


def interpolation_error(recording: Recording, signal: str) -> float:
    """Return the rms error (SI) that straight lines between the readings of ``signal`` have; 0 of an even clock.

    Each reading is left out and drawn from its neighbours: that is off by the curvature over twice the distance, and
    by the noise, which is taken off.
    """
    if not is_unevenly_sampled(recording):
        return 0.0
    known = np.isfinite(recording[signal])
    time, y = recording.time[known], recording[signal][known]
    if y.size < 3:
        return np.inf
    share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    off = y[1:-1] - y[:-2] - share * (y[2:] - y[:-2])
    noise = recording.noise.get(signal)
    rest = float(np.mean(off**2)) - LEAVE_ONE_OUT_VARIANCE * (noise.rms**2 if noise else 0.0)
    return float(INTERPOLATION_ERROR_RATIO * max(rest, 0.0) ** 0.5)


def resample(rows: Array, period: float) -> Array:
    """Return rows time, u, ... at every ``period``: the command as it stands, the others on straight lines."""
    time, u, *others = rows
    clock = np.arange(time[0], time[-1] + period / 2, period)
    held = u[np.searchsorted(time, clock + period * 1e-6, side="right") - 1]
    return np.stack([clock, held, *(np.interp(clock, time, row) for row in others)])
