"""The complete diagnosis: verdict, named effects, equivalents, probabilities, discrepancy, sizes it would detect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np
from scipy.special import softmax

from pneucli.diagnose.adequacy import LackOfFit, significant_lack_of_fit
from pneucli.diagnose.calibration import Evidence, likelihood_shares, presence_rate
from pneucli.diagnose.candidate import Candidate, Decision
from pneucli.diagnose.constraints import has_null, interval_contains_null, violated_constraint
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.decision import Judgement, log_odds_among_equivalents
from pneucli.diagnose.discrepancy import UnexplainedResidual, describe_discrepancies, describe_lack_of_fit
from pneucli.diagnose.equivalence import Term
from pneucli.diagnose.evidence import SetProbability, set_probabilities
from pneucli.diagnose.score import FittedModel
from pneucli.diagnose.selection import SelectionPath, select_effects, unsearched_path
from pneucli.identify.estimation.fit import Estimate, Fit
from pneucli.identify.estimation.intervals import with_intervals_over_models
from pneucli.identify.estimation.parameters import null_value
from pneucli.identify.estimation.score_test import ScoreTest
from pneucli.identify.residuals import FreeRun
from pneucli.messages import compare
from pneucli.messages.compare import ExcessBalance
from pneucli.messages.diagnose import Discrepancy, Shift
from pneucli.physics.declaration import Effect, Parameter

MDE_SIGMA = 4.0  # standard errors: detected in 80 of 100 data sets at a level of 5 % for the catalogue


@dataclass(frozen=True)
class MinimumDetectableEffect:
    """The size of an effect's leading parameter from which it is detectable, in the parameter's unit.

    ``size`` is inf where no plausible size is detectable; ``typical``: a typical size is. ``where`` has the values of
    the parameters without a null, which say where, when or how fast the effect acts; other values have another
    detectable size.
    """

    effect: Effect
    parameter: Parameter
    size: float
    plausible: bool
    typical: bool
    where: Mapping[Parameter, float] = field(default_factory=dict)


def minimum_detectable_effects(
    data: DiagnosisData, fitted: FittedModel, *, complete: bool = True
) -> list[MinimumDetectableEffect]:
    """Return the minimum detectable size of every observable effect that the model lacks.

    Where more than noise is left (not ``complete``) the standard errors are larger by as much as model error widens
    the intervals of the fitted parameters: a named effect has to stand beyond these.
    """
    absent = data.absent_effects(fitted.model)
    tests_by_effect = {e.name: tests for e, tests in data.signatures_of(fitted, absent)}
    sigma = MDE_SIGMA * (1.0 if complete else _error_inflation(data, fitted))
    return [
        _minimum_detectable_effect(effect, tests_by_effect.get(effect.name, []), fitted, sigma) for effect in absent
    ]


def _error_inflation(data: DiagnosisData, fitted: FittedModel) -> float:
    """Return how much model error widens the intervals of a model's parameters: the median ratio, at least 1."""
    by_blocks, of_intervals = data.contrast_variances(fitted, np.eye(len(fitted.fit.covariance)))
    known = (by_blocks > 0.0) & np.isfinite(of_intervals)
    return max(float(np.sqrt(np.median(of_intervals[known] / by_blocks[known]))), 1.0) if known.any() else 1.0


def undetectable_effects(data: DiagnosisData, sizes: Sequence[MinimumDetectableEffect]) -> list[Decision]:
    """Return decisions about effects without a sensitive residual, or without a detectable plausible size."""
    insensitive = [e for e in data.effects.values() if not data.is_observable(e)]
    return [Decision(e, "cannot-show") for e in [*(d.effect for d in sizes if not d.plausible), *insensitive]]


