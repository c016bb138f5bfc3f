"""What adding or removing effects did to the error."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages import labelled, table
from pneucli.messages.compare import lacks_something
from pneucli.messages.formatting import format_noise_ratio, format_parameters, join_names

Answer = Mapping[str, Any]


def lines(answer: Answer, file: str, verbose: bool) -> Iterator[str]:
    """Yield what was changed, the error before and after, each recording, and what to do next."""
    yield from labelled("changed", _change(answer))
    yield from labelled("error", error_change(answer))
    if answer["parameters"]:
        yield from labelled("size", format_parameters(answer["parameters"]))
    rows = [
        (r["recording"], r["use"], format_noise_ratio(r["before"]), format_noise_ratio(r["after"]))
        for r in answer["recordings"]
    ]
    yield from table(("recording", "use", "before", "after, × noise"), rows, texts=2)
    judged = {"error": answer["after"], "lack_of_fit": answer["lack_of_fit"]}
    yield from labelled("do", f"pneucli {'diagnose' if lacks_something(judged) else 'run'} {file}")


def _change(answer: Answer) -> str:
    parts = [f"{word} {join_names(answer[word])}" for word in ("added", "removed") if answer[word]]
    return f"{' and '.join(parts) or 'nothing'}; effects: {join_names(answer['effects']) or 'none'}"


def error_change(answer: Answer) -> str:
    """Return the error before and after on test recordings, and on those that were fitted."""
    uses = {"test": "test recordings", "train": "those fitted"}
    parts = [
        f"{format_noise_ratio(answer['before'][use])} → {format_noise_ratio(answer['after'][use])} × noise on {name}"
        for use, name in uses.items()
        if answer["after"].get(use) is not None
    ]
    return ", ".join(parts) or "nothing was compared"
