"""The rows of all formats: which stamps are kept, which rows are left out, and tables over several clocks.

Rows read = samples + the rows of each kind of loss. Rows without a stamp, rows that repeat one (the last is kept) and
up to three rows in a row that are out of order are left out and counted; a clock that runs back for longer is refused.

Of channels with clocks of their own the readings that were sampled fastest give the stamps. A command holds its value
until its next stamp. A slower reading stays as sparse as it was measured: each of its samples stands at the nearest
stamp, interpolated over at most half a period of the fast clock, and all other stamps have none. Short tables, such as
digitised figures, keep all their stamps.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array, Mask
from pneucli.errors import InputError
from pneucli.io.raw_file import ColumnValues, Repair
from pneucli.messages.formatting import format_plain

RowClasses = NDArray[np.int8]
RowLocator = Callable[[int], str]  # of a row, counted from 0, in words

LOSS_MESSAGES = {  # of one row, and of several
    "no-stamp": ("row without a time stamp was left out", "rows without a time stamp were left out"),
    "duplicate": ("row repeats a time stamp; the last was kept", "rows repeat a time stamp; the last was kept"),
    "backward": ("isolated row out of order in time was left out", "isolated rows out of order in time were left out"),
    "truncated": ("row, the last, is cut off and was left out", "rows, the last, are cut off and were left out"),
    "outside": ("row lies outside from and to", "rows lie outside from and to"),
    "other-channel": ("row belongs to a channel that is not taken", "rows belong to channels that are not taken"),
    "joined": ("row shares the sample of another channel's row", "rows share the sample of another channel's row"),
    "no-overlap": ("row lies outside the time that all share", "rows lie outside the time that all channels share"),
}
ROW_CLASSES = ("kept", "no-stamp", "duplicate", "backward")
MAX_BACKWARD_ROWS = 3  # rows in a row whose stamps go back
MIN_FALLING_SHARE, MIN_FALLING_ROWS = 0.98, 4  # steps that go back, and rows, where the newest row stands first
SUMMER_TIME, SUMMER_TIME_SLACK = 3600.0, 60.0  # s by which a clock goes back in autumn
LOOKAHEAD_ROWS = 2  # rows that must follow before one is judged
MAX_MAGNITUDE = 1e30  # no sensor reads more, in any SI unit: an overflow, or the mark of one


@dataclass(frozen=True)
class Table:
    """Rows of one clock (s): ``columns`` by name, and ``rows``, where each stands among all rows of the file."""

    time: Array
    columns: Mapping[str, Array]
    rows: NDArray[np.intp]


def falls(time: ColumnValues) -> bool:
    """Return whether stamps fall from row to row: the newest row stands first."""
    known = time[np.isfinite(time)]
    if known.size < MIN_FALLING_ROWS or not known[-1] < known[0]:
        return False
    return bool(np.mean(np.diff(known) <= 0) > MIN_FALLING_SHARE)


NEWEST_FIRST = "the newest row stands first; the rows were read from the last one up"


class TimestampCheck:
    """Classifies the rows of one clock by their stamps, batch by batch."""

    def __init__(self, place: RowLocator) -> None:
        self._place = place
        self._row = 0  # that the next batch begins with
        self._highest = -np.inf
        self._kept = np.nan  # the stamp of the last row that was kept
        self._late: _BackwardRun | None = None  # that goes on where the next batch begins

    def classify_rows(self, time: Array, count: int) -> RowClasses:
        """Return the class of each of the first ``count`` rows, by number in ROW_CLASSES; later rows only give context.

        Raises InputError, with its place, where the clock runs back or more than half of the stamps repeat.
        """
        first, self._row = self._row, self._row + count
        classes = np.zeros(count, dtype=np.int8)
        if not count:
            return classes
        if max(self._highest, -MAX_MAGNITUDE) < time[0] and np.all(time[1:] > time[:-1]) and time[-1] <= MAX_MAGNITUDE:
            self._highest = self._kept = float(time[count - 1])
            self._late = None
            return classes
        usable = np.abs(time) <= MAX_MAGNITUDE
        time = np.where(usable, time, np.nan)
        inline = usable & ~self._isolated_ahead(time)
        highest = np.maximum.accumulate(np.concatenate([[self._highest], np.where(inline, time, -np.inf)]))
        before = highest[:-1]
        same, back = inline & (time == before), inline & (time < before)
        self._reject_backward_clock(same[:count], back[:count], before, time, first)
        self._highest = float(highest[count])
        repeated = self._repeated(time, inline & ~back, count)
        for kind, mask in (("no-stamp", ~usable), ("duplicate", repeated), ("backward", back | (usable & ~inline))):
            classes[mask[:count]] = ROW_CLASSES.index(kind)
        return classes

    def _repeated(self, time: Array, taken: Mask, count: int) -> Mask:
        """Mark the rows of equal stamps but the last: it has the state after an event, such as a command's step."""
        followed = np.zeros(time.size, dtype=np.bool_)
        for rows in range(1, LOOKAHEAD_ROWS + 1):
            followed[:-rows] |= taken[rows:] & (time[rows:] == time[:-rows])
        last = np.flatnonzero(taken & ~followed)
        stamps = np.concatenate([[self._kept], time[last]])
        again = stamps[1:] == stamps[:-1]  # behind rows that run back, too far for a look ahead
        repeated = taken & followed
        repeated[last[again]] = True
        kept = last[~again & (last < count)]
        self._kept = float(time[kept[-1]]) if kept.size else self._kept
        return repeated

    def _isolated_ahead(self, time: Array) -> Mask:
        """Mark single stamps that run ahead of both stamps after them, which go on from the one before."""
        wrong = np.zeros(time.size, dtype=np.bool_)
        for i in np.flatnonzero(np.diff(time) < 0):
            before = time[i - 1] if i else self._highest
            after = time[i + 1 : i + 3]
            wrong[i] = bool(before < after[0] and after.size == LOOKAHEAD_ROWS and after[0] < after[1] < time[i])
        return wrong

    def _reject_backward_clock(self, same: Mask, back: Mask, before: Array, time: Array, first: int) -> None:
        edges = np.flatnonzero(np.diff(np.concatenate([[0], back.view(np.int8), [0]])))
        runs = [_BackwardRun(first + i, j - i, before[i], time[i]) for i, j in edges.reshape(-1, 2).tolist()]
        if runs and runs[0].row == first and self._late:
            runs[0] = replace(self._late, length=self._late.length + runs[0].length)
        self._late = runs[-1] if runs and back[-1] else None
        longest = max(runs, key=lambda run: run.length, default=None)
        if longest and (longest.length > MAX_BACKWARD_ROWS or len(runs) > max(MAX_BACKWARD_ROWS, 0.01 * back.size)):
            found = f"the time goes back from {format_plain(longest.before, 9)} s to {format_plain(longest.time, 9)} s"
            mend = "a clock that starts anew makes another recording: state part = 1 where the header stands again "
            mend += "there, else cut the file there, or use skip_rows"
            if abs(longest.before - longest.time - SUMMER_TIME) < SUMMER_TIME_SLACK:
                mend = "if summer time ends there, write the stamps with their offset from UTC, such as 02:00:00+01:00"
            raise InputError(self._place(longest.row), found, "rising time stamps", mend, code="E045")
        if same.sum() > 0.5 * same.size > MAX_BACKWARD_ROWS:
            where, found = self._place(first + int(np.argmax(same))), "more than half of the time stamps repeat"
            raise InputError(where, found, "a stamp for each row", "export the time with more digits", code="E045")


