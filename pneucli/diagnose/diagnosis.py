"""The complete diagnosis: verdict, named effects, equivalents, probabilities, and the remaining discrepancy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
from scipy.special import softmax

from pneucli.diagnose.adequacy import LackOfFit, significant_lack_of_fit
from pneucli.diagnose.calibration import Evidence, likelihood_shares, presence_rate, probability
from pneucli.diagnose.candidate import Candidate, Decision
from pneucli.diagnose.constraints import violated_constraint
from pneucli.diagnose.data import DiagnosisData, lack_of_fit
from pneucli.diagnose.decision import (
    DecisionWithEvidence,
    collect_evidence,
    decide,
    log_odds_among_equivalents,
    retest_without_refused,
)
from pneucli.diagnose.detectability import MinimumDetectableEffect, minimum_detectable_effects, undetectable_effects
from pneucli.diagnose.discrepancy import Discrepancy, UnexplainedResidual, describe_discrepancies, describe_lack_of_fit
from pneucli.diagnose.equivalence import Term
from pneucli.diagnose.free_run_test import free_run_lack_of_fit
from pneucli.diagnose.score import FittedModel
from pneucli.diagnose.selection import SelectionPath, select_effects, unsearched_path
from pneucli.identify.estimation.fit import Estimate, Fit

Verdict = Literal["adequate", "missing-effect", "unexplained", "inconclusive"]

MAX_UNDETECTABLE_SHARE = 0.5  # of the observable effects: with more undetectable ones no model is called adequate
MIN_PARAMETER_SHIFT = 0.2  # of a base parameter's value, if it also exceeds two standard errors


@dataclass(frozen=True)
class ParameterShift:
    """A base parameter that the added effects changed; not plausible where it ended at a bound."""

    parameter: str
    before: float
    after: float
    unit: str
    plausible: bool


class Confidence(NamedTuple):
    """The probability that an effect or one of its equivalents is present, and that it is this effect."""

    of_set: float
    alone: float


@dataclass(frozen=True)
class Diagnosis:
    """The result of a diagnosis.

    ``missing`` has the named effects in the order to add them, ``equivalents`` the indistinguishable effects of each
    added one, ``decisions`` one for every effect that the model lacked, the added ones first.
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


def diagnose(data: DiagnosisData, base: Fit) -> Diagnosis:
    """Find the effects that a fitted model lacks; none is looked for in recordings that cannot be true."""
    start = data.fitted_model(base)
    path = unsearched_path(data, start) if data.implausible else select_effects(data, start)
    unexplained = _lack_of_last_model(data, path)
    terms = path.terms
    equivalents = {
        name: [c for c in term.equivalents(data, complete=not unexplained) if violated_constraint(data, c) is None]
        for name, term in terms.items()
    }
    equivalent_names = {name: tuple(c.effect.name for c in equivalents.get(name, [])) for name in path.added}
    decided = [
        decide(data, path.last, c, unexplained, terms.get(name))
        for name, c in zip(path.added, _path_candidates(data, path), strict=True)
    ]
    decided = retest_without_refused(data, path.last, decided, unexplained)
    missing = [d.effect.name for d, _ in decided if d.supported]
    equal_decisions = [Decision(c.effect, "supported", c) for name in missing for c in equivalents.get(name, [])]
    sizes = minimum_detectable_effects(data, path.last)
    decisions = _first_decision_each(
        [*(d for d, _ in decided), *equal_decisions, *path.decisions, *undetectable_effects(data, sizes)]
    )
    improbable = {
        c.effect.name: collect_evidence(data, c.full, c, Term(c, ()), complete=False) for c in path.improbable
    }
    weighable = [(d, e) for d, e in decided if d.reason not in ("cannot-show", "explained-by-signal")]
    evidence = improbable | {d.effect.name: e for d, e in weighable}
    shares = {
        n: _shares_in_term(data, terms[n], equivalents[n], complete=not unexplained) for n in missing if n in terms
    }
    scored = improbable | {d.effect.name: e for d, e in decided if d.supported or d.reason == "explained-by-unknown"}
    confidence = _confidence(decisions, scored, shares)
    shown = path.last if unexplained and missing else path.models[_named_prefix_length([d for d, _ in decided])]
    lacks = _unexplained(data, shown, decided, unexplained, path.last)
    return Diagnosis(
        verdict=_verdict(data, lacks, missing, sizes),
        missing=tuple(missing),
        decisions=decisions,
        equivalents=equivalent_names,
        path=path,
        parameter_shifts=tuple(_parameter_shifts(start.fit, path.last.fit)),
        detectable=tuple(sizes),
        unexplained=describe_lack_of_fit(data, shown.fit, lacks[0]) if lacks else None,
        confidence=confidence,
        evidence=evidence,
        discrepancies=tuple(describe_discrepancies(data, path.last.fit, [*path.test, *path.train])),
    )


