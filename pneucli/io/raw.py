"""What is wanted of a raw file, and what every reader of raw files offers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from numpy.typing import NDArray

from pneucli.errors import InputError, did_you_mean

Key = str | int
Values = NDArray[Any]


@dataclass(frozen=True)
class Channel:
    """One signal in a raw file: ``SI = factor * column + offset``, in the rows where ``where`` holds.

    A column is named, or counted from 1. ``decimal`` and ``thousands`` are this column's own marks in text files.
    """

    column: Key
    factor: float = 1.0
    offset: float = 0.0
    where: tuple[Key, str | float] | None = None
    decimal: str | None = None
    thousands: str | None = None


@dataclass(frozen=True)
class RawFile:
    """A raw file and its channels by signal; those in ``required`` must be there. ``None``: found from the file."""

    path: Path
    channels: Mapping[str, Channel]
    required: frozenset[str] = frozenset({"time"})
    header: bool = True
    delimiter: str | None = None
    decimal: str | None = None
    thousands: str | None = None
    encoding: str | None = None
    skip_rows: int = 0


@dataclass(frozen=True)
class Ask:
    """One column asked of a reader: its position (from 0) and how its text is to be read."""

    position: int
    text: bool = False
    decimal: str | None = None
    thousands: str | None = None


@dataclass
class Repair:
    """What was mended or noticed: where, what kind, how often, and in words."""

    signal: str
    kind: str
    count: int
    message: str


class Reader(Protocol):
    """An opened raw file; ``names`` are its columns in order, ``repairs`` what had to be mended to read it."""

    names: Sequence[str]
    repairs: list[Repair]

    def batches(self, asks: Sequence[Ask]) -> Iterator[list[Values]]:
        """Yield the asked columns in batches of rows: float64, or text where asked."""

    def place(self, row: int) -> str:
        """Return where data row ``row`` (from 0) stands in the file."""


@dataclass
class Columns:
    """A file whose columns are read whole, such as MATLAB's, HDF5, TDMS and MDF; ``fetch`` returns one column."""

    path: Path
    names: Sequence[str]
    fetch: Callable[[str], Values]
    repairs: list[Repair] = field(default_factory=list)

    def batches(self, asks: Sequence[Ask]) -> Iterator[list[Values]]:
        """Yield all rows at once; raises InputError where the columns differ in length."""
        columns = [self.fetch(self.names[ask.position]) for ask in asks]
        for ask, column in zip(asks, columns, strict=True):
            if column.size != columns[0].size:
                where = f'{self.path}, column "{self.names[ask.position]}"'
                found = f'{column.size} values, but "{self.names[asks[0].position]}" has {columns[0].size}'
                raise InputError(where, found, "columns of one length", "take signals of one clock only")
        yield columns

    def place(self, row: int) -> str:
        """Return file and row (from 1)."""
        return f"{self.path}, row {row + 1}"


def position(column: Key, names: Sequence[str]) -> int | None:
    """Return where ``column`` stands among ``names``: by number from 1, by name, or by the last part of a path."""
    if isinstance(column, int):
        return column - 1 if 1 <= column <= len(names) else None
    wanted = column.strip()
    for same in (_exact, _as_path, _last_part):
        hits = [index for index, name in enumerate(names) if same(name, wanted)]
        if len(hits) == 1 or (hits and same is _exact):
            return hits[0]
    return None


def _exact(name: str, wanted: str) -> bool:
    return name == wanted


def _as_path(name: str, wanted: str) -> bool:
    return name.strip("/") == wanted.replace(".", "/").strip("/")


def _last_part(name: str, wanted: str) -> bool:
    return name.rsplit("/", 1)[-1] == wanted


def missing_column(path: Path, signal: str, column: Key, names: Sequence[str]) -> InputError:
    """Return the error that says which columns there are instead."""
    listed = ", ".join(f'"{name}"' for name in names[:30]) or "none"
    if isinstance(column, int):
        return InputError(f"{path}, signal {signal}", f"no column {column}", f"1 to {len(names)}", f"columns: {listed}")
    mend = did_you_mean(column, names) if names else "the file has no columns"
    return InputError(f"{path}, signal {signal}", f'no column "{column}"', f"one of {listed}", mend)
