"""The meaning of paths in the pipeline file: relative to the file, with variables, ``~`` and globs.

A path may lead into a zip archive, ``runs.zip/step_1.csv``; a glob may, too. :func:`cache_folder` is where the program
keeps what it can make again.
"""

import glob
import logging
import os
import re
import tempfile
import zipfile
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path, PurePosixPath

from pneucli.errors import InputError, printable

_LOG = logging.getLogger(__name__)


def expand_path(text: str, folder: Path, where: str) -> Path:
    """Return the path or glob ``text``: ``${NAME}`` and ``~`` replaced, relative to ``folder``, that of the file.

    Raises InputError at ``where`` for an environment variable that is not set.
    """

    def value(match: re.Match[str]) -> str:
        if (found := os.environ.get(match[1])) is None:
            mend = f"export {match[1]}=FOLDER"
            raise InputError(
                where, f"the environment variable {match[1]} is not set", "its value in the path", mend, code="E008"
            )
        return found

    return folder / os.path.expanduser(re.sub(r"\$\{(\w+)\}", value, text))


def matching_files(text: str, folder: Path, where: str) -> list[Path]:
    """Return the regular files and the members of archives that ``text`` names, in natural order.

    Raises InputError for an environment variable that is not set, and for a name that cannot be printed.
    """
    path = expand_path(text, folder, where)
    found = (
        [path] if is_file(path) else [hit for hit in map(Path, glob.glob(str(path), recursive=True)) if is_file(hit)]
    ) or archive_members(path)
    for hit in found:
        require_printable(hit, where)
    return sorted(found, key=natural_order)


def matching_files_or_path(text: str, folder: Path, where: str) -> list[Path]:
    """Return :func:`matching_files`, or the path itself where there is none."""
    return matching_files(text, folder, where) or [expand_path(text, folder, where)]


def require_printable(path: Path, where: str) -> None:
    """Raise InputError where a name on the path is not UTF-8 or contains control characters."""
    if printable(str(path)) != str(path):
        found = f'the path "{path}" is not UTF-8 or holds control characters'
        raise InputError(where, found, "names that can be printed", "rename the file or its folder", code="E026")


def is_file(path: Path) -> bool:
    """Return whether the path is an existing file and no folder, pipe or device."""
    try:
        return path.is_file()
    except OSError:  # such as a name that is too long
        return False


def archive_members(pattern: Path) -> list[Path]:
    """Return the members of archives that a path or glob such as ``runs.zip/*.csv`` names, as paths of this kind."""
    found = _split_at_archive(pattern)
    if found is None:
        return []
    archive, inner = found
    archives = [archive] if is_file(archive) else map(Path, glob.glob(str(archive), recursive=True))
    return [hit / name for hit in archives for name in member_names(hit) if name == inner or _matches(name, inner)]


def member_names(archive: Path) -> list[str]:
    """Return the names of the files in a zip archive that can be parts of a path; none where it is no archive."""
    try:
        with zipfile.ZipFile(archive) as opened:
            names = [one.filename for one in opened.infolist() if not one.is_dir()]
    except (OSError, zipfile.BadZipFile):
        return []
    return [name for name in names if not name.startswith("/") and ".." not in PurePosixPath(name).parts]


def archive_and_member(path: Path) -> tuple[Path, str] | None:
    """Return the archive that a path leads into, and the member's name; None for a path that leads into none."""
    found = _split_at_archive(path)
    return found if found is not None and is_file(found[0]) else None


def file_on_disk(path: Path) -> Path:
    """Return the archive that a path leads into; other paths as they are."""
    found = archive_and_member(path)
    return path if found is None else found[0]


def _split_at_archive(path: Path) -> tuple[Path, str] | None:
    for number, part in enumerate(path.parts[:-1], 1):
        if part.lower().endswith(".zip") and not os.path.isdir(Path(*path.parts[:number])):
            return Path(*path.parts[:number]), "/".join(path.parts[number:])
    return None


def _matches(name: str, pattern: str) -> bool:
    """Return whether a member's name matches a glob, folder by folder, of which ``**`` are any number."""
    if "**" in pattern.split("/"):
        return fnmatchcase(name, pattern.replace("**/", "*"))
    parts, wanted = name.split("/"), pattern.split("/")
    return len(parts) == len(wanted) and all(map(fnmatchcase, parts, wanted))


def natural_order(path: Path) -> list[tuple[bool, int, str]]:
    """Return a key by which step_10 comes after step_9."""
    parts = re.split(r"(\d+)", str(path))
    return [(part.isdigit(), int(part) if part.isdigit() else 0, part) for part in parts]


BEFORE_A_PATH = r"(?<![\w/\\.~-])"
MAX_STEPS_UP = 2  # folders above the current one, from which a path is shown as "../"


def from_here(text: str) -> str:
    """Return a text in which paths below the current folder, or near it, start from where the user stands.

    Args:
        text: A path, or a sentence with paths.

    Returns:
        ``"."`` for the current folder, ``"raw/a.csv"`` for a file below it, ``"../rig/a.csv"`` beside it, whole paths
        elsewhere.

    """
    try:
        folder = os.getcwd()
    except FileNotFoundError:  # it was removed
        return text
    text = re.sub(BEFORE_A_PATH + re.escape(folder) + r"(?![\w/\\.~-])", lambda _: os.curdir, text)
    for up in range(MAX_STEPS_UP + 1):
        if folder == os.path.dirname(folder):  # the root: all paths are below it
            break
        before = BEFORE_A_PATH + re.escape(folder + os.sep)
        text = (f"..{os.sep}" * up).join(re.split(before, text))
        folder = os.path.dirname(folder)
    return text


def cache_folder() -> Path:
    """Return the folder of the cache: ``PNEUCLI_CACHE``, else the user's, else, with a warning, a temporary one."""
    from platformdirs import user_cache_dir  # noqa: PLC0415 - it takes a moment, and few commands need it

    return _writable_folder(Path(os.environ.get("PNEUCLI_CACHE") or user_cache_dir("pneucli")))


@cache
def _writable_folder(wanted: Path) -> Path:
    try:
        wanted.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=wanted):
            return wanted
    except OSError as error:
        instead = _temporary()
        _LOG.warning("warning: cannot write to %s (%s): compiled kernels go to %s", wanted, error.strerror, instead)
        return instead


def _temporary() -> Path:
    """Return a folder that only this user can write, because the program executes its content."""
    if not hasattr(os, "getuid"):
        return Path(tempfile.mkdtemp(prefix="pneucli-"))
    usual = Path(tempfile.gettempdir(), f"pneucli-{os.getuid()}")
    usual.mkdir(mode=0o700, exist_ok=True)
    status = usual.lstat()
    own = usual.is_dir() and not usual.is_symlink() and status.st_uid == os.getuid() and not status.st_mode & 0o077
    return usual if own else Path(tempfile.mkdtemp(prefix="pneucli-"))
