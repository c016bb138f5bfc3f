"""A leak test: what leaks with its interval, the law, whether it passes, and what limits the answer."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages import labelled
from pneucli.messages.formatting import format_interval, format_percent, format_quantity

Answer = Mapping[str, Any]
VERDICTS = {
    "pass": "passes",
    "fail": "leaks too much",
    "undecided": "cannot be decided: the limit is within the interval",
}
LAWS = {
    "laminar": "flows as through a long gap (laminar)",
    "orifice": "flows as through a hole (orifice)",
    "between": "flows between the laws of a long gap and of a hole",
    "cannot tell": "the course does not tell a gap from a hole",
}
STILL_WARM = 1.0  # K over the wall: from here it is worth being said


def lines(answer: Answer, file: str, verbose: bool) -> Iterator[str]:
    """Yield each test: verdict, rates, course and doubts; then what was left out."""
    for one in answer["tests"]:
        yield from labelled("leak", f"{one['recording']}: {sentence(one, answer)}")
        yield from labelled("", f"it {course(one)}; {LAWS[one['law']]}")
        for text in doubts(one, answer):
            yield from labelled("doubt", text)
    for text in answer["left_out"]:
        yield from labelled("left out", text)
    if answer["volume"] is None:
        yield from labelled("do", f'pneucli leak {file} --volume "2 l", from which flow and area follow')


def sentence(one: Answer, answer: Answer) -> str:
    """Return the leak in all units, and whether it passes."""
    found = [with_interval(one[kind]) for kind in kinds(one)]
    limit = answer["limit"]
    verdict = "" if limit is None else f"{VERDICTS[one['verdict']]} ({limit['text']}): "
    at = f"at {format_quantity(one['pressure'], 'Pa')}"
    return f"{verdict}{', '.join(found)} {at}"


def with_interval(found: Answer) -> str:
    """Return a quantity with its interval; losses of pressure in Pa/s, in which leaks are stated."""
    if found["unit"] == "Pa/s":
        return f"{format_interval(found['value'], '1', found['ci95'])} Pa/s"
    return format_interval(found["value"], found["unit"], found["ci95"])


def kinds(one: Answer) -> list[str]:
    """Return the quantities that are known of a leak."""
    return [kind for kind in ("rate", "flow", "area") if one[kind] is not None]


def course(one: Answer) -> str:
    """Return from when to when, and from where to where."""
    first, last = one["shut"]
    before = "" if one["rest"] is None else f"rests at {format_quantity(one['rest'], 'Pa')}, then "
    return (
        f"{before}is shut from {format_quantity(first, 's')} to {format_quantity(last, 's')} and comes from "
        f"{format_quantity(one['pressure'], 'Pa')} to {format_quantity(one['pressure_end'], 'Pa')}"
    )


def doubts(one: Answer, answer: Answer) -> Iterator[str]:
    """Yield what limits the answer of a test, and what would help."""
    low, high = one["rate"]["ci95"]
    half = 0.5 * (high - low)
    if abs(one["warmed"]) > STILL_WARM:
        side = "warmer" if one["warmed"] > 0.0 else "colder"
        yield (
            f"the gas was about {format_quantity(abs(one['warmed']), 'K', 2)} {side} than the wall at first and took "
            f"{format_quantity(one['settling'], 's', 2)} to settle: wait longer before the test"
        )
    if not one["temperature_measured"] and half and (share := one["drift_half_width"] / half) > 0.5:
        yield (
            f"{format_percent(min(share, 1.0))} of the interval is what a drift of the wall by "
            f"{format_quantity(answer['drift'], 'K', 2)} could do: record it, test longer, or state --drift"
        )
    if low <= 0.0 <= high:
        yield "no leak is seen; the upper end of the interval is the most there can be"
    elif high < 0.0:
        yield "the pressure moves away from ambient: the vessel is being filled, or becomes warmer"
    if one["seconds_to_decide"] is not None:
        yield f"a test of about {format_quantity(one['seconds_to_decide'], 's', 2)} would decide"
