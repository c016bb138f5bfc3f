"""Add recordings to a pipeline file; comments and layout stay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import AoT

from pneucli.config.effect_edit import edit_document
from pneucli.errors import InputError


def append_recordings(path: str | Path, tables: Sequence[Mapping[str, Any]]) -> None:
    """Append tables to ``[[recordings]]``; the file is replaced atomically, everything else in it stays as it was.

    Args:
        path: The pipeline file.
        tables: The new tables, values as TOML has them.

    Raises:
        InputError: ``recordings`` is not an array of tables.
    """
    with edit_document(path) as document:
        recordings = document.get("recordings")
        is_first = recordings is None
        if is_first:
            document.add(tomlkit.nl())
            recordings = document["recordings"] = tomlkit.aot()
        if not isinstance(recordings, AoT):
            raise InputError(
                f"{path}, key recordings", "not tables", "tables [[recordings]]", "write each as a table", code="E023"
            )
        for table in tables:
            added = tomlkit.table()
            for key, value in table.items():
                added.add(key, value)
            if not is_first:  # tomlkit separates the tables of a new array by itself
                added.add(tomlkit.nl())
            recordings.append(added)
