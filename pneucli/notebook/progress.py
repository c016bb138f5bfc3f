"""Print progress and messages on standard error, for a terminal, a log or a notebook."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

from pneucli.errors import printable
from pneucli.paths import from_here
from pneucli.pipeline.context import Progress, no_progress

LINE_INTERVAL = 9.0  # s, between progress lines without a terminal


def print_message(message: str) -> None:
    """Print a message on standard error, paths from where the user stands; a closed pipe does not stop the work."""
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


@contextmanager
def progress(quiet: bool) -> Iterator[Progress]:
    """Yield the function to which stages report: it draws a bar on a terminal, and prints plain lines elsewhere."""
    if quiet:
        yield no_progress
    elif sys.stderr.isatty():
        with _bar() as show:
            yield show
    else:
        with _lines() as show:
            yield show


@contextmanager
def _bar() -> Iterator[Progress]:
    from rich.console import Console  # noqa: PLC0415 - only a terminal needs it
    from rich.progress import (  # noqa: PLC0415 - likewise
        BarColumn,
        Progress,
        SpinnerColumn,
        TextColumn,
        TimeElapsedColumn,
    )

    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=1.0)
        yield lambda message, fraction: bar.update(task, description=message, completed=fraction)


@contextmanager
def _lines() -> Iterator[Progress]:
    """Yield a function that stores the last report; a thread prints it every few seconds."""
    last = ["starting"]
    start = time.monotonic()
    done = threading.Event()

    def show(message: str, fraction: float) -> None:
        last[0] = f"{message}, {100 * fraction:.0f} %"

    def tell() -> None:
        while not done.wait(LINE_INTERVAL):
            print_message(f"  {last[0]} ({time.monotonic() - start:.0f} s)")

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield show
    finally:
        done.set()
        teller.join()
