"""The variables of the FMU: inputs, outputs, parameters with their units and intervals, start values."""

from __future__ import annotations

import math
import sys
import tomllib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib.resources import files
from typing import Literal

import numpy as np

from pneucli.export.fmu.plant import Plant
from pneucli.figure import Figure
from pneucli.physics.declaration import Parameter
from pneucli.quantities import PISTON_AREA_UNITS, axis_unit
from pneucli.simulate import layout as at

FIRST_INPUT, FIRST_OUTPUT, FIRST_VALUE = 1, 11, 100  # value references, as in templates/plant_core.h
AXIS_ONLY = ("friction.", "rig.moving_mass", "rig.piston", "rig.stroke", "rig.dead_volume_2", "rig.lower", "rig.upper")
_TABLES = tomllib.loads(files("pneucli.export.fmu").joinpath("variables.toml").read_text(encoding="utf-8"))
BASE, INPUT_TITLES, OUTPUT_TITLES, START_TITLES = (_TABLES[name] for name in ("base", "input", "output", "start"))
RANGES = {
    "any": (-math.inf, math.inf),
    "not negative": (0.0, math.inf),
    "positive": (sys.float_info.min, math.inf),  # the smallest number that is not 0 in any importer
    "ratio": (0.0, 1.0),
    "from 1": (1.0, math.inf),
}
OF_CYLINDER = ("x", "v", "a", "p2", "chamber_2.p")


@dataclass(frozen=True)
class Variable:
    """A variable of the FMU; ``start`` is None for an output, ``identified`` for what is not identified.

    A parameter outside ``lowest`` to ``highest`` is refused.
    """

    name: str
    reference: int
    kind: Literal["input", "output", "parameter"]
    unit: str
    title: str
    start: float | None = None
    identified: Figure | None = None
    lowest: float = -math.inf
    highest: float = math.inf

    @property
    def description(self) -> str:
        """The meaning, and the interval of what was identified."""
        if (one := self.identified) is None:
            return self.title
        return f"{self.title}; identified, 95 % interval {one.low:.6g} to {one.high:.6g}"


def variables_of(plant: Plant) -> list[Variable]:
    """Return the variables of a plant, those that act on it, in the order of their value references."""
    return [*_inputs(plant), *_outputs(plant), *(v for v in all_values(plant) if _is_shown(v.name, plant))]


def all_values(plant: Plant) -> list[Variable]:
    """Return every parameter in the order of the plant's array of values: base, effects, start, step, valve."""
    named: list[tuple[str, str, str, float, tuple[float, float]]] = [
        (name, _base_unit(name), BASE[name][1], float(value), RANGES[BASE[name][2]])
        for name, value in zip(at.BASE_NAMES, plant.base, strict=True)
    ]
    named += [
        (f"{e.name}.{p.name}", p.unit, _title(p), plant.th[f"{e.name}.{p.name}"], _range(p))
        for e in plant.effects
        for p in e.parameters
    ]
    for n, v in plant.start.items():
        unit, title, kind = START_TITLES[n]
        named.append((f"start.{n}", axis_unit(unit), title, v, RANGES[kind]))
    named.append(("solver.max_step", "s", "longest step of the equations", plant.max_step, RANGES["positive"]))
    for i in (1, 2):
        title = f"factor on the areas of the valve at chamber {i}"
        named.append((f"valve.area_factor_{i}", "1", title, 1.0, RANGES["not negative"]))
    return [
        Variable(
            *(name, FIRST_VALUE + i, "parameter", unit, title, value),
            Figure(value, *plant.intervals[name], unit) if name in plant.intervals else None,
            *(min(low, value), max(high, value)),  # what the rig states is within its range
        )
        for i, (name, unit, title, value, (low, high)) in enumerate(named)
    ]


def _inputs(plant: Plant) -> Iterator[Variable]:
    for name, start in plant.inputs.items():
        unit, title = INPUT_TITLES[name]
        yield Variable(name, FIRST_INPUT + at.PLANT_INPUTS.index(name), "input", axis_unit(unit), title, start)


def _outputs(plant: Plant) -> Iterator[Variable]:
    for i, name in enumerate(at.PLANT_OUTPUTS):
        if plant.has_cylinder or name not in OF_CYLINDER:
            unit, title = OUTPUT_TITLES[name]
            yield Variable(name, FIRST_OUTPUT + i, "output", axis_unit(unit), title)


def _is_shown(name: str, plant: Plant) -> bool:
    """Return whether a parameter acts on the plant."""
    heat = any("heat" in effect.ports for effect in plant.effects)
    two = plant.flags[at.CHAMBER_2] in (at.VALVE_2, at.MIRRORED)
    hidden = {
        "rig.wall_temperature": not heat,
        "rig.polytropic_exponent": heat,
        "rig.supply_pressure": "p_supply" in plant.inputs,
        "valve.area_factor_2": not two,
        "start.u2": not two,
        "start.p2": plant.flags[at.CHAMBER_2] == at.OPEN,
        "start.x": not plant.has_cylinder,
        "start.v": not plant.has_cylinder,
    }
    return not hidden.get(name, False) and (plant.has_cylinder or not name.startswith(AXIS_ONLY))


def _base_unit(name: str) -> str:
    """Return the unit of a base parameter on the current axis."""
    unit = axis_unit(BASE[name][0])
    rotary = axis_unit("m") != "m"
    return PISTON_AREA_UNITS[1] if rotary and name.startswith("rig.piston_area") else unit


def _range(parameter: Parameter) -> tuple[float, float]:
    """Return the bounds that the declaration states as numbers, with the value at which the effect vanishes.

    A bound in a scale of the rig is that of a search, of which the sign is kept.
    """
    low, high = parameter.lower, parameter.upper
    bounds = [
        (-math.inf if low.startswith("-") else 0.0) if isinstance(low, str) else low,
        math.inf if isinstance(high, str) else high,
    ]
    bounds += [parameter.null] if isinstance(parameter.null, float | int) else []
    return min(bounds), max(bounds)


def _title(parameter: Parameter) -> str:
    return parameter.title or parameter.name.replace("_", " ")


def c_tables(plant: Plant) -> str:
    """Return the numbers of the plant as C."""
    inputs = [plant.inputs.get(name, 0.0) for name in at.PLANT_INPUTS]
    same = np.array_equal(plant.areas, plant.areas_2)
    values = all_values(plant)
    names = "\n".join(f'    "{v.name}",' for v in values)
    parts = [
        _array("VALUES", [float(v.start or 0.0) for v in values]),
        _array("LOWEST", np.clip([v.lowest for v in values], -sys.float_info.max, sys.float_info.max)),
        _array("HIGHEST", np.clip([v.highest for v in values], -sys.float_info.max, sys.float_info.max)),
        f"static const char *const NAMES[{len(values)}] = {{\n{names}\n}};",
        _array("INPUTS", inputs),
        _array("FLAGS", plant.flags),
        _array("ON", [1.0] * (len(plant.effects) + 1)),
        _array("AREAS_1", plant.areas),
        "#define AREAS_2 AREAS_1" if same else _array("AREAS_2", plant.areas_2),
    ]
    return "\n".join([*parts, ""])


def _array(name: str, values: Iterable[float]) -> str:
    numbers = [repr(float(value)) for value in values]
    rows = [f"    {', '.join(numbers[i : i + 5])}," for i in range(0, len(numbers), 5)]
    return "\n".join([f"static const double {name}[{len(numbers)}] = {{", *rows, "};"])
