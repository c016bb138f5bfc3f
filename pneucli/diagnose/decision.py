"""The evidence for the probability of an effect (:mod:`pneucli.diagnose.calibration`), and whether it is named."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pneucli.diagnose.adequacy import LackOfFit, significant_lack_of_fit
from pneucli.diagnose.calibration import MIN_NAMED_PROBABILITY, Evidence, probability
from pneucli.diagnose.candidate import Candidate, Decision, Reason
from pneucli.diagnose.constraints import violated_constraint
from pneucli.diagnose.data import DiagnosisData, lack_of_fit
from pneucli.diagnose.equivalence import DISCREPANCY_READINGS, Term, nonparametric_rival
from pneucli.diagnose.evidence import relative_effect_size, significance
from pneucli.diagnose.free_run_error import removed_error_share
from pneucli.diagnose.hypothesis_tests import passing_candidates
from pneucli.diagnose.score import FittedModel
from pneucli.physics.declaration import Effect
from pneucli.simulate.rig_quantities import rig_quantities

DecisionWithEvidence = tuple[Decision, Evidence]

PROBABILITY_FLOOR = 1e-6  # a calibrated probability is no more certain than this


def decide(
    data: DiagnosisData,
    last: FittedModel,
    candidate: Candidate,
    unexplained: Sequence[LackOfFit],
    term: Term | None,
) -> DecisionWithEvidence:
    """Return the decision about an added effect and its evidence.

    An effect that is more probably absent is not named, nor is one that violates a hard constraint
    (:mod:`pneucli.diagnose.constraints`), or one that a smooth function of a signal explains better. ``term`` is the
    effect in the ``last`` model.
    """
    evidence = collect_evidence(data, last, candidate, term, complete=not unexplained)
    reason: Reason = _violated_constraint(data, candidate, term) or "supported"
    if reason == "supported" and probability(evidence) < MIN_NAMED_PROBABILITY:
        reason = "explained-by-unknown"
    if reason == "supported" and term is not None and _has_better_smooth_rival(data, term):
        reason = "explained-by-signal"
    return Decision(candidate.effect, reason, candidate), evidence


def _has_better_smooth_rival(data: DiagnosisData, term: Term) -> bool:
    """Whether a smooth function of one signal explains more than the effect; never for an exclusive measurement."""
    return not term.is_measured_exclusively(data) and nonparametric_rival(data, term) is not None


def retest_without_refused(
    data: DiagnosisData, last: FittedModel, decided: Sequence[DecisionWithEvidence], unexplained: Sequence[LackOfFit]
) -> list[DecisionWithEvidence]:
    """Return the decisions about the effects of the ``last`` model after a test without the refused ones.

    The user will not add the refused effects. For example a force on the piston may compensate for the offset of a
    pressure sensor that only resembles an unmodelled effect; by itself the force explains nothing.
    """
    refused = [d.effect for d, _ in decided if not d.supported and d.effect.name in last.effect_names]
    kept_by_noise = not unexplained and all(d.supported or d.reason == "explained-by-unknown" for d, _ in decided)
    if kept_by_noise or not refused or not any(d.supported for d, _ in decided):
        return list(decided)
    for effect in refused:
        (last,) = data.refit_without(last, [effect])
    unexplained_now = unexplained or significant_lack_of_fit(*lack_of_fit(data, last))
    retested = [
        _retested(data, last, one, unexplained_now, same=bool(unexplained) or not unexplained_now)
        if one[0].supported
        else one
        for one in decided
    ]
    return retest_without_refused(data, last, retested, unexplained_now)


def _retested(
    data: DiagnosisData,
    last: FittedModel,
    previous: DecisionWithEvidence,
    unexplained: Sequence[LackOfFit],
    *,
    same: bool,
) -> DecisionWithEvidence:
    """Return the previous decision, or a new one from the model without the refused effects if the effect fails there.

    A new one is made, too, if the residual was taken for noise before and is significant now (``same`` is false).
    """
    effect = previous[0].effect
    (reduced,) = data.refit_without(last, [effect])
    term = Term(data.candidate(reduced, last, effect), ())
    passes = bool(passing_candidates(data, reduced, [term.candidate]))
    stays = passes and _violated_constraint(data, term.candidate, term) is None
    return previous if stays and same else decide(data, last, term.candidate, unexplained, term)


def _violated_constraint(data: DiagnosisData, candidate: Candidate, term: Term | None) -> Reason | None:
    """Return the hard constraint that an effect violates in the last model, or at its step of the path."""
    if term is None:
        return violated_constraint(data, candidate)
    return violated_constraint(data, term.candidate, measured_exclusively=term.is_measured_exclusively(data))


def predicts_point_force(effect: Effect, unexplained: Sequence[LackOfFit]) -> bool:
    """Whether an effect predicts the force where one is unexplained; a set-valued law could hide any force."""
    return not (effect.is_set_valued and any(r.kind.predicts_force for r in unexplained))


def collect_evidence(
    data: DiagnosisData,
    last: FittedModel,
    candidate: Candidate,
    term: Term | None,
    *,
    complete: bool,
) -> Evidence:
    """Return the evidence for a candidate's effect in the ``last`` model; ``complete``: that leaves only noise."""
    step = candidate if term is None else term.candidate
    errors = data.free_run_errors
    share = None if errors is None else removed_error_share(errors(step.reduced.model), errors(step.full.model))
    return _evidence_of_fit(data, last, candidate, term)._replace(share=share, complete=complete)


