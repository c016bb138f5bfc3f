"""``export``: controller and maps as files for other programs."""

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from pneucli.cli.command import Command, File, HowToRun, law_names, run_stage


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


class Fmi(StrEnum):
    """The version of the standard of the exported plant."""

    three = "3.0"
    two = "2.0"


def _export(
    pipeline: File,
    to: Annotated[
        list[Target],
        typer.Option(
            "--to", help="c (PLC, cRIO), st (IEC 61131-3), mat (MATLAB), csv, or fmu (the plant); repeatable."
        ),
    ],
    controller: Annotated[
        str | None, typer.Option("--controller", metavar="NAME", help="Another than [design] names.")
    ] = None,
    precision: Annotated[
        Precision, typer.Option("--precision", help="Arithmetic of the C: double, or float for small targets.")
    ] = Precision.float64,
    prefix: Annotated[
        str, typer.Option("--prefix", help="Begins every name of the C and the structured text, such as axis1.")
    ] = "pneucli",
    fmi: Annotated[Fmi, typer.Option("--fmi", help="Version of FMI of the plant.")] = Fmi.three,
    how: HowToRun = HowToRun(),
) -> None:
    from pneucli.export.controller_program import checked_prefix

    run_stage(
        "export",
        pipeline,
        how,
        {"to": _with_previous_targets(how.open(pipeline).artifacts, to)}
        | ({"controller": law_names([controller], "--controller")[0]} if controller else {})
        | ({"precision": precision.value} if precision != Precision.float64 else {})
        | ({"prefix": checked_prefix(prefix, "--prefix")} if prefix != "pneucli" else {})
        | ({"fmi": fmi.value} if fmi != Fmi.three else {}),
    )


def _with_previous_targets(artifacts: Path, to: list[Target]) -> list[str]:
    """Return the targets together with those of earlier exports, which are updated as well."""
    from pneucli.pipeline import manifest

    former = manifest.read_manifest(artifacts / "export")
    options: Mapping[str, Any] = former.inputs.options if former else {}
    return sorted({*options.get("to", []), *(target.value for target in to)})


COMMAND = Command(_export, "pneucli export axis-7/pipeline.toml --to c --to mat", place=90, stage="export")
