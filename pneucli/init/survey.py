"""Part of ``init``: what stands in a raw file of which nothing is known."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.init.clock_columns import computed_clocks, is_increasing, may_be_clock, paired_clocks
from pneucli.init.column_names import read_name
from pneucli.init.role_evidence import pressure_behind_valve
from pneucli.init.survey_types import Column, Guess, Survey
from pneucli.init.table_shapes import (
    MIN_PAUSE,
    in_unit,
    long_table,
    runs_below_one_another,
    runs_beside_one_another,
    with_unit_beside,
    with_validity,
)
from pneucli.io.clock import CounterClock, continuous_stamps
from pneucli.io.delimited import DelimitedReader
from pneucli.io.file_units import read_unit, unit_in_file
from pneucli.io.formats import is_text, open_raw, unpacked
from pneucli.io.packed import named_as
from pneucli.io.raw_file import ColumnKey, ColumnRequest, ColumnValues, RawFile, Reader
from pneucli.io.text_sniffer import SniffedLayout, apply_sniffed, is_unit, sniff, stated_numbers
from pneucli.io.timestamp_order import NEWEST_FIRST, Table, align_tables, falls
from pneucli.paths import file_on_disk
from pneucli.units import parse_unit, same_dimension

__all__ = ["Column", "Guess", "Survey", "survey_file"]

MAX_SURVEY_ROWS = 200_000  # rows that are looked at
SPARSE = 0.1  # of the rows of the longest clock: fewer are those of a command that is logged on change
_RATE = re.compile(r"\((\d+(?:\.\d+)?) (k)?Hz\)")
MAX_TEXTS = 3  # texts of a column that are shown


def survey_parts(raw: RawFile) -> list[Survey]:
    """Read what there is; a file of several runs is several recordings.

    Runs begin where the header and the clock start anew, or where a column says the run, or stand beside one another.
    Raises InputError as :func:`survey_file` does.
    """
    found = survey_file(raw)
    if found.parts:
        return [survey_file(replace(raw, part=number)) for number in range(1, found.parts + 1)]
    return [replace(found, columns=columns, run=run) for run, columns in found.runs] or [found]


def survey_file(raw: RawFile) -> Survey:
    """Read what there is; raises InputError where it cannot be read, or holds no numbers."""
    if not file_on_disk(raw.path).exists():
        raise InputError(str(raw.path), "no such file", "a raw file", "check the path", code="E002")
    inner = unpacked(raw.path)
    with named_as(raw.path, inner):
        found = _survey_text(replace(raw, path=inner)) if is_text(inner) else _survey_binary(replace(raw, path=inner))
    return replace(found, raw=replace(found.raw, path=raw.path))


def _survey_text(raw: RawFile) -> Survey:
    found = sniff(raw)
    stated = apply_sniffed(raw, found)
    reader = DelimitedReader(stated)
    columns, labels = _text_columns(reader, found)
    if max((one.values.size for one in columns), default=0) < 2:
        told = "one row of numbers" if columns else "no column of numbers"
        raise InputError(str(raw.path), told, "rows of numbers", "say --skip-rows or --delimiter", code="E041")
    bare = replace(stated, delimiter=raw.delimiter)
    plain = raw.delimiter is None and _same_table(bare, reader)
    columns, unused, runs = _shaped(reader, columns, labels)
    anew = bool(reader.header_lines) and _starts_anew(columns, reader.header_lines)
    parts = reader.header_lines + 1 if anew and not runs else 0
    return Survey(bare if plain else stated, True, columns, stated_numbers(raw, found), unused, parts, runs)


def _shaped(
    reader: Reader, columns: Sequence[Column], labels: Mapping[str, ColumnValues]
) -> tuple[list[Column], list[str], list[tuple[str, list[Column]]]]:
    """Return the columns of a table as one of signals, what is left out in words, and the columns of each run."""
    words = [one.message for one in reader.repairs if one.kind in ("words", "matlab-object")]
    if any(falls(one.values) for one in columns if may_be_clock(one)):
        columns = [replace(one, values=one.values[::-1]) for one in columns]
        labels = {key: own[::-1] for key, own in labels.items()}
        words.append(NEWEST_FIRST)
    if long := long_table(columns, labels):
        used = {one.where[0] for one in long if one.where is not None}
        used |= {key for key, own in labels.items() if all(map(is_unit, set(own)))}
        taken = {one.key for one in long}
        further = [one for one in columns if one.key not in taken and not one.unit]
        beside = {one.name: [f"{value:g}" for value in one.values] for one in further} | dict(labels)
        return long, [*words, *(_counted(key, own) for key, own in beside.items() if key not in used)], []

    def as_text(column: Column) -> ColumnValues:
        return _read(reader, [ColumnRequest(list(reader.names).index(str(column.key)), text=True)])[0]

    named = all(isinstance(one.key, str) and list(reader.names).count(one.key) == 1 for one in columns)
    timed = named and not computed_clocks(columns)
    runs = runs_below_one_another(columns, labels, as_text) if timed else []
    runs = runs or runs_beside_one_another(columns)
    valid, told = with_validity(columns, labels, as_text) if timed and not runs else (list(columns), set[str]())
    clocked = [(run, _with_clocks(own)) for run, own in runs]
    by_run = {one.where[0] for _, own in runs for one in own if one.where is not None}
    unused = [*words, *(_counted(key, own) for key, own in labels.items() if key not in by_run | told)]
    return (clocked[0][1] if clocked else _with_clocks(valid)), unused, clocked


def _with_clocks(columns: Sequence[Column]) -> list[Column]:
    found = [*computed_clocks(columns), *columns]
    behind = pressure_behind_valve(found, [read_name(one, False) for one in found])
    return _aligned(paired_clocks([*found, *behind]))


def _counted(key: str, texts: Iterable[Any]) -> str:
    """Return a column of text in words: what stands in it, and how often."""
    often = Counter(str(text) for text in texts if text)
    listed = ", ".join(f'"{text}" {count} times' for text, count in often.most_common(MAX_TEXTS))
    return f'"{key}": texts, {listed}' + ", ..." * (len(often) > MAX_TEXTS)


def _starts_anew(columns: Sequence[Column], headers: int) -> bool:
    """Return whether a clock goes back where the header stands again, or pauses as often as it does."""
    clock = next((one.finite_values for one in columns if is_increasing(one.finite_values)), np.empty(0))
    steps = np.diff(CounterClock().unwrap(clock)) if clock.size else clock
    pauses = np.count_nonzero(steps > MIN_PAUSE * np.median(steps)) if steps.size else 0
    return bool(np.any(steps < 0)) or pauses == headers


def _same_table(raw: RawFile, reader: DelimitedReader) -> bool:
    """Return whether reading finds the same columns by itself."""
    try:
        return DelimitedReader(raw).names == reader.names
    except InputError:
        return False


def _text_columns(reader: DelimitedReader, found: SniffedLayout) -> tuple[list[Column], dict[str, ColumnValues]]:
    """Return the columns of numbers, and those of text by their keys."""
    numbers = [n for n in range(len(reader.names)) if n not in {*reader.labels, *reader.dates}]
    asks = [ColumnRequest(n, thousands=found.thousands.get(n)) for n in numbers]
    labels = [ColumnRequest(n, text=True) for n in sorted(reader.labels)]
    read = _read(reader, [*asks, *labels])
    columns = []
    for ask, values in zip(asks, read, strict=False):
        name = found.names[ask.position] if ask.position < len(found.names) else ""
        often = reader.names.count(reader.names[ask.position]) > 1
        key: ColumnKey = ask.position + 1 if not found.header or often or not name else name
        title = found.titles[ask.position] if ask.position < len(found.titles) else ""
        one = _column(reader, ask.position, key, title or name, values, ask.thousands)
        above = found.units[ask.position] if ask.position < len(found.units) else ""
        columns.append(one if one.unit or not above else in_unit(one, read_unit(above)))
    by_place = {ask.position: values for ask, values in zip(labels, read[len(asks) :], strict=True)}
    columns = [with_unit_beside(one, by_place.get(ask.position + 1)) for ask, one in zip(asks, columns, strict=True)]
    if not any(found.names):  # each row says what stands behind: "valve_V;5.00;p1_bar;1.02"; one text is the rig's
        before = [set(by_place.get(ask.position - 1, ())) for ask in asks]
        if sum(len(own) == 1 for own in before) > 1:
            named = zip(columns, before, strict=True)
            columns = [replace(one, name=str(*own)) if len(own) == 1 and not one.name else one for one, own in named]
    return columns, {str(reader.names[place]): values for place, values in by_place.items()}


def _column(
    reader: Reader, place: int, key: ColumnKey, name: str, values: Array, thousands: str | None = None
) -> Column:
    """Return a column with the unit that the file states; stamps of a calendar are read in s."""
    if place in reader.stamps:
        return Column(key, name, "s", values, thousands=thousands)
    file_unit = unit_in_file(reader, place)
    if file_unit is None:
        return Column(key, name, "", values, thousands=thousands)
    written = "" if file_unit.unit and file_unit.certain else file_unit.text
    return Column(key, name, file_unit.unit, values, thousands=thousands, scale=file_unit.scale, written=written)


def _read(reader: Reader, asks: Sequence[ColumnRequest]) -> list[ColumnValues]:
    parts: list[list[ColumnValues]] = []
    if not asks:  # all columns hold dates alone
        return []
    for batch in reader.batches(asks):
        parts.append(batch)
        if sum(one[0].size for one in parts) >= MAX_SURVEY_ROWS:
            break
    if not parts:
        return [np.empty(0) for _ in asks]
    return [np.concatenate(column) for column in zip(*parts, strict=True)]


def _survey_binary(raw: RawFile) -> Survey:
    """Survey a binary file, column by column or clock by clock: what has another length than most is left out."""
    reader = open_raw(raw)
    stamps = set(reader.clocks.values())
    columns, unused = [], []
    labels: dict[str, ColumnValues] = {}
    for place, name in enumerate(reader.names):
        if stamps and place in reader.clock_names and place not in reader.clocks:
            continue  # stands for the clocks of the others
        try:
            (values,) = _read(reader, [ColumnRequest(place, text=place in reader.labels)])
        except InputError as error:
            unused.append(f'"{name}": {error.found}')
            continue
        if place in reader.labels:
            labels[name] = values
            continue
        clock = reader.names[reader.clocks[place]] if place in reader.clocks else None
        columns.append(replace(_column(reader, place, name, name, values), clock=clock))
    columns = [with_unit_beside(one, labels.get(f"{one.name.rpartition('/')[0]}/unit")) for one in columns]
    scalars = {one.name: float(one.values[0]) for one in columns if one.values.size == 1} | _rate_of_group(columns)
    columns = [one for one in columns if one.values.size > 1]
    if not columns:
        raise InputError(
            str(raw.path), "no column of numbers", "a recording", "export vectors of one clock", code="E041"
        )
    if stamps:
        shared = next(
            (_column(reader, n, reader.names[n], reader.names[n], np.empty(0)) for n in reader.clock_names), None
        )
        texts = [_counted(name, own) for name, own in labels.items()]
        runs = [(run, _aligned(own, shared)) for run, own in runs_beside_one_another(columns)]
        return Survey(
            raw, False, runs[0][1] if runs else _aligned(columns, shared), scalars, [*unused, *texts], runs=runs
        )
    sizes = Counter(one.values.size for one in columns)
    usual = max(sizes, key=lambda size: (sizes[size], size))
    other = [
        f'"{one.name}": {one.values.size} values, most have {usual}' for one in columns if one.values.size != usual
    ]
    kept = [one for one in columns if one.values.size == usual]
    found, left, runs = _shaped(reader, kept, {name: own for name, own in labels.items() if own.size == usual})
    return Survey(raw, False, found, scalars, [*unused, *other, *left], runs=runs)


def _rate_of_group(columns: Sequence[Column]) -> dict[str, float]:
    """Return the rate (Hz) that the one group of all columns is called after, as recorders of NI do; else nothing."""
    groups = {one.name.rpartition("/")[0] for one in columns}
    said = _RATE.search(groups.pop()) if len(groups) == 1 else None
    return {"rate": float(said[1]) * (1e3 if said[2] else 1.0)} if said else {}


def _aligned(columns: Sequence[Column], shared: Column | None = None) -> list[Column]:
    """Return columns over one table of stamps, where some have clocks of their own; the clock that is shared first.

    ``shared`` is the column that stands for each column's own clock, where the file has one.
    """
    clocks = {column.clock for column in columns if column.clock is not None}
    if not clocks:
        return list(columns)
    by_key = {column.key: column for column in columns}
    first = next(column for column in columns if column.key in clocks)
    owners: dict[ColumnKey, list[Column]] = {}
    for column in columns:
        if column.key not in clocks:
            owners.setdefault(first.key if column.clock is None else column.clock, []).append(column)
    tables, start = [], 0
    for clock, own in owners.items():
        time = _seconds(by_key[clock])
        known = np.flatnonzero(np.isfinite(time[: min(one.values.size for one in own)]))
        tables.append(
            Table(
                time[known],
                {str(n): one.values[known] for n, one in enumerate(columns) if one in own},
                np.arange(start, start + known.size),
            )
        )
        start += known.size
    longest = max(table.time.size for table in tables)
    sparse = [name for one in tables if one.time.size < SPARSE * longest for name in one.columns]
    table = align_tables(tables, sparse, lambda row: f"row {row + 1}").table
    clock_column = first if shared is None else replace(shared, unit=shared.unit or first.unit or "s")
    factor = parse_unit(clock_column.unit).factor if _is_timed(clock_column) else 1.0
    aligned = [replace(one, values=table.columns[str(n)]) for n, one in enumerate(columns) if str(n) in table.columns]
    aligned = [replace(one, clock=None) if shared or one.clock == first.key else one for one in aligned]
    return [replace(clock_column, values=table.time / factor, is_clock=True), *aligned]


def _is_timed(clock: Column) -> bool:
    return bool(clock.unit) and same_dimension(clock.unit, "s")


def _seconds(clock: Column) -> Array:
    """Return the stamps of a clock in s, or in its own numbers where it says no unit."""
    time = continuous_stamps(clock.values)
    return np.asarray(time * parse_unit(clock.unit).factor) if _is_timed(clock) else time
