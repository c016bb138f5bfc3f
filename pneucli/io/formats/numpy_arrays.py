"""NumPy: an ``.npz`` archive or an ``.npy`` array; a column is an array, a column of a matrix, or a field."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.io.column_reader import ColumnReader, column_names, split_columns
from pneucli.io.damaged_files import check_expanded_size
from pneucli.io.formats.base import ZIP_MAGIC, Format
from pneucli.io.raw_file import ColumnValues
from pneucli.paths import member_names


def open_numpy(path: Path) -> ColumnReader:
    """List the columns; arrays of objects, which would run what the file says, are passed over."""
    owner: dict[str, tuple[str, str | None]] = {}  # column -> array, field
    with _Arrays(path) as arrays:
        for name in arrays.names:
            array = arrays.load(name)
            if array is None:
                continue
            for field in array.dtype.names or [None]:
                part = array if field is None else array[field]
                if part.dtype.kind in "fiubmM":
                    own = _column(name, field)
                    owner |= dict.fromkeys(
                        column_names(own, part.shape) if part.dtype.kind in "fiub" else [own], (name, field)
                    )

    def fetch(wanted: Sequence[str]) -> list[ColumnValues]:
        columns: dict[str, ColumnValues] = {}
        with _Arrays(path) as arrays:
            for name, field in dict.fromkeys(owner[one] for one in wanted):
                array = arrays.load(name)
                part = array if field is None or array is None else array[field]
                columns |= {key: np.ravel(one) for key, one in split_columns(_column(name, field), part).items()}
        return [columns[name] for name in wanted]

    return ColumnReader(path, NUMPY.name, list(owner), fetch)


def _column(name: str, field: str | None) -> str:
    return f"{name}/{field}".lstrip("/") if field else name or "data"


class _Arrays:
    """The arrays of a file of either kind; that of an ``.npy`` file has no name."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._opened: Any = None

    def __enter__(self) -> _Arrays:
        self._opened = np.load(self._path, allow_pickle=False, mmap_mode=None)
        return self

    def __exit__(self, *_: object) -> None:
        if hasattr(self._opened, "close"):
            self._opened.close()

    @property
    def names(self) -> list[str]:
        return list(self._opened.files) if hasattr(self._opened, "files") else [""]

    def load(self, name: str) -> Any:
        """Return an array; None where it holds objects."""
        if not name:
            return self._opened
        info = self._opened.zip.getinfo(f"{name}.npy")
        check_expanded_size(self._path, info.file_size)
        try:
            return self._opened[name]
        except ValueError:  # of objects
            return None


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
    unused="arrays of objects, which would run what the file says",
)
