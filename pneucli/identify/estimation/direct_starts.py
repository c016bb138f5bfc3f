"""Starts of effects as the balance of forces or the flow into the chambers gives them, in the model's names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pneucli.identify.guesses.base_model import PLACEHOLDER_VOLUME
from pneucli.identify.guesses.direct_friction import direct_friction, force_samples
from pneucli.identify.guesses.late_valve import LATENESS, late_valve
from pneucli.identify.residuals import ForceBalance, ResidualModel
from pneucli.physics.declaration import Effect
from pneucli.physics.scales import RigQuantities
from pneucli.recording import ParameterPrior
from pneucli.simulate.model import Model
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.simulate.valve_forms.area import MAX_OVERLAP_RATIO, ValveArea


def direct_guesses(effect: Effect, model: Model, views: Sequence[ResidualModel]) -> list[dict[str, float]]:
    """Return values (SI) of an effect and of all other friction, or of the valve's areas, by name.

    None where the effect declares no such parameter. What the pipeline file says of a parameter takes its place.
    """
    if not any(p.direct for p in effect.parameters):
        return []
    effects = (*(e for e in model.effects if e.name != effect.name), effect)
    facts = rig_quantities(model, [view.experiment for view in views])
    if any(p.direct in LATENESS for p in effect.parameters):
        return [_with_priors(values, model.rig.priors) for values in _late_valve(effect, model, views, facts)]
    known = _direct_friction(model, views, two_branches=any(e.is_set_valued for e in effects))
    return [_with_priors(_named(direct, effects, effect, facts), model.rig.priors) for direct in known]


def _late_valve(
    effect: Effect, model: Model, views: Sequence[ResidualModel], facts: RigQuantities
) -> list[dict[str, float]]:
    """Return a lag or delay of all valves with the areas that it leaves them; none of a single side's."""
    if effect.side is not None or not all(isinstance(valve, ValveArea) for valve in model.valves):
        return []
    (name, how, size), *_ = [(p.name, p.direct, p.range_on(facts)) for p in effect.parameters if p.direct in LATENESS]
    base = model.base_values()
    rig = replace(model.rig, dead_volume_1=base["rig.dead_volume_1"], dead_volume_2=base["rig.dead_volume_2"])
    experiments = list({id(view.experiment): view.experiment for view in views if view.is_simulated}.values())
    found = late_valve(
        experiments, rig, model.values.get("rig.vessel_volume", PLACEHOLDER_VOLUME), str(how), size.upper
    )
    if found is None:
        return []
    values = {f"{effect.name}.{name}": max(found.time, size.lower)}
    own = {valve.label: valve for valve in model.valves if isinstance(valve, ValveArea)}
    for guessed in (one for one in found.valves if one.label in own):
        values |= {name: value for name, (value, _) in _with_knots_of(own[guessed.label], guessed).parameters().items()}
    return [values]


def _with_knots_of(own: ValveArea, guessed: ValveArea) -> ValveArea:
    """Return a guessed valve with the knots of another one."""
    commands, bounds = np.array(own.commands), {}
    for sign, field in ((1.0, "overlap_fill"), (-1.0, "overlap_vent")):
        first = float(np.min(np.abs(commands[sign * commands > 0.0]), initial=np.inf))
        bounds[field] = min(getattr(guessed, field), MAX_OVERLAP_RATIO * first)
    return replace(own, areas=tuple(guessed(commands).tolist()), **bounds)


def direct_base_friction(model: Model, views: Sequence[ResidualModel]) -> list[dict[str, float]]:
    """Return Coulomb friction above zero (N) with viscous friction (N s/m), by name, from the balance of forces."""
    known = _direct_friction(model, views, two_branches=False)
    return [_with_priors(_base(direct), model.rig.priors) for direct in known if direct["coulomb"] > 0.0]


def _direct_friction(model: Model, views: Sequence[ResidualModel], *, two_branches: bool) -> list[dict[str, float]]:
    balanced = [
        view.experiment for view in views if isinstance(view, ForceBalance) and not view.experiment.p2_is_unmeasured
    ]
    mass = model.base_values()["rig.moving_mass"] + model.sum_of_port("mass")
    return direct_friction(force_samples(balanced, mass), two_branches=two_branches)


def _base(direct: Mapping[str, float]) -> dict[str, float]:
    return {f"friction.{name}": direct[name] for name in ("coulomb", "viscous")}


def _named(
    direct: Mapping[str, float], effects: Sequence[Effect], added: Effect, facts: RigQuantities
) -> dict[str, float]:
    """Return direct values by the names of parameters; of the effect to be added the others are as usual."""
    values = _base(direct)
    for effect in effects:
        for p in effect.parameters:
            size, value = p.range_on(facts), direct.get(p.direct or "")
            if value is not None:
                values[f"{effect.name}.{p.name}"] = float(np.clip(value, size.lower, size.upper))
            elif effect is added and size.typical and not p.refines:
                values[f"{effect.name}.{p.name}"] = size.typical[0]
    return values


def _with_priors(values: dict[str, float], priors: Mapping[str, ParameterPrior]) -> dict[str, float]:
    return {name: _with_prior(value, priors[name]) if name in priors else value for name, value in values.items()}


def _with_prior(value: float, prior: ParameterPrior) -> float:
    stated = prior.start if prior.fixed is None else prior.fixed
    return float(np.clip(value if stated is None else stated, prior.lower, prior.upper))
