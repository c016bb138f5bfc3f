"""From raw columns to signals in SI, batch by batch; channels with clocks of their own become one table.

A file is opened for its signals: the column of each, the unit that the file states for it, and its clock.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice

import numpy as np

from pneucli.arrays import Array, Indices, Mask
from pneucli.errors import InputError
from pneucli.io.clock import spread_repeated_stamps, spread_stamps
from pneucli.io.column_reader import number_in
from pneucli.io.expression import ROW, Expression
from pneucli.io.file_units import unit_in_file, with_unit_of_file
from pneucli.io.formats import open_raw
from pneucli.io.raw_file import (
    Batch,
    Channel,
    ColumnKey,
    ColumnRequest,
    ColumnValues,
    RawFile,
    Reader,
    Repair,
    column_position,
    joined,
    missing_column,
)
from pneucli.io.signal_repairs import JUDGES, SignalRepairs, bad_rows, is_held
from pneucli.io.timestamp_order import NEWEST_FIRST, Table, align_tables, falls, loss_repairs
from pneucli.units import parse_unit, same_dimension

BATCH_ROWS = 1 << 17  # rows: as many in every format, so that what is judged batch by batch is judged alike


@dataclass(frozen=True)
class _Group:
    """Signals of one clock: the position of its stamps, or None where they are computed, and the rows that count."""

    clock: int | None
    where: tuple[ColumnKey, str | float] | None


class SignalReader:
    """A raw file, its reader, and the position of each channel that it has a column for, ``time`` first.

    The position of a channel that is computed is None: ``columns`` has those that it is computed from, by their keys.
    ``clocks`` has the position of the stamps of each signal whose clock is not that of ``time``.
    """

    def __init__(
        self,
        raw: RawFile,
        reader: Reader,
        positions: Mapping[str, int | None],
        columns: Mapping[ColumnKey, int],
        clocks: Mapping[str, int],
    ) -> None:
        self.raw, self.reader, self.positions, self._columns, self._clocks = raw, reader, positions, columns, clocks
        self._first = 0  # row of the next batch
        self._losses: Counter[str] = Counter()
        self._rows: Indices | None = None  # of the file, that the signals' rows come from
        self._starts: list[int] = [0]  # first row of each clock that was read by itself
        self._repairs = {name: SignalRepairs(name, raw.channels[name]) for name in positions}
        self._expressions = {n: Expression(c.expression) for n, c in self.channels.items() if c.expression is not None}
        self._noted: list[Repair] = []

    @property
    def channels(self) -> dict[str, Channel]:
        """The channels that the file has, ``time`` first."""
        return {name: self.raw.channels[name] for name in self.positions}

    @property
    def names(self) -> Sequence[str]:
        """The columns of the file."""
        return self.reader.names

    @property
    def rows(self) -> int:
        """Rows of the file that were read so far."""
        return self.reader.rows

    @property
    def losses(self) -> Counter[str]:
        """Rows that were read so far and are none of :meth:`batches`, by kind."""
        return self.reader.losses + self._losses

    @property
    def own_repairs(self) -> list[Repair]:
        """What had to be mended or noticed to read the file, but for the rows that were left out."""
        return [*self.reader.repairs, *self._noted, *(one for own in self._repairs.values() for one in own.repairs())]

    @property
    def repairs(self) -> list[Repair]:
        """What had to be mended or noticed to read the file."""
        return [*self.own_repairs, *loss_repairs(self.losses)]

    @property
    def held(self) -> set[str]:
        """The signals that keep their value until their next stamp."""
        return {name for name, channel in self.channels.items() if is_held(name, channel)}

    def locate(self, row: int) -> str:
        """Return where a row of :meth:`batches` stands in the file."""
        row = row if self._rows is None or row >= self._rows.size else int(self._rows[row])
        return self.reader.locate(row - max(start for start in self._starts if start <= max(row, 0)))

    def batches(self) -> Iterator[Batch]:
        """Yield signals in SI, ``time`` among them, in the file's order of rows, BATCH_ROWS rows at a time."""
        one_clock = len(set(self._groups().values())) <= 1 and not any(c.where for c in self.channels.values())
        read = self._wide_batches() if one_clock else iter([self._read_clocks()])
        yield from rebatch(spread_repeated_stamps(read, self._noted), list(self.positions))

    def _groups(self) -> dict[str, _Group]:
        """Return the group of each signal but ``time``."""
        shared = self.positions["time"]
        names = [name for name in self.positions if name != "time"]
        return {name: _Group(self._clocks.get(name, shared), self.raw.channels[name].where) for name in names}

    def _wide_batches(self) -> Iterator[Batch]:
        names = list(self.positions)
        clock = next((group.clock for group in self._groups().values()), self.positions["time"])
        read = (self._numbers(names, one) for one in self.reader.batches(self._column_requests(names, clock)))
        for numbers in self._oldest_first(read):
            yield {name: self._repaired(name, own) for name, own in numbers.items()}

    def _oldest_first(self, batches: Iterator[Batch]) -> Iterator[Batch]:
        """Yield the same rows, from the last one up where the stamps of the first ones fall."""
        first = next(batches, None)
        if first is None or not falls(first["time"]):
            yield from chain([first] * (first is not None), batches)
            return
        whole = {name: values[::-1] for name, values in joined([first, *batches]).items()}
        self._rows = np.arange(whole["time"].size)[::-1]
        self._noted.append(Repair("time", "reversed", whole["time"].size, NEWEST_FIRST))
        yield whole

    def _column_requests(self, names: Sequence[str], clock: int | None) -> list[ColumnRequest]:
        """Return the requests for the columns of signals, ``time`` read from ``clock``, and of their expressions."""
        places = {name: clock if name == "time" else self.positions[name] for name in names}
        plain = [(place, self.raw.channels[name]) for name, place in places.items() if place is not None]
        requests = [_column_request(place, channel) for place, channel in plain]
        requests += [ColumnRequest(self._columns[key]) for key in self._read_by(names)]
        return requests or [ColumnRequest(0, text=True)]  # any column tells how many rows there are

    def _read_by(self, names: Sequence[str]) -> list[ColumnKey]:
        """Return the columns that the expressions of signals read."""
        keys = [key for name in names if name in self._expressions for key in self._expressions[name].columns]
        return [key for key in dict.fromkeys(keys) if key in self._columns]

    def _values(self, names: Sequence[str], columns: Sequence[ColumnValues], clock: Channel | None = None) -> Batch:
        """Return signals in SI, repaired, of :meth:`_column_requests`; ``clock`` says how stamps are read."""
        numbers = self._numbers(names, columns)
        return {name: self._repaired(name, own, clock if name == "time" else None) for name, own in numbers.items()}

    def _repaired(self, name: str, numbers: ColumnValues, channel: Channel | None = None) -> Array:
        return _to_si(self._repairs[name].repair(numbers), channel or self.raw.channels[name])

    def _numbers(self, names: Sequence[str], columns: Sequence[ColumnValues]) -> dict[str, ColumnValues]:
        """Return the numbers of signals as they stand in ``columns``, which are those of :meth:`_column_requests`."""
        waiting = iter(columns)
        found = {name: next(waiting) for name in names if name not in self._expressions}
        by_key = dict(zip(self._read_by(names), waiting, strict=False))
        rows = columns[0].size
        by_key.setdefault(ROW, np.arange(self._first, self._first + rows, dtype=np.float64))
        self._first += rows
        for name in names:
            if name in self._expressions:
                own = self._expressions[name]
                found[name] = own.values({key: by_key[key] for key in own.columns})
        return {name: found[name] for name in names}

    def _read_clocks(self) -> Batch:
        """Read the channels clock by clock, and return one table."""
        groups = self._groups()
        if self.reader.clocks:
            tables = [
                self._read_clock(group, [n for n, own in groups.items() if own == group]) for group in _unique(groups)
            ]
        else:
            tables = self._read_rows(groups)
        aligned = align_tables(tables, self.held, self.locate)
        taken = np.unique(np.concatenate([table.rows for table in tables])).size
        self._rows = aligned.table.rows
        self._noted += aligned.repairs
        self._losses = aligned.losses + Counter({"other-channel": self._first - taken})
        return {"time": aligned.table.time, **aligned.table.columns}

    def _read_clock(self, group: _Group, names: Sequence[str]) -> Table:
        """Return the channels of one of the file's own clocks, as a table of its own."""
        first = self._first
        asked = ["time", *names]
        requests = self._column_requests(asked, group.clock)
        channel = self._clock_channel(group.clock)
        values = joined(self._values(asked, columns, channel) for columns in self.reader.batches(requests))
        self._repairs["time"] = SignalRepairs("time", self.raw.channels["time"])
        self._starts.append(first)
        time = values.pop("time")
        return Table(spread_stamps(time), values, np.arange(first, first + time.size))

    def _read_rows(self, groups: Mapping[str, _Group]) -> list[Table]:
        """Return the channels whose clocks and labels are further columns of the same rows, a table for each."""
        labels = list(dict.fromkeys(group.where[0] for group in groups.values() if group.where))
        clocks = [clock for clock in dict.fromkeys(self._clocks.values()) if clock is not None]
        names = list(self.positions)
        requests = self._column_requests(names, self.positions["time"])
        own = [_column_request(clock, self._clock_channel(clock)) for clock in clocks]
        texts = [ColumnRequest(self._required_position("where", key), text=True) for key in labels]
        asked = {one.position for one in (*requests, *own, *texts)}
        beside = [n for n, name in enumerate(self.reader.names) if labels and n not in asked and JUDGES.fullmatch(name)]
        texts += [ColumnRequest(n, text=True) for n in beside]
        batches = self.reader.batches([*requests, *own, *texts])
        whole = iter([np.concatenate(parts) for parts in zip(*batches, strict=True)])
        numbers = self._numbers(names, [*islice(whole, len(requests))])
        time = self._repaired("time", numbers["time"])
        stamps = dict(zip(clocks, islice(whole, len(clocks)), strict=True))
        by_label = dict(zip(labels, islice(whole, len(labels)), strict=True))
        words = dict(zip((self.reader.names[n] for n in beside), whole, strict=True))
        if (judged := bad_rows(words)) is not None:
            by_label = {key: np.where(judged[1], "", own) for key, own in by_label.items()}
            count = int(np.count_nonzero(judged[1]))
            self._noted.append(Repair("", "quality", count, f'"{judged[0]}" calls {count} rows bad: left out'))
        return [self._table(group, groups, {**numbers, "time": time}, stamps, by_label) for group in _unique(groups)]

    def _clock_channel(self, clock: int | None) -> Channel:
        """Return the channel that says how the stamps at a position are read: its signal's own, else that of time."""
        own = (self.raw.channels[name].clock for name, place in self._clocks.items() if place == clock)
        return next(own, None) or self.raw.channels["time"]

    def _table(
        self,
        group: _Group,
        groups: Mapping[str, _Group],
        values: Mapping[str, ColumnValues],
        stamps: Mapping[int, ColumnValues],
        labels: Mapping[ColumnKey, ColumnValues],
    ) -> Table:
        """Return the rows that belong to the channels of one group; a clock of its own ends where its stamps end.

        ``values`` has the repaired time and, of each channel, the numbers of all rows: only its own rows are repaired.
        """
        names = [name for name, other in groups.items() if other == group]
        time, where = values["time"], group.where
        if group.clock in stamps:
            channel = self._clock_channel(group.clock)
            time = _to_si(SignalRepairs("time", channel).repair(stamps[group.clock]), channel)  # type: ignore[index]
        rows = np.flatnonzero(_label_mask(labels[where[0]], where[1])) if where else np.arange(time.size)
        if where and not rows.size:
            seen = sorted({str(text) for column in labels.values() for text in column[:10_000]})
            found, mend = f'no row where the label is "{where[1]}"', f"labels: {', '.join(seen[:30])}"
            raise InputError(f"{self.raw.path}, signal {names[0]}", found, "", mend, code="E043")
        if falls(time[rows]):
            rows = rows[::-1]
            self._noted.append(Repair("time", "reversed", rows.size, NEWEST_FIRST))
        if not where and self._clocks:
            known = np.flatnonzero(np.isfinite(time))
            rows = rows[: int(known[-1]) + 1 if known.size else 0]
        return Table(
            spread_stamps(time[rows]), {name: self._repaired(name, values[name][rows]) for name in names}, rows
        )

    def _required_position(self, signal: str, column: ColumnKey) -> int:
        place = column_position(self.raw.path, signal, column, self.reader.names)
        if place is None:
            raise missing_column(self.raw.path, signal, column, self.reader.names)
        return place


