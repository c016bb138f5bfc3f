"""Long recordings reduced to segments: minutes describe a rig as well as hours."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pneucli.recording import Recording

MAX_SAMPLES = 100_000  # in all: the derivatives for all parameters need less than a gigabyte
MIN_REDUCTION = 2.0  # times: less saves too little for a fit of the given model that is not that of ``identify``
MAX_ERROR_SAMPLES = 300_000  # of which errors are stated: to simulate so many takes about as long as the search
MAX_SEGMENTS = 10  # of one recording, so that a drift over it is visible
MIN_HORIZONS = 4.0  # of the comparison, at least, in one segment


def subsample(recordings: Sequence[Recording], max_samples: int, horizon: float) -> list[Recording]:
    """Return recordings of at most ``max_samples`` samples in all: evenly spaced segments of the longest ones.

    Short recordings, such as the steps of a valve test, stay complete. A segment keeps the name of its recording and
    lasts at least MIN_HORIZONS horizons (s). No sample is moved or averaged, so that fast effects remain.
    """
    size_limit = _common_size([recording.time.size for recording in recordings], max_samples)
    return [segment for recording in recordings for segment in _segments(recording, size_limit, horizon)]


def searched_samples(samples: int) -> int:
    """Return to about how many of so many samples a search fits its models.

    >>> searched_samples(150_000), searched_samples(250_000)
    (150000, 100000)
    """
    return samples if samples <= MIN_REDUCTION * MAX_SAMPLES else MAX_SAMPLES


def _common_size(sizes: Sequence[int], max_samples: int) -> int:
    """Return the size to which larger recordings are cut so that all together have at most ``max_samples``."""
    if sum(sizes) <= max_samples:
        return max(sizes, default=0)
    remaining, waiting_sizes = max_samples, sorted(sizes)
    while waiting_sizes and waiting_sizes[0] * len(waiting_sizes) <= remaining:
        remaining -= waiting_sizes.pop(0)
    return remaining // len(waiting_sizes)


def _segments(recording: Recording, size_limit: int, horizon: float) -> Iterator[Recording]:
    n = recording.time.size
    if n <= size_limit:
        yield recording
        return
    shortest = max(int(MIN_HORIZONS * horizon / recording.period), 1)
    count = int(np.clip(size_limit // shortest, 1, MAX_SEGMENTS))
    size = size_limit // count
    for start in np.linspace(0, n - size, count).astype(int):
        part = slice(start, start + size)
        signals = {
            name: s[part].copy() for name, s in recording.signals.items()
        }  # a view would keep the whole in memory
        yield replace(recording, time=recording.time[part].copy(), signals=signals)
