"""Repairs of the raw numbers of one signal, before units: marks of missing values, roll-over, and values that are held.

What was replaced, undone or filled in is counted and reported; numbers that need no repair pass bit by bit.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pneucli.io.channel_clocks import hold_missing
from pneucli.io.clock_repairs import CounterClock
from pneucli.io.held_readings import HeldReadingDetector
from pneucli.io.missing_marks import MarkDetector
from pneucli.io.raw_file import Array, Channel, Repair
from pneucli.io.roll_over import RollOverCorrector
from pneucli.messages.formatting import format_plain

COMMANDS = ("u", "u2", "x_ref", "p_ref")  # set, not sensed: they hold their value, and may jump
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
