"""The parameters that a fit varies: base friction, the valve's areas, unknown rig values, and the effects' own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneucli.physics.declaration import BASE, Effect, Parameter
from pneucli.physics.scales import Facts
from pneucli.plausibility.required_inputs import to_identify
from pneucli.recording import Known, Rig
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model, Valve
from pneucli.simulate.rig_quantities import facts_of

Array = NDArray[np.float64]

STEP = 1e-4  # of a parameter's scale, for differences
TINY = 1e-30  # stands for nothing where one divides or takes a logarithm
LARGEST_OVERLAP = 0.95  # of the smallest command with a knot


@dataclass(frozen=True)
class Free:
    """One free parameter. The fit sees (value - zero) / scale, or log(value) where ``logarithmic``.

    ``prior`` is a standard deviation around the start in the fit's own coordinate, inf where the data decide alone;
    ``centre`` is the value around which it holds, the start where there is none; ``step`` the difference in that
    coordinate from which derivatives are taken.
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
    centre: float | None = None

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


def has(model: Model, name: str) -> bool:
    """Return whether a model has a parameter of that name."""
    return name in model.named() or name in model.base() or name in model.values


def with_parameters(model: Model, values: dict[str, float]) -> Model:
    """Return the model with parameters of any kind replaced."""
    valves = model.named()
    rest = {name: v for name, v in values.items() if name not in valves}
    second = None if model.valve_2 is None else model.valve_2.with_named(values)
    return replace(model.with_values(rest), valve=model.valve.with_named(values), valve_2=second)


def base_parameters(model: Model, experiments: Sequence[Experiment]) -> list[Free]:
    """Return the base model's free parameters that these experiments can tell, starting from the model's values."""
    facts = facts_of(model, experiments)
    free: list[Free] = []
    moving = [e for e in experiments if e.recording.kind.cylinder]
    driven = [e for e in experiments if e.recording.kind.valve and not e.recording.valve_shut]
    if moving:
        free += [_base(name, value_of(model, name), facts) for name in ("friction.coulomb", "friction.viscous")]
    free += [_base(name, value_of(model, name), facts) for name in _of_rig(model.rig, experiments)]
    if driven:
        free += [one for valve in model.valves for one in _valve(valve, facts)]
    return informed(free, model.rig)


def _of_rig(rig: Rig, experiments: Sequence[Experiment]) -> list[str]:
    """Return the rig's values that are identified: those that the file leaves out, or is not sure of, and that show."""
    recordings = [e.recording for e in experiments]
    moving, gas = any(r.kind.cylinder for r in recordings), any(r.kind.axis for r in recordings)
    names = ["rig.moving_mass"] if moving and rig.moving_mass is None else []
    names += to_identify(recordings, rig)
    names += ["rig.polytropic_exponent"] if rig.exponent_free and any(r.kind.valve for r in recordings) else []
    shown = {
        **dict.fromkeys(("rig.moving_mass", "rig.piston_area_1", "rig.piston_area_2"), moving),
        **dict.fromkeys(("rig.dead_volume_1", "rig.dead_volume_2"), gas),
        "rig.vessel_volume": any(r.kind.vessel for r in recordings),
        "rig.supply_pressure": any(r.kind.valve and not r.valve_shut and "p_supply" not in r for r in recordings),
    }
    return names + [name for name in rig.known if shown.get(name, False) and name not in names]


def informed(free: Sequence[Free], rig: Rig) -> list[Free]:
    """Return the free parameters with what is known of them beforehand; one that is fixed is not free."""
    return [_with_known(f, rig.known[f.name]) if f.name in rig.known else f for f in free if not _fixed(f.name, rig)]


def _fixed(name: str, rig: Rig) -> bool:
    return name in rig.known and rig.known[name].fixed is not None


def _with_known(free: Free, known: Known) -> Free:
    lower, upper = max(free.lower, known.lower), min(free.upper, known.upper)
    if known.start is not None:  # what a person states may lie beyond what a rig usually has
        lower, upper = min(lower, max(known.start, known.lower)), max(upper, min(known.start, known.upper))
    start = float(np.clip(free.start, lower, upper))
    if math.isinf(known.sigma):
        return replace(free, start=start, lower=lower, upper=upper)
    centre = start if known.start is None else known.start
    prior = known.sigma / (max(abs(centre), TINY) if free.logarithmic else free.scale)
    return replace(free, start=start, lower=lower, upper=upper, prior=prior, centre=centre)


def _base(name: str, start: float, facts: Facts) -> Free:
    """Return a base parameter as declared, sized by its start; where that is nearly nothing, by what is plausible."""
    declared = BASE[name]
    size = declared.on(facts)
    start = max(start, size.lower, 1e-4 * size.typical[0] if size.typical else TINY)
    upper = facts.heat_ratio if name == "rig.polytropic_exponent" else size.upper
    return Free(name, declared.unit, start, max(size.lower, 0.0), upper, start)


def _valve(valve: Valve, facts: Facts) -> list[Free]:
    """Return the valve's free parameters: areas (or a gain) as logarithms, an overlap short of the smallest knot."""
    lowest = min((abs(c) for c in valve.commands), default=0.0)
    area, overlap = BASE["valve.effective_area"].on(facts), BASE["valve.overlap"].on(facts)
    free = []
    for name, (value, unit) in valve.named().items():
        if unit == "V":
            scale = overlap.typical[0] if overlap.typical else lowest
            free.append(Free(name, unit, value, 0.0, LARGEST_OVERLAP * lowest, scale, prior=10.0))
        else:
            a_volt = facts.command if unit == "m^2/V" else 1.0
            bounds = max(area.lower, TINY) / a_volt, area.upper / a_volt
            free.append(Free(name, unit, value, *bounds, 1.0, logarithmic=True))
    return free


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
    return informed(free, model.rig)


def null_value(parameter: Parameter, model: Model) -> float | None:
    """Return the finite value at which the parameter makes its effect vanish, None where there is none."""
    if isinstance(parameter.null, str):
        return value_of(model, parameter.null)
    return None if parameter.null is None or math.isinf(parameter.null) else parameter.null


def absent_value(parameter: Parameter, model: Model, upper: float) -> float | None:
    """Return the value at which the effect is as good as absent: its null, or ``upper`` where that is infinite."""
    if parameter.null is None:
        return None
    null = null_value(parameter, model)
    return upper if null is None else null
