"""The diagnosis: verdict, evidence, parameter shifts, and the next step."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pneucli.messages import labelled, table, warnings
from pneucli.messages.formatting import (
    format_interval,
    format_noise_ratio,
    format_number,
    format_parameters,
    format_percent,
    format_plain,
    format_quantity,
    join_names,
)
from pneucli.messages.verdict import VALIDATION_PHRASES

Answer = Mapping[str, Any]


def lines(answer: Answer, file: str, verbose: bool) -> Iterator[str]:
    """Yield verdict, evidence, shifts and next step; with ``-v`` also path, candidates and detection limits."""
    yield from labelled("found", answer["sentence"])
    if evidence := evidence_summary(answer):
        yield from labelled("evidence", evidence)
    if changes := parameter_shifts(answer):
        yield from labelled("changes", changes)
    if "since" in answer:
        yield from labelled("since", changes_since_baseline(answer))
    yield from labelled("do", next_step(answer, file))
    yield from warnings(answer)
    if verbose:
        yield from _selection_path(answer)
        yield from _candidates(answer)
        yield from (
            line for one in answer.get("detectable", []) for line in labelled("limit", describe_detection_limit(one))
        )


def evidence_summary(answer: Answer) -> str:
    """Return the evidence behind the verdict: sizes and probabilities of the named effects, or detection limits.

    It is empty where nothing is named and something is left.
    """
    if answer.get("impossible"):
        return ""
    if answer["verdict"] in ("adequate", "inconclusive"):
        return detectability_summary(answer)
    found = [c for c in answer["candidates"] if c["effect"] in answer["missing"]]
    parts = [f"{c['effect']} {format_parameters(c['parameters'])}{probability_clause(c)}" for c in found]
    if found and not any(c["indistinguishable_from"] for c in found):
        parts.append("no other effect of the catalogue explains these recordings as well")
    return "; ".join(parts)


def probability_clause(candidate: Answer) -> str:
    """Return the probability of an effect or its equivalents; nothing where it is not stated."""
    if candidate.get("confidence") is None:
        return ""
    of = ", or one that is indistinguishable from it," if candidate["indistinguishable_from"] else ""
    return f"{of} is present with {format_percent(candidate['confidence'])} probability"


def parameter_shifts(answer: Answer) -> str:
    """Return the base parameters that the named effects change; nothing where none is named."""
    if not answer["missing"]:
        return ""
    moved = []
    for m in answer.get("moved") or []:
        values = dict.fromkeys(format_quantity(m[end], m["unit"], 3) for end in ("from", "to"))
        moved.append(f"{m['parameter']} {' → '.join(values)}{'' if m['plausible'] else ' (at its bound)'}")
    return ", ".join(moved)


def changes_since_baseline(answer: Answer) -> str:
    """Return the changes since the baseline, or the sizes from which a change is detectable."""
    if answer["changes"]:
        return "; ".join(describe_change(one) for one in answer["changes"])
    unseen = [one for one in answer["since"]["unseen"] if one["plausible"]]
    sizes = [f"{one['name']} by {format_quantity(one['size'], one['unit'], 2)}" for one in unseen[:3]]
    text = f"no change detected in {len(answer['since']['unseen'])} parameters and effects"
    text += f"; a change from these sizes on would have been named: {join_names(sizes)}" if sizes else ""
    unknown = "; the variation from date to date without a change is unknown (--repeat)"
    return text if answer["since"].get("repeatability") else text + unknown


def describe_change(one: Answer) -> str:
    """Return one change with its interval, its false-alarm probability, and its equivalents."""
    before = "nothing" if one["before"] is None else format_quantity(one["before"], one["unit"], 3)
    after = "–" if one["ci95"] is None else format_interval(one["after"], one["unit"], one["ci95"])
    equivalents = f", or {join_names(one['indistinguishable_from'])}" if one["indistinguishable_from"] else ""
    chance = format_number(max(1.0 - one["confidence"], 1e-12), 1)
    return f"{one['name']}{equivalents} changed from {before} to {after} (chance of a false alarm {chance})"


def next_step(answer: Answer, file: str, otherwise: str = "run") -> str:
    """Return what to do next, with the command; ``otherwise`` is that where nothing is left to record or to add."""
    if answer.get("impossible"):
        return f"mend the recordings; or, to have an answer all the same: pneucli diagnose {file} --force"
    parts = [f"pneucli add {file} --suggested"] if answer["missing"] else []
    if answer.get("next_experiment"):
        parts.append(answer["next_experiment"])
    return "; or: ".join(parts) or (otherwise and f"pneucli {otherwise} {file}")


def detectability_summary(answer: Answer) -> str:
    """Return how many effects of the catalogue are detectable, with an example.

    Effects that no residual can show have no limit; they are among the others all the same.
    """
    limits = answer.get("detectable", [])
    detectable = [describe_detection_limit(one) for one in limits if one["size"] is not None]
    if not detectable:
        return "no other effect of the catalogue is detectable"
    others = {c["effect"] for c in [*limits, *answer.get("candidates", [])]} - set(answer.get("missing", []))
    return f"{len(detectable)} of {len(others)} other effects are detectable, such as {detectable[0]}"


def describe_detection_limit(one: Answer) -> str:
    """Return the detection limit of an effect, and where it acts at this limit."""
    if one["size"] is None:
        return str(one["would_show"])
    where = [f", {at['parameter']} {format_quantity(at['value'], at['unit'], 2)}" for at in one.get("where", [])]
    return f"{one['effect']} ({one['parameter']} {format_quantity(one['size'], one['unit'], 2)}{''.join(where)})"


REJECTION_REASONS = {
    "cannot-show": "These recordings cannot detect it: no residual is sensitive to it, or to any plausible size of it.",
    "not-promising": "The residual contains too little of its signature; it was not fitted.",
    "vanishes": "The fit returns zero.",
    "replaces-base-parameter": "It changes the residuals as a parameter does that the model has.",
    "at-bound": "The fit ends at a bound of the plausible range.",
    "below-resolution": "The fitted time is too short for the sampling.",
    "not-significant": "The improvement is no larger than chance.",
    "interval-contains-null": "The 95 % interval of its size contains the value at which it is absent.",
    "varies-with-horizon": (
        "Its time changes where the model restarts half as often: it shortens what is predicted, and no part of the "
        "rig is late."
    ),
    "immaterial": "It explains too little of the error, is too small or too uncertain to be probably present.",
    "raises-error": "It improves a subsystem, but raises the error of the whole model.",
    "needless": "It helps by itself, but adds nothing to the effects that were selected.",
    "contradicted-by-reading": "Samples at ambient pressure in these recordings refute it.",
    "explained-by-unknown": (
        "It probably only resembles an effect outside the catalogue: it explains too little, is too small or too "
        "uncertain."
    ),
}
"""Why an effect is not named, by its ``reason``."""


def reason_sentence(candidate: Answer, missing: Sequence[str], held_out: str, looks_like: str = "") -> str:
    """Return why a candidate is named or not."""
    if not candidate["supported"]:
        text = f"{candidate['title']}. {REJECTION_REASONS[candidate['reason']]}"
        alike = join_names(candidate["indistinguishable_from"])
        return f"{text} These recordings cannot distinguish it from {alike}." if alike else text
    if candidate["effect"] not in missing:
        alike = join_names([n for n in candidate["indistinguishable_from"] if n in missing])
        return f"{candidate['title']}: in place of {alike} it explains these recordings equally well."
    errors = [format_number(candidate[f"error_{when}"], 3) for when in ("before", "after")]
    text = f"{candidate['title']}: with it the error goes from {errors[0]} to {errors[1]} times the noise"
    return f"{text} {VALIDATION_PHRASES[held_out]}. {looks_like}".rstrip()


def _explained(candidate: Answer) -> str:
    """Return the error with a candidate, or of one that is not told what its fit removes of the squared residuals."""
    beside = join_names([candidate["effect"], *(candidate.get("beside") or [])])
    if candidate["error_after"] is None:
        return f"{beside} explains {format_percent(max(candidate['residual_share'], 0.0))} of the squared residuals"
    return f"error with {beside} {format_number(candidate['error_after'], 3)} × noise"


def _selection_path(answer: Answer) -> Iterator[str]:
    yield ""
    rows = [
        (s["add"] or "model as it is", format_noise_ratio(s["error_test"]), format_noise_ratio(s["error_train"]))
        for s in answer["ladder"]
    ]
    yield from table(("with", "test, × noise", "train, × noise"), rows, texts=1)


def _candidates(answer: Answer) -> Iterator[str]:
    fitted = [c for c in answer["candidates"] if c["parameters"]]
    for c in fitted:
        yield ""
        yield from labelled("named" if c["effect"] in answer["missing"] else "tried", c["effect"])
        yield from labelled("", f"{format_parameters(c['parameters'])}; {_explained(c)}")
        yield from labelled("", c["why"])
    yield ""
    others = [c for c in answer["candidates"] if not c["parameters"]]
    for reason in dict.fromkeys(c["reason"] for c in others):
        alike = join_names([c["effect"] for c in others if c["reason"] == reason])
        yield from labelled("untried", f"{alike}. {REJECTION_REASONS[reason]}")


def distinguishing_experiment(names: tuple[str, str], procedures: tuple[str, str]) -> str:
    """Return how to distinguish two effects by the procedures that their declarations state."""
    one, other = procedures
    return f"To tell {names[0]} from {names[1]}: {one}" + (f" {other}" if other != one else "")


def discriminating_manoeuvre(manoeuvre: str | None, channel: str = "", times_noise: float = 0.0) -> str:
    """Return the simulated manoeuvre in which two models differ most; None: they differ by no more than noise."""
    if manoeuvre is None:
        return "In no simulated manoeuvre do the two fitted models differ by more than noise."
    return (
        f"In simulation the two fitted models differ most in this manoeuvre: {manoeuvre}; "
        f"{channel} differs by {format_plain(times_noise, 2)} times its noise (rms)."
    )


def discrepancy_experiment(
    procedures: Sequence[tuple[str, str]], channel: str, subsystem: str, variable: str | None
) -> str:
    """Return what to record about a discrepancy, with the procedure of each effect that may be it, by name."""
    tests = "".join(f"To test {name}: {procedure} " for name, procedure in procedures)
    return (
        f"{tests}The discrepancy is in {channel} ({subsystem}). Repeat a recording unchanged, then record "
        f"another range or order of {variable or 'each signal'}: what recurs over it belongs to the rig."
    )


def detecting_experiment(name: str, procedure: str) -> str:
    """Return what to record to detect an effect that these recordings cannot detect."""
    return f"These recordings cannot detect {name}: {procedure}"