@dataclass(frozen=True)
class _BackwardRun:
    """Rows in a row whose stamps go back: the first of them, how many, the stamp before it and its own."""

    row: int
    length: int
    before: float
    time: float


def count_losses(classes: RowClasses) -> Counter[str]:
    """Return how many rows were left out, by kind."""
    counts = np.bincount(classes, minlength=len(ROW_CLASSES))
    return Counter({kind: int(count) for kind, count in zip(ROW_CLASSES[1:], counts[1:], strict=True) if count})


def loss_message(kind: str, count: int) -> str:
    """Return how many rows were left out and why, in words."""
    return f"{count} {LOSS_MESSAGES[kind][count > 1]}"


def loss_repairs(losses: Mapping[str, int]) -> list[Repair]:
    """Return the rows that were left out, as repairs of the clock."""
    return [
        Repair("time", kind, losses[kind], loss_message(kind, losses[kind])) for kind in ROW_CLASSES if losses.get(kind)
    ]


def join_tables(tables: Sequence[Table], locate: RowLocator) -> tuple[Table, Counter[str]]:
    """Return one table over all stamps of ``tables``, NaN where a column has no row, and what became of the rows.

    Tables of equal clocks are one table, its stamps as they are. Otherwise each clock is checked by itself, and its
    losses are counted; ``joined`` are the rows that share a sample with a row of another table.
    """
    if have_one_clock(tables):
        columns = {name: values for table in tables for name, values in table.columns.items()}
        return Table(tables[0].time, columns, tables[0].rows), count_joined_rows(tables, tables[0].rows.size)
    kept, losses = drop_disordered(tables, locate)
    clock = np.unique(np.concatenate([table.time for table in kept]))
    columns = {name: _on_clock(clock, table.time, values) for table in kept for name, values in table.columns.items()}
    return Table(clock, columns, np.empty(0, dtype=np.intp)), losses + count_joined_rows(kept, clock.size)


