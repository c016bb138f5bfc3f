"""NumPy: an ``.npz`` archive or an ``.npy`` array; a column is an array, a column of a matrix, or a field."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.io.column_reader import ColumnReader
from pneucli.io.formats.base import ZIP_MAGIC, Format
from pneucli.io.packed import check_expanded_size
from pneucli.io.raw_file import ColumnValues
from pneucli.paths import member_names


def open_numpy(path: Path) -> ColumnReader:
    """List the columns; arrays of objects, which would run what the file says, are passed over."""
    owner: dict[str, str] = {}  # the array of each of the parts of arrays
    shapes: dict[str, tuple[int, ...]] = {}
    texts: list[list[str]] = []
    for own, name, part in _parts(path):
        texts += [np.ravel(part).tolist()] if part.dtype.kind == "U" else []
        if part.dtype.kind in "fiubmM":
            owner[own], shapes[own] = name, part.shape if part.dtype.kind in "fiub" else ()

    def load(wanted: Collection[str]) -> dict[str, ColumnValues]:
        parts = _parts(path, dict.fromkeys(owner[own] for own in wanted))
        return {own: part for own, _, part in parts if own in wanted}

    return ColumnReader.of_arrays(path, NUMPY.name, shapes, load, texts)


def _parts(path: Path, wanted: Iterable[str] | None = None) -> Iterator[tuple[str, str, Any]]:
    """Yield the arrays of a file of either kind, or each of their fields: its column, its array's name, and itself."""
    for name, array in _arrays(path, wanted):
        for field in array.dtype.names or ("",):
            yield f"{name}/{field}".strip("/") or "data", name, array[field] if field else array


def _arrays(path: Path, wanted: Iterable[str] | None) -> Iterator[tuple[str, Any]]:
    """Yield the wanted arrays, or all, by name; that of an ``.npy`` file has none. Those of objects are passed over."""
    opened = np.load(path, allow_pickle=False)
    if isinstance(opened, np.ndarray):
        yield "", opened
        return
    with opened:
        for name in opened.files if wanted is None else wanted:
            check_expanded_size(path, opened.zip.getinfo(f"{name}.npy").file_size)
            with suppress(ValueError):  # of objects
                yield name, opened[name]


def _is_npz(head: bytes, path: Path) -> bool:
    names = member_names(path) if head.startswith(ZIP_MAGIC) else []
    return bool(names) and all(name.endswith(".npy") for name in names)


NUMPY = Format(
    "NumPy",
    "NumPy (`npz`, `npy`)",
    open_numpy,
    magic=(b"\x93NUMPY",),
    recognises=_is_npz,
    column="an array, a column `m/2`, a field",
    used="the unit of stamps and durations",
    unused="arrays of objects",
)
