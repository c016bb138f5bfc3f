"""``init``: a new pipeline."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Annotated

import typer

from pneucli.cli import console, examples
from pneucli.cli.options import Json


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        "init",
        help="A new pipeline from an example, or from raw files, columns guessed and shown.",
        epilog=examples.of("init"),
    )(_init)


def _init(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="The folder to make.", show_default=False)],
    raw: Annotated[
        list[Path] | None, typer.Option("--from", metavar="RAW", help="A raw file; more may follow.")
    ] = None,
    more: Annotated[
        list[Path] | None, typer.Argument(metavar="RAW", help="More raw files.", show_default=False)
    ] = None,
    json: Json = False,
) -> None:
    init = importlib.import_module("pneucli.stages.init")
    answer = init.create(directory, [*(raw or []), *(more or [])])
    if json:
        console.answer(answer)
    else:
        print(init.describe(answer))
