"""The parameters that a fit varies: base friction, the valve's areas, unknown rig values, and the effects' own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.guesses.friction_and_valve import TINY
from pneucli.physics.declaration import BASE_PARAMETERS, Effect, Parameter
from pneucli.physics.scales import RigQuantities
from pneucli.plausibility.required_inputs import volumes_to_identify
from pneucli.recording import ParameterPrior, Rig
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model, ValveForm, parameter_value
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.simulate.valve_forms.area import MAX_OVERLAP_RATIO

Array = NDArray[np.float64]

DIFFERENCE_STEP = 1e-4  # of a parameter's scale, for differences


@dataclass(frozen=True)
class FreeParameter:
    """One free parameter. The fit sees (value - zero) / scale, or log(value) where ``logarithmic``.

    ``prior_sigma`` is a standard deviation around the start in the fit's own coordinate, inf where the data decide
    alone; ``prior_mean`` is the value around which it holds, the start where there is none; ``step`` the difference in
    that coordinate from which derivatives are taken.
    """

    name: str
    unit: str
    start: float
    lower: float
    upper: float
    scale: float
    logarithmic: bool = False
    prior_sigma: float = np.inf
    step: float = DIFFERENCE_STEP
    prior_mean: float | None = None

    def to_coordinate(self, value: float) -> float:
        """Return the fit's coordinate of a value."""
        return float(np.log(value)) if self.logarithmic else value / self.scale

    def from_coordinate(self, z: float) -> float:
        """Return the value at a coordinate of the fit."""
        return float(np.exp(min(z, 700.0))) if self.logarithmic else z * self.scale

    def derivative(self, value: float) -> float:
        """Return d value / d coordinate."""
        return value if self.logarithmic else self.scale


def base_parameters(model: Model, experiments: Sequence[Experiment]) -> list[FreeParameter]:
    """Return the base model's free parameters that these experiments can tell, starting from the model's values."""
    facts = rig_quantities(model, experiments)
    free: list[FreeParameter] = []
    moving = [e for e in experiments if e.recording.kind.cylinder]
    driven = [e for e in experiments if e.recording.kind.valve and not e.recording.valve_shut]
    if moving:
        free += [
            _base_parameter(name, parameter_value(model, name), facts)
            for name in ("friction.coulomb", "friction.viscous")
        ]
    free += [
        _base_parameter(name, parameter_value(model, name), facts) for name in _rig_parameters(model.rig, experiments)
    ]
    if driven:
        free += [one for valve in model.valves for one in _valve_parameters(valve, facts)]
    return with_prior_knowledge(free, model.rig)


def _rig_parameters(rig: Rig, experiments: Sequence[Experiment]) -> list[str]:
    """Return the rig's values that are identified: those that the file leaves out, or is not sure of, and that show."""
    recordings = [e.recording for e in experiments]
    moving, gas = any(r.kind.cylinder for r in recordings), any(r.kind.axis for r in recordings)
    names = ["rig.moving_mass"] if moving and rig.moving_mass is None else []
    names += volumes_to_identify(recordings, rig)
    names += ["rig.polytropic_exponent"] if rig.exponent_free and any(r.kind.valve for r in recordings) else []
    shown = {
        **dict.fromkeys(("rig.moving_mass", "rig.piston_area_1", "rig.piston_area_2"), moving),
        **dict.fromkeys(("rig.dead_volume_1", "rig.dead_volume_2"), gas),
        "rig.vessel_volume": any(r.kind.vessel for r in recordings),
        "rig.supply_pressure": any(r.kind.valve and not r.valve_shut and "p_supply" not in r for r in recordings),
    }
    return names + [name for name in rig.priors if shown.get(name, False) and name not in names]


def with_prior_knowledge(free: Sequence[FreeParameter], rig: Rig) -> list[FreeParameter]:
    """Return the free parameters with what is known of them beforehand; one that is fixed is not free."""
    return [_with_prior(f, rig.priors[f.name]) if f.name in rig.priors else f for f in free if not _fixed(f.name, rig)]


