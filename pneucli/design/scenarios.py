"""Scenarios of the closed loop: what the reference, the load, the supply and the sensors do over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.design.cascade import spring_pressure
from pneucli.design.closed_loop import Scenario
from pneucli.design.controller import Controller
from pneucli.errors import InputError, UnitError, did_you_mean
from pneucli.units import parse_quantity

Array = NDArray[np.float64]
Recorded = Mapping[str, tuple[Array, Array]]

UNITS = {
    "duration": "s",
    "centre": "m",
    "amplitude": "m",
    "frequency": "1/s",
    "dwell": "s",
    "load": "N",
    "load_from": "s",
    "load_to": "s",
    "supply_drop": "Pa",
    "supply_from": "s",
    "supply_to": "s",
    "lost_from": "s",
    "lost_to": "s",
}
TEXTS = ("name", "reference", "recording", "lost")
REFERENCES = ("hold", "steps", "sine", "s-curve", "recorded")

# what is run where the pipeline file states nothing; amplitudes and centre as shares of the stroke below
DEFAULTS: tuple[dict[str, Any], ...] = (
    {"name": "steps", "reference": "steps", "duration": 8.0},
    {"name": "sine", "reference": "sine", "frequency": 0.5, "duration": 6.0},
    {"name": "s-curve", "reference": "s-curve", "duration": 5.0},
    {"name": "load", "reference": "hold", "load": -50.0, "load_from": 1.0, "load_to": 3.5, "duration": 6.0},
    {
        "name": "supply-drop",
        "reference": "steps",
        "supply_drop": 1e5,
        "supply_from": 1.5,
        "supply_to": 5.0,
        "duration": 8.0,
    },
    {"name": "sensor-dropout", "reference": "steps", "lost": "p1", "lost_from": 3.2, "lost_to": 3.3, "duration": 8.0},
)
LONGEST = 10_000_000  # samples of a scenario
CENTRE, AMPLITUDE = 0.5, 0.15  # of the stroke: what a closed chamber's air spring allows


def scenarios_from(
    tables: Sequence[Mapping[str, Any]], controller: Controller, where: str, recorded: Recorded | None = None
) -> list[Scenario]:
    """Return the scenarios of ``[[scenarios]]`` tables, or the default ones where there is none.

    ``recorded`` holds time (s) and reference (m) of recordings by name. Raises InputError for what cannot be read.
    """
    found = []
    for i, table in enumerate(tables or DEFAULTS):
        values = read_table(table, f"{where}[{i}]")
        found.append(_scenario(values, controller, recorded or {}, f"{where}[{i}]"))
    return found


def read_table(table: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return a table of ``[[scenarios]]`` in SI; raises InputError for a key or value that cannot be read."""
    values: dict[str, Any] = {"reference": "steps"}
    for key, value in table.items():
        if key in TEXTS:
            if not isinstance(value, str):
                raise InputError(f"{where}.{key}", f"{value}", "a text")
            values[key] = value
        elif key in UNITS:
            try:
                values[key] = parse_quantity(value, UNITS[key], difference=key == "supply_drop")
            except UnitError as error:
                raise InputError(f"{where}.{key}", str(error), f'a quantity such as "1 {UNITS[key]}"') from error
        else:
            raise InputError(f"{where}.{key}", "unknown key", mend=did_you_mean(key, [*TEXTS, *UNITS]))
    if values["reference"] not in REFERENCES:
        raise InputError(
            f"{where}.reference", f'"{values["reference"]}"', mend=did_you_mean(values["reference"], REFERENCES)
        )
    for key in ("duration", "dwell", "frequency"):
        if not values.get(key, 1.0) > 0.0:
            raise InputError(f"{where}.{key}", f"{values[key]:g}", "above 0")
    if values.get("lost", "x") not in ("x", "p1", "p2"):
        raise InputError(f"{where}.lost", f'"{values["lost"]}"', '"x", "p1" or "p2"')
    return values


def _scenario(values: Mapping[str, Any], controller: Controller, recorded: Recorded, where: str) -> Scenario:
    c = controller.values
    duration = values.get("duration", 6.0)
    if duration > LONGEST * controller.period:
        found = f"{duration:g} s in steps of {controller.period:g} s"
        raise InputError(f"{where}.duration", found, f"at most {LONGEST} steps", "shorten it")
    time = np.arange(0.0, duration, controller.period)
    reference = _reference(values, time, c["C_STROKE"], recorded, where)
    load = values.get("load", 0.0) * _between(time, values, "load")
    supply = c["C_SUPPLY"] - values.get("supply_drop", 0.0) * _between(time, values, "supply")
    lost = ((values["lost"], values.get("lost_from", 1.0), values.get("lost_to", 1.05)),) if "lost" in values else ()
    return Scenario(
        values.get("name", values["reference"]), reference, load, supply, start_at(c, float(reference[0])), lost
    )


def start_at(c: Mapping[str, float], x: float) -> tuple[float, float, float]:
    """Return x (m) and the pressures (Pa) that hold the piston there against the air spring, friction aside."""
    p2 = float(spring_pressure(c, np.array([x]))[0])
    p1 = (c["C_AREA_2"] * p2 + (c["C_AREA_1"] - c["C_AREA_2"]) * c["C_AMBIENT"]) / c["C_AREA_1"]
    return x, p1, p2


def _between(time: Array, values: Mapping[str, Any], what: str) -> Array:
    begin, end = values.get(f"{what}_from", 1.0), values.get(f"{what}_to", np.inf)
    return np.asarray((time >= begin) & (time < end), dtype=np.float64)


def _reference(values: Mapping[str, Any], time: Array, stroke: float, recorded: Recorded, where: str) -> Array:
    """Return the reference in m; each begins with half a second at rest."""
    centre, amplitude = values.get("centre", CENTRE * stroke), values.get("amplitude", AMPLITUDE * stroke)
    moving = np.maximum(time - 0.5, 0.0)
    kind = values["reference"]
    if kind == "sine":
        return np.asarray(centre + amplitude * np.sin(2 * np.pi * values.get("frequency", 0.5) * moving))
    if kind == "steps":
        pattern = np.array([0.0, 1.0, -1.0, 0.0])
        place = np.minimum(np.ceil(moving / values.get("dwell", 2.5)).astype(int), 3)
        return np.asarray(centre + amplitude * pattern[place])
    if kind == "s-curve":
        s = np.clip(moving / values.get("dwell", 1.5), 0.0, 1.0)
        return np.asarray(centre - amplitude + 2 * amplitude * s**3 * (10 - 15 * s + 6 * s * s))
    if kind == "recorded":
        name = values.get("recording", "")
        if name not in recorded:
            raise InputError(
                f"{where}.recording", f'"{name}"', "a recording with x_ref or x", did_you_mean(name, recorded)
            )
        at, known = recorded[name]
        return np.asarray(np.interp(time, at - at[0], known))
    return np.full(time.size, centre)
