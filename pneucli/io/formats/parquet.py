"""Parquet, in batches; only the wanted columns are read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from pneucli.errors import InputError
from pneucli.io.column_reader import is_label_column, seconds_since_first
from pneucli.io.damaged_files import check_expanded_size, library_errors_as_input_errors
from pneucli.io.date_parsing import CalendarClock, is_date_or_time
from pneucli.io.formats.base import Format
from pneucli.io.raw_file import NO_CLOCKS, ColumnRequest, ColumnValues, Repair

BATCH_ROWS = 1 << 17
LABEL_ROWS = 1000  # rows that tell whether a text is a label


class ParquetReader:
    """A Parquet file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        schema = pq.read_schema(path)
        self.names: Sequence[str] = schema.names
        file_units = [(field.metadata or {}).get(b"unit", b"").decode(errors="replace") for field in schema]
        self.units = {number: unit for number, unit in enumerate(file_units) if unit}
        self.start: datetime | None = None
        self.repairs: list[Repair] = []
        self.rows = 0
        self.clocks = NO_CLOCKS
        self.clock_names: frozenset[int] = frozenset()
        self.losses: Counter[str] = Counter()
        self.labels = label_columns(schema, lambda names: _first_rows(path, names))

    def batches(self, asks: Sequence[ColumnRequest]) -> Iterator[list[ColumnValues]]:
        """Yield the asked columns; time stamps of a calendar become seconds since the first of them."""
        wanted = [self.names[ask.position] for ask in asks]
        twice = [name for name in wanted if list(self.names).count(name) > 1]
        if twice:
            raise InputError(
                str(self._path), f'two columns are called "{twice[0]}"', "a name for each", "rename one", code="E042"
            )
        first: dict[int, Any] = {}
        with library_errors_as_input_errors(self._path, PARQUET.name, self.repairs):
            file = pq.ParquetFile(self._path, page_checksum_verification=True)
            check_expanded_size(self._path, _size(file, wanted))
            parts = file.iter_batches(BATCH_ROWS, columns=list(dict.fromkeys(wanted)))
        while True:
            with library_errors_as_input_errors(self._path, PARQUET.name, self.repairs):
                batch = next(parts, None)
            if batch is None:
                return
            self.rows += batch.num_rows
            values = [self._values(batch, name, ask, first) for name, ask in zip(wanted, asks, strict=True)]
            self.start = self.start or first_start(first, batch.schema)
            yield values

    def locate(self, row: int) -> str:
        """Return file and row (from 1)."""
        return f"{self._path}, row {row + 1}"

    def _values(self, batch: Any, name: str, ask: ColumnRequest, first: dict[int, Any]) -> ColumnValues:
        column = batch.column(name)
        try:
            if pa.types.is_dictionary(column.type):
                column = column.dictionary_decode()
            if ask.text:
                return np.array([str(value).strip() for value in column.to_pylist()], dtype=object)
            return column_numbers(column, first, ask.position)
        except (pa.ArrowException, UnicodeDecodeError, ValueError) as error:
            where = f'{self._path}, column "{name}" of {column.type}'
            raise InputError(
                where, str(error).splitlines()[0], "numbers", "export it as float64", code="E043"
            ) from error


def label_columns(schema: Any, first_rows: Callable[[list[str]], Any]) -> frozenset[int]:
    """Return the positions of columns whose texts are neither numbers nor stamps; ``first_rows`` reads some of them."""
    texts = [field.name for field in schema if _is_text(field.type)]
    table = first_rows(texts) if texts else None
    return frozenset(
        number
        for number, field in enumerate(schema)
        if field.name in texts and table is not None and is_label_column(table.column(field.name).to_pylist())
    )


def _is_text(kind: Any) -> bool:
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind))


def _first_rows(path: Path, names: list[str]) -> Any:
    return next(pq.ParquetFile(path).iter_batches(LABEL_ROWS, columns=names), None)


def first_start(first: Mapping[int, Any], schema: Any) -> datetime | None:
    """Return when the clock reads 0, by stamps that :func:`column_numbers` noted; in UTC where the schema says so."""
    found = next((one for one in first.values() if one is not None), None)
    if found is None or isinstance(found, CalendarClock):
        return None if found is None else found.start
    start = found.astype("datetime64[us]").item()
    zoned = any(getattr(field.type, "tz", None) for field in schema)
    return (start.replace(tzinfo=UTC) if zoned else start) if isinstance(start, datetime) else None


def column_numbers(column: Any, first: dict[int, Any] | None = None, key: int = 0) -> ColumnValues:
    """Return a column of Arrow as float64; times of day in s, calendar time in s since the first of it."""
    if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
        return _text_numbers(column.cast(pa.string()), {} if first is None else first, key)
    if pa.types.is_time(column.type):
        return np.asarray(column.cast(pa.time64("ns")).cast(pa.int64()).cast(pa.float64()).to_numpy(False)) * 1e-9
    if pa.types.is_temporal(column.type):
        return seconds_since_first(column.to_numpy(zero_copy_only=False), {} if first is None else first, key)
    return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False))


def _text_numbers(column: Any, first: dict[int, Any], key: int) -> ColumnValues:
    """Return texts as numbers, or as stamps of a calendar in s; raises ValueError where they are neither."""
    known = next((text for text in column.drop_null().to_pylist() if text.strip()), "")
    if is_date_or_time(known):
        return first.setdefault(key, CalendarClock()).seconds(column)  # type: ignore[no-any-return]
    try:
        return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False))
    except pa.ArrowInvalid as error:
        raise ValueError(f'texts, such as "{known}"') from error


def _size(file: Any, wanted: Sequence[str]) -> int:
    """Return how many bytes the wanted columns expand to, by the file's own account."""
    meta = file.metadata
    groups = [meta.row_group(number) for number in range(meta.num_row_groups)]
    columns = [group.column(index) for group in groups for index in range(group.num_columns)]
    stored = sum(one.total_uncompressed_size for one in columns if one.path_in_schema.split(".")[0] in wanted)
    return max(int(stored), 8 * int(meta.num_rows) * len(set(wanted)))


PARQUET = Format(
    "Parquet", "Parquet", ParquetReader, magic=(b"PAR1",), used="the unit of stamps, durations and fields (`unit`)"
)