def _fixed(name: str, rig: Rig) -> bool:
    return name in rig.priors and rig.priors[name].fixed is not None


def _with_prior(free: FreeParameter, known: ParameterPrior) -> FreeParameter:
    lower, upper = max(free.lower, known.lower), min(free.upper, known.upper)
    if known.start is not None:  # what a person states may lie beyond what a rig usually has
        lower, upper = min(lower, max(known.start, known.lower)), max(upper, min(known.start, known.upper))
    start = float(np.clip(free.start, lower, upper))
    if math.isinf(known.sigma):
        return replace(free, start=start, lower=lower, upper=upper)
    centre = start if known.start is None else known.start
    prior = known.sigma / (max(abs(centre), TINY) if free.logarithmic else free.scale)
    return replace(free, start=start, lower=lower, upper=upper, prior_sigma=prior, prior_mean=centre)


def _base_parameter(name: str, start: float, facts: RigQuantities) -> FreeParameter:
    """Return a base parameter as declared, sized by its start; where that is nearly nothing, by what is plausible."""
    declared = BASE_PARAMETERS[name]
    size = declared.range_on(facts)
    start = max(start, size.lower, 1e-4 * size.typical[0] if size.typical else TINY)
    upper = facts.heat_capacity_ratio if name == "rig.polytropic_exponent" else size.upper
    return FreeParameter(name, declared.unit, start, max(size.lower, 0.0), upper, start)


def _valve_parameters(valve: ValveForm, facts: RigQuantities) -> list[FreeParameter]:
    """Return the valve's free parameters: areas (or a gain) as logarithms, an overlap short of the smallest knot."""
    lowest = min((abs(c) for c in valve.commands), default=0.0)
    area, overlap = (
        BASE_PARAMETERS["valve.effective_area"].range_on(facts),
        BASE_PARAMETERS["valve.overlap"].range_on(facts),
    )
    free = []
    for name, (value, unit) in valve.parameters().items():
        if unit == "V":
            scale = overlap.typical[0] if overlap.typical else lowest
            free.append(FreeParameter(name, unit, value, 0.0, MAX_OVERLAP_RATIO * lowest, scale, prior_sigma=10.0))
        else:
            a_volt = facts.max_command if unit == "m^2/V" else 1.0
            bounds = max(area.lower, TINY) / a_volt, area.upper / a_volt
            free.append(FreeParameter(name, unit, value, *bounds, 1.0, logarithmic=True))
    return free


def effect_parameters(
    effect: Effect, model: Model, facts: RigQuantities, initial_values: dict[str, float] | None = None
) -> list[FreeParameter]:
    """Return an effect's free parameters, starting from given, present or typical values, on the rig of these facts."""
    free = []
    for p in effect.parameters:
        name, size = f"{effect.name}.{p.name}", p.range_on(facts)
        typical = size.typical[0] if size.typical else 0.0
        start = (initial_values or {}).get(name, model.values.get(name, typical))
        start = float(np.clip(start, size.lower, size.upper))
        null = null_value(p, model)
        logarithmic = null is None and size.lower > 0.0
        away = [abs(value - (null or 0.0)) for value in (start, *size.typical)]
        scale = max(away[0], 0.1 * max(away), TINY)
        step = max(size.step / scale, DIFFERENCE_STEP)
        free.append(
            FreeParameter(name, p.unit, start, size.lower, size.upper, scale, logarithmic=logarithmic, step=step)
        )
    return with_prior_knowledge(free, model.rig)


def null_value(parameter: Parameter, model: Model) -> float | None:
    """Return the finite value at which the parameter makes its effect vanish, None where there is none."""
    if isinstance(parameter.null, str):
        return parameter_value(model, parameter.null)
    return None if parameter.null is None or math.isinf(parameter.null) else parameter.null


def absent_value(parameter: Parameter, model: Model, upper: float) -> float | None:
    """Return the value at which the effect is as good as absent: its null, or ``upper`` where that is infinite."""
    if parameter.null is None:
        return None
    null = null_value(parameter, model)
    return upper if null is None else null
