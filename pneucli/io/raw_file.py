"""What is wanted of a raw file, and what every reader of raw files offers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.errors import InputError, did_you_mean
from pneucli.units import STANDARD_ATMOSPHERE

ColumnKey = str | int
ColumnValues = NDArray[Any]
Batch = dict[str, Array]  # signals by name, of the same rows
NO_CLOCKS: Mapping[int, int] = MappingProxyType({})


@dataclass(frozen=True)
class Channel:
    """One signal in a raw file: ``SI = factor * column + offset``, in the rows where ``where`` holds.

    A column is named, or counted from 1; an ``expression`` over columns may take its place. ``decimal`` and
    ``thousands`` are this column's own marks in text files. ``unit`` is what the pipeline file states. Where it states
    nothing (None) of a signal whose SI unit is ``si``, a unit that the raw file itself says counts.
    ``clock`` is the column of its own stamps, where they are not those of ``time``. ``hold``: whether the value holds
    until the next stamp; ``missing``: the numbers that mark no value. Of both None: found from the signal and the file.
    """

    column: ColumnKey
    factor: float = 1.0
    offset: float = 0.0
    where: tuple[ColumnKey, str | float] | None = None
    decimal: str | None = None
    thousands: str | None = None
    expression: str | None = None
    unit: str | None = None
    si: str | None = None
    clock: Channel | None = None
    hold: bool | None = None
    missing: tuple[float, ...] | None = None


@dataclass(frozen=True)
class RawFile:
    """A raw file and its channels by signal; those in ``required`` must be there. ``None``: found from the file.

    ``part`` counts (from 1) the tables of a text between headers or comments (:func:`part_bounds`); None: one table.
    ``ambient`` is the pressure (Pa) from which units of the file such as barg count.
    """

    path: Path
    channels: Mapping[str, Channel]
    required: frozenset[str] = frozenset({"time"})
    header: bool = True
    delimiter: str | None = None
    decimal: str | None = None
    thousands: str | None = None
    encoding: str | None = None
    skip_rows: int = 0
    part: int | None = None
    ambient: float = STANDARD_ATMOSPHERE


@dataclass(frozen=True)
class ColumnRequest:
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


def joined(batches: Iterable[Batch]) -> Batch:
    """Return the rows of all batches, of which there is one at least, as one batch."""
    parts = list(batches)
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


class Reader(ABC):
    """An opened raw file; ``names`` are its columns in order, ``repairs`` what had to be mended to read it.

    ``rows`` counts the rows of numbers that were read so far; ``losses`` those that the reader left out, by kind.
    All else is by the positions of columns, from 0. ``clocks`` has that of the stamps of each column whose clock the
    file itself knows; the columns at ``clock_names`` stand for the clock of whatever column they are read with. Columns
    of several clocks are read one clock at a time. ``labels`` are columns of text that is neither numbers nor stamps,
    ``units`` those that the file says. ``stamps`` are columns of dates, times and durations, which are read in s, and
    ``start`` is when a clock of a calendar reads 0; both are known once these were read.
    """

    names: Sequence[str]
    repairs: list[Repair]
    rows: int
    losses: Counter[str]
    clocks: Mapping[int, int]
    clock_names: Collection[int]
    labels: Collection[int]
    units: Mapping[int, str]
    stamps: Collection[int] = frozenset()
    start: datetime | None

    @abstractmethod
    def batches(self, asks: Sequence[ColumnRequest]) -> Iterator[list[ColumnValues]]:
        """Yield the asked columns in batches of rows: float64, or text where asked."""

    @abstractmethod
    def locate(self, row: int) -> str:
        """Return where data row ``row`` (from 0) stands in the file."""


def column_position(path: Path, signal: str, column: ColumnKey, names: Sequence[str]) -> int | None:
    """Return where ``column`` stands among ``names``: by number from 1, by name, or by the last part of a path.

    ``None`` where it is not there. Raises InputError where several columns are called so.
    """
    if isinstance(column, int):
        return column - 1 if 1 <= column <= len(names) else None
    wanted = column.strip()
    path_wanted = wanted.replace(".", "/").strip("/")
    same: tuple[Callable[[str], bool], ...] = (
        lambda name: name == wanted,
        lambda name: name.strip("/") == path_wanted,
        lambda name: name.rsplit("/", 1)[-1] == wanted,
    )
    for fits in same:
        hits = [index for index, name in enumerate(names) if fits(name)]
        if len(hits) > 1:
            listed = ", ".join(f'"{names[hit]}" (column {hit + 1})' for hit in hits[:10])
            mend = "name it in full or by its number, or rename it"
            raise InputError(
                f"{path}, signal {signal}", f'{len(hits)} columns are called "{wanted}"', listed, mend, code="E042"
            )
        if hits:
            return hits[0]
    return None


def missing_column(
    path: Path, signal: str, column: ColumnKey, names: Sequence[str], taken: Collection[int] = ()
) -> InputError:
    """Return the error that says which columns there are instead; ``taken`` are the positions that signals have."""
    listed = ", ".join(f'"{name}"' for name in names[:30]) or "none"
    if isinstance(column, int):
        return InputError(
            f"{path}, signal {signal}", f"no column {column}", f"1 to {len(names)}", f"columns: {listed}", code="E042"
        )
    mend = nearest_column(column, names, taken)
    return InputError(f"{path}, signal {signal}", f'no column "{column}"', f"one of {listed}", mend, code="E042")


def nearest_column(column: str, names: Sequence[str], taken: Collection[int]) -> str:
    """Return which column may be meant: one that no other signal takes, by their positions from 0."""
    free = [name for place, name in enumerate(names) if place not in taken and name]
    if not free:
        return "another signal takes each column of the file" if names else "the file has no columns"
    return did_you_mean(column, free, "free")
