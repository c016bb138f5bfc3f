"""A valve on a steady bench: its characteristics, and what its rows say that a valve does not explain."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from pneucli.messages import labelled, table
from pneucli.messages.formatting import (
    format_interval,
    format_noise_ratio,
    format_number,
    format_percent,
    format_plain,
    format_quantity,
)

FLOW_COLUMNS = ("command", "rows", "C (ISO 6358)", "b", "m", "cracking pressure", "× noise")
LITRES_PER_BAR = 1e8  # l/(s bar) in m^3/(s Pa)
LITRES_PER_MINUTE = 6e4 / 1.185  # l/min ANR in kg/s
STEADY_BENCH_LIMITS = (
    "a steady bench shows the flow function and leaks at a closed valve; effects of time (lag, delay, hysteresis, heat "
    "transfer) and of a cylinder cannot show"
)


def flow_finding(code: str, **values: Any) -> str:
    """Return a finding of :mod:`pneucli.identify.valve.flow_findings` by its code, with its numbers."""
    return f"{code}: {_TEXTS[code](**values)}"


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


def at_command(u: float | None) -> str:
    """Return the command in a sentence."""
    return "at the one opening" if u is None else f"at {format_plain(u)} V"


def _uphill(rows: int, of: int) -> str:
    return (
        f"in {rows} of {of} rows gas flows toward the higher pressure, as a pump or a compressor makes it: no area "
        "describes that; check whether p_supply and p1 are exchanged"
    )


def _pressure_loop(correlation: float, spread: float, varied: float, offset: float, gain: float, droop: float) -> str:
    falls = format_quantity(1000.0 * droop / LITRES_PER_MINUTE, "Pa", 2)
    law = (
        f"{format_quantity(offset, 'Pa', 3)} + {format_quantity(gain, 'Pa', 3)}/V · u, less {falls} for 1000 l/min ANR"
    )
    return (
        f"p1 follows the command (correlation {format_number(correlation, 3)}; {format_quantity(spread, 'Pa', 2)} rms "
        f"at each) while the flow varies by {format_percent(varied)}: the valve controls its outlet pressure to "
        f"{law}, as one with a pressure loop or a regulator does; its command does not set an "
        "area, and C, b and m do not describe it"
    )


def _scatters(u: float | None, share: float, low: float, high: float, ratio: float) -> str:
    flows = " and ".join(f"{format_number(LITRES_PER_MINUTE * one, 3)} l/min ANR" for one in (low, high))
    return (
        f"{at_command(u)} the flow differs by {format_percent(share)} rms from any function of the two pressures "
        f"(such as {flows} near a pressure ratio of {format_number(ratio, 2)}): something besides command and "
        "pressures sets it"
    )


def _idle(count: int, spread: float) -> str:
    return (
        f"the conductance is the same at {count} commands, within {format_percent(spread)}: the command does not set "
        "an area; check the column of u, or whether the component is a fixed orifice"
    )


def _against_pressure(u: float | None) -> str:
    return (
        f"{at_command(u)} the flow stays as large while the pressure difference vanishes, as that of a pump does: "
        "no area describes that"
    )


def _loops(share: float, half_width: float) -> str:
    return (
        f"a command that is reached from above lets through another flow than from below, by {format_percent(share)}: "
        f"hysteresis of the valve, about ± {format_number(half_width, 2)} V"
    )


def _at_no_difference(u: float | None, share: float) -> str:
    return (
        f"{at_command(u)} {format_percent(abs(share))} of the largest flow remains without a pressure difference: "
        "the zero of the flow meter, a zero of a pressure gauge, or a second way for the gas; "
        "record a row with the valve closed"
    )


def _not_followed(u: float | None, share: float, ratio: float) -> str:
    return (
        f"{at_command(u)} the curve has another shape than ISO 6358 gives it: {format_percent(share)} rms, "
        f"{format_number(ratio, 2)} × the scatter of neighbouring rows; the opening goes with the pressures, as "
        "that of a relief or a check valve does, or several restrictions act in series"
    )


def _cracking(u: float | None, pressure: tuple[float, float, float], count: int, paths: int) -> str:
    value, low, high = pressure
    where = "" if paths == 1 else f" at {count} of {paths} openings, {at_command(u).removeprefix('at ')} the most"
    opens = format_interval(float(value), "Pa", [float(low), float(high)])
    return f"nothing flows below a pressure difference of {opens}{where}: a check or a relief valve opens there"


_TEXTS: dict[str, Callable[..., str]] = {
    "flow-uphill": _uphill,
    "pressure-loop": _pressure_loop,
    "flow-hysteresis": _loops,
    "flow-scatters": _scatters,
    "command-idle": _idle,
    "flow-against-pressure": _against_pressure,
    "flow-at-no-difference": _at_no_difference,
    "curve-not-followed": _not_followed,
    "cracking-pressure": _cracking,
}


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


def idle_effects_warning(names: list[str]) -> str:
    """Return the warning about effects of the model that a steady bench does not have."""
    return (
        f"[model] effects {', '.join(names)}: they do not act on a steady bench, which has neither time nor a cylinder"
    )


def base_model_warning() -> str:
    """Return what the errors of a diagnosis of a steady bench are errors of."""
    return (
        "the errors here are those of the flow function that simulations have (b = 0.528 and m = 0.5 unless an effect "
        "changes it); identify and compare use C, b and m of each opening"
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
