"""What is said of the margins of the loop."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages.formatting import joined, number, quantity

Answer = Mapping[str, Any]
TITLES = {"command": "at the command", "command 2": "at the second command", "position": "at the position's reading"}
HEAD = ("loop cut", "gain may rise", "may fall", "phase", "later by", "least distance from −1")


def row(loop: str, worst: Answer) -> tuple[str, ...]:
    """Return the least margins of one loop as texts, in the order of HEAD."""
    rise = "× any" if worst["gain_up"] is None else f"× {number(worst['gain_up'], 3)}"
    fall = "× any" if not worst["gain_down"] else f"× {number(worst['gain_down'], 2)}"
    later = "any" if worst["delay"] is None else f"{number(1e3 * worst['delay'], 2)} ms"
    return TITLES[loop], rise, fall, f"{number(math.degrees(worst['phase']), 2)}°", later, number(worst["modulus"], 2)


def lines(answer: Answer) -> Iterator[str]:
    """Yield a sentence a loop, and what small signals do not tell."""
    for loop, worst in answer["worst"].items():
        _, rise, fall, phase, later, _ = row(loop, worst)
        yield f"{TITLES[loop]}: gain {rise} or {fall}, phase {phase}, {later} later"


def doubts(answer: Answer) -> Iterator[str]:
    """Yield what is to be warned of: a loop that grows, or a piston that does not slide."""
    grows = sorted({quantity(p["x"], "m", 3) for p in answer["points"] if not p["stable"]})
    if grows:
        yield f"the loop is not stable for small signals at {joined(grows)}"
    if answer["stuck"]:
        places = sorted({quantity(p["x"], "m", 3) for p in answer["stuck"]})
        yield f"the piston does not slide steadily at {joined(places)} at any slow speed, so no margin is known there"


def limits(answer: Answer) -> str:
    """Return to what the margins apply, in a sentence or two."""
    speeds = [abs(p["speed"]) for p in answer["points"]]
    if not speeds:
        return "Nothing slid steadily: there are no margins."
    text = f"Small signals about a piston that slides at {quantity(min(speeds), 'm/s', 2)}"
    text += f" to {quantity(max(speeds), 'm/s', 2)}" if max(speeds) > 1.01 * min(speeds) else ""
    text += "; a piston that sticks does not follow small signals, and the scenarios tell of it."
    if (width := answer["overlap"]["value"]) > 0.0:
        text += (
            f" Nor does the valve within its overlap of {quantity(width, 'V', 2)}, over which the inverse map jumps."
        )
    if answer["left_out"]:
        text += f" Left out, as small signals are lost in it: {joined([t.lower() for t in answer['left_out']])}."
    return text
