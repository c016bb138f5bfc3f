"""``status``: list the stages that are up to date, those that are stale, and why."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneucli.cli import console
from pneucli.cli.command import Command, File, HowToRun
from pneucli.pipeline.graph import STAGES

if TYPE_CHECKING:
    from pneucli.pipeline.runner import StageStatus


def _status(pipeline: File, how: HowToRun = HowToRun()) -> None:
    """``quiet`` exists for uniform options; this command prints nothing on standard error."""
    opened_pipeline = how.open(pipeline)
    opened_pipeline.validate()
    verdicts = opened_pipeline.stage_status(list(STAGES))
    if how.json:
        stages = [{"stage": name, "state": _state(v), "why": list(v.reasons)} for name, v in verdicts.items()]
        console.print_json({"schema": "pneucli/status/1", "pipeline": opened_pipeline.name, "stages": stages})
        return
    folder = opened_pipeline.artifacts
    for name, verdict in verdicts.items():
        console.print_text(f"{name:10}{_state(verdict)}{(verdict.reasons and ': ' + ', '.join(verdict.reasons)) or ''}")
        if how.verbose and verdict.manifest is not None:
            manifest = verdict.manifest
            console.print_text(
                f"          ran in {manifest.seconds:.1f} s, {len(manifest.outputs)} files: {folder}/{name}"
            )


def _state(verdict: StageStatus) -> str:
    if verdict.reasons:
        return "stale"
    skipped = verdict.manifest is not None and verdict.manifest.skipped is not None
    return "does not apply" if skipped else "up to date"


COMMAND = Command(
    _status,
    "pneucli status axis-7/pipeline.toml",
    "What is up to date, what is stale and why; nothing is run.",
    place=190,
)