def _evidence_of_fit(data: DiagnosisData, last: FittedModel, candidate: Candidate, term: Term | None) -> Evidence:
    """Return the evidence without a free run, which is all that counts with an unmodelled effect present."""
    deviation, size = _significance_and_size(data, last, candidate.effect)
    return Evidence(None, deviation, size, left=1.0 if term is None else term.remaining_variance(data))


def posterior_probability(data: DiagnosisData, term: Term) -> float:
    """Return the probability of a term's effect or its equivalents, with an unmodelled effect present."""
    return probability(_evidence_of_fit(data, term.candidate.full, term.candidate, term))


def log_odds_among_equivalents(data: DiagnosisData, candidate: Candidate) -> float:
    """Return the log odds of a candidate against its equivalents.

    All equivalents resemble the same unmodelled effect, and an effect of more than its typical size is no more
    probable. The remaining free-run error counts as DISCREPANCY_READINGS independent readings: a force balance contains
    few break-aways, and a trajectory depends on each of them.
    """
    p = posterior_probability(data, Term(candidate, ()))
    p = min(max(p, PROBABILITY_FLOOR), 1.0 - PROBABILITY_FLOOR)
    errors = (
        [] if data.free_run_errors is None else [e for e in data.free_run_errors(candidate.full.model).values() if e]
    )
    return math.log(p / (1.0 - p)) - DISCREPANCY_READINGS * (float(np.mean(np.log(errors))) if errors else 0.0)


def _significance_and_size(data: DiagnosisData, fitted: FittedModel, effect: Effect) -> tuple[float, float]:
    """Return the distance of an effect from its absence over the standard error of its interval, and its size."""
    facts = rig_quantities(fitted.model, [residual_model.experiment for residual_model in data.train])
    size = relative_effect_size(fitted.fit, effect, facts, data.train)
    own = [f.name.startswith(f"{effect.name}.") for f in fitted.fit.free]
    by_blocks, of_intervals = (np.diag(f.covariance)[own] for f in (fitted.fit, data.with_intervals(fitted)))
    inflation = float(np.mean(of_intervals / by_blocks)) if np.all(by_blocks > 0.0) and any(own) else 1.0
    return significance(fitted.fit, effect, data.train) / math.sqrt(inflation), size
