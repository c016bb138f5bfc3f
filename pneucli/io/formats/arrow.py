"""Parquet, Feather and Arrow, in batches; only the wanted columns are read."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pyarrow import feather

from pneucli.errors import InputError
from pneucli.io.clock import Clock, is_date_or_time
from pneucli.io.column_reader import ColumnReader, as_text, is_label_column, packing
from pneucli.io.formats.base import Format
from pneucli.io.formats.json_text import columns_of_rows, reader_of
from pneucli.io.packed import check_expanded_size, library_errors_as_input_errors
from pneucli.io.raw_file import ColumnRequest, ColumnValues

BATCH_ROWS = 1 << 17
LABEL_ROWS = 1000  # rows that tell whether a text is a label
ReadBatches = Callable[[list[str], int], Iterator[Any]]


@dataclass
class ArrowReader(ColumnReader):
    """A file whose columns Arrow reads; ``read`` yields the named ones, so many rows each; ``packed``: see packing."""

    read: ReadBatches = field(kw_only=True)
    packed: Mapping[str, tuple[float, float] | None] = field(kw_only=True)

    @classmethod
    def of_schema(cls, path: Path, format: str, schema: Any, read: ReadBatches) -> ColumnReader:
        """List the columns, with the units that the metadata of their fields say; those of arrays and structs whole."""
        if any(map(pa.types.is_nested, schema.types)):
            rows = [row for batch in read(schema.names, BATCH_ROWS) for row in batch.to_pylist()]
            return reader_of(path, format, columns_of_rows(rows))
        said = {field.name: {as_text(k): as_text(v) for k, v in (field.metadata or {}).items()} for field in schema}
        packed = {one.name: packing(said[one.name], whole=pa.types.is_integer(one.type)) for one in schema}
        own = {name: said[name].get("unit", "") if packed[name] else "counts" for name in said}
        texts = [field.name for field in schema if _is_text(field.type)]
        first = next(read(texts, LABEL_ROWS), None) if texts and len(own) == len(schema) else None
        known = {name: first.column(name).to_pylist() for name in texts} if first is not None else {}
        labels = {name for name, values in known.items() if is_label_column(values[:LABEL_ROWS])}
        return cls(path, format, schema.names, lambda _: [], own, texts=labels, read=read, packed=packed)

    def batches(self, asks: Sequence[ColumnRequest]) -> Iterator[list[ColumnValues]]:
        """Yield the asked columns; time stamps of a calendar become seconds since the first of them."""
        wanted = [self.names[ask.position] for ask in asks]
        twice = [name for name in wanted if list(self.names).count(name) > 1]
        if twice:
            raise InputError(
                str(self.path), f'two columns are called "{twice[0]}"', "a name for each", "rename one", code="E042"
            )
        clocks = {ask.position: Clock() for ask in asks}
        parts = self.read(list(dict.fromkeys(wanted)), BATCH_ROWS)
        while True:
            with library_errors_as_input_errors(self.path, self.format, self.repairs):
                batch = next(parts, None)
            if batch is None:
                return
            self.rows += batch.num_rows
            values = [self._column(batch, name, ask, clocks) for name, ask in zip(wanted, asks, strict=True)]
            self.start = self.start or next((one.start for one in clocks.values() if one.start), None)
            yield values

    def _column(self, batch: Any, name: str, ask: ColumnRequest, clocks: Mapping[int, Clock]) -> ColumnValues:
        column = batch.column(name)
        try:
            if pa.types.is_dictionary(column.type):
                column = column.dictionary_decode()
            if ask.text:
                return np.array([as_text(value) for value in column.to_pylist()], dtype=object)
            values, is_stamp = _numbers(column, clocks[ask.position])
        except (pa.ArrowException, UnicodeDecodeError, ValueError) as error:
            where = f'{self.path}, column "{name}" of {column.type}'
            raise InputError(
                where, str(error).splitlines()[0], "numbers", "export it as float64", code="E043"
            ) from error
        self.stamps |= {ask.position} if is_stamp else set()
        factor, offset = self.packed[name] or (1.0, 0.0)
        return values if (factor, offset) == (1.0, 0.0) else values * factor + offset


def _is_text(kind: Any) -> bool:
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind))


def _numbers(column: Any, clock: Clock) -> tuple[ColumnValues, bool]:
    """Return a column as float64, and whether it holds stamps, in s; raises ValueError where texts are no numbers."""
    if pa.types.is_temporal(column.type):
        return clock.seconds(column), True
    if not _is_text(column.type):
        return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)), False
    column = column.cast(pa.string())
    known = next((text for text in column.drop_null().to_pylist() if text.strip()), "")
    if is_date_or_time(known):
        return clock.seconds(column), True
    try:
        return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False)), False
    except pa.ArrowInvalid as error:
        raise ValueError(f'texts, such as "{known}"') from error


def open_parquet(path: Path) -> ColumnReader:
    """List the columns of a Parquet file."""
    return ArrowReader.of_schema(path, PARQUET.name, pq.read_schema(path), partial(_read_parquet, path))


def _read_parquet(path: Path, names: list[str], rows: int) -> Iterator[Any]:
    file = pq.ParquetFile(path, page_checksum_verification=True)
    check_expanded_size(path, _size(file, names))
    yield from file.iter_batches(rows, columns=names)


def _size(file: Any, wanted: Sequence[str]) -> int:
    """Return how many bytes the wanted columns expand to, by the file's own account."""
    meta = file.metadata
    groups = [meta.row_group(number) for number in range(meta.num_row_groups)]
    columns = [group.column(index) for group in groups for index in range(group.num_columns)]
    stored = sum(one.total_uncompressed_size for one in columns if one.path_in_schema.split(".")[0] in wanted)
    return max(int(stored), 8 * int(meta.num_rows) * len(set(wanted)))


def open_feather(path: Path) -> ColumnReader:
    """List the columns of a file of Arrow, or of Feather in either of its versions."""
    with path.open("rb") as file:
        is_new = file.read(6) == b"ARROW1"
    if is_new:
        with pa.memory_map(str(path)) as source:
            schema = pa.ipc.open_file(source).schema
    else:
        schema = feather.read_table(path, memory_map=True).schema
    return ArrowReader.of_schema(path, FEATHER.name, schema, partial(_read_feather, path))


def _read_feather(path: Path, names: list[str], rows: int) -> Iterator[Any]:
    yield from feather.read_table(path, columns=names).to_batches(rows)


PARQUET = Format(
    "Parquet",
    "Parquet",
    open_parquet,
    magic=(b"PAR1",),
    used="the unit of stamps and durations, `unit`, `gain`, `offset`",
)
FEATHER = Format(
    "Feather",
    "Feather, Arrow",
    open_feather,
    magic=(b"ARROW1", b"FEA1"),
    used="as Parquet",
)
