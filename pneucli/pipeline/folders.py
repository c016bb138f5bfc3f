"""A stage's folder is the old one or the new one, whole, at every moment at which a run may be killed.

A stage writes into ``.NAME.new``. When it is done, ``NAME`` is renamed to ``.NAME.old``, ``.NAME.new`` to ``NAME``, and
the old one is deleted. :func:`recover_folder`, called under the lock before anything else, puts back an old folder whose
successor has not arrived, and removes what a killed run left behind.

Nothing is removed but what this program wrote: what the folder's manifest lists, and, of a folder that was never
finished, what lies beside its mark, which is there before anything else and goes last.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pneucli.errors import InputError
from pneucli.pipeline import manifest as staleness

NO_FOLDER = -1
INCOMPLETE_MARK = f".{staleness.MANIFEST_FILE}"  # what the manifest is called until it is whole


def _new(artifacts: Path, stage: str) -> Path:
    return artifacts / f".{stage}.new"


def _old(artifacts: Path, stage: str) -> Path:
    return artifacts / f".{stage}.old"


def require_own_files(artifacts: Path, stages: Iterable[str]) -> None:
    """Raise InputError where the place of a stage's folder holds anything that this program did not write."""
    for stage in stages:
        for folder in (artifacts / stage, _old(artifacts, stage), _new(artifacts, stage)):
            if foreign := _foreign_files(folder):
                found = f"{', '.join(foreign[:3])}{', ...' * (len(foreign) > 3)}, which pneucli did not write"
                mend = "move it away, or name another folder with --out"
                raise InputError(str(folder), found, f"what {stage} wrote there, and nothing else", mend)


@contextmanager
def replace_folder(artifacts: Path, stage: str) -> Iterator[Path]:
    """Yield the empty folder into which the stage writes; it replaces the old one when the block ends well.

    Else it is removed. Raises InputError where the old one has got a file meanwhile that no stage wrote.
    """
    final, old, new = artifacts / stage, _old(artifacts, stage), _new(artifacts, stage)
    new.mkdir()
    (new / INCOMPLETE_MARK).touch()
    try:
        yield new
        require_own_files(artifacts, [stage])
    except BaseException as error:
        _remove(new)
        if isinstance(error, OSError) and error.filename is None:  # a disk that is full says not where
            error.filename = str(final)
        raise
    if final.exists():
        final.rename(old)
    new.rename(final)
    _remove(old)


def recover_folder(artifacts: Path, stage: str) -> None:
    """Make good what a killed run left of ``stage``."""
    final, old = artifacts / stage, _old(artifacts, stage)
    if old.exists() and not final.exists():
        old.rename(final)
    for leftover in (old, _new(artifacts, stage)):
        if not _foreign_files(leftover):
            _remove(leftover)


def _foreign_files(folder: Path) -> list[str]:
    """Return what in ``folder`` this program did not write, by its path in there.

    Another run may swap the folder meanwhile: manifest and content are of one moment only where neither has changed.
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
    """Return which folder this is, and the paths of all that is in it."""
    if folder.is_symlink() or not folder.is_dir():
        return NO_FOLDER, set()
    return folder.stat().st_ino, {path.relative_to(folder).as_posix() for path in _walk(folder)}


def _walk(folder: Path) -> Iterator[Path]:
    """Yield all that is in ``folder``, links not followed, what is deeper first."""
    for root, folders, files in os.walk(folder, topdown=False):
        yield from (Path(root, name) for name in (*files, *folders))


def _remove(folder: Path) -> None:
    """Remove what this program wrote, mark and manifest last, and the folder where nothing else is in it."""
    kept = {folder / name for name in _foreign_files(folder)}
    last = [folder / staleness.MANIFEST_FILE, folder / INCOMPLETE_MARK]
    for path in (*(path for path in _walk(folder) if path not in kept and path not in last), *last, folder):
        with suppress(OSError):
            path.rmdir() if path.is_dir() else path.unlink(missing_ok=True)
