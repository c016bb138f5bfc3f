"""Long recordings, thinned to stretches: minutes tell how a rig behaves as well as hours do."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pneucli.recording import Recording

MAX_SAMPLES = 100_000  # samples in all: their derivatives for all parameters fit into a gigabyte
MAX_SEGMENTS = 10  # of one recording, so that what drifts over it is seen
MIN_HORIZONS = 4.0  # of the comparison, at least, in one stretch


def subsample(recordings: Sequence[Recording], max_samples: int, horizon: float) -> list[Recording]:
    """Return recordings of at most ``max_samples`` samples in all: the longest are cut to stretches, spread evenly over them.

    What is short, such as the steps of a valve test, stays whole. Stretches keep their recording's name and are at
    least some horizons (s) long; no sample is moved or averaged, so that nothing fast is lost.
    """
    level = _common_size([one.time.size for one in recordings], max_samples)
    return [piece for one in recordings for piece in _segments(one, level, horizon)]


def _common_size(sizes: Sequence[int], most: int) -> int:
    """Return the size to which the larger ones are cut so that all together are no more than ``most``."""
    if sum(sizes) <= most:
        return max(sizes, default=0)
    left, waiting = most, sorted(sizes)
    while waiting and waiting[0] * len(waiting) <= left:
        left -= waiting.pop(0)
    return left // len(waiting)


def _segments(one: Recording, level: int, horizon: float) -> Iterator[Recording]:
    n = one.time.size
    if n <= level:
        yield one
        return
    shortest = max(int(MIN_HORIZONS * horizon / one.period), 1)
    number = int(np.clip(level // shortest, 1, MAX_SEGMENTS))
    size = level // number
    for start in np.linspace(0, n - size, number).astype(int):
        part = slice(start, start + size)
        signals = {name: s[part].copy() for name, s in one.signals.items()}  # a view would keep the whole in memory
        yield replace(one, time=one.time[part].copy(), signals=signals)
