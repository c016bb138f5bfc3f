"""From the template and a row of the table to the row's own pipeline file."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

import tomlkit

from pneucli.errors import InputError, did_you_mean
from pneucli.fleet.table import FleetRow
from pneucli.io.remote_files import is_remote

RECORDINGS = "recordings"
SAFE_CHARACTERS = " +,=@()"  # in a folder's name, beside letters, digits and _.-~


def folder_name(text: str) -> str:
    """Return a name as a folder may have it; two names never become one."""
    return quote(text, safe=SAFE_CHARACTERS)


def row_pipeline(template: str, row: FleetRow, folders: tuple[Path, Path]) -> str:
    """Return the template's text with the row's values in it, and every path absolute.

    ``folders`` are those of template and table: paths of either are relative to them. Raises InputError for a key whose
    table the template lacks and that cannot be made.
    """
    document = tomlkit.parse(template)
    for table in document.get(RECORDINGS, []):
        _make_paths_absolute(table, folders[0])
    if plugins := document.get("model", {}).get("plugins"):
        document["model"]["plugins"] = [_path(str(p), folders[0]) for p in plugins]
    for key, value in row.values.items():
        last = key.rpartition(".")[2]
        _set(document, key, _path(value, folders[1]) if last == "file" and isinstance(value, str) else value)
    document["pipeline"]["name"] = re.sub(r'[/\\:*?"<>|]', "_", row.rig)[:60]
    return tomlkit.dumps(document)


def _make_paths_absolute(table: Any, folder: Path) -> None:
    for one in (table, *table.get("more", [])):
        if isinstance(one.get("file"), str):
            one["file"] = _path(one["file"], folder)


def _path(text: str, folder: Path) -> str:
    """Return a path from ``folder`` as an absolute one; what begins with a variable or is a URL stays as it is."""
    return text if is_remote(text) or text.startswith(("$", "~")) else os.path.normpath(folder / text)


def _set(document: Any, key: str, value: Any) -> None:
    words = key.split(".")
    table = document
    if words[0] == RECORDINGS:
        table = next(t for t in document[RECORDINGS] if t.get("name") == words[1])
        words = words[2:]
    for word in words[:-1]:
        table = table.setdefault(word, tomlkit.table())
    table[words[-1]] = value


def require_columns(template: Mapping[str, Any], columns: Iterable[str], keys_at: Any, where: str) -> None:
    """Raise InputError for columns that name no key of a pipeline file, or a recording that the template lacks.

    ``known(location)`` returns the keys that the table at ``location`` may have.
    """
    names = [str(t.get("name")) for t in template.get(RECORDINGS, [])]
    for column in columns:
        words = column.split(".")
        if words[0] == RECORDINGS and (len(words) < 3 or words[1] not in names):
            mend = did_you_mean(words[1] if len(words) > 1 else "", names)
            raise InputError(f"{where}, column {column}", "no such recording in the template", "by its name", mend)
        location = (words[0], *words[2:]) if words[0] == RECORDINGS else tuple(words)
        for wrong, keys in _unknown_keys(location, keys_at):
            raise InputError(f"{where}, column {column}", f'no key "{wrong}"', "", did_you_mean(wrong, keys))


def _unknown_keys(location: tuple[str, ...], known: Any) -> Iterator[tuple[str, list[str]]]:
    for depth, word in enumerate(location):
        keys = known(location[:depth])
        if keys and word not in keys:
            yield word, keys
            return


def raw_file_names(document: Mapping[str, Any]) -> list[str]:
    """Return the raw files that a pipeline's tables name, as they are named."""
    tables = [one for table in document.get(RECORDINGS, []) for one in (table, *table.get("more", []))]
    return [str(one["file"]) for one in tables if isinstance(one.get("file"), str)]
