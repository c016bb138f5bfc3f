"""Two runs side by side: the differences first, the whole tables behind ``-v``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pneucli.messages import labelled, table
from pneucli.messages.compare import evaluation_error
from pneucli.messages.formatting import (
    format_interval,
    format_noise_ratio,
    format_number,
    format_plain,
    format_quantity,
    join_names,
)

Answer = Mapping[str, Any]
CHANCE = 0.05  # of a 95 % interval to miss
MIN_ERROR_CHANGE = 0.005  # of an error: what its three digits show


def lines(answer: Answer, file: str, verbose: bool) -> Iterator[str]:
    """Yield effects, errors, parameters beyond their intervals and verdicts of two runs."""
    for side in ("a", "b"):
        one = answer[side]
        yield from labelled(side.upper(), f"{one['path']}: {join_names(one['effects']) or 'base model'}")
    yield from labelled("effects", _effects(answer["effects"]))
    yield from labelled("error", _errors(answer))
    yield from labelled("found", _parameters(answer["parameters"]))
    shown = [row for row in answer["parameters"] if verbose or row["beyond"]]
    if shown:
        yield from table(("parameter", "A", "B", "B - A", "× interval"), [_row(row) for row in shown], texts=1)
    for side in ("a", "b"):
        yield from labelled("verdict", f"{side.upper()}: {_verdict(answer[side])}")
    recordings = [row for row in answer["recordings"] if verbose or _differs(row)]
    if recordings:
        yield from table(("recording", "use", "A", "B, × noise"), [_recording(row) for row in recordings], texts=2)


def _effects(effects: Mapping[str, Sequence[str]]) -> str:
    parts = [f"only {name}: {join_names(effects[key])}" for key, name in (("only_a", "A"), ("only_b", "B"))
             if effects[key]]  # fmt: skip
    return "; ".join(parts) or "the same in both"


def _errors(answer: Answer) -> str:
    sides = [answer["a"]["error"], answer["b"]["error"]]
    use, _ = evaluation_error(sides[1])
    a, b = (format_noise_ratio(side.get(use)) for side in sides)
    other = "" if answer["same_data"] else "; on other recordings or at another horizon, so the errors do not compare"
    return f"{a} → {b} × noise on {use} recordings{other}"


def _parameters(rows: Sequence[Answer]) -> str:
    """Return how many parameters differ beyond their intervals, and how many would by chance."""
    compared = [row for row in rows if row["beyond"] is not None]
    if not compared:
        return "no parameter has an interval in both"
    beyond = sum(row["beyond"] for row in compared)
    return (
        f"{beyond} of {len(compared)} parameters differ by more than their 95 % intervals allow; in two repeats of one "
        f"rig about {format_plain(CHANCE * len(compared), 1)} would"
    )


def _row(row: Answer) -> tuple[str, ...]:
    a, b = (
        format_interval(one["value"], row["unit"], one["ci95"] or (None, None)) if one is not None else "-"
        for one in (row["a"], row["b"])
    )
    change = "-" if row["difference"] is None else format_quantity(row["difference"], row["unit"], 3)
    return row["name"], a, b, change, "-" if row["distance"] is None else format_number(row["distance"], 2)


def _verdict(side: Answer) -> str:
    if side["verdict"] is None:
        return "not diagnosed, or not as the model is now"
    return f"{side['verdict']}. {side['sentence']}"


def _differs(row: Answer) -> bool:
    a, b = row["before"], row["after"]
    return (a is None) != (b is None) or (a is not None and b is not None and abs(b - a) > MIN_ERROR_CHANGE * max(a, b))


def _recording(row: Answer) -> tuple[str, str, str, str]:
    return row["recording"], row["use"], format_noise_ratio(row["before"]), format_noise_ratio(row["after"])
