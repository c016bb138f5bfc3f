"""Part of ``init``: what stands in a raw file of which nothing is known."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pneucli.errors import InputError
from pneucli.io.delimited import DelimitedReader
from pneucli.io.formats import is_text, open_raw
from pneucli.io.raw_file import ColumnKey, ColumnRequest, ColumnValues, RawFile, Reader
from pneucli.io.signal_reader import unit_in_file
from pneucli.io.text_sniffer import SniffedLayout, apply_sniffed, sniff

Array = NDArray[np.float64]
MAX_SURVEY_ROWS = 200_000  # rows that are looked at
MAX_LABELS = 30  # of a long table, at most


@dataclass(frozen=True)
class Column:
    """One column of numbers: its ``key`` in the pipeline file, its ``name``, the unit that the file says, its values.

    ``where`` is the label column and the label, of the channel of a long table. ``thousands`` is its own mark.
    """

    key: ColumnKey
    name: str
    unit: str
    values: Array = field(repr=False)
    where: tuple[ColumnKey, str] | None = None
    thousands: str | None = None

    @property
    def finite_values(self) -> Array:
        """The values that are numbers."""
        return self.values[np.isfinite(self.values)]


@dataclass(frozen=True)
class Survey:
    """A raw file: how it has to be read, its columns, and what it has one value of only."""

    raw: RawFile
    is_text: bool
    columns: Sequence[Column]
    scalars: dict[str, float]

    @property
    def path(self) -> Path:
        """The file."""
        return self.raw.path


@dataclass(frozen=True)
class Guess:
    """One column and the signal it is taken for, read in ``unit``; ``signal`` is empty where nothing fits.

    ``unit_stated``: whether the file says the unit; ``reference``: gauge or absolute, where the name says it; ``note``: what
    speaks for it.
    """

    column: Column
    signal: str
    unit: str = ""
    unit_stated: bool = False
    reference: str = ""
    note: str = ""


def survey_file(raw: RawFile) -> Survey:
    """Read what there is; raises InputError where it cannot be read, or holds no numbers."""
    if not raw.path.exists():
        raise InputError(str(raw.path), "no such file", "a raw file", "check the path")
    if not is_text(raw.path):
        return _survey_binary(raw)
    found = sniff(raw)
    stated = apply_sniffed(raw, found)
    reader = DelimitedReader(stated)
    columns = _text_columns(reader, found)
    if not columns:
        raise InputError(str(raw.path), "no column of numbers", "rows of numbers", "say --skip-rows or --delimiter")
    bare = replace(stated, delimiter=raw.delimiter)
    plain = raw.delimiter is None and _same_table(bare, reader)
    return Survey(bare if plain else stated, True, columns, {})


def _same_table(raw: RawFile, reader: DelimitedReader) -> bool:
    """Return whether reading finds the same columns by itself."""
    try:
        return DelimitedReader(raw).names == reader.names
    except InputError:
        return False


def _text_columns(reader: DelimitedReader, found: SniffedLayout) -> list[Column]:
    numbers = [n for n in range(len(reader.names)) if n not in reader.labels]
    asks = [ColumnRequest(n, thousands=found.thousands.get(n)) for n in numbers]
    labels = [ColumnRequest(n, text=True) for n in sorted(reader.labels)]
    read = _read(reader, [*asks, *labels])
    columns = []
    for ask, values in zip(asks, read, strict=False):
        name = found.names[ask.position] if ask.position < len(found.names) else ""
        often = reader.names.count(reader.names[ask.position]) > 1
        key: ColumnKey = ask.position + 1 if not found.header or often or not name else name
        unit = "s" if ask.position in reader.stamps else unit_in_file(reader, ask.position) or ""
        columns.append(Column(key, name, unit, values, thousands=ask.thousands))
    long = _long_table_channels(
        reader, columns, dict(zip((ask.position for ask in labels), read[len(asks) :], strict=True))
    )
    return long or columns


def _read(reader: Reader, asks: Sequence[ColumnRequest]) -> list[ColumnValues]:
    parts: list[list[ColumnValues]] = []
    for batch in reader.batches(asks):
        parts.append(batch)
        if sum(one[0].size for one in parts) >= MAX_SURVEY_ROWS:
            break
    return [np.concatenate(column) for column in zip(*parts, strict=True)]


def _long_table_channels(reader: Reader, columns: list[Column], labels: dict[int, ColumnValues]) -> list[Column]:
    """Return clock and channels of a long table (a label, a stamp, a value); nothing where it is none."""
    if len(columns) != 2 or not labels:
        return []
    position, texts = next(iter(labels.items()))
    names = dict.fromkeys(texts)
    if not 1 < len(names) <= min(MAX_LABELS, texts.size // 2):
        return []
    clock, value = columns
    split = [Column(value.key, name, "", value.values[texts == name], (reader.names[position], name)) for name in names]
    return [Column(clock.key, clock.name, clock.unit, clock.values[texts == split[0].name]), *split]


def _survey_binary(raw: RawFile) -> Survey:
    """Survey a binary file, column by column: what has another length than most is passed over."""
    reader = open_raw(raw)
    columns = []
    for position, name in enumerate(reader.names):
        try:
            (values,) = _read(reader, [ColumnRequest(position)])
        except InputError:
            continue  # of no numbers
        columns.append(Column(name, name, unit_in_file(reader, position) or "", values))
    scalars = {one.name: float(one.values[0]) for one in columns if one.values.size == 1}
    sizes = Counter(one.values.size for one in columns if one.values.size > 1)
    if not sizes:
        raise InputError(str(raw.path), "no column of numbers", "a recording", "export vectors of one clock")
    usual = max(sizes, key=lambda size: (sizes[size], size))
    return Survey(raw, False, [one for one in columns if one.values.size == usual], scalars)
