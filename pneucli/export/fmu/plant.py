"""The plant that is exported: the identified rig with its effects, its inputs, its start, and its parameters."""

import math
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from typing import Literal

import numpy as np

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.figure import Figure
from pneucli.physics.declaration import Effect, Parameter
from pneucli.quantities import PISTON_AREA_UNITS, axis_unit
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.kernel_settings import max_motion_step
from pneucli.simulate.model import Model
from pneucli.simulate.open_loop import SAMPLING_PERIOD, command_recording
from pneucli.simulate.preparation import prepare
from pneucli.simulate.run import area_tables, base_vector

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
Interval = tuple[float, float]

FAR = 1e9  # m: an end of the stroke that is nowhere; C has no literal for infinity
REFUSED_PORTS = dict.fromkeys(
    ("sensor_delay", "force_delay"), "it delays the recorder's channels against each other, not the plant"
)


@dataclass(frozen=True)
class Plant:
    """A plant with all its numbers, SI.

    Attributes:
        name: Name of the pipeline.
        effects: Effects that act, in the order of their parameters in ``th``.
        base: Base parameters in the order of :data:`pneucli.simulate.layout.BASE_NAMES`, shape (19,).
        th: Values by EFFECT.PARAMETER, in the unit of the catalogue.
        flags: Switches in the kernel's layout, shape (9,).
        areas: Effective areas in m^2 of the valve at chamber 1 over the command.
        areas_2: Those of chamber 2.
        max_step: Longest step of the equations in s.
        intervals: 95 % interval of identified parameters, by name.
    """

    name: str
    effects: tuple[Effect, ...]
    base: Array
    th: Mapping[str, float]
    flags: Array
    areas: Array
    areas_2: Array
    max_step: float
    intervals: Mapping[str, Interval]

    @property
    def has_cylinder(self) -> bool:
        """Whether there is a piston; otherwise the plant is the vessel of a valve test."""
        return bool(self.flags[at.MECHANICS] > 0.0)

    @property
    def inputs(self) -> dict[str, float]:
        """The inputs with their start, in the order of the layout: those that act on this plant."""
        null, supply = (float(self.base[at.BASE_NAMES.index(n)]) for n in ("valve.null", "rig.supply_pressure"))
        start = {"u": null, "u2": null, "p_supply": supply, "force": 0.0}
        acts = {
            "u2": self.flags[at.CHAMBER_2] == at.VALVE_2,
            "p_supply": self.flags[at.STATED_SUPPLY] == 0.0,
            "force": self.has_cylinder,
        }
        return {name: value for name, value in start.items() if acts.get(name, True)}

    @property
    def start(self) -> dict[str, float]:
        """The default start: at rest in mid-stroke at ambient pressure, the valve shut."""
        stroke, ambient = (float(self.base[at.BASE_NAMES.index(n)]) for n in ("rig.stroke", "rig.ambient_pressure"))
        centre = 0.5 * stroke if self.has_cylinder and math.isfinite(stroke) else 0.0
        return {"x": centre, "v": 0.0, "p1": ambient, "p2": ambient, "u": 0.0, "u2": 0.0}


def plant_of(
    name: str, model: Model, experiments: Sequence[Experiment], intervals: Mapping[str, Interval], where: str
) -> Plant:
    """Return the plant of an identified model.

    Args:
        name: Name of the pipeline.
        model: The identified model.
        experiments: Its experiments; those with the valve say what closes chamber 2, whether the supply pressure is an
            input, and where the ends of the stroke are.
        intervals: 95 % interval of identified parameters, by name.
        where: The place of the model in the pipeline file, for messages.

    Returns:
        The plant; an axis where the rig has a cylinder, else the vessel of its valve test.

    Raises:
        InputError: An effect cannot be exported.
    """
    kind = "axis" if model.rig.has_cylinder else "valve"
    own = [e for e in experiments if e.recording.kind.valve and e.recording.kind.vessel != model.rig.has_cylinder]
    imagined = _imagined(kind, model, own)
    flags = imagined.flags
    flags[at.U_MAX] = max(float(e.flags[at.U_MAX]) for e in experiments if e.recording.kind.valve)
    flags[at.STATED_SUPPLY] = float(all("p_supply" not in e.recording for e in own or experiments))
    acting = set((own[0] if own else imagined).active_effects(model.effects))
    effects = tuple(sorted((e for e in model.effects if e.name in acting), key=lambda e: (e.order, e.name)))
    for effect in effects:
        _require_exportable(effect, where)
    base = np.clip(base_vector(model, imagined), -FAR, FAR)
    supply = at.BASE_NAMES.index("rig.supply_pressure")
    if not math.isfinite(base[supply]):
        base[supply] = max(float(np.median(e.raw["p_supply"])) for e in own if "p_supply" in e.raw)
    values = model.effect_values()
    return Plant(
        name,
        effects,
        base,
        {f"{e.name}.{p.name}": values[f"{e.name}.{p.name}"] for e in effects for p in e.parameters},
        flags,
        *area_tables(model, imagined),
        min((e.max_step for e in own), default=max_motion_step(model.rig, SAMPLING_PERIOD)),
        intervals,
    )


def require_valve(experiments: Sequence[Experiment], where: str) -> None:
    """Raise InputError where no recording has a valve that lets gas through.

    Args:
        experiments: The experiments.
        where: The place of the recordings in the pipeline file.
    """
    if not any(e.recording.kind.valve and not e.recording.valve_shut for e in experiments):
        found = "no recording shows a valve that lets gas through: all are of friction, or of a valve that is shut"
        wanted = 'a recording with experiment = "valve" or "axis"'
        raise InputError(where, found, wanted, "add one under [[recordings]]", code="E071")


def _imagined(kind: str, model: Model, own: Sequence[Experiment]) -> Experiment:
    """Return an experiment at rest on this rig, with the ends of the stroke that the recordings show."""
    drives_both = model.rig.arrangement.drives_both
    stated = own[0].recording.chamber_2 if own else None
    chamber_2 = "valve" if drives_both else stated or "closed"
    command = np.full(10, model.rig.valve_null)
    about = {"experiment": kind, "chamber_2": chamber_2}
    limits = next((e.stroke_limits for e in own if e.stroke_limits is not None), None)
    return replace(prepare(command_recording(command, about, model.rig), model.rig, None), stroke_limits=limits)


def _require_exportable(effect: Effect, where: str) -> None:
    for port, reason in REFUSED_PORTS.items():
        if port in effect.ports:
            found = f'the effect "{effect.name}" cannot be exported: {reason}'
            raise InputError(
                where, found, "effects of the plant", f"pneucli remove PIPELINE {effect.name}", code="E064"
            )


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
        (f"{e.name}.{p.name}", p.unit, p.title or p.name.replace("_", " "), plant.th[f"{e.name}.{p.name}"], _range(p))
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
