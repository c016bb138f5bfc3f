"""Parts of the answer of ``plan``: recordings, rivals, limits, refused manoeuvres."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.config.recording_sources import plugin_files
from pneucli.diagnose.subsample import MAX_SAMPLES
from pneucli.errors import InputError, did_you_mean
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.intervals import with_intervals
from pneucli.identify.estimation.model_fit import fit_model, free_parameters
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.residuals import ResidualModel
from pneucli.messages.plan import by_hand_text, manoeuvre_text
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import all_effects, select_effects
from pneucli.pipeline.context import Context
from pneucli.pipeline.manifest import digest
from pneucli.plan.bench import Bench, described_benches, recorded_benches
from pneucli.plan.first import MODEL_ERROR, extreme_models, sample_residual_models, typical_model, with_typical_spread
from pneucli.plan.limits import BEST_MODEL, Limits, Refused, Safety, limits_of, models_to_check
from pneucli.plan.manoeuvre import Manoeuvre
from pneucli.plan.manoeuvres import cost_of
from pneucli.plan.power import Expectation, Power, Prediction, deviations_of, prior_information, with_absent_effects
from pneucli.plan.rivals import Rival, rivals_of_diagnosis
from pneucli.plan.simulation import start_of
from pneucli.recording import Rig
from pneucli.simulate.model import without_effect
from pneucli.stages.pipeline_data import PipelineData

VESSEL_HORIZON, AXIS_HORIZON = 5.0, 0.5  # s between restarts of the comparison, as the pipelines of new rigs have them
NOISE_WARNING = (
    "The powers assume usual sensors, and that the best model leaves five times the noise, correlated over 0.1 s: "
    "after the first recordings, plan again from the diagnosis."
)


@dataclass(frozen=True)
class Basis:
    """What a plan starts from.

    Attributes:
        benches: The benches that can show what is in question.
        safety: The limits of the rig, and the models in which every manoeuvre must keep them.
        expectation: The best model, the models with other effects, and what is known of parameters.
        rivals: The hypotheses in question.
        digest: Digest of what the plan starts from, which seeds the draw.
        warnings: What a reader has to know.
    """

    benches: Sequence[Bench]
    safety: Safety
    expectation: Expectation
    rivals: Sequence[Rival]
    digest: str
    warnings: Sequence[str] = ()

    @property
    def limits(self) -> Limits:
        """The limits of the rig."""
        return self.safety.limits

    @property
    def shown_rivals(self) -> list[Rival]:
        """The rivals that the benches can show."""
        return [rival for rival in self.rivals if rival.effect in self.expectation.others]


Array = NDArray[np.float64]
MAX_REFUSED = 30  # refused manoeuvres in an answer


def plan_answer(
    context: Context, basis: Basis, programme: Sequence[Manoeuvre], predictions: Sequence[Prediction]
) -> dict[str, Any]:
    """Return the answer without expectations."""
    recordings = recordings_answer(programme)
    for row, predicted in zip(recordings, predictions, strict=True):
        row["times_noise"] = {name: one.rms for name, one in predicted.differences.items()}
    rows = list({r["text"] + r["quantity"]: r for r in map(refused_answer, basis.safety.refused)}.values())
    first = bool(context.options.get("first"))
    best = {"name": BEST_MODEL, "effect": None, "present": True, "probability": None, "in_place_of": None}
    return {
        "schema": "pneucli/plan/1",
        "pipeline": context.config.name,
        "first": first,
        "seconds": recordings[-1]["end"],
        "recordings": recordings,
        "manual": [{"recording": r["name"], "text": r["by_hand"]} for r in recordings if r["by_hand"]],
        "limits": limits_answer(basis.limits),
        "refused": rows[:MAX_REFUSED],
        "refused_count": len(rows),
        "rivals": [] if first else [best, *({"name": r.name} | asdict(r) for r in basis.rivals)],
        "warnings": [*basis.warnings],
    }


def recordings_answer(programme: Sequence[Manoeuvre]) -> list[dict[str, Any]]:
    """Return the planned recordings with their times in ``commands.csv``."""
    rows, begin = [], 0.0
    for number, m in enumerate(programme, 1):
        row = manoeuvre_answer(m)
        rows.append(row | {"name": f"plan_{number}_{m.kind}", "begin": begin, "end": begin + m.duration})
        begin += cost_of(m)
    return rows


def manoeuvre_answer(m: Manoeuvre) -> dict[str, Any]:
    """Return one manoeuvre."""
    bench = m.bench
    return {
        "use": m.use,
        "kind": m.kind,
        "bench": bench.name,
        "experiment": bench.experiment,
        "drive": bench.drive,
        "column": bench.quantity,
        "chamber_2": bench.template.chamber_2,
        "chamber": bench.template.chamber,
        "imposed": bench.template.imposed,
        "valve": "shut" if m.kind == "shut-valve" else None,
        "start": asdict(start_of(m)),
        "gain": bench.gain if bench.drive == "position" else None,
        "centre": m.centre,
        "level": m.level,
        "frequency": m.frequency,
        "speed": m.speed,
        "pressure": m.pressure,
        "force": m.force,
        "added_mass": m.added_mass,
        "by_hand": by_hand_text(m.kind, m.force, m.added_mass) if m.by_hand else None,
    }


def expected_answer(basis: Basis, powers: Sequence[Power], information: Array) -> list[dict[str, Any]]:
    """Return for each rival its probability before, and the power to show it; without rivals for every effect.

    A rival that no bench of the recordings can show has a power of 0.
    """
    if not basis.rivals:
        typical = [p for p in powers if p.typical]
        return [_expected(p.effect, p.effect, None, p.power) for p in typical]
    shown = {r.name: basis.expectation.power(information, r.effect) for r in basis.shown_rivals}
    return [_expected(r.effect, r.name, r.own_probability, shown.get(r.name, 0.0)) for r in basis.rivals]


def _expected(effect: str, rival: str, probability: float | None, power: float) -> dict[str, Any]:
    return {"effect": effect, "rival": rival, "probability_before": probability, "power": power}


def limits_answer(limits: Limits) -> dict[str, Any]:
    """Return the limits, SI; None: not limited."""
    values = asdict(limits) | {"position": list(limits.position)}
    return {name: value if value is not None and np.isfinite(value).all() else None for name, value in values.items()}


def refused_answer(one: Refused) -> dict[str, Any]:
    """Return a refused manoeuvre with the first limit that it exceeds."""
    first = one.violations[0]
    return {
        "text": manoeuvre_text(manoeuvre_answer(one.manoeuvre)),
        "bench": one.manoeuvre.bench.name,
        "model": one.model,
        "quantity": first.quantity,
        "value": first.value if np.isfinite(first.value) else None,
        "limit": first.limit,
        "unit": first.unit,
    }


def limits_too_narrow(where: str) -> InputError:
    """Return the refusal of a plan for which no manoeuvre is left."""
    mend = "state end_margin, max_speed, max_pressure or max_force in [plan]; pneucli plan -v shows what was refused"
    return InputError(where, "no manoeuvre keeps the limits of the rig", "wider limits", mend, code="E071")


def diagnosed_pipeline(context: Context) -> Basis:
    """Return what the last diagnosis leaves open; raises InputError where no recording runs over time."""
    pipeline = PipelineData(context, max_samples=MAX_SAMPLES)
    train = pipeline.residual_models("train")
    if not train:
        raise InputError(
            f"{context.path}, key recordings",
            "no recording over time to plan from",
            "recordings, or --first",
            f"pneucli plan {context.path} --first",
            code="E061",
        )
    wanted = _wanted_effects(context, pipeline.available_effects)
    context.progress("fitting the best model")
    best = _best_fit(pipeline, train)
    present = [e.name for e in best.model.effects]
    rivals = rivals_of_diagnosis(context.answers["diagnose"], present, wanted)
    absent = with_absent_effects(best.model, pipeline.available_effects.values(), train)
    doubtful = {r.effect: without_effect(best.model, r.effect) for r in rivals if not r.present}
    expectation = Expectation(
        best.model,
        absent | doubtful,
        best.free,
        prior_information(len(absent) + len(doubtful), best.free),
        pipeline.horizon,
        context.config.compare.low_pass,
        deviations_of(train, best.residual),
    ).with_recordings(train)
    benches = recorded_benches([one.experiment for one in train])
    limits = limits_of(pipeline.rig, benches, context.config.plan.model_dump())
    checked = {r.name: expectation.others[r.effect] for r in rivals if r.effect in expectation.others}
    asked = [pipeline.available_effects[r.effect] for r in rivals]
    telling = [m.experiment.recording for m in train if any(m.is_sensitive_to(e) for e in asked)]
    return Basis(
        [b for b in benches if any(map(b.made, telling))] or benches,
        Safety(pipeline.rig, limits, models_to_check(best, checked)),
        expectation,
        rivals,
        context.answers["diagnose"]["data"],
    )


def _wanted_effects(context: Context, available: Mapping[str, Effect]) -> list[str]:
    wanted: list[str] = context.options.get("effects", [])
    for name in wanted:
        if name not in available:
            mend = did_you_mean(name, available)
            raise InputError("--effects", f'no effect "{name}"', "effects of the catalogue", mend, code="E030")
    return wanted


def _best_fit(pipeline: PipelineData, train: Sequence[ResidualModel]) -> Fit:
    """Return the fit of the model with the effects of the pipeline file and those that the diagnosis names."""
    given, where = pipeline.effects, f"{pipeline.context.path}, key model.effects"
    named = [n for n in pipeline.context.answers["diagnose"]["missing"] if n not in {e.name for e in given}]
    added = select_effects(named, pipeline.available_effects, where)
    guess = guess_base_model([one.experiment for one in train], pipeline.rig, pipeline.valve)
    return with_intervals(fit_model(guess, train, (*given, *added)), train)


def described_rig(context: Context) -> Basis:
    """Return a typical model of a rig that is only described; raises InputError where ``[rig]`` describes no bench."""
    config = context.config
    rig = _described(context)
    benches = described_benches(rig, config.plan.max_command)
    limits = limits_of(rig, benches, config.plan.model_dump())
    model = typical_model(rig, benches, "switching" if rig.valve_kind == "switching" else config.model.valve)
    horizon = AXIS_HORIZON if rig.has_cylinder else VESSEL_HORIZON
    samples = sample_residual_models(benches, limits, model, horizon)
    free, catalogue = free_parameters(model, samples), all_effects(plugin_files(config)).values()
    absent = with_absent_effects(model, [e for e in catalogue if e.side is None], samples)
    free = with_typical_spread(free)
    return Basis(
        benches,
        Safety(rig, limits, extreme_models(model)),
        Expectation(
            model,
            absent,
            free,
            prior_information(len(absent), free),
            horizon,
            usual=MODEL_ERROR,
        ),
        [],
        digest([config.rig.model_dump(mode="json"), config.plan.model_dump(mode="json")]),
        [NOISE_WARNING],
    )


def _described(context: Context) -> Rig:
    """Return the rig; raises InputError where no bench, no supply or no null command is described."""
    rig = context.config.to_rig()
    if not described_benches(rig):
        raise InputError(
            f"{context.path}, key rig",
            "neither a vessel nor a cylinder with its stroke",
            "[rig.vessel] volume, or [rig.cylinder] piston_area_1 and stroke",
            "describe the rig",
            code="E063",
        )
    if rig.supply_pressure is None:
        raise InputError(
            f"{context.path}, key rig.supply_pressure", "missing", 'such as "7 bar"', "state the supply", code="E063"
        )
    if rig.null_free:
        raise InputError(
            f"{context.path}, key rig.valve.null",
            '"identify", but there is no recording yet',
            "the command at which nothing flows: every command of the programme is about it",
            'such as null = "5 V", half the range of the valve',
            code="E063",
        )
    return rig
