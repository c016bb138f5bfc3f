"""Opens a raw file for its signals: the column of each, the unit that the file states for it, and its clock."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

from pneucli.errors import InputError
from pneucli.io.expression import ROW, Expression
from pneucli.io.file_units import unit_in_file, with_unit_of_file
from pneucli.io.formats import open_raw
from pneucli.io.raw_file import Channel, ColumnKey, RawFile, Reader, Repair, column_position, missing_column
from pneucli.io.signal_reader import SignalReader
from pneucli.units import parse_unit, same_dimension


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
