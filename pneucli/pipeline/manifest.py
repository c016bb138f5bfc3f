"""The folder of a stage: its manifest, by whose digests it is stale or up to date, and its atomic replacement.

The manifest is ``stage.json``. A file counts as unchanged while size and time stamp are; otherwise it is read and
hashed, so that a new time stamp by itself makes nothing stale. The key of a stage is a digest of its inputs, including
the keys of its parents, so it can be computed without running anything.

Whenever a run is killed, the folder is completely the old or the new one. A stage writes into ``.NAME.new``. When it is
done, ``NAME`` is renamed to ``.NAME.old``, ``.NAME.new`` to ``NAME``, and the old folder is deleted.
:func:`recover_folder`, called first under the lock, restores an old folder whose successor is not in place, and removes
what a killed run left. The program removes only what it wrote itself: the files in the folder's manifest and, of an
unfinished folder, the files next to its mark, which is written first and removed last.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneucli import imports, paths
from pneucli.errors import InputError
from pneucli.version import __version__

if TYPE_CHECKING:
    from filelock import FileLock

MANIFEST_FILE = "stage.json"
SCHEMA = "pneucli/stage/1"
NEVER_RUN = "never done"


def digest(value: object) -> str:
    """Return the SHA-256 of a value of JSON or TOML."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, default=str).encode()).hexdigest()


@cache
def program_digest() -> str:
    """Return the program's version and the SHA-256 of its source and of extensions; a change makes all stale."""
    package = str(Path(__file__).parents[1])
    names = [
        os.path.join(folder, name)[len(package) + 1 :].replace(os.sep, "/")
        for folder, _, files in os.walk(package)
        if os.path.basename(folder) != "__pycache__"
        for name in files
    ]
    content = hashlib.sha256()
    for name in sorted(names):
        content.update(name.encode() + b"\0")
        with open(os.path.join(package, name), "rb", buffering=0) as file:
            content.update(file.read())
    content.update(repr(imports.versions()).encode())
    return f"{__version__} {content.hexdigest()}"


@dataclass(frozen=True)
class Stamp:
    """A file's size in bytes, time of modification in ns, and SHA-256; ``size = -1`` where there is no regular file."""

    size: int
    mtime_ns: int
    sha256: str


def stamp(path: Path, previous: Stamp | None = None) -> Stamp:
    """Return the stamp of ``path``; the file is read only where size or time differ from those of ``previous``."""
    path = paths.file_on_disk(path)
    if not paths.is_file(path):
        return Stamp(-1, 0, "")
    status = path.stat()
    if previous and (previous.size, previous.mtime_ns) == (status.st_size, status.st_mtime_ns):
        return previous
    with path.open("rb") as file:
        return Stamp(status.st_size, status.st_mtime_ns, hashlib.file_digest(file, "sha256").hexdigest())


def named_files(tables: Mapping[str, Any], table: str, key: str, pipeline: Path) -> dict[str, Path]:
    """Return the files that ``key`` names in ``table`` (or in each table of that array), by their path from the file.

    A name without a file is returned as a path. Raises InputError as :mod:`pneucli.paths` does.
    """
    folder, where = pipeline.parent, f"{pipeline}, key {table}.{key}"
    entries = tables.get(table, [])
    values = [entry.get(key, []) for entry in (entries if isinstance(entries, list) else [entries])]
    names = [name for value in values for name in ([value] if isinstance(value, str) else value)]
    found = [hit for name in names for hit in paths.matching_files_or_path(name, folder, where)]
    return {os.path.relpath(path, folder): path for path in found}


@dataclass(frozen=True)
class Inputs:
    """Everything that a stage's result depends on; ``tables`` has digests, ``parents`` keys."""

    program: str
    tables: Mapping[str, str]
    files: Mapping[str, Stamp]
    parents: Mapping[str, str]
    options: Mapping[str, Any]

    @property
    def key(self) -> str:
        """Digest of all inputs, without time stamps."""
        return digest({**asdict(self), "files": {name: file.sha256 for name, file in self.files.items()}})


@dataclass(frozen=True)
class Manifest:
    """The content of ``stage.json``; a stage that does not apply has ``skipped``, the reason, and no ``answer``."""

    stage: str
    inputs: Inputs
    outputs: Mapping[str, Stamp] = field(default_factory=dict)
    answer: dict[str, Any] | None = None
    skipped: Mapping[str, Any] | None = None
    seconds: float = 0.0

    def write(self, folder: Path) -> None:
        """Write or replace ``stage.json`` in ``folder``, atomically."""
        text = json.dumps({"schema": SCHEMA, "key": self.inputs.key, **asdict(self)}, indent=1, allow_nan=False)
        partial = folder / f".{MANIFEST_FILE}"
        partial.write_text(text, encoding="utf-8")
        partial.replace(folder / MANIFEST_FILE)


