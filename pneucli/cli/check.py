"""``check``: what a pipeline reads and lacks, without running it."""

from __future__ import annotations

import typer

from pneucli import messages
from pneucli.cli import console, examples
from pneucli.cli.options import File, Json, Out, Quiet, Verbose


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        "check",
        help="All that can be said without running: file, raw files, signals, units, what is missing. Exit 0 or 2.",
        epilog=examples.example_line("check"),
    )(_check)


def _check(pipeline: File, out: Out = None, json: Json = False, verbose: Verbose = False, quiet: Quiet = False) -> None:
    """``out`` and ``quiet`` exist for uniform options: nothing is written, and no progress is printed."""
    from pneucli.stages.check import check_pipeline

    answer = check_pipeline(pipeline)
    if json:
        console.print_json(answer)
    else:
        console.print_text(messages.render("check", answer, str(pipeline), verbose=verbose))
    if answer["faults"] or answer["missing"]:
        raise typer.Exit(2)
