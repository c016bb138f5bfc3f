"""What a command declares of itself, and the lines that most commands have in common."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from pneucli.cli import console
from pneucli.cli.options import File, Json, Out, Quiet, Verbose, open_pipeline_file
from pneucli.pipeline.graph import STAGES

if TYPE_CHECKING:
    from pneucli.pipeline.runner import Done, Pipeline


@dataclass(frozen=True)
class Command:
    """One command of the program.

    A file of :mod:`pneucli.cli.commands` has one as ``COMMAND``, and so has what a package names as entry point of the
    group ``pneucli.commands``; the command's name is that of the file or of the entry point.

    Attributes:
        run: The function behind it, with the arguments of the command line as typer reads them.
        example: The last line of ``--help``.
        help: What it does, in one line; default: the title of its stage.
        place: Where it stands in the list of all commands; those of other packages come last.
        stage: The stage that it runs; it is left out where that is not installed.
    """

    run: Callable[..., None]
    example: str
    help: str = ""
    place: int = 1000
    stage: str = ""

    @property
    def text(self) -> str:
        """What it does, in one line."""
        title = STAGES[self.stage].title if self.stage else ""
        return self.help or f"{title[0].upper()}{title[1:]}."


def stage_command(name: str, example: str, place: int) -> Command:
    """Return the command of a stage that has no options of its own."""

    def command(
        pipeline: File, out: Out = None, json: Json = False, verbose: Verbose = False, quiet: Quiet = False
    ) -> None:
        run_stage(name, pipeline, out, json, quiet, verbose)

    return Command(command, example, place=place, stage=name)


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
    done = update(open_pipeline_file(file, out), [name], quiet, None if options is None else {name: options})
    answer = done[name].answer
    if not json and name != "ingest":
        print_findings(done, answer.get("contradicted", ()))
    show(name, answer, file, json, verbose)
    if not json and name == "ingest":
        print_findings(done)
    if fails_acceptance(done):
        raise typer.Exit(1)


def update(
    pipeline: Pipeline,
    stages: Sequence[str],
    quiet: bool,
    options: Mapping[str, Mapping[str, Any]] | None = None,
) -> dict[str, Done]:
    """Bring stages up to date and report on standard error, unless ``quiet``."""
    with console.progress(quiet) as progress:
        return pipeline.update(stages, options, progress, console.messenger(quiet))


def show(name: str, answer: Mapping[str, Any], file: Path, json: bool, verbose: bool = False) -> None:
    """Print an answer: as the one JSON object, or as the sentences of :mod:`pneucli.messages`."""
    from pneucli import messages

    if json:
        console.print_json(answer)
    else:
        console.print_text(messages.render(name, answer, str(file), verbose=verbose))


def fails_acceptance(done: Mapping[str, Done]) -> bool:
    """Return whether the design violates a requirement of a strict ``[design]``."""
    from pneucli.messages import acceptance

    designed = done["design"].manifest.answer if "design" in done else None
    return acceptance.fails_acceptance((designed or {}).get("gate"))


def print_findings(done: Mapping[str, Done], left_out: Sequence[Mapping[str, str | None]] = ()) -> None:
    """Print what is odd or cannot be true of the recordings, which could have changed the answer of any stage."""
    from pneucli.messages import plausibility

    if "ingest" in done and (answer := done["ingest"].manifest.answer):
        for line in plausibility.lines(answer, left_out):
            console.print_text(line)
