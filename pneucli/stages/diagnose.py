"""``diagnose``: which physical effect is missing, how sure that is, what else it could be, and what to measure next."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pneucli.diagnose.detectable import Detectable
from pneucli.diagnose.diagnosis import Diagnosis, diagnose, how_to_tell
from pneucli.diagnose.errors import Errors, shown_error
from pneucli.diagnose.manoeuvres import separation
from pneucli.diagnose.search import WORTH, supported
from pneucli.diagnose.trial import Bench, State, Trial
from pneucli.errors import InputError, did_you_mean
from pneucli.identify.effects import fit_model
from pneucli.identify.start import first_guess
from pneucli.identify.views import View
from pneucli.pipeline.context import Context
from pneucli.stages import history
from pneucli.stages.diagnose_tables import SHAPE, write_diagnosis
from pneucli.stages.identify import as_ratio, parameter_answer
from pneucli.stages.study import Study

HELD_OUT = 3  # without test recordings, every third is held out


def run(context: Context) -> dict[str, Any]:
    """Diagnose the model with the effects of the pipeline file; return the answer that ``--json`` prints.

    Raises InputError where no recording can be fitted, or ``--exclude`` names what is no effect.
    """
    study = Study(context)
    bench, warnings = _bench(study)
    if not bench.train:
        raise InputError(
            f"{context.path}, key recordings", "no recording to train on", 'at least one with use = "train"'
        )
    context.progress("fitting the model as it is", 0.2)
    fitted = [view.experiment for view in bench.train]
    guess = first_guess(fitted, study.rig, study.valve)
    base = fit_model(guess, bench.train, study.effects)
    bench = replace(bench, covered=guess.valve.covers)
    errors = Errors.seen_by(base.model, study.experiments)
    found = diagnose(replace(bench, errors=errors.of, shown=lambda model: shown_error(model, study.experiments)), base)
    context.progress("the error that the user sees", 0.9)
    answer = _answer(study, bench, found)
    answer["warnings"] = warnings
    answer["plausibility"] = context.answers["ingest"]["plausibility"]
    write_diagnosis(study, bench, found, answer)
    return answer | history.keep(context, answer, SHAPE)


def _bench(study: Study) -> tuple[Bench, list[str]]:
    train, test = (study.views(use, whitened=True) for use in ("train", "test"))
    warnings = []
    if not test and len(train) >= HELD_OUT:
        train, test = _without_every_third(train)
        names = ", ".join(sorted({v.experiment.recording.name for v in test}))
        warnings.append(f'no recording has use = "test": {names} held out from the fits instead')
    elif not test:
        warnings.append("no recording to hold out: what is found rests on the fitted recordings alone")
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
    return Bench(train, test, effects, given=given, progress=progress), warnings


def _without_every_third(views: list[View]) -> tuple[list[View], list[View]]:
    names = list(dict.fromkeys(v.experiment.recording.name for v in views))
    held = set(names[HELD_OUT - 1 :: HELD_OUT])
    return (
        [v for v in views if v.experiment.recording.name not in held],
        [v for v in views if v.experiment.recording.name in held],
    )


def _answer(study: Study, bench: Bench, found: Diagnosis) -> dict[str, Any]:
    first = Errors.seen_by(found.found.rungs[0].model, study.experiments)
    rungs = [shown_error(state.model, study.experiments) for state in found.found.rungs]
    ladder = [
        {"add": add, "error_train": e["train"], "error_test": e["test"]}
        for add, e in zip([None, *found.found.added], rungs, strict=True)
    ]
    candidates = [_named(study, found, i, rungs) for i in range(len(found.found.added))]
    candidates += _others(study, bench, found, first, rungs[0])
    pairs = [(n, other) for n in found.missing for other in found.equals[n]]
    following = " ".join(_tell_apart(bench, found, a, b) for a, b in pairs[:2])
    return {
        "schema": "pneucli/diagnose/1",
        "pipeline": study.context.config.name,
        "model": {"effects": [e.name for e in study.effects]},
        "data": study.data,
        "excluded": study.context.options.get("exclude", []),
        "verdict": found.verdict,
        "missing": list(found.missing),
        "ladder": ladder,
        "candidates": candidates,
        "unexplained_share": _left(rungs[0], rungs[-1]),
        "next_experiment": following or _next(bench, found),
        "sentence": sentence(found, rungs),
        "detectable": [_detectable(d) for d in found.detectable],
        "moved": [
            {"parameter": m.parameter, "from": m.before, "to": m.after, "unit": m.unit, "plausible": m.plausible}
            for m in found.moved
        ],
        "unexplained": None
        if found.unknown is None
        else {
            "subsystem": found.unknown.subsystem,
            "channel": found.unknown.channel,
            "times_noise": found.unknown.ratio,
            "variable": found.unknown.variable,
            "character": found.unknown.character,
            "law": found.unknown.law,
        },
    }


def _detectable(one: Detectable) -> dict[str, Any]:
    return {
        "effect": one.effect.name,
        "parameter": one.parameter.name,
        "size": one.size if one.plausible else None,
        "unit": one.parameter.unit,
        "would_show": one.would_show,
    }


def _error(errors: dict[str, float | None]) -> float | None:
    return errors["train"] if errors["test"] is None else errors["test"]


def _parameters(study: Study, state: State, effect: str) -> dict[str, Any]:
    mine = [as_ratio(e, study) for e in state.fit.estimates if e.name.startswith(f"{effect}.")]
    return {name.partition(".")[2]: value for name, value in parameter_answer(mine).items()}


def _settled(found: Diagnosis) -> State:
    """Return the model with all that is named, before what was tried after it and is not."""
    places = [i for i, name in enumerate(found.found.added, 1) if name in found.missing]
    return found.found.rungs[max(places, default=0)]


def _named(study: Study, found: Diagnosis, i: int, rungs: list[dict[str, float | None]]) -> dict[str, Any]:
    name = found.found.added[i]
    before, after = _error(rungs[i]), _error(rungs[i + 1])
    effect = next(e for e in found.found.last.model.effects if e.name == name)
    equals = list(found.equals.get(name, ()))
    why = f"{effect.title}: adding it takes the error from {_number(before)} to {_number(after)} times the noise "
    why += (
        "on recordings that were not fitted."
        if found.found.rungs[0].test.size
        else "on recordings that were fitted; none was held out."
    )
    if name not in found.missing:
        why += (
            " It may only stand in for something unknown: it takes too little, recordings disagree, or the error rises."
        )
    return {
        "effect": name,
        "title": effect.title,
        "error_before": before,
        "error_after": after,
        "parameters": _parameters(study, _settled(found) if name in found.missing else found.found.last, name),
        "indistinguishable_from": equals,
        "supported": True,
        "why": f"{why} {effect.looks_like}",
    }


def _others(
    study: Study, bench: Bench, found: Diagnosis, errors: Errors, before: dict[str, float | None]
) -> list[dict[str, Any]]:
    trials = [
        t for t in (found.found.rounds[0] if found.found.rounds else ()) if t.effect.name not in found.found.added
    ]
    start = found.found.rungs[0]
    able = {t.effect.name for t in supported(bench, start, trials)}
    return [
        {
            "effect": t.effect.name,
            "title": t.effect.title,
            "error_before": _error(before),
            "error_after": _error(errors.of(t.state.model)),
            "parameters": _parameters(study, t.state, t.effect.name),
            "indistinguishable_from": [],
            "supported": t.effect.name in able,
            "why": _why_not(t, found, supported=t.effect.name in able),
        }
        for t in trials
    ]


def _why_not(trial: Trial, found: Diagnosis, *, supported: bool) -> str:
    title = f"Adding {trial.effect.name}"
    if any(trial.effect.name in equals for equals in found.equals.values()):
        return f"{title} instead explains these recordings as well; they cannot tell."
    if supported and found.missing:
        return f"{title} helps alone, but beside {' and '.join(found.missing)} it is not needed."
    if supported:
        return f"{title} helps, but less than what was taken instead."
    if trial.train.total < WORTH:
        return f"{title} does not lower the error at all."
    if trial.state.test.size and not trial.test.certain:
        return f"{title} helps where it was fitted, but not for certain on recordings that were not fitted."
    return f"{title} changes no more than chance would."


def _left(first: dict[str, float | None], last: dict[str, float | None]) -> float | None:
    """The share of the squared error beyond noise that remains."""
    before, after = _error(first), _error(last)
    if before is None or after is None:
        return None
    if before <= 1.0:
        return 0.0
    return min(max((after**2 - 1.0) / (before**2 - 1.0), 0.0), 1.0)


def _tell_apart(bench: Bench, found: Diagnosis, name: str, other: str) -> str:
    """What separates two effects: as declared, and the manoeuvre in which both fitted models differ most."""
    text = how_to_tell(bench.effects[name], bench.effects[other])
    rival = next(t.state.model for t in found.found.rivals[name] if t.effect.name == other)
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
    if found.verdict == "adequate" and blind:
        return f"These recordings could not have shown {blind[0].effect.name}: {blind[0].effect.separate}"
    return None


def sentence(found: Diagnosis, rungs: list[dict[str, float | None]]) -> str:
    """Return the verdict as an engineer would say it."""
    before, after = _number(_error(rungs[0])), _number(_error(rungs[-1]))
    titles = {e.name: e.title.lower() for e in found.found.last.model.effects}
    named = " and ".join(f"{titles[n]} ({n})" for n in found.missing)
    if found.verdict == "adequate":
        return f"Nothing in the residual is more than noise and known uncertainty (error {after} times the noise)."
    if found.verdict == "missing-effect":
        what = "it" if len(found.missing) == 1 else "them"
        text = f"The model lacks {named}: with {what} the error goes from {before} to {after} times the noise."
        equals = sorted({e for n in found.missing for e in found.equals[n]})
        return text + (f" These recordings cannot tell it from {', '.join(equals)}." if equals else "")
    assert found.unknown is not None
    text = f"{found.unknown.character.capitalize()}, something remains that no effect of the catalogue accounts for: "
    text += f"{found.unknown.channel} errs by {found.unknown.ratio:.2g} times its noise ({found.unknown.subsystem})."
    return text + (f" Beside it stands what helped: {named}." if named else "")


def _number(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.3g}"
