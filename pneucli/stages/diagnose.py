"""``diagnose``: which physical effect is missing, how sure that is, what else it could be, and what to measure next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from pneucli.config.recording_sources import plugin_files
from pneucli.diagnose import executor_refit
from pneucli.diagnose.adequacy import Remainder, allowed_for
from pneucli.diagnose.candidate import Decision
from pneucli.diagnose.cross_validation import turns_of
from pneucli.diagnose.data import Bench, State
from pneucli.diagnose.detectability import Detectable
from pneucli.diagnose.diagnosis import Diagnosis, diagnose, how_to_tell
from pneucli.diagnose.discrepancy import Discrepancy, Unknown
from pneucli.diagnose.experiment_design import separation
from pneucli.diagnose.free_run_error import ShownErrors, left_over, taken_away, told
from pneucli.diagnose.posterior import lacks_p2
from pneucli.diagnose.subsample import MOST
from pneucli.errors import InputError, did_you_mean
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.intervals import with_intervals
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.guesses.friction_and_valve import first_guess
from pneucli.identify.residuals import Inferred, View
from pneucli.memory import give_back
from pneucli.messages.diagnose import why
from pneucli.pipeline.context import Context
from pneucli.pipeline.manifest import identity
from pneucli.simulate.model import Model
from pneucli.stages import history
from pneucli.stages.changes import keep_reference, since
from pneucli.stages.diagnose_sentence import sentence
from pneucli.stages.identify import as_ratio, parameter_answer
from pneucli.stages.pipeline_data import Study
from pneucli.stages.tables.diagnosis import SHAPE, write_diagnosis

BY_TURNS = 'no recording has use = "test": each is held out in turn, from a model fitted without it'
THINNED = "{used} of {samples} samples are diagnosed: of the longest recordings stretches, spread evenly over them"
INFERRED_P2 = "{}: p2 was not recorded and follows from the model; a force like that of a spring can hide in its start"
NO_P2 = "{}: chamber 2 is shut or driven and p2 was not recorded, so what acts on the piston cannot be told: record p2"
LEFT_OPEN = (
    "{} of recordings that were not fitted errs by {:.2g} times its noise, no more than the fitted parameters' own "
    "uncertainty allows (95 %): record such commands or speeds for the fit, too"
)
NONE_HELD_OUT = "no recording to hold out: what is found rests on the fitted recordings alone"


def run(context: Context) -> dict[str, Any]:
    """Diagnose the model with the effects of the pipeline file; return the answer that ``--json`` prints.

    Raises InputError where no recording can be fitted, ``--exclude`` names what is no effect, or ``--since`` no model.
    """
    study = Study(context, most=MOST)
    bench, warnings = _bench(study)
    if thinned := _thinned(study):
        warnings.append(THINNED.format(**thinned))
    if not bench.train:
        raise InputError(
            f"{context.path}, key recordings", "no recording to train on", 'at least one with use = "train"'
        )
    context.progress("fitting the model as it is", 0.2)
    fitted = [view.experiment for view in bench.train]
    guess = first_guess(fitted, study.rig, study.valve)
    implausible = bool(context.answers["ingest"]["plausibility"])
    bench = replace(bench, covered=guess.valve.covers, shown=ShownErrors(study.experiments), implausible=implausible)
    model, answer = _diagnosed(study, bench, guess)
    give_back()  # the derivatives of all that was tried
    answer["warnings"], answer["thinned"] = [*warnings, *answer["warnings"]], thinned
    answer["plausibility"] = context.answers["ingest"]["plausibility"]
    context.progress("what later comparisons need", 0.95)
    whole = keep_reference(study, bench, model)
    answer["parameters"] = parameter_answer([as_ratio(e, study) for e in whole.estimates])
    if asked := context.options.get("since"):
        answer |= since(study, bench, asked)
    return answer | history.keep(context, answer, SHAPE)


def _diagnosed(study: Study, bench: Bench, guess: Model) -> tuple[Model, dict[str, Any]]:
    """Return the fitted model without what is missing, and what is said of that; write its tables."""
    base = fit_model(guess, bench.train, study.effects)
    context, plugins = study.context, plugin_files(study.context.config)
    with executor_refit.through(context.options.get("executor"), context.out, plugins, identity) as refits:
        found = diagnose(replace(bench, refits=refits), base)
    context.progress("the error that the user sees", 0.9)
    answer = _answer(study, bench, found)
    write_diagnosis(study, bench, found, answer)
    return base.model, answer


def _thinned(study: Study) -> dict[str, int] | None:
    """Return how many samples there are and how many are diagnosed; None where these are all."""
    samples = sum(int(r["samples"]) for r in study.context.answers["ingest"]["recordings"])
    used = sum(one.time.size for one in study.recordings)
    return {"samples": samples, "used": used} if used < samples else None


def unread_p2(views: Sequence[View]) -> list[str]:
    """Return what is to be said of views of a shut or driven chamber 2 whose pressure was not recorded."""
    inferred = [view.experiment.recording.name for view in views if isinstance(view, Inferred)]
    blind = [view.experiment.recording.name for view in views if lacks_p2(view)]
    return [text.format(", ".join(names)) for text, names in ((INFERRED_P2, inferred), (NO_P2, blind)) if names]


def left_open(held_out: Sequence[Remainder]) -> list[str]:
    """Return what is to be said of recordings that the model misses by no more than its parameters may be off."""
    return [LEFT_OPEN.format(r.channel, r.ratio) for r in allowed_for(held_out)]


def _bench(study: Study) -> tuple[Bench, list[str]]:
    train, test = (study.views(use, whitened=True) for use in ("train", "test"))
    turns = () if test else turns_of(train)
    warnings = [] if test else [BY_TURNS if turns else NONE_HELD_OUT]
    warnings += unread_p2(train)
    excluded = study.context.options.get("exclude", [])
    for name in excluded:
        if name not in study.known_effects:
            mend = did_you_mean(name, study.known_effects)
            raise InputError("--exclude", f'no effect "{name}"', "an effect of the catalogue", mend)
    effects = {n: e for n, e in study.known_effects.items() if n not in excluded}
    steps = iter(range(1, 10_000))

    def progress(text: str) -> None:
        n = next(steps)
        study.context.progress(text, 0.25 + 0.65 * n / (n + 40.0))  # how many steps there are, the data decide

    given = tuple(e.name for e in study.effects)
    return Bench(train, test, effects, given=given, progress=progress, turns=turns), warnings


def _answer(study: Study, bench: Bench, found: Diagnosis) -> dict[str, Any]:
    assert bench.shown is not None
    rungs = [dict(bench.shown(state.model)) for state in found.found.rungs]
    ladder = [
        {"add": add, "error_train": e["train"], "error_test": e["test"]}
        for add, e in zip([None, *found.found.added], rungs, strict=True)
    ]
    settled = with_intervals(_settled(found).fit, bench.train)
    candidates = [_candidate(study, bench, found, settled, decision) for decision in found.decisions]
    pairs = [(n, other) for n in found.missing for other in found.equals[n]]
    rest = None if found.unknown is None else _unknown(found.unknown)
    following = " ".join(_tell_apart(bench, found, a, b) for a, b in pairs[:2])
    return {
        "schema": "pneucli/diagnose/1",
        "pipeline": study.context.config.name,
        "model": {"effects": [e.name for e in study.effects]},
        "data": study.data,
        "held_out": held_out(bench),
        "excluded": study.context.options.get("exclude", []),
        "verdict": found.verdict,
        "missing": list(found.missing),
        "ladder": ladder,
        "candidates": candidates,
        "unexplained_share": left_over(rungs[0], rungs[-1]),
        "next_experiment": following or _next(bench, found),
        "sentence": sentence(found, rungs, rest),
        "detectable": [_detectable(d) for d in found.detectable],
        "discrepancy": [_discrepancy(d) for d in found.left],
        "moved": [
            {"parameter": m.parameter, "from": m.before, "to": m.after, "unit": m.unit, "plausible": m.plausible}
            for m in found.moved
        ],
        "unexplained": rest,
        "warnings": [] if found.unknown else left_open(found.found.test),  # what is unknown widens errors, too
    }


def _unknown(one: Unknown) -> dict[str, Any]:
    return {
        "subsystem": one.subsystem,
        "channel": one.channel,
        "times_noise": one.ratio,
        "variable": one.variable,
        "character": one.character,
        "law": one.law,
        "share": one.share,
        "also_over": list(one.alike),
    }


def _detectable(one: Detectable) -> dict[str, Any]:
    return {
        "effect": one.effect.name,
        "parameter": one.parameter.name,
        "size": one.size if one.plausible else None,
        "unit": one.parameter.unit,
        "where": [{"parameter": p.name, "value": value, "unit": p.unit} for p, value in one.where.items()],
        "would_show": one.would_show,
    }


def _discrepancy(one: Discrepancy) -> dict[str, Any]:
    return {
        "subsystem": one.subsystem,
        "channel": one.channel,
        "size": one.size,
        "time_constant_s": one.time_constant,
        "over": one.over,
        "share": one.share,
    }


def _parameters(study: Study, found: Fit, effect: str) -> dict[str, Any]:
    mine = [as_ratio(e, study) for e in found.estimates if e.name.startswith(f"{effect}.")]
    return {name.partition(".")[2]: value for name, value in parameter_answer(mine).items()}


def _settled(found: Diagnosis) -> State:
    """Return the model with all that is named, before what was tried after it and is not."""
    places = [i for i, name in enumerate(found.found.added, 1) if name in found.missing]
    return found.found.rungs[max(places, default=0)]


def _candidate(study: Study, bench: Bench, found: Diagnosis, settled: Fit, decision: Decision) -> dict[str, Any]:
    assert bench.shown is not None
    name, trial = decision.effect.name, decision.trial
    state = trial.state if trial else found.found.rungs[0]
    before, after = (bench.shown(s.model) for s in ((trial.before, state) if trial else (state, state)))
    unchanged = decision.reason == "cannot-show"
    said = {
        "effect": name,
        "title": decision.effect.title,
        "error_before": told(before),
        "error_after": told(after) if trial or unchanged else None,
        "parameters": _parameters(study, settled if name in found.missing else state.fit, name),
        "indistinguishable_from": _alike(found, name),
        "supported": decision.supported,
        "reason": decision.reason,
        "confidence": round(found.confidence[name].of_set, 4) if name in found.confidence else None,
        "confidence_alone": round(found.confidence[name].alone, 4) if name in found.confidence else None,
        "share": None if trial is None or told(before) is None else taken_away(before, after) or 0.0,
        "evidence": found.evidence[name]._asdict() if name in found.evidence else None,
    }
    return said | {"why": why(said, found.missing, held_out(bench), decision.effect.looks_like)}


def _alike(found: Diagnosis, name: str) -> list[str]:
    """Return what explains the recordings as well as an effect that was added, or that stands beside a named one."""
    if name in found.equals:
        return list(found.equals[name])
    sets = ([n, *(e for e in found.equals[n] if e != name)] for n in found.missing if name in found.equals[n])
    return next(sets, [])


def held_out(bench: Bench) -> str:
    """Return how recordings were held out: apart, by turns, or none."""
    return "apart" if bench.held_out else "by turns" if bench.turns else "none"


def _tell_apart(bench: Bench, found: Diagnosis, name: str, other: str) -> str:
    """What separates two effects: as declared, and the manoeuvre in which both fitted models differ most."""
    text = how_to_tell(bench.effects[name], bench.effects[other])
    rival = next(t.state.model for t in found.found.places[name].rivals if t.effect.name == other)
    best = separation(found.found.last.model, rival, [*bench.train, *bench.held_out])
    if best is None:
        return f"{text} No manoeuvre that both fitted models were run through separates them by more than noise."
    return (
        f"{text} Of the manoeuvres that both fitted models were run through, this separates them most: "
        f"{best.manoeuvre}; {best.channel} would differ by {best.times_noise:.2g} times its noise (rms)."
    )


def _next(bench: Bench, found: Diagnosis) -> str | None:
    if found.unknown is not None:
        where = found.unknown.variable or "each signal"
        doubted = [n for n in found.found.added if n not in found.missing]
        return "".join(f"Whether it is {n}: {bench.effects[n].separate} " for n in doubted) + (
            f"What remains stands in {found.unknown.channel} ({found.unknown.subsystem}). Repeat a recording "
            f"unchanged, then one with a different range or order of {where}: "
            "what comes back over it belongs to the rig."
        )
    blind = [d for d in found.detectable if not d.plausible]
    if found.verdict in ("adequate", "inconclusive") and blind:
        return f"These recordings could not have shown {blind[0].effect.name}: {blind[0].effect.separate}"
    return None