def _minimum_detectable_effect(
    effect: Effect, tests: list[ScoreTest], fitted: FittedModel, sigma: float
) -> MinimumDetectableEffect:
    """Return the detectable size: the typical value nearest to the null, scaled by ``sigma`` standard errors."""
    effect = effect.in_model_with(fitted.model.effects)
    leading = effect.leading_parameter
    name = f"{effect.name}.{leading.name}"
    finite = [s for s in tests if not s.direct and np.isfinite(s.step_error) and s.step_error > 0.0]
    if not finite:
        return MinimumDetectableEffect(effect, leading, np.inf, plausible=False, typical=False)
    best = min(finite, key=lambda s: s.step_error)
    null = null_value(leading, fitted.model)
    where = {
        p: best.values[f"{effect.name}.{p.name}"] for p in effect.main_parameters if p.null is None and p is not leading
    }
    relative_size = sigma * best.step_error
    if null is None:
        detectable = relative_size < 1.0
        return MinimumDetectableEffect(
            effect, leading, best.values[name], plausible=detectable, typical=detectable, where=where
        )
    distance = relative_size * abs(best.values[name] - null)
    return MinimumDetectableEffect(
        effect, leading, distance, plausible=relative_size < 3.0, typical=relative_size < 1.0, where=where
    )


Verdict = Literal["adequate", "missing-effect", "unexplained", "inconclusive"]

MAX_UNDETECTABLE_SHARE = 0.5  # of the observable effects: with more undetectable ones no model is called adequate
MIN_PARAMETER_SHIFT = 0.2  # of a base parameter's value, if it also exceeds two standard errors


class Confidence(NamedTuple):
    """The probability that an effect or one of its equivalents is present, and that it is this effect."""

    of_set: float
    alone: float


@dataclass(frozen=True)
class Diagnosis:
    """The result of a diagnosis.

    ``missing`` has the named effects in the order to add them, ``equivalents`` the indistinguishable effects of each
    added one, ``decisions`` one for every effect that the model lacked, the added ones first. ``fit`` is that of the
    last model, with intervals over all models that the data allow; ``lack_of_fit`` judges its printed error.
    ``sets`` are all fitted sets of effects, the most probable first; they decide nothing.
    """

    verdict: Verdict
    missing: tuple[str, ...]
    decisions: tuple[Decision, ...]
    equivalents: Mapping[str, tuple[str, ...]]
    path: SelectionPath
    fit: Fit
    parameter_shifts: tuple[Shift, ...]
    detectable: tuple[MinimumDetectableEffect, ...]
    unexplained: UnexplainedResidual | None
    confidence: Mapping[str, Confidence]
    evidence: Mapping[str, Evidence]
    discrepancies: tuple[Discrepancy, ...]
    lack_of_fit: compare.LackOfFit | None = None
    sets: tuple[SetProbability, ...] = ()


def diagnose(data: DiagnosisData, base: Fit) -> Diagnosis:
    """Find the effects that a fitted model lacks; none is looked for in recordings that cannot be true."""
    start = data.visit(data.fitted_model(base))
    del base  # its derivatives are in memory, those of the start in a file
    path = unsearched_path(data, start) if data.implausible else select_effects(data, start)
    judged = data.judge_fit(path.last.fit)
    unexplained = [] if data.implausible else _lack_of_last_model(path, judged)
    equivalents = {
        name: [c for c in term.equivalents(data, complete=not unexplained) if violated_constraint(data, c) is None]
        for name, term in path.terms.items()
    }
    equal_decisions = [Decision(c.effect, "supported", c) for name in path.added for c in equivalents[name]]
    sizes = minimum_detectable_effects(data, path.last, complete=not unexplained)
    decisions = _first_decision_each(
        [
            *(path.judgements[name].decision for name in path.added),
            *equal_decisions,
            *path.decisions,
            *undetectable_effects(data, sizes),
        ]
    )
    judgements = {j.decision.effect.name: j for j in path.refused} | dict(path.judgements)
    shares = {
        n: _shares_in_term(data, term, equivalents[n], complete=not unexplained) for n, term in path.terms.items()
    }
    return Diagnosis(
        verdict=_verdict(data, unexplained, path.added, sizes, judged),
        missing=tuple(path.added),
        decisions=decisions,
        equivalents={name: tuple(c.effect.name for c in equivalents[name]) for name in path.added},
        path=path,
        fit=_fit_over_models(data, path),
        parameter_shifts=tuple(_parameter_shifts(start.fit, path.last.fit)),
        detectable=tuple(sizes),
        unexplained=describe_lack_of_fit(data, path.last.fit, unexplained[0]) if unexplained else None,
        confidence=_confidence(decisions, judgements, shares),
        evidence={name: j.evidence for name, j in judgements.items()},
        discrepancies=tuple(describe_discrepancies(data, path.last.fit, [*path.test, *path.train])),
        lack_of_fit=_with_balance(judged, next((one for one in unexplained if one.kind is not FreeRun), None)),
        sets=tuple(set_probabilities([*data.visited.values()])),
    )


