"""The identified parameters with their intervals."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.words import labelled, table, warnings
from pneucli.words.numbers import percent, times, with_interval


def lines(answer: Mapping[str, Any], file: str, verbose: bool) -> Iterator[str]:
    """Yield the model, its parameters, warnings, and what to do next."""
    model = answer["model"]
    effects = ", ".join(model["effects"])
    count = len(model["parameters"])
    yield from labelled("found", f"{count} parameters of the base model{f' with {effects}' if effects else ''}")
    rows = [(name, with_interval(p["value"], p["unit"], p["ci95"])) for name, p in model["parameters"].items()]
    yield from table(("parameter", "value, 95 % interval"), rows, texts=2)
    if valve := answer.get("valve"):
        yield from labelled("valve", _valve(valve))
    yield from warnings(answer)
    yield from labelled("do", f"pneucli compare {file}")


def _valve(valve: Mapping[str, Any]) -> str:
    """Return how well the measured map follows its curves, and the model the map."""
    residual, lack = valve["residual"], valve["lack_of_fit"]
    held = "" if residual["test"] is None else f", {times(residual['test'])} × noise on held-out ones"
    said = f"the measured map leaves {times(residual['train'])} × noise on its curves{held}"
    if lack["median"] is None:
        return f"{said}; no command was covered"
    off = f"{percent(lack['median'])} in the median, {percent(lack['p95'])} at the 95th percentile"
    return f"{said}; the model's valve is off it by {off}, outside both intervals at {percent(lack['share_outside'])}"
