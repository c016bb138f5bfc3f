"""``exam``: write sealed cases with hidden effects, answer them by this program, and grade the answers."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pneucli.cli import console
from pneucli.cli.command import Command, Executor, How
from pneucli.figure import to_json

if TYPE_CHECKING:
    from pneucli.exam.grades import Answered, Grades, Written, WrittenLike


def _list_conditions(wanted: bool) -> None:
    from pneucli.exam.conditions import CONDITIONS
    from pneucli.messages.formatting import format_plain

    if wanted:
        for one in CONDITIONS:
            limits = " to ".join(format_plain(one.number[end]) for end in ("from", "to") if one.number)
            console.print_text(f"{one.pattern:16} {', '.join(filter(None, (one.description, limits)))}")
        raise typer.Exit


def _exam(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="The folder of the exam.")],
    cases: Annotated[
        int, typer.Option("--cases", min=0, help="Cases with something hidden (60), for each condition.")
    ] = 60,
    nulls: Annotated[
        int, typer.Option("--nulls", min=0, help="Cases with nothing hidden (20), for each condition.")
    ] = 20,
    size: Annotated[float, typer.Option("--size", min=0.0, help="Of what is hidden, over the usual (1).")] = 1.0,
    seed: Annotated[
        int | None,
        typer.Option(
            "--seed",
            min=0,
            help="Another seed gives another exam; default: one from the hash of this program, which nobody chose.",
        ),
    ] = None,
    condition: Annotated[
        list[str] | None,
        typer.Option(
            "--condition",
            metavar="NAME",
            help="Repeatable: as many cases of each, by names that + joins to hold at once; default: usual.",
        ),
    ] = None,
    list_conditions: Annotated[
        bool,
        typer.Option(
            "--conditions", callback=_list_conditions, is_eager=True, help="List the names of conditions, and stop."
        ),
    ] = False,
    like: Annotated[
        Path | None,
        typer.Option(
            "--like",
            metavar="PIPELINE",
            help="Cases like this rig, its recordings and its noise: each effect at several sizes, and none.",
        ),
    ] = None,
    repeats: Annotated[int, typer.Option("--repeats", min=1, help="Of each effect at each size, with --like (3).")] = 3,
    answer: Annotated[bool, typer.Option("--answer", help="Diagnose every case that has no answer yet.")] = False,
    executor: Executor = None,
    grade: Annotated[bool, typer.Option("--grade", help="Print the grades of the answers.")] = False,
    how: How = How(),
) -> None:
    from pneucli.exam import conditions, from_pipeline, workflow

    result: Answered | Grades | Written | WrittenLike
    if answer:
        with console.progress(how.quiet) as progress:
            result = workflow.answer(directory, progress, executor)
        text = result.text
    if grade:
        result = workflow.grade(directory)
        text = result.page.rstrip()
        if (like_result := from_pipeline.write_result(directory, directory / workflow.ANSWERS)) is not None:
            result = replace(result, like=like_result)
            text = f"{text}\n\n{from_pipeline.read_result_page(directory / workflow.ANSWERS)}"
    if like is not None and not (answer or grade):
        with console.progress(how.quiet) as progress:
            result = from_pipeline.write(
                directory, like, repeats=repeats, nulls=nulls, seed=seed or 1, progress=progress
            )
        text = f"wrote {len(result.cases)} cases like {result.like} into {directory}"
    elif not (answer or grade):
        result = workflow.write(directory, cases, nulls, size, seed, condition or [conditions.USUAL])
        text = f"wrote {len(result.cases)} cases into {directory}; to answer them: pneucli exam {directory} --answer"
    if how.json:
        console.print_json(to_json(result))
    else:
        print(text)


COMMAND = Command(
    _exam,
    "pneucli exam my-exam --cases 12 --nulls 4",
    "Sealed cases with hidden effects, answers to them, and the grading of answers.",
    place=210,
)
