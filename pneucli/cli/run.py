"""``run``: all that is out of date, the report, then the checks."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from pneucli import messages
from pneucli.cli import console, examples
from pneucli.cli.options import File, Json, Out, Quiet, Verbose, built, opened, shortest
from pneucli.cli.stage import doubt, refused
from pneucli.messages.run import lines as summary
from pneucli.stages.history import listed

if TYPE_CHECKING:
    from pneucli.pipeline.checks import CheckResult
    from pneucli.pipeline.runner import Done, Pipeline

STAGES = ("compare", "design", "simulate", "diagnose", "report")


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(
        "run", help="All that is out of date, then the report; exit 1 where a check fails.", epilog=examples.of("run")
    )(_run)


def _run(pipeline: File, out: Out = None, json: Json = False, verbose: Verbose = False, quiet: Quiet = False) -> None:
    from pneucli.pipeline.checks import evaluate

    opened_pipeline = opened(pipeline, out)
    say = console.hush if quiet else console.say
    with console.progress(quiet) as progress:
        done = opened_pipeline.bring_up(built(*STAGES), None, progress, say)
    if not any(stage.why for stage in done.values()):
        say("everything is up to date")
    answers = {name: stage.manifest.answer for name, stage in done.items() if stage.manifest.answer is not None}
    results = evaluate(opened_pipeline.tables.get("checks", {}), answers, str(pipeline))
    if json:
        console.answer(_answer(opened_pipeline, done, results))
    else:
        _print(opened_pipeline, done, results, pipeline, verbose)
    raise typer.Exit(0 if all(result.passed for result in results) and not refused(done) else 1)


def _answer(pipeline: Pipeline, done: Mapping[str, Done], results: Sequence[CheckResult]) -> dict[str, Any]:
    return {
        "schema": "pneucli/run/1",
        "pipeline": pipeline.name,
        "stages": [
            {
                "stage": name,
                "ran": bool(stage.why),
                "why": list(stage.why),
                "skipped": (stage.manifest.skipped or {}).get("found"),
                "seconds": stage.manifest.seconds,
            }
            for name, stage in done.items()
        ],
        "checks": [{"path": r.path, "limit": dict(r.limit), "value": r.value, "passed": r.passed} for r in results],
        "passed": all(result.passed for result in results),
        "report": str(_report(pipeline)) if "report" in done else None,
    }


def _print(
    pipeline: Pipeline, done: Mapping[str, Done], results: Sequence[CheckResult], file: Path, verbose: bool
) -> None:
    answers = {name: stage.manifest.answer for name, stage in done.items() if stage.manifest.answer is not None}
    models = listed(pipeline.artifacts / "compare")
    failed = [str(result) for result in results if not result.passed]
    if verbose:
        for name, stage in done.items():
            console.tell(f"{name:10}{_state(stage)}")
            if name in answers:
                console.tell(textwrap.indent(messages.of(name, answers[name], str(file), verbose=True), "  "))
    doubt(done)
    console.tell("\n".join(summary(answers, models, failed, shortest(_report(pipeline)), str(file))))


def _state(stage: Done) -> str:
    if stage.manifest.skipped is not None:
        return f"does not apply: {stage.manifest.skipped['found']}"
    return f"ran in {stage.manifest.seconds:.1f} s" if stage.why else "up to date"


def _report(pipeline: Pipeline) -> Path:
    return pipeline.artifacts / "report" / "report.html"
