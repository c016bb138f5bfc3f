"""``ingest``, ``identify``, ``compare`` and so on: run one stage and the stages that it needs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pneucli import messages
from pneucli.cli import console, examples
from pneucli.cli.options import EXECUTORS, File, Json, Out, Quiet, Verbose, open_pipeline_file
from pneucli.messages import acceptance, plausibility
from pneucli.pipeline.graph import Stage

if TYPE_CHECKING:
    from pneucli.pipeline.runner import Done


class Target(StrEnum):
    """The target of ``export``."""

    c = "c"
    mat = "mat"
    csv = "csv"
    st = "st"
    fmu = "fmu"


class Precision(StrEnum):
    """The arithmetic of the exported C."""

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
    app.command(stage.name, help=text, epilog=examples.example_line(stage.name))(command)


def run_stage(
    name: str,
    file: Path,
    out: Path | None,
    json: bool,
    quiet: bool,
    verbose: bool = False,
    options: Mapping[str, Any] | None = None,
) -> None:
    """Bring the stage up to date and print its answer; ``options`` default to those of its last run."""
    say = console.ignore_message if quiet else console.print_message
    pipeline = open_pipeline_file(file, out)
    with console.progress(quiet) as progress:
        done = pipeline.update([name], None if options is None else {name: options}, progress, say)
    answer = done[name].answer
    if json:
        console.print_json(answer)
    elif name == "ingest":
        console.print_text(messages.render(name, answer, str(file), verbose=verbose))
        print_findings(done)
    else:
        print_findings(done, answer.get("contradicted", ()))
        console.print_text(messages.render(name, answer, str(file), verbose=verbose))
    if fails_acceptance(done):
        raise typer.Exit(1)


def fails_acceptance(done: Mapping[str, Done]) -> bool:
    """Return whether the design violates a requirement of a strict ``[design]``."""
    designed = done["design"].manifest.answer if "design" in done else None
    return acceptance.fails_acceptance((designed or {}).get("gate"))


def print_findings(done: Mapping[str, Done], left_out: Sequence[Mapping[str, str | None]] = ()) -> None:
    """Print what is odd or cannot be true of the recordings, which could have changed the answer of any stage."""
    if "ingest" in done and (answer := done["ingest"].manifest.answer):
        for line in plausibility.lines(answer, left_out):
            console.print_text(line)


def _plain(name: str) -> Callable[..., None]:
    def command(
        pipeline: File, out: Out = None, json: Json = False, verbose: Verbose = False, quiet: Quiet = False
    ) -> None:
        run_stage(name, pipeline, out, json, quiet, verbose)

    return command


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
    executor: Annotated[
        str | None,
        typer.Option("--executor", metavar="WHERE", help=f"Where a long search is done: {EXECUTORS}."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Use recordings that cannot be true, too.")] = False,
    out: Out = None,
    json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    run_stage(
        "diagnose",
        pipeline,
        out,
        json,
        quiet,
        verbose,
        ({"exclude": sorted(set(exclude))} if exclude else {})
        | ({"force": True} if force else {})
        | _baseline_options(since, alarm_rate, quiet, repeat or [])
        | _executor_option(executor),
    )


def _baseline_options(old: Path | None, alarm_rate: float | None, quiet: bool, repeats: list[Path]) -> dict[str, Any]:
    """Return the options for a comparison with the baseline ``old``, a pipeline (diagnosed first) or its artifacts.

    ``repeats`` are pipelines, or their artifacts, that were compared with it before.
    """
    if old is None:
        return {}
    from pneucli.stages.changes import baseline_options, read_repeat

    folder = _diagnosis_folder(old, quiet)
    asked = baseline_options(folder, alarm_rate)
    differences = [
        read_repeat(one / "diagnose" if one.is_dir() else _diagnosis_folder(one, quiet), asked) for one in repeats
    ]
    return baseline_options(folder, alarm_rate, differences)


def _diagnosis_folder(old: Path, quiet: bool) -> Path:
    """Return the folder of a diagnosis; bring it up to date where ``old`` is a pipeline file."""
    if old.is_dir():
        return old / "diagnose"
    pipeline = open_pipeline_file(old, None)
    with console.progress(quiet) as progress:
        pipeline.update(["diagnose"], None, progress, console.ignore_message if quiet else console.print_message)
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
    options = None if compare is None else {"compare": _control_law_names(compare.split(","), "--compare")}
    run_stage("design", pipeline, out, json, quiet, verbose, options)


def _control_law_names(names: list[str], where: str) -> list[str]:
    """Return the checked names of control laws; raises InputError before anything runs."""
    from pneucli.controller.laws import select_laws

    return [one.name for one in select_laws([name.strip() for name in names], where)]


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
    run_stage("simulate", pipeline, out, json, quiet, verbose, _executor_option(executor) or None)


def _executor_option(executor: str | None) -> dict[str, Any]:
    """Return the option that names the executor; raises InputError at once where it does not answer."""
    if executor is None:
        return {}
    from pneucli.executors import require_cluster

    require_cluster(executor)
    return {"executor": executor}


def _export(
    pipeline: File,
    to: Annotated[
        list[Target],
        typer.Option(
            "--to", help="c (PLC, cRIO), st (IEC 61131-3), mat (MATLAB), csv, or fmu (the plant); repeatable."
        ),
    ],
    controller: Annotated[
        str | None,
        typer.Option("--controller", metavar="NAME", help="Another than [design] names.", show_default=False),
    ] = None,
    precision: Annotated[
        Precision, typer.Option("--precision", help="Arithmetic of the C: double, or float for small targets.")
    ] = Precision.float64,
    out: Out = None,
    json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    run_stage(
        "export",
        pipeline,
        out,
        json,
        quiet,
        verbose,
        {"to": _with_previous_targets(open_pipeline_file(pipeline, out).artifacts, to)}
        | ({"controller": _control_law_names([controller], "--controller")[0]} if controller else {})
        | ({"precision": precision.value} if precision != Precision.float64 else {}),
    )


def _with_previous_targets(artifacts: Path, to: list[Target]) -> list[str]:
    """Return the targets together with those of earlier exports, which are updated as well."""
    from pneucli.pipeline import manifest

    former = manifest.read_manifest(artifacts / "export")
    options: Mapping[str, Any] = former.inputs.options if former else {}
    return sorted({*options.get("to", []), *(target.value for target in to)})
