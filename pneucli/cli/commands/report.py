"""``report``: the page of all answers, and that of the thesis."""

from typing import Annotated

import typer

from pneucli.cli.command import Command, File, HowToRun, run_stage


def _report(
    pipeline: File,
    thesis: Annotated[
        bool | None,
        typer.Option(
            "--thesis/--no-thesis",
            help="Also thesis.html: the figures of the source thesis with the data of this rig; default: as last time.",
        ),
    ] = None,
    how: HowToRun = HowToRun(),
) -> None:
    options = None if thesis is None else {"thesis": True} if thesis else {}
    run_stage("report", pipeline, how, options)


COMMAND = Command(_report, "pneucli report axis-7/pipeline.toml", place=80, stage="report")
