"""The formats of raw files: one file a format, found in this folder; those of other packages by their entry points.

The first bytes of a file decide which it has. What no format recognises is a text.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

from pneucli import imports
from pneucli.errors import InputError
from pneucli.io.delimited import DelimitedReader
from pneucli.io.formats import archives
from pneucli.io.formats.base import Format
from pneucli.io.packed import PackedReader, library_errors_as_input_errors, named_as, unpacked_once
from pneucli.io.raw_file import RawFile, Reader, Repair
from pneucli.paths import archive_and_member

HEAD_BYTES = 4096  # by which formats are recognised


@cache
def formats() -> tuple[Format, ...]:
    """Return all formats, those of other packages first; raises InputError where one of these cannot be loaded."""
    found = [*imports.added(imports.FORMATS), *imports.declared(__name__, Format)]
    return tuple(sorted(found, key=lambda one: one.place))


def open_raw(raw: RawFile) -> Reader:
    """Open a raw file of any format that is known; its columns are listed, and nothing else of it is read.

    Raises InputError where it is unreadable, cut off, no regular file, or needs an extra that is not installed.
    """
    inner = unpacked(raw.path)
    if inner != raw.path:
        with named_as(raw.path, inner):
            return PackedReader(open_raw(replace(raw, path=inner)), raw.path, inner)
    found = format_of(raw.path)
    if found is None or found.open is None:
        return DelimitedReader(raw)
    return _open_reader(found.name, found.open, raw.path)


def is_text(path: Path) -> bool:
    """Return whether a file, unpacked, is a table of text; raises InputError where it is no regular file."""
    return format_of(unpacked(path)) is None


def unpacked(path: Path) -> Path:
    """Return what a packed file, a workbook, or a member of an archive holds; other files as they are."""
    found = format_of(path)
    if found is None or found.unpack is None:
        return path
    inner = unpacked_once(path, found.name, found.unpack)
    with named_as(path, inner):
        return unpacked(inner)


def format_of(path: Path) -> Format | None:
    """Return the format of a file, None of a text; raises InputError where it is no regular file, or is refused."""
    found = _recognised(path)
    if found is not None and found.refused:
        what, _, mend = found.refused.partition("; ")
        raise InputError(str(path), f"this is a {what}", "a file of recorded numbers", mend, code="E040")
    return found


def recordings_in_archive(path: Path) -> list[Path]:
    """Return the members of a zip archive that may be recordings, as paths into it; none of any other file."""
    return archives.members(path) if path.is_file() and _recognised(path) is archives.ZIP else []


def _recognised(path: Path) -> Format | None:
    head = _head(path)
    return next((one for one in formats() if one.has(head, path)), None)


def _head(path: Path) -> bytes:
    if archive_and_member(path):
        return b""
    if not path.is_file():
        found = "a folder" if path.is_dir() else "no regular file (a pipe or a device)"
        raise InputError(
            str(path), found, "a file of recorded numbers", "copy what it delivers into a file", code="E040"
        )
    with path.open("rb") as file:
        return file.read(HEAD_BYTES)


def _open_reader(name: str, opens: Callable[[Path], Reader], path: Path) -> Reader:
    notes: list[Repair] = []
    with library_errors_as_input_errors(path, name, notes):
        reader = opens(path)
    reader.repairs += notes
    if not reader.names:
        wanted, mend = f"a whole {name} file", "copy or export it again"
        raise InputError(str(path), "holds no columns of numbers", wanted, mend, code="E041")
    return reader
