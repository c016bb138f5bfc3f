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
    for one in answer["assumed"]:
        yield from labelled("assumed", f"{one['what']} (to state it: {one['instead']})")
    for label in ("valve", "valve_2"):
        if valve := answer.get(label):
            yield from labelled(label.replace("_", " "), _valve(valve))
    yield from warnings(answer)
    yield from labelled("do", f"pneucli compare {file}")


def _valve(valve: Mapping[str, Any]) -> str:
    """Return how well the measured map follows its curves, and the model the map."""
    residual, lack = valve["residual"], valve["lack_of_fit"]
    if valve["map"] == "model":
        return f"no vessel was filled: the map is that of the model's valve, which{_off(lack, 'measured gradients')}"
    held = "" if residual["test"] is None else f", {times(residual['test'])} × noise on held-out ones"
    said = f"the measured map leaves {times(residual['train'])} × noise on its curves{held}"
    if lack["median"] is None:
        return f"{said}; no command was covered"
    return f"{said}; the model's valve{_off(lack, 'it')}"


def _off(lack: Mapping[str, Any], what: str) -> str:
    if lack["median"] is None:
        return f" has no {what} to be held against"
    off = f"{percent(lack['median'])} in the median, {percent(lack['p95'])} at the 95th percentile"
    return f" is off {what} by {off}, outside both intervals at {percent(lack['share_outside'])}"