def _unique(groups: Mapping[str, _Group]) -> list[_Group]:
    return list(dict.fromkeys(groups.values()))


def rebatch(batches: Iterator[Batch], names: list[str]) -> Iterator[Batch]:
    """Yield the same rows, BATCH at a time; at least one batch, which may be empty."""
    waiting: Batch = {name: np.empty(0) for name in names}
    for batch in batches:
        rows = joined([waiting, batch]) if waiting["time"].size else {name: batch[name] for name in names}
        whole = rows["time"].size // BATCH_ROWS * BATCH_ROWS
        for start in range(0, whole, BATCH_ROWS):
            yield {name: values[start : start + BATCH_ROWS] for name, values in rows.items()}
        waiting = {name: values[whole:] for name, values in rows.items()}
    yield waiting


def _column_request(place: int, channel: Channel) -> ColumnRequest:
    return ColumnRequest(place, decimal=channel.decimal, thousands=channel.thousands)


def _to_si(column: ColumnValues, channel: Channel) -> Array:
    with np.errstate(over="ignore", invalid="ignore"):  # what becomes infinite is counted as such
        values = column if channel.factor == 1.0 else column * channel.factor
        return values if channel.offset == 0.0 else values + channel.offset


def _label_mask(labels: ColumnValues, wanted: str | float) -> Mask:
    if isinstance(wanted, str) and labels.dtype == object:
        return np.asarray(labels == wanted.strip(), dtype=np.bool_)
    return np.array([number_in(label) == number_in(wanted) for label in labels], dtype=np.bool_)


