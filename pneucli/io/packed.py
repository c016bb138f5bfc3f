"""Packed files: gzip, bzip2, xz, zip and Excel, recognised by their first bytes, unpacked into a folder of their own.

What is inside is read as any other file; where it cannot be, the messages name the packed file and its member.
"""

from __future__ import annotations

import atexit
import bz2
import csv
import gzip
import lzma
import shutil
import tempfile
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import date, datetime, time, timedelta
from functools import lru_cache
from pathlib import Path
from typing import IO, Any

from pneucli import paths
from pneucli.errors import InputError, did_you_mean
from pneucli.io.column_reader import import_extra
from pneucli.io.damaged_files import check_expanded_size, library_errors_as_input_errors
from pneucli.io.raw_file import ColumnRequest, ColumnValues, Reader

BLOCK_BYTES = 1 << 22
_STREAMS: dict[bytes, tuple[str, Callable[..., IO[bytes]]]] = {
    b"\x1f\x8b": ("gzip", gzip.GzipFile),  # type: ignore[dict-item]
    b"BZh": ("bzip2", bz2.BZ2File),
    b"\xfd7zXZ\x00": ("xz", lzma.LZMAFile),
}
_EXCEL = {b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1": "Excel (xls)"}
_REFUSED = {
    b"7z\xbc\xaf\x27\x1c": "7-Zip archive",
    b"Rar!\x1a\x07": "RAR archive",
    b"\x28\xb5\x2f\xfd": "Zstandard file",
}
_SUFFIXES = (".gz", ".bz2", ".xz", ".zip")
_folder: str | None = None  # of all unpacked files, removed when the program ends


def packed_format(path: Path, head: bytes) -> str | None:
    """Return what packs a file, ``"Excel"`` for workbooks; None where nothing does.

    Raises InputError where it is an archive that is not read.
    """
    for magic, name in _REFUSED.items():
        if head.startswith(magic):
            raise InputError(
                str(path), f"this is a {name}", "a file of recorded numbers", "unpack it first", code="E040"
            )
    if head[257:262] == b"ustar":
        raise InputError(
            str(path), "this is a tar archive", "a file of recorded numbers", "unpack it first", code="E040"
        )
    if any(head.startswith(magic) for magic in _EXCEL):
        return "Excel"
    for magic, (name, _) in _STREAMS.items():
        if head.startswith(magic):
            return name
    return _zip_format(path) if head.startswith(b"PK\x03\x04") else None


def _zip_format(path: Path) -> str:
    with library_errors_as_input_errors(path, "zip", []), zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        if any(name.startswith("xl/") for name in names) or "content.xml" in names:
            return "Excel"
        arrays = [name for name in names if name.endswith(".npy")]
        return "NumPy" if arrays and len(arrays) == len(names) else "zip"


@contextmanager
def named_as(path: Path, inner: Path) -> Iterator[None]:
    """Let errors about the unpacked file ``inner`` name the packed file ``path``."""
    try:
        yield
    except InputError as error:
        raise InputError(
            error.where.replace(str(inner), shown_name(path, inner)),
            error.found,
            error.wanted,
            error.mend,
            error.faults,
            code=error.code,
        ) from error


class PackedReader:
    """The reader of what was unpacked; its messages name the packed file."""

    def __init__(self, reader: Reader, path: Path, inner: Path) -> None:
        self._reader, self._path, self._inner = reader, path, inner
        self.names = reader.names
        self.clocks, self.clock_names = reader.clocks, reader.clock_names

    def __getattr__(self, name: str) -> Any:
        return getattr(self._reader, name)

    def batches(self, requests: Sequence[ColumnRequest]) -> Iterator[list[ColumnValues]]:
        """Yield the asked columns, as the reader does."""
        with named_as(self._path, self._inner):
            yield from self._reader.batches(requests)

    def locate(self, row: int) -> str:
        """Return where a row stands in the packed file."""
        return self._reader.locate(row).replace(str(self._inner), shown_name(self._path, self._inner))


def shown_name(path: Path, inner: Path) -> str:
    """Return how messages name what was unpacked."""
    return str(path) if path.name.startswith(inner.name) else f"{path}/{inner.name}"


def unpack(path: Path, kind: str) -> Path:
    """Return the file inside a packed one, unpacked; a zip archive may be named with its member, ``runs.zip/a.csv``.

    Raises InputError where it holds none or several, or where it needs an extra that is not installed.
    """
    status = paths.file_on_disk(path).stat()
    return _unpacked(path, kind, status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=256)
def _unpacked(path: Path, kind: str, size: int, changed: int) -> Path:
    target = Path(tempfile.mkdtemp(dir=_scratch()))
    with library_errors_as_input_errors(path, kind, []):
        if kind == "Excel":
            return _write_sheet(path, target / f"{path.stem}.tsv")
        if kind == "zip":
            return _extract_member(*(paths.archive_and_member(path) or (path, _only_member(path))), target)
        name = path.name[: -len(path.suffix)] if path.suffix.lower() in _SUFFIXES else path.name
        stream = next(opened for name_, opened in _STREAMS.values() if name_ == kind)
        with stream(path) as source:
            return _copy(path, source, target / name)


def _scratch() -> str:
    global _folder  # noqa: PLW0603 - one for the program
    if _folder is None:
        _folder = tempfile.mkdtemp(prefix="pneucli-unpacked-")
        atexit.register(shutil.rmtree, _folder, ignore_errors=True)
    return _folder


def _copy(path: Path, source: IO[bytes], target: Path) -> Path:
    written = 0
    with target.open("wb") as file:
        while block := source.read(BLOCK_BYTES):
            written += len(block)
            check_expanded_size(path, written, of="its content")
            file.write(block)
    return target


def recordings_in_archive(path: Path) -> list[Path]:
    """Return the members of a zip archive that may be recordings, as paths into it; none of any other file."""
    return [path / name for name in paths.member_names(path) if not _is_note(name)]


def _only_member(path: Path) -> str:
    """Return the name of the one recording in an archive; raises InputError where there is none, or several."""
    members = [name for name in paths.member_names(path) if not _is_note(name)]
    if len(members) != 1:
        listed = ", ".join(members[:5]) + ", ..." * (len(members) > 5)
        found = f"a zip archive of {len(members)} files" + (f": {listed}" if members else "")
        mend = "copy the archive again"
        if members:
            suffix = Counter(Path(name).suffix for name in members).most_common(1)[0][0]
            one = next(name for name in members if name.endswith(suffix))
            mend = f'name one, file = "{path.name}/{one}", or several, file = "{path.name}/*{suffix}"'
        raise InputError(str(path), found, "one recording in an archive, or the names of some", mend, code="E048")
    return members[0]


def _extract_member(path: Path, name: str, folder: Path) -> Path:
    with zipfile.ZipFile(path) as archive:
        if name not in archive.namelist():
            wanted, listed = "a file in this archive", recordings_in_archive(path)
            mend = did_you_mean(name, [str(one.relative_to(path).as_posix()) for one in listed])
            raise InputError(str(path), f'no "{name}" in the archive', wanted, mend, code="E048")
        with archive.open(name) as source:
            return _copy(path, source, folder / Path(name).name)


def _is_note(name: str) -> bool:
    """Return whether a member is none that anyone recorded: what macOS adds, or a text about the others."""
    plain = Path(name).name.lower()
    return name.startswith("__MACOSX/") or plain.startswith(".") or plain.startswith(("readme", "license"))


def _write_sheet(path: Path, target: Path) -> Path:
    """Write the sheet of a workbook that holds most rows as a text with tabs."""
    calamine = import_extra(
        "python_calamine", "excel", path, found="this is an Excel file, and python-calamine is not installed"
    )
    workbook = calamine.CalamineWorkbook.from_path(str(path))
    sheets = [workbook.get_sheet_by_name(name).to_python(skip_empty_area=True) for name in workbook.sheet_names]
    rows: list[list[Any]] = max(sheets, key=_numeric_rows, default=[])
    if not _numeric_rows(rows):
        raise InputError(
            str(path), "no sheet of this Excel file holds numbers", "rows of numbers", "export it again", code="E041"
        )
    with target.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, delimiter="\t", lineterminator="\n")
        writer.writerows([_cell(value) for value in row] for row in rows)
    return target


def _numeric_rows(rows: Sequence[Sequence[Any]]) -> int:
    return sum(any(isinstance(value, int | float | datetime) for value in row) for row in rows)


def _cell(value: Any) -> str:
    if isinstance(value, float | int) and not isinstance(value, bool):
        return repr(value)
    if isinstance(value, timedelta):
        return repr(value.total_seconds())
    if isinstance(value, datetime | date | time):
        return value.isoformat(" ") if isinstance(value, datetime) else value.isoformat()
    return str(value).replace("\t", " ").replace("\n", " ").strip()
