"""``simulate``: scenarios of the model, with and without its controller."""

from __future__ import annotations

from typing import Annotated

import typer

from pneucli.cli.command import Command, run_stage
from pneucli.cli.options import (
    EXECUTORS,
    File,
    Json,
    Out,
    Quiet,
    Verbose,
    executor_option,
)


def _simulate(
    pipeline: File,
    executor: Annotated[
        str | None,
        typer.Option("--executor", metavar="WHERE", help=f"Where the Monte Carlo study runs: {EXECUTORS}."),
    ] = None,
    out: Out = None,
    json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    run_stage("simulate", pipeline, out, json, quiet, verbose, executor_option(executor) or None)


COMMAND = Command(_simulate, "pneucli simulate axis-7/pipeline.toml -v", place=70, stage="simulate")
