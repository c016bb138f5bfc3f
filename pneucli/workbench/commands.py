"""Run the program's own commands in processes of their own: what a button does is what the command line does."""

import asyncio
import os
import shlex
import sys
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pneucli.messages.progress import LOG_INTERVAL_VARIABLE

PROGRESS_INTERVAL = 0.5  # s, between two lines of progress
KILL_DELAY = 5.0  # s, from asking a command to end to ending it
KEPT_LINES = 200  # of a command's messages
ERROR = "error: "  # with which the lines of a refusal begin


@dataclass
class Command:
    """One command: its words after ``pneucli``, and what came of it.

    Attributes:
        words: The command line after ``pneucli``, the pipeline file as the user would write it.
        messages: What it wrote on standard error, the last line last.
        printed: What it wrote on standard output.
        exit_code: None while it runs.
        cancelled: Whether the user ended it.
        number: How many commands this workbench has begun by then.

    """

    words: Sequence[str]
    started: float = field(default_factory=time.monotonic)
    messages: deque[str] = field(default_factory=lambda: deque(maxlen=KEPT_LINES))
    printed: str = ""
    exit_code: int | None = None
    cancelled: bool = False
    number: int = 1

    @property
    def line(self) -> str:
        """The command line that does the same."""
        return shlex.join(["pneucli", *self.words])

    @property
    def name(self) -> str:
        """The command's name."""
        return self.words[0]

    def as_json(self) -> dict[str, Any]:
        """Return what the page shows of it."""
        running = self.exit_code is None
        return {
            "number": self.number,
            "name": self.name,
            "line": self.line,
            "running": running,
            "seconds": round(time.monotonic() - self.started, 1) if running else None,
            "progress": self.messages[-1].strip() if running and self.messages else "",
            "failed": not running and not self.cancelled and self.exit_code not in (0, 1),
            "cancelled": self.cancelled,
            "text": "" if running else self.text(),
        }

    def text(self) -> str:
        """Return what it found, in the sentences of the command line."""
        if self.cancelled:
            return "Cancelled: every file is as before, or complete."
        if self.exit_code in (0, 1):
            return self.printed
        lines = [*self.messages]
        first = next((i for i, line in enumerate(lines) if line.startswith(ERROR)), 0)
        return "\n".join(lines[first:]).removeprefix(ERROR) or f"the command ended with exit code {self.exit_code}"


class CommandRunner:
    """Runs one command at a time.

    Args:
        folder: The folder in which commands run.

    Attributes:
        changed: Called whenever there is something new to show.

    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.changed: Callable[[], None] = lambda: None
        self.last: Command | None = None
        self._process: asyncio.subprocess.Process | None = None

    @property
    def running(self) -> bool:
        """Whether a command runs."""
        return self.last is not None and self.last.exit_code is None

    async def run(self, words: Sequence[str]) -> Command:
        """Run ``pneucli`` with these words to its end."""
        command = self.last = Command(words, number=1 + (self.last.number if self.last else 0))
        environment = {**os.environ, LOG_INTERVAL_VARIABLE: str(PROGRESS_INTERVAL), "PYTHONIOENCODING": "utf-8"}
        self._process = process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "pneucli", *words),
            cwd=self.folder,
            env=environment,
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        self.changed()
        reading = asyncio.gather(process.stdout.read(), self._listen(process, command))  # type: ignore[union-attr]
        try:
            out, _ = await reading
            code = await process.wait()
        except asyncio.CancelledError:  # the workbench ends as the command begins
            with suppress(ProcessLookupError):
                process.kill()
            await process.wait()
            raise
        command.printed = out.decode("utf-8", "replace").rstrip()
        command.exit_code, self._process = code, None
        self.changed()
        return command

    async def _listen(self, process: asyncio.subprocess.Process, command: Command) -> None:
        """Take the lines of progress as they come."""
        async for line in process.stderr:  # type: ignore[union-attr]
            command.messages.append(line.decode("utf-8", "replace").rstrip())
            self.changed()

    async def cancel(self) -> None:
        """End the running command; its stage's folder stays as it was."""
        if (process := self._process) is None or self.last is None:
            return
        self.last.cancelled = True
        process.terminate()
        with suppress(asyncio.TimeoutError):
            await asyncio.wait_for(process.wait(), KILL_DELAY)
            return
        process.kill()
