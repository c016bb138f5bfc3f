"""Repairs of the raw numbers of one signal, before units: marks of missing values, roll-over, and values that are held.

What was replaced, undone or filled in is counted and reported; numbers that need no repair pass bit by bit.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pneucli.arrays import Array
from pneucli.io.channel_clocks import hold_missing
from pneucli.io.clock_repairs import CounterClock
from pneucli.io.missing_marks import MarkDetector
from pneucli.io.raw_file import Channel, Repair
from pneucli.io.roll_over import RollOverCorrector
from pneucli.messages.formatting import format_plain

MIN_CHANGES = 50
MIN_SAME_PHASE = 0.98  # of the changes, that lie a multiple of k rows apart
MIN_FILLED = 0.5  # of the multiples of k at which the reading changes: what rests does not tell k
MAX_ROWS = 1000  # that a sample may be held for


class HeldReadingDetector:
    """Finds a reading that is held and takes its repetitions away, batch by batch.

    ``rows`` is the number of rows for which each sample is held, 1 where the reading is not held; ``removed`` counts
    the repetitions, which are no samples: they become missing. The first batch decides.
    """

    def __init__(self, *, remove: bool = True) -> None:
        self.rows = 0
        self.removed = 0
        self._remove = remove
        self._phase = 0  # rows of the next batch before a new sample

    def thin(self, values: Array) -> Array:
        """Return ``values`` with NaN where a sample is repeated; the same array where none is."""
        if not self.rows:
            self.rows, self._phase = _hold(values)
        if self.rows == 1:
            return values
        sampled = np.zeros(values.size, dtype=np.bool_)
        sampled[self._phase :: self.rows] = True
        self._phase = (self._phase - values.size) % self.rows
        self.removed += int(np.count_nonzero(~sampled & np.isfinite(values)))
        return np.where(sampled, values, np.nan) if self._remove else values


def _hold(values: Array) -> tuple[int, int]:
    """Return for how many rows each sample is held, and the row of the first new sample."""
    changes = np.flatnonzero(values[1:] != values[:-1]) + 1
    changes = changes[np.isfinite(values[changes]) & np.isfinite(values[changes - 1])]
    if changes.size < MIN_CHANGES:
        return 1, 0
    rows = int(np.median(np.diff(changes)))
    if not 1 < rows <= MAX_ROWS:
        return 1, 0
    phases = np.bincount(changes % rows, minlength=rows)
    phase = int(np.argmax(phases))
    regular = phases[phase] >= MIN_SAME_PHASE * changes.size and changes.size >= MIN_FILLED * values.size / rows
    return (rows, phase) if regular else (1, 0)


COMMANDS = ("u", "u2", "x_ref", "p_ref")  # set, not sensed: they hold their value, jump and rest as they like
POSITIONS = ("x", "x_ref")  # whose counter may roll over


def is_held(name: str, channel: Channel) -> bool:
    """Return whether a signal keeps its value until its next stamp: as stated, by default a command does."""
    return name in COMMANDS if channel.hold is None else channel.hold


class SignalRepairs:
    """Repairs one signal batch by batch, in the numbers of its column."""

    def __init__(self, name: str, channel: Channel) -> None:
        self._name = name
        command = name in COMMANDS
        self._held = is_held(name, channel)
        self._marks = MarkDetector(channel.missing, command=command) if name != "time" else None
        self._counter = CounterClock() if name == "time" else None
        self._roll_over = RollOverCorrector() if name in POSITIONS else None
        self._sampling = HeldReadingDetector(remove=not self._held) if channel.hold is None and name != "time" else None
        self._last = np.nan
        self._filled = 0

    def repair(self, values: Array) -> Array:
        """Return the next batch, repaired; the same array where there is nothing to repair."""
        if self._counter is not None:
            return self._counter.unwrap(values)
        if self._marks is not None:
            values = self._marks.replace(values)
        if self._roll_over is not None:
            values = self._roll_over.correct(values)
        if self._sampling is not None:
            values = self._sampling.thin(values)
        if self._held:
            values, filled = hold_missing(values, self._last)
            self._last = float(values[-1]) if values.size else self._last
            self._filled += filled
        return values

    def repairs(self) -> Iterator[Repair]:
        """Yield what was repaired so far."""
        if self._counter is not None and self._counter.count:
            count = self._counter.count
            yield Repair("time", "counter", count, f"the counter of the clock wraps {count} times; undone")
        if self._marks is not None:
            for mark, count in sorted(self._marks.counts.items()):
                message = f"{count} samples are {format_plain(mark, 10)}, a mark of no value: missing"
                yield Repair(self._name, "mark", count, message)
        yield from self._roll_over_repair()
        rows = self._sampling.rows if self._sampling is not None else 1
        if rows > 1 and not self._held:
            message = (
                f"each sample stands in {rows} rows: it was held; the {self._sampling_removed} repetitions are missing"
            )
            yield Repair(self._name, "held", self._sampling_removed, message)
        elif rows > 1:
            yield Repair(
                self._name, "set-slowly", rows, f"it changes once in {rows} rows: it is set more slowly than logged"
            )
        if self._filled:
            message = f"{self._filled} fields are empty; each holds the value before it"
            yield Repair(self._name, "hold", self._filled, message)

    @property
    def _sampling_removed(self) -> int:
        return self._sampling.removed if self._sampling is not None else 0

    def _roll_over_repair(self) -> Iterator[Repair]:
        found = self._roll_over.found if self._roll_over is not None else None
        if found is None:
            return
        size = f"{format_plain(found.period)} of its column's unit"
        turns = f"the position jumps by {size}, {found.count} times: a counter rolls over"
        if found.certain:
            message = f"{turns}; undone (its zero may be off by a multiple of that)"
            yield Repair(self._name, "roll-over", found.count, message)
        else:
            yield Repair(self._name, "jumps", found.count, f"{turns}; kept, as its period is not certain")
