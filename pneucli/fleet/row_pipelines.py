"""Make the pipeline file of a row from the template and the row's values."""

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
SAFE_CHARACTERS = " +,=@()"  # unchanged in a folder's name, in addition to letters, digits and _.-~


def folder_name(text: str) -> str:
    """Return a folder name for a text; different texts give different folder names."""
    return quote(text, safe=SAFE_CHARACTERS)


def row_pipeline(template: str, row: FleetRow, folders: tuple[Path, Path]) -> str:
    """Return the template's text with the row's values in it, and every path absolute.

    Args:
        template: The text of the template pipeline.
        row: The row of the table.
        folders: The folders of template and table, to which their paths are relative.

    Raises:
        InputError: The template has no table for a key, and none can be made.

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
    parts = key.split(".")
    table = document
    if parts[0] == RECORDINGS:
        table = next(t for t in document[RECORDINGS] if t.get("name") == parts[1])
        parts = parts[2:]
    for part in parts[:-1]:
        table = table.setdefault(part, tomlkit.table())
    table[parts[-1]] = value


def require_columns(template: Mapping[str, Any], columns: Iterable[str], keys_at: Any, where: str) -> None:
    """Raise InputError for columns that name no key of a pipeline file, or no recording of the template.

    ``keys_at(location)`` returns the keys that the table at ``location`` may have.
    """
    names = [str(t.get("name")) for t in template.get(RECORDINGS, [])]
    for column in columns:
        parts = column.split(".")
        if parts[0] == RECORDINGS and (len(parts) < 3 or parts[1] not in names):
            mend = did_you_mean(parts[1] if len(parts) > 1 else "", names)
            raise InputError(
                f"{where}, column {column}", "no such recording in the template", "by its name", mend, code="E081"
            )
        location = (parts[0], *parts[2:]) if parts[0] == RECORDINGS else tuple(parts)
        for wrong, keys in _unknown_keys(location, keys_at):
            raise InputError(
                f"{where}, column {column}", f'no key "{wrong}"', "", did_you_mean(wrong, keys), code="E081"
            )


def _unknown_keys(location: tuple[str, ...], keys_at: Any) -> Iterator[tuple[str, list[str]]]:
    for depth, name in enumerate(location):
        keys = keys_at(location[:depth])
        if keys and name not in keys:
            yield name, keys
            return


def raw_file_names(document: Mapping[str, Any]) -> list[str]:
    """Return the raw files that a pipeline's tables name, as they are named."""
    tables = [one for table in document.get(RECORDINGS, []) for one in (table, *table.get("more", []))]
    return [str(one["file"]) for one in tables if isinstance(one.get("file"), str)]
