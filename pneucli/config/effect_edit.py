"""Changes to a pipeline file that keep its comments and layout."""

import codecs
import os
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit import TOMLDocument
from tomlkit.items import AoT, Table

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


def set_effects(path: str | Path, effects: Sequence[str]) -> None:
    """Set ``[model] effects``; the file is replaced atomically, everything else in it stays as it was.

    Raises :class:`InputError` where ``[model]`` is not a table.
    """
    with edit_document(path) as document:
        model = document.get("model")
        if model is None:
            model = document["model"] = tomlkit.table()
        if not isinstance(model, Table):
            raise InputError(
                f"{path}, key model",
                "not a table",
                "a table [model]",
                "write [model] on a line of its own",
                code="E023",
            )
        model["effects"] = list(effects)


def set_fixed(path: str | Path, name: str, value: str | float | None) -> None:
    """Fix a parameter at a value in ``[model.parameters]``, or free it where ``value`` is None.

    The file is replaced atomically, everything else in it stays as it was.
    """
    with edit_document(path) as document:
        model = document.setdefault("model", tomlkit.table())
        if value is None:
            parameters = model.get("parameters", {})
            parameters.pop(name, None)
            if "parameters" in model and not parameters:
                del model["parameters"]
            return
        entry = tomlkit.inline_table()
        entry["fixed"] = value
        model.setdefault("parameters", tomlkit.table())[name] = entry


@contextmanager
def edit_document(path: str | Path) -> Iterator[TOMLDocument]:
    """Yield a TOML file as a document to edit; it is replaced atomically when the block ends without an error."""
    path = Path(path)
    content = path.read_bytes()
    document = tomlkit.parse(content.decode("utf-8-sig"))
    yield document
    text = tomlkit.dumps(document)
    if b"\r\n" in content:  # what is new has the line ends of the rest
        text = re.sub("\r?\n", "\r\n", text)
    mark = codecs.BOM_UTF8 if content.startswith(codecs.BOM_UTF8) else b""
    replace_file(path, mark + text.encode())


def replace_file(path: Path, content: bytes) -> None:
    """Replace a file at once, with its permissions; behind a link, the file that it leads to."""
    target = path.resolve()
    with tempfile.NamedTemporaryFile(dir=target.parent, prefix=f".{target.name}.", delete=False) as file:
        file.write(content)
    os.chmod(file.name, target.stat().st_mode & 0o7777)
    os.replace(file.name, target)