def have_one_clock(tables: Sequence[Table]) -> bool:
    """Return whether all tables have the same stamps."""
    return all(np.array_equal(table.time, tables[0].time, equal_nan=True) for table in tables[1:])


def drop_disordered(tables: Sequence[Table], locate: RowLocator) -> tuple[list[Table], Counter[str]]:
    """Return each table without the rows that its clock leaves out, and how many rows of the file these are, by kind.

    A row that several tables share is lost only where each of them leaves it out.
    """
    kept, classes = zip(*(_drop_disordered_rows(table, locate) for table in tables), strict=True)
    of_row = np.full(max(int(table.rows.max(initial=-1)) for table in tables) + 1, len(ROW_CLASSES), dtype=np.int8)
    for table, own in zip(tables, classes, strict=True):
        of_row[table.rows] = np.minimum(of_row[table.rows], own)
    return list(kept), count_losses(of_row[of_row < len(ROW_CLASSES)])


def count_joined_rows(tables: Sequence[Table], samples: int) -> Counter[str]:
    """Return how many rows of the file share one of ``samples`` with a row of another table."""
    rows = np.unique(np.concatenate([table.rows for table in tables])).size if len(tables) > 1 else samples
    return Counter({"joined": rows - samples} if rows > samples else {})


def _drop_disordered_rows(table: Table, place: RowLocator) -> tuple[Table, RowClasses]:
    classes = TimestampCheck(lambda row: place(int(table.rows[row]))).classify_rows(table.time, table.time.size)
    keep = classes == 0
    return Table(
        table.time[keep], {name: values[keep] for name, values in table.columns.items()}, table.rows[keep]
    ), classes


def _on_clock(clock: Array, stamps: Array, values: Array) -> Array:
    spread = np.full(clock.size, np.nan)
    spread[np.searchsorted(clock, stamps)] = values
    return spread


MIN_GRID_SAMPLES = 100  # of the largest table; fewer are points of a figure, where every stamp counts
SAME_STAMP = 1e-3  # of a period of the fast clock, within which two stamps are one: the digits of the files
GAP_PERIODS = 2.5  # of a reading's own periods, over which nothing is interpolated
MEND = "check the start times and the units of the clocks, or take the channels of one clock only"
SAME_RATE = 1.5  # ratio of two rates, below which interpolation reduces noise and is reported


@dataclass
class Alignment:
    """Tables that became one, what became of their rows, and the notes about it."""

    table: Table
    losses: Counter[str] = field(default_factory=Counter)
    repairs: list[Repair] = field(default_factory=list)


def align_tables(tables: Sequence[Table], held: Collection[str], locate: RowLocator) -> Alignment:
    """Return one table over the stamps of ``tables``; signals of ``held`` keep their value until their next stamp.

    Raises InputError where a clock runs back, or where the tables have no time in common.
    """
    if have_one_clock(tables):
        return Alignment(*join_tables(tables, locate))
    kept, losses = drop_disordered(tables, locate)
    few = max(table.time.size for table in _with_readings(kept, held)) < MIN_GRID_SAMPLES
    if not few and not _lack_rows_alone([table.time for table in kept]):
        return _on_fastest_clock(kept, held, losses, locate)
    table, losses = join_tables(tables, locate)
    columns = {name: hold_missing(v)[0] if name in held else v for name, v in table.columns.items()}
    return Alignment(replace(table, columns=columns), losses)


def _lack_rows_alone(clocks: Sequence[Array]) -> bool:
    """Return whether all clocks are that of the most stamps, at its rate, and lack some of them: rows called bad."""
    longest = max(clocks, key=lambda one: one.size)
    rate = _period(longest)
    return all(_period(one) < SAME_RATE * rate and bool(np.isin(one, longest).all()) for one in clocks)


def _with_readings(tables: Sequence[Table], held: Collection[str]) -> Sequence[Table]:
    return [table for table in tables if table.columns.keys() - set(held)] or tables