def open_signals(raw: RawFile) -> SignalReader:
    """Open ``raw`` and find the columns of its channels.

    A channel without a column is passed over, unless it is required: then InputError lists the columns there are. It
    is raised too where several columns are called alike, or one column is asked for two signals, and where the unit
    that the file says of a column cannot be that of its signal.
    """
    reader = open_raw(raw)
    computed = {name: Expression(one.expression) for name, one in raw.channels.items() if one.expression is not None}
    found = {
        name: _position(raw, name, channel.column, reader)
        for name, channel in raw.channels.items()
        if name not in computed
    }
    columns = {name: _columns_of(raw, name, one, reader.names) for name, one in computed.items()}
    for name in sorted(raw.required):
        absent = [key for key, place in columns.get(name, {}).items() if place is None]
        if absent or (name in found and found[name] is None):
            key = absent[0] if absent else raw.channels[name].column
            taken = [place for place in found.values() if place is not None]
            raise missing_column(raw.path, name, key, reader.names, taken)
    places = {name: place for name, place in found.items() if place is not None}
    _require_own_columns(raw, places, reader.names)
    reader.repairs += _duplicate_names(reader)
    raw = replace(
        raw, channels={n: with_unit_of_file(raw, n, c, places.get(n), reader) for n, c in raw.channels.items()}
    )
    whole = {name: own for name, own in columns.items() if None not in own.values()}
    inner = {key: place for own in whole.values() for key, place in own.items() if place is not None}
    order = {name: places.get(name) for name in raw.channels if name in places or name in whole}
    order = {"time": order.pop("time"), **order}
    clocks = _clocks(raw, reader, order, inner)
    channels = {
        n: _with_clock(one, raw.channels["time"], clocks.get(n), reader, places.get("time"))
        for n, one in raw.channels.items()
    }
    return SignalReader(replace(raw, channels=channels), reader, order, inner, clocks)


