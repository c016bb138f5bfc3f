"""``diff``: two runs side by side."""

from pathlib import Path
from typing import Annotated

import typer

from pneucli.cli.command import Command, How, open_pipeline_file

HELP = "Two runs side by side: effects, errors, parameters beyond their intervals, verdicts."
_SIDE = "A pipeline file, which is compared first, or a folder of artifacts, which is read as it is."
A = Annotated[Path, typer.Argument(metavar="A", help=_SIDE)]
B = Annotated[Path, typer.Argument(metavar="B", help="Another one.")]


def _diff(a: A, b: B, how: How = How()) -> None:
    from pneucli.stages.diff import difference, read_answers

    one, other = (read_answers(str(path), _artifacts(path, how)) for path in (a, b))
    how.tell(difference(one, other), b)


def _artifacts(path: Path, how: How) -> Path:
    """Return the folder of a run; bring the comparison up to date where ``path`` is a pipeline file."""
    if path.is_dir():
        return path
    pipeline = open_pipeline_file(path, None)
    how.update(pipeline, "compare")
    return pipeline.artifacts


COMMAND = Command(_diff, "pneucli diff axis-7/pipeline.toml axis-8/pipeline.toml", HELP, place=140)
