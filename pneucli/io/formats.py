"""Which format a raw file has, by its first bytes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import cast

from pneucli.errors import InputError
from pneucli.io import arrow_file, hdf5, json_file, mat, mat4, mdf, numpy_file, parquet, ros_bag, scope_export, tdms
from pneucli.io.damaged_files import library_errors_as_input_errors
from pneucli.io.delimited import DelimitedReader
from pneucli.io.packed import PackedReader, named_as, packed_format, unpack
from pneucli.io.raw_file import RawFile, Reader, Repair
from pneucli.paths import archive_and_member

HEAD_BYTES = 4096  # by which formats are recognised


def open_raw(raw: RawFile) -> Reader:
    """Open a raw file of any format that is known; its columns are listed, and nothing else of it is read.

    Raises InputError where it is unreadable, cut off, no regular file, or needs an extra that is not installed.
    """
    inner = unpacked(raw.path)
    if inner != raw.path:
        with named_as(raw.path, inner):
            return cast("Reader", PackedReader(open_raw(replace(raw, path=inner)), raw.path, inner))
    if (found := _format(raw.path)) is not None:
        return _open_reader(found[0], raw.path, found[1])
    return DelimitedReader(raw)


def is_text(path: Path) -> bool:
    """Return whether a file, unpacked, is a table of text; raises InputError where it is no regular file."""
    return _format(unpacked(path)) is None


def unpacked(path: Path) -> Path:
    """Return what a packed file, a workbook, or a member of an archive holds; other files as they are."""
    kind = "zip" if archive_and_member(path) else packed_format(path, _head(path))
    if kind in (None, numpy_file.NAME):
        return path
    inner = unpack(path, kind)
    with named_as(path, inner):
        return unpacked(inner)


def is_archive(path: Path) -> bool:
    """Return whether a file is a zip archive of files, and no workbook and no arrays of NumPy."""
    try:
        return path.is_file() and packed_format(path, _head(path)) == "zip"
    except InputError:  # which reading the file says again
        return False


def _head(path: Path) -> bytes:
    if not path.is_file():
        found = "a folder" if path.is_dir() else "no regular file (a pipe or a device)"
        raise InputError(
            str(path), found, "a file of recorded numbers", "copy what it delivers into a file", code="E040"
        )
    with path.open("rb") as file:
        return file.read(HEAD_BYTES)


def _format(path: Path) -> tuple[Callable[[Path], Reader], str] | None:
    head = _head(path)
    for magic, (opener, name) in _FORMATS.items():
        if head.startswith(magic) or (name == hdf5.NAME and head[512 : 512 + len(magic)] == magic):
            return opener, name
    for magic, found in _UNREADABLE.items():
        if head.startswith(magic):
            raise InputError(
                str(path), f"this is a {found}", "a file of recorded numbers", "export it as CSV", code="E040"
            )
    if mat4.is_mat4(head):
        return mat4.open_mat4, mat4.NAME
    if json_file.is_json(head):
        return json_file.open_json, json_file.NAME
    if (scope := scope_export.scope_format(head)) is not None:
        return scope_export.open_scope, scope
    if path.suffix.lower() in _BINARY_SUFFIXES and not head.strip():
        raise InputError(str(path), "the file is empty", "a recording", "record it again or leave it out", code="E041")
    return None


def _open_reader(opener: Callable[[Path], Reader], path: Path, name: str) -> Reader:
    notes: list[Repair] = []
    with library_errors_as_input_errors(path, name, notes):
        reader = opener(path)
    reader.repairs += notes
    if not reader.names:
        raise InputError(
            str(path), "holds no columns of numbers", f"a whole {name} file", "copy or export it again", code="E041"
        )
    return reader


_FORMATS: dict[bytes, tuple[Callable[[Path], Reader], str]] = {
    b"PAR1": (parquet.ParquetReader, parquet.NAME),
    b"TDSm": (tdms.open_tdms, tdms.NAME),
    b"MDF ": (mdf.MdfReader, mdf.NAME),
    b"\x89HDF\r\n\x1a\n": (hdf5.open_hdf5, hdf5.NAME),
    b"MATLAB 5.0": (mat.open_mat, mat.NAME),
    b"PK\x03\x04": (numpy_file.open_numpy, numpy_file.NAME),
    b"\x93NUMPY": (numpy_file.open_numpy, numpy_file.NAME),
    b"ARROW1": (arrow_file.open_feather, arrow_file.NAME),
    b"FEA1": (arrow_file.open_feather, arrow_file.NAME),
    b"\x89MCAP0\r\n": (ros_bag.open_mcap, ros_bag.NAME),
    b"SQLite format 3\x00": (ros_bag.open_rosbag2, ros_bag.NAME),
}
_UNREADABLE = {
    b"#ROSBAG V": "bag of ROS 1; convert it with rosbags-convert, then use the mcap file",
    b"\x80\x04": "pickle of Python, which could run anything; save the arrays with numpy.savez",
    b"\x80\x05": "pickle of Python, which could run anything; save the arrays with numpy.savez",
    b"%PDF": "PDF document",
    b"\xff\xd8\xff": "picture (JPEG)",
    b"\x89PNG": "picture (PNG)",
    b"MDF     3": "file of MDF 3; convert it to MDF 4",
}
_BINARY_SUFFIXES = (".mat", ".tdms", ".mf4", ".mdf", ".h5", ".hdf5", ".parquet")
