"""``diagnose``: the missing physical effects, their probabilities and equivalents, and the next experiment."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from pneucli.compare.error_regions import beyond_fitted
from pneucli.config.recording_sources import plugin_files
from pneucli.diagnose import executor_refit
from pneucli.diagnose.adequacy import LackOfFit, within_parameter_uncertainty
from pneucli.diagnose.candidate import Candidate, Decision, Reason
from pneucli.diagnose.constraints import lacks_p2
from pneucli.diagnose.data import DiagnosisData, folds_of
from pneucli.diagnose.diagnosis import Diagnosis, diagnose
from pneucli.diagnose.free_run_error import (
    FreeRunErrors,
    held_out_error,
    relative_error,
    remaining_error_share,
    removed_error_share,
)
from pneucli.diagnose.score import ErrorsByUse
from pneucli.diagnose.subsample import MAX_ERROR_SAMPLES
from pneucli.figure import Figure, to_answer
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.intervals import with_intervals
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.residuals import ForceBalanceInferredPressure, ResidualModel
from pneucli.memory import release_free_memory
from pneucli.messages.diagnose import (
    MIN_TOLD_PROBABILITY,
    Answer,
    CandidateAnswer,
    FlowVerdict,
    GivenModel,
    Step,
    reason_sentence,
    verdict_sentence,
)
from pneucli.messages.findings import tell
from pneucli.messages.ingest import implausibility_sentences
from pneucli.messages.progress import BASELINE_PROGRESS, FREE_RUN_PROGRESS, GIVEN_MODEL_PROGRESS
from pneucli.pipeline.graph import Context
from pneucli.pipeline.manifest import program_versions
from pneucli.simulate.model import Model
from pneucli.stages import history
from pneucli.stages.answer_parts import divergences, figures_of, per_vessel_volume, purpose_of
from pneucli.stages.changes import compare_with_baseline, fit_all_recordings, write_baseline
from pneucli.stages.diagnosis_answer import (
    SHAPE_FILE,
    detection_limits,
    fitted_sets,
    parameter_shift,
    proposed_experiment,
    unexplained_answer,
    write_diagnosis,
)
from pneucli.stages.pipeline_data import PipelineData

REPLACES_BASE: Reason = "replaces-base-parameter"


def run(context: Context) -> dict[str, Any]:
    """Diagnose the model with the effects of the pipeline file; return the answer that ``--json`` prints.

    Raises InputError where no recording can be fitted, ``--exclude`` names what is no effect, or ``--since`` no model.
    """
    pipeline = PipelineData.for_search(context)
    if not pipeline.recordings:
        from pneucli.stages.flow_diagnosis import diagnose_flow_only  # noqa: PLC0415 - few pipelines have a flow bench

        return diagnose_flow_only(pipeline)
    data, warnings = _diagnosis_data(pipeline)
    if subsampling := pipeline.subsampling:
        warnings.append(tell("diagnosis-subsampled", **subsampling))
    guess = pipeline.guess()
    context.progress(GIVEN_MODEL_PROGRESS)
    impossible = pipeline.impossible
    compared = replace(pipeline, max_samples=MAX_ERROR_SAMPLES) if subsampling else pipeline
    errors = FreeRunErrors(compared.experiments)
    data = replace(
        data,
        modelled_parts=guess.excluded_parts,
        free_run_errors=errors,
        judge_fit=errors.judge,
        implausible=bool(impossible),
    )
    model, found = _run_diagnosis(pipeline, data, guess, implausibility_sentences(impossible))
    release_free_memory()  # the derivatives of all candidates
    context.progress(BASELINE_PROGRESS)
    joint_fit = fit_all_recordings(pipeline, data, model)
    if context.options.get("baseline"):
        write_baseline(pipeline, data, joint_fit)
    estimates = with_intervals(joint_fit, [*data.train, *data.held_out]).estimates
    parameters = figures_of([per_vessel_volume(e, pipeline) for e in estimates])
    since, changes = None, None
    if context.options.get("since"):
        since, changes = compare_with_baseline(pipeline, data, context.options["since"])
    found = replace(
        found,
        warnings=[*warnings, *found.warnings],
        thinned=subsampling,
        plausibility=pipeline.ingested.plausibility,
        contradicted=pipeline.contradicted,
        parameters=_without_replaced_intervals(parameters, found.candidates),
        flow=_flow_answer(pipeline),
        since=since,
        changes=changes,
    )
    answer = to_answer(found)
    return {**answer, **history.record_model(context, answer, SHAPE_FILE)}


def _without_replaced_intervals(
    parameters: Mapping[str, Figure], candidates: Sequence[CandidateAnswer]
) -> dict[str, Figure]:
    """Return the parameters, those without their intervals whose place an effect may take, in part or in whole."""
    replaced = {n for c in candidates if c.reason == REPLACES_BASE for n in c.indistinguishable_from}
    return {name: _without_interval(one) if name in replaced else one for name, one in parameters.items()}


def _without_interval(one: Figure) -> Figure:
    return replace(one, low=-math.inf, high=math.inf)


def _flow_answer(pipeline: PipelineData) -> FlowVerdict | None:
    """Return the entry about steady benches; None where the pipeline records none."""
    if not pipeline.flow_recordings:
        return None
    from pneucli.stages.flow_diagnosis import flow_diagnosis  # noqa: PLC0415 - few pipelines have a flow bench

    flow = flow_diagnosis(pipeline)
    assert flow is not None
    return FlowVerdict(flow.verdict, flow.missing, flow.ladder, flow.sentence)


def _run_diagnosis(
    pipeline: PipelineData, data: DiagnosisData, guess: Model, impossible: Sequence[str]
) -> tuple[Model, Answer]:
    """Diagnose, write the tables, and return the fitted given model and the answer.

    ``impossible`` has a sentence for each finding that forbids a verdict.
    """
    context, plugins = pipeline.context, plugin_files(pipeline.context.config)
    with executor_refit.open_refits(context.options.get("executor"), context.out, plugins, program_versions) as refits:
        found = diagnose(replace(data, run_refits=refits), fit_model(guess, data.train, pipeline.effects))
    context.progress(FREE_RUN_PROGRESS)
    answer = _answer(pipeline, data, found, impossible)
    write_diagnosis(pipeline, data, found, answer)
    return found.path.models[0].model, answer


def unmeasured_pressure_warnings(residual_models: Sequence[ResidualModel]) -> list[str]:
    """Return warnings about recordings of a piston on which a pressure acts that was not recorded."""
    inferred: dict[tuple[str, ...], list[str]] = {}
    for one in residual_models:
        if isinstance(one, ForceBalanceInferredPressure):
            inferred.setdefault(one.experiment.inferred_pressures, []).append(one.experiment.recording.name)
    found = [
        tell("pressure-inferred", recordings=", ".join(names), pressures=" and ".join(which))
        for which, names in inferred.items()
    ]
    missing = [one.experiment.recording.name for one in residual_models if lacks_p2(one)]
    found += [tell("p2-missing", recordings=", ".join(missing))] if missing else []
    blind = [one.experiment.recording.name for one in residual_models if one.experiment.lacks_pressures]
    return found + ([tell("no-pressure", recordings=", ".join(blind))] if blind else [])


def parameter_uncertainty_warnings(held_out: Sequence[LackOfFit]) -> list[str]:
    """Return warnings about held-out recordings whose error is within the uncertainty of the parameters."""
    within = within_parameter_uncertainty(held_out)
    return [tell("within-uncertainty", channel=r.channel, ratio=r.ratio) for r in within]


def _diagnosis_data(pipeline: PipelineData) -> tuple[DiagnosisData, list[str]]:
    train, test = (pipeline.residual_models(use) for use in ("train", "test"))
    folds = () if test else folds_of(train)
    warnings = [] if test else [tell("cross-validated" if folds else "no-held-out")]
    warnings += unmeasured_pressure_warnings(train)
    effects = {n: e for n, e in pipeline.available_effects.items() if n not in pipeline.excluded_effects}
    base_effects = tuple(e.name for e in pipeline.effects)
    progress = pipeline.context.progress
    return DiagnosisData(train, test, effects, base_effects=base_effects, progress=progress, folds=folds), warnings


def _answer(pipeline: PipelineData, data: DiagnosisData, found: Diagnosis, impossible: Sequence[str]) -> Answer:
    assert isinstance(data.free_run_errors, FreeRunErrors)
    errors = [dict(data.free_run_errors(fitted.model)) for fitted in found.path.models]
    given, selected = found.path.models[0].model, found.path.last.model
    in_same_units = data.free_run_errors(selected, given)
    beyond, within = beyond_fitted(data.free_run_errors.comparisons(selected))
    answer = Answer(
        schema="pneucli/diagnose/1",
        pipeline=pipeline.context.config.name,
        model=GivenModel([e.name for e in pipeline.effects]),
        data=pipeline.data_digest,
        held_out=validation_method(data),
        excluded=pipeline.excluded_effects,
        forced=bool(pipeline.context.options.get("force", False)),
        impossible=impossible,
        verdict=found.verdict,
        missing=found.missing,
        ladder=[Step(add, e["train"], e["test"]) for add, e in zip([None, *found.path.added], errors, strict=True)],
        candidates=[_candidate_answer(pipeline, data, found, decision) for decision in found.decisions],
        unexplained_share=remaining_error_share(errors[0], in_same_units),
        explained_share=removed_error_share(errors[0], in_same_units),
        relative_error=relative_error(errors[0], in_same_units),
        purpose=purpose_of(data.free_run_errors.channels(selected), pipeline.context.config.compare.tolerance),
        lack_of_fit=found.lack_of_fit,
        free_run=divergences(data.free_run_errors.free_runs(found.path.last.fit)),
        beyond_fitted=beyond,
        error_within_fitted=within,
        next_experiment=proposed_experiment(data, found),
        detectable=detection_limits(found, pipeline),
        discrepancy=found.discrepancies,
        moved=[parameter_shift(one, pipeline) for one in found.parameter_shifts],
        unexplained=None if found.unexplained is None else unexplained_answer(found.unexplained),
        sets=fitted_sets(found),
        warnings=[]
        if found.unexplained
        else parameter_uncertainty_warnings(found.path.test),  # an unmodelled effect would raise these errors, too
    )
    return replace(answer, sentence=verdict_sentence(answer))


def _parameters(pipeline: PipelineData, found: Fit, effect: str) -> dict[str, Figure]:
    estimates = [per_vessel_volume(e, pipeline) for e in found.estimates if e.name.startswith(f"{effect}.")]
    return {name.partition(".")[2]: value for name, value in figures_of(estimates).items()}


def _candidate_answer(
    pipeline: PipelineData, data: DiagnosisData, found: Diagnosis, decision: Decision
) -> CandidateAnswer:
    assert data.free_run_errors is not None
    name, candidate = decision.effect.name, decision.candidate
    fitted = candidate.full if candidate else found.path.models[0]
    confidence = found.confidence.get(name)
    told = decision.supported or (confidence is not None and confidence.of_set >= MIN_TOLD_PROBABILITY)
    before: ErrorsByUse = {"train": None, "test": None}
    after = before
    if told and candidate:  # simulations and intervals of what is not told would take longer than its fit
        before, after = (data.free_run_errors(one.model) for one in (candidate.reduced, fitted))
    shown = found.fit if name in found.missing else data.with_intervals(fitted) if told else fitted.fit
    parameters = _parameters(pipeline, shown, name)
    replaces = candidate is not None and decision.reason == REPLACES_BASE
    answer = CandidateAnswer(
        effect=name,
        title=decision.effect.title,
        error_before=held_out_error(before),
        error_after=held_out_error(after),
        beside=_beside(found, candidate),
        parameters=parameters if told else {n: _without_interval(p) for n, p in parameters.items()},
        indistinguishable_from=candidate.replaces if replaces and candidate else _equivalents(found, name),
        supported=decision.supported,
        reason=decision.reason,
        confidence=None if confidence is None else round(confidence.of_set, 4),
        confidence_alone=None if confidence is None else round(confidence.alone, 4),
        share=None if held_out_error(before) is None else removed_error_share(before, after) or 0.0,
        residual_share=None if candidate is None else 1.0 - candidate.full.cost / candidate.reduced.cost,
        evidence=found.evidence[name]._asdict() if name in found.evidence else None,
    )
    why = reason_sentence(answer, found.missing, validation_method(data), decision.effect.looks_like)
    return replace(answer, why=why)


def _beside(found: Diagnosis, candidate: Candidate | None) -> list[str]:
    """Return the effects that the model of a candidate has beside those of the given model and the candidate's own."""
    given = found.path.models[0].effect_names
    return [] if candidate is None else [e for e in candidate.reduced.effect_names if e not in given]


def _equivalents(found: Diagnosis, name: str) -> list[str]:
    """Return the effects that are indistinguishable from an added effect, or from an equivalent of a named one."""
    if name in found.equivalents:
        return list(found.equivalents[name])
    sets = ([n, *(e for e in found.equivalents[n] if e != name)] for n in found.missing if name in found.equivalents[n])
    return next(sets, [])


def validation_method(data: DiagnosisData) -> str:
    """Return how recordings were held out: apart, by turns, or none."""
    return "apart" if data.held_out else "by turns" if data.folds else "none"
