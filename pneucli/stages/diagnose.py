"""``diagnose``: which physical effect is missing, how sure that is, what else it could be, and what to measure next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from pneucli.config.recording_sources import plugin_files
from pneucli.diagnose import executor_refit
from pneucli.diagnose.adequacy import LackOfFit, within_parameter_uncertainty
from pneucli.diagnose.candidate import Decision
from pneucli.diagnose.cross_validation import folds_of
from pneucli.diagnose.data import DiagnosisData, FittedModel
from pneucli.diagnose.detectability import MinimumDetectableEffect
from pneucli.diagnose.diagnosis import Diagnosis, diagnose, distinguishing_experiment
from pneucli.diagnose.discrepancy import Discrepancy, UnexplainedResidual
from pneucli.diagnose.experiment_design import most_discriminating_experiment
from pneucli.diagnose.free_run_error import FreeRunErrors, held_out_error, remaining_error_share, removed_error_share
from pneucli.diagnose.posterior import lacks_p2
from pneucli.diagnose.subsample import MAX_SAMPLES
from pneucli.errors import InputError, did_you_mean
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.intervals import with_intervals
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.guesses.friction_and_valve import guess_base_model
from pneucli.identify.residuals import ForceBalanceInferredP2, ResidualModel
from pneucli.memory import release_free_memory
from pneucli.messages.diagnose import reason_sentence
from pneucli.pipeline.context import Context
from pneucli.pipeline.manifest import program_versions
from pneucli.plausibility.repaired import REPAIRS
from pneucli.simulate.model import Model
from pneucli.stages import history
from pneucli.stages.changes import compare_with_baseline, write_baseline
from pneucli.stages.compare import purpose_answer
from pneucli.stages.diagnose_sentence import verdict_sentence
from pneucli.stages.identify import parameters_answer, per_vessel_volume
from pneucli.stages.pipeline_data import PipelineData
from pneucli.stages.tables.diagnosis import SHAPE_FILE, write_diagnosis

CROSS_VALIDATED = 'no recording has use = "test": each is held out in turn, from a model fitted without it'
SUBSAMPLED = "{used} of {samples} samples are diagnosed: of the longest recordings stretches, spread evenly over them"
P2_INFERRED = "{}: p2 was not recorded and follows from the model; a force like that of a spring can hide in its start"
P2_MISSING = (
    "{}: chamber 2 is shut or driven and p2 was not recorded, so what acts on the piston cannot be told: record p2"
)
ERROR_WITHIN_UNCERTAINTY = (
    "{} of recordings that were not fitted errs by {:.2g} times its noise, no more than the fitted parameters' own "
    "uncertainty allows (95 %): record such commands or speeds for the fit, too"
)
NO_HELD_OUT_RECORDING = "no recording to hold out: what is found rests on the fitted recordings alone"


def run(context: Context) -> dict[str, Any]:
    """Diagnose the model with the effects of the pipeline file; return the answer that ``--json`` prints.

    Raises InputError where no recording can be fitted, ``--exclude`` names what is no effect, or ``--since`` no model.
    """
    study = PipelineData(context, max_samples=MAX_SAMPLES)
    bench, warnings = _diagnosis_data(study)
    if thinned := _subsampling(study):
        warnings.append(SUBSAMPLED.format(**thinned))
    if not bench.train:
        raise InputError(
            f"{context.path}, key recordings", "no recording to train on", 'at least one with use = "train"'
        )
    context.progress("fitting the model as it is", 0.2)
    fitted = [view.experiment for view in bench.train]
    guess = guess_base_model(fitted, study.rig, study.valve)
    implausible = any(one["check"] not in REPAIRS for one in context.answers["ingest"]["plausibility"])
    bench = replace(
        bench,
        modelled_parts=guess.valve.covers,
        free_run_errors=FreeRunErrors(study.experiments),
        implausible=implausible,
    )
    model, answer = _run_diagnosis(study, bench, guess)
    release_free_memory()  # the derivatives of all that was tried
    answer["warnings"], answer["thinned"] = [*warnings, *answer["warnings"]], thinned
    answer["plausibility"] = context.answers["ingest"]["plausibility"]
    context.progress("what later comparisons need", 0.95)
    whole = write_baseline(study, bench, model)
    answer["parameters"] = parameters_answer([per_vessel_volume(e, study) for e in whole.estimates])
    if asked := context.options.get("since"):
        answer |= compare_with_baseline(study, bench, asked)
    return answer | history.record_model(context, answer, SHAPE_FILE)


def _run_diagnosis(study: PipelineData, bench: DiagnosisData, guess: Model) -> tuple[Model, dict[str, Any]]:
    """Return the fitted model without what is missing, and what is said of that; write its tables."""
    base = fit_model(guess, bench.train, study.effects)
    context, plugins = study.context, plugin_files(study.context.config)
    with executor_refit.open_refits(context.options.get("executor"), context.out, plugins, program_versions) as refits:
        found = diagnose(replace(bench, run_refits=refits), base)
    context.progress("the error that the user sees", 0.9)
    answer = _answer(study, bench, found)
    write_diagnosis(study, bench, found, answer)
    return base.model, answer


def _subsampling(study: PipelineData) -> dict[str, int] | None:
    """Return how many samples there are and how many are diagnosed; None where these are all."""
    samples = sum(int(r["samples"]) for r in study.context.answers["ingest"]["recordings"])
    used = sum(one.time.size for one in study.recordings)
    return {"samples": samples, "used": used} if used < samples else None


def unmeasured_p2_warnings(views: Sequence[ResidualModel]) -> list[str]:
    """Return what is to be said of views of a shut or driven chamber 2 whose pressure was not recorded."""
    inferred = [view.experiment.recording.name for view in views if isinstance(view, ForceBalanceInferredP2)]
    blind = [view.experiment.recording.name for view in views if lacks_p2(view)]
    return [text.format(", ".join(names)) for text, names in ((P2_INFERRED, inferred), (P2_MISSING, blind)) if names]


def parameter_uncertainty_warnings(held_out: Sequence[LackOfFit]) -> list[str]:
    """Return what is to be said of recordings that the model misses by no more than its parameters may be off."""
    return [ERROR_WITHIN_UNCERTAINTY.format(r.channel, r.ratio) for r in within_parameter_uncertainty(held_out)]


def _diagnosis_data(study: PipelineData) -> tuple[DiagnosisData, list[str]]:
    train, test = (study.residual_models(use, whitened=True) for use in ("train", "test"))
    turns = () if test else folds_of(train)
    warnings = [] if test else [CROSS_VALIDATED if turns else NO_HELD_OUT_RECORDING]
    warnings += unmeasured_p2_warnings(train)
    excluded = study.context.options.get("exclude", [])
    for name in excluded:
        if name not in study.available_effects:
            mend = did_you_mean(name, study.available_effects)
            raise InputError("--exclude", f'no effect "{name}"', "an effect of the catalogue", mend)
    effects = {n: e for n, e in study.available_effects.items() if n not in excluded}
    steps = iter(range(1, 10_000))

    def progress(text: str) -> None:
        n = next(steps)
        study.context.progress(text, 0.25 + 0.65 * n / (n + 40.0))  # how many steps there are, the data decide

    given = tuple(e.name for e in study.effects)
    return DiagnosisData(train, test, effects, base_effects=given, progress=progress, folds=turns), warnings


def _answer(study: PipelineData, bench: DiagnosisData, found: Diagnosis) -> dict[str, Any]:
    assert isinstance(bench.free_run_errors, FreeRunErrors)
    rungs = [dict(bench.free_run_errors(state.model)) for state in found.path.models]
    ladder = [
        {"add": add, "error_train": e["train"], "error_test": e["test"]}
        for add, e in zip([None, *found.path.added], rungs, strict=True)
    ]
    settled = with_intervals(_selected_model(found).fit, bench.train)
    candidates = [_candidate_answer(study, bench, found, settled, decision) for decision in found.decisions]
    selected = _selected_model(found).model
    pairs = [(n, other) for n in found.missing for other in found.equivalents[n]]
    rest = None if found.unexplained is None else _unexplained_answer(found.unexplained)
    following = " ".join(_discriminating_experiment(bench, found, a, b) for a, b in pairs[:2])
    return {
        "schema": "pneucli/diagnose/1",
        "pipeline": study.context.config.name,
        "model": {"effects": [e.name for e in study.effects]},
        "data": study.data_digest,
        "held_out": validation_method(bench),
        "excluded": study.context.options.get("exclude", []),
        "verdict": found.verdict,
        "missing": list(found.missing),
        "ladder": ladder,
        "candidates": candidates,
        "unexplained_share": remaining_error_share(rungs[0], rungs[-1]),
        "explained_share": removed_error_share(rungs[0], bench.free_run_errors(selected)),
        "purpose": purpose_answer(bench.free_run_errors.channels(selected), study.context.config.compare.tolerance),
        "next_experiment": following or _next_experiment(bench, found),
        "sentence": verdict_sentence(found, rungs, rest),
        "detectable": [_detectability_answer(d) for d in found.detectable],
        "discrepancy": [_discrepancy_answer(d) for d in found.discrepancies],
        "moved": [
            {"parameter": m.parameter, "from": m.before, "to": m.after, "unit": m.unit, "plausible": m.plausible}
            for m in found.parameter_shifts
        ],
        "unexplained": rest,
        "warnings": []
        if found.unexplained
        else parameter_uncertainty_warnings(found.path.test),  # what is unknown widens errors, too
    }


def _unexplained_answer(one: UnexplainedResidual) -> dict[str, Any]:
    return {
        "subsystem": one.subsystem,
        "channel": one.channel,
        "times_noise": one.ratio,
        "variable": one.variable,
        "character": one.character,
        "law": one.law,
        "share": one.share,
        "also_over": list(one.other_signals),
    }


def _detectability_answer(one: MinimumDetectableEffect) -> dict[str, Any]:
    return {
        "effect": one.effect.name,
        "parameter": one.parameter.name,
        "size": one.size if one.plausible else None,
        "unit": one.parameter.unit,
        "where": [{"parameter": p.name, "value": value, "unit": p.unit} for p, value in one.where.items()],
        "would_show": one.would_show,
    }


def _discrepancy_answer(one: Discrepancy) -> dict[str, Any]:
    return {
        "subsystem": one.subsystem,
        "channel": one.channel,
        "size": one.size,
        "time_constant_s": one.time_constant,
        "over": one.over,
        "share": one.share,
    }


def _parameters(study: PipelineData, found: Fit, effect: str) -> dict[str, Any]:
    mine = [per_vessel_volume(e, study) for e in found.estimates if e.name.startswith(f"{effect}.")]
    return {name.partition(".")[2]: value for name, value in parameters_answer(mine).items()}


def _selected_model(found: Diagnosis) -> FittedModel:
    """Return the model with all that is named, before what was tried after it and is not."""
    places = [i for i, name in enumerate(found.path.added, 1) if name in found.missing]
    return found.path.models[max(places, default=0)]


def _candidate_answer(
    study: PipelineData, bench: DiagnosisData, found: Diagnosis, settled: Fit, decision: Decision
) -> dict[str, Any]:
    assert bench.free_run_errors is not None
    name, trial = decision.effect.name, decision.candidate
    state = trial.full if trial else found.path.models[0]
    before, after = (bench.free_run_errors(s.model) for s in ((trial.reduced, state) if trial else (state, state)))
    unchanged = decision.reason == "cannot-show"
    said = {
        "effect": name,
        "title": decision.effect.title,
        "error_before": held_out_error(before),
        "error_after": held_out_error(after) if trial or unchanged else None,
        "parameters": _parameters(study, settled if name in found.missing else state.fit, name),
        "indistinguishable_from": _equivalents(found, name),
        "supported": decision.supported,
        "reason": decision.reason,
        "confidence": round(found.confidence[name].of_set, 4) if name in found.confidence else None,
        "confidence_alone": round(found.confidence[name].alone, 4) if name in found.confidence else None,
        "share": None if trial is None or held_out_error(before) is None else removed_error_share(before, after) or 0.0,
        "evidence": found.evidence[name]._asdict() if name in found.evidence else None,
    }
    return said | {"why": reason_sentence(said, found.missing, validation_method(bench), decision.effect.looks_like)}


def _equivalents(found: Diagnosis, name: str) -> list[str]:
    """Return what explains the recordings as well as an effect that was added, or that stands beside a named one."""
    if name in found.equivalents:
        return list(found.equivalents[name])
    sets = ([n, *(e for e in found.equivalents[n] if e != name)] for n in found.missing if name in found.equivalents[n])
    return next(sets, [])


def validation_method(bench: DiagnosisData) -> str:
    """Return how recordings were held out: apart, by turns, or none."""
    return "apart" if bench.held_out else "by turns" if bench.folds else "none"


def _discriminating_experiment(bench: DiagnosisData, found: Diagnosis, name: str, other: str) -> str:
    """What separates two effects: as declared, and the manoeuvre in which both fitted models differ most."""
    text = distinguishing_experiment(bench.effects[name], bench.effects[other])
    rival = next(t.full.model for t in found.path.terms[name].rivals if t.effect.name == other)
    best = most_discriminating_experiment(found.path.last.model, rival, [*bench.train, *bench.held_out])
    if best is None:
        return f"{text} No manoeuvre that both fitted models were run through separates them by more than noise."
    return (
        f"{text} Of the manoeuvres that both fitted models were run through, this separates them most: "
        f"{best.manoeuvre}; {best.channel} would differ by {best.times_noise:.2g} times its noise (rms)."
    )


def _next_experiment(bench: DiagnosisData, found: Diagnosis) -> str | None:
    if found.unexplained is not None:
        where = found.unexplained.variable or "each signal"
        doubted = [n for n in found.path.added if n not in found.missing]
        return "".join(f"Whether it is {n}: {bench.effects[n].separate} " for n in doubted) + (
            f"What remains stands in {found.unexplained.channel} ({found.unexplained.subsystem}). Repeat a recording "
            f"unchanged, then one with a different range or order of {where}: "
            "what comes back over it belongs to the rig."
        )
    blind = [d for d in found.detectable if not d.plausible]
    if found.verdict in ("adequate", "inconclusive") and blind:
        return f"These recordings could not have shown {blind[0].effect.name}: {blind[0].effect.separate}"
    return None
