"""``simulate``: scenarios of the model, with and without its controller."""

from __future__ import annotations

from typing import Annotated

import typer

from pneucli.cli.command import Command, HowToRun, run_stage
from pneucli.cli.options import EXECUTORS, File, executor_option


def _simulate(
    pipeline: File,
    executor: Annotated[
        str | None,
        typer.Option("--executor", metavar="WHERE", help=f"Where the Monte Carlo study runs: {EXECUTORS}."),
    ] = None,
    how: HowToRun = HowToRun(),
) -> None:
    run_stage("simulate", pipeline, how, executor_option(executor) or None)


COMMAND = Command(_simulate, "pneucli simulate axis-7/pipeline.toml -v", place=70, stage="simulate")
