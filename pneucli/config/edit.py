"""Changes to a pipeline file that keep its comments and layout."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

import tomlkit
from tomlkit.items import Table

from pneucli.errors import InputError


def set_effects(path: str | Path, effects: Sequence[str]) -> None:
    """Set ``[model] effects``; the file is replaced atomically, everything else in it stays as it was.

    Raises :class:`InputError` where ``[model]`` is not a table.
    """
    path = Path(path)
    document = tomlkit.parse(path.read_text(encoding="utf-8"))
    model = document.get("model")
    if model is None:
        model = document["model"] = tomlkit.table()
    if not isinstance(model, Table):
        raise InputError(f"{path}, key model", "not a table", "a table [model]", "write [model] on a line of its own")
    model["effects"] = list(effects)
    _replace(path, tomlkit.dumps(document))


def _replace(path: Path, text: str) -> None:
    target = path.resolve()
    with tempfile.NamedTemporaryFile(
        "w", dir=target.parent, prefix=f".{target.name}.", delete=False, encoding="utf-8"
    ) as file:
        file.write(text)
    os.chmod(file.name, target.stat().st_mode & 0o7777)
    os.replace(file.name, target)
