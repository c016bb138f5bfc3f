"""What each signal of a recording looks like: least, median, most, noise and rate, in SI."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pneucli.messages.ingest import SignalSummary
from pneucli.quantities import SIGNALS
from pneucli.recording import Recording

GAP_PERIODS = 2.5  # of a signal's own sampling period: two samples may lie two periods apart where its clock drifts
# percentile of the steps between samples: the period of a clock of which most stamps were lost
PERIOD_PERCENTILE = 10.0


def summarize_signal(recording: Recording, signal: str) -> SignalSummary:
    """Return what ``signal`` of a recording looks like; it has one measured sample at least."""
    at = np.flatnonzero(np.isfinite(recording[signal]))
    values, time = recording[signal][at], recording.time[at]
    steps = np.diff(time)
    with np.errstate(all="ignore"):
        speeds = np.abs(np.diff(values) / steps)
    noise = recording.noise.get(signal)
    return SignalSummary(
        unit=SIGNALS[signal].unit,
        least=float(values.min()),
        median=float(np.median(values)),
        most=float(values.max()),
        noise=None if noise is None else noise.rms,
        rate=1.0 / float(np.median(steps)) if steps.size and not recording.kind.steady else None,
        speed=None
        if recording.kind.steady
        else float(np.percentile(speeds, 99.0))
        if steps.size and np.isfinite(speeds).all()
        else None,
        missing=missing_share(recording, signal),
    )


def without_empty_signals(recording: Recording) -> Recording:
    """Return a recording without the signals of which no sample was measured."""
    return replace(
        recording, signals={n: values for n, values in recording.signals.items() if np.isfinite(values).any()}
    )


def missing_share(recording: Recording, signal: str) -> float:
    """Return the share of a recording's time in which ``signal`` ought to have been measured and was not.

    A slower clock misses nothing: gaps of more than ``GAP_PERIODS`` of the signal's own periods count, if other signals
    were measured in them, and so does what is cut off at either end.
    """
    finite = np.isfinite(recording[signal])
    if finite.all():
        return 0.0
    at = np.flatnonzero(finite)
    steps, rows = np.diff(recording.time[at]), np.diff(at)
    own = float(np.percentile(steps, PERIOD_PERCENTILE)) if steps.size else np.inf
    ends = np.array([recording.time[at[0]] - recording.time[0], recording.time[-1] - recording.time[at[-1]]])
    lost = float(steps[(steps > GAP_PERIODS * own) & (rows > 1)].sum() + ends[ends > GAP_PERIODS * own].sum())
    return lost / float(recording.time[-1] - recording.time[0])
