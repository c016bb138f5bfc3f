"""``plan --first``: the programme of a new rig, from its description alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pneucli.config.recording_sources import plugin_files
from pneucli.errors import InputError
from pneucli.identify.estimation.model_fit import free_parameters
from pneucli.physics.effects import all_effects
from pneucli.pipeline.context import Context
from pneucli.plan.bench import described_benches
from pneucli.plan.evaluation import Comparison, evaluate_candidates
from pneucli.plan.first import (
    extreme_models,
    prior_covariance,
    programme_objective,
    sample_residual_models,
    typical_model,
    usual_deviations,
    visible_effects,
)
from pneucli.plan.limits import Limits, limits_of
from pneucli.plan.power import power_table
from pneucli.plan.rivals import with_typical_effect
from pneucli.plan.safety import Safety
from pneucli.plan.selection import choose_sequence, total_information
from pneucli.simulate.model import parameter_value
from pneucli.stages.plan_answer import plan_answer
from pneucli.stages.plan_files import power_row, write_plan

FIRST_MINUTES = 5.0
VESSEL_HORIZON, AXIS_HORIZON = 5.0, 0.5  # s between restarts of the comparison, as the pipelines of new rigs have them
Z95 = 1.96
NOISE_WARNING = (
    "The powers assume usual sensors, and that the best model leaves twice the noise, correlated over 0.1 s: after the "
    "first recordings, plan again from the diagnosis."
)


@dataclass(frozen=True)
class FirstStudy:
    """What writing a first programme needs."""

    context: Context
    limits: Limits


def first_programme(context: Context) -> dict[str, Any]:
    """Plan the first recordings of a rig; raises InputError where ``[rig]`` describes no bench."""
    config = context.config
    rig = config.to_rig()
    stated = config.plan.model_dump()
    benches = described_benches(rig, stated["max_command"])
    if not benches:
        raise InputError(
            f"{context.path}, key rig",
            "neither a vessel nor a cylinder with its stroke",
            "[rig.vessel] volume, or [rig.cylinder] piston_area_1 and stroke",
            "describe the rig",
        )
    if rig.supply_pressure is None:
        raise InputError(f"{context.path}, key rig.supply_pressure", "missing", 'such as "7 bar"', "state the supply")
    limits = limits_of(rig, benches, stated)
    context.progress("a typical model of the rig", 0.05)
    form = "switching" if rig.valve_kind == "switching" else config.model.valve
    model = typical_model(rig, benches, form)
    horizon = AXIS_HORIZON if rig.has_cylinder else VESSEL_HORIZON
    samples = sample_residual_models(benches, limits, model, horizon)
    free = free_parameters(model, samples)
    catalogue = visible_effects(list(all_effects(plugin_files(config)).values()), samples, model)
    pairs = [(e, m) for e in catalogue if (m := with_typical_effect(model, e, samples)) is not None]
    effects, models = [e for e, _ in pairs], [m for _, m in pairs]
    comparison = Comparison(model, models, free, usual_deviations(samples), horizon)
    candidates, refused = evaluate_candidates(
        benches, limits, comparison, rig, lambda text, share: context.progress(text, 0.1 + 0.8 * share)
    )
    commands = [c for c in candidates if not c.manoeuvre.by_hand]
    covariance = prior_covariance(free)
    safety = Safety(rig, limits, extreme_models(model))
    seconds = 60.0 * float(context.options.get("minutes", FIRST_MINUTES))
    chosen = choose_sequence(commands, programme_objective(covariance), seconds, safety)
    if not chosen:
        raise InputError(
            f"{context.path}, key plan", "no manoeuvre keeps the limits", "wider limits", "state them in [plan]"
        )
    chosen = sorted(chosen, key=lambda c: [b.name for b in benches].index(c.manoeuvre.bench.name))
    told = total_information(chosen)
    powers = power_table(effects, models, told, covariance, model)
    study = FirstStudy(context, limits)
    answer = plan_answer(study, chosen, [*refused, *safety.refused])
    answer["expected"] = [
        {"effect": p.effect.name, "rival": p.effect.name, "probability_before": None, "power": p.power}
        for p in powers
        if p.typical
    ]
    after = told.parameter_covariance(covariance)
    answer["parameters"] = [
        {
            "name": f.name,
            "unit": f.unit,
            "half_width_before": float(Z95 * np.sqrt(covariance[i, i]) * f.derivative(parameter_value(model, f.name))),
            "half_width_after": float(Z95 * np.sqrt(after[i, i]) * f.derivative(parameter_value(model, f.name))),
        }
        for i, f in enumerate(free)
    ]
    answer["power"] = [power_row(p) for p in powers]
    answer["warnings"] = [NOISE_WARNING]
    return write_plan(answer, chosen, powers, study, (comparison, []))
