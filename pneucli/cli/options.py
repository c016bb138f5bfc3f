"""What the commands share: their common arguments, and what these become."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pneucli.pipeline.graph import STAGES

if TYPE_CHECKING:
    from pneucli.pipeline.runner import Pipeline

File = Annotated[Path, typer.Argument(metavar="PIPELINE", help="The pipeline file (TOML).", show_default=False)]
Out = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="DIR", help="Folder of the artifacts; default: artifacts/NAME beside the pipeline file."
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print the answer as one JSON object, and nothing else.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="The tables behind the verdict as well.")]
EXECUTORS = "local (default), dask://host:port, or a TOML file of a cluster"
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress, no messages on standard error.")]


def open_pipeline_file(file: Path, out: Path | None) -> Pipeline:
    """Open the pipeline; the file itself is validated only when it has changed (units cost half a second to import)."""
    from pneucli.notebook.run import open_pipeline_of

    return open_pipeline_of(file, out)


def shortest_path(path: Path) -> str:
    """Return a path as short as it can be said from here."""
    return str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)


def built_stages(*names: str) -> list[str]:
    """Those of the stages that this installation has."""
    return [name for name in names if STAGES[name].built]
