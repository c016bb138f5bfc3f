"""Artifacts: Parquet files with units, schema, and what made them; replaced atomically.

The unit stands in each field's metadata and again as JSON in the file's, since pandas drops the first and polars and
DuckDB see only the second.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, cast

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import ArrayLike, NDArray

from pneucli.errors import InputError
from pneucli.quantities import SIGNALS, axis_unit
from pneucli.version import __version__

_PREFIX = "pneucli."
_ROW_GROUP_ROWS = 1 << 20


@dataclass(frozen=True)
class Provenance:
    """What made an artifact: SHA-256 of each input by name, and the parameters (JSON-able).

    ``inputs = None``: they are stated later, by :meth:`TableWriter.add_inputs`.
    """

    inputs: Mapping[str, str] | None = field(default_factory=dict)
    parameters: Mapping[str, Any] = field(default_factory=dict)


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path that replaces ``path`` when the block ends without an error, and vanishes otherwise."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=path.suffix)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o644)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a text file in UTF-8, as a whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def sha256_of(path: str | Path) -> str:
    """Return the SHA-256 of a file's content, in hexadecimal."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def schema_of(
    types: Mapping[str, pa.DataType], *, units: Mapping[str, str], schema: str, provenance: Provenance
) -> pa.Schema:
    """Return the Arrow schema of an artifact.

    A numeric column has its unit from ``units``, else from the nomenclature of signals (``"1"`` is dimensionless);
    text has the unit ``""``. Raises ``ValueError`` where a numeric column has no unit.
    """
    own = {name: _unit(name, kind, units) for name, kind in types.items()}
    fields = [pa.field(name, kind, metadata={"unit": own[name]}) for name, kind in types.items()]
    about = {
        "schema": schema,
        "version": __version__,
        "units": json.dumps(own),
        "parameters": json.dumps(dict(provenance.parameters), sort_keys=True, default=str),
    }
    if provenance.inputs is not None:
        about["inputs"] = json.dumps(dict(provenance.inputs), sort_keys=True)
    return pa.schema(fields, metadata={_PREFIX + key: value for key, value in about.items()})


def schema_from(columns: str, *, schema: str, provenance: Provenance, **types: pa.DataType) -> pa.Schema:
    """Return the Arrow schema of columns as :meth:`Tables.write` takes them: numbers and texts, but for ``types``."""
    names, units = _declared(columns)
    kinds = {name: pa.float64() if name in units else pa.string() for name in names}
    return schema_of(kinds | types, units=units, schema=schema, provenance=provenance)


def _unit(name: str, kind: pa.DataType, units: Mapping[str, str]) -> str:
    if name in units or name in SIGNALS:
        return axis_unit(units[name] if name in units else SIGNALS[name].unit)
    if pa.types.is_integer(kind) or pa.types.is_floating(kind):
        raise ValueError(f"column {name} has no unit")
    return ""


class TableWriter:
    """Write an artifact in batches with bounded memory; a context manager over :func:`atomic_path`."""

    def __init__(self, path: str | Path, schema: pa.Schema) -> None:
        self._atomic = atomic_path(path)
        self._schema = schema
        floats = [f.name for f in schema if pa.types.is_floating(f.type)]
        self._options: dict[str, Any] = {
            "compression": "zstd",
            "compression_level": 1,
            "use_byte_stream_split": floats,
            "use_dictionary": [f.name for f in schema if f.name not in floats],
        }

    def __enter__(self) -> TableWriter:
        self._writer = pq.ParquetWriter(self._atomic.__enter__(), self._schema, **self._options)
        return self

    def write(self, columns: Mapping[str, Any]) -> None:
        """Append a row group; a single text holds for all rows, and columns that are left out are null."""
        rows = max(len(values) for values in columns.values() if not isinstance(values, str))
        arrays = [_array(columns.get(f.name), f.type, rows) for f in self._schema]
        self._writer.write_table(pa.Table.from_arrays(arrays, schema=self._schema), row_group_size=_ROW_GROUP_ROWS)

    def add_inputs(self, provenance: Provenance) -> None:
        """State the inputs' hashes at the end, where they were found while writing."""
        self._writer.add_key_value_metadata(
            {_PREFIX + "inputs": json.dumps(dict(provenance.inputs or {}), sort_keys=True)}
        )

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._writer.close()
        self._atomic.__exit__(kind, error, trace)


def _array(values: Any, kind: pa.DataType, rows: int) -> Any:
    if values is None:
        return pa.nulls(rows, cast("Any", kind))
    if isinstance(values, str):
        return pa.repeat(values, rows)
    if isinstance(values, pa.Array):
        return values
    return pa.array(values if isinstance(values, np.ndarray) else list(values), kind)


