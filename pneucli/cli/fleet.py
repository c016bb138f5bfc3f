"""``fleet``: process many rigs and dates from one template, and report the changes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from pneucli import messages
from pneucli.cli import console, examples
from pneucli.cli.options import EXECUTORS, Json, Quiet, Verbose

FleetFile = Annotated[Path, typer.Argument(metavar="FLEET", help="The fleet file (TOML).", show_default=False)]
Executor = Annotated[
    str | None, typer.Option("--executor", metavar="WHERE", help=f"Where the rows are done: {EXECUTORS}.")
]

Out = Annotated[
    str | None,
    typer.Option(
        "--out",
        metavar="DIR",
        help="Folder of the results, or its URL (s3://bucket/folder); default: artifacts/NAME next to the fleet file.",
    ),
]


def register(app: typer.Typer) -> None:
    """Add the command."""
    text = "Many rigs and dates from one template: a pipeline a row, and what changed in which rig."
    app.command("fleet", help=text, epilog=examples.example_line("fleet"))(_fleet)


def _fleet(
    fleet: FleetFile,
    executor: Executor = None,
    out: Out = None,
    json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    from pneucli.config import load_fleet
    from pneucli.fleet import run as stage
    from pneucli.fleet.output import evaluate_checks
    from pneucli.io.remote_files import is_remote

    config = load_fleet(fleet)
    here = Path(out or config.path.parent / "artifacts" / config.fleet.name).absolute()
    place, say = out if out and is_remote(out) else here, console.ignore_message if quiet else console.print_message
    with console.progress(quiet) as progress:
        answer = stage.run(config, place, executor, progress, say)
    results = evaluate_checks(config, answer)
    _print(answer, json, verbose, str(fleet), [str(one) for one in results if not one.passed])
    raise typer.Exit(0 if all(one.passed for one in results) else 1)


def _print(answer: dict[str, Any], json: bool, verbose: bool, file: str, failed: list[str]) -> None:
    if json:
        console.print_json(answer)
        return
    console.print_text(messages.render("fleet", answer, file, verbose=verbose))
    for one in failed:
        console.print_text(f"check    {one}")
