"""The residual that no effect of the catalogue explains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pneucli.messages.formatting import (
    format_noise_ratio,
    format_number,
    format_percent,
    format_quantity,
    format_signal,
)
from pneucli.quantities import signal_title

SHAPES = {
    "constant": "a constant",
    "proportional": "proportional to it",
    "sign": "a constant that changes sign with it",
    "signed-square": "growing with its square, sign kept",
    "line": "a straight line",
    "parabola": "a parabola",
}
PERIODIC_SHAPE = "a sine"
FREE_RUN = "an error of the complete simulation alone (by itself each subsystem fits)"
MAX_NAMED_SIGNALS = 2  # over which a discrepancy is as good a function as over the first
SHAPELESS = "an error that is no function of any signal"


def discrepancy_kind_text(
    kind: str, acts_as: Sequence[str], variable: str | None, *, share: float | None = None, period: float | None = None
) -> str:
    """Return as what a discrepancy acts, and over which signal.

    ``kind`` is that of :class:`pneucli.diagnose.discrepancy.UnexplainedResidual`, ``share`` the explained part of the
    squares, ``period`` in SI.
    """
    if variable is None:
        return FREE_RUN if kind == "free-run" else SHAPELESS
    what = " or ".join(_with_article(one) for one in acts_as) or "something"
    if kind == "periodic":
        return f"{what} that repeats over {signal_title(variable)}, period {format_signal(period or 0.0, variable)}"
    over = "that drifts over each recording" if variable == "time" else f", a function of {signal_title(variable)}"
    text = f"{what} {over}".replace(" ,", ",")
    return f"mostly irregular; {format_percent(share or 0.0)} of it is {text}" if kind == "irregular" else text


def _with_article(noun: str) -> str:
    return f"an {noun}" if noun[0] in "aeio" else f"a {noun}"


def explaining_signal(unexplained: Mapping[str, Any]) -> str:
    """Return how much of the unexplained residual a function of one signal explains; nothing where none does."""
    if not unexplained.get("share"):
        return ""
    share = format_percent(unexplained["share"])
    if unexplained.get("law") == PERIODIC_SHAPE:  # a period is estimated from all recordings
        return f"The period explains {share} of what is left."
    return f"A function of {unexplained['variable']} explains {share} of what is left in recordings that were left out."


def discrepancy_character(unexplained: Mapping[str, Any]) -> str:
    """Return as what the discrepancy acts, over which signal, and over which others equally well, the first by name."""
    shape = f" ({unexplained['law']})" if unexplained.get("law") else ""
    also = unexplained.get("also_over") or []
    named = len(also) if len(also) <= MAX_NAMED_SIGNALS + 1 else MAX_NAMED_SIGNALS
    others = [f", or of {signal_title(name)}" for name in also[:named]]
    if also[named:]:
        others.append(f", or of {len(also) - named} other signals")
    return f"{unexplained['character']}{shape}{''.join(others)}"


def discrepancy_location(unexplained: Mapping[str, Any]) -> str:
    """Return the channel of the discrepancy, its size, and the subsystem."""
    ratio = format_number(unexplained["times_noise"], 2)
    return f"{unexplained['channel']} errs by {ratio} times its noise ({unexplained['subsystem']})"


def largest_discrepancy(answer: Mapping[str, Any]) -> str:
    """Return the channel of the largest discrepancy in excess of noise with its size; nothing where there is none."""
    found = answer.get("discrepancy") or []
    if not found:
        return ""
    worst = max(found, key=lambda one: one["size"])
    over = f", over {worst['over']}" if worst.get("over") else ""
    duration = f", lasting {format_quantity(worst['time_constant_s'], 's', 2)}" if worst.get("time_constant_s") else ""
    return f"{worst['channel']}, {format_noise_ratio(worst['size'])} × its noise ({worst['subsystem']}{over}{duration})"
