"""Standard output for answers, standard error for everything else."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, TextIO

from pneucli.errors import printable
from pneucli.pipeline.context import Progress, silent

STEPS = 10  # without a terminal, progress is told in steps of ten per cent


def say(message: str) -> None:
    """Tell people something, on standard error; where nobody listens, the work goes on."""
    try:
        print(printable(message, keep="\n"), file=sys.stderr, flush=True)
    except BrokenPipeError:
        silence(sys.stderr)


def silence(stream: TextIO) -> None:
    """Send what is still to be written into a closed pipe nowhere."""
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def hush(message: str) -> None:
    """Say nothing."""


def answer(content: Mapping[str, Any]) -> None:
    """Print the one JSON object of ``--json``."""
    print(json.dumps(content, indent=1, allow_nan=False))


@contextmanager
def progress(quiet: bool) -> Iterator[Progress]:
    """Yield the function that stages report to: a bar on a terminal, plain lines elsewhere."""
    if quiet:
        yield silent
    elif sys.stderr.isatty():
        with _bar() as show:
            yield show
    else:
        yield _lines()


@contextmanager
def _bar() -> Iterator[Progress]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0, visible=False)
        yield lambda message, fraction: bar.update(task, description=message, completed=fraction, visible=True)


def _lines() -> Progress:
    told: dict[str, int] = {}

    def show(message: str, fraction: float) -> None:
        step = int(STEPS * fraction)
        if step > told.get(message, -1):
            told[message] = step
            say(f"  {message}: {100 * fraction:.0f} %")

    return show
