"""``open``: the report, up to date, in the browser."""

from __future__ import annotations

import webbrowser

import typer

from pneucli.cli import console, examples
from pneucli.cli.options import File, Json, Out, Quiet, opened, shortest

HELP = "Bring the report up to date and open it in the browser."


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("open", help=HELP, epilog=examples.of("open"))(_open)


def _open(pipeline: File, out: Out = None, json: Json = False, quiet: Quiet = False) -> None:
    opened_pipeline = opened(pipeline, out)
    with console.progress(quiet) as progress:
        opened_pipeline.bring_up(["report"], None, progress, console.hush if quiet else console.say)
    report = opened_pipeline.artifacts / "report" / "report.html"
    shown = webbrowser.open(report.as_uri())
    if json:
        console.answer({"schema": "pneucli/open/1", "report": str(report), "opened": shown})
    else:
        console.tell(shortest(report) if shown else f"no browser was found; the report is {shortest(report)}")
