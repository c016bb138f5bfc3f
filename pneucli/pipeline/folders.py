"""Replace a stage's folder atomically: whenever a run is killed, the folder is completely the old or the new one.

A stage writes into ``.NAME.new``. When it is done, ``NAME`` is renamed to ``.NAME.old``, ``.NAME.new`` to ``NAME``, and
the old folder is deleted. :func:`recover_folder`, called first under the lock, restores an old folder whose successor
is not in place, and removes what a killed run left.

The program removes only what it wrote itself: the files in the folder's manifest and, of an unfinished folder, the
files next to its mark, which is written first and removed last.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from pneucli.errors import InputError
from pneucli.pipeline import manifest as staleness

if TYPE_CHECKING:
    from filelock import FileLock


LOCK_FILE = ".lock"
NO_FOLDER = -1
INCOMPLETE_MARK = f".{staleness.MANIFEST_FILE}"  # the manifest's name until the folder is complete


def _new(artifacts: Path, stage: str) -> Path:
    return artifacts / f".{stage}.new"


def _old(artifacts: Path, stage: str) -> Path:
    return artifacts / f".{stage}.old"


def require_own_files(artifacts: Path, stages: Iterable[str]) -> None:
    """Raise InputError where a stage's folder contains files that this program did not write."""
    for stage in stages:
        for folder in (artifacts / stage, _old(artifacts, stage), _new(artifacts, stage)):
            if foreign := _foreign_files(folder):
                found = f"{', '.join(foreign[:3])}{', ...' * (len(foreign) > 3)}, which pneucli did not write"
                mend = "move it away, or name another folder with --out"
                raise InputError(str(folder), found, f"what {stage} wrote there, and nothing else", mend, code="E006")


@contextmanager
def replace_folder(artifacts: Path, stage: str) -> Iterator[Path]:
    """Yield an empty folder for the stage; it replaces the old one when the block ends without error.

    After an error it is removed. Raises InputError where the old folder meanwhile contains a file of no stage.
    """
    final, old, new = artifacts / stage, _old(artifacts, stage), _new(artifacts, stage)
    new.mkdir()
    (new / INCOMPLETE_MARK).touch()
    try:
        yield new
        require_own_files(artifacts, [stage])
    except BaseException as error:
        _remove(new)
        if isinstance(error, OSError) and error.filename is None:  # the error of a full disk has no file name
            error.filename = str(final)
        raise
    if final.exists():
        final.rename(old)
    new.rename(final)
    _remove(old)


def recover_folder(artifacts: Path, stage: str) -> None:
    """Restore the folder of ``stage`` after a killed run."""
    final, old = artifacts / stage, _old(artifacts, stage)
    if old.exists() and not final.exists():
        old.rename(final)
    for leftover in (old, _new(artifacts, stage)):
        if not _foreign_files(leftover):
            _remove(leftover)


def _foreign_files(folder: Path) -> list[str]:
    """Return the files in ``folder`` that this program did not write, by their path in it.

    Another run may replace the folder meanwhile, so manifest and content are read again until neither changes.
    """
    seen: tuple[int, set[str]] | None = None
    while seen != (now := _content(folder)):
        seen, manifest = now, staleness.read_manifest(folder)
    inode, there = now
    if inode == NO_FOLDER:
        return [folder.name] if os.path.lexists(folder) else []
    if INCOMPLETE_MARK in there and staleness.MANIFEST_FILE not in there:
        return []
    listed = manifest.outputs if manifest else ()
    ours = {
        INCOMPLETE_MARK,
        staleness.MANIFEST_FILE,
        *listed,
        *(parent.as_posix() for name in listed for parent in Path(name).parents),
    }
    return sorted(there - ours)


def _content(folder: Path) -> tuple[int, set[str]]:
    """Return the identity of the folder, and the paths of its content."""
    if folder.is_symlink() or not folder.is_dir():
        return NO_FOLDER, set()
    return folder.stat().st_ino, {path.relative_to(folder).as_posix() for path in _walk(folder)}


def _walk(folder: Path) -> Iterator[Path]:
    """Yield the content of ``folder``, the deepest first, without following links."""
    for root, folders, files in os.walk(folder, topdown=False):
        yield from (Path(root, name) for name in (*files, *folders))


def _remove(folder: Path) -> None:
    """Remove the files that this program wrote, mark and manifest last, and then the folder if it is empty."""
    foreign = {folder / name for name in _foreign_files(folder)}
    last = [folder / staleness.MANIFEST_FILE, folder / INCOMPLETE_MARK]
    for path in (*(path for path in _walk(folder) if path not in foreign and path not in last), *last, folder):
        with suppress(OSError):
            path.rmdir() if path.is_dir() else path.unlink(missing_ok=True)


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
