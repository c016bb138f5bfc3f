"""The meaning of paths in the pipeline file: relative to the file, with variables, ``~`` and globs."""

from __future__ import annotations

import glob
import os
import re
from pathlib import Path

from pneucli.errors import InputError, printable


def expand_path(text: str, folder: Path, where: str) -> Path:
    """Return the path or glob ``text``: ``${NAME}`` and ``~`` replaced, relative to ``folder``, that of the file.

    Raises InputError at ``where`` for an environment variable that is not set.
    """

    def value(match: re.Match[str]) -> str:
        if (found := os.environ.get(match[1])) is None:
            mend = f"export {match[1]}=FOLDER"
            raise InputError(where, f"the environment variable {match[1]} is not set", "its value in the path", mend)
        return found

    return folder / os.path.expanduser(re.sub(r"\$\{(\w+)\}", value, text))


def matching_files(text: str, folder: Path, where: str) -> list[Path]:
    """Return the regular files that ``text`` names, in natural order.

    Raises InputError for an environment variable that is not set, and for a name that cannot be printed.
    """
    path = expand_path(text, folder, where)
    found = (
        [path] if is_file(path) else [hit for hit in map(Path, glob.glob(str(path), recursive=True)) if is_file(hit)]
    )
    for hit in found:
        require_printable(hit, where)
    return sorted(found, key=_natural_order)


def matching_files_or_path(text: str, folder: Path, where: str) -> list[Path]:
    """Return :func:`matching_files`, or the path itself where there is none."""
    return matching_files(text, folder, where) or [expand_path(text, folder, where)]


def require_printable(path: Path, where: str) -> None:
    """Raise InputError where a name on the path is not UTF-8 or contains control characters."""
    if printable(str(path)) != str(path):
        found = f'the path "{path}" is not UTF-8 or holds control characters'
        raise InputError(where, found, "names that can be printed", "rename the file or its folder")


def is_file(path: Path) -> bool:
    """Return whether the path is an existing file and no folder, pipe or device."""
    try:
        return path.is_file()
    except OSError:  # such as a name that is too long
        return False


def _natural_order(path: Path) -> list[tuple[bool, int, str]]:
    parts = re.split(r"(\d+)", str(path))
    return [(part.isdigit(), int(part) if part.isdigit() else 0, part) for part in parts]
