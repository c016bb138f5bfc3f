"""The parameters that a fit varies: base friction, the valve's areas, unknown rig values, and the effects' own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneucli.physics.base import BASE
from pneucli.physics.declaration import Effect, Parameter
from pneucli.physics.scales import Facts
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.facts import facts_of
from pneucli.simulate.model import Model
from pneucli.simulate.valve_area import ValveArea

Array = NDArray[np.float64]

AREA = "valve.effective_area"
OVERLAPS = {"valve.overlap_fill": "overlap_fill", "valve.overlap_vent": "overlap_vent"}
GAIN = "valve.gain"
STEP = 1e-4  # of a parameter's scale, for differences
TINY = 1e-30  # stands for nothing where one divides or takes a logarithm
LARGEST_OVERLAP = 0.95  # of the smallest command with a knot


@dataclass(frozen=True)
class Free:
    """One free parameter. The fit sees (value - zero) / scale, or log(value) where ``logarithmic``.

    ``prior`` is a standard deviation around the start in the fit's own coordinate, inf where the data decide alone;
    ``step`` the difference in that coordinate from which derivatives are taken.
    """

    name: str
    unit: str
    start: float
    lower: float
    upper: float
    scale: float
    logarithmic: bool = False
    prior: float = np.inf
    step: float = STEP

    def inward(self, value: float) -> float:
        """Return the fit's coordinate of a value."""
        return float(np.log(value)) if self.logarithmic else value / self.scale

    def outward(self, z: float) -> float:
        """Return the value at a coordinate of the fit."""
        return float(np.exp(min(z, 700.0))) if self.logarithmic else z * self.scale

    def slope(self, value: float) -> float:
        """Return d value / d coordinate."""
        return value if self.logarithmic else self.scale


def area_name(command: float) -> str:
    """Return the parameter's name of the effective area at a command in V."""
    return f"{AREA}({command:+.4g} V)"


def value_of(model: Model, name: str) -> float:
    """Return the value of any parameter of a model by its name."""
    if name in OVERLAPS:
        return float(getattr(model.valve, OVERLAPS[name]))
    if name.startswith(AREA):
        names = [area_name(c) for c in model.valve.commands]
        return model.valve.areas[names.index(name)]
    if name == GAIN:
        return model.valve.areas[-1] / model.valve.commands[-1]
    return model.values[name] if name in model.values else model.base()[name]


def with_parameters(model: Model, values: dict[str, float]) -> Model:
    """Return the model with parameters of any kind replaced."""
    valve = model.valve
    areas = [values.get(area_name(c), a) for c, a in zip(valve.commands, valve.areas, strict=True)]
    if GAIN in values:
        areas = [values[GAIN] * abs(c) for c in valve.commands]
    fill, vent = (values.get(name, getattr(valve, field)) for name, field in OVERLAPS.items())
    rest = {n: v for n, v in values.items() if n not in OVERLAPS and n != GAIN and not n.startswith(AREA)}
    return replace(
        model.with_values(rest), valve=replace(valve, areas=tuple(areas), overlap_fill=fill, overlap_vent=vent)
    )


def base_parameters(model: Model, experiments: Sequence[Experiment], *, linear_valve: bool) -> list[Free]:
    """Return the base model's free parameters that these experiments can tell, starting from the model's values."""
    facts = facts_of(model, experiments)
    free: list[Free] = []
    moving = [e for e in experiments if e.recording.experiment != "valve"]
    driven = [e for e in experiments if e.flags[1] > 0 and not e.recording.valve_shut]
    if moving:
        free += [_base(name, value_of(model, name), facts) for name in ("friction.coulomb", "friction.viscous")]
        if model.rig.moving_mass is None:
            free.append(_base("rig.moving_mass", value_of(model, "rig.moving_mass"), facts))
    if driven:
        free += _valve(model, facts, linear_valve=linear_valve)
    return free


def _base(name: str, start: float, facts: Facts) -> Free:
    """Return a base parameter as declared, sized by its start; where that is nearly nothing, by what is plausible."""
    declared = BASE[name]
    size = declared.on(facts)
    start = max(start, size.lower, 1e-4 * size.typical[0] if size.typical else 1e-9)
    return Free(name, declared.unit, start, max(size.lower, 0.0), size.upper, start)


def _valve(model: Model, facts: Facts, *, linear_valve: bool) -> list[Free]:
    area = BASE[AREA].on(facts)
    lower = max(area.lower, TINY)
    if linear_valve:
        gain = value_of(model, GAIN)
        bounds = lower / facts.command, area.upper / facts.command
        return [Free(GAIN, "m^2/V", gain, *bounds, 1.0, logarithmic=True)]
    valve = model.valve
    areas = [
        Free(area_name(c), "m^2", a, lower, area.upper, 1.0, logarithmic=True)
        for c, a in zip(valve.commands, valve.areas, strict=True)
    ]
    lowest = min((abs(c) for c in valve.commands), default=0.0)
    overlap = BASE["valve.overlap"].on(facts)
    overlaps = [
        Free(
            name,
            "V",
            getattr(valve, field),
            overlap.lower,
            LARGEST_OVERLAP * lowest,
            overlap.typical[0] if overlap.typical else lowest,
            prior=10.0,
        )
        for name, field in OVERLAPS.items()
    ]
    return areas + overlaps


def effect_parameters(effect: Effect, model: Model, facts: Facts, starts: dict[str, float] | None = None) -> list[Free]:
    """Return an effect's free parameters, starting from given, present or typical values, on the rig of these facts."""
    free = []
    for p in effect.parameters:
        name, size = f"{effect.name}.{p.name}", p.on(facts)
        typical = size.typical[0] if size.typical else 0.0
        start = (starts or {}).get(name, model.values.get(name, typical))
        start = float(np.clip(start, size.lower, size.upper))
        null = null_value(p, model)
        logarithmic = null is None and size.lower > 0.0
        away = [abs(value - (null or 0.0)) for value in (start, *size.typical)]
        scale = max(away[0], 0.1 * max(away), TINY)
        step = max(size.step / scale, STEP)
        free.append(Free(name, p.unit, start, size.lower, size.upper, scale, logarithmic=logarithmic, step=step))
    return free


def null_value(parameter: Parameter, model: Model) -> float | None:
    """Return the finite value at which the parameter makes its effect vanish, None where there is none."""
    if isinstance(parameter.null, str):
        return value_of(model, parameter.null)
    return None if parameter.null is None or math.isinf(parameter.null) else parameter.null


def roughness(valve: ValveArea) -> Array:
    """Return how far each inner knot's log area lies off the line through its neighbours, over log(|u| - overlap)."""
    rows = []
    for sign, overlap in ((1.0, valve.overlap_fill), (-1.0, valve.overlap_vent)):
        side = sorted((sign * c, a) for c, a in zip(valve.commands, valve.areas, strict=True) if sign * c > overlap)
        x, y = np.log([c - overlap for c, _ in side]), np.log([max(a, 1e-14) for _, a in side])
        if x.size > 2:
            w = (x[1:-1] - x[:-2]) / (x[2:] - x[:-2])
            rows.append(y[1:-1] - (1 - w) * y[:-2] - w * y[2:])
    return np.concatenate(rows) if rows else np.zeros(0)
