"""What is missing from the model, how sure that is, what it changes, and what to do."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pneucli.messages import labelled, table, warnings
from pneucli.messages.compare import evaluation_error
from pneucli.messages.formatting import (
    format_interval,
    format_noise_ratio,
    format_number,
    format_parameters,
    format_percent,
    format_quantity,
    join_names,
)
from pneucli.quantities import signal_title

Answer = Mapping[str, Any]


def lines(answer: Answer, file: str, verbose: bool) -> Iterator[str]:
    """Yield the verdict, the evidence, what moves, what to do; behind ``-v`` ladder, candidates and limits."""
    yield from labelled("found", verdict_sentence(answer))
    yield from labelled("sure", evidence_summary(answer))
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


def verdict_sentence(answer: Answer) -> str:
    """Return the verdict in one sentence."""
    if answer["verdict"] == "missing-effect":
        named = [f"{c['effect']} ({c['title'][:1].lower()}{c['title'][1:]})" for c in _named(answer)]
        return f"the model lacks {join_names(named)}"
    if answer["verdict"] == "adequate":
        return "nothing is missing that these recordings could show"
    return f"{answer['verdict']}: {answer['sentence']}"


def describe_discrepancy(unexplained: Answer) -> str:
    """Return what is known of what no effect accounts for: where it is, of what it is a function, how much of it."""
    share = ""
    if unexplained.get("share"):
        fitted = unexplained.get("law") == "a sine"  # a period is found in all recordings, none is left out of it
        what, held = (
            ("This", "")
            if fitted
            else (f"A function of {unexplained['variable']}", " in recordings that were left out")
        )
        share = f" {what} explains {format_percent(unexplained['share'])} of it{held}."
    return f"What remains is {discrepancy_character(unexplained)}: {discrepancy_location(unexplained)}.{share}"


def discrepancy_character(unexplained: Answer) -> str:
    """Return as what the unknown acts, over which signal, and over which others as well."""
    law = f" ({unexplained['law']})" if unexplained.get("law") else ""
    return f"{unexplained['character']}{law}" + "".join(
        f", or of {signal_title(name)}" for name in unexplained.get("also_over") or []
    )


def discrepancy_location(unexplained: Answer) -> str:
    """Return in which channel the unknown is, and how large."""
    return f"{unexplained['channel']} errs by {format_number(unexplained['times_noise'], 2)} times its noise ({unexplained['subsystem']})"


def evidence_summary(answer: Answer) -> str:
    """Return the evidence: how the error moves, on which recordings, with which size, and what else it could be."""
    if answer["verdict"] in ("adequate", "inconclusive"):
        return f"{error_reduction(answer)}; {detectability_summary(answer)}"
    named = [f"{c['effect']} {format_parameters(c['parameters'])}{probability_clause(c)}" for c in _named(answer)]
    parts = [error_reduction(answer), *named, *([equivalence_clause(answer)] if named else [])]
    if left := answer.get("unexplained_share"):
        parts.append(f"{format_percent(left)} of the error beyond noise stays")
    return "; ".join(parts)


def probability_clause(candidate: Answer) -> str:
    """Return how probable an effect is, with its set where it has one; nothing where that is not stated."""
    if candidate.get("confidence") is None:
        return ""
    of = ", or one that it cannot be told from," if candidate["indistinguishable_from"] else ""
    return f"{of} is there with {format_percent(candidate['confidence'])} probability"


def error_reduction(answer: Answer) -> str:
    """Return what becomes of the error with what is named, on the recordings that it is judged by."""
    first, last = answer["ladder"][0], selected_step(answer)
    use, before = evaluation_error({"train": first["error_train"], "test": first["error_test"]})
    on = VALIDATION_PHRASES["apart" if use == "test" else answer.get("held_out", "none")]
    if first is last:
        return f"the error is {format_noise_ratio(before)} × noise {on}"
    after = last[f"error_{use}"]
    moves = "rises" if before and after and after > before else "falls"
    return f"the error {moves} from {format_noise_ratio(before)} to {format_noise_ratio(after)} × noise {on}"


def selected_step(answer: Answer) -> Answer:
    """Return the rung with all that is named; what was tried after it does not count."""
    first: Answer = answer["ladder"][0]
    return next((step for step in reversed(answer["ladder"]) if step["add"] in answer["missing"]), first)


def equivalence_clause(answer: Answer) -> str:
    """Return what the named effects cannot be told from."""
    equals = sorted({other for c in _named(answer) for other in c["indistinguishable_from"]})
    if equals:
        return f"these recordings cannot tell it from {join_names(equals)}"
    return "no other effect of the catalogue explains these recordings as well"


def parameter_shifts(answer: Answer) -> str:
    """Return which other parameters move when the effects are added."""
    moved = [
        f"{m['parameter']} {format_quantity(m['from'], m['unit'], 3)} → {format_quantity(m['to'], m['unit'], 3)}"
        f"{'' if m['plausible'] else ' (not plausible)'}"
        for m in answer.get("moved") or []
    ]
    return ", ".join(moved)


def changes_since_baseline(answer: Answer) -> str:
    """Return what changed since the old model, or from which sizes on a change would have shown."""
    if answer["changes"]:
        return "; ".join(describe_change(one) for one in answer["changes"])
    unseen = [one for one in answer["since"]["unseen"] if one["plausible"]]
    sizes = [f"{one['name']} by {format_quantity(one['size'], one['unit'], 2)}" for one in unseen[:3]]
    text = f"nothing changed that {len(answer['since']['unseen'])} parameters and effects would show"
    text += f"; from these sizes on a change would have been named: {join_names(sizes)}" if sizes else ""
    unknown = "; how much the rig differs from date to date without a change is not known (--repeat)"
    return text if answer["since"].get("repeatability") else text + unknown


def describe_change(one: Answer) -> str:
    """Return one change: from what to what, how sure, and what else it could be."""
    before = "nothing" if one["before"] is None else format_quantity(one["before"], one["unit"], 3)
    after = "–" if one["ci95"] is None else format_interval(one["after"], one["unit"], one["ci95"])
    twins = f", or {join_names(one['indistinguishable_from'])}" if one["indistinguishable_from"] else ""
    chance = format_number(max(1.0 - one["confidence"], 1e-12), 1)
    return f"{one['name']}{twins} changed from {before} to {after} (chance of a false alarm {chance})"


def next_step(answer: Answer, file: str) -> str:
    """Return what to do next, with the command."""
    parts = [f"pneucli add {file} --suggested"] if answer["missing"] else []
    if answer.get("next_experiment"):
        parts.append(answer["next_experiment"])
    return "; or: ".join(parts) or f"pneucli run {file}"


def remaining_discrepancy(answer: Answer) -> str:
    """Return what stays beyond noise, and where: the largest discrepancy; nothing where none is known."""
    found = answer.get("discrepancy") or []
    if not found:
        return ""
    worst = max(found, key=lambda one: one["size"])
    over = f", over {worst['over']}" if worst.get("over") else ""
    lasts = f", lasting {format_quantity(worst['time_constant_s'], 's', 2)}" if worst.get("time_constant_s") else ""
    return f"What remains: {worst['channel']} by {format_noise_ratio(worst['size'])} × noise ({worst['subsystem']}{over}{lasts})."


def detectability_summary(answer: Answer) -> str:
    """Return how much of the catalogue would have shown, with an example: absent is not the same as invisible."""
    known = answer.get("detectable", [])
    able = [describe_detection_limit(one) for one in known if one["size"] is not None]
    if not able:
        return "no other effect of the catalogue would have shown"
    return f"{len(able)} of {len(known)} other effects would have shown, such as {able[0]}"


def describe_detection_limit(one: Answer) -> str:
    """Return from which size on an effect would have shown, and where it acts then."""
    if one["size"] is None:
        return str(one["would_show"])
    where = [f", {at['parameter']} {format_quantity(at['value'], at['unit'], 2)}" for at in one.get("where", [])]
    return f"{one['effect']} ({one['parameter']} {format_quantity(one['size'], one['unit'], 2)}{''.join(where)})"


REJECTION_REASONS = {
    "cannot-show": "These recordings could not show it: no recording feels it, or none would at any plausible size.",
    "not-promising": "The residual holds too little of what it would leave there; it was not fitted.",
    "vanishes": "Fitted, it vanishes: the recordings want none of it.",
    "at-bound": "It would have to be larger or smaller than is plausible: fitted, it stands at a bound.",
    "below-resolution": "Fitted, it is a time shorter than the sampling can tell from none.",
    "not-significant": "Adding it changes no more than chance would.",
    "immaterial": "What it takes off the error is too little to matter.",
    "not-on-held-out": "It helps where it was fitted, but not for certain on recordings that were not fitted.",
    "raises-error": "It fits each part by itself, but the error of the whole model rises with it.",
    "needless": "It helps alone, but beside what was taken nothing is left for it.",
    "contradicted-by-reading": "Samples at ambient pressure in these recordings refute it.",
    "explained-by-unknown": (
        "It more likely stands in for something unknown: it takes too little, is too small or not sure enough beside "
        "what remains."
    ),
    "explained-by-signal": "A function of one signal explains more in its place: it stands in for something unknown.",
}
"""What is said of an effect that is not named, by its ``reason``: the only place."""
VALIDATION_PHRASES = {
    "apart": "on recordings that were not fitted",
    "by turns": "on the fitted recordings (each held out in turn)",
    "none": "on the fitted recordings (none was held out)",
}


def reason_sentence(candidate: Answer, missing: Sequence[str], held_out: str, looks_like: str = "") -> str:
    """Return why a candidate is named or not, in a sentence that a person understands."""
    if not candidate["supported"]:
        return f"{candidate['title']}. {REJECTION_REASONS[candidate['reason']]}"
    if candidate["effect"] not in missing:
        alike = join_names([n for n in candidate["indistinguishable_from"] if n in missing])
        return f"{candidate['title']}: in place of {alike} it explains these recordings as well; they cannot tell."
    errors = [format_number(candidate[f"error_{when}"], 3) for when in ("before", "after")]
    text = f"{candidate['title']}: adding it takes the error from {errors[0]} to {errors[1]} times the noise"
    return f"{text} {VALIDATION_PHRASES[held_out]}. {looks_like}".rstrip()


def _named(answer: Answer) -> list[Answer]:
    return [c for c in answer["candidates"] if c["effect"] in answer["missing"]]


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
        yield from labelled(
            "", f"{format_parameters(c['parameters'])}; error with it {format_number(c['error_after'], 3)} × noise"
        )
        yield from labelled("", c["why"])
    yield ""
    others = [c for c in answer["candidates"] if not c["parameters"]]
    for reason in dict.fromkeys(c["reason"] for c in others):
        alike = join_names([c["effect"] for c in others if c["reason"] == reason])
        yield from labelled("untried", f"{alike}. {REJECTION_REASONS[reason]}")
