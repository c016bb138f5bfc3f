"""Repairs of a clock that are certain: a counter that wraps, and stamps that are coarser than the sampling period."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np

from pneucli.arrays import Array, Indices
from pneucli.io.raw_file import Repair
from pneucli.messages.formatting import format_plain

LARGEST_DECADE, SMALLEST_DECADE = 2, -9  # of the step of stamps, 10^n s
MAX_ROUNDING = 1e-3  # of that step, by which binary numbers may miss its multiples
MIN_UNEVEN_SHARE = 0.2  # of the period, by which a stamp must miss an even clock to matter
MIN_UNEVEN_STEPS = 8  # fewer are rows that the logger repeated or lost
MAX_SPREAD = 1.25  # steps: an even clock that is cut to steps misses its stamps by up to one, and the line is estimated
MIN_ROWS = 50  # of a run without a gap
MAX_GAP_RATIO = 2.5  # of the usual step between different stamps: a longer one is a gap


@dataclass
class EvenClock:
    """Places rows on the ticks of an even clock, batch by batch; each run of rows without a gap has ticks of its own.

    ``step`` is the step of the stamps in s, ``longest_step`` that between neighbours without a gap; ``rows`` is how
    many rows were placed, ``refused`` how many runs no even clock explains. Whole milliseconds of a controller that
    logs at 2 kHz alternate, and a velocity from them is wrong by as much; where an even clock, read in steps of the
    stamps, explains every stamp, its ticks take their place.
    """

    step: float
    longest_step: float
    rows: int = 0
    refused: int = 0
    _last: float = np.nan  # stamp
    _next_tick: float = np.nan  # of the present run; NaN where it has no ticks yet
    _period: float = np.nan

    @classmethod
    def of(cls, time: Array) -> EvenClock | None:
        """Return the clock of the first stamps in s, shape (n,); None if they are fine, or no even clock has them."""
        if time.size < MIN_ROWS or not np.isfinite(time).all() or np.any(np.diff(time) < 0) or time[0] == time[-1]:
            return None
        step, steps = _step(time), np.diff(time)
        if step is None:
            return None
        longest = max(MAX_GAP_RATIO * float(np.median(steps[steps > 0])), 1.5 * step)
        within = steps[steps <= longest]
        if step < MIN_UNEVEN_SHARE * within.mean() or _uneven_count(within) < MIN_UNEVEN_STEPS:
            return None
        trial = cls(step, longest)
        trial.place(time)
        return None if trial.refused or trial.rows <= 0.5 * time.size else cls(step, longest)

    def place(self, time: Array) -> Array:
        """Return the ticks at which the next rows were recorded, in s; stamps that no even clock explains stay."""
        if not time.size or not np.isfinite(time).all():
            return time
        steps = np.diff(np.concatenate([[self._last], time]))
        runs = np.split(time, np.flatnonzero(~((steps >= 0) & (steps <= self.longest_step))))
        self._last = float(time[-1])
        placed = [self._continued(runs[0])]
        for run in runs[1:]:
            self._next_tick = np.nan
            placed.append(self._continued(run))
        return np.concatenate(placed)

    def _continued(self, stamps: Array) -> Array:
        """Return the ticks of the next rows of the present run: as before where that explains them, or else anew."""
        if not stamps.size:
            return stamps
        k = np.arange(stamps.size)
        ticks = self._next_tick + self._period * k
        if not np.all((ticks - stamps <= MAX_SPREAD * self.step) & (stamps - ticks <= (MAX_SPREAD - 1.0) * self.step)):
            self._next_tick = np.nan
            tells = stamps.size >= MIN_ROWS and _uneven_count(np.diff(stamps)) >= MIN_UNEVEN_STEPS
            period = float(np.cov(k, stamps - stamps[0])[0, 1] / np.var(k, ddof=1)) if tells else self._period
            misses = stamps - stamps[0] - period * k
            if not np.ptp(misses) <= MAX_SPREAD * self.step:
                self.refused += tells
                return stamps
            ticks = stamps[0] + np.max(misses) + period * k  # a stamp tells whole steps that have passed
            self._period = period
        self._next_tick = float(ticks[-1]) + self._period
        self.rows += stamps.size
        return np.asarray(ticks)


def _uneven_count(steps: Array) -> int:
    """Return how many steps differ from the usual one by more than the clock may."""
    usual, period = np.median(steps), np.mean(steps)
    return int(np.count_nonzero(np.abs(steps - usual) > MIN_UNEVEN_SHARE * period))


def _step(time: Array) -> float | None:
    """Return the largest power of ten in s of which all differences of stamps are multiples; None where none is."""
    since_first = time - time[0]
    for decade in range(LARGEST_DECADE, SMALLEST_DECADE - 1, -1):
        multiples = since_first / 10.0**decade
        if np.max(np.abs(multiples - np.round(multiples))) < MAX_ROUNDING:
            return float(10.0**decade)
    return None


Batch = dict[str, Array]

_DAY = 86_400.0  # s
# what a counter of stamps counts to, in its own unit: bits; microseconds of 32 bits in ms or s; a day in s, ms, us
COUNTER_PERIODS = (2.0**16, 2.0**24, 2.0**31, 2.0**32, 2.0**32 / 1e3, 2.0**32 / 1e6, _DAY, _DAY * 1e3, _DAY * 1e6)
MAX_WRAP_STEPS = 20.0  # usual steps of the clock, that it may have gone on by where it wraps
MIN_PERIOD_STEPS = 100.0  # usual steps in a period of the counter
MIN_REPEATED_SHARE = 0.5  # of the stamps that repeat the one before: fewer are single faults of the logger
MIN_REGULAR_SHARE = 0.8  # of the runs of equal stamps, that are as long as most of them, within a quarter
MIN_RUNS, MIN_SHARED_ROWS = 2, 16  # whole runs of equal stamps, and rows in all


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

    Stamps of an even clock give way to its ticks (:class:`EvenClock`); other stamps that several rows share
    are spread over these. Which of both is decided by the first batch.
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
    parts = [first, *batches]
    whole = {name: np.concatenate([part[name] for part in parts]) for name in first}
    whole["time"], period = _spread(whole["time"])
    rows = whole["time"].size
    message = f"{rows} rows share their stamps with others, as the clock is coarse; they were spread evenly, "
    message += f"{format_plain(period, 3)} s apart, and each may be off by as much"
    repairs.append(Repair("time", "spread", rows, message))
    yield whole


def continuous_stamps(raw: Array) -> Array:
    """Return raw stamps as they are read: over the wraps of their counter, and spread where the clock is coarse."""
    return spread_stamps(CounterClock().unwrap(raw))


def spread_stamps(time: Array) -> Array:
    """Return the stamps of a coarse clock spread evenly; the same array where the clock is not coarse."""
    clock = None if _shares_evenly(time) else EvenClock.of(time)
    if clock is not None:
        return clock.place(time)
    return _spread(time)[0] if _is_coarse(time) else time


def _shares_evenly(time: Array) -> bool:
    """Return whether equally many rows share each stamp but the first and the last."""
    return _is_coarse(time) and bool(np.ptp(np.diff(_run_edges(time))[1:-1]) == 0)


def _is_coarse(time: Array) -> bool:
    """Return whether most stamps repeat the one before, and equally many rows share each."""
    if time.size < MIN_SHARED_ROWS or not np.isfinite(time).all() or np.any(np.diff(time) < 0):
        return False
    lengths = np.diff(_run_edges(time))[1:-1]
    if lengths.size < MIN_RUNS or np.mean(np.diff(time) == 0) <= MIN_REPEATED_SHARE:
        return False
    usual = float(np.median(lengths))
    return bool(np.mean(np.abs(lengths - usual) <= max(1.0, 0.25 * usual)) >= MIN_REGULAR_SHARE)


def _run_edges(time: Array) -> Indices:
    return np.concatenate([[0], np.flatnonzero(np.diff(time) != 0) + 1, [time.size]])


def _spread(time: Array) -> tuple[Array, float]:
    """Return stamps spread over the rows that share them, and the period of the rows."""
    edges = _run_edges(time)
    lengths = np.diff(edges)
    steps = np.append(np.diff(time[edges[:-1]]), np.nan) / lengths
    period = float(np.median(steps[:-1])) if lengths.size > 1 else 0.0
    steps = np.where(steps < MAX_GAP_RATIO * period, steps, period)
    inside = np.arange(time.size) - np.repeat(edges[:-1], lengths)
    if lengths.size > 2 and lengths[0] < np.median(lengths):  # the recording begins within this stamp
        steps[0] = period
        inside[: lengths[0]] += int(np.median(lengths)) - lengths[0]
    return np.asarray(time + inside * np.repeat(steps, lengths)), period
