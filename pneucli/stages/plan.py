"""``plan``: the next experiment, from the last diagnosis or, with ``--first``, from the rig's description alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.diagnose.subsample import MAX_SAMPLES
from pneucli.errors import InputError
from pneucli.pipeline.context import Context
from pneucli.plan.entropy import expected_entropy, powers_to_decide
from pneucli.plan.evaluation import Comparison, evaluate_candidates
from pneucli.plan.power import Power, power_table
from pneucli.plan.rivals import Rival, with_typical_effect
from pneucli.plan.selection import (
    Chosen,
    Evaluated,
    Objective,
    choose_sequence,
    entropy_objective,
    grouped_by_setup,
    size_objective,
    total_information,
    width_objective,
)
from pneucli.plan.sizes import effect_sizes
from pneucli.quantities import Z95
from pneucli.simulate.model import parameter_value
from pneucli.stages.pipeline_data import PipelineData
from pneucli.stages.plan_answer import expected_rows, limits_too_narrow, plan_answer, rival_answer
from pneucli.stages.plan_files import write_plan
from pneucli.stages.plan_first import first_programme
from pneucli.stages.plan_study import PlanStudy, progress_within

Array = NDArray[np.float64]

DEFAULT_MINUTES = 3.0
MAX_HALF_WIDTH = 10.0  # of an effect's size: a wider interval says nothing about it
MIN_SECONDS = 15.0  # s of machine time: one recording and one that is held out


def run(context: Context) -> dict[str, Any]:
    """Plan the next experiment, write its files, and return the answer that ``--json`` prints.

    Raises InputError where the limits leave no manoeuvre, or an effect or parameter is unknown.
    """
    if context.options.get("first"):
        return first_programme(context)
    study = PlanStudy(PipelineData(context, max_samples=MAX_SAMPLES))
    context.progress("fitting the best model", 0.02)
    wanted: list[str] = context.options.get("parameters", [])
    positions = study.positions_of(wanted)
    context.progress("fitting the rivals", 0.08)
    rivals = study.rivals
    others = [rival.model for rival in rivals[1:]]
    comparison = study.comparison(others)
    candidates, refused = evaluate_candidates(
        study.benches, study.limits, comparison, study.pipeline.rig, progress_within(context, 0.25, 0.8)
    )
    objective = _objective(study, rivals, positions)
    chosen = _chosen(study, candidates, objective)
    context.progress("power of the plan", 0.9)
    powers = _powers(study, chosen)
    refused = [*refused, *study.safety.refused]
    answer = plan_answer(study, chosen, refused)
    covariance = study.best.covariance
    prior, errors = [r.prior_odds for r in rivals], [r.size_error for r in rivals[1:]]
    before = expected_entropy(np.zeros((len(others), len(others))), prior, errors) if others else 0.0
    gram = total_information(chosen).between_rivals(covariance) if chosen and others else None
    after = before if gram is None else expected_entropy(gram, prior, errors)
    found = [0.0] * len(others) if gram is None else powers_to_decide(gram, prior, errors)
    answer["rivals"] = [rival_answer(r, study.best.model) for r in rivals]
    answer["entropy"] = {"before": before, "after": after, "unit": "bit"}
    answer["expected"] = expected_rows(rivals[1:], found)
    answer["parameters"] = _narrowed(study, chosen, positions)
    if study.context.options.get("effects"):
        answer["sizes"] = _sizes(study, chosen, rivals)
    return write_plan(answer, chosen, powers, study, (comparison, [r.name for r in rivals[1:]]))


def _objective(study: PlanStudy, rivals: Sequence[Rival], positions: Sequence[int]) -> Objective:
    """Return what the plan lowers: the width of parameters, the error of named effects' sizes, or the entropy."""
    covariance = study.best.covariance
    if positions:
        return width_objective(covariance, positions)
    if len(rivals) == 1:  # nothing is in question: every parameter of the model becomes more certain
        return width_objective(covariance, range(len(study.best.free)))
    sizes = effect_sizes(study.best, rivals[1:])
    if study.context.options.get("effects") and sizes:
        return size_objective(sizes, covariance)
    return entropy_objective([r.prior_odds for r in rivals], [r.size_error for r in rivals[1:]], covariance)


