"""``run``: bring all stages up to date, write the report, then evaluate the checks."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from pneucli import messages
from pneucli.cli import console
from pneucli.cli.command import Command, File, HowToRun, fails_acceptance, print_findings
from pneucli.messages.run import lines as summary
from pneucli.paths import from_here
from pneucli.stages.history import compared_models

if TYPE_CHECKING:
    from pneucli.pipeline.checks import CheckResult
    from pneucli.pipeline.runner import Done, Pipeline

STAGES = ("compare", "design", "simulate", "diagnose", "report")


def _run(pipeline: File, how: HowToRun = HowToRun()) -> None:
    from pneucli.pipeline.checks import evaluate

    opened_pipeline = how.open(pipeline)
    done = how.update(opened_pipeline, *STAGES)
    if not any(stage.reasons for stage in done.values()):
        how.say("everything is up to date")
    answers = {name: stage.manifest.answer for name, stage in done.items() if stage.manifest.answer is not None}
    results = evaluate(opened_pipeline.tables.get("checks", {}), answers, str(pipeline))
    if how.json:
        console.print_json(_answer(opened_pipeline, done, results))
    else:
        _print(opened_pipeline, done, results, pipeline, how.verbose)
    raise typer.Exit(0 if all(result.passed for result in results) and not fails_acceptance(done) else 1)


def _answer(pipeline: Pipeline, done: Mapping[str, Done], results: Sequence[CheckResult]) -> dict[str, Any]:
    return {
        "schema": "pneucli/run/1",
        "pipeline": pipeline.name,
        "stages": [
            {
                "stage": name,
                "ran": bool(stage.reasons),
                "why": list(stage.reasons),
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
    models = compared_models(pipeline.artifacts / "compare")
    failed = [str(result) for result in results if not result.passed]
    if verbose:
        for name, stage in done.items():
            console.print_text(f"{name:10}{_state(stage)}")
            if name in answers:
                console.print_text(textwrap.indent(messages.render(name, answers[name], str(file), verbose=True), "  "))
    print_findings(done, answers.get("compare", {}).get("contradicted", ()))
    console.print_text("\n".join(summary(answers, models, failed, from_here(str(_report(pipeline))), str(file))))


def _state(stage: Done) -> str:
    if stage.manifest.skipped is not None:
        return f"does not apply: {stage.manifest.skipped['found']}"
    return f"ran in {stage.manifest.seconds:.1f} s" if stage.reasons else "up to date"


def _report(pipeline: Pipeline) -> Path:
    return pipeline.artifacts / "report" / "report.html"


COMMAND = Command(
    _run,
    "pneucli run axis-7/pipeline.toml",
    "All that is out of date, then the report; exit 1 where a check fails.",
    place=160,
)
