"""The evidence for the probability of an effect (:mod:`pneucli.diagnose.calibration`), and whether it is named."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pneucli.diagnose.adequacy import LackOfFit, significant_lack_of_fit
from pneucli.diagnose.calibration import MIN_NAMED_PROBABILITY, Evidence, probability
from pneucli.diagnose.candidate import Candidate, Decision, Reason
from pneucli.diagnose.constraints import violated_constraint
from pneucli.diagnose.data import DiagnosisData, lack_of_fit
from pneucli.diagnose.equivalence import DISCREPANCY_READINGS, Term, nonparametric_rival
from pneucli.diagnose.evidence import disagreement, relative_effect_size, significance
from pneucli.diagnose.free_run_error import removed_error_share
from pneucli.diagnose.hypothesis_tests import passing_candidates
from pneucli.diagnose.score import FittedModel
from pneucli.identify.residuals import (
    ChamberPressures,
    ForceBalance,
    ForceBalanceInferredP2,
    ImposedMotion,
    ResidualModel,
)
from pneucli.physics.declaration import Effect
from pneucli.simulate.rig_quantities import rig_quantities

DecisionWithEvidence = tuple[Decision, Evidence]

LARGE_LACK_OF_FIT = 3.5  # times the expected rms: several unmodelled effects act
MIN_SHARE_IF_LARGE = 0.25  # of the excess cost, under a large lack of fit
MIN_SHARE = 0.95  # the same otherwise: an effect that resembles a single unmodelled one also leaves little
MIN_SHARE_WITHOUT_HELD_OUT = 0.9  # the same without a held-out recording that could contradict it
MAX_SHARE_LEFT_IN_OWN_CHANNELS = 0.5  # of the excess cost of channels that only this effect changes
PROBABILITY_FLOOR = 1e-6  # a calibrated probability is no more certain than this
MAX_DISAGREEMENT = 0.5  # of an effect's size: recordings that disagree by more do not show this effect


def decide(
    data: DiagnosisData,
    last: FittedModel,
    candidate: Candidate,
    unexplained: Sequence[LackOfFit],
    term: Term | None,
) -> DecisionWithEvidence:
    """Return the decision about an added effect and its evidence.

    An effect that probably only resembles an unmodelled one is not named, nor is one that violates a hard constraint
    (:mod:`pneucli.diagnose.constraints`). Recordings without a calibration of the
    probability use a fallback where something is ``unexplained``. ``term`` is the effect in the ``last`` model.
    """
    evidence = collect_evidence(data, last, candidate, term, complete=not unexplained)
    reason: Reason = _violated_constraint(data, candidate, term) or "supported"
    if reason == "supported" and not _is_probable(data, last, candidate, unexplained, term, evidence):
        reason = "explained-by-unknown"
    if reason == "supported" and term is not None and _has_better_smooth_rival(data, term):
        reason = "explained-by-signal"
    return Decision(candidate.effect, reason, candidate), evidence


def _is_probable(
    data: DiagnosisData,
    last: FittedModel,
    candidate: Candidate,
    unexplained: Sequence[LackOfFit],
    term: Term | None,
    evidence: Evidence,
) -> bool:
    """Whether an effect is more probably present than absent; without a calibration, whether it explains enough.

    Of channels that nothing else can change, an effect has to explain more than remains.
    """
    if has_calibration(data, candidate.effect):
        return probability(evidence) >= MIN_NAMED_PROBABILITY
    if not unexplained:
        return True
    if term is not None and term.is_measured_exclusively(data):
        return evidence.left < MAX_SHARE_LEFT_IN_OWN_CHANNELS
    share, contradiction = (
        explained_excess_cost(candidate.reduced, candidate.full),
        disagreement_between_recordings(data, last, candidate.effect.name),
    )
    return predicts_point_force(candidate.effect, unexplained) and passes_fallback(
        data, share, contradiction, unexplained
    )


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


def has_calibration(data: DiagnosisData, effect: Effect) -> bool:
    """Whether the probability is calibrated for such recordings.

    The calibration has no recordings of a force alone, and always has held-out data.
    """
    return data.has_held_out_data and all(
        type(residual_model) in (ChamberPressures, ForceBalance, ImposedMotion, ForceBalanceInferredP2)
        for residual_model in data.train
        if residual_model.is_sensitive_to(effect)
    )


def passes_fallback(data: DiagnosisData, share: float, disagreement: float, unexplained: Sequence[LackOfFit]) -> bool:
    """Whether an effect explains enough where no calibration exists: nearly all, or a part of a large lack of fit."""
    if disagreement > MAX_DISAGREEMENT and data.has_held_out_data:
        return False
    if not data.has_held_out_data:
        return share > MIN_SHARE_WITHOUT_HELD_OUT
    return share > MIN_SHARE or (share > MIN_SHARE_IF_LARGE and unexplained[0].ratio > LARGE_LACK_OF_FIT)


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
    share = (
        None
        if data.free_run_errors is None
        else removed_error_share(data.free_run_errors(step.reduced.model), data.free_run_errors(step.full.model))
    )
    remaining = 1.0 if term is None else term.remaining_share(data)
    deviation, size = _significance_and_size(data, last, candidate.effect)
    return Evidence(
        share,
        deviation,
        size,
        complete,
        remaining,
    )


def posterior_probability(data: DiagnosisData, term: Term) -> float:
    """Return the probability of a term's effect or its equivalents, with an unmodelled effect present."""
    return probability(collect_evidence(data, term.candidate.full, term.candidate, term, complete=False))


def log_odds_among_equivalents(data: DiagnosisData, candidate: Candidate) -> float:
    """Return the log odds of a candidate against its equivalents.

    All equivalents resemble the same unmodelled effect, and an effect of more than its typical size is no more
    probable. The remaining free-run error counts as DISCREPANCY_READINGS independent readings: a force balance contains
    few break-aways, and a trajectory depends on each of them.
    """
    evidence = collect_evidence(data, candidate.full, candidate, Term(candidate, ()), complete=False)
    own_evidence = evidence._replace(share=None, size=min(evidence.size, 1.0))
    p = min(max(probability(own_evidence), PROBABILITY_FLOOR), 1.0 - PROBABILITY_FLOOR)
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


def disagreement_between_recordings(data: DiagnosisData, fitted: FittedModel, name: str) -> float:
    """Return the share of an effect's size by which recordings (or quarters of one) would change it."""
    names = [residual_model.experiment.recording.name for residual_model in data.train]
    single, recording_index = len(set(names)) == 1, np.unique(names, return_inverse=True)[1]
    parts = [
        _quarters(residual_model) if single else np.full(_residual_count(residual_model), i)
        for residual_model, i in zip(data.train, recording_index, strict=True)
    ]
    return disagreement(fitted.fit, data.effects[name], np.concatenate(parts), data.train)


def _residual_count(residual_model: ResidualModel) -> int:
    return residual_model.experiment.time.size * len(residual_model.channels)


def _quarters(residual_model: ResidualModel) -> NDArray[np.int64]:
    """Return the quarter of the recording of each residual."""
    n = residual_model.experiment.time.size
    return np.tile(np.arange(n) * 4 // n, len(residual_model.channels))


def explained_excess_cost(reduced: FittedModel, full: FittedModel) -> float:
    """Return the share of the cost in excess of noise that a step removes, on fitted and held-out recordings."""
    return (reduced.cost - full.cost) / max(reduced.cost - reduced.residual_count, 1e-9)
