"""Common arguments of the commands."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pneucli.imports import hidden_modules

if TYPE_CHECKING:
    from pneucli.pipeline.runner import Pipeline

File = Annotated[Path, typer.Argument(metavar="PIPELINE", help="The pipeline file (TOML).", show_default=False)]
Out = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="DIR", help="Folder of the artifacts; default: artifacts/NAME next to the pipeline file."
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print the answer as one JSON object, and nothing else.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="The tables behind the verdict as well.")]
Executor = Annotated[
    str | None,
    typer.Option(
        "--executor",
        metavar="WHERE",
        help="Where long work is done: local (default), dask://host:port, or a TOML file of a cluster.",
        show_default=False,
    ),
]
Page = Annotated[Path | None, typer.Option("--html", metavar="FILE", help="Write a page with the curves as well.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress, no messages on standard error.")]


def open_pipeline_file(file: Path, out: Path | None) -> Pipeline:
    """Open the pipeline; validate the file only when it has changed (the units take half a second to import)."""
    from pneucli.notebook.run import open_pipeline_of

    return replace(open_pipeline_of(file, out), prepare=keep_pandas_out)


def keep_pandas_out() -> None:
    """Let Arrow find no pandas in this process.

    Arrow imports pandas, which is slow, at its first array, only to recognise objects of pandas, and no stage gives it
    any. The stages' own ``import pandas`` still works.
    """
    if "pandas" in sys.modules:
        return
    import pyarrow as pa

    with hidden_modules("pandas"):
        pa.array([0.0])


def law_names(names: list[str], where: str) -> list[str]:
    """Return the checked names of control laws; raises InputError before anything runs."""
    from pneucli.controller.laws import select_laws

    return [one.name for one in select_laws([name.strip() for name in names], where)]


def executor_option(executor: str | None) -> dict[str, Any]:
    """Return the option that names the executor; raises InputError at once where it does not answer."""
    if executor is None:
        return {}
    from pneucli.executors.dask_cluster import require_cluster

    require_cluster(executor)
    return {"executor": executor}
