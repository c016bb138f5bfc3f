"""The free parameters of a fit: friction, valve areas, unknown rig values, and the parameters of effects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pneucli.identify.guesses.base_model import TINY
from pneucli.physics.declaration import BASE_PARAMETERS, Effect, Parameter
from pneucli.physics.scales import RigQuantities
from pneucli.plausibility.required_inputs import volumes_to_identify
from pneucli.recording import ParameterPrior, Rig
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model, ValveForm, parameter_value
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.simulate.valve_forms import MAX_OVERLAP_RATIO, OVERLAP_FIELDS

DIFFERENCE_STEP = 1e-4  # of a parameter's scale, for forward differences


@dataclass(frozen=True)
class FreeParameter:
    """One free parameter. The fit's coordinate is value / scale, or log(value) where ``logarithmic``.

    ``prior_sigma`` is the standard deviation of a normal prior in that coordinate, infinite without a prior;
    ``prior_mean`` is the value at its centre, the start where absent. ``step`` is the coordinate step of the
    differences. ``multiplies``: parameters of one level, whose product with this one the data determine. A bound is a
    limit where physics or the user excludes what lies beyond, as a lower bound of zero does; else it only ends the
    search.
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
    multiplies: tuple[str, ...] = ()
    lower_is_limit: bool = False
    upper_is_limit: bool = False

    def to_coordinate(self, value: float) -> float:
        """Return the fit's coordinate of a value."""
        return float(np.log(value)) if self.logarithmic else value / self.scale

    def from_coordinate(self, z: float) -> float:
        """Return the value at a coordinate."""
        return float(np.exp(min(z, 700.0))) if self.logarithmic else z * self.scale

    def derivative(self, value: float) -> float:
        """Return d value / d coordinate."""
        return value if self.logarithmic else self.scale


def base_parameters(model: Model, experiments: Sequence[Experiment]) -> list[FreeParameter]:
    """List the base model's free parameters that these experiments can identify.

    Args:
        model: The model, whose values are the start values.
        experiments: The training experiments.

    Returns:
        Friction where a piston moves, unknown rig values, and valve areas where air flows through a valve.

    """
    quantities = rig_quantities(model, experiments)
    free: list[FreeParameter] = []
    has_motion = [experiment for experiment in experiments if experiment.recording.kind.cylinder]
    has_flow = [
        experiment
        for experiment in experiments
        if experiment.recording.kind.valve and not experiment.recording.valve_shut
    ]
    if has_motion:
        free += [
            _base_parameter(name, parameter_value(model, name), quantities)
            for name in ("friction.coulomb", "friction.viscous")
        ]
    free += [
        _base_parameter(name, parameter_value(model, name), quantities)
        for name in _rig_parameters(model.rig, experiments)
    ]
    if has_flow:
        free += [one for valve in model.valves for one in _valve_parameters(valve, quantities)]
    return with_prior_knowledge(free, model.rig)


def _rig_parameters(rig: Rig, experiments: Sequence[Experiment]) -> list[str]:
    """Return the rig values to identify: those that the file leaves out or states with a prior, where they can show."""
    recordings = [experiment.recording for experiment in experiments]
    has_motion, gas = (
        any(recording.kind.cylinder for recording in recordings),
        any(recording.kind.axis for recording in recordings),
    )
    names = ["rig.moving_mass"] if has_motion and rig.moving_mass is None else []
    names += volumes_to_identify(recordings, rig)
    names += (
        ["rig.polytropic_exponent"]
        if rig.exponent_free and any(recording.kind.valve for recording in recordings)
        else []
    )
    is_identifiable = {
        **dict.fromkeys(("rig.moving_mass", "rig.piston_area_1", "rig.piston_area_2"), has_motion),
        **dict.fromkeys(("rig.dead_volume_1", "rig.dead_volume_2"), gas),
        "rig.vessel_volume": any(recording.kind.vessel for recording in recordings),
        "rig.supply_pressure": any(
            recording.kind.valve and not recording.valve_shut and "p_supply" not in recording
            for recording in recordings
        ),
    }
    return names + [name for name in rig.priors if is_identifiable.get(name, False) and name not in names]


def with_prior_knowledge(free: Sequence[FreeParameter], rig: Rig) -> list[FreeParameter]:
    """Apply the priors of a rig to free parameters.

    Args:
        free: The free parameters.
        rig: The rig; its priors come from the pipeline file.

    Returns:
        The free parameters with their priors, bounds and start values; without those that the file fixes.

    """
    return [
        _with_prior(parameter, rig.priors[parameter.name]) if parameter.name in rig.priors else parameter
        for parameter in free
        if not _fixed(parameter.name, rig)
    ]


def _fixed(name: str, rig: Rig) -> bool:
    return name in rig.priors and rig.priors[name].fixed is not None


def _with_prior(free: FreeParameter, prior: ParameterPrior) -> FreeParameter:
    lower, upper = max(free.lower, prior.lower), min(free.upper, prior.upper)
    if prior.start is not None:  # what a person states may lie beyond what a rig usually has
        lower, upper = min(lower, max(prior.start, prior.lower)), max(upper, min(prior.start, prior.upper))
    start = float(np.clip(free.start, lower, upper))
    free = replace(
        free,
        lower_is_limit=free.lower_is_limit or lower == prior.lower,
        upper_is_limit=free.upper_is_limit or upper == prior.upper,
    )
    if math.isinf(prior.sigma):
        return replace(free, start=start, lower=lower, upper=upper)
    prior_mean = start if prior.start is None else prior.start
    parameter_prior = prior.sigma / (max(abs(prior_mean), TINY) if free.logarithmic else free.scale)
    return replace(free, start=start, lower=lower, upper=upper, prior_sigma=parameter_prior, prior_mean=prior_mean)


