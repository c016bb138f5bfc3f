"""Lock an artifacts folder, so that one run at a time uses it."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from pneucli.errors import InputError

LOCK_FILE = ".lock"

if sys.platform == "win32":
    import msvcrt

    def _lock(descriptor: int, wait: bool) -> None:
        os.lseek(descriptor, 1 << 30, os.SEEK_SET)  # beyond the text, so that others can read the holder
        while True:
            try:
                msvcrt.locking(descriptor, msvcrt.LK_LOCK if wait else msvcrt.LK_NBLCK, 1)
            except OSError:  # LK_LOCK gives up after ten seconds
                if not wait:
                    raise
            else:
                return

else:
    import fcntl

    def _lock(descriptor: int, wait: bool) -> None:
        # lockf, not flock: a worker process that outlives a killed run does not inherit it
        fcntl.lockf(descriptor, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextmanager
def folder_lock(folder: Path, notify: Callable[[str], None]) -> Iterator[None]:
    """Hold the lock of ``folder``, which is created if necessary; ``notify`` receives the name of another holder.

    The operating system releases the lock of a dead process. Raises InputError where the folder cannot be created or
    written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder / LOCK_FILE, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise InputError(
            str(folder), f"cannot write artifacts there: {error.strerror}", mend="name another folder with --out"
        ) from error
    try:
        _acquire(descriptor, folder, notify)
        yield
    finally:
        os.close(descriptor)


def _acquire(descriptor: int, folder: Path, say: Callable[[str], None]) -> None:
    try:
        _lock(descriptor, wait=False)
    except OSError:
        owner = os.pread(descriptor, 32, 0).decode() if hasattr(os, "pread") else ""
        say(f"waiting for another run{owner and f' (process {owner})'} in {folder}")
        _lock(descriptor, wait=True)
    os.lseek(descriptor, 0, os.SEEK_SET)
    if not (found := os.read(descriptor, 32)).isdigit() and found:
        mend = "move it away, or name another folder with --out"
        raise InputError(str(folder / LOCK_FILE), "a file that pneucli did not write", "the number of a process", mend)
    os.ftruncate(descriptor, 0)
    os.lseek(descriptor, 0, os.SEEK_SET)
    os.write(descriptor, str(os.getpid()).encode())