def write_table(
    path: str | Path,
    columns: Mapping[str, ArrayLike],
    *,
    units: Mapping[str, str] | None = None,
    schema: str,
    provenance: Provenance,
) -> None:
    """Write columns of equal length: floats (NaN stays NaN), integers, booleans or text, each with its unit.

    ``schema`` is name and version, ``"pneucli/compare/residuals/1"``. Units as in :func:`schema_of`.
    """
    columns = {n: [axis_unit(str(one)) for one in values] if n == "unit" else values for n, values in columns.items()}  # type: ignore[union-attr]
    arrays = {name: _column(values) for name, values in columns.items()}
    types = {name: array.type for name, array in arrays.items()}
    with TableWriter(path, schema_of(types, units=units or {}, schema=schema, provenance=provenance)) as writer:
        writer.write(arrays)


@dataclass(frozen=True)
class Tables:
    """The tables that a stage writes into its folder: ``NAME.parquet`` with the schema ``pneucli/STAGE/NAME/1``."""

    out: Path
    stage: str
    made_by: Provenance

    def write(self, name: str, columns: str, rows: Iterable[Sequence[Any]]) -> None:
        """Write a table, also one without rows.

        Args:
            name: Its name.
            columns: What each row holds, in its order, with its unit: ``"channel, lag [s], correlation [1]"``. A
                column without one has the unit of the signal of its name, or is text.
            rows: Its rows, or blocks of rows: arrays, beside which a number or a text stands in each row. A number
                that is None is NaN.
        """
        names, units = _declared(columns)
        blocks = [_of_one_size(row) for row in rows] or [[np.zeros(0, None if n in units else object) for n in names]]
        stacked = [np.concatenate(parts) for parts in zip(*blocks, strict=True)]
        table = {n: v.tolist() if v.dtype == object else v for n, v in zip(names, stacked, strict=True)}
        schema = f"pneucli/{self.stage}/{name}/1"
        write_table(self.out / f"{name}.parquet", table, units=units, schema=schema, provenance=self.made_by)


def _declared(columns: str) -> tuple[list[str], dict[str, str]]:
    """Return the names of columns, and the units of those that have one.

    >>> _declared("channel, lag [s], x")
    (['channel', 'lag', 'x'], {'lag': 's', 'x': 'm'})
    """
    pairs = [column.removesuffix("]").partition(" [") for column in columns.split(", ")]
    units = {name: unit or SIGNALS[name].unit for name, _, unit in pairs if unit or name in SIGNALS}
    return [name for name, *_ in pairs], units


def _of_one_size(block: Sequence[Any]) -> list[NDArray[Any]]:
    size = max((np.size(one) for one in block if np.ndim(one)), default=1)
    return [np.asarray(one) if np.ndim(one) else _repeated(one, size) for one in block]


def _repeated(one: Any, size: int) -> NDArray[Any]:
    return np.full(size, np.nan if one is None else one, dtype=object if isinstance(one, str) else None)


def _column(values: ArrayLike) -> Any:
    array = pa.array(values if isinstance(values, np.ndarray) and values.dtype.kind in "fiub" else list(values))  # type: ignore[arg-type]
    return pa.nulls(len(array), pa.string()) if pa.types.is_null(array.type) else array


def read_table(path: str | Path) -> dict[str, NDArray[Any] | list[str]]:
    """Return every column: numbers as arrays (null becomes NaN), text as lists.

    Raises :class:`InputError` where the file is missing or is not Parquet.
    """
    table = _read(Path(path))
    return {name: _values(table[name]) for name in table.column_names}


def read_metadata(path: str | Path) -> dict[str, Any]:
    """Return schema, version, units, inputs and parameters of an artifact."""
    metadata = pq.read_metadata(path).metadata or {}
    own = {name: metadata[key].decode() for name in _METADATA_KEYS if (key := (_PREFIX + name).encode()) in metadata}
    return {name: text if name in ("schema", "version") else json.loads(text) for name, text in own.items()}


_METADATA_KEYS = ("schema", "version", "units", "inputs", "parameters")


def _read(path: Path) -> pa.Table:
    try:
        return pq.ParquetFile(path, memory_map=True).read()  # pq.read_table imports pyarrow.dataset
    except FileNotFoundError as error:
        raise InputError(str(path), "no such artifact", "", "run the stage that writes it", code="E007") from error
    except pa.ArrowInvalid as error:
        raise InputError(
            str(path), f"not a Parquet file: {error}", "", "delete it and run its stage again", code="E007"
        ) from error


def _values(column: Any) -> NDArray[Any] | list[str]:
    if pa.types.is_string(column.type) or pa.types.is_dictionary(column.type):
        return [str(value) if value is not None else "" for value in column.to_pylist()]
    return np.asarray(column.to_numpy())
