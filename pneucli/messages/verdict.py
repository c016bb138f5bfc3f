"""The verdict of a diagnosis with its warnings and detection limits, as sentences of the answer."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from pneucli.messages.compare import beyond_fitted_sentence, evaluation_error, excused_segments, free_run_sentence
from pneucli.messages.formatting import (
    format_noise_ratio,
    format_number,
    format_percent,
    format_quantity,
    format_signal,
    join_names,
)
from pneucli.quantities import signal_title

SHAPES = {
    "constant": "a constant",
    "proportional": "proportional to it",
    "sign": "a constant that changes sign with it",
    "signed-square": "growing with its square, sign kept",
    "line": "a straight line",
    "parabola": "a parabola",
}
PERIODIC_SHAPE = "a sine"
FREE_RUN = "an error of the complete simulation alone (by itself each subsystem fits)"
MAX_NAMED_SIGNALS = 2  # over which a discrepancy is as good a function as over the first
SHAPELESS = "an error that is no function of any signal"
Answer = Mapping[str, Any]
VALIDATION_PHRASES = {
    "apart": "on recordings that were not fitted",
    "by turns": "on the fitted recordings (each held out in turn)",
    "none": "on the fitted recordings (none was held out)",
}
CERTAIN = 0.9  # probability from which on an effect is stated without it; of such names 95 in 100 are right
MIN_TOLD_PROBABILITY = 0.3  # of an effect that is not named: about one in four of those below 0.5 is present


def verdict_sentence(answer: Answer) -> str:
    """Return the verdict: what is named and how much it explains, then what is left.

    This is the ``sentence`` of the answer of ``diagnose``; terminal, page, summary and fleet show it unchanged.

    Args:
        answer: The answer of ``diagnose``, complete but for this sentence.

    >>> ladder = [{"add": None, "error_train": 1.4, "error_test": 1.02}]
    >>> print(verdict_sentence({"verdict": "adequate", "missing": [], "ladder": ladder}))
    Nothing is missing that these recordings could show: the error is 1.02 × noise on recordings that were not fitted.
    What is left does not exceed noise and parameter uncertainty.
    """
    if answer.get("impossible"):
        return impossible_data_sentence(answer["impossible"])
    error = error_reduction(answer)
    if answer["verdict"] == "inconclusive":
        if (answer.get("lack_of_fit") or {}).get("undetermined"):
            return (
                f"No statement is possible: {error}, which the uncertainty of the fitted parameters may explain alone. "
                "Record such commands and speeds for the fit, too."
            )
        limits = answer["detectable"]
        undetectable = sum(not one["typical"] for one in limits)
        return (
            f"No statement is possible: {undetectable} of {len(limits)} effects are undetectable at a typical size; "
            f"{error}."
        )
    beyond = beyond_fitted_sentence(answer, selected_step(answer)["error_test"])
    parts = _remainder(answer), free_run_sentence(answer), beyond, _base_equivalents(answer)
    rest = " ".join(filter(None, parts))
    if answer["missing"]:
        return f"{_named_effects(answer)} {rest}"
    if answer["verdict"] == "adequate":
        return f"Nothing is missing that these recordings could show: {error}. {rest}"
    return f"No effect of the catalogue explains these recordings: {error}. {_likeliest_effect(answer)}{rest}"


def _base_equivalents(answer: Answer) -> str:
    """Return which effects these recordings cannot distinguish from parameters of the model."""
    found: dict[str, list[str]] = {}
    for c in answer.get("candidates", []):
        if c.get("reason") == "replaces-base-parameter":
            found.setdefault(join_names(c["indistinguishable_from"]), []).append(c["effect"])
    return " ".join(
        f"These recordings cannot distinguish {join_names(effects)} from {base}, which the model has: they determine "
        "only what both explain together."
        for base, effects in found.items()
    )


def _likeliest_effect(answer: Answer) -> str:
    """Return the most probable effect that is not named, with what it explains; nothing where all are improbable."""
    told = [c for c in answer["candidates"] if (c.get("confidence") or 0.0) >= MIN_TOLD_PROBABILITY]
    if not told:
        return ""
    best = max(told, key=lambda c: c["confidence"])
    before, after = (format_noise_ratio(best[key]) for key in ("error_before", "error_after"))
    others = join_names(best.get("beside") or [])
    change = f"added to {others}, it takes the error" if others else "with it the error goes"
    return (
        f"The likeliest, {best['effect']} ({best['title'][:1].lower()}{best['title'][1:]}), is present with "
        f"{100.0 * best['confidence']:.0f} % probability: {change} from {before} to {after} × noise. "
    )


def _named_effects(answer: Answer) -> str:
    """Return the named effects, how much they explain, and the effects that are indistinguishable from each."""
    named = [c for c in answer["candidates"] if c["effect"] in answer["missing"]]
    effects, lacks = join_names([_named_effect(c) for c in named]), "lacks"
    if any(_is_doubtful(c) for c in named):
        lacks = "probably lacks"
    share = answer.get("explained_share")
    subject, pronoun = ("it explains", "it") if len(named) == 1 else ("they explain", "them")
    explains = f"; {subject} {format_percent(share)} of the squared error beyond noise" if share else ""
    text = f"The model {lacks} {effects}: with {pronoun} {error_reduction(answer)}{explains}."
    for c in named:
        if equivalents := c["indistinguishable_from"]:
            one = pronoun if len(named) == 1 else c["effect"]
            text += f" These recordings cannot distinguish {one} from {join_names(sorted(equivalents))}."
    return text


def _named_effect(candidate: Answer) -> str:
    """Return an effect by name and title, with its probability where that leaves a doubt."""
    title = f"{candidate['title'][:1].lower()}{candidate['title'][1:]}"
    probable = f"; {100.0 * candidate['confidence']:.0f} % probable" if _is_doubtful(candidate) else ""
    return f"{candidate['effect']} ({title}{probable})"


def _is_doubtful(candidate: Answer) -> bool:
    """Return whether an effect is less probable than CERTAIN; where no probability is known, nothing is said of it."""
    return candidate["confidence"] is not None and candidate["confidence"] < CERTAIN


def _remainder(answer: Answer) -> str:
    """Return what is left with the named effects."""
    if rest := answer.get("unexplained"):
        text = f"What is left is {discrepancy_character(rest)}: {discrepancy_location(rest)}"
        return f"{text}; no effect of the catalogue explains it." if answer["missing"] else f"{text}."
    largest = largest_discrepancy(answer)
    where = f"; it is largest in {largest}" if largest else ""
    count = (answer.get("lack_of_fit") or {}).get("excused", 0)
    beside = f", but for {excused_segments(count)}, where little decides when a piston starts" if count else ""
    return f"What is left does not exceed noise and parameter uncertainty{beside}{where}."


def error_reduction(answer: Answer) -> str:
    """Return how the named effects change the error, and on which recordings."""
    first, last = answer["ladder"][0], selected_step(answer)
    use, before = evaluation_error({"train": first["error_train"], "test": first["error_test"]})
    on = VALIDATION_PHRASES["apart" if use == "test" else answer.get("held_out", "none")]
    if first is last:
        return f"the error is {format_noise_ratio(before)} × noise {on}"
    after, relative = last[f"error_{use}"], answer.get("relative_error")
    ratios = f"from {format_noise_ratio(before)} to {format_noise_ratio(after)} × noise"
    if format_noise_ratio(before) == format_noise_ratio(after):
        return f"the error stays at {format_noise_ratio(after)} × noise {on}"
    if not (before and after and after > before):
        return f"the error falls {ratios} {on}"
    rises = f"the error rises {ratios} {on}"
    if relative is None or relative >= 1.0:
        return rises
    return f"{rises}, no more than by chance: in mm and bar it falls to {format_percent(relative)}"


def selected_step(answer: Answer) -> Answer:
    """Return the step of the path with all named effects."""
    first: Answer = answer["ladder"][0]
    return next((step for step in reversed(answer["ladder"]) if step["add"] in answer["missing"]), first)


def impossible_data_sentence(findings: Sequence[str]) -> str:
    """Return why nothing was looked for: the first finding with its mend, and the number of others.

    Args:
        findings: Sentences of the findings, at least one.

    >>> print(impossible_data_sentence(["run_1, p1 below vacuum; gauge?", "run_1, x moves at 112 m/s"]))
    run_1, p1 below vacuum; gauge? (and 1 more). Recordings contradict the stated rig: no effect was looked for.
    """
    others = f" (and {len(findings) - 1} more)" if len(findings) > 1 else ""
    return f"{findings[0]}{others}. Recordings contradict the stated rig: no effect was looked for."


def detection_limit_sentence(
    title: str, parameter: str, size: float | None, unit: str, null: float | str | None, where: Sequence[str] = ()
) -> str:
    """Return from which size on an effect is detectable; None: at no plausible size.

    ``null`` is that of the parameter, at which the effect is absent; ``where`` has the values of parameters that say
    where, when or how fast the effect acts.
    """
    if size is None:
        return f"{title}: these recordings cannot detect it at any plausible size"
    limit = f"{format_quantity(size, unit, 2, trimmed=True)} ({'; '.join([parameter, *where])})"
    if null == 0.0:
        return f"{title}: detectable above {limit}"
    if null is None or null == math.inf:
        return f"{title}: detectable at {limit}"
    return f"{title}: detectable from a difference of {limit} on"


def location_phrase(parameter: str, value: float, unit: str) -> str:
    """Return the value of a parameter that says where, when or how fast an effect acts."""
    return f"{parameter} {format_quantity(value, unit, 2, trimmed=True)}"


def discrepancy_kind_text(
    kind: str, acts_as: Sequence[str], variable: str | None, *, share: float | None = None, period: float | None = None
) -> str:
    """Return as what a discrepancy acts, and over which signal.

    ``kind`` is that of :class:`pneucli.diagnose.discrepancy.UnexplainedResidual`, ``share`` the explained part of the
    squares, ``period`` in SI.
    """
    if variable is None:
        return FREE_RUN if kind == "free-run" else SHAPELESS
    what = " or ".join(_with_article(one) for one in acts_as) or "something"
    if kind == "periodic":
        return f"{what} that repeats over {signal_title(variable)}, period {format_signal(period or 0.0, variable)}"
    over = "that drifts over each recording" if variable == "time" else f", a function of {signal_title(variable)}"
    text = f"{what} {over}".replace(" ,", ",")
    return f"mostly irregular; {format_percent(share or 0.0)} of it is {text}" if kind == "irregular" else text


def _with_article(noun: str) -> str:
    return f"an {noun}" if noun[0] in "aeio" else f"a {noun}"


def explaining_signal(unexplained: Mapping[str, Any]) -> str:
    """Return how much of the unexplained residual a function of one signal explains; nothing where none does."""
    if not unexplained.get("share"):
        return ""
    share = format_percent(unexplained["share"])
    if unexplained.get("law") == PERIODIC_SHAPE:  # a period is estimated from all recordings
        return f"The period explains {share} of what is left."
    return f"A function of {unexplained['variable']} explains {share} of what is left in recordings that were left out."


def discrepancy_character(unexplained: Mapping[str, Any]) -> str:
    """Return as what the discrepancy acts, over which signal, and over which others equally well, the first by name."""
    shape = f" ({unexplained['law']})" if unexplained.get("law") else ""
    also = unexplained.get("also_over") or []
    named = len(also) if len(also) <= MAX_NAMED_SIGNALS + 1 else MAX_NAMED_SIGNALS
    others = [f", or of {signal_title(name)}" for name in also[:named]]
    if also[named:]:
        others.append(f", or of {len(also) - named} other signals")
    return f"{unexplained['character']}{shape}{''.join(others)}"


def discrepancy_location(unexplained: Mapping[str, Any]) -> str:
    """Return the channel of the discrepancy, its size, and the subsystem."""
    ratio = format_number(unexplained["times_noise"], 2)
    return f"{unexplained['channel']} errs by {ratio} times its noise ({unexplained['subsystem']})"


def largest_discrepancy(answer: Mapping[str, Any]) -> str:
    """Return the channel of the largest discrepancy in excess of noise with its size; nothing where there is none."""
    found = answer.get("discrepancy") or []
    if not found:
        return ""
    worst = max(found, key=lambda one: one["size"])
    over = f", over {worst['over']}" if worst.get("over") else ""
    duration = f", lasting {format_quantity(worst['time_constant_s'], 's', 2)}" if worst.get("time_constant_s") else ""
    return f"{worst['channel']}, {format_noise_ratio(worst['size'])} × its noise ({worst['subsystem']}{over}{duration})"
