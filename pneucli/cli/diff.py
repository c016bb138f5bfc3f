"""``diff``: two runs side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pneucli import messages
from pneucli.cli import console, examples
from pneucli.cli.options import Json, Quiet, Verbose, open_pipeline_file

HELP = "Two runs side by side: effects, errors, parameters beyond their intervals, verdicts."
_SIDE = "A pipeline file, which is compared first, or a folder of artifacts, which is read as it is."
A = Annotated[Path, typer.Argument(metavar="A", help=_SIDE, show_default=False)]
B = Annotated[Path, typer.Argument(metavar="B", help="Another one.", show_default=False)]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("diff", help=HELP, epilog=examples.example_line("diff"))(_diff)


def _diff(a: A, b: B, json: Json = False, verbose: Verbose = False, quiet: Quiet = False) -> None:
    from pneucli.stages.diff import difference, read_answers

    one, other = (read_answers(str(path), _artifacts(path, quiet)) for path in (a, b))
    answer = difference(one, other)
    if json:
        console.print_json(answer)
    else:
        console.print_text(messages.render("diff", answer, str(b), verbose=verbose))


def _artifacts(path: Path, quiet: bool) -> Path:
    """Return the folder of a run; bring the comparison up to date where ``path`` is a pipeline file."""
    if path.is_dir():
        return path
    pipeline = open_pipeline_file(path, None)
    with console.progress(quiet) as progress:
        pipeline.update(["compare"], None, progress, console.ignore_message if quiet else console.print_message)
    return pipeline.artifacts