def _position(raw: RawFile, name: str, column: ColumnKey, reader: Reader) -> int | None:
    """Return where a column stands; of clocks that are called alike, one for each group of channels, the first."""
    if name == "time" and reader.clocks and isinstance(column, str):
        alike = [n for n in sorted(set(reader.clocks.values())) if reader.names[n].rsplit("/", 1)[-1] == column.strip()]
        if alike and column not in reader.names:
            return alike[0]
    return column_position(raw.path, name, column, reader.names)


def _clocks(
    raw: RawFile, reader: Reader, positions: Mapping[str, int | None], columns: Mapping[ColumnKey, int]
) -> dict[str, int]:
    """Return the position of the stamps of each signal that has a clock of its own.

    As the pipeline file states it; otherwise the clock that the file itself knows, where ``time`` is one of these. A
    signal that is computed has the clock of the columns that it is computed from.
    """
    found = {}
    shared = positions["time"]
    by_file = shared is not None and (shared in reader.clock_names or shared in reader.clocks.values())
    for name, place in positions.items():
        channel = raw.channels[name]
        if channel.clock is not None:
            own = column_position(raw.path, f"{name}, key time", channel.clock.column, reader.names)
            if own is None:
                raise missing_column(raw.path, f"{name}, key time", channel.clock.column, reader.names)
            found[name] = own
        elif by_file and name != "time":
            read = Expression(channel.expression).columns if channel.expression is not None else ()
            places = [place, *(columns.get(key) for key in read)]
            by_column = [reader.clocks[one] for one in places if one is not None and one in reader.clocks]
            found |= {name: by_column[0]} if by_column else {}
    return found


