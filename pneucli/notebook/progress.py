"""Print progress and messages on standard error, for a terminal, a log or a notebook."""

import os
import shutil
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from typing import TextIO

from pneucli.errors import printable
from pneucli.messages.progress import LOG_INTERVAL_VARIABLE, progress_line
from pneucli.paths import from_here
from pneucli.pipeline.graph import NO_PROGRESS, Progress

REDRAW_INTERVAL = 0.5  # s, between two drawings of the line on a terminal
LOG_INTERVAL = 30.0  # s, between two lines in a log, unless the environment says otherwise


def print_message(message: str) -> None:
    """Print a message on standard error, paths from where the user stands; a closed pipe does not stop the work."""
    if (line := _line.get()) is not None:
        line.clear()
    try:
        print(from_here(printable(message, keep="\n")), file=sys.stderr, flush=True)
    except BrokenPipeError:
        discard_output(sys.stderr)


def discard_output(stream: TextIO) -> None:
    """Discard pending output of a closed pipe."""
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def ignore_message(message: str) -> None:
    """Print nothing."""


class ProgressLine(Progress):
    """One line about the present work: redrawn in its place on a terminal, written now and then to a log."""

    def __init__(self, *, redrawn: bool) -> None:
        self._redrawn, self._drawn = redrawn, 0
        self._lock = threading.Lock()
        self.begin("", None)

    def begin(self, work: str, seconds: float | None) -> None:
        """Begin a work that takes about so many seconds."""
        self._work, self._message, self._began = work, "starting", time.monotonic()
        self._end = None if seconds is None else self._began + seconds
        self._first: tuple[float, float] | None = None  # when the first share was reported, and the share

    def __call__(self, message: str, share: float | None = None) -> None:
        """Note what is being done; shares of the work that are reported tell better than the estimate when it ends."""
        self._message, now = message, time.monotonic()
        if share is None:
            return
        if self._first is None or share < self._first[1]:
            self._first = now, share
        elif share > self._first[1]:
            since, before = self._first
            self._end = now + (now - since) * (1.0 - share) / (share - before)

    def text(self) -> str:
        """Return the line."""
        now = time.monotonic()
        left = None if self._end is None else self._end - now
        return progress_line(": ".join(filter(None, [self._work, self._message])), now - self._began, left)

    def draw(self) -> None:
        """Write the line, on a terminal in place of the former one."""
        if not self._redrawn:
            print_message(self.text())
            return
        with self._lock:
            text = printable(self.text())[: shutil.get_terminal_size().columns - 1]
            self._write(f"\r{text.ljust(self._drawn)}")
            self._drawn = len(text)

    def clear(self) -> None:
        """Remove the line from the terminal."""
        with self._lock:
            if self._drawn:
                self._write(f"\r{' ' * self._drawn}\r")
                self._drawn = 0

    def _write(self, text: str) -> None:
        with suppress(OSError):  # a closed terminal does not stop the work
            sys.stderr.write(text)
            sys.stderr.flush()


def _log_interval() -> float:
    """Return the time in s between two lines in a log; a value that is no number counts as none."""
    with suppress(KeyError, ValueError):
        return max(float(os.environ[LOG_INTERVAL_VARIABLE]), 0.1)
    return LOG_INTERVAL


_line: ContextVar[ProgressLine | None] = ContextVar("line", default=None)


@contextmanager
def progress(quiet: bool) -> Iterator[Progress]:
    """Yield what stages report to: one line that is redrawn on a terminal, a line every half minute elsewhere."""
    if quiet:
        yield NO_PROGRESS
        return
    on_terminal = sys.stderr.isatty() and os.environ.get("TERM") != "dumb"
    line, done = ProgressLine(redrawn=on_terminal), threading.Event()

    def draw() -> None:
        while not done.wait(REDRAW_INTERVAL if on_terminal else _log_interval()):
            line.draw()

    drawer, token = threading.Thread(target=draw, daemon=True), _line.set(line)
    drawer.start()
    try:
        yield line
    finally:
        done.set()
        drawer.join()
        line.clear()
        _line.reset(token)