def _base_parameter(name: str, start: float, quantities: RigQuantities) -> FreeParameter:
    """Return a declared base parameter, scaled by its start value, or by its smallest plausible value near zero."""
    declaration = BASE_PARAMETERS[name]
    valid_range = declaration.range_on(quantities)
    start = max(start, valid_range.lower, 1e-4 * valid_range.typical[0] if valid_range.typical else TINY)
    upper = quantities.heat_capacity_ratio if name == "rig.polytropic_exponent" else valid_range.upper
    lower, is_exponent = max(valid_range.lower, 0.0), name == "rig.polytropic_exponent"
    free = FreeParameter(name, declaration.unit, start, lower, upper, start)
    return replace(free, lower_is_limit=is_exponent, upper_is_limit=is_exponent)


def _valve_parameters(valve: ValveForm, quantities: RigQuantities) -> list[FreeParameter]:
    """Return the valve's free parameters: areas (or a gain) as logarithms, each overlap below its smallest knot."""
    smallest = {
        f"{valve.label}.{name}": min((abs(c) for c in valve.commands if sign * c > 0.0), default=0.0)
        for name, sign in zip(OVERLAP_FIELDS, (1.0, -1.0), strict=True)
    }
    area, overlap = (
        BASE_PARAMETERS["valve.effective_area"].range_on(quantities),
        BASE_PARAMETERS["valve.overlap"].range_on(quantities),
    )
    free = []
    for name, (value, unit) in valve.parameters().items():
        if unit == "V":
            scale = overlap.typical[0] if overlap.typical else smallest[name]
            largest = MAX_OVERLAP_RATIO * smallest[name]  # at the smallest command the valve is open
            one = FreeParameter(name, unit, value, 0.0, largest, scale, prior_sigma=10.0)
            free.append(replace(one, upper_is_limit=True))
        else:
            a_volt = quantities.max_command if unit == "m^2/V" else 1.0
            bounds = max(area.lower, TINY) / a_volt, area.upper / a_volt
            free.append(FreeParameter(name, unit, value, *bounds, 1.0, logarithmic=True))
    return free


def effect_parameters(
    effect: Effect, model: Model, quantities: RigQuantities, initial_values: dict[str, float] | None = None
) -> list[FreeParameter]:
    """List the free parameters of an effect.

    Args:
        effect: The effect.
        model: The model; its values are the start values where the effect is present.
        quantities: The quantities of the rig that scale ranges and typical values.
        initial_values: Start values by EFFECT.PARAMETER, in declared units, that take precedence.

    Returns:
        The free parameters in the order of their declaration.

    """
    free = []
    for p in effect.in_model_with(model.effects).parameters:
        name, valid_range = f"{effect.name}.{p.name}", p.range_on(quantities)
        if p.refines and name not in {*model.values, *model.rig.priors}:
            continue
        typical = valid_range.typical[0] if valid_range.typical else 0.0
        start = (initial_values or {}).get(name, model.values.get(name, typical))
        start = float(np.clip(start, valid_range.lower, valid_range.upper))
        null = null_value(p, model)
        logarithmic = null is None and valid_range.lower > 0.0
        distances = [abs(value - (null or 0.0)) for value in (start, *valid_range.typical)]
        scale = max(distances[0], 0.1 * max(distances), TINY)
        step = max(valid_range.step / scale, DIFFERENCE_STEP)
        free.append(
            FreeParameter(
                *(name, p.unit, start, valid_range.lower, valid_range.upper, scale),
                logarithmic=logarithmic,
                step=step,
                multiplies=_levels(p.multiplies, model),
            )
        )
    return with_prior_knowledge(free, model.rig)


def _levels(multiplied: str | None, model: Model) -> tuple[str, ...]:
    """Return the parameter that a ratio multiplies, with those of the model that equal it where they have no effect."""
    if multiplied is None:
        return ()
    others = (f"{e.name}.{p.name}" for e in model.effects for p in e.parameters if p.null == multiplied)
    return (multiplied, *others)


def null_value(parameter: Parameter, model: Model) -> float | None:
    """Return the finite null of a parameter, at which its effect vanishes.

    Args:
        parameter: The declared parameter.
        model: The model, for a null that is the value of another parameter.

    Returns:
        The null in the declared unit; None where it is infinite or absent.

    """
    if isinstance(parameter.null, str):
        return parameter_value(model, parameter.null)
    return None if parameter.null is None or math.isinf(parameter.null) else parameter.null


def absent_value(parameter: Parameter, model: Model, upper: float) -> float | None:
    """Return the value at which an effect is practically absent.

    Args:
        parameter: The declared parameter.
        model: The model, for a null that is the value of another parameter.
        upper: The upper bound, which replaces an infinite null.

    Returns:
        The value in the declared unit; None where the parameter has no null.

    """
    if parameter.null is None:
        return None
    null = null_value(parameter, model)
    return upper if null is None else null
