"""``status``: what is up to date, what is stale and why."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from pneucli.cli import console, examples
from pneucli.cli.options import File, Json, Out, Quiet, built, opened
from pneucli.pipeline.graph import STAGES

if TYPE_CHECKING:
    from pneucli.pipeline.runner import Verdict


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        "status", help="What is up to date, what is stale and why; nothing is run.", epilog=examples.of("status")
    )(_status)


def _status(pipeline: File, out: Out = None, json: Json = False, quiet: Quiet = False) -> None:
    """``quiet`` is there for the sake of uniform options: nothing is said on standard error anyway."""
    opened_pipeline = opened(pipeline, out)
    opened_pipeline.validate()
    verdicts = opened_pipeline.survey(built(*STAGES))
    if json:
        stages = [{"stage": name, "state": _state(v), "why": list(v.why)} for name, v in verdicts.items()]
        console.answer({"schema": "pneucli/status/1", "pipeline": opened_pipeline.name, "stages": stages})
        return
    for name, verdict in verdicts.items():
        console.tell(f"{name:10}{_state(verdict)}{(verdict.why and ': ' + ', '.join(verdict.why)) or ''}")


def _state(verdict: Verdict) -> str:
    if verdict.why:
        return "stale"
    skipped = verdict.manifest is not None and verdict.manifest.skipped is not None
    return "does not apply" if skipped else "up to date"
