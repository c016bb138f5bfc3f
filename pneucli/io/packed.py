"""What packed files share: they are unpacked once, into a folder of their own, and read as any other file.

Where what is inside cannot be read, the messages name the packed file and its member.
"""

from __future__ import annotations

import atexit
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import IO, Any

from pneucli import paths
from pneucli.errors import InputError
from pneucli.io.damaged_files import check_expanded_size, library_errors_as_input_errors
from pneucli.io.raw_file import ColumnRequest, ColumnValues, Reader

BLOCK_BYTES = 1 << 22
Unpack = Callable[[Path, Path], Path]
_folder: str | None = None  # of all unpacked files, removed when the program ends


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


class PackedReader(Reader):
    """The reader of what was unpacked; its messages name the packed file."""

    def __init__(self, reader: Reader, path: Path, inner: Path) -> None:
        self._reader, self._path, self._inner = reader, path, inner

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
    is_itself = path.name.startswith(inner.name) or path.stem == inner.stem  # a.csv.gz, a workbook
    return str(path) if is_itself else f"{path}/{inner.name}"


def unpacked_once(path: Path, name: str, unpack: Unpack) -> Path:
    """Return the file inside a packed one of the format ``name``; again only where the packed file changed.

    Raises InputError where it holds none or several, is damaged, or needs an extra that is not installed.
    """
    status = paths.file_on_disk(path).stat()
    return _unpacked(path, name, unpack, status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=256)
def _unpacked(path: Path, name: str, unpack: Unpack, size: int, changed: int) -> Path:
    target = Path(tempfile.mkdtemp(dir=_scratch()))
    with library_errors_as_input_errors(path, name, []):
        return unpack(path, target)


def _scratch() -> str:
    global _folder  # noqa: PLW0603 - one for the program
    if _folder is None:
        _folder = tempfile.mkdtemp(prefix="pneucli-unpacked-")
        atexit.register(shutil.rmtree, _folder, ignore_errors=True)
    return _folder


def copy_expanded(path: Path, source: IO[bytes], target: Path) -> Path:
    """Write what a stream of the packed file ``path`` expands to; raises InputError where that is out of proportion."""
    written = 0
    with target.open("wb") as file:
        while block := source.read(BLOCK_BYTES):
            written += len(block)
            check_expanded_size(path, written, of="its content")
            file.write(block)
    return target
