"""The parameters that a fit varies: base friction, the valve's areas, unknown rig values, and the effects' own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneucli.physics.declaration import Effect, Parameter
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model, Valve

Array = NDArray[np.float64]

STEP = 1e-4  # of a parameter's scale, for differences
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


def value_of(model: Model, name: str) -> float:
    """Return the value of any parameter of a model by its name."""
    named = model.named()
    if name in named:
        return named[name][0]
    return model.values[name] if name in model.values else model.base()[name]


def with_parameters(model: Model, values: dict[str, float]) -> Model:
    """Return the model with parameters of any kind replaced."""
    valves = model.named()
    rest = {name: v for name, v in values.items() if name not in valves}
    second = None if model.valve_2 is None else model.valve_2.with_named(values)
    return replace(model.with_values(rest), valve=model.valve.with_named(values), valve_2=second)


def base_parameters(model: Model, experiments: Sequence[Experiment]) -> list[Free]:
    """Return the base model's free parameters that these experiments can tell, starting from the model's values."""
    free: list[Free] = []
    moving = [e for e in experiments if e.recording.kind.cylinder]
    driven = [e for e in experiments if e.flags[1] > 0 and not e.recording.valve_shut]
    if moving:
        coulomb = max(value_of(model, "friction.coulomb"), 1e-3)
        viscous = max(value_of(model, "friction.viscous"), 1e-3)
        free.append(Free("friction.coulomb", "N", coulomb, 0.0, 1e5, coulomb))
        free.append(Free("friction.viscous", "N s/m", viscous, 0.0, 1e6, viscous))
        if model.rig.moving_mass is None:
            mass = value_of(model, "rig.moving_mass")
            free.append(Free("rig.moving_mass", "kg", mass, 1e-3, 1e5, mass))
    if driven:
        free += [one for valve in model.valves for one in _valve(valve)]
    return free


def _valve(valve: Valve) -> list[Free]:
    """Return the valve's free parameters: areas as logarithms, an overlap short of the smallest knot."""
    lowest = min((abs(c) for c in valve.commands), default=0.0)
    return [
        Free(name, unit, value, 0.0, LARGEST_OVERLAP * lowest, 0.1, prior=10.0)
        if unit == "V"
        else Free(name, unit, value, 1e-12, 1e-2, 1.0, logarithmic=True)
        for name, (value, unit) in valve.named().items()
    ]


def effect_parameters(effect: Effect, model: Model, starts: dict[str, float] | None = None) -> list[Free]:
    """Return an effect's free parameters, starting from given, present or typical values."""
    free = []
    for p in effect.parameters:
        name = f"{effect.name}.{p.name}"
        start = (starts or {}).get(name, model.values.get(name, p.typical[0]))
        start = float(np.clip(start, p.lower, p.upper))
        null = null_value(p, model)
        logarithmic = null is None and p.lower > 0.0
        scale = max(abs(start - (null or 0.0)), abs(p.typical[0]) * 0.1, 1e-12)
        step = max(p.step / scale, STEP)
        free.append(Free(name, p.unit, start, p.lower, p.upper, scale, logarithmic=logarithmic, step=step))
    return free


def null_value(parameter: Parameter, model: Model) -> float | None:
    """Return the finite value at which the parameter makes its effect vanish, None where there is none."""
    if isinstance(parameter.null, str):
        return value_of(model, parameter.null)
    return None if parameter.null is None or math.isinf(parameter.null) else parameter.null
