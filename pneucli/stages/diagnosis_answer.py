"""Parts of the answer of ``diagnose``: numbers, and the sentences that messages make of them."""

from __future__ import annotations

from typing import Any

from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.detectability import MinimumDetectableEffect
from pneucli.diagnose.diagnosis import Diagnosis, ParameterShift
from pneucli.diagnose.discrepancy import Discrepancy, UnexplainedResidual
from pneucli.messages.discrepancy import PERIODIC_SHAPE, SHAPES, discrepancy_kind_text
from pneucli.messages.experiment_design import (
    detecting_experiment,
    discrepancy_experiment,
    discriminating_manoeuvre,
    distinguishing_experiment,
)
from pneucli.messages.plan import manoeuvre_text
from pneucli.messages.verdict import MIN_TOLD_PROBABILITY, detection_limit_sentence, location_phrase
from pneucli.plan.discrimination import most_discriminating_manoeuvre
from pneucli.stages.leak_answer import vessel_scale
from pneucli.stages.pipeline_data import PipelineData
from pneucli.stages.plan_answer import manoeuvre_answer


def unexplained_answer(one: UnexplainedResidual) -> dict[str, Any]:
    """Return the entry about the unexplained residual."""
    return {
        "subsystem": one.subsystem,
        "channel": one.channel,
        "times_noise": one.ratio,
        "variable": one.variable,
        "character": discrepancy_kind_text(one.kind, one.acts_as, one.variable, share=one.share, period=one.period),
        "law": PERIODIC_SHAPE if one.kind == "periodic" else SHAPES.get(one.simple_shape or ""),
        "share": one.share,
        "also_over": list(one.other_signals),
    }


def detectability_answer(one: MinimumDetectableEffect, study: PipelineData) -> dict[str, Any]:
    """Return the entry about the detection limit of an effect."""
    factor, unit = vessel_scale(f"{one.effect.name}.{one.parameter.name}", one.parameter.unit, study)
    size = factor * one.size if one.plausible else None
    return {
        "effect": one.effect.name,
        "parameter": one.parameter.name,
        "size": size,
        "unit": unit,
        "typical": one.typical,
        "where": [{"parameter": p.name, "value": value, "unit": p.unit} for p, value in one.where.items()],
        "would_show": _detection_limit(one, size, unit),
    }


def _detection_limit(one: MinimumDetectableEffect, size: float | None, unit: str) -> str:
    where = [location_phrase(p.title or p.name, value, p.unit) for p, value in one.where.items()]
    name = one.parameter.title or one.parameter.name
    return detection_limit_sentence(one.effect.title, name, size, unit, one.parameter.null, where)


def shift_answer(one: ParameterShift, study: PipelineData) -> dict[str, Any]:
    """Return the entry about a base parameter that the added effects changed."""
    factor, unit = vessel_scale(one.parameter, one.unit, study)
    sizes = {"from": factor * one.before, "to": factor * one.after}
    return {"parameter": one.parameter, **sizes, "unit": unit, "plausible": one.plausible}


def discrepancy_answer(one: Discrepancy) -> dict[str, Any]:
    """Return the entry about the discrepancy of a channel."""
    return {
        "subsystem": one.subsystem,
        "channel": one.channel,
        "size": one.size,
        "time_constant_s": one.time_constant,
        "over": one.over,
        "share": one.share,
    }


def _discriminating_experiment(data: DiagnosisData, found: Diagnosis, name: str, other: str) -> str:
    """Return how to distinguish two effects: as declared, and the manoeuvre in which both fitted models differ most."""
    procedures = data.effects[name].separate, data.effects[other].separate
    rival = next(c.full.model for c in found.path.terms[name].rivals if c.effect.name == other)
    best = most_discriminating_manoeuvre(found.path.last.model, rival, [m.experiment for m in data.residual_models])
    simulated = (
        discriminating_manoeuvre(None)
        if best is None
        else discriminating_manoeuvre(manoeuvre_text(manoeuvre_answer(best.manoeuvre)), best.channel, best.times_noise)
    )
    return f"{distinguishing_experiment((name, other), procedures)} {simulated}"


def proposed_experiment(data: DiagnosisData, found: Diagnosis) -> str | None:
    """Return the next experiment: for indistinguishable effects, the discrepancy, or an undetectable effect."""
    if data.implausible:
        return None
    pairs = [(n, other) for n in found.missing for other in found.equivalents[n]]
    if pairs:
        return " ".join(_discriminating_experiment(data, found, a, b) for a, b in pairs[:2])
    if (rest := found.unexplained) is not None:
        told = [j for j in found.path.refused if j.probability >= MIN_TOLD_PROBABILITY]
        effects = [j.decision.effect for j in sorted(told, key=lambda j: -j.probability)]
        return discrepancy_experiment(
            [(e.name, e.separate) for e in effects], rest.channel, rest.subsystem, rest.variable
        )
    undetectable = [d.effect for d in found.detectable if not d.plausible]
    if found.verdict in ("adequate", "inconclusive") and undetectable:
        return detecting_experiment(undetectable[0].name, undetectable[0].separate)
    return None