def _lack_of_last_model(data: DiagnosisData, path: SelectionPath) -> Sequence[LackOfFit]:
    """Return the significant lack of fit of a path's last model, or else what its free run shows."""
    return significant_lack_of_fit(path.train, path.test) or free_run_lack_of_fit(
        path.last.model, [*data.train, *data.held_out]
    )


def _unexplained(
    data: DiagnosisData,
    shown: FittedModel,
    decided: Sequence[DecisionWithEvidence],
    unexplained: Sequence[LackOfFit],
    last: FittedModel,
) -> Sequence[LackOfFit]:
    """Return the significant lack of fit of the model that is shown, worst first, or else that of the ``last`` model.

    Where a smooth function of a signal explains more than an effect, it is that of the channels on which the effect
    acts, however small: the function explains it significantly. Recordings that cannot be true show none.
    """
    if data.implausible:
        return []
    if shown is last:
        return unexplained
    train, test = lack_of_fit(data, shown)
    effects = [d.effect for d, _ in decided if d.reason == "explained-by-signal"]
    kinds = {type(v) for v in data.train for effect in effects if v.is_sensitive_to(effect)}
    minor = sorted((r for r in train if r.kind in kinds), key=lambda r: -r.ratio)
    return significant_lack_of_fit(train, test) or unexplained or minor[:1]


def _verdict(
    data: DiagnosisData,
    unexplained: Sequence[LackOfFit],
    missing: Sequence[str],
    sizes: Sequence[MinimumDetectableEffect],
) -> Verdict:
    if data.implausible:
        return "inconclusive"
    if unexplained:
        return "unexplained"
    if missing:
        return "missing-effect"
    undetectable = sum(not d.typical for d in sizes)
    return "inconclusive" if undetectable > MAX_UNDETECTABLE_SHARE * len(sizes) else "adequate"


def _path_candidates(data: DiagnosisData, path: SelectionPath) -> list[Candidate]:
    """Return the candidate of each step of the path."""
    return [data.candidate(a, b, data.effects[n]) for n, (a, b) in zip(path.added, pairwise(path.models), strict=True)]


def _confidence(
    decisions: Sequence[Decision],
    added: Mapping[str, Evidence],
    shares: Mapping[str, Mapping[str, float]],
) -> dict[str, Confidence]:
    """Return the probabilities of each effect.

    ``added`` has the evidence of the added effects that violate no constraint, ``shares`` the likelihood shares of the
    named effects and their equivalents.
    """
    confidence = {d.effect.name: Confidence(*[presence_rate(d.reason)] * 2) for d in decisions}
    probabilities = {name: probability(evidence) for name, evidence in added.items()}
    confidence |= {name: Confidence(p, p) for name, p in probabilities.items()}
    for name, share_by_effect in shares.items():
        if name in probabilities:
            confidence |= {
                effect: Confidence(probabilities[name], share * probabilities[name])
                for effect, share in share_by_effect.items()
            }
    return confidence


def _shares_in_term(
    data: DiagnosisData, term: Term, equivalents: Sequence[Candidate], *, complete: bool
) -> dict[str, float]:
    """Return the share of an effect and of each equivalent in their common likelihood, by name.

    With an unmodelled effect present the likelihood is overconfident; the log odds among equivalents decide instead.
    """
    candidates = [term.candidate, *equivalents]
    shares = (
        likelihood_shares([c.full for c in candidates])
        if complete
        else softmax([log_odds_among_equivalents(data, c) for c in candidates]).tolist()
    )
    return dict(zip([c.effect.name for c in candidates], shares, strict=True))


def _first_decision_each(decisions: Sequence[Decision]) -> tuple[Decision, ...]:
    """Return the first decision about each effect, where one after a fit precedes one after the screening."""
    first: dict[str, Decision] = {}
    for d in sorted(decisions, key=lambda d: d.reason == "not-promising"):
        first.setdefault(d.effect.name, d)
    return tuple(first.values())


def _named_prefix_length(added: Sequence[Decision]) -> int:
    """Return the number of added effects before the first that is not named: its reduction stays unexplained."""
    return next((i for i, d in enumerate(added) if not d.supported), len(added))


def _parameter_shifts(before: Fit, after: Fit) -> list[ParameterShift]:
    after_by_name = {e.name: e for e in after.estimates}
    return [
        ParameterShift(e.name, e.value, after_by_name[e.name].value, e.unit, not after_by_name[e.name].at_bound)
        for e in before.estimates
        if e.name in after_by_name and _has_shifted(e, after_by_name[e.name])
    ]


def _has_shifted(before: Estimate, after: Estimate) -> bool:
    difference = abs(after.value - before.value)
    return after.at_bound or bool(
        difference > MIN_PARAMETER_SHIFT * abs(before.value) and difference > 2.0 * np.hypot(before.error, after.error)
    )
