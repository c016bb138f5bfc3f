"""Repairs of a clock that are certain: a counter that wraps, and stamps that are coarser than the sampling period."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from pneucli.io.even_clock import EvenClock
from pneucli.io.raw_file import Repair
from pneucli.messages.formatting import format_plain

Array = NDArray[np.float64]
Batch = dict[str, Array]

_DAY = 86_400.0  # s
# what a counter of stamps counts to, in its own unit: bits; microseconds of 32 bits in ms or s; a day in s, ms, us
COUNTER_PERIODS = (2.0**16, 2.0**24, 2.0**31, 2.0**32, 2.0**32 / 1e3, 2.0**32 / 1e6, _DAY, _DAY * 1e3, _DAY * 1e6)
MAX_WRAP_STEPS = 20.0  # usual steps of the clock, that it may have gone on by where it wraps
MIN_PERIOD_STEPS = 100.0  # usual steps in a period of the counter
MIN_REPEATED_SHARE = 0.5  # of the stamps that repeat the one before: fewer are single faults of the logger
MIN_REGULAR_SHARE = 0.8  # of the runs of equal stamps, that are as long as most of them, within a quarter
MAX_GAP_RATIO = 2.5  # of the usual step between stamps: a longer one is a gap, and nothing is spread over it
MIN_RUNS = 8


class CounterClock:
    """Lets a clock whose counter wraps go on, batch by batch; ``count`` is how often it wrapped."""

    def __init__(self) -> None:
        self.count = 0
        self._last = np.nan
        self._added = 0.0

    def unwrap(self, stamps: Array) -> Array:
        """Return raw stamps, in the file's own unit, that go on where the counter wraps."""
        joined = np.concatenate([[self._last], stamps])
        self._last = float(stamps[-1]) if stamps.size and np.isfinite(stamps[-1]) else self._last
        steps = np.diff(joined)
        back = np.flatnonzero(steps < 0)
        forward = steps[steps > 0]
        if (not back.size or not forward.size) and not self._added:
            return stamps
        usual = float(np.median(forward)) if forward.size else 0.0
        added = np.zeros(steps.size)
        for at in back:
            added[at] = _counter_period(-float(steps[at]), usual)
        self.count += int(np.count_nonzero(added))
        total = self._added + np.cumsum(added)
        self._added = float(total[-1]) if total.size else self._added
        return np.asarray(stamps + total)


def _counter_period(backward: float, usual: float) -> float:
    """Return the period of the counter that wrapped; 0 where none explains the step back."""
    near = [
        p for p in COUNTER_PERIODS if 0.0 <= p - backward <= MAX_WRAP_STEPS * usual and p > MIN_PERIOD_STEPS * usual
    ]
    return near[0] if near else 0.0


def spread_repeated_stamps(batches: Iterator[Batch], repairs: list[Repair]) -> Iterator[Batch]:
    """Yield the same rows; those of a coarse clock are spread evenly.

    Stamps of an even clock give way to its ticks (:mod:`pneucli.io.even_clock`); other stamps that several rows share
    are spread over these. Which of both is decided by the first batch. The rows of the last stamp of a batch wait for
    the next one.
    """
    first = next(batches, None)
    if first is None:
        return
    clock = None if _shares_evenly(first["time"]) else EvenClock.of(first["time"])
    if clock is not None:
        for batch in chain([first], batches):
            yield batch | {"time": clock.place(batch["time"])}
        cause = f"an even clock, read in steps of {format_plain(clock.step)} s, has these stamps"
        repairs.append(Repair("time", "spread", clock.rows, f"{cause}; {clock.rows} rows were placed on its ticks"))
        return
    if not _is_coarse(first["time"]):
        yield first
        yield from batches
        return
    waiting, rows, period = first, 0, 0.0
    for batch in batches:
        ready = _last_run(waiting["time"])
        if ready:
            time, period = _spread(waiting["time"][:ready], waiting["time"][ready], period)
            rows += ready
            yield {name: values[:ready] for name, values in waiting.items()} | {"time": time}
        waiting = {name: np.concatenate([waiting[name][ready:], batch[name]]) for name in waiting}
    time, _ = _spread(waiting["time"], None, period)
    rows += time.size
    message = f"{rows} rows share their stamps with others, as the clock is coarse; they were spread evenly"
    repairs.append(Repair("time", "spread", rows, message))
    yield waiting | {"time": time}


def spread_stamps(time: Array) -> Array | None:
    """Return the stamps of a coarse clock spread evenly; None where the clock is not coarse."""
    clock = None if _shares_evenly(time) else EvenClock.of(time)
    if clock is not None:
        return clock.place(time)
    return _spread(time, None, 0.0)[0] if _is_coarse(time) else None


def _shares_evenly(time: Array) -> bool:
    """Return whether equally many rows share each stamp but the first and the last."""
    return _is_coarse(time) and bool(np.ptp(np.diff(_run_edges(time))[1:-1]) == 0)


def _is_coarse(time: Array) -> bool:
    """Return whether most stamps repeat the one before, and equally many rows share each."""
    if time.size < 2 * MIN_RUNS or not np.isfinite(time).all() or np.any(np.diff(time) < 0):
        return False
    lengths = np.diff(_run_edges(time))[1:-1]
    if lengths.size < MIN_RUNS or np.mean(np.diff(time) == 0) <= MIN_REPEATED_SHARE:
        return False
    usual = float(np.median(lengths))
    return bool(np.mean(np.abs(lengths - usual) <= max(1.0, 0.25 * usual)) >= MIN_REGULAR_SHARE)


def _run_edges(time: Array) -> NDArray[np.intp]:
    return np.concatenate([[0], np.flatnonzero(np.diff(time) != 0) + 1, [time.size]])


def _last_run(time: Array) -> int:
    """Return where the run of the last stamp begins."""
    return int(_run_edges(time)[-2])


def _spread(time: Array, following: float | None, period: float) -> tuple[Array, float]:
    """Return stamps spread over their rows, and the period; ``following`` is the stamp after them, if one is known."""
    edges = _run_edges(time)
    lengths = np.diff(edges)
    stamps = time[edges[:-1]]
    ends = np.append(stamps[1:], np.nan if following is None else following)
    steps = (ends - stamps) / lengths
    known = steps[np.isfinite(steps) & (steps > 0)]
    period = float(np.median(known)) if known.size else period
    steps = np.where(np.isfinite(steps) & (steps < MAX_GAP_RATIO * period), steps, period)
    inside = np.arange(time.size) - np.repeat(edges[:-1], lengths)
    return np.asarray(time + inside * np.repeat(steps, lengths)), period
