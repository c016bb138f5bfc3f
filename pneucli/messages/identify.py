"""The identified parameters with their intervals."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages import labelled, table, warnings
from pneucli.messages.flow import flow_lines
from pneucli.messages.formatting import (
    format_interval,
    format_noise_ratio,
    format_number,
    format_percent,
    format_quantity,
    join_names,
    unit_symbol,
)

INTERVAL_MEANING = (
    "Intervals are the value ± the expanded uncertainty (k = 2, GUM) of all sources of the budget; where the thermal "
    "state of the gas is open, they hold for every state between no heat and the most that the wall can give or take."
)
CONDUCTANCE = "sonic_conductance("
ISO_COLUMNS = ("command", "C (ISO 6358)", "b", "m")
FRICTION_COLUMNS = ("recording", "p1", "kinetic friction", "break-away")
LITRES_PER_BAR = 1e8  # l/(s bar) in m^3/(s Pa)


def lines(answer: Mapping[str, Any], file: str, verbose: bool) -> Iterator[str]:
    """Yield the model, its parameters, warnings, and what to do next."""
    model = answer["model"]
    effects = ", ".join(model["effects"])
    flow = answer.get("flow")
    listed = {n: p for n, p in model["parameters"].items() if flow is None or n not in flow["parameters"]}
    if listed or flow is None:
        yield from labelled(
            "found", f"{len(listed)} parameters of the base model{f' with {effects}' if effects else ''}"
        )
        rows = [(name, format_interval(p["value"], p["unit"], p["ci95"])) for name, p in listed.items()]
        yield from table(("parameter", "value, 95 % interval"), rows, texts=2)
    if flow is not None:
        openings = len(flow["paths"])
        yield from labelled("flow", f"{openings} flow path{'s' if openings > 1 else ''} of a steady bench")
        yield from flow_lines(flow)
    for one in answer["assumed"]:
        yield from labelled("assumed", f"{one['what']} (to state it: {one['instead']})")
    for label in ("valve", "valve_2"):
        if valve := answer.get(label):
            yield from labelled(label.replace("_", " "), _valve(valve))
            if by_command := iso_rows(valve["iso"], label):
                yield from table(ISO_COLUMNS, by_command, texts=4)
    for line in uncertainty_lines(answer.get("uncertainty", {})):
        yield from labelled("budget", line)
    friction = answer.get("friction", {})
    if by_recording := friction_rows(friction):
        yield from table(FRICTION_COLUMNS, by_recording, texts=4)
    for name, texts in (("friction", friction_lines(friction)), ("leak", leak_lines(answer.get("leaks", {})))):
        for one in texts:
            yield from labelled(name, one)
    yield from warnings(answer)
    yield from labelled("do", f"pneucli compare {file}")


def _valve(valve: Mapping[str, Any]) -> str:
    """Return how well the measured map follows its curves, and the model the map."""
    residual, lack = valve["residual"], valve["lack_of_fit"]
    if valve["map"] == "model":
        clause = _lack_of_fit_clause(lack, "measured gradients")
        return f"no vessel was filled: the map is that of the model's valve, which{clause}"
    held = "" if residual["test"] is None else f", {format_noise_ratio(residual['test'])} × noise on held-out ones"
    text = f"the measured map leaves {format_noise_ratio(residual['train'])} × noise on its curves{held}"
    if lack["median"] is None:
        return f"{text}; no command was covered"
    return f"{text}; the model's valve{_lack_of_fit_clause(lack, 'it')}"


def _lack_of_fit_clause(lack: Mapping[str, Any], what: str) -> str:
    if lack["median"] is None:
        return f" cannot be compared with {what}: there are no points with flow"
    off = f"{format_percent(lack['median'])} in the median, {format_percent(lack['p95'])} at the 95th percentile"
    return f" is off {what} by {off}, outside both intervals at {format_percent(lack['share_outside'])}"


def iso_rows(iso: Mapping[str, Any], label: str) -> list[tuple[str, ...]]:
    """Return the characteristics of ISO 6358 by command: command, C, b, m."""
    rows: list[tuple[str, ...]] = []
    for name in [name for name in iso if name.startswith(f"{label}.sonic_conductance(")]:
        of = "(" + name.partition("(")[2]
        c, b, m = (iso[f"{label}.{figure}{of}"] for figure in ("sonic_conductance", "critical_ratio", "subsonic_index"))
        ends = [None if end is None else LITRES_PER_BAR * end for end in c["ci95"]]
        shown = format_interval(LITRES_PER_BAR * c["value"], "l/(s bar)", ends)
        rows.append((of.strip("()"), shown, *(format_interval(v["value"], "1", v["ci95"]) for v in (b, m))))
    return rows


def friction_rows(friction: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Return friction by recording: its name, the pressure, kinetic friction, break-away."""
    kinetic = {k["recording"]: k for k in friction.get("kinetic", [])}
    broken = {b["recording"]: b for b in friction.get("breakaway", [])}
    rows: list[tuple[str, ...]] = []
    for name in {**kinetic, **broken}:
        level, away = kinetic.get(name), broken.get(name)
        p1 = level["pressures"].get("p1") if level else None
        sliding = format_interval(level["friction"], level["unit"], level["ci95"]) if level else "–"
        held = f"{format_interval(away['value'], away['unit'], away['ci95'])} ({away['count']} ×)" if away else "–"
        rows.append((name, format_quantity(p1, "Pa", 3), sliding, held))
    return rows


