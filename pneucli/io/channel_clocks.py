"""One table of clocks: channels that were sampled at stamps of their own become one table.

The readings that were sampled fastest give the stamps. A command holds its value until its next stamp. A slower
reading stays as sparse as it was measured: each of its samples stands at the nearest stamp, interpolated over at most
half a period of the fast clock, and all other stamps have none. Short tables, such as digitised figures, keep all their
stamps.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pneucli.arrays import Array, Indices, Mask
from pneucli.errors import InputError
from pneucli.io.raw_file import Repair
from pneucli.io.timestamp_order import RowLocator, Table, drop_disordered, have_one_clock, join_tables
from pneucli.messages.formatting import format_plain

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
    if max(table.time.size for table in _with_readings(kept, held)) < MIN_GRID_SAMPLES:
        table, losses = join_tables(tables, locate)
        columns = {name: hold_missing(v)[0] if name in held else v for name, v in table.columns.items()}
        return Alignment(replace(table, columns=columns), losses)
    return _on_fastest_clock(kept, held, losses, locate)


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
    shared = [fastest.rows[inside], *(_shared_rows(table, held, span) for table in others)]
    read, used = (np.unique(np.concatenate(rows)).size for rows in ([table.rows for table in tables], shared))
    losses = losses + Counter({"joined": used - int(time.size), "no-overlap": read - used})
    return Alignment(Table(time, columns, fastest.rows[inside]), losses, repairs)


def _inside(table: Table, span: tuple[float, float]) -> Mask:
    return (table.time >= span[0]) & (table.time <= span[1])


def _shared_rows(table: Table, held: Collection[str], span: tuple[float, float]) -> Indices:
    """Return the rows of a table that are used; commands from before the span hold their value in it."""
    return table.rows if table.columns.keys() <= set(held) else table.rows[_inside(table, span)]


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
