"""``init``: a new pipeline."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pneucli.cli import console
from pneucli.cli.command import Command, How
from pneucli.paths import from_here

if TYPE_CHECKING:
    from pneucli.init.components import Component


def _init(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="The folder to make.")],
    raw: Annotated[
        list[Path] | None,
        typer.Option("--from", metavar="RAW", help="A raw file, a folder or a glob; more may follow."),
    ] = None,
    more: Annotated[list[Path] | None, typer.Argument(metavar="RAW", help="More raw files.")] = None,
    no_header: Annotated[
        bool, typer.Option("--no-header", help="Texts begin with numbers: columns by number.")
    ] = False,
    skip_rows: Annotated[int, typer.Option("--skip-rows", metavar="N", help="Lines above the table.", min=0)] = 0,
    delimiter: Annotated[
        str | None, typer.Option("--delimiter", metavar="MARK", help="What stands between columns.")
    ] = None,
    decimal: Annotated[str | None, typer.Option("--decimal", metavar="MARK", help="The decimal mark: . or ,")] = None,
    ask: Annotated[
        bool, typer.Option("--ask", help="Ask what raw files cannot tell: bore, rod, stroke, supply.")
    ] = False,
    how: How = How(),
    cylinder: Annotated[
        str | None, typer.Option("--cylinder", metavar="PART", help="The cylinder by its part number.")
    ] = None,
    valve: Annotated[str | None, typer.Option("--valve", metavar="PART", help="The valve by its part number.")] = None,
    components: Annotated[
        Path | None, typer.Option("--components", metavar="FILE", help="A table of your own parts (CSV).")
    ] = None,
) -> None:
    init = importlib.import_module("pneucli.stages.init")
    mark = {"\\t": "\t", "tab": "\t"}.get(delimiter or "", delimiter)
    stated = {"header": not no_header, "skip_rows": skip_rows, "delimiter": mark, "decimal": decimal}
    parts = _parts({"cylinder": cylinder, "valve": valve}, components)
    answer = init.create(directory, [*(raw or []), *(more or [])], parts=parts, **stated)
    if ask:
        answers = _ask(init.questions(answer.fill_in), init.refusal)
        answer = replace(answer, fill_in=init.fill_in(Path(answer.pipeline), answers))
    how.tell(answer, from_here(answer.pipeline))


def _parts(numbers: Mapping[str, str | None], own_table: Path | None) -> list[Component]:
    """Return the parts that are named; raises InputError where a table has none of that number."""
    from pneucli.init.components import find_component

    return [find_component(number, kind, own_table) for kind, number in numbers.items() if number is not None]


def _ask(questions: Sequence[tuple[str, str, str]], refusal: Callable[[dict[str, str]], str]) -> dict[str, str]:
    """Ask on the terminal, again where an answer cannot be taken.

    An empty answer leaves the ``?`` in the file, as does the end of the input.
    """
    answers: dict[str, str] = {}
    waiting = [*questions]
    while waiting:
        name, text, example = waiting[0]
        try:
            typed = typer.prompt(
                f"{text}, such as {example} (Enter: fill it in later)", default="", show_default=False, err=True
            )
        except typer.Abort:
            break
        given = {**answers, **({name: typed.strip()} if typed.strip() else {})}
        if why := refusal(given):
            console.print_message(why)
            continue
        answers = given
        waiting.pop(0)
    return answers


COMMAND = Command(
    _init,
    "pneucli init axis-7 --from recordings/*.csv",
    "A new pipeline from an example, or from raw files, columns guessed and shown.",
    place=10,
)
