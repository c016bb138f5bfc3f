"""Why an effect is named or refused: its evidence, its probability (:mod:`pneucli.diagnose.calibration`), a reason."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pneucli.diagnose.adequacy import significant_lack_of_fit
from pneucli.diagnose.calibration import MIN_NAMED_PROBABILITY, Evidence, probability
from pneucli.diagnose.candidate import Candidate, Decision, Reason
from pneucli.diagnose.constraints import violated_constraint
from pneucli.diagnose.data import DiagnosisData, lack_of_fit
from pneucli.diagnose.equivalence import DISCREPANCY_READINGS, Term
from pneucli.diagnose.evidence import null_contrast, relative_effect_size, significance
from pneucli.diagnose.free_run_error import removed_error_share
from pneucli.diagnose.score import FittedModel
from pneucli.physics.declaration import Effect
from pneucli.simulate.rig_quantities import rig_quantities


@dataclass(frozen=True)
class Judgement:
    """The decision about an effect, its evidence, and the probability by this evidence."""

    decision: Decision
    evidence: Evidence
    probability: float


def judge(data: DiagnosisData, term: Term, *, constrained: bool = False, error_may_rise: bool = False) -> Judgement:
    """Judge an effect in the model that a term leads to.

    An effect that is more probably absent is refused; ``constrained``: so is one that violates a hard constraint
    (:mod:`pneucli.diagnose.constraints`), the last of which does not count where ``error_may_rise``.
    """
    candidate = term.candidate
    complete = is_complete(data, candidate.full)
    evidence = _evidence(data, term, complete=complete)
    p = probability(evidence)
    violated = None
    if constrained:
        may_rise = error_may_rise or term.is_measured_exclusively(data)
        violated = violated_constraint(data, candidate, distance=evidence.significance, error_may_rise=may_rise)
    improbable: Reason = "immaterial" if complete else "explained-by-unknown"
    reason = violated or ("supported" if p >= MIN_NAMED_PROBABILITY else improbable)
    return Judgement(Decision(candidate.effect, reason, candidate), evidence, p)


def is_complete(data: DiagnosisData, fitted: FittedModel) -> bool:
    """Whether a model leaves nothing beyond noise and the uncertainty of its parameters."""
    return not significant_lack_of_fit(*lack_of_fit(data, fitted))


def _evidence(data: DiagnosisData, term: Term, *, complete: bool) -> Evidence:
    """Return the evidence for a term's effect or its equivalents; the free run counts where only noise is left."""
    candidate, errors, share = term.candidate, data.free_run_errors, None
    if complete and errors is not None:
        share = removed_error_share(errors(candidate.reduced.model), errors(candidate.full.model))
    deviation, size = _significance_and_size(data, candidate.full, candidate.effect)
    return Evidence(share, deviation, size, complete, term.remaining_variance(data))


def log_odds_among_equivalents(data: DiagnosisData, candidate: Candidate) -> float:
    """Return the log odds of a candidate against its equivalents.

    All equivalents resemble the same unmodelled effect, and an effect of more than its typical size is no more
    probable. The remaining free-run error counts as DISCREPANCY_READINGS independent readings: a force balance contains
    few break-aways, and a trajectory depends on each of them.
    """
    p = judge(data, Term(candidate, ())).probability
    errors = list[float]()
    if data.free_run_errors is not None:
        found = data.free_run_errors(candidate.full.model, candidate.reduced.model)  # all in units of the same model
        errors = [e for e in found.values() if e]
    return math.log(p / (1.0 - p)) - DISCREPANCY_READINGS * (float(np.mean(np.log(errors))) if errors else 0.0)


def _significance_and_size(data: DiagnosisData, fitted: FittedModel, effect: Effect) -> tuple[float, float]:
    """Return the distance of an effect from its absence over the standard error of its interval, and its size."""
    facts = rig_quantities(fitted.model, [residual_model.experiment for residual_model in data.train])
    size = relative_effect_size(fitted.fit, effect, facts, data.train)
    own = null_contrast(fitted.fit, effect)
    rows = np.eye(len(fitted.fit.free))[[f.name.startswith(f"{effect.name}.") for f in fitted.fit.free]]
    rows = rows if own is None else own.contrast
    by_blocks, of_intervals = data.contrast_variances(fitted, rows)
    inflation = float(np.mean(of_intervals / by_blocks)) if np.all(by_blocks > 0.0) and len(rows) else 1.0
    return significance(fitted.fit, effect, data.train) / math.sqrt(inflation), size
