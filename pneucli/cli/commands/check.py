"""``check``: what a pipeline reads and lacks, without running it."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from pneucli.cli import console
from pneucli.cli.command import Command, File, HowToRun

More = Annotated[list[Path] | None, typer.Argument(metavar="PIPELINE", help="More pipeline files.")]


def _check(
    pipeline: File, more: More = None, how: HowToRun = HowToRun()
) -> None:  # fmt: skip
    """``out`` and ``quiet`` exist for uniform options: nothing is written, and no progress is printed."""
    from pneucli.stages.check import check_pipeline

    files = [pipeline, *(more or [])]
    answers = [check_pipeline(file) for file in files]
    if how.json and more:
        console.print_json({"schema": "pneucli/checks/1", "pipelines": list(map(asdict, answers))})
    else:
        for file, answer in zip(files, answers, strict=True):
            how.tell(answer, file)
    if any(answer.faults or answer.missing for answer in answers):
        raise typer.Exit(2)


COMMAND = Command(
    _check,
    "pneucli check axis-7/pipeline.toml",
    "All that can be said without running: file, raw files, signals, units, what is missing. Exit 0 or 2.",
    place=180,
)
