"""``design``: the control laws, one of them for the axis."""

from typing import Annotated

import typer

from pneucli.cli.command import Command, File, HowToRun, law_names, run_stage


def _design(
    pipeline: File,
    compare: Annotated[
        str | None, typer.Option("--compare", metavar="NAME,NAME...", help="Laws to run side by side; default: all.")
    ] = None,
    how: HowToRun = HowToRun(),
) -> None:
    options = None if compare is None else {"compare": law_names(compare.split(","), "--compare")}
    run_stage("design", pipeline, how, options)


COMMAND = Command(_design, "pneucli design axis-7/pipeline.toml --compare pid,relay,best", place=60, stage="design")
