"""Which candidate the selection adds next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pneucli.diagnose.adequacy import significant_lack_of_fit
from pneucli.diagnose.calibration import MIN_NAMED_PROBABILITY
from pneucli.diagnose.candidate import Candidate, Reason, supported_candidates
from pneucli.diagnose.data import DiagnosisData, lack_of_fit
from pneucli.diagnose.decision import log_odds_among_equivalents, posterior_probability, predicts_point_force
from pneucli.diagnose.equivalence import Term, best_candidate
from pneucli.diagnose.hypothesis_tests import is_at_noise_floor
from pneucli.diagnose.screening import Decisions


def next_term(data: DiagnosisData, decisions: Decisions) -> tuple[Candidate | None, Decisions]:
    """Return the best supported candidate that the free-run error does not contradict, and the updated decisions."""
    while candidates := supported_candidates(decisions):
        first = _best_or_most_probable(data, candidates)
        refused = "explained-by-unknown" if may_hide_force(data, first) else free_run_refusal(data, first)
        if refused is None:
            return first, decisions
        decisions = [replace(d, reason=refused) if d.candidate is first else d for d in decisions]
    return None, decisions


def _best_or_most_probable(data: DiagnosisData, candidates: Sequence[Candidate]) -> Candidate:
    """Return the candidate with the lowest cost, or the most probable one where an unmodelled effect remains.

    With an unmodelled effect the lowest cost means little: a spring of a tenth of its usual stiffness, far from its
    rest position, is a constant force.
    """
    first = best_candidate(data, candidates)
    if len(candidates) == 1 or not significant_lack_of_fit(*lack_of_fit(data, first.full)):
        return first
    ranked = [first, *(c for c in candidates if c is not first)]
    terms = [Term(c, tuple(other for other in candidates if other is not c)) for c in ranked]
    return most_probable_equivalent(data, max(terms, key=lambda term: posterior_probability(data, term)))


def most_probable_equivalent(data: DiagnosisData, term: Term) -> Candidate:
    """Return the most probable of a term's candidate and its equivalents, with an unmodelled effect present."""
    return max(
        [term.candidate, *term.equivalents(data, complete=False)], key=lambda c: log_odds_among_equivalents(data, c)
    )


def may_hide_force(data: DiagnosisData, candidate: Candidate) -> bool:
    """Whether a set-valued friction law leaves a force unexplained, which its interval could hide.

    Such a law is acceptable where its probability reaches MIN_NAMED_PROBABILITY by what else it explains.
    """
    unexplained = significant_lack_of_fit(*lack_of_fit(data, candidate.full)) if candidate.effect.is_set_valued else []
    return (
        not predicts_point_force(candidate.effect, unexplained)
        and posterior_probability(data, Term(candidate, ())) < MIN_NAMED_PROBABILITY
    )


def free_run_refusal(data: DiagnosisData, candidate: Candidate) -> Reason | None:
    """Return why the free-run error contradicts a candidate; None where it does not.

    At the noise floor the error must fall by more than chance: the description of the rig, the smoothing or the clock
    may cause a tiny significant effect.
    """
    if raises_free_run_error(data, candidate):
        return "raises-error"
    return (
        "immaterial"
        if is_at_noise_floor(candidate.reduced)
        and not data.free_run_error_falls_clearly(candidate.reduced, candidate.full)
        else None
    )


def raises_free_run_error(data: DiagnosisData, candidate: Candidate) -> bool:
    """Whether a candidate raises the free-run error.

    An effect that an exclusive channel measures may raise it: another unmodelled effect may have compensated for it, as
    a piston's friction can for the bias of its accelerometer.
    """
    return data.free_run_error_rises(candidate.reduced, candidate.full) and not Term(
        candidate, ()
    ).is_measured_exclusively(data)