def friction_lines(friction: Mapping[str, Any]) -> Iterator[str]:
    """Yield how friction grows with pressure, and how far recordings agree."""
    if line := friction.get("over_pressure"):
        at_ambient, slope = line["at_ambient"], line["slope"]
        unit, ends = at_ambient["unit"], [1e5 * end for end in slope["ci95"]]
        growth = format_interval(1e5 * slope["value"], f"{unit_symbol(unit)}/bar", ends)
        force = format_interval(at_ambient["value"], unit, at_ambient["ci95"])
        yield f"kinetic, over p1 above ambient: {force} + {growth}"
    for one in friction.get("repeats", []):
        force, spread = format_quantity(one["friction"], one["unit"], 3), format_percent(one["spread"])
        recordings = join_names(one["recordings"])
        yield f"{recordings}, at one pressure and speed: {force} with a standard deviation of {spread}"


def leak_lines(leaks: Mapping[str, Any]) -> Iterator[str]:
    """Yield what shut chambers lost, what that is as a flow, and what an area takes for granted of heat."""
    for one in leaks.get("lost", []):
        of = "" if one["volume_known"] else " for each litre of volume"
        yield (
            f"{one['recording']}: {format_quantity(one['start'], 'Pa')} to {format_quantity(one['end'], 'Pa')} in "
            f"{format_number(one['seconds'], 3)} s, {format_number(one['percent'], 2)} %/s of the pressure above "
            f"ambient at first; in the mean {format_number(one['isothermal'], 3)} l/min ANR{of} if the gas kept the "
            f"wall's temperature, {format_number(one['adiabatic'], 3)} if it took none of its heat"
        )
    for one in leaks.get("flows", []):
        of = "" if one["volume_known"] else " for each litre of volume"
        text = f"{one['effect']}: {format_number(one['flow'], 3)} {one['unit']}{of}"
        yield f"{text} from {format_quantity(one['pressure'], 'Pa', 3)} to ambient"
    for one in leaks.get("areas", []):
        isothermal, adiabatic = (format_quantity(one[name], one["unit"]) for name in ("isothermal", "adiabatic"))
        yield (
            f"{one['name']} goes with the exponent {format_number(one['exponent'], 3)} ([rig] thermal): {isothermal} "
            f"if the gas keeps the wall's temperature, {adiabatic} if it takes none of its heat"
        )


def largest_conductance(uncertainty: Mapping[str, Any]) -> tuple[str, Mapping[str, Any]] | None:
    """Return name and budget of the largest C; None without one."""
    named = [(name, one) for name, one in uncertainty.get("budgets", {}).items() if "sonic_conductance" in name]
    return max(named, key=lambda item: item[1]["value"], default=None)


def uncertainty_lines(uncertainty: Mapping[str, Any]) -> Iterator[str]:
    """Yield how well the largest C is known, and from where its uncertainty comes."""
    if (found := largest_conductance(uncertainty)) is None:
        return
    name, budget = found
    at = f" at {name.partition('(')[2].rstrip(')')}" if "(" in name else ""
    text = f"C{at} is known to ± {format_number(100.0 * budget['expanded'] / budget['value'], 2)} % (k = 2)"
    certain = [one for one in budget["sources"] if not one["bound"]]
    variance = sum(one["contribution"] ** 2 for one in certain)
    if variance > 0.0:
        main = max(certain, key=lambda one: one["contribution"])
        share = format_percent(main["contribution"] ** 2 / variance)
        text += f"; main source: {main['source']} (type {main['type']}, {share} of the variance)"
    if (factors := thermal_factors(budget)) is not None:
        least, largest = (format_number(factor, 3) for factor in factors)
        text += f"; the heat of the wall may make it {least} to {largest} × as large"
    if missing := budget["calibration_not_stated"]:
        text += f"; no calibration is stated for {', '.join(missing)}"
    yield text


def thermal_factors(budget: Mapping[str, Any]) -> tuple[float, float] | None:
    """Return the least and the largest factor on C for the heat of the wall; None where the model knows that heat."""
    return next((tuple(one["factors"]) for one in budget["sources"] if one["factors"]), None)
