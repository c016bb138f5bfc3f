"""What was seen in raw files, what was made of it, and what is left to people."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import PurePath
from shlex import quote
from typing import Any

from pneucli.messages import each, labelled, table
from pneucli.messages.formatting import format_plain

Answer = Mapping[str, Any]


def lines(answer: Mapping[str, Any], file: str, verbose: bool) -> Iterator[str]:
    """Yield each column with its range and what it is taken for, the kinds of recordings, and what is to be done."""
    if not answer["columns"]:
        yield from labelled("do", f"describe your rig and recordings in {file}, then pneucli run {file}")
        return
    yield from column_lines(answer["recordings"], answer["columns"])
    yield from each("left out", answer["left_out"])
    yield from each("cannot", answer["cannot"])
    yield from labelled("wrote", answer["pipeline"])
    if answer["check"]:
        yield from labelled("check", f"line {_listed(answer['check'])}: what the data alone cannot tell")
    look = f"pneucli look {' '.join(dict.fromkeys(quote(one['file']) for one in answer['recordings']))}"
    yield from labelled("do", f"{look} to see the curves; {_next(answer, file)}")


def column_lines(kinds: Sequence[Answer], columns: Sequence[Answer]) -> Iterator[str]:
    """Yield the columns of each kind of recording with their ranges, and why each is taken as it is."""
    for one in kinds:
        held = f"held out to test: {', '.join(one['held_out'])}" if one["held_out"] else "none held out"
        count = f"{one['files']} file" + "s" * (one["files"] > 1)
        part = f", run {one['run']}" if one["run"] else "" if one["part"] is None else f", part {one['part']}"
        yield from labelled("kind", f"{_short(one['file'])}{part}: {count}, {one['experiment']}; {held}")
        own = [column for column in columns if all(column[key] == one[key] for key in ("file", "part", "run"))]
        yield from table(("column", "taken for", "unit", "least", "median", "most"), [*map(_row, own)], texts=3)
        for column in own:
            if column["why"] and column["signal"]:
                yield from labelled("", f"{column['signal']}: {column['why'].replace('CHECK ', '')}")
        yield ""


def _next(answer: Mapping[str, Any], file: str) -> str:
    waiting = answer["fill_in"]
    if not waiting:
        return f"pneucli run {file}"
    keys = ", ".join(f"{one['key']} (line {one['line']})" for one in waiting)
    return f"fill in {'this one' if len(waiting) == 1 else f'these {len(waiting)}'}: {keys}; then pneucli run {file}"


def _row(column: Mapping[str, Any]) -> tuple[str, ...]:
    gauge = " gauge" * column["gauge"]
    numbers = ("" if column[key] is None else f"{format_plain(column[key], 4)}" for key in ("least", "median", "most"))
    return (f"{column['column']}", column["signal"] or "-", f"{column['unit']}{gauge}", *numbers)


def _short(file: str) -> str:
    return "/".join(PurePath(file).parts[-2:])


def _listed(numbers: list[int]) -> str:
    return ", ".join(map(str, numbers))
