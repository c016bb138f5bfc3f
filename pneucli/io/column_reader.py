"""Files whose columns are read whole: MATLAB's, HDF5 and TDMS, and what their readers share."""

from __future__ import annotations

import importlib
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.errors import InputError
from pneucli.io.damaged_files import library_errors_as_input_errors
from pneucli.io.raw_file import ColumnRequest, ColumnValues, Repair

FetchColumns = Callable[[Sequence[str]], list[ColumnValues]]


@dataclass
class ColumnReader:
    """A file of the format ``format``; ``fetch`` opens it and returns the columns of the given names, no others.

    ``own_clocks`` has the column of stamps of each column whose clock the file knows, both by name; the column
    ``shared_clock`` stands for the clock of whatever column it is read with.
    """

    path: Path
    format: str
    names: Sequence[str]
    fetch: FetchColumns
    units: Mapping[int, str] = field(default_factory=dict)
    repairs: list[Repair] = field(default_factory=list)
    rows: int = 0
    losses: Counter[str] = field(default_factory=Counter)
    start: datetime | None = None
    own_clocks: Mapping[str, str] = field(default_factory=dict)
    shared_clock: str | None = None

    @classmethod
    def of_columns(
        cls,
        path: Path,
        format: str,
        columns: Mapping[str, ColumnValues],
        units: Mapping[str, str],
        clocks: Mapping[str, str],
    ) -> ColumnReader:
        """Return the reader of columns that were read already; units and clocks are by the names of columns."""
        if clocks and "time" not in columns:  # stands for each column's own clock
            longest = max(dict.fromkeys(clocks.values()), key=lambda name: columns[name].size)
            columns = {**columns, "time": columns[longest]}
            units = {**units, **({"time": units[longest]} if longest in units else {})}
        names = list(columns)
        file_units = {names.index(name): unit for name, unit in units.items() if unit and name in columns}
        return cls(
            path,
            format,
            names,
            lambda wanted: [columns[name] for name in wanted],
            file_units,
            own_clocks=clocks,
            shared_clock="time" if clocks else None,
        )

    @property
    def clocks(self) -> Mapping[int, int]:
        """The position of the stamps of each column whose clock the file knows, by the position of the column."""
        place = {name: number for number, name in enumerate(self.names)}
        return {
            place[name]: place[clock] for name, clock in self.own_clocks.items() if name in place and clock in place
        }

    @property
    def clock_names(self) -> Collection[int]:
        """The position of the column that stands for every column's own clock, if there is one."""
        return [number for number, name in enumerate(self.names) if name == self.shared_clock]

    def batches(self, asks: Sequence[ColumnRequest]) -> Iterator[list[ColumnValues]]:
        """Yield all rows at once; raises InputError where the columns differ in length."""
        wanted = [self.names[ask.position] for ask in asks]
        with library_errors_as_input_errors(self.path, self.format, self.repairs):
            fetched = dict(zip(dict.fromkeys(wanted), self.fetch(list(dict.fromkeys(wanted))), strict=True))
        for name, column in fetched.items():
            if column.size != fetched[wanted[0]].size:
                found = f'{column.size} values, but "{wanted[0]}" has {fetched[wanted[0]].size}'
                where = f'{self.path}, column "{name}"'
                raise InputError(where, found, "columns of one length", "take signals of one clock only", code="E042")
        self.rows += fetched[wanted[0]].size
        yield [fetched[name] for name in wanted]

    def locate(self, row: int) -> str:
        """Return file and row (from 1)."""
        return f"{self.path}, row {row + 1}"


def import_extra(module: str, extra: str, path: Path, found: str = "") -> Any:
    """Import what a format needs; raises InputError that names the extra where it is not installed."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        wanted = f'the extra "{extra}"'
        found = found or f"{module} is not installed"
        raise InputError(str(path), found, wanted, f'pip install "pneucli[{extra}]"', code="E042") from error


def column_names(name: str, shape: Sequence[int]) -> list[str]:
    """Return what an array's columns are called: its ``name``, or ``name/1``, ... along a matrix's shorter side."""
    sides = [side for side in shape if side != 1]
    if len(sides) < 2:
        return [name]
    return [f"{name}/{number}" for number in range(1, min(sides) + 1)] if len(sides) == 2 else []


def split_columns(name: str, array: ColumnValues) -> dict[str, ColumnValues]:
    """Return the columns of an array, shape ``(n,)`` each, by the names of :func:`column_names`."""
    array = array.reshape([side for side in array.shape if side != 1] or [-1])
    if array.ndim == 2 and array.shape[0] >= array.shape[1]:
        array = array.T
    return dict(zip(column_names(name, array.shape), array if array.ndim == 2 else [array], strict=False))


def to_vector(values: Any) -> ColumnValues:
    """Return values as float64, shape ``(n,)``; calendar time as seconds since the first stamp."""
    array = np.asarray(values).ravel()
    return seconds_since_first(array, {}) if array.dtype.kind in "mM" else array.astype(np.float64)


def seconds_since_first(stamps: ColumnValues, first: dict[int, Any], key: int = 0) -> ColumnValues:
    """Return calendar time or durations as seconds since the first stamp that was seen under ``key``."""
    if stamps.dtype.kind == "m":
        return np.asarray(stamps / np.timedelta64(1, "s"), dtype=np.float64)
    valid = np.flatnonzero(~np.isnat(stamps))
    if key not in first and valid.size:
        first[key] = stamps[valid[0]]
    start = first.get(key, np.datetime64("NaT"))
    return np.asarray((stamps - start) / np.timedelta64(1, "s"), dtype=np.float64)


_CLOCK_WORDS = (
    "time",
    "t",
    "zeit",
    "timestamp",
    "timestamps",
    "stamp",
    "tout",
    "temps",
    "tiempo",
    "clock",
    "time_s",
    "t_s",
)


def clocks_by_group(names: Sequence[str], sizes: Mapping[str, int]) -> dict[str, str]:
    """Return the clock of each column by name: the column of its group that is called like one and is as long.

    None where there is one group, or one clock for all: then every column of stamps is a column like others.
    """
    own: dict[str, str] = {}
    for name in names:
        group, slash, last = name.rpartition("/")
        if slash and _CLOCK_NAME.fullmatch(last):
            own.setdefault(group, name)
    found = {}
    for name in names:
        clock = own.get(name.rpartition("/")[0])
        if clock is not None and clock != name and sizes.get(clock) == sizes.get(name):
            found[name] = clock
    return found if len(set(found.values())) > 1 else {}


_CLOCK_NAME = re.compile(rf"(?i)(?:{'|'.join(_CLOCK_WORDS)})\s*(?:[\[(].*[\])])?")
