"""Changes to a pipeline file that keep its comments and layout."""

from __future__ import annotations

import codecs
import os
import re
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import tomlkit
from tomlkit import TOMLDocument
from tomlkit.items import Table

from pneucli.errors import InputError


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
    _replace(path, mark + text.encode())


def _replace(path: Path, content: bytes) -> None:
    target = path.resolve()
    with tempfile.NamedTemporaryFile(dir=target.parent, prefix=f".{target.name}.", delete=False) as file:
        file.write(content)
    os.chmod(file.name, target.stat().st_mode & 0o7777)
    os.replace(file.name, target)
