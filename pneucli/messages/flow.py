"""A valve on a steady bench: its characteristics, and what its rows say that a valve does not explain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages import labelled, table
from pneucli.messages.formatting import (
    format_interval,
    format_noise_ratio,
    format_number,
)

FLOW_COLUMNS = ("command", "rows", "C (ISO 6358)", "b", "m", "cracking pressure", "× noise")
LITRES_PER_BAR = 1e8  # l/(s bar) in m^3/(s Pa)
STEADY_BENCH_LIMITS = (
    "a steady bench shows the flow function and leaks at a closed valve; effects of time (lag, delay, hysteresis, heat "
    "transfer) and of a cylinder cannot show"
)


def flow_lines(flow: Mapping[str, Any]) -> Iterator[str]:
    """Yield the table of a steady bench; an asterisk marks what typical values hold."""
    yield from table(FLOW_COLUMNS, [flow_row(path) for path in flow["paths"]], texts=6)
    if any(not path[name]["determined"] for path in flow["paths"] for name in ("b", "m")):
        text = "the rows do not determine b or m there: typical values of valves (b 0.35, m 0.5) hold them"
        yield from labelled("*", text)


def flow_row(path: Mapping[str, Any]) -> tuple[str, ...]:
    """Return a path's command, number of rows, C, b, m, cracking pressure, and residual over noise."""
    c = path["C"]
    shown = format_interval(LITRES_PER_BAR * c["value"], "l/(s bar)", [LITRES_PER_BAR * end for end in c["ci95"]])
    b, m = (
        format_interval(path[name]["value"], "1", path[name]["ci95"]) + ("" if path[name]["determined"] else " *")
        for name in ("b", "m")
    )
    cracking = path["cracking_pressure"]
    opens = "–" if cracking is None else format_interval(cracking["value"], "Pa", cracking["ci95"])
    ratio = format_noise_ratio(path["residual"]["ratio_to_noise"])
    return (path["name"] or "one opening", f"{path['rows']}", shown, b, m, opens, ratio)


def flow_verdict(base: float | None, last: float | None, named: str, left: str, beyond: str = "") -> str:
    """Return the verdict of a diagnosis of a steady bench in a sentence.

    Args:
        base: Error of the given model over noise.
        last: Error of the model with what was named.
        named: The effect that is named with its value; empty where none is.
        left: What the rows say that no effect of the catalogue explains; empty where nothing is left.
        beyond: What C, b and m of each opening describe and an effect does not; empty where that is nothing.

    """
    errors = [format_noise_ratio(one) for one in (base, last)]
    parts = (
        [f"The model lacks {named}: the error goes from {errors[0]} to {errors[1]} times the noise."] if named else []
    )
    if left:
        parts.append(f"No effect of the catalogue explains what remains: {left}.")
    elif beyond:
        parts.append(f"{beyond}.")
    elif not named:
        parts.append(f"Nothing in the rows exceeds their scatter (error {errors[1]} times the noise).")
    return " ".join(parts)


def other_shape(ratio: float | None) -> str:
    """Return that the equation of ISO 6358 leaves more than the scatter of the rows."""
    return f"C, b and m of each opening leave {format_noise_ratio(ratio)} times the scatter of neighbouring rows"


def other_characteristics(m: tuple[float, float, float], ratio: float | None) -> str:
    """Return what C, b and m of each command achieve where one b for all commands does not suffice."""
    low, high = (format_number(one, 3) for one in (m[1], m[2]))
    return (
        f"What remains is described by C, b and m of each opening, which identify gives (m {low} to {high} where the "
        f"simulation has 0.5): they leave {format_noise_ratio(ratio)} times the noise"
    )


def undetermined_sentence() -> str:
    """Return why no statement is possible about rows that are choked throughout."""
    return (
        "No statement is possible: the rows do not determine the critical ratio, and none has the valve closed, so "
        "neither another flow function nor a leak could show."
    )


def next_rows(*, ratio: bool, closed: bool) -> str | None:
    """Return which rows to record next; None where none is missing."""
    wanted = ["five and more downstream pressures between 0.3 and 0.98 of the upstream one at each command"] * ratio
    wanted += ["a row with the valve closed"] * closed
    return f"record {' and '.join(wanted)}" if wanted else None


def effect_reason(title: str, *, named: bool, before: float | None, after: float | None) -> str:
    """Return why an effect that was fitted to rows of steady flow is named or not."""
    if not named:
        return f"{title}. The improvement is no larger than chance."
    errors = [format_noise_ratio(one) for one in (before, after)]
    return f"{title}: with it the error goes from {errors[0]} to {errors[1]} times the noise."
