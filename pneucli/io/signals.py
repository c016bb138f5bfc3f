"""From raw columns to signals in SI, batch by batch; long tables are merged over all their time stamps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.errors import InputError
from pneucli.io.formats import open_raw
from pneucli.io.raw import Ask, Channel, Key, RawFile, Reader, Values, missing_column, position

Array = NDArray[np.float64]
Batch = dict[str, Array]


@dataclass(frozen=True)
class Opened:
    """A raw file, its reader, and the position of each channel that it has a column for."""

    raw: RawFile
    reader: Reader
    positions: Mapping[str, int]

    @property
    def channels(self) -> dict[str, Channel]:
        """The channels that the file has, ``time`` first."""
        return {name: self.raw.channels[name] for name in self.positions}

    def batches(self) -> Iterator[Batch]:
        """Yield signals in SI, ``time`` among them, in the file's order of rows."""
        if any(channel.where for channel in self.channels.values()):
            yield self._merged()
            return
        asks = [_ask(place, self.raw.channels[name]) for name, place in self.positions.items()]
        for columns in self.reader.batches(asks):
            pairs = zip(self.channels.items(), columns, strict=True)
            yield {name: _to_si(column, channel) for (name, channel), column in pairs}

    def _merged(self) -> Batch:
        keys = {channel.where[0]: None for channel in self.channels.values() if channel.where}
        places = [self._place("where", key) for key in keys]
        asks = [_ask(place, self.raw.channels[name]) for name, place in self.positions.items()]
        asks += [Ask(place, text=True) for place in places]
        whole = [np.concatenate(parts) for parts in zip(*self.reader.batches(asks), strict=True)]
        values = dict(zip(self.positions, whole[: len(self.positions)], strict=True))
        labels = dict(zip(keys, whole[len(self.positions) :], strict=True))
        time = _to_si(values["time"], self.raw.channels["time"])
        parts = {name: self._rows(name, values[name], time, labels) for name in self.positions if name != "time"}
        clock = np.unique(np.concatenate([stamps for stamps, _ in parts.values()]))
        return {"time": clock, **{name: _spread(clock, *part) for name, part in parts.items()}}

    def _rows(self, name: str, values: Values, time: Array, labels: Mapping[Key, Values]) -> tuple[Array, Array]:
        """Return the time stamps (rising) and values of the rows that belong to ``name``."""
        channel = self.raw.channels[name]
        chosen = np.isfinite(time)
        if channel.where:
            chosen &= _equal(labels[channel.where[0]], channel.where[1])
        if not chosen.any():
            label = channel.where and channel.where[1]
            found = sorted({str(text) for column in labels.values() for text in column[:10_000]})
            raise InputError(
                f"{self.raw.path}, signal {name}", f'no row where the label is "{label}"', "", f"labels: {found}"
            )
        order = np.argsort(time[chosen], kind="stable")
        stamps, first = np.unique(time[chosen][order], return_index=True)
        return stamps, _to_si(values[chosen][order][first], channel)

    def _place(self, name: str, column: Key) -> int:
        place = position(column, self.reader.names)
        if place is None:
            raise missing_column(self.raw.path, name, column, self.reader.names)
        return place


def open_signals(raw: RawFile) -> Opened:
    """Open ``raw`` and find the columns of its channels.

    A channel without a column is passed over, unless it is required: then InputError lists the columns there are.
    """
    reader = open_raw(raw)
    found = {name: position(channel.column, reader.names) for name, channel in raw.channels.items()}
    for name in sorted(raw.required):
        if found.get(name) is None:
            raise missing_column(raw.path, name, raw.channels[name].column, reader.names)
    places = {name: place for name, place in found.items() if place is not None}
    _require_own_columns(raw, places, reader.names)
    return Opened(raw, reader, {"time": places.pop("time"), **places})


def _require_own_columns(raw: RawFile, places: Mapping[str, int], names: Sequence[str]) -> None:
    """Raise InputError where two signals are read from one column: of a long table, from the same rows of it."""
    taken: dict[tuple[int, tuple[Key, str | float] | None], str] = {}
    for name, place in places.items():
        if (other := taken.setdefault((place, raw.channels[name].where), name)) != name:
            found = f'{other} and {name} are both column "{names[place]}"'
            mend = "correct one of them in [signals], or leave out of take what was not recorded"
            raise InputError(f"{raw.path}, signal {name}", found, "a column for each signal", mend)


def _ask(place: int, channel: Channel) -> Ask:
    return Ask(place, decimal=channel.decimal, thousands=channel.thousands)


def _to_si(column: Values, channel: Channel) -> Array:
    values = column if channel.factor == 1.0 else column * channel.factor
    return values if channel.offset == 0.0 else values + channel.offset


def _equal(labels: Values, wanted: str | float) -> NDArray[np.bool_]:
    if isinstance(wanted, str):
        return np.asarray(labels == wanted.strip())
    return np.array([_number(label) == wanted for label in labels])


def _number(label: str) -> float | None:
    try:
        return float(label)
    except ValueError:
        return None


def _spread(clock: Array, stamps: Array, values: Array) -> Array:
    spread = np.full(clock.size, np.nan)
    spread[np.searchsorted(clock, stamps)] = values
    return spread
