"""The default horizon: the time from one restart of the model to the next, from the time scales of the recordings.

A model that restarts long before a reading has changed predicts hardly more than the restart state, and any model looks
right.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import takewhile

import numpy as np

from pneucli.arrays import Array
from pneucli.recording import Recording

MIN_HORIZON = 0.5  # s, in which the readings of most axes and valve tests change by most of their range
MIN_HORIZON_SAMPLES = 5  # samples within a horizon
RESPONSE_SHARE = 0.63  # of a reading's range: one time constant of a first-order response
MIN_RANGE_RATIO = 10.0  # of a reading's range over its noise; pure noise has 8 in 100,000 samples
STEPS = (1.0, 2.0, 5.0)  # of each power of ten


def default_horizon(recordings: Sequence[Recording]) -> float:
    """Return the horizon where the pipeline file states none.

    It is the longest time of the series 0.5, 1, 2, 5, ... s within which no reading changes by ``RESPONSE_SHARE`` of
    its range in any recording: the fastest response decides, because it restarts often enough for all others.

    Args:
        recordings: The recordings.

    Returns:
        The horizon in s, at least ``MIN_HORIZON`` and ``MIN_HORIZON_SAMPLES`` sampling periods.
    """
    free = [r for r in recordings if r.imposed is None]
    readings = [(y, r.period) for r in free for y in _readings(r)]
    horizon = max([MIN_HORIZON, *(MIN_HORIZON_SAMPLES * r.period for r in free)])
    if not readings:
        return horizon
    lags = _series(min(period for _, period in readings), max(y.size * period for y, period in readings))
    unresponsive = takewhile(lambda lag: not any(_responds_within(y, round(lag / p)) for y, p in readings), lags)
    return max([horizon, *unresponsive])


def _series(shortest: float, longest: float) -> Iterator[float]:
    """Yield the times of the series from ``shortest`` to ``longest``; in one of them a sine of any period responds."""
    for power in range(int(np.floor(np.log10(shortest))), int(np.floor(np.log10(longest))) + 1):
        yield from (step * 10.0**power for step in STEPS if shortest <= step * 10.0**power <= longest)


def _readings(recording: Recording) -> Iterator[Array]:
    """Yield the readings that respond; a constant, pure noise and derivatives of the position tell no time scale."""
    for name in ("p1", "p2", "temperature", "x" if "x" in recording else "v"):
        if name in recording:
            y = recording[name][np.isfinite(recording[name])]
            noise = recording.noise[name].rms if name in recording.noise else 0.0
            if y.size and np.ptp(y) > MIN_RANGE_RATIO * noise:
                yield y


def _responds_within(y: Array, lag: int) -> bool:
    """Whether a reading changes by ``RESPONSE_SHARE`` of its range over so many samples."""
    if not 0 < lag < y.size:
        return False
    return bool(np.max(np.abs(y[lag:] - y[:-lag])) >= RESPONSE_SHARE * np.ptp(y))
