"""What each signal of a recording looks like: least, median, most, noise and rate, in SI."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.quantities import SIGNALS
from pneucli.recording import Recording

Array = NDArray[np.float64]

GAP = 2.5  # of a signal's own sampling period: two samples may lie two periods apart where its clock drifts


@dataclass(frozen=True)
class Look:
    """One signal in its SI ``unit``; ``rate`` is in samples per second, ``missing`` a share of the recording's time.

    ``speed`` is the change per second that 1 % of the steps exceed, so that one spike does not stand for all.
    """

    unit: str
    least: float
    median: float
    most: float
    noise: float
    rate: float
    speed: float
    missing: float


def look(recording: Recording, signal: str) -> Look:
    """Return what ``signal`` of a recording looks like; it has one measured sample at least."""
    measured = np.flatnonzero(np.isfinite(recording[signal]))
    values, time = recording[signal][measured], recording.time[measured]
    steps = np.diff(time)
    noise = recording.noise.get(signal)
    return Look(
        unit=SIGNALS[signal].unit,
        least=float(values.min()),
        median=float(np.median(values)),
        most=float(values.max()),
        noise=float("nan") if noise is None else noise.rms,
        rate=1.0 / float(np.median(steps)) if steps.size else float("nan"),
        speed=float(np.percentile(np.abs(np.diff(values) / steps), 99.0)) if steps.size else float("nan"),
        missing=missing(recording, signal),
    )


def missing(recording: Recording, signal: str) -> float:
    """Return the share of a recording's time in which ``signal`` ought to have been measured and was not.

    A signal with a slower clock of its own misses nothing: what counts are gaps of more than ``GAP`` of its own periods
    in which other signals were measured, and what is cut off at either end.
    """
    finite = np.isfinite(recording[signal])
    if finite.all():
        return 0.0
    at = np.flatnonzero(finite)
    steps, rows = np.diff(recording.time[at]), np.diff(at)
    own = float(np.median(steps)) if steps.size else np.inf
    ends = np.array([recording.time[at[0]] - recording.time[0], recording.time[-1] - recording.time[at[-1]]])
    lost = float(steps[(steps > GAP * own) & (rows > 1)].sum() + ends[ends > GAP * own].sum())
    return lost / float(recording.time[-1] - recording.time[0])
