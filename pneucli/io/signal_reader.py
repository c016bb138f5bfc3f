"""From raw columns to signals in SI, batch by batch; long tables become one table over all their time stamps."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import isclose

import numpy as np
from numpy.typing import NDArray

from pneucli.errors import InputError, UnitError
from pneucli.io.expression import ROW, Expression
from pneucli.io.formats import open_raw
from pneucli.io.raw_file import (
    Channel,
    ColumnKey,
    ColumnRequest,
    ColumnValues,
    RawFile,
    Reader,
    Repair,
    column_position,
    missing_column,
)
from pneucli.io.timestamp_order import Array, Table, join_tables, loss_repairs
from pneucli.units import factor_and_offset, parse_unit, same_dimension

Batch = dict[str, Array]

_BRACKETED = re.compile(r"[\[(<]([^\[\](){}<>]*)[\])>]\s*$")
BATCH_ROWS = 1 << 17  # rows: as many in every format, so that what is judged batch by batch is judged alike


class SignalReader:
    """A raw file, its reader, and the position of each channel that it has a column for, ``time`` first.

    The position of a channel that is computed is None: ``columns`` has those that it is computed from, by their keys.
    """

    def __init__(
        self, raw: RawFile, reader: Reader, positions: Mapping[str, int | None], columns: Mapping[ColumnKey, int]
    ) -> None:
        self.raw, self.reader, self.positions, self._columns = raw, reader, positions, columns
        self._first = 0  # row of the next batch
        self._losses: Counter[str] = Counter()
        self._rows: NDArray[np.intp] | None = None  # of the file, that the signals' rows come from

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
    def repairs(self) -> list[Repair]:
        """What had to be mended or noticed to read the file."""
        return [*self.reader.repairs, *loss_repairs(self.losses)]

    def locate(self, row: int) -> str:
        """Return where a row of :meth:`batches` stands in the file."""
        return self.reader.locate(row if self._rows is None or row >= self._rows.size else int(self._rows[row]))

    def batches(self) -> Iterator[Batch]:
        """Yield signals in SI, ``time`` among them, in the file's order of rows, BATCH rows at a time."""
        long = any(channel.where for channel in self.channels.values())
        yield from rebatch(iter([self._read_long_table()]) if long else self._wide_batches(), list(self.positions))

    def _wide_batches(self) -> Iterator[Batch]:
        for columns in self.reader.batches(self._column_requests()):
            yield self._values(columns)

    def _column_requests(self) -> list[ColumnRequest]:
        plain = [(place, self.raw.channels[name]) for name, place in self.positions.items() if place is not None]
        asks = [_column_request(place, channel) for place, channel in plain]
        asks += [ColumnRequest(place) for place in self._columns.values()]
        return asks or [ColumnRequest(0, text=True)]  # any column tells how many rows there are

    def _values(self, columns: Sequence[ColumnValues]) -> Batch:
        """Return the signals in SI; ``columns`` are those of :meth:`_column_requests`."""
        waiting = iter(columns)
        found = {name: next(waiting) for name, place in self.positions.items() if place is not None}
        by_key = dict(zip(self._columns, waiting, strict=False))
        rows = columns[0].size
        by_key.setdefault(ROW, np.arange(self._first, self._first + rows, dtype=np.float64))
        self._first += rows
        for name, channel in self.channels.items():
            if channel.expression is not None:
                own = Expression(channel.expression)
                found[name] = own.values({key: by_key[key] for key in own.columns})
        return {name: _to_si(found[name], channel) for name, channel in self.channels.items()}

    def _read_long_table(self) -> Batch:
        keys = {channel.where[0]: None for channel in self.channels.values() if channel.where}
        places = [self._required_position("where", key) for key in keys]
        asks = self._column_requests()
        texts = [ColumnRequest(place, text=True) for place in places]
        whole = [np.concatenate(parts) for parts in zip(*self.reader.batches([*asks, *texts]), strict=True)]
        values = self._values(whole[: len(asks)])
        labels = dict(zip(keys, whole[len(asks) :], strict=True))
        tables = [self._table(where, values, labels) for where in dict.fromkeys(self._row_filters().values())]
        taken = np.unique(np.concatenate([table.rows for table in tables])).size
        table, losses = join_tables(tables, self.reader.locate)
        self._rows = table.rows
        self._losses = losses + Counter({"other-channel": values["time"].size - taken})
        return {"time": table.time, **table.columns}

    def _row_filters(self) -> dict[str, tuple[ColumnKey, str | float] | None]:
        return {name: channel.where for name, channel in self.channels.items() if name != "time"}

    def _table(
        self,
        where: tuple[ColumnKey, str | float] | None,
        values: Mapping[str, Array],
        labels: Mapping[ColumnKey, ColumnValues],
    ) -> Table:
        """Return the rows that belong to the channels of one ``where``."""
        names = [name for name, other in self._row_filters().items() if other == where]
        time = values["time"]
        rows = np.flatnonzero(_label_mask(labels[where[0]], where[1])) if where else np.arange(time.size)
        if where and not rows.size:
            seen = sorted({str(text) for column in labels.values() for text in column[:10_000]})
            found, mend = f'no row where the label is "{where[1]}"', f"labels: {', '.join(seen[:30])}"
            raise InputError(f"{self.raw.path}, signal {names[0]}", found, "", mend)
        return Table(time[rows], {name: values[name][rows] for name in names}, rows)

    def _required_position(self, signal: str, column: ColumnKey) -> int:
        place = column_position(self.raw.path, signal, column, self.reader.names)
        if place is None:
            raise missing_column(self.raw.path, signal, column, self.reader.names)
        return place