def _fit_over_models(data: DiagnosisData, path: SelectionPath) -> Fit:
    """Return the fit of a path's last model with intervals that contain those of the alternatives.

    An alternative in which an added effect may be absent is left out: whether that is there, its probability says.
    """
    added = [data.effects[name] for name in path.added]
    fits = [data.with_intervals(model) for model in path.alternatives]
    sure = [fit for fit in fits if not any(has_null(fit, e) and interval_contains_null(fit, e) for e in added)]
    return with_intervals_over_models(data.with_intervals(path.last), sure)


def _lack_of_last_model(path: SelectionPath, judged: compare.LackOfFit | None) -> Sequence[LackOfFit]:
    """Return the significant lack of fit of a path's last model, by subsystem, or else that of its printed error."""
    found = significant_lack_of_fit(path.train, path.test)
    if found or judged is None or not judged.present or judged.worst is None:
        return found
    ratio = judged.worst.ratio_to_noise  # which does not show where an error began
    return [LackOfFit(FreeRun, judged.worst.channel, ratio, ratio, ())]


def _with_balance(judged: compare.LackOfFit | None, balance: LackOfFit | None) -> compare.LackOfFit | None:
    if judged is None or balance is None:
        return judged
    return replace(judged, present=True, balance=ExcessBalance(balance.kind.title, balance.channel, balance.ratio))


def _verdict(
    data: DiagnosisData,
    unexplained: Sequence[LackOfFit],
    missing: Sequence[str],
    sizes: Sequence[MinimumDetectableEffect],
    judged: compare.LackOfFit | None,
) -> Verdict:
    if data.implausible:
        return "inconclusive"
    if unexplained:
        return "unexplained"
    if missing:
        return "missing-effect"
    undetectable = sum(not d.typical for d in sizes)
    undetermined = judged is not None and judged.undetermined
    return "inconclusive" if undetermined or undetectable > MAX_UNDETECTABLE_SHARE * len(sizes) else "adequate"


def _confidence(
    decisions: Sequence[Decision],
    judged: Mapping[str, Judgement],
    shares: Mapping[str, Mapping[str, float]],
) -> dict[str, Confidence]:
    """Return the probabilities of each effect; none of one in whose place the model has a parameter.

    ``judged`` has the judgements of the effects that were added, ``shares`` the likelihood shares of the named effects
    and their equivalents.
    """
    rated = [d for d in decisions if d.reason != "replaces-base-parameter"]
    confidence = {d.effect.name: Confidence(*[presence_rate(d.reason)] * 2) for d in rated}
    probabilities = {
        name: j.probability
        for name, j in judged.items()
        if j.decision.reason in ("supported", "explained-by-unknown", "immaterial")
    }
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


def _parameter_shifts(before: Fit, after: Fit) -> list[Shift]:
    after_by_name = {e.name: e for e in after.estimates}
    return [
        Shift(e.name, e.value, after_by_name[e.name].value, e.unit, not after_by_name[e.name].at_bound)
        for e in before.estimates
        if e.name in after_by_name and _has_shifted(e, after_by_name[e.name])
    ]


def _has_shifted(before: Estimate, after: Estimate) -> bool:
    difference = abs(after.value - before.value)
    return after.at_bound or bool(
        difference > MIN_PARAMETER_SHIFT * abs(before.value) and difference > 2.0 * np.hypot(before.error, after.error)
    )
