"""The stability margins of the loop."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages.formatting import format_number, format_quantity, join_names

Answer = Mapping[str, Any]
LOOP_TITLES = {
    "command": "at the command",
    "command 2": "at the second command",
    "position": "at the position's reading",
}
COLUMN_TITLES = ("loop cut", "upper gain margin", "lower gain margin", "phase margin", "delay margin", "modulus margin")


def table_row(loop: str, worst: Answer) -> tuple[str, ...]:
    """Return the smallest margins of one loop as texts, in the order of COLUMN_TITLES."""
    rise = "× any" if worst["gain_up"] is None else f"× {format_number(worst['gain_up'], 3)}"
    fall = "× any" if not worst["gain_down"] else f"× {format_number(worst['gain_down'], 2)}"
    later = "any" if worst["delay"] is None else f"{format_number(1e3 * worst['delay'], 2)} ms"
    return (
        LOOP_TITLES[loop],
        rise,
        fall,
        f"{format_number(math.degrees(worst['phase']), 2)}°",
        later,
        format_number(worst["modulus"], 2),
    )


def lines(answer: Answer) -> Iterator[str]:
    """Yield a sentence a loop, and what small signals do not tell."""
    for loop, worst in answer["worst"].items():
        _, rise, fall, phase, later, _ = table_row(loop, worst)
        yield f"{LOOP_TITLES[loop]}: gain {rise} or {fall}, phase {phase}, {later} later"


def stability_warnings(answer: Answer) -> Iterator[str]:
    """Yield what is to be warned of: a loop that grows, or a piston that does not slide."""
    grows = sorted({format_quantity(p["x"], "m", 3) for p in answer["points"] if not p["stable"]})
    if grows:
        yield f"the loop is not stable for small signals at {join_names(grows)}"
    if answer["stuck"]:
        places = sorted({format_quantity(p["x"], "m", 3) for p in answer["stuck"]})
        where = join_names(places)
        yield f"the piston does not slide steadily at {where} at any slow speed, so it has no margin there"


def validity_note(answer: Answer) -> str:
    """Return to what the margins apply, in a sentence or two."""
    speeds = [abs(p["speed"]) for p in answer["points"]]
    if not speeds:
        return "Nothing slid steadily: there are no margins."
    text = f"Small signals about a piston that slides at {format_quantity(min(speeds), 'm/s', 2)}"
    text += f" to {format_quantity(max(speeds), 'm/s', 2)}" if max(speeds) > 1.01 * min(speeds) else ""
    text += "; a piston that sticks does not follow small signals: see the closed-loop scenarios."
    if (width := answer["overlap"]["value"]) > 0.0:
        overlap = format_quantity(width, "V", 2)
        text += f" Nor does the valve within its overlap of {overlap}, over which the inverse map jumps."
    if answer["left_out"]:
        text += f" Left out, as small signals are lost in it: {join_names([t.lower() for t in answer['left_out']])}."
    return text
