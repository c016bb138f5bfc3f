"""Checks and repairs of one recording, batch by batch. Good data pass bit by bit; no value is invented.

Repaired, with counts: rows without a time stamp, duplicated stamps (the first row is kept), isolated stamps that are
out of order, infinite values, and spikes (they become NaN). Noticed only: NaN, gaps, a clock that jitters, frozen and
saturated channels. Refused: a clock that runs backward for longer, or whose stamps are too coarse.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from pneucli.errors import InputError
from pneucli.io.raw import Repair
from pneucli.io.runs import Runs
from pneucli.io.spikes import MARGIN, find_spikes

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Batch = dict[str, Array]

COMMANDS = ("u", "u2", "x_ref", "p_ref")  # set, not sensed: they may jump and rest as they like
ISOLATED = 3  # rows in a row whose stamps go back
GAP = 10.0  # sampling periods
JITTER = 0.2  # of a sampling period


class Cleaner:
    """Carries what must be known of earlier batches; ``place`` tells where a data row stands in the file.

    ``noise`` is the standard deviation of each signal as far as it is known (SI). ``push`` takes a batch and returns
    the rows that are settled, ``finish`` the rest; ``repairs`` then has what was done.
    """

    def __init__(self, place: Callable[[int], str], noise: Mapping[str, float] | None = None) -> None:
        self._place, self._noise = place, noise or {}
        self._held: Batch = {}
        self._context = 0  # leading rows of _held that have been handed out already
        self._rows_read = 0
        self._counts: dict[tuple[str, str], int] = {}
        self._clock = _Clock()
        self._runs: dict[str, Runs] = {}
        self._kept = 0

    def push(self, batch: Mapping[str, Array]) -> Batch:
        """Return settled rows; the last few wait for their neighbours."""
        return self._advance(batch, hold=MARGIN)

    def finish(self) -> Batch:
        """Return the rows that waited."""
        return self._advance({name: values[:0] for name, values in self._held.items()}, hold=0)

    def _advance(self, batch: Mapping[str, Array], hold: int) -> Batch:
        joined = {name: _join(self._held.get(name), values) for name, values in batch.items()}
        first_row = self._rows_read - (len(joined["time"]) - len(batch["time"]))
        self._rows_read += len(batch["time"])
        rows = self._in_order(joined, first_row)
        start, end = self._context, max(self._context, len(rows["time"]) - hold)
        rows = {name: self._mended(name, values, start, end) for name, values in rows.items()}
        done = {name: values[start:end] for name, values in rows.items()}
        self._clock.see(done["time"])
        self._kept += end - start
        begin = max(0, end - MARGIN)
        self._held = {name: values[begin:].copy() for name, values in rows.items()}
        self._context = end - begin
        return done

    def _in_order(self, rows: Mapping[str, Array], first_row: int) -> Batch:
        time = rows["time"]
        finite = np.isfinite(time)
        late = np.flatnonzero(np.diff(time) <= 0) if finite.all() else np.flatnonzero(finite)
        if finite.all() and not late.size:
            return dict(rows)
        keep = finite & ~_out_of_line(time)
        self._count("time", "no-stamp", int(np.sum(~finite)))
        highest = np.maximum.accumulate(np.where(keep, time, -np.inf))
        before = np.concatenate([[-np.inf], highest[:-1]])
        same, back = keep & (time == before), keep & (time < before)
        self._refuse_backward(back, time, before, first_row)
        self._count("time", "duplicate", int(same.sum()))
        self._count("time", "backward", int(back.sum() + np.sum(finite & ~keep)))
        if same.sum() > 0.5 * time.size > ISOLATED:
            where, found = self._place(first_row + int(np.argmax(same))), "more than half of the time stamps repeat"
            raise InputError(where, found, "a stamp for each row", "export the time with more digits")
        keep &= ~same & ~back
        return {name: values[keep] for name, values in rows.items()}

    def _refuse_backward(self, back: Mask, time: Array, before: Array, first_row: int) -> None:
        edges = np.flatnonzero(np.diff(np.concatenate([[0], back.view(np.int8), [0]])))
        lengths = edges[1::2] - edges[::2]
        if lengths.size and (lengths.max() > ISOLATED or lengths.size > max(ISOLATED, 0.01 * time.size)):
            at = int(edges[2 * int(np.argmax(lengths))])
            found = f"the time goes back from {before[at]:g} s to {time[at]:g} s"
            mend = "a clock that starts anew makes another recording: cut the file there, or use skip_rows"
            raise InputError(self._place(first_row + at), found, "rising time stamps", mend)

    def _mended(self, name: str, values: Array, start: int, end: int) -> Array:
        """Return one signal with its rows start..end mended; the same array where nothing is to mend."""
        if name == "time":
            return values
        bad = start + np.flatnonzero(~np.isfinite(values[start:end]))
        infinite = bad[np.isinf(values[bad])]
        self._count(name, "infinite", infinite.size)
        self._count(name, "nan", bad.size - infinite.size)
        values = _without(values, infinite)
        if name in COMMANDS:
            return values
        spikes = find_spikes(values, self._noise.get(name, 0.0))
        spikes = spikes[(spikes >= start) & (spikes < end)]
        self._count(name, "spike", spikes.size)
        values = _without(values, spikes)
        self._runs.setdefault(name, Runs(name)).see(values[start:end])
        return values

    def _count(self, signal: str, kind: str, count: int) -> None:
        if count:
            self._counts[signal, kind] = self._counts.get((signal, kind), 0) + count

    @property
    def period(self) -> float:
        """Median sampling period in s (of the first batch); NaN with fewer than two rows."""
        return self._clock.period

    @property
    def samples(self) -> int:
        """Rows that were handed out."""
        return self._kept

    def repairs(self) -> list[Repair]:
        """Return all that was mended or noticed so far."""
        counted = [Repair(*key, count, _MESSAGES[key[1]].format(count)) for key, count in self._counts.items()]
        noticed = [repair for runs in self._runs.values() for repair in runs.repairs()]
        return [*counted, *self._clock.repairs(), *noticed]


_MESSAGES = {
    "no-stamp": "{} rows without a time stamp were left out",
    "duplicate": "{} rows repeat a time stamp; the first was kept",
    "backward": "{} isolated rows whose time is out of order were left out",
    "infinite": "{} infinite values became NaN",
    "nan": "{} values are missing (NaN)",
    "spike": "{} spikes became NaN",
}


class _Clock:
    """Median period, gaps and jitter of the time stamps that were handed out."""

    def __init__(self) -> None:
        self.period = float("nan")
        self._last = np.empty(0)
        self._gaps, self._missing, self._uneven, self._intervals = 0, 0.0, 0, 0

    def see(self, time: Array) -> None:
        """Take note of the next stamps."""
        steps = np.diff(np.concatenate([self._last, time]))
        self._last = time[-1:] if time.size else self._last
        if not steps.size:
            return
        if not np.isfinite(self.period):
            self.period = float(np.median(steps))
        wide = steps[steps > GAP * self.period]
        self._gaps += wide.size
        self._missing += float(wide.sum())
        self._uneven += int(np.sum(np.abs(steps - self.period) > JITTER * self.period)) - wide.size
        self._intervals += steps.size

    def repairs(self) -> list[Repair]:
        """Return gaps and jitter as far as there are any."""
        found = []
        if self._gaps:
            message = f"{self._gaps} gaps, {self._missing:.3g} s in all, were left as they are"
            found.append(Repair("time", "gap", self._gaps, message))
        if self._uneven > max(ISOLATED, 0.01 * self._intervals):
            share = f"{100 * self._uneven / self._intervals:.0f} %"
            message = f"the clock jitters: {share} of the intervals are {100 * JITTER:.0f} % off {self.period:.4g} s"
            found.append(Repair("time", "jitter", self._uneven, message))
        return found


def _join(held: Array | None, values: Array) -> Array:
    return values if held is None or not held.size else np.concatenate([held, values])


def _without(values: Array, where: NDArray[np.intp]) -> Array:
    """Return ``values`` with NaN at ``where``; the same array where there is nothing to do."""
    if not where.size:
        return values
    values = values.copy()
    values[where] = np.nan
    return values


def _out_of_line(time: Array) -> Mask:
    """Mark single stamps that run ahead of both stamps after them, which themselves go on from the one before."""
    wrong = np.zeros(time.size, dtype=np.bool_)
    for i in np.flatnonzero(np.diff(time) < 0):
        before = time[i - 1] if i else -np.inf
        after = time[i + 1 : i + 3]
        wrong[i] = bool(before < after[0] and after.size == 2 and after[0] < after[1] < time[i])
    return wrong
