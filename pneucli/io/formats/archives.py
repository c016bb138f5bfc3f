"""Compressed files and zip archives: what is inside is read; a zip archive may be named with its member."""

from __future__ import annotations

import bz2
import gzip
import lzma
import zipfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pneucli import paths
from pneucli.errors import InputError, did_you_mean
from pneucli.io.formats.base import ZIP_MAGIC, Format
from pneucli.io.packed import copy_expanded

_SUFFIXES = (".gz", ".bz2", ".xz")


def _stream(opened: Callable[[Path], Any]) -> Callable[[Path, Path], Path]:
    def unpack(path: Path, folder: Path) -> Path:
        name = path.name[: -len(path.suffix)] if path.suffix.lower() in _SUFFIXES else path.name
        with opened(path) as source:
            return copy_expanded(path, source, folder / name)

    return unpack


def members(path: Path) -> list[Path]:
    """Return the members of a zip archive that may be recordings, as paths into it; none of any other file."""
    return [path / name for name in paths.member_names(path) if not _is_note(name)]


def _only_member(path: Path) -> str:
    """Return the name of the one recording in an archive; raises InputError where there is none, or several."""
    names = [str(one.relative_to(path).as_posix()) for one in members(path)]
    if len(names) != 1:
        listed = ", ".join(names[:5]) + ", ..." * (len(names) > 5)
        found = f"a zip archive of {len(names)} files" + (f": {listed}" if names else "")
        mend = "copy the archive again"
        if names:
            suffix = Counter(Path(name).suffix for name in names).most_common(1)[0][0]
            one = next(name for name in names if name.endswith(suffix))
            mend = f'name one, file = "{path.name}/{one}", or several, file = "{path.name}/*{suffix}"'
        raise InputError(str(path), found, "one recording in an archive, or the names of some", mend, code="E048")
    return names[0]


def _extract(path: Path, folder: Path) -> Path:
    inside = paths.archive_and_member(path)
    archived = inside[0] if inside else path
    with zipfile.ZipFile(archived) as archive:
        name = inside[1] if inside else _only_member(path)
        if name not in archive.namelist():
            wanted, listed = "a file in this archive", members(archived)
            mend = did_you_mean(name, [str(one.relative_to(archived).as_posix()) for one in listed])
            raise InputError(str(archived), f'no "{name}" in the archive', wanted, mend, code="E048")
        with archive.open(name) as source:
            return copy_expanded(archived, source, folder / Path(name).name)


def _is_note(name: str) -> bool:
    """Return whether a member is none that anyone recorded: what macOS adds, or a text about the others."""
    plain = Path(name).name.lower()
    return name.startswith("__MACOSX/") or plain.startswith(".") or plain.startswith(("readme", "license"))


GZIP = Format("gzip", "`.gz`, `.bz2`, `.xz`", magic=(b"\x1f\x8b",), unpack=_stream(gzip.open), column="what is inside")
BZIP2 = Format("bzip2", magic=(b"BZh",), unpack=_stream(bz2.open))
XZ = Format("xz", magic=(b"\xfd7zXZ\x00",), unpack=_stream(lzma.open))
ZIP = Format(
    "zip",
    "`.zip`",
    magic=(ZIP_MAGIC,),
    recognises=lambda _, path: paths.archive_and_member(path) is not None,
    unpack=_extract,
    column='what is inside; `"runs.zip/*.csv"` makes each member a recording',
    place=1,  # workbooks and arrays are zip archives, too
)
