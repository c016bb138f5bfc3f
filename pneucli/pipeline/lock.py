"""Lock an artifacts folder, so that one run at a time uses it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from pneucli.errors import InputError

if TYPE_CHECKING:
    from filelock import FileLock

LOCK_FILE = ".lock"


@contextmanager
def folder_lock(folder: Path, notify: Callable[[str], None]) -> Iterator[None]:
    """Hold the lock of ``folder``, which is created if necessary; ``notify`` receives the name of another holder.

    The operating system releases the lock of a dead process. Raises InputError where the folder cannot be created or
    written to, or where the lock's place is taken by a file that pneucli did not write.
    """
    from filelock import FileLock  # noqa: PLC0415 - it brings asyncio, and commands that run nothing need no lock

    path = folder / LOCK_FILE
    lock = FileLock(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _refuse_foreign_file(path)
        _acquire(lock, path, notify)
    except OSError as error:
        mend = "name another folder with --out"
        raise InputError(
            str(folder), f"cannot write artifacts there: {error.strerror}", mend=mend, code="E005"
        ) from error
    try:
        yield
    finally:
        lock.release()


def _acquire(lock: FileLock, path: Path, notify: Callable[[str], None]) -> None:
    from filelock import Timeout  # noqa: PLC0415

    try:
        lock.acquire(blocking=False)
    except Timeout:
        owner = _read(path)
        notify(f"waiting for another run{owner and f' (process {owner})'} in {path.parent}")
        lock.acquire()
    with suppress(PermissionError):  # Windows keeps the file of a lock from being written
        path.write_text(str(os.getpid()), encoding="ascii")


def _refuse_foreign_file(path: Path) -> None:
    if (found := _read(path)) and not found.isdigit():
        mend = "move it away, or name another folder with --out"
        raise InputError(str(path), "a file that pneucli did not write", "the number of a process", mend, code="E006")


def _read(path: Path) -> str:
    """Return the begin of the lock's file; nothing where there is none, or where Windows keeps it from being read."""
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            return file.read(32)
    except (FileNotFoundError, PermissionError):
        return ""
