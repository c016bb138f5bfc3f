"""``plot``: measured, model and residual of a recording, in a file or in the terminal."""

import io
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import typer

from pneucli.cli.command import Command, HowToRun
from pneucli.errors import InputError, require_known
from pneucli.figure import read
from pneucli.messages import StageAnswer, labelled, table
from pneucli.messages.compare import CHANNEL_TITLES, Answer, ChannelResult, evaluation_error
from pneucli.messages.formatting import format_noise_ratio

INSTALL = "pip install 'pneucli[terminal]'"
HELP = "Measured, model and residual of a recording: in the terminal, or in a file with --save."
ENDINGS = ("png", "svg", "pdf")
Source = Annotated[
    Path,
    typer.Argument(
        metavar="PIPELINE", help="The pipeline file, or a folder of artifacts, which is read as it is.",
    ),
]  # fmt: skip
Recording = Annotated[str | None, typer.Argument(metavar="RECORDING", help="Its name; default: the worst one.")]
Channels = Annotated[
    list[str] | None, typer.Option("--channel", metavar="C", help="p1, p2, x, v, ... (repeatable); default: all.")
]
Save = Annotated[
    Path | None, typer.Option("--save", metavar="FILE", help="Write the picture: .png, .svg or .pdf.")
]  # fmt: skip


@dataclass(frozen=True)
class Plot(StageAnswer):
    """What a picture of a recording shows, where it is, or why it is not shown."""

    recording: str
    use: str
    channels: Sequence[ChannelResult]
    file: str | None = None
    not_shown: str | None = None

    def lines(self, file: str, verbose: bool) -> Iterator[str]:
        """Yield the errors of the channels that are shown, and the file or how to get one."""
        parts = [f"{one.channel} {format_noise_ratio(one.ratio_to_noise)} × noise" for one in self.channels]
        yield from labelled("shown", f"{self.recording} ({self.use}): {', '.join(parts)}")
        if self.file:
            yield from labelled("saved", self.file)
        if self.not_shown:
            command = f"pneucli plot {file} {self.recording} --save {self.recording}.png"
            yield from labelled("picture", f"not shown: {self.not_shown}. To a file (.png, .svg, .pdf): {command}")
        if verbose:
            yield from table(CHANNEL_TITLES, [one.row for one in self.channels], texts=3)


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

    run = open_run(pipeline, how.out, quiet=how.quiet)
    shown = shown_channels(read(Answer, run.answer("compare")), recording, channel)
    figure = run.plot.residuals(shown.recording, channel)
    if save is not None:
        save.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(save, dpi=150)
        how.tell(replace(shown, file=str(save)), pipeline)
        return
    # under --json standard output has room for the answer alone
    why = "--json prints the answer alone" if how.json else show_picture(figure._repr_png_())
    how.tell(replace(shown, not_shown=why or None), pipeline)


def shown_channels(compared: Answer, recording: str | None, channels: Sequence[str] | None) -> Plot:
    """Return what a picture of one recording shows, by default of the one with the largest error that judges the model.

    Raises InputError where the recording, or one of the channels, was not compared.
    """
    name = worst_recording(compared) if recording is None else recording
    rows = [row for row in compared.channels if row.recording == name]
    found, recordings = '"{}" was not compared', {row.recording for row in compared.channels}
    require_known([str(name)], recordings, "plot, recording", found, code="E091")
    require_known(channels or (), {row.channel for row in rows}, "plot, channel", found, code="E091")
    shown = [row for row in rows if not channels or row.channel in channels]
    return Plot("pneucli/plot/1", compared.pipeline, str(name), rows[0].use, shown)


def worst_recording(compared: Answer) -> str | None:
    """Return the recording with the largest error over noise among those that judge the model."""
    from pneucli.stages.diff import error_changes

    use, _ = evaluation_error(compared.error)
    rows = [row for row in error_changes([], compared.channels) if row.use == use]
    worst = max(rows, key=lambda row: row.after or 0.0, default=None)
    return None if worst is None else worst.recording


COMMAND = Command(
    _plot, "pneucli plot axis-7/pipeline.toml stickslip_2 --channel x --save stickslip_2.svg", HELP, place=150
)
