"""Feather and Arrow: read as a whole; only the wanted columns are read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import feather

from pneucli.io.column_reader import ColumnReader
from pneucli.io.formats.base import Format
from pneucli.io.formats.parquet import LABEL_ROWS, column_numbers, label_columns
from pneucli.io.raw_file import ColumnValues


def open_feather(path: Path) -> ColumnReader:
    """List the columns of numbers, of times and of texts, with the units that their metadata say."""
    schema = _schema(path)
    fields = [field for field in schema if _is_numeric(field.type)]
    units = [(field.metadata or {}).get(b"unit", b"").decode(errors="replace") for field in fields]

    def fetch(wanted: Sequence[str]) -> list[ColumnValues]:
        table = feather.read_table(path, columns=list(wanted))
        return [_array(table[name].combine_chunks()) for name in wanted]

    file_units = {number: unit for number, unit in enumerate(units) if unit}
    names = [field.name for field in fields]
    labels = label_columns(
        pa.schema(fields), lambda texts: feather.read_table(path, columns=texts).slice(0, LABEL_ROWS)
    )
    return ColumnReader(path, FEATHER.name, names, fetch, file_units, labels=labels)


def _schema(path: Path) -> Any:
    with path.open("rb") as file:
        is_new = file.read(6) == b"ARROW1"
    if is_new:
        with pa.memory_map(str(path)) as source:
            return pa.ipc.open_file(source).schema
    return feather.read_table(path, memory_map=True).schema


def _array(column: Any) -> ColumnValues:
    """Return a column as numbers, calendar time, or texts."""
    if pa.types.is_dictionary(column.type):
        column = column.dictionary_decode()
    if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
        return np.array(column.to_pylist(), dtype=object)
    if pa.types.is_temporal(column.type) and not pa.types.is_time(column.type):
        return np.asarray(column.to_numpy(zero_copy_only=False))
    return column_numbers(column)


def _is_numeric(kind: Any) -> bool:
    """Return whether a column may hold numbers or stamps: also as texts, of which only reading tells."""
    if pa.types.is_dictionary(kind):
        kind = kind.value_type
    return bool(
        pa.types.is_integer(kind)
        or pa.types.is_floating(kind)
        or pa.types.is_temporal(kind)
        or pa.types.is_boolean(kind)
        or pa.types.is_decimal(kind)
        or pa.types.is_string(kind)
        or pa.types.is_large_string(kind)
    )


FEATHER = Format(
    "Feather",
    "Feather, Arrow",
    open_feather,
    magic=(b"ARROW1", b"FEA1"),
    used="the unit of stamps, durations and fields (`unit`)",
)
