"""``plan``: the next experiment as files to run, and the recordings of a plan into the pipeline."""

from pathlib import Path
from typing import Annotated, Any

import typer

from pneucli.cli.command import Command, File, HowToRun, run_stage
from pneucli.errors import InputError, require_known

HELP = "The next experiment: varied manoeuvres within the limits of the rig, as files to run, and what they would show."
TARGETS = ("csv", "st", "c")


def _plan(
    pipeline: File,
    files: Annotated[
        list[Path] | None, typer.Argument(metavar="[FILE]...", help="With --take: further recordings.")
    ] = None,
    first: Annotated[
        bool, typer.Option("--first", help="For a rig without recordings: the first programme, from [rig] alone.")
    ] = False,
    minutes: Annotated[
        float | None,
        typer.Option("--minutes", metavar="M", min=0.0, help="Machine time at most; default: 3, with --first 5."),
    ] = None,
    effects: Annotated[
        str | None, typer.Option("--effects", metavar="A,B...", help="Decide about these effects.")
    ] = None,
    to: Annotated[
        str, typer.Option("--to", metavar="csv,st,c", help="Also a player of the commands as structured text or C.")
    ] = "csv",
    take: Annotated[
        list[Path] | None,
        typer.Option(
            "--take", metavar="FILE", help="Add the recordings of the last plan, diagnose, show what changed."
        ),
    ] = None,
    how: HowToRun = HowToRun(),
) -> None:
    if take:
        _take(pipeline, [*take, *(files or [])], how)
        return
    if files:
        raise InputError(
            "pneucli plan", str(files[0]), "recordings after --take", "write --take before the files", code="E001"
        )
    options = _options(minutes, effects, to)
    if first and effects:
        raise InputError(
            "--first",
            "together with --effects",
            "--first alone: it plans for every effect",
            f"pneucli plan {pipeline} --first",
            code="E001",
        )
    if first:
        _first(pipeline, how, options)
    else:
        run_stage("plan", pipeline, how, options)


def _options(minutes: float | None, effects: str | None, to: str) -> dict[str, Any]:
    """Return the options of the stage; raises InputError before anything runs."""
    targets = _names(to)
    require_known(targets, TARGETS, "--to", wanted="csv, st or c", code="E031")
    options: dict[str, Any] = {} if minutes is None else {"minutes": minutes}
    options |= {"effects": _names(effects)} if effects else {}
    players = sorted(set(targets) - {"csv"})
    return options | ({"to": players} if players else {})


def _names(text: str) -> list[str]:
    return [name for name in (part.strip() for part in text.split(",")) if name]


def _first(file: Path, how: HowToRun, options: dict[str, Any]) -> None:
    """Plan from the rig's description alone: no stage runs before."""
    from pneucli.pipeline.graph import FIRST_PLAN_STAGES
    from pneucli.pipeline.runner import open_pipeline
    from pneucli.stages.pipeline_file import load_rig_description

    pipeline = open_pipeline(file, load_rig_description, how.out, FIRST_PLAN_STAGES)
    done = how.update(pipeline, "plan", options={"plan": options | {"first": True}})
    how.show("plan", done["plan"].answer, file)


def _take(file: Path, recordings: list[Path], how: HowToRun) -> None:
    """Add recordings to the pipeline file, diagnose, and show before and after.

    The pipeline file stays as it was where the recordings cannot be diagnosed.
    """
    from pneucli.figure import read
    from pneucli.messages.diagnose import Answer
    from pneucli.stages.plan_take import add_recordings, last_answers, taken_answer

    pipeline = how.open(file)
    before, plan = last_answers(pipeline.artifacts, file)
    former = file.read_bytes()
    added = add_recordings(file, plan, recordings)
    try:
        done = how.update(how.open(file), "diagnose")
    except InputError:
        file.write_bytes(former)
        raise
    after = read(Answer, done["diagnose"].answer)
    how.tell(taken_answer(before, after, plan, added), file)


COMMAND = Command(_plan, "pneucli plan axis-7/pipeline.toml --minutes 1", HELP, place=100)
