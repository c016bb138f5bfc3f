"""What a command declares of itself, and the lines and arguments that most commands have in common."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Protocol

import typer

from pneucli.cli import console
from pneucli.figure import read, to_json
from pneucli.imports import hidden_modules
from pneucli.pipeline.graph import STAGES

if TYPE_CHECKING:
    from pneucli.pipeline.runner import Done, Pipeline

File = Annotated[Path, typer.Argument(metavar="PIPELINE", help="The pipeline file (TOML).")]
Out = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="DIR", help="Folder of the artifacts; default: artifacts/NAME next to the pipeline file."
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print the answer as one JSON object, and nothing else.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="The tables behind the verdict as well.")]
Executor = Annotated[
    str | None,
    typer.Option(
        "--executor",
        metavar="WHERE",
        help="Where long work is done: local (default), dask://host:port, or a TOML file of a cluster.",
    ),
]
Page = Annotated[Path | None, typer.Option("--html", metavar="FILE", help="Write a page with the curves as well.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress, no messages on standard error.")]


def open_pipeline_file(file: Path, out: Path | None) -> Pipeline:
    """Open the pipeline; validate the file only when it has changed (the units take half a second to import)."""
    from pneucli.notebook.run import open_pipeline_of

    return replace(open_pipeline_of(file, out), prepare=keep_pandas_out)


def keep_pandas_out() -> None:
    """Let Arrow find no pandas in this process.

    Arrow imports pandas, which is slow, at its first array, only to recognise objects of pandas, and no stage gives it
    any. The stages' own ``import pandas`` still works.
    """
    if "pandas" in sys.modules:
        return
    import pyarrow as pa

    with hidden_modules("pandas"):
        pa.array([0.0])


def law_names(names: list[str], where: str) -> list[str]:
    """Return the checked names of control laws; raises InputError before anything runs."""
    from pneucli.controller.laws import select_laws

    return [one.name for one in select_laws([name.strip() for name in names], where)]


def executor_option(executor: str | None) -> dict[str, Any]:
    """Return the option that names the executor; raises InputError at once where it does not answer."""
    if executor is None:
        return {}
    from pneucli.executors import require_cluster

    require_cluster(executor)
    return {"executor": executor}


@dataclass(frozen=True)
class Command:
    """One command of the program.

    A file of :mod:`pneucli.cli.commands` has one as ``COMMAND``, and so has what a package names as entry point of the
    group ``pneucli.commands``; the command's name is that of the file or of the entry point.

    Attributes:
        run: The function behind it, with the arguments of the command line as typer reads them, and ``how``.
        example: The last line of ``--help``.
        help: What it does, in one line; default: the title of its stage.
        place: Where it stands in the list of all commands; those of other packages come last.
        stage: The stage that it runs.
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


class Told(Protocol):
    """An answer whose fields are the keys of its JSON, and which says itself what a person reads."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def lines(self, file: str, verbose: bool) -> Iterator[str]:
        """Yield what a person reads; ``file`` is the pipeline file as the user typed it, for the commands."""


@dataclass(frozen=True)
class How:
    """How a command answers: the options that every command has, by its argument ``how``."""

    json: bool = False
    verbose: bool = False
    quiet: bool = False

    @property
    def say(self) -> Callable[[str], None]:
        """The function that takes messages for standard error."""
        return console.ignore_message if self.quiet else console.print_message

    def show(self, name: str, answer: Mapping[str, Any], file: Path | str) -> None:
        """Print an answer: as the one JSON object, or as the sentences of :mod:`pneucli.messages`."""
        from pneucli import messages

        if self.json:
            console.print_json(answer)
        else:
            console.print_text(messages.render(name, answer, str(file), verbose=self.verbose))

    def tell(self, answer: Told, file: Path | str) -> None:
        """Print an answer that words itself: as the one JSON object, or as its sentences."""
        if self.json:
            console.print_json(to_json(answer))
        else:
            console.print_text("\n".join(answer.lines(str(file), self.verbose)))

    def update(
        self, pipeline: Pipeline, *stages: str, options: Mapping[str, Mapping[str, Any]] | None = None
    ) -> dict[str, Done]:
        """Bring stages of a pipeline up to date; report on standard error."""
        with console.progress(self.quiet) as progress:
            return pipeline.update(stages, options, progress, self.say)


@dataclass(frozen=True)
class HowToRun(How):
    """The same of a command that opens a pipeline file: also where its artifacts are."""

    out: Path | None = None

    def open(self, file: Path) -> Pipeline:
        """Open a pipeline file."""
        return open_pipeline_file(file, self.out)


OPTIONS = {"out": Out, "json": Json, "verbose": Verbose, "quiet": Quiet}  # of these two, in their order


def with_common_options(run: Callable[..., None]) -> Callable[..., None]:
    """Return a command with the common options in place of its argument ``how``, as typer reads them."""
    signature = inspect.signature(run, eval_str=True)
    if (how := signature.parameters.get("how")) is None:
        return run
    default = how.annotation() if how.default is how.empty else how.default
    own = [
        inspect.Parameter(name, how.kind, default=getattr(default, name), annotation=option)
        for name, option in OPTIONS.items()
        if hasattr(default, name)
    ]

    def command(**given: Any) -> None:
        chosen = {one.name: given.pop(one.name) for one in own}
        run(**given, how=type(default)(**chosen))

    parameters = [part for one in signature.parameters.values() for part in (own if one is how else (one,))]
    command.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {one.name: one.annotation for one in parameters}
    return command


def stage_command(name: str, example: str, place: int) -> Command:
    """Return the command of a stage that has no options of its own."""

    def command(pipeline: File, how: HowToRun = HowToRun()) -> None:
        run_stage(name, pipeline, how)

    return Command(command, example, place=place, stage=name)


def run_stage(name: str, file: Path, how: HowToRun, options: Mapping[str, Any] | None = None) -> None:
    """Bring the stage up to date and print its answer; ``options`` default to those of its last run."""
    done = how.update(how.open(file), name, options=None if options is None else {name: options})
    answer = done[name].answer
    if not how.json and name != "ingest":
        print_findings(done, answer.get("contradicted", ()))
    how.show(name, answer, file)
    if not how.json and name == "ingest":
        print_findings(done)
    if fails_acceptance(done):
        raise typer.Exit(1)


def fails_acceptance(done: Mapping[str, Done]) -> bool:
    """Return whether the design violates a requirement of a strict ``[design]``."""
    from pneucli.messages import design

    designed = done["design"].manifest.answer if "design" in done else None
    return design.fails_acceptance(read(design.Answer, designed or {}).gate)


def print_findings(done: Mapping[str, Done], left_out: Sequence[Mapping[str, str | None]] = ()) -> None:
    """Print what is odd or cannot be true of the recordings, which could have changed the answer of any stage."""
    from pneucli.messages import ingest
    from pneucli.messages.compare import LeftOut

    if "ingest" in done and (answer := done["ingest"].manifest.answer):
        excused = [read(LeftOut, one) for one in left_out]
        for line in read(ingest.Answer, answer).plausibility_lines(excused):
            console.print_text(line)
