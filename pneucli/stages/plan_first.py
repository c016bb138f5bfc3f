"""``plan --first``: the programme of a new rig, from its description alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.config.recording_sources import plugin_files
from pneucli.errors import InputError
from pneucli.identify.estimation.model_fit import free_parameters
from pneucli.identify.residuals import ResidualModel
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import all_effects
from pneucli.pipeline.context import Context
from pneucli.plan.bench import Bench, described_benches
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
from pneucli.plan.rivals import lagged_models, with_typical_effect
from pneucli.plan.safety import Safety
from pneucli.plan.selection import choose_sequence, grouped_by_setup, total_information
from pneucli.quantities import Z95
from pneucli.recording import Rig
from pneucli.simulate.model import Model, parameter_value
from pneucli.stages.plan_answer import limits_too_narrow, plan_answer
from pneucli.stages.plan_files import write_plan

Array = NDArray[np.float64]

FIRST_MINUTES = 5.0
VESSEL_HORIZON, AXIS_HORIZON = 5.0, 0.5  # s between restarts of the comparison, as the pipelines of new rigs have them
NOISE_WARNING = (
    "The powers assume usual sensors, and that the best model leaves five times the noise, correlated over 0.1 s: "
    "after the first recordings, plan again from the diagnosis."
)


@dataclass(frozen=True)
class FirstStudy:
    """A rig that is only described: its benches, limits, typical model, and the effects that may be seen."""

    context: Context

    @cached_property
    def rig(self) -> Rig:
        """The rig; raises InputError where no bench, no supply or no null command is described."""
        rig = self.context.config.to_rig()
        if not described_benches(rig):
            raise InputError(
                f"{self.context.path}, key rig",
                "neither a vessel nor a cylinder with its stroke",
                "[rig.vessel] volume, or [rig.cylinder] piston_area_1 and stroke",
                "describe the rig",
                code="E063",
            )
        if rig.supply_pressure is None:
            raise InputError(
                f"{self.context.path}, key rig.supply_pressure",
                "missing",
                'such as "7 bar"',
                "state the supply",
                code="E063",
            )
        if rig.null_free:
            raise InputError(
                f"{self.context.path}, key rig.valve.null",
                '"identify", but there is no recording yet',
                "the command at which nothing flows: every command of the programme is about it",
                'such as null = "5 V", half the range of the valve',
                code="E063",
            )
        return rig

    @cached_property
    def benches(self) -> list[Bench]:
        """The benches."""
        return described_benches(self.rig, self.context.config.plan.max_command)

    @cached_property
    def limits(self) -> Limits:
        """The limits of the rig."""
        return limits_of(self.rig, self.benches, self.context.config.plan.model_dump())

    @cached_property
    def model(self) -> Model:
        """A typical model."""
        form = "switching" if self.rig.valve_kind == "switching" else self.context.config.model.valve
        return typical_model(self.rig, self.benches, form)

    @property
    def horizon(self) -> float:
        """Time in s between restarts of the comparison."""
        return AXIS_HORIZON if self.rig.has_cylinder else VESSEL_HORIZON

    @cached_property
    def samples(self) -> list[ResidualModel]:
        """The residual models of a manoeuvre of each bench."""
        return sample_residual_models(self.benches, self.limits, self.model, self.horizon)

    @cached_property
    def catalogue(self) -> list[Effect]:
        """The effects of the catalogue and of plugins."""
        return list(all_effects(plugin_files(self.context.config)).values())

    @cached_property
    def effects(self) -> list[tuple[Effect, Model]]:
        """The effects that may be seen, each with the model that has it at its typical size."""
        visible = visible_effects(self.catalogue, self.samples, self.model)
        return [(e, m) for e in visible if (m := with_typical_effect(self.model, e, self.samples)) is not None]

    @cached_property
    def comparison(self) -> Comparison:
        """The comparison of planned recordings with the typical model and those with one effect."""
        free, models = free_parameters(self.model, self.samples), [m for _, m in self.effects]
        lags = lagged_models(self.model, self.catalogue, self.samples)
        deviations = usual_deviations(self.model, self.samples, lags)
        return Comparison(self.model, models, free, deviations, self.horizon, lags=lags)


def first_programme(context: Context) -> dict[str, Any]:
    """Plan the first recordings of a rig; raises InputError where ``[rig]`` describes no bench."""
    study = FirstStudy(context)
    rig, comparison = study.rig, study.comparison
    context.progress("a typical model of the rig", 0.05)
    candidates, refused = evaluate_candidates(
        study.benches, study.limits, comparison, rig, lambda text, share: context.progress(text, 0.1 + 0.8 * share)
    )
    covariance = prior_covariance(comparison.free)
    safety = Safety(rig, study.limits, extreme_models(study.model))
    seconds = 60.0 * float(context.options.get("minutes", FIRST_MINUTES))
    commands = [c for c in candidates if not c.manoeuvre.by_hand]
    chosen = choose_sequence(commands, programme_objective(covariance), seconds, safety)
    if not chosen:
        raise limits_too_narrow(f"{context.path}, key plan")
    chosen = grouped_by_setup(chosen, study.benches)
    told = total_information(chosen)
    effects, models = [e for e, _ in study.effects], [m for _, m in study.effects]
    powers = power_table(effects, models, told, covariance, study.model)
    answer = plan_answer(study, chosen, [*refused, *safety.refused])
    answer["expected"] = [
        {"effect": p.effect.name, "rival": p.effect.name, "probability_before": None, "power": p.power}
        for p in powers
        if p.typical
    ]
    answer["parameters"] = _narrowed(study, covariance, told.parameter_covariance(covariance))
    answer["warnings"] = [NOISE_WARNING]
    return write_plan(answer, chosen, powers, study, (comparison, []))


def _narrowed(study: FirstStudy, before: Array, after: Array) -> list[dict[str, Any]]:
    """Return the half widths of the parameters' 95 % intervals, before and after the programme."""
    slopes = [Z95 * f.derivative(parameter_value(study.model, f.name)) for f in study.comparison.free]
    return [
        {
            "name": f.name,
            "unit": f.unit,
            "half_width_before": float(slope * np.sqrt(before[i, i])),
            "half_width_after": float(slope * np.sqrt(after[i, i])),
        }
        for i, (f, slope) in enumerate(zip(study.comparison.free, slopes, strict=True))
    ]