def read_manifest(folder: Path) -> Manifest | None:
    """Return the manifest of ``folder``; ``None`` where there is none, or one of another version."""
    try:
        content = json.loads((folder / MANIFEST_FILE).read_text(encoding="utf-8"))
        if content.pop("schema") != SCHEMA:
            return None
        content.pop("key")
        content.pop("summary", None)  # of an older program
        inputs = Inputs(**{**content["inputs"], "files": _stamps(content["inputs"]["files"])})
        return Manifest(**{**content, "inputs": inputs, "outputs": _stamps(content["outputs"])})
    except (OSError, ValueError, KeyError, TypeError):
        return None


def read_answers(artifacts: Path, stages: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Return the answers of those of the stages that have run, whether or not they are up to date."""
    manifests = {name: read_manifest(artifacts / name) for name in stages}
    return {name: one.answer for name, one in manifests.items() if one is not None and one.answer is not None}


def _stamps(content: Mapping[str, Mapping[str, Any]]) -> dict[str, Stamp]:
    return {name: Stamp(**stamp) for name, stamp in content.items()}


def stamp_files(folder: Path, previous: Mapping[str, Stamp] | None = None) -> dict[str, Stamp]:
    """Return the stamps of all files below ``folder`` except the manifest."""
    files = sorted(
        path for path in folder.rglob("*") if path.is_file() and path.name not in (MANIFEST_FILE, f".{MANIFEST_FILE}")
    )
    previous = previous or {}
    return {name: stamp(path, previous.get(name)) for path in files for name in [path.relative_to(folder).as_posix()]}


def stale_reasons(before: Manifest | None, now: Inputs, outputs: Mapping[str, Stamp]) -> tuple[str, ...]:
    """Return why a folder is stale: inputs that changed since ``before``, and ``outputs`` that were modified."""
    if before is None:
        return (NEVER_RUN,)
    was = before.inputs
    why = ["the program changed"] if was.program != now.program else []
    why += [f"{_change_word(was.tables, now.tables, name)} [{name}]" for name in _changed(was.tables, now.tables)]
    shas = ({n: s.sha256 for n, s in was.files.items()}, {n: s.sha256 for n, s in now.files.items()})
    why += _first_reasons([f"{_change_word(was.files, now.files, name)} {name}" for name in _changed(*shas)])
    why += [f"{name} is stale" for name in _changed(was.parents, now.parents)]
    why += [f"other option --{name}" for name in _changed(was.options, now.options)]
    found = {name: stamp.sha256 for name, stamp in outputs.items()}
    broken = [name for name, as_written in before.outputs.items() if found.get(name) != as_written.sha256]
    return (*why, *_first_reasons([f"its file {name} is missing or was changed" for name in broken]))


def _changed(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    return [name for name in {**before, **now} if before.get(name) != now.get(name)]


def _change_word(before: Mapping[str, Any], now: Mapping[str, Any], name: str) -> str:
    if name not in before:
        return "new"
    return "changed" if name in now else "no longer"


def _first_reasons(reasons: Iterable[str], most: int = 3) -> list[str]:
    reasons = list(reasons)
    return reasons if len(reasons) <= most else [*reasons[:most], f"and {len(reasons) - most} more"]


NUMERICAL_PACKAGES = ("numpy", "scipy", "numba")


def program_versions() -> dict[str, str]:
    """Return the versions of this program (with the hash of its source), of Python and of the numerical libraries."""
    from importlib.metadata import version  # noqa: PLC0415 - it brings the standard library's email

    python = ".".join(platform.python_version_tuple()[:2])
    return {"pneucli": program_digest(), "Python": python, **{name: version(name) for name in NUMERICAL_PACKAGES}}


LOCK_FILE = ".lock"
NO_FOLDER = -1
INCOMPLETE_MARK = f".{MANIFEST_FILE}"  # the manifest's name until the folder is complete


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
        seen, manifest = now, read_manifest(folder)
    inode, there = now
    if inode == NO_FOLDER:
        return [folder.name] if os.path.lexists(folder) else []
    if INCOMPLETE_MARK in there and MANIFEST_FILE not in there:
        return []
    listed = manifest.outputs if manifest else ()
    ours = {
        INCOMPLETE_MARK,
        MANIFEST_FILE,
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
    last = [folder / MANIFEST_FILE, folder / INCOMPLETE_MARK]
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
