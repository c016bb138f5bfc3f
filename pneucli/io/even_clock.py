"""Stamps of an even clock that are coarser than its period: whole milliseconds of a controller that logs at 2 kHz.

Differences of such stamps alternate, and a velocity from them is wrong by as much; acceleration is wrong by more than
the motion has. Where an even clock, read in steps of the stamps, explains every stamp, its ticks take their place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

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
    many rows were placed, ``refused`` how many runs no even clock explains.
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
