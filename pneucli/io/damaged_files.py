"""Between the user and libraries that read raw files: damage is reported in one sentence, expansion is bounded."""

from __future__ import annotations

import gc
import logging
import sys
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from logging.handlers import BufferingHandler
from pathlib import Path

from pneucli.errors import InputError
from pneucli.io.raw_file import Repair
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