def _with_clock(channel: Channel, time: Channel, place: int | None, reader: Reader, shared: int | None) -> Channel:
    """Return a channel whose clock is read in the unit that is stated, else in the file's, else in that of ``time``."""
    if place is None:
        return channel
    file_unit = unit_in_file(reader, place)
    if channel.clock is None:  # the file's own: ``time`` says how one of them is read
        of_time = unit_in_file(reader, shared) if shared is not None else None
        plain = file_unit is not None and of_time is not None and file_unit.is_plain and of_time.is_plain
        ratio = parse_unit(file_unit.unit).factor / parse_unit(of_time.unit).factor if plain else 1.0  # type: ignore[union-attr]
        own = Channel(reader.names[place], time.factor * ratio, time.offset)
        return replace(channel, clock=own)
    unit = channel.clock.unit or (file_unit.unit if file_unit is not None and file_unit.is_plain else None)
    if unit is None or not same_dimension(unit, "s"):
        return replace(channel, clock=replace(channel.clock, factor=time.factor, offset=time.offset))
    return replace(channel, clock=replace(channel.clock, factor=parse_unit(unit).factor))


def _columns_of(raw: RawFile, name: str, expression: Expression, names: Sequence[str]) -> dict[ColumnKey, int | None]:
    """Return where the columns of an expression stand; the rows' number is none of them."""
    found = {key: column_position(raw.path, name, key, names) for key in expression.columns}
    return {key: place for key, place in found.items() if place is not None or key != ROW}


def _require_own_columns(raw: RawFile, places: Mapping[str, int], names: Sequence[str]) -> None:
    """Raise InputError where two signals are read from one column: of a long table, from the same rows of it."""
    taken: dict[tuple[int, tuple[ColumnKey, str | float] | None], str] = {}
    for name, place in places.items():
        if (other := taken.setdefault((place, raw.channels[name].where), name)) != name:
            found = f'{other} and {name} are both column "{names[place]}"'
            mend = "correct one of them in [signals], or leave out of take what was not recorded"
            raise InputError(f"{raw.path}, signal {name}", found, "a column for each signal", mend, code="E042")


def _duplicate_names(reader: Reader) -> list[Repair]:
    often = Counter(name for name in reader.names if name)
    alike = {name: count for name, count in often.items() if count > 1}
    listed = ", ".join(f'{count} "{name}"' for name, count in list(alike.items())[:5])
    return [Repair("", "same-name", sum(alike.values()), f"columns share a name: {listed}; none is taken")] * bool(
        alike
    )
