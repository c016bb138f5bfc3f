"""Scenarios of the closed loop: reference, load, supply and sensor dropouts over time."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pneucli.arrays import Array
from pneucli.closed_loop.simulation import Scenario
from pneucli.controller import layout
from pneucli.controller.parameters import Controller, nominal_load
from pneucli.design.bandwidths import chamber_2_pressure
from pneucli.errors import InputError, require_known
from pneucli.messages.formatting import format_plain
from pneucli.units import read_quantity

Recorded = Mapping[str, tuple[Array, Array]]
PRESSURE_SUFFIX = ", pressure"  # behind a recording's name: what was asked of its pressure

UNITS = {
    "duration": "s",
    "centre": "m",
    "amplitude": "m",
    "points": "m",
    "frequency": "Hz",
    "dwell": "s",
    "load": "N",
    "load_from": "s",
    "load_to": "s",
    "supply_drop": "Pa",
    "supply_from": "s",
    "supply_to": "s",
    "lost_from": "s",
    "lost_to": "s",
    "commission": "s",
}
TEXT_KEYS = ("name", "reference", "recording", "lost", "control")
REFERENCES = ("hold", "steps", "points", "sine", "s-curve", "recorded")
CONTROLS = ("position", "pressure")
PRESSURE_KEYS = ("centre", "amplitude", "points")  # in Pa where the pressure is controlled

# what is run where the pipeline file states nothing; absent sizes follow from the rig, see below
DEFAULTS: tuple[dict[str, Any], ...] = (
    {"name": "steps", "reference": "steps", "duration": 8.0},
    {"name": "sine", "reference": "sine", "frequency": 0.5, "duration": 6.0},
    {"name": "s-curve", "reference": "s-curve", "duration": 5.0},
    {"name": "load", "reference": "hold", "load_from": 1.0, "load_to": 3.5, "duration": 6.0},
    {
        "name": "supply-drop",
        "reference": "steps",
        "supply_from": 1.5,
        "supply_to": 5.0,
        "duration": 8.0,
    },
    {"name": "sensor-dropout", "reference": "steps", "lost": "p1", "lost_from": 3.2, "lost_to": 3.3, "duration": 8.0},
    {"name": "points", "reference": "points", "dwell": 1.5, "duration": 8.0},
    {"name": "pressure", "control": "pressure", "reference": "steps", "dwell": 1.5, "duration": 6.0},
)
MAX_SAMPLES = 10_000_000  # samples of a scenario
CENTRE, AMPLITUDE = 0.5, 0.15  # of the stroke: what a closed chamber's air spring allows
POINTS = (0.5, 0.515, 0.44, 0.4385, 0.62)  # of the stroke: long ways and short ones
SUPPLY_DROP_FRACTION = 1.0 / 6.0  # of the supply above ambient pressure
PRESSURE_STEP_FRACTION = 0.1  # of the same, up and down: of a pressure that is asked for


def read_scenarios(
    tables: Sequence[Mapping[str, Any]], controller: Controller, where: str, recorded: Recorded | None = None
) -> list[Scenario]:
    """Return the scenarios of ``[[scenarios]]`` tables, or the default ones without a table.

    Args:
        tables: Tables of the pipeline file.
        controller: The controller, whose limits give the default sizes.
        where: File and key, for messages.
        recorded: Time (s) and reference (m) of recordings by name; of pressures (Pa) by name and ``PRESSURE_SUFFIX``.

    Raises:
        InputError: A key or value cannot be read.

    """
    found = []
    for i, table in enumerate(tables or DEFAULTS):
        values = read_scenario(table, f"{where}[{i}]")
        found.append(_scenario(values, controller, recorded or {}, f"{where}[{i}]"))
    return found


def read_scenario(table: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return a table of ``[[scenarios]]`` in SI; raises InputError for a key or value that cannot be read."""
    values: dict[str, Any] = {"reference": "steps", "control": "position"}
    pressed = table.get("control") == "pressure"
    for key, value in table.items():
        values[key] = _read(key, value, "Pa" if pressed and key in PRESSURE_KEYS else UNITS.get(key, ""), where)
    for key, known in (("reference", REFERENCES), ("control", CONTROLS)):
        require_known([values[key]], known, f"{where}.{key}", code="E023")
    for key in ("duration", "dwell", "frequency"):
        if not values.get(key, 1.0) > 0.0:
            raise InputError(f"{where}.{key}", f"{format_plain(values[key])}", "above 0", code="E023")
    if values.get("lost", "x") not in ("x", "p1", "p2"):
        raise InputError(f"{where}.lost", f'"{values["lost"]}"', '"x", "p1" or "p2"', code="E023")
    return values


def _read(key: str, value: Any, unit: str, where: str) -> Any:
    """Return one entry in SI; raises InputError where it cannot be read."""
    if key in TEXT_KEYS:
        if not isinstance(value, str):
            raise InputError(f"{where}.{key}", f"{value}", "a text", code="E023")
        return value
    require_known([key], [*TEXT_KEYS, *UNITS], f"{where}.{key}", "unknown key", code="E021")
    several = value if key == "points" and isinstance(value, list) and value else [value]
    found = [read_quantity(one, unit, f"{where}.{key}", difference=key == "supply_drop") for one in several]
    return found if key == "points" else found[0]


