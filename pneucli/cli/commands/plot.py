"""``plot``: measured, model and residual of a recording, in a file or in the terminal."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pneucli.cli.command import Command, HowToRun
from pneucli.errors import InputError

if TYPE_CHECKING:
    from pneucli.notebook.panels import NotebookFigure

INSTALL = "pip install 'pneucli[terminal]'"
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


def show_picture(png: bytes) -> str:
    """Show a PNG on standard output; return the reason where that is not possible, else nothing."""
    if not (sys.stdout.isatty() and sys.stdin.isatty()) or os.environ.get("TERM") == "dumb":
        return "standard output is no terminal"
    try:
        from rich.console import Console
        from textual_image.renderable import Image, SixelImage, TGPImage
    except ImportError:
        return f"pictures in a terminal need the extra terminal: {INSTALL}"
    if Image not in (SixelImage, TGPImage):
        return "this terminal shows no pictures (neither sixel nor kitty graphics)"
    Console().print(Image(io.BytesIO(png), width="auto"))
    return ""


def _plot(
    pipeline: Source,
    recording: Recording = None,
    channel: Channels = None,
    save: Save = None,
    how: HowToRun = HowToRun(),
) -> None:
    if save is not None and save.suffix.lstrip(".").lower() not in ENDINGS:
        wanted = f"a file that ends in {', '.join(ENDINGS)}"
        raise InputError(
            f"--save {save}", f'the ending "{save.suffix}"', wanted, f"--save {save.stem}.png", code="E001"
        )
    from pneucli.notebook.run import open_run
    from pneucli.stages.plot import plot_answer

    run = open_run(pipeline, how.out, quiet=how.quiet)
    answer = plot_answer(run.answer("compare"), recording, channel)
    figure = run.plot.residuals(answer["recording"], channel)
    answer |= _save(figure, save) if save is not None else _show(figure, how.json)
    how.show("plot", answer, pipeline)


def _save(figure: NotebookFigure, file: Path) -> dict[str, Any]:
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=150)
    return {"file": str(file), "not_shown": None}


def _show(figure: NotebookFigure, json: bool) -> dict[str, Any]:
    """Show the figure; under ``--json`` standard output has room for the answer alone."""
    why = "--json prints the answer alone" if json else show_picture(figure._repr_png_())
    return {"file": None, "not_shown": why or None}


COMMAND = Command(
    _plot, "pneucli plot axis-7/pipeline.toml stickslip_2 --channel x --save stickslip_2.svg", HELP, place=150
)
