"""``diagnose``: the missing physical effect, or what changed since an older recording."""

from pathlib import Path
from typing import Annotated, Any

import typer

from pneucli.cli.command import Command, Executor, File, HowToRun, executor_option, open_pipeline_file, run_stage


def _diagnose(
    pipeline: File,
    exclude: Annotated[
        list[str] | None,
        typer.Option("--exclude", metavar="EFFECT", help="An effect that is certainly absent (repeatable)."),
    ] = None,
    since: Annotated[
        Path | None,
        typer.Option("--since", metavar="OLD", help="Which effect or parameter changed since this older pipeline."),
    ] = None,
    repeat: Annotated[
        list[Path] | None,
        typer.Option("--repeat", metavar="OLD", help="A healthy repeat of OLD, held against it (repeatable)."),
    ] = None,
    alarm_rate: Annotated[
        float | None,
        typer.Option("--alarm-rate", min=0.0, max=0.5, help="False alarms for each comparison (0.001), with --since."),
    ] = None,
    executor: Executor = None,
    force: Annotated[bool, typer.Option("--force", help="Use recordings that cannot be true, too.")] = False,
    how: HowToRun = HowToRun(),
) -> None:
    run_stage(
        "diagnose",
        pipeline,
        how,
        ({"exclude": sorted(set(exclude))} if exclude else {})
        | ({"force": True} if force else {})
        | _baseline_options(since, alarm_rate, how, repeat or [])
        | executor_option(executor),
    )


def _baseline_options(old: Path | None, alarm_rate: float | None, how: HowToRun, repeats: list[Path]) -> dict[str, Any]:
    """Return the options for a comparison with the baseline ``old``, a pipeline (diagnosed first) or its artifacts.

    ``repeats`` are pipelines, or their artifacts, that were compared with it before.
    """
    if old is None:
        return {}
    from pneucli.stages.changes import baseline_options, read_repeat

    folder = _diagnosis_folder(old, how)
    asked = baseline_options(folder, alarm_rate)
    differences = [
        read_repeat(one / "diagnose" if one.is_dir() else _diagnosis_folder(one, how), asked) for one in repeats
    ]
    return baseline_options(folder, alarm_rate, differences)


def _diagnosis_folder(old: Path, how: HowToRun) -> Path:
    """Return the folder of a diagnosis; bring it up to date where ``old`` is a pipeline file."""
    if old.is_dir():
        return old / "diagnose"
    pipeline = open_pipeline_file(old, None)
    how.update(pipeline, "diagnose")
    return pipeline.artifacts / "diagnose"


COMMAND = Command(_diagnose, "pneucli diagnose axis-7/pipeline.toml --exclude extra-mass", place=50, stage="diagnose")
