"""The answer of ``diagnose``: verdict, evidence, parameter shifts, and the next step."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pneucli.figure import Figure, optional
from pneucli.messages import StageAnswer, each, labelled, table
from pneucli.messages.changes import Change, Since, changes_since_baseline
from pneucli.messages.compare import (
    BeyondFitted,
    Divergence,
    Errors,
    LackOfFit,
    LeftOut,
    Purpose,
    beyond_fitted_sentence,
    evaluation_error,
    excused_segments,
    free_run_sentence,
)
from pneucli.messages.formatting import (
    format_noise_ratio,
    format_number,
    format_parameters,
    format_percent,
    format_quantity,
    format_signal,
    join_names,
)
from pneucli.messages.ingest import Implausible
from pneucli.quantities import signal_title

PATH_TITLES = ("with", "test, × noise", "train, × noise")
VALIDATION_PHRASES = {
    "apart": "on recordings that were not fitted",
    "by turns": "on the fitted recordings (each held out in turn)",
    "none": "on the fitted recordings (none was held out)",
}


@dataclass(frozen=True)
class GivenModel:
    """The effects of the model that was diagnosed."""

    effects: Sequence[str]


@dataclass(frozen=True)
class Step:
    """A step of the selection path: the effect that was added, and the errors over noise with it."""

    add: str | None
    error_train: float | None
    error_test: float | None

    @property
    def error(self) -> Errors:
        """The errors by use."""
        return {"train": self.error_train, "test": self.error_test}

    @property
    def row(self) -> tuple[str, ...]:
        """The row of a table under ``PATH_TITLES``."""
        return self.add or "model as it is", format_noise_ratio(self.error_test), format_noise_ratio(self.error_train)


@dataclass(frozen=True)
class CandidateAnswer:
    """An effect that was looked for (interface, sections 3 and 6).

    ``beside`` has the effects that the model of both errors has beside those of the given model, ``residual_share`` the
    part of the squared residuals that its fit removes.
    """

    effect: str
    title: str
    error_before: float | None
    error_after: float | None
    beside: Sequence[str]
    parameters: Mapping[str, Figure]
    indistinguishable_from: Sequence[str]
    supported: bool
    reason: str
    confidence: float | None
    confidence_alone: float | None
    share: float | None
    residual_share: float | None
    evidence: Mapping[str, Any] | None
    why: str = ""

    @property
    def named(self) -> str:
        """Its name with its title in lower case."""
        return f"{self.effect} ({self.title[:1].lower()}{self.title[1:]}"


@dataclass(frozen=True)
class Place:
    """Where, when or how fast an effect acts: the value of a parameter."""

    parameter: str
    value: float
    unit: str


@dataclass(frozen=True)
class DetectionLimit:
    """From which size on an effect is detectable; None: at no plausible size. ``typical``: a typical one is."""

    effect: str
    parameter: str
    size: float | None
    unit: str
    typical: bool
    where: Sequence[Place]
    would_show: str


@dataclass(frozen=True)
class Discrepancy:
    """What remains in one channel of one subsystem with all named effects.

    ``size`` is its rms over that of noise, ``time_constant_s`` its correlation time where that is known, ``over`` the
    signal of which it is a function, if any, ``share`` its part of all squares in excess of noise.
    """

    subsystem: str
    channel: str
    size: float
    time_constant_s: float | None
    over: str | None
    share: float


@dataclass(frozen=True)
class FittedSet:
    """Effects that were fitted together, and the cost of a reading with them: about 1 where only noise is left."""

    effects: Sequence[str]
    cost: float

    @property
    def row(self) -> tuple[str, str]:
        """The row of a table."""
        return ", ".join(self.effects) or "model as it is", format_number(self.cost, 4)


@dataclass(frozen=True)
class Shift:
    """A base parameter that the named effects changed; not ``plausible`` where it ended at a bound."""

    parameter: str
    from_: float
    to: float
    unit: str
    plausible: bool


@dataclass(frozen=True)
class Unexplained:
    """The largest discrepancy, as what it acts, and over which signals."""

    subsystem: str
    channel: str
    times_noise: float
    variable: str | None
    character: str
    law: str | None
    share: float | None
    also_over: Sequence[str]


@dataclass(frozen=True)
class FlowVerdict:
    """What the diagnosis of the steady benches of a pipeline says, beside that of its recordings over time."""

    verdict: str
    missing: Sequence[str]
    ladder: Sequence[Step]
    sentence: str


@dataclass(frozen=True)
class Answer(StageAnswer):
    """Which physical effect is missing (interface, sections 3, 6 and 7)."""

    model: GivenModel
    data: str
    held_out: str
    excluded: Sequence[str]
    forced: bool
    impossible: Sequence[str]
    verdict: str
    missing: Sequence[str]
    ladder: Sequence[Step]
    candidates: Sequence[CandidateAnswer]
    unexplained_share: float | None
    explained_share: float | None
    relative_error: float | None
    purpose: Purpose | None
    lack_of_fit: LackOfFit | None
    free_run: Sequence[Divergence]
    beyond_fitted: Sequence[BeyondFitted]
    error_within_fitted: float | None
    next_experiment: str | None
    detectable: Sequence[DetectionLimit]
    discrepancy: Sequence[Discrepancy]
    moved: Sequence[Shift]
    unexplained: Unexplained | None
    warnings: Sequence[str]
    sentence: str = ""
    thinned: Mapping[str, int] | None = None
    plausibility: Sequence[Implausible] = ()
    contradicted: Sequence[LeftOut] = ()
    parameters: Mapping[str, Figure] | None = None
    flow: FlowVerdict | None = optional()
    since: Since | None = optional()
    changes: Sequence[Change] | None = optional()
    sets: Sequence[FittedSet] = ()
    number: int = 0
    when: str = ""

    @property
    def named(self) -> list[CandidateAnswer]:
        """The candidates that the model lacks."""
        return [c for c in self.candidates if c.effect in self.missing]

    def lines(self, file: str, verbose: bool) -> Iterator[str]:
        """Yield verdict, evidence, shifts and next step; with ``-v`` also path, candidates and detection limits."""
        yield from labelled("found", self.sentence)
        if evidence := evidence_summary(self):
            yield from labelled("evidence", evidence)
        if changes := parameter_shifts(self):
            yield from labelled("changes", changes)
        if self.since is not None:
            yield from labelled("since", changes_since_baseline(self.changes or (), self.since))
        yield from labelled("do", next_step(self, file))
        yield from each("warning", self.warnings)
        if verbose:
            yield ""
            yield from table(PATH_TITLES, [s.row for s in self.ladder], texts=1)
            if self.sets:
                yield ""
                yield from table(
                    ("fitted together", "cost of a reading (noise: 1)"), [s.row for s in self.sets], texts=1
                )
            yield from _candidates(self)
            yield from each("limit", map(describe_detection_limit, self.detectable))


def evidence_summary(answer: Answer) -> str:
    """Return the evidence behind the verdict: sizes and probabilities of the named effects, or detection limits.

    It is empty where nothing is named and something is left.
    """
    if answer.impossible:
        return ""
    if answer.verdict in ("adequate", "inconclusive"):
        return detectability_summary(answer)
    found = answer.named
    parts = [f"{c.effect} {format_parameters(c.parameters)}{probability_clause(c)}" for c in found]
    if found and not any(c.indistinguishable_from for c in found):
        parts.append("no other effect of the catalogue explains these recordings as well")
    return "; ".join(parts)


def probability_clause(candidate: CandidateAnswer) -> str:
    """Return the probability of an effect or its equivalents; nothing where it is not stated."""
    if candidate.confidence is None:
        return ""
    of = ", or one that is indistinguishable from it," if candidate.indistinguishable_from else ""
    return f"{of} is present with {format_percent(candidate.confidence)} probability"


def parameter_shifts(answer: Answer) -> str:
    """Return the base parameters that the named effects change; nothing where none is named."""
    if not answer.missing:
        return ""
    moved = []
    for m in answer.moved:
        values = dict.fromkeys(format_quantity(end, m.unit, 3) for end in (m.from_, m.to))
        moved.append(f"{m.parameter} {' → '.join(values)}{'' if m.plausible else ' (at its bound)'}")
    return ", ".join(moved)


def next_step(answer: Answer, file: str, otherwise: str = "run") -> str:
    """Return what to do next, with the command; ``otherwise`` is that where nothing is left to record or to add."""
    if answer.impossible:
        return f"mend the recordings; or, to have an answer all the same: pneucli diagnose {file} --force"
    parts = [f"pneucli add {file} --suggested"] if answer.missing else []
    if answer.next_experiment:
        parts.append(answer.next_experiment)
    return "; or: ".join(parts) or (otherwise and f"pneucli {otherwise} {file}")


def detectability_summary(answer: Answer) -> str:
    """Return how many effects of the catalogue are detectable, with an example.

    Effects that no residual can show have no limit; they are among the others all the same.
    """
    limits = answer.detectable
    detectable = [describe_detection_limit(one) for one in limits if one.size is not None]
    if not detectable:
        return "no other effect of the catalogue is detectable"
    others = {*(one.effect for one in limits), *(c.effect for c in answer.candidates)} - set(answer.missing)
    return f"{len(detectable)} of {len(others)} other effects are detectable, such as {detectable[0]}"


def describe_detection_limit(one: DetectionLimit) -> str:
    """Return the detection limit of an effect, and where it acts at this limit."""
    if one.size is None:
        return one.would_show
    where = [f", {at.parameter} {format_quantity(at.value, at.unit, 2)}" for at in one.where]
    return f"{one.effect} ({one.parameter} {format_quantity(one.size, one.unit, 2)}{''.join(where)})"


REJECTION_REASONS = {
    "cannot-show": "These recordings cannot detect it: no residual is sensitive to it, or to any plausible size of it.",
    "not-promising": "The residual contains too little of its signature; it was not fitted.",
    "vanishes": "The fit returns zero.",
    "replaces-base-parameter": "It changes the residuals as a parameter does that the model has.",
    "at-bound": "The fit ends at a bound of the plausible range.",
    "below-resolution": "The fitted time is too short for the sampling.",
    "not-significant": "The improvement is no larger than chance.",
    "interval-contains-null": "The 95 % interval of its size contains the value at which it is absent.",
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


def reason_sentence(candidate: CandidateAnswer, missing: Sequence[str], held_out: str, looks_like: str = "") -> str:
    """Return why a candidate is named or not."""
    if not candidate.supported:
        text = f"{candidate.title}. {REJECTION_REASONS[candidate.reason]}"
        if candidate.reason == "at-bound" and candidate.parameters:
            text = f"{text[:-1]}: {format_parameters(candidate.parameters)}."
        named = [name for name in missing if name not in candidate.beside]
        if candidate.reason == "explained-by-unknown" and named:  # it was judged without those, and may explain much
            others = f"{join_names(named)}, or an effect outside the catalogue"
            text = f"{candidate.title}. It probably only resembles {others}."
        alike = join_names(candidate.indistinguishable_from)
        return f"{text} These recordings cannot distinguish it from {alike}." if alike else text
    if candidate.effect not in missing:
        alike = join_names([n for n in candidate.indistinguishable_from if n in missing])
        return f"{candidate.title}: in place of {alike} it explains these recordings equally well."
    errors = [format_number(error, 3) for error in (candidate.error_before, candidate.error_after)]
    text = f"{candidate.title}: with it the error goes from {errors[0]} to {errors[1]} times the noise"
    return f"{text} {VALIDATION_PHRASES[held_out]}. {looks_like}".rstrip()


def _explained(candidate: CandidateAnswer) -> str:
    """Return the error with a candidate, or of one that is not told what its fit removes of the squared residuals."""
    beside = join_names([candidate.effect, *candidate.beside])
    if candidate.error_after is None:
        return f"{beside} explains {format_percent(max(candidate.residual_share or 0.0, 0.0))} of the squared residuals"
    return f"error with {beside} {format_number(candidate.error_after, 3)} × noise"


def _candidates(answer: Answer) -> Iterator[str]:
    fitted = [c for c in answer.candidates if c.parameters]
    for c in fitted:
        yield ""
        yield from labelled("named" if c.effect in answer.missing else "tried", c.effect)
        yield from labelled("", f"{format_parameters(c.parameters)}; {_explained(c)}")
        yield from labelled("", c.why)
    yield ""
    others = [c for c in answer.candidates if not c.parameters]
    for reason in dict.fromkeys(c.reason for c in others):
        alike = join_names([c.effect for c in others if c.reason == reason])
        yield from labelled("untried", f"{alike}. {REJECTION_REASONS[reason]}")


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
CERTAIN = 0.9  # probability from which on an effect is stated without it; of such names 95 in 100 are right
MIN_TOLD_PROBABILITY = 0.3  # of an effect that is not named: about one in four of those below 0.5 is present


def verdict_sentence(answer: Answer) -> str:
    """Return the verdict: what is named and how much it explains, then what is left.

    This is the ``sentence`` of the answer of ``diagnose``; terminal, page, summary and fleet show it unchanged.

    Args:
        answer: The answer of ``diagnose``, complete but for this sentence.

    >>> from pneucli.figure import read
    >>> ladder = [{"add": None, "error_train": 1.4, "error_test": 1.02}]
    >>> print(verdict_sentence(read(Answer, {"verdict": "adequate", "ladder": ladder})))
    Nothing is missing that these recordings could show: the error is 1.02 × noise on recordings that were not fitted.
    What is left does not exceed noise and parameter uncertainty.
    """
    if answer.impossible:
        return impossible_data_sentence(answer.impossible)
    error = error_reduction(answer)
    if answer.verdict == "inconclusive":
        if answer.lack_of_fit and answer.lack_of_fit.undetermined:
            return (
                f"No statement is possible: {error}, which the uncertainty of the fitted parameters or of the noise "
                "may explain alone. Record such commands and speeds for the fit, too, and rests."
            )
        limits = answer.detectable
        undetectable = sum(not one.typical for one in limits)
        return (
            f"No statement is possible: {undetectable} of {len(limits)} effects are undetectable at a typical size; "
            f"{error}."
        )
    beyond, within = answer.beyond_fitted, answer.error_within_fitted
    beyond_text = beyond_fitted_sentence(beyond, within, selected_step(answer).error_test)
    drift = free_run_sentence(answer.lack_of_fit, answer.free_run)
    parts = _remainder(answer), drift, beyond_text, _base_equivalents(answer)
    rest = " ".join(filter(None, parts))
    if answer.missing:
        return f"{_named_effects(answer)} {rest}"
    if answer.verdict == "adequate":
        return f"Nothing is missing that these recordings could show: {error}. {rest}"
    return f"No effect of the catalogue explains these recordings: {error}. {_likeliest_effect(answer)}{rest}"


def _base_equivalents(answer: Answer) -> str:
    """Return which effects these recordings cannot distinguish from parameters of the model."""
    found: dict[str, list[str]] = {}
    for c in answer.candidates:
        if c.reason == "replaces-base-parameter":
            found.setdefault(join_names(c.indistinguishable_from), []).append(c.effect)
    return " ".join(
        f"These recordings cannot distinguish {join_names(effects)} from {base}, which the model has: they determine "
        "only what both explain together."
        for base, effects in found.items()
    )


def _likeliest_effect(answer: Answer) -> str:
    """Return the most probable effect that is not named, with what it explains; nothing where all are improbable."""
    best = max(answer.candidates, key=lambda c: c.confidence or 0.0, default=None)
    if best is None or (probability := best.confidence or 0.0) < MIN_TOLD_PROBABILITY:
        return ""
    before, after = (format_noise_ratio(error) for error in (best.error_before, best.error_after))
    others = join_names(best.beside)
    change = f"added to {others}, it takes the error" if others else "with it the error goes"
    return (
        f"The likeliest, {best.named}), is present with {100.0 * probability:.0f} % probability: "
        f"{change} from {before} to {after} × noise. "
    )


def _named_effects(answer: Answer) -> str:
    """Return the named effects, how much they explain, and the effects that are indistinguishable from each."""
    named = answer.named
    effects = join_names([_named_effect(c) for c in named])
    lacks = "probably lacks" if any(_is_doubtful(c) for c in named) else "lacks"
    share = answer.explained_share
    subject, pronoun = ("it explains", "it") if len(named) == 1 else ("they explain", "them")
    explains = f"; {subject} {format_percent(share)} of the squared error beyond noise" if share else ""
    text = f"The model {lacks} {effects}: with {pronoun} {error_reduction(answer)}{explains}."
    for c in named:
        if equivalents := c.indistinguishable_from:
            one = pronoun if len(named) == 1 else c.effect
            text += f" These recordings cannot distinguish {one} from {join_names(sorted(equivalents))}."
    return text


def _named_effect(candidate: CandidateAnswer) -> str:
    """Return an effect by name and title, with its probability where that leaves a doubt."""
    probable = f"; {100.0 * (candidate.confidence or 0.0):.0f} % probable" if _is_doubtful(candidate) else ""
    return f"{candidate.named}{probable})"


def _is_doubtful(candidate: CandidateAnswer) -> bool:
    """Return whether an effect is less probable than CERTAIN; where no probability is known, nothing is said of it."""
    return candidate.confidence is not None and candidate.confidence < CERTAIN


def _remainder(answer: Answer) -> str:
    """Return what is left with the named effects."""
    if rest := answer.unexplained:
        text = f"What is left is {discrepancy_character(rest)}: {discrepancy_location(rest)}"
        return f"{text}; no effect of the catalogue explains it." if answer.missing else f"{text}."
    largest = largest_discrepancy(answer)
    where = f"; it is largest in {largest}" if largest else ""
    count = answer.lack_of_fit.excused if answer.lack_of_fit else 0
    beside = f", but for {excused_segments(count)}, where little decides when a piston starts" if count else ""
    return f"What is left does not exceed noise and parameter uncertainty{beside}{where}."


def error_reduction(answer: Answer) -> str:
    """Return how the named effects change the error, and on which recordings."""
    first, last = answer.ladder[0], selected_step(answer)
    use, before = evaluation_error(first.error)
    on = VALIDATION_PHRASES["apart" if use == "test" else answer.held_out or "none"]
    if first is last:
        return f"the error is {format_noise_ratio(before)} × noise {on}"
    after, relative = last.error[use], answer.relative_error
    ratios = f"from {format_noise_ratio(before)} to {format_noise_ratio(after)} × noise"
    if format_noise_ratio(before) == format_noise_ratio(after):
        return f"the error stays at {format_noise_ratio(after)} × noise {on}"
    if not (before and after and after > before):
        return f"the error falls {ratios} {on}"
    if relative is None or relative >= 1.0:
        return f"the error rises {ratios} {on}"
    less = "since noise moves the completed model less"
    return f"the error in mm and bar falls to {format_percent(relative)} {on}; it rises {ratios}, {less}"


def selected_step(answer: Answer) -> Step:
    """Return the step of the path with all named effects."""
    return next((step for step in reversed(answer.ladder) if step.add in answer.missing), answer.ladder[0])


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
    title: str,
    parameter: str,
    size: float | None,
    unit: str,
    null: float | str | None,
    where: Sequence[str] = (),
    beside: Sequence[str] = (),
) -> str:
    """Return from which size on an effect is detectable; None: at no plausible size.

    ``null`` is that of the parameter, at which the effect is absent; ``where`` has the values of parameters that say
    where, when or how fast the effect acts; ``beside`` names the effects without which it showed.
    """
    if size is None:
        others = f"beside {join_names(beside)} " if beside else ""
        return f"{title}: {others}these recordings cannot detect it at any plausible size"
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


def explaining_signal(unexplained: Unexplained) -> str:
    """Return how much of the unexplained residual a function of one signal explains; nothing where none does."""
    if not unexplained.share:
        return ""
    share = format_percent(unexplained.share)
    if unexplained.law == PERIODIC_SHAPE:  # a period is estimated from all recordings
        return f"The period explains {share} of what is left."
    return f"A function of {unexplained.variable} explains {share} of what is left in recordings that were left out."


def discrepancy_character(unexplained: Unexplained) -> str:
    """Return as what the discrepancy acts, over which signal, and over which others equally well, the first by name."""
    shape = f" ({unexplained.law})" if unexplained.law else ""
    also = unexplained.also_over
    named = len(also) if len(also) <= MAX_NAMED_SIGNALS + 1 else MAX_NAMED_SIGNALS
    others = [f", or of {signal_title(name)}" for name in also[:named]]
    if also[named:]:
        others.append(f", or of {len(also) - named} other signals")
    return f"{unexplained.character}{shape}{''.join(others)}"


def discrepancy_location(unexplained: Unexplained) -> str:
    """Return the channel of the discrepancy, its size, and the subsystem."""
    ratio = format_number(unexplained.times_noise, 2)
    return f"{unexplained.channel} errs by {ratio} times its noise ({unexplained.subsystem})"


def largest_discrepancy(answer: Answer) -> str:
    """Return the channel of the largest discrepancy in excess of noise with its size; nothing where there is none."""
    if not answer.discrepancy:
        return ""
    worst = max(answer.discrepancy, key=lambda one: one.size)
    over = f", over {worst.over}" if worst.over else ""
    duration = f", lasting {format_quantity(worst.time_constant_s, 's', 2)}" if worst.time_constant_s else ""
    return f"{worst.channel}, {format_noise_ratio(worst.size)} × its noise ({worst.subsystem}{over}{duration})"
