"""The identified parameters with their intervals."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.words import labelled, table, warnings
from pneucli.words.numbers import with_interval


def lines(answer: Mapping[str, Any], file: str, verbose: bool) -> Iterator[str]:
    """Yield the model, its parameters, warnings, and what to do next."""
    model = answer["model"]
    effects = ", ".join(model["effects"])
    count = len(model["parameters"])
    yield from labelled("found", f"{count} parameters of the base model{f' with {effects}' if effects else ''}")
    rows = [(name, with_interval(p["value"], p["unit"], p["ci95"])) for name, p in model["parameters"].items()]
    yield from table(("parameter", "value, 95 % interval"), rows, texts=2)
    yield from warnings(answer)
    yield from labelled("do", f"pneucli compare {file}")