def _on_fastest_clock(
    tables: Sequence[Table], held: Collection[str], losses: Counter[str], locate: RowLocator
) -> Alignment:
    reading = _with_readings(tables, held)
    fastest = min(reading, key=lambda table: _period(table.time))
    period = _period(fastest.time)
    start, end = max(float(table.time[0]) for table in tables), min(float(table.time[-1]) for table in reading)
    if start > end:
        found = f"one channel begins at {format_plain(start, 6)} s, and another one ends at {format_plain(end, 6)} s"
        raise InputError(
            locate(int(fastest.rows[0])), found, "channels that were recorded at one time", MEND, code="E045"
        )
    span = start - 0.5 * period, end + 0.5 * period
    inside = _inside(fastest, span)
    time = fastest.time[inside]
    columns = {name: values[inside] for name, values in fastest.columns.items()}
    repairs = []
    others = [table for table in tables if table is not fastest]
    for table in others:
        for name, values in table.columns.items():
            placed = _held(time, table.time, values, period) if name in held else _measured(time, table.time, values)
            columns[name] = placed
            repairs.append(
                Repair(name, "clock", int(table.time.size), _clock_note(name, table.time, period, name in held))
            )
    before = [set(table.columns) <= set(held) for table in others]  # commands from before the span hold in it
    used_rows = [table.rows[own | _inside(table, span)] for own, table in zip(before, others, strict=True)]
    shared = [fastest.rows[inside], *used_rows]
    read, used = (np.unique(np.concatenate(rows)).size for rows in ([table.rows for table in tables], shared))
    losses = losses + Counter({"joined": used - int(time.size), "no-overlap": read - used})
    return Alignment(Table(time, columns, fastest.rows[inside]), losses, repairs)


def _inside(table: Table, span: tuple[float, float]) -> Mask:
    return (table.time >= span[0]) & (table.time <= span[1])


def _clock_note(name: str, stamps: Array, period: float, is_held: bool) -> str:
    rate, base = 1.0 / _period(stamps), 1.0 / period
    stamp_rate = f"{format_plain(base, 4)} Hz"
    if is_held:
        return f"{stamps.size} values on a clock of its own, each held until the next, at stamps of {stamp_rate}"
    own_rate = f"sampled at {format_plain(rate, 4)} Hz on a clock of its own"
    note = f"{own_rate}; each sample stands at the nearest stamp of {stamp_rate}"
    return f"{note}, interpolated, which takes noise off" if base < SAME_RATE * rate else note


def _period(time: Array) -> float:
    return float(np.median(np.diff(time))) if time.size > 1 else np.inf


def _held(time: Array, stamps: Array, values: Array, period: float) -> Array:
    """Return at each time the value at the last stamp that is not after it."""
    at = np.searchsorted(stamps, time + SAME_STAMP * period, side="right") - 1
    return np.asarray(np.where(at < 0, np.nan, hold_missing(values)[0][np.maximum(at, 0)]))


def hold_missing(values: Array, before: float = np.nan) -> tuple[Array, int]:
    """Return values with each NaN replaced by the last value before it, and how many were; ``before`` precedes them."""
    finite = np.isfinite(values)
    if finite.all():
        return values, 0
    last = np.maximum.accumulate(np.where(finite, np.arange(values.size), -1))
    filled = np.where(last < 0, before, values[np.maximum(last, 0)])
    return filled, int(np.count_nonzero(np.isfinite(filled) & ~finite))


def _measured(time: Array, stamps: Array, values: Array) -> Array:
    """Return the samples of a reading, each at the stamp of ``time`` next to it, NaN at all other stamps."""
    measured = np.isfinite(values)
    stamps, values = stamps[measured], values[measured]
    placed = np.full(time.size, np.nan)
    if not stamps.size or time.size < 2:
        return placed
    own, period = _period(stamps), _period(time)
    right = np.clip(np.searchsorted(time, stamps), 1, time.size - 1)
    nearest = np.where(stamps - time[right - 1] < time[right] - stamps, right - 1, right)
    shift = time[nearest] - stamps
    moved = values + _change(stamps, values, shift, GAP_PERIODS * own)
    same = np.abs(shift) <= SAME_STAMP * period
    near = np.abs(shift) <= 0.5 * period * (1 + SAME_STAMP)
    order = np.argsort(-np.abs(shift), kind="stable")  # of two samples at one stamp the nearer is written last
    order = order[near[order]]
    placed[nearest[order]] = np.where(same, values, moved)[order]
    return placed


def _change(stamps: Array, values: Array, shift: Array, longest: float) -> Array:
    """Return by how much a reading changes over ``shift`` from each stamp, on the line to its neighbour."""
    if stamps.size < 2:
        return np.zeros_like(values)
    steps, rises = np.diff(stamps), np.diff(values)
    slopes = np.where(steps <= longest, rises / steps, 0.0)
    after, before = np.append(slopes, slopes[-1]), np.insert(slopes, 0, slopes[0])  # at either end the only slope
    return np.asarray(shift * np.where(shift >= 0, after, before))
