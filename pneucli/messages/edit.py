"""What adding or removing effects did to the error."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages import labelled, table
from pneucli.messages.compare import judged, tone
from pneucli.messages.formatting import joined, parameters, times

Answer = Mapping[str, Any]


def lines(answer: Answer, file: str, verbose: bool) -> Iterator[str]:
    """Yield what was changed, the error before and after, each recording, and what to do next."""
    yield from labelled("changed", _change(answer))
    yield from labelled("error", fall(answer))
    if answer["parameters"]:
        yield from labelled("size", parameters(answer["parameters"]))
    rows = [(r["recording"], r["use"], times(r["before"]), times(r["after"])) for r in answer["recordings"]]
    yield from table(("recording", "use", "before", "after, × noise"), rows, texts=2)
    _, after = judged(answer["after"])
    yield from labelled("do", f"pneucli {'run' if tone(after) == 'good' else 'diagnose'} {file}")


def _change(answer: Answer) -> str:
    parts = [f"{word} {joined(answer[word])}" for word in ("added", "removed") if answer[word]]
    return f"{' and '.join(parts) or 'nothing'}; effects: {joined(answer['effects']) or 'none'}"


def fall(answer: Answer) -> str:
    """Return the error before and after on test recordings, and on those that were fitted."""
    uses = {"test": "test recordings", "train": "those fitted"}
    parts = [
        f"{times(answer['before'][use])} → {times(answer['after'][use])} × noise on {words}"
        for use, words in uses.items()
        if answer["after"].get(use) is not None
    ]
    return ", ".join(parts) or "nothing was compared"
