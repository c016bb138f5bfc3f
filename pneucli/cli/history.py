"""``history``: the errors of every model that was compared, oldest first."""

from __future__ import annotations

import typer

from pneucli.cli import console, examples
from pneucli.cli.options import File, Json, Out, Quiet, opened

HELP = "How the error fell: every model that was compared, oldest first; nothing is run."


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("history", help=HELP, epilog=examples.of("history"))(_history)


def _history(pipeline: File, out: Out = None, json: Json = False, quiet: Quiet = False) -> None:
    from pneucli.messages import history
    from pneucli.stages.history import listed

    opened_pipeline = opened(pipeline, out)
    opened_pipeline.validate()
    known = listed(opened_pipeline.artifacts / "compare")
    if json:
        console.answer({"schema": "pneucli/history/1", "pipeline": opened_pipeline.name, "models": known})
        return
    console.tell("\n".join(history.lines(known, str(pipeline))))
    if known and opened_pipeline.survey(["compare"])["compare"].why and not quiet:
        console.say(f"the file or its data have changed since; to compare anew: pneucli compare {pipeline}")