def _chosen(study: PlanStudy, candidates: Sequence[Evaluated], objective: Objective) -> list[Chosen]:
    """Choose from commands; a manoeuvre by hand only where it alone tells more than the best command alone."""
    seconds = 60.0 * float(study.context.options.get("minutes", DEFAULT_MINUTES))
    if seconds < MIN_SECONDS:
        raise InputError("--minutes", f"{seconds / 60.0:g}", f"at least {MIN_SECONDS / 60.0:g}", code="E001")
    commands = [c for c in candidates if not c.manoeuvre.by_hand]
    study.context.progress("choosing", 0.82)
    best = min((objective(c.information) for c in commands), default=np.inf)
    manual = [c for c in candidates if c.manoeuvre.by_hand and objective(c.information) < best]
    chosen = choose_sequence([*commands, *manual], objective, seconds, study.safety)
    if not chosen and not commands:
        raise limits_too_narrow(f"{study.context.path}, key plan")
    return grouped_by_setup(chosen, study.benches)


def _powers(study: PlanStudy, chosen: Sequence[Chosen]) -> list[Power]:
    """Return the power table of the chosen recordings for every effect that the best model lacks."""
    model, fitted = study.best.model, [c for c in chosen if c.manoeuvre.use == "train"]
    there = {e.name for e in model.effects}
    absent = [
        e
        for e in study.pipeline.available_effects.values()
        if e.name not in there and e.part not in model.valve.covers and any(m.is_sensitive_to(e) for m in study.train)
    ]
    pairs = [(e, m) for e in absent if (m := with_typical_effect(model, e, study.train)) is not None]
    if not pairs or not fitted:
        return []
    effects, models = [list(part) for part in zip(*pairs, strict=True)]
    comparison: Comparison = study.comparison(models)
    told = [t for c in fitted if (t := comparison.information(c.manoeuvre)) is not None]
    total = told[0]
    for one in told[1:]:
        total = total + one
    return power_table(effects, models, total, study.best.covariance, model)


def _sizes(study: PlanStudy, chosen: Sequence[Chosen], rivals: Sequence[Rival]) -> list[dict[str, Any]]:
    """Return the half widths of the 95 % intervals of the effects' sizes, each effect alone beside the best model.

    None: the recordings so far, or those of the plan, do not show the effect.
    """
    if not chosen:
        return []
    covariance, told = study.best.covariance, total_information(chosen)
    rows = []
    for one in effect_sizes(study.best, rivals[1:]):
        known = one if one.fitted else replace(one, error=np.inf)
        widths = [Z95 * one.distance * error for error in (known.error, known.error_after(told, covariance))]
        before, after = (width if width < MAX_HALF_WIDTH * one.distance else None for width in widths)
        unit = one.parameter.unit
        rows.append({"name": one.name, "unit": unit, "half_width_before": before, "half_width_after": after})
    return rows


def _narrowed(study: PlanStudy, chosen: Sequence[Chosen], positions: Sequence[int]) -> list[dict[str, Any]]:
    """Return the half widths of the parameters' 95 % intervals, before and after the plan."""
    if not chosen:
        return []
    before = study.best.covariance
    after = total_information(chosen).parameter_covariance(before)
    rows = []
    for i in positions:
        f = study.best.free[i]
        slope = Z95 * abs(f.derivative(parameter_value(study.best.model, f.name)))
        rows.append(
            {
                "name": f.name,
                "unit": f.unit,
                "half_width_before": float(slope * np.sqrt(before[i, i])),
                "half_width_after": float(slope * np.sqrt(after[i, i])),
            }
        )
    return rows
