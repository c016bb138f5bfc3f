"""Which format a raw file has, told by its first bytes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from pneucli.errors import InputError
from pneucli.io import hdf5, mat, mdf, parquet, tdms
from pneucli.io.damaged_files import library_errors_as_input_errors
from pneucli.io.delimited import DelimitedReader
from pneucli.io.raw_file import RawFile, Reader, Repair


def open_raw(raw: RawFile) -> Reader:
    """Open a raw file of any format that is known; its columns are listed, and nothing else of it is read.

    Raises InputError where it is unreadable, cut off, no regular file, or needs an extra that is not installed.
    """
    if (found := _format(raw.path)) is not None:
        return _open_reader(found[0], raw.path, found[1])
    return DelimitedReader(raw)


def is_text(path: Path) -> bool:
    """Return whether a file is of none of the binary formats; raises InputError where it is no regular file."""
    return _format(path) is None


def _format(path: Path) -> tuple[Callable[[Path], Reader], str] | None:
    if not path.is_file():
        found = "a folder" if path.is_dir() else "no regular file (a pipe or a device)"
        raise InputError(str(path), found, "a file of recorded numbers", "copy what it delivers into a file")
    with path.open("rb") as file:
        head = file.read(1024)
    for magic, (opener, name) in _FORMATS.items():
        if head.startswith(magic) or (name == hdf5.NAME and head[512 : 512 + len(magic)] == magic):
            return opener, name
    if path.suffix.lower() in _BINARY_SUFFIXES and not head.strip():
        raise InputError(str(path), "the file is empty", "a recording", "record it again or leave it out")
    return None


def _open_reader(opener: Callable[[Path], Reader], path: Path, name: str) -> Reader:
    notes: list[Repair] = []
    with library_errors_as_input_errors(path, name, notes):
        reader = opener(path)
    reader.repairs += notes
    if not reader.names:
        raise InputError(str(path), "holds no columns of numbers", f"a whole {name} file", "copy or export it again")
    return reader


_FORMATS: dict[bytes, tuple[Callable[[Path], Reader], str]] = {
    b"PAR1": (parquet.ParquetReader, parquet.NAME),
    b"TDSm": (tdms.open_tdms, tdms.NAME),
    b"MDF ": (mdf.MdfReader, mdf.NAME),
    b"\x89HDF\r\n\x1a\n": (hdf5.open_hdf5, hdf5.NAME),
    b"MATLAB 5.0": (mat.open_mat, mat.NAME),
}
_BINARY_SUFFIXES = (".mat", ".tdms", ".mf4", ".mdf", ".h5", ".hdf5", ".parquet")
