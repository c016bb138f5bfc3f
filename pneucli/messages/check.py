"""What a pipeline reads, what it lacks, and what is at fault in it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import PurePath
from typing import Any

from pneucli.messages import labelled, table


def lines(answer: Mapping[str, Any], file: str, verbose: bool) -> Iterator[str]:
    """Yield each recording with its signals, then what is missing, assumed and at fault."""
    for one in answer["recordings"]:
        about = f"{one['name']}: {PurePath(one['file']).name}, {one['experiment']}, {one['use']}"
        yield from labelled("reads", about)
        rows = [(row["signal"], row["column"], row["unit"] or "as the file says, else SI") for row in one["signals"]]
        yield from table(("signal", "column", "unit"), rows, texts=3)
        for row in one["signals"]:
            if row["told"]:
                yield from labelled("", f"{row['signal']}: {row['told']}")
        yield ""
    for need in answer["missing"]:
        yield from labelled("missing", f"[{need['table']}] {need['key']} = {need['example']}: {need['wanted']}")
    for one in answer["assumed"]:
        yield from labelled("assumed", f"{one['what']}; {one['instead']} would say it")
    for text in answer["left_out"]:
        yield from labelled("left out", text)
    for fault in answer["faults"]:
        parts = [fault["found"], *(f"{key}: {fault[key]}" for key in ("wanted", "mend") if fault[key])]
        yield from labelled("fault", f"{fault['where']}: {'; '.join(parts)}")
    if not answer["missing"] and not answer["faults"]:
        yield from labelled("do", f"pneucli run {file}")