def open_signals(raw: RawFile) -> SignalReader:
    """Open ``raw`` and find the columns of its channels.

    A channel without a column is passed over, unless it is required: then InputError lists the columns there are. It
    is raised too where several columns are called alike, or one column is asked for two signals, and where the unit
    that the file says of a column cannot be that of its signal.
    """
    reader = open_raw(raw)
    computed = {name: Expression(one.expression) for name, one in raw.channels.items() if one.expression is not None}
    found = {
        name: column_position(raw.path, name, channel.column, reader.names)
        for name, channel in raw.channels.items()
        if name not in computed
    }
    columns = {name: _columns_of(raw, name, one, reader.names) for name, one in computed.items()}
    for name in sorted(raw.required):
        lacking = [key for key, place in columns.get(name, {}).items() if place is None]
        if lacking or (name in found and found[name] is None):
            key = lacking[0] if lacking else raw.channels[name].column
            raise missing_column(raw.path, name, key, reader.names)
    places = {name: place for name, place in found.items() if place is not None}
    _require_own_columns(raw, places, reader.names)
    reader.repairs += _duplicate_names(reader)
    raw = replace(
        raw, channels={n: _with_unit_of_file(raw, n, c, places.get(n), reader) for n, c in raw.channels.items()}
    )
    whole = {name: own for name, own in columns.items() if None not in own.values()}
    inner = {key: place for own in whole.values() for key, place in own.items() if place is not None}
    order = {name: places.get(name) for name in raw.channels if name in places or name in whole}
    return SignalReader(raw, reader, {"time": order.pop("time"), **order}, inner)


def _columns_of(raw: RawFile, name: str, expression: Expression, names: Sequence[str]) -> dict[ColumnKey, int | None]:
    """Return where the columns of an expression stand; the rows' number is none of them."""
    found = {key: column_position(raw.path, name, key, names) for key in expression.columns}
    return {key: place for key, place in found.items() if place is not None or key != ROW}