def _scenario(values: Mapping[str, Any], controller: Controller, recorded: Recorded, where: str) -> Scenario:
    c = controller.values
    duration = values.get("duration", 6.0)
    if duration > MAX_SAMPLES * controller.period:
        found = f"{format_plain(duration)} s in steps of {format_plain(controller.period)} s"
        raise InputError(f"{where}.duration", found, f"at most {MAX_SAMPLES} steps", "shorten it", code="E023")
    time = np.arange(0.0, duration, controller.period)
    pressed = values["control"] == "pressure"
    reference = _reference(values, time, _sizes(values, c, pressed), recorded, where)
    x, p1, p2 = equilibrium_at(c, CENTRE * c["C_STROKE"] if pressed else float(reference[0]))
    given = "load" in values or "load_from" in values or "load_to" in values
    load = values.get("load", -nominal_load(c)) * _between(time, values, "load") * given
    given = any(key in values for key in ("supply_drop", "supply_from", "supply_to"))
    drop = values.get("supply_drop", SUPPLY_DROP_FRACTION * (c["C_SUPPLY"] - c["C_AMBIENT"])) * given
    supply = c["C_SUPPLY"] - drop * _between(time, values, "supply")
    lost = ((values["lost"], values.get("lost_from", 1.0), values.get("lost_to", 1.05)),) if "lost" in values else ()
    name = values.get("name", values["reference"])
    mode = None
    if "commission" in values:
        mode = np.zeros(time.size)
        mode[(time >= values["commission"]).argmax()] = layout.OPERATING_MODES.index("commission")
    return Scenario(name, reference, load, supply, (x, p1, p2), lost, pressed, operating_mode=mode)


def _sizes(values: Mapping[str, Any], c: Mapping[str, float], pressed: bool) -> dict[str, Any]:
    """Return centre, amplitude, points and duration: stated ones, else such as suit the rig.

    A sine is no faster than the largest speed of the reference, an S-curve lasts as long as it needs.
    """
    if pressed:
        _, middle, _ = equilibrium_at(c, CENTRE * c["C_STROKE"])
        size = PRESSURE_STEP_FRACTION * (c["C_SUPPLY"] - c["C_AMBIENT"])
        usual = {"centre": middle, "amplitude": size, "points": [middle, middle + size, middle - size]}
        return usual | {key: values[key] for key in PRESSURE_KEYS if key in values}
    stroke, fastest = c["C_STROKE"], c["C_V_MAX"]
    amplitude = values.get("amplitude", AMPLITUDE * stroke)
    if values["reference"] == "sine" and "amplitude" not in values:
        amplitude = min(amplitude, fastest / (2 * np.pi * values.get("frequency", 0.5)))
    usual = {"centre": CENTRE * stroke, "amplitude": amplitude, "points": [share * stroke for share in POINTS]}
    usual["way"] = max(1.5, 1.875 * 2 * amplitude / fastest)
    return usual | {key: values[key] for key in PRESSURE_KEYS if key in values}


def equilibrium_at(c: Mapping[str, float], x: float) -> tuple[float, float, float]:
    """Return x (m) and the pressures (Pa) of the piston in equilibrium at x, without friction."""
    p2 = float(chamber_2_pressure(c, np.array([x]))[0])
    p1 = (c["C_AREA_2"] * p2 + (c["C_AREA_1"] - c["C_AREA_2"]) * c["C_AMBIENT"]) / c["C_AREA_1"]
    return x, p1, p2


def _between(time: Array, values: Mapping[str, Any], what: str) -> Array:
    begin, end = values.get(f"{what}_from", 1.0), values.get(f"{what}_to", np.inf)
    return np.asarray((time >= begin) & (time < end), dtype=np.float64)


def _reference(
    values: Mapping[str, Any], time: Array, sizes: Mapping[str, Any], recorded: Recorded, where: str
) -> Array:
    """Return the reference in m, or in Pa for pressure control; each begins with half a second at rest."""
    centre, amplitude = sizes["centre"], sizes["amplitude"]
    moving = np.maximum(time - 0.5, 0.0)
    kind = values["reference"]
    if kind == "sine":
        return np.asarray(centre + amplitude * np.sin(2 * np.pi * values.get("frequency", 0.5) * moving))
    if kind in ("steps", "points"):
        steps = centre + amplitude * np.array([0.0, 1.0, -1.0, 0.0])
        points = np.asarray(steps if kind == "steps" else sizes["points"])
        place = np.minimum(np.ceil(moving / values.get("dwell", 2.5)).astype(int), points.size - 1)
        return np.asarray(points[place])
    if kind == "s-curve":
        s = np.clip(moving / values.get("dwell", sizes.get("way", 1.5)), 0.0, 1.0)
        return np.asarray(centre - amplitude + 2 * amplitude * s**3 * (10 - 15 * s + 6 * s * s))
    if kind == "recorded":
        return _recorded(values, time, recorded, where)
    return np.full(time.size, centre)


def _recorded(values: Mapping[str, Any], time: Array, recorded: Recorded, where: str) -> Array:
    """Return the recorded reference, or the recorded signal, constant beyond its ends."""
    name = values.get("recording", "")
    pressed = values["control"] == "pressure"
    known = {
        key.removesuffix(PRESSURE_SUFFIX): v for key, v in recorded.items() if key.endswith(PRESSURE_SUFFIX) == pressed
    }
    wanted = "a recording with p_ref or p1" if pressed else "a recording with x_ref or x"
    require_known([name], known, f"{where}.recording", wanted=wanted, code="E091")
    at, asked = known[name]
    return np.asarray(np.interp(time, at - at[0], asked))
