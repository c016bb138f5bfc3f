"""The diagnosis as a whole: verdict, effects, sets that the data cannot split, and what to measure next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
from scipy.special import softmax

from pneucli.diagnose.adequacy import LackOfFit, significant_lack_of_fit
from pneucli.diagnose.calibration import Evidence, likelihood_shares, presence_rate, probability
from pneucli.diagnose.candidate import Decision
from pneucli.diagnose.data import Candidate, DiagnosisData, FittedModel, lack_of_fit
from pneucli.diagnose.detectability import MinimumDetectableEffect, minimum_detectable_effects, undetectable_effects
from pneucli.diagnose.discrepancy import Discrepancy, UnexplainedResidual, describe_discrepancies, describe_lack_of_fit
from pneucli.diagnose.equivalence import Term
from pneucli.diagnose.free_run_adequacy import free_run_lack_of_fit
from pneucli.diagnose.posterior import (
    DecisionWithEvidence,
    collect_evidence,
    decide,
    has_calibration,
    log_odds_among_equivalents,
    retest_without_refused,
)
from pneucli.diagnose.selection import SelectionPath, select_effects
from pneucli.identify.estimation.fit import Estimate, Fit
from pneucli.physics.declaration import Effect

Verdict = Literal["adequate", "missing-effect", "unexplained", "inconclusive"]

MAX_UNDETECTABLE_SHARE = 0.5  # of the effects that could act: where more would not have shown, nothing is adequate
MIN_PARAMETER_SHIFT = 0.2  # of a base parameter's value, beyond its interval


@dataclass(frozen=True)
class ParameterShift:
    """A base parameter that the found effects moved; not plausible where it left its bounds."""

    parameter: str
    before: float
    after: float
    unit: str
    plausible: bool


class Confidence(NamedTuple):
    """The probability that an effect, or one that the data cannot tell from it, is there; and that it is this one."""

    of_set: float
    alone: float


@dataclass(frozen=True)
class Diagnosis:
    """What the recordings say, and what they cannot say.

    ``missing`` in the order to add them; ``equivalents`` names for each that was added what explains as much.
    ``decisions``: one for every effect that the model lacked, those that were added first.
    """

    verdict: Verdict
    missing: tuple[str, ...]
    decisions: tuple[Decision, ...]
    equivalents: Mapping[str, tuple[str, ...]]
    path: SelectionPath
    parameter_shifts: tuple[ParameterShift, ...]
    detectable: tuple[MinimumDetectableEffect, ...]
    unexplained: UnexplainedResidual | None
    confidence: Mapping[str, Confidence]
    evidence: Mapping[str, Evidence]
    discrepancies: tuple[Discrepancy, ...]


def diagnose(bench: DiagnosisData, base: Fit) -> Diagnosis:
    """Find which effects are missing in a fitted model."""
    start = bench.fitted_model(base)
    found = select_effects(bench, start)
    left = significant_lack_of_fit(found.train, found.test) or free_run_lack_of_fit(
        found.last.model, [*bench.train, *bench.held_out]
    )
    places = found.terms
    twins = {name: place.equivalents(bench, complete=not left) for name, place in places.items()}
    equals = {name: tuple(t.effect.name for t in twins.get(name, [])) for name in found.added}
    weights = [
        decide(bench, found.last, t, left, places.get(name), equals[name])
        for name, t in zip(found.added, _path_candidates(bench, found), strict=True)
    ]
    weights = retest_without_refused(bench, found.last, weights, left)
    missing = [d.effect.name for d, _ in weights if d.supported]
    alike = [Decision(t.effect, "supported", t) for name in missing for t in twins.get(name, [])]
    sizes = minimum_detectable_effects(bench, found.last)
    decisions = _first_decision_each(
        [*(d for d, _ in weights), *alike, *found.decisions, *undetectable_effects(bench, sizes)]
    )
    doubted = {t.effect.name: collect_evidence(bench, t.full, t, Term(t, ()), complete=False) for t in found.improbable}
    evidence = doubted | {
        d.effect.name: e for d, e in weights if d.reason not in ("cannot-show", "explained-by-signal")
    }
    parts = {n: _shares_in_term(bench, places[n], twins[n], complete=not left) for n in missing if n in places}
    sure = _confidence(bench, decisions, evidence, parts)
    shown = found.last if left and missing else found.models[_named_prefix_length([d for d, _ in weights])]
    unexplained = left if shown is found.last else _unexplained(bench, shown, weights, left)
    unknown = describe_lack_of_fit(bench, shown.fit, unexplained[0]) if unexplained else None
    moved = tuple(_parameter_shifts(start.fit, found.last.fit))
    verdict = _verdict(bench, unexplained, missing, sizes)
    remaining = describe_discrepancies(bench, found.last.fit, [*found.test, *found.train])
    return Diagnosis(
        verdict=verdict,
        missing=tuple(missing),
        decisions=decisions,
        equivalents=equals,
        path=found,
        parameter_shifts=moved,
        detectable=tuple(sizes),
        unexplained=unknown,
        confidence=sure,
        evidence=evidence,
        discrepancies=tuple(remaining),
    )


def _unexplained(
    bench: DiagnosisData, shown: FittedModel, weights: Sequence[DecisionWithEvidence], left: Sequence[LackOfFit]
) -> Sequence[LackOfFit]:
    """Return what a state leaves that is more than noise, worst first, or what the last one did.

    Where a law of a signal explains more than an effect, what that acts in: faint or not, it is sure.
    """
    train, test = lack_of_fit(bench, shown)
    effects = [d.effect for d, _ in weights if d.reason == "explained-by-signal"]
    kinds = {type(v) for v in bench.train for effect in effects if v.is_sensitive_to(effect)}
    faint = sorted((r for r in train if r.kind in kinds), key=lambda r: -r.ratio)
    return significant_lack_of_fit(train, test) or left or faint[:1]


def _verdict(
    bench: DiagnosisData, left: Sequence[LackOfFit], missing: Sequence[str], sizes: Sequence[MinimumDetectableEffect]
) -> Verdict:
    if left:
        return "unexplained"
    if missing:
        return "missing-effect"
    blind = sum(not d.typical for d in sizes)
    return "inconclusive" if bench.implausible or blind > MAX_UNDETECTABLE_SHARE * len(sizes) else "adequate"


def _path_candidates(bench: DiagnosisData, found: SelectionPath) -> list[Candidate]:
    """Return the step to each rung."""
    return [
        bench.candidate(a, b, bench.effects[n]) for n, (a, b) in zip(found.added, pairwise(found.models), strict=True)
    ]


def _confidence(
    bench: DiagnosisData,
    decisions: Sequence[Decision],
    added: Mapping[str, Evidence],
    parts: Mapping[str, Mapping[str, float]],
) -> dict[str, Confidence]:
    """Return for each effect the probability that it, or one of its twins, is there, and that it is that one.

    ``parts`` are the likelihoods of the named effects and their twins. Nothing is said of effects that only recordings
    show of which there is no exam.
    """
    sure = {
        d.effect.name: Confidence(*[presence_rate(d.reason)] * 2) for d in decisions if has_calibration(bench, d.effect)
    }
    known = {name: probability(evidence) for name, evidence in added.items() if name in sure}
    sure |= {name: Confidence(p, p) for name, p in known.items()}
    for name, of_each in parts.items():
        if name in known:
            sure |= {one: Confidence(known[name], part * known[name]) for one, part in of_each.items()}
    return sure


def _shares_in_term(
    bench: DiagnosisData, place: Term, alike: Sequence[Candidate], *, complete: bool
) -> dict[str, float]:
    """Return the likelihood of an effect and of those alike over that of all, by name.

    Beside something unknown squares do not tell: there it is how each stands against the others, one of them being
    there.
    """
    trials = [place.candidate, *alike]
    parts = (
        likelihood_shares([t.full for t in trials])
        if complete
        else softmax([log_odds_among_equivalents(bench, t) for t in trials]).tolist()
    )
    return dict(zip([t.effect.name for t in trials], parts, strict=True))


def _first_decision_each(decisions: Sequence[Decision]) -> tuple[Decision, ...]:
    """Return the first decision about each effect, those that a fit can prove before those that a screen left out."""
    first: dict[str, Decision] = {}
    for d in sorted(decisions, key=lambda d: d.reason == "not-promising"):
        first.setdefault(d.effect.name, d)
    return tuple(first.values())


def _named_prefix_length(added: Sequence[Decision]) -> int:
    """Return how many of the effects added are named before the first that is not: what it took is unexplained."""
    return next((i for i, d in enumerate(added) if not d.supported), len(added))


def _parameter_shifts(before: Fit, after: Fit) -> list[ParameterShift]:
    now = {e.name: e for e in after.estimates}
    return [
        ParameterShift(e.name, e.value, now[e.name].value, e.unit, not now[e.name].at_bound)
        for e in before.estimates
        if e.name in now and _has_shifted(e, now[e.name])
    ]


def _has_shifted(before: Estimate, after: Estimate) -> bool:
    apart = abs(after.value - before.value)
    return after.at_bound or bool(
        apart > MIN_PARAMETER_SHIFT * abs(before.value) and apart > 2.0 * np.hypot(before.error, after.error)
    )


def distinguishing_experiment(one: Effect, other: Effect) -> str:
    """Return what recording tells two effects apart, as their declarations say."""
    return f"To tell {one.name} from {other.name}: {one.separate}" + (
        f" {other.separate}" if other.separate != one.separate else ""
    )
