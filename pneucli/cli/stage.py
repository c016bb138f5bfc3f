"""``ingest``, ``identify``, ``compare`` and so on: one stage, after all that it needs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pneucli import messages
from pneucli.cli import console, examples
from pneucli.cli.options import EXECUTORS, File, Json, Out, Quiet, Verbose, opened
from pneucli.messages import acceptance, plausibility
from pneucli.pipeline.graph import Stage

if TYPE_CHECKING:
    from pneucli.pipeline.runner import Done


class Target(StrEnum):
    """What ``export`` writes for."""

    c = "c"
    mat = "mat"
    csv = "csv"
    st = "st"


class Precision(StrEnum):
    """In what arithmetic the C calculates."""

    float64 = "float64"
    float32 = "float32"


def register(app: typer.Typer, stage: Stage) -> None:
    """Add the command of ``stage``."""
    special: dict[str, Callable[..., None]] = {
        "design": _design,
        "diagnose": _diagnose,
        "export": _export,
        "simulate": _simulate,
    }
    command = special.get(stage.name, _plain(stage.name))
    text = f"{stage.title[0].upper()}{stage.title[1:]}."
    app.command(stage.name, help=text, epilog=examples.of(stage.name))(command)


def bring_up(
    name: str,
    file: Path,
    out: Path | None,
    json: bool,
    quiet: bool,
    verbose: bool = False,
    options: Mapping[str, Any] | None = None,
) -> None:
    """Bring the stage up to date and print its answer; without ``options`` those of its last run hold."""
    say = console.hush if quiet else console.say
    pipeline = opened(file, out)
    with console.progress(quiet) as progress:
        done = pipeline.bring_up([name], None if options is None else {name: options}, progress, say)
    answer = done[name].answer
    if json:
        console.answer(answer)
    else:
        console.tell(messages.of(name, answer, str(file), verbose=verbose))
        doubt(done)
    if refused(done):
        raise typer.Exit(1)


def refused(done: Mapping[str, Done]) -> bool:
    """Whether the design misses what a strict ``[design]`` asks."""
    designed = done["design"].manifest.answer if "design" in done else None
    return acceptance.refused((designed or {}).get("gate"))


def doubt(done: Mapping[str, Done]) -> None:
    """Print what is implausible in the recordings, behind the answer of every stage that rests on them."""
    if "ingest" in done and (answer := done["ingest"].manifest.answer):
        for line in plausibility.lines(answer):
            console.tell(line)


def _plain(name: str) -> Callable[..., None]:
    def command(
        pipeline: File, out: Out = None, json: Json = False, verbose: Verbose = False, quiet: Quiet = False
    ) -> None:
        bring_up(name, pipeline, out, json, quiet, verbose)

    return command


def _diagnose(
    pipeline: File,
    exclude: Annotated[
        list[str] | None,
        typer.Option("--exclude", metavar="EFFECT", help="Known not to be there (repeatable)."),
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
    executor: Annotated[
        str | None,
        typer.Option("--executor", metavar="WHERE", help=f"Where a long search is done: {EXECUTORS}."),
    ] = None,
    out: Out = None,
    json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    bring_up(
        "diagnose",
        pipeline,
        out,
        json,
        quiet,
        verbose,
        ({"exclude": sorted(set(exclude))} if exclude else {})
        | _since(since, alarm_rate, quiet, repeat or [])
        | _where(executor),
    )


def _since(old: Path | None, alarm_rate: float | None, quiet: bool, repeats: list[Path]) -> dict[str, Any]:
    """Return the options that ask what changed since ``old``, a pipeline (diagnosed first) or its artifacts.

    ``repeats`` are pipelines, or their artifacts, that were held against it before.
    """
    if old is None:
        return {}
    from pneucli.stages.changes import option, repeat_in

    folder = _diagnosed(old, quiet)
    asked = option(folder, alarm_rate)
    known = [repeat_in(one / "diagnose" if one.is_dir() else _diagnosed(one, quiet), asked) for one in repeats]
    return option(folder, alarm_rate, known)


def _diagnosed(old: Path, quiet: bool) -> Path:
    """Return the folder of a diagnosis, which is brought up to date where a pipeline file is named."""
    if old.is_dir():
        return old / "diagnose"
    pipeline = opened(old, None)
    with console.progress(quiet) as progress:
        pipeline.bring_up(["diagnose"], None, progress, console.hush if quiet else console.say)
    return pipeline.artifacts / "diagnose"


def _design(
    pipeline: File,
    compare: Annotated[
        str | None,
        typer.Option(
            "--compare", metavar="NAME,NAME...", help="Laws to run side by side; default: all.", show_default=False
        ),
    ] = None,
    out: Out = None,
    json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    options = None if compare is None else {"compare": _laws(compare.split(","), "--compare")}
    bring_up("design", pipeline, out, json, quiet, verbose, options)


def _laws(names: list[str], where: str) -> list[str]:
    """Check names of laws before anything runs; raises InputError."""
    from pneucli.controller.laws import laws_named

    return [law.name for law in laws_named([name.strip() for name in names], where)]


def _simulate(
    pipeline: File,
    executor: Annotated[
        str | None,
        typer.Option("--executor", metavar="WHERE", help=f"Where the Monte Carlo study runs: {EXECUTORS}."),
    ] = None,
    out: Out = None,
    json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    bring_up("simulate", pipeline, out, json, quiet, verbose, _where(executor) or None)


def _where(executor: str | None) -> dict[str, Any]:
    """Return the option that says where work is done; raises InputError at once where nobody is there."""
    if executor is None:
        return {}
    from pneucli.executors import require_cluster

    require_cluster(executor)
    return {"executor": executor}


def _export(
    pipeline: File,
    to: Annotated[
        list[Target], typer.Option("--to", help="c (PLC, cRIO), st (IEC 61131-3), mat (MATLAB) or csv; repeatable.")
    ],
    controller: Annotated[
        str | None,
        typer.Option("--controller", metavar="NAME", help="Another law than that of [design].", show_default=False),
    ] = None,
    precision: Annotated[
        Precision, typer.Option("--precision", help="Arithmetic of the C: double, or float for small targets.")
    ] = Precision.float64,
    out: Out = None,
    json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    bring_up(
        "export",
        pipeline,
        out,
        json,
        quiet,
        verbose,
        {"to": _with_former(opened(pipeline, out).artifacts, to)}
        | ({"controller": _laws([controller], "--controller")[0]} if controller else {})
        | ({"precision": precision.value} if precision != Precision.float64 else {}),
    )


def _with_former(artifacts: Path, to: list[Target]) -> list[str]:
    """What was exported before stays exported, up to date with the rest."""
    from pneucli.pipeline import manifest

    former = manifest.read(artifacts / "export")
    options: Mapping[str, Any] = former.inputs.options if former else {}
    return sorted({*options.get("to", []), *(target.value for target in to)})
