"""``fleet``: process many rigs and dates from one template, and report the changes."""

from pathlib import Path
from typing import Annotated

import typer

from pneucli.cli import console
from pneucli.cli.command import Command, Executor, How

FleetFile = Annotated[Path, typer.Argument(metavar="FLEET", help="The fleet file (TOML).")]
Out = Annotated[
    str | None,
    typer.Option(
        "--out",
        metavar="DIR",
        help="Folder of the results, or its URL (s3://bucket/folder); default: artifacts/NAME next to the fleet file.",
    ),
]


def _fleet(fleet: FleetFile, executor: Executor = None, out: Out = None, how: How = How()) -> None:
    from pneucli.config import load_fleet
    from pneucli.fleet import run as stage
    from pneucli.fleet.output import evaluate_checks
    from pneucli.io.result_store import is_remote

    config = load_fleet(fleet)
    here = Path(out or config.path.parent / "artifacts" / config.fleet.name).absolute()
    with console.progress(how.quiet) as progress:
        place = out if out and is_remote(out) else here
        answer = stage.run(config, place, executor, progress, how.say)
    how.show("fleet", answer, fleet)
    failed = [one for one in evaluate_checks(config, answer) if not one.passed]
    for one in failed if not how.json else ():
        console.print_text(f"check    {one}")
    raise typer.Exit(1 if failed else 0)


COMMAND = Command(
    _fleet,
    "pneucli fleet plant-3/fleet.toml --executor dask://scheduler:8786",
    "Many rigs and dates from one template: a pipeline a row, and what changed in which rig.",
    place=220,
)
