"""``plot``: measured, model and residual of a recording, in a file or in the terminal."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pneucli import messages
from pneucli.cli import console, examples
from pneucli.cli.options import Json, Out, Quiet, Verbose
from pneucli.errors import InputError

if TYPE_CHECKING:
    from pneucli.notebook.panels import NotebookFigure

HELP = "Measured, model and residual of a recording: in the terminal, or in a file with --save."
ENDINGS = ("png", "svg", "pdf")

Source = Annotated[
    Path,
    typer.Argument(
        metavar="PIPELINE", help="The pipeline file, or a folder of artifacts, which is read as it is.",
        show_default=False,
    ),
]  # fmt: skip
Recording = Annotated[
    str | None, typer.Argument(metavar="RECORDING", help="Its name; default: the worst one.", show_default=False)
]
Channels = Annotated[
    list[str] | None,
    typer.Option("--channel", metavar="C", help="p1, p2, x, v, ... (repeatable); default: all.", show_default=False),
]
Save = Annotated[
    Path | None, typer.Option("--save", metavar="FILE", help="Write the picture: .png, .svg or .pdf.")
]  # fmt: skip


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("plot", help=HELP, epilog=examples.example_line("plot"))(_plot)


def _plot(
    pipeline: Source,
    recording: Recording = None,
    channel: Channels = None,
    save: Save = None,
    out: Out = None,
    json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    if save is not None and save.suffix.lstrip(".").lower() not in ENDINGS:
        wanted = f"a file that ends in {', '.join(ENDINGS)}"
        raise InputError(
            f"--save {save}", f'the ending "{save.suffix}"', wanted, f"--save {save.stem}.png", code="E001"
        )
    from pneucli.notebook.run import open_run
    from pneucli.stages.plot import plot_answer

    run = open_run(pipeline, out, quiet=quiet)
    answer = plot_answer(run.answer("compare"), recording, channel)
    figure = run.plot.residuals(answer["recording"], channel)
    answer |= _save(figure, save) if save is not None else _show(figure, json)
    if json:
        console.print_json(answer)
    else:
        console.print_text(messages.render("plot", answer, str(pipeline), verbose=verbose))


def _save(figure: NotebookFigure, file: Path) -> dict[str, Any]:
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=150)
    return {"file": str(file), "not_shown": None}


def _show(figure: NotebookFigure, json: bool) -> dict[str, Any]:
    """Show the figure; under ``--json`` standard output has room for the answer alone."""
    from pneucli.cli.terminal_picture import show_picture

    why = "--json prints the answer alone" if json else show_picture(figure._repr_png_())
    return {"file": None, "not_shown": why or None}
