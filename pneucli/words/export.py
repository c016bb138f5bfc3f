"""What was exported."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.words import labelled


def lines(answer: Mapping[str, Any], file: str, verbose: bool) -> Iterator[str]:
    """Yield the period of the controller, and the files."""
    yield from labelled("found", f"controller {answer['controller']}, one step every {1e3 * answer['period_s']:g} ms")
    yield from labelled("wrote", ", ".join(answer["files"]))