def _with_unit_of_file(raw: RawFile, name: str, channel: Channel, place: int | None, reader: Reader) -> Channel:
    """Return ``channel`` in the unit that the file says of its column, where the pipeline file states none."""
    said = None if place is None else unit_in_file(reader, place)
    if said is None or place is None or (channel.si is None and channel.unit is None):
        return channel
    where, column = f"{raw.path}, signal {name}", f'"{reader.names[place]}"'
    if channel.unit is not None:
        if same_dimension(said, channel.unit) and not isclose(
            parse_unit(said).factor, parse_unit(channel.unit).factor, rel_tol=1e-6
        ):
            message = f"the file says {said} of {column}; read in {channel.unit}, as stated"
            reader.repairs.append(Repair(name, "unit", 1, message))
        return channel
    if not same_dimension(said, channel.si or ""):
        found = f"the file says {said} of column {column}, and no unit is stated"
        raise InputError(
            where, found, f"a unit such as {channel.si}", f'state unit = "...", with scale if {said} is right'
        )
    factor, offset = factor_and_offset(said, 0.0 if channel.offset else raw.ambient)
    reader.repairs.append(Repair(name, "unit-said", 1, f"read in {said}, as the file says of {column}"))
    return replace(channel, factor=factor, offset=offset + channel.offset)


def unit_in_file(reader: Reader, place: int) -> str | None:
    """Return the unit that a file says of its column: below the header, as a property, or in brackets in its name."""
    in_name = _BRACKETED.search(reader.names[place])
    for text in (reader.units.get(place), in_name and in_name[1]):
        try:
            if text and parse_unit(text):
                return text
        except UnitError:
            continue
    return None


def _require_own_columns(raw: RawFile, places: Mapping[str, int], names: Sequence[str]) -> None:
    """Raise InputError where two signals are read from one column: of a long table, from the same rows of it."""
    taken: dict[tuple[int, tuple[ColumnKey, str | float] | None], str] = {}
    for name, place in places.items():
        if (other := taken.setdefault((place, raw.channels[name].where), name)) != name:
            found = f'{other} and {name} are both column "{names[place]}"'
            mend = "correct one of them in [signals], or leave out of take what was not recorded"
            raise InputError(f"{raw.path}, signal {name}", found, "a column for each signal", mend)


def _duplicate_names(reader: Reader) -> list[Repair]:
    often = Counter(name for name in reader.names if name)
    alike = {name: count for name, count in often.items() if count > 1}
    listed = ", ".join(f'{count} "{name}"' for name, count in list(alike.items())[:5])
    return [Repair("", "same-name", sum(alike.values()), f"columns share a name: {listed}; none is taken")] * bool(
        alike
    )


def rebatch(batches: Iterator[Batch], names: list[str]) -> Iterator[Batch]:
    """Yield the same rows, BATCH at a time; at least one batch, which may be empty."""
    waiting: Batch = {name: np.empty(0) for name in names}
    for batch in batches:
        joined = {
            name: np.concatenate([rest, batch[name]]) if rest.size else batch[name] for name, rest in waiting.items()
        }
        whole = joined["time"].size // BATCH_ROWS * BATCH_ROWS
        for start in range(0, whole, BATCH_ROWS):
            yield {name: values[start : start + BATCH_ROWS] for name, values in joined.items()}
        waiting = {name: values[whole:] for name, values in joined.items()}
    yield waiting


def _column_request(place: int, channel: Channel) -> ColumnRequest:
    return ColumnRequest(place, decimal=channel.decimal, thousands=channel.thousands)


def _to_si(column: ColumnValues, channel: Channel) -> Array:
    with np.errstate(over="ignore", invalid="ignore"):  # what becomes infinite is counted as such
        values = column if channel.factor == 1.0 else column * channel.factor
        return values if channel.offset == 0.0 else values + channel.offset


def _label_mask(labels: ColumnValues, wanted: str | float) -> NDArray[np.bool_]:
    if isinstance(wanted, str) and labels.dtype == object:
        return np.asarray(labels == wanted.strip(), dtype=np.bool_)
    number = _number(wanted)
    return np.array([_number(label) == number for label in labels], dtype=np.bool_)


def _number(label: str | float) -> float | None:
    try:
        return float(label)
    except ValueError:
        return None
