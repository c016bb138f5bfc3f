"""Files whose columns are read whole: MATLAB's, HDF5 and TDMS, and what their readers share."""

from __future__ import annotations

import importlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
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
    """A file of the format ``format``; ``fetch`` opens it and returns the columns of the given names, no others."""

    path: Path
    format: str
    names: Sequence[str]
    fetch: FetchColumns
    units: Mapping[int, str] = field(default_factory=dict)
    repairs: list[Repair] = field(default_factory=list)
    rows: int = 0
    losses: Counter[str] = field(default_factory=Counter)
    start: datetime | None = None

    def batches(self, asks: Sequence[ColumnRequest]) -> Iterator[list[ColumnValues]]:
        """Yield all rows at once; raises InputError where the columns differ in length."""
        wanted = [self.names[ask.position] for ask in asks]
        with library_errors_as_input_errors(self.path, self.format, self.repairs):
            fetched = dict(zip(dict.fromkeys(wanted), self.fetch(list(dict.fromkeys(wanted))), strict=True))
        for name, column in fetched.items():
            if column.size != fetched[wanted[0]].size:
                found = f'{column.size} values, but "{wanted[0]}" has {fetched[wanted[0]].size}'
                where = f'{self.path}, column "{name}"'
                raise InputError(where, found, "columns of one length", "take signals of one clock only")
        self.rows = fetched[wanted[0]].size
        yield [fetched[name] for name in wanted]

    def locate(self, row: int) -> str:
        """Return file and row (from 1)."""
        return f"{self.path}, row {row + 1}"


def import_extra(module: str, extra: str, path: Path) -> Any:
    """Import what a format needs; raises InputError that names the extra where it is not installed."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        wanted = f'the extra "{extra}"'
        raise InputError(str(path), f"{module} is not installed", wanted, f'pip install "pneucli[{extra}]"') from error


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
