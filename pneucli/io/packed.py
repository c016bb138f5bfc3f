"""What packed and damaged files share: one sentence for damage, bounded expansion, a folder for what is unpacked.

Where what is inside cannot be read, the messages name the packed file and its member.
"""

from __future__ import annotations

import atexit
import gc
import logging
import shutil
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from logging.handlers import BufferingHandler
from pathlib import Path
from typing import IO, Any

from pneucli import paths
from pneucli.errors import InputError
from pneucli.io.raw_file import ColumnRequest, ColumnValues, Reader, Repair
from pneucli.messages.formatting import format_plain

MIN_EXPANSION_LIMIT = 512 << 20  # bytes that any file may expand to
# times its own size, that a larger one may: measured signals, having noise, shrink to a tenth at most
MAX_EXPANSION_RATIO = 100
_LIBRARY_LOGGERS = ("asammdf", "nptdms")
MAX_NOTES = 1000  # that a library may log; of more the last ones are told
_IGNORED_WARNINGS = (DeprecationWarning, PendingDeprecationWarning, FutureWarning, ResourceWarning)


@contextmanager
def library_errors_as_input_errors(path: Path, name: str, repairs: list[Repair]) -> Iterator[None]:
    """Run a library's code on ``path``, a file of the format ``name``.

    Whatever it raises on a damaged file becomes an InputError; what it warns of or logs is noted in ``repairs``.
    """
    notes: list[str] = []
    try:
        with warnings.catch_warnings(record=True) as caught, _capture_logs(notes):
            warnings.simplefilter("always")
            yield
    except InputError:
        raise
    except MemoryError:
        raise InputError(
            str(path), "does not fit into the memory", "", "take a stretch of it, or fewer signals", code="E005"
        ) from None
    except Exception as error:  # these libraries raise all kinds of things on damaged files
        found = f"cannot be read as {name}: {type(error).__name__}: {_first_line(str(error))}"
        with _mute_unraisable():  # half-made readers complain while they are collected
            traceback.clear_frames(error.__traceback__)
            del error
            gc.collect()  # what is left of them may hold itself
        raise InputError(str(path), found, f"a whole {name} file", "copy or export it again", code="E044") from None
    notes += [str(one.message) for one in caught if not issubclass(one.category, _IGNORED_WARNINGS)]
    repairs += [Repair("", "reader", 1, f"while reading: {_first_line(note)}") for note in dict.fromkeys(notes)]


def check_expanded_size(path: Path, size: int, *, of: str = "the wanted columns") -> None:
    """Raise InputError where ``path`` would expand to ``size`` bytes, out of all proportion to its own size."""
    own = path.stat().st_size
    if size > max(MIN_EXPANSION_LIMIT, MAX_EXPANSION_RATIO * own):
        found = f"{of} expand to {size / 1e6:.0f} MB, from a file of {format_plain(own / 1e6, 3)} MB"
        wanted = f"at most {MAX_EXPANSION_RATIO} times the file's size, or {MIN_EXPANSION_LIMIT >> 20} MB"
        raise InputError(
            str(path), found, wanted, "check what wrote the file; no measured signal shrinks so much", code="E044"
        )


def _first_line(text: str) -> str:
    """Return the first line of what a library says, shortened."""
    line = next(iter(text.strip().splitlines()), "")
    return line if len(line) <= 200 else f"{line[:200]} ..."


@contextmanager
def _capture_logs(notes: list[str]) -> Iterator[None]:
    """Let the libraries' loggers write to ``notes`` instead of the screen."""
    root, handler = logging.getLogger(), BufferingHandler(MAX_NOTES)
    handler.setLevel(logging.WARNING)
    own = [
        log
        for name, log in root.manager.loggerDict.items()
        if name.partition(".")[0] in _LIBRARY_LOGGERS and isinstance(log, logging.Logger)
    ]
    before = [(log, log.handlers[:], log.propagate) for log in own]
    for log in own:
        log.handlers, log.propagate = [handler], False
    try:
        yield
    finally:
        notes += [record.getMessage() for record in handler.buffer]
        for log, handlers, propagate in before:
            log.handlers, log.propagate = handlers, propagate


@contextmanager
def _mute_unraisable() -> Iterator[None]:
    before = sys.unraisablehook
    sys.unraisablehook = lambda _: None
    try:
        yield
    finally:
        sys.unraisablehook = before


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
