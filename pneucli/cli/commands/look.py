"""``look``: signals of raw files as they would be taken, before there is a pipeline file."""

from dataclasses import replace
from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from pneucli.cli.command import Command, How, Page

Files = Annotated[list[Path], typer.Argument(metavar="FILE...", help="Raw files, folders or globs.")]


def _look(raw: Files, html: Page = None, how: How = How()) -> None:
    from pneucli.stages.look import look_at

    answer = look_at(raw)
    if html is not None:
        from pneucli.io.artifacts import write_text
        from pneucli.report.recording_pages import look_page

        write_text(html, look_page(answer))
        answer = replace(answer, page=str(html))
    how.tell(answer, " ".join(quote(str(path)) for path in raw))


COMMAND = Command(
    _look,
    "pneucli look recordings/*.csv --html look.html",
    "Raw files as they would be taken: roles, units, references, clocks, rests and doubts, with curves.",
    place=15,
)
