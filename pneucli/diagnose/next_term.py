"""Which effect leads a round: what is added next to the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pneucli.diagnose.adequacy import significant_lack_of_fit
from pneucli.diagnose.calibration import MIN_NAMED_PROBABILITY
from pneucli.diagnose.candidate import Reason, supported_candidates
from pneucli.diagnose.data import Candidate, DiagnosisData, lack_of_fit
from pneucli.diagnose.equivalence import Term, best_candidate
from pneucli.diagnose.hypothesis_tests import is_at_noise_floor
from pneucli.diagnose.posterior import log_odds_among_equivalents, posterior_probability, predicts_point_force
from pneucli.diagnose.screening import Decisions


def next_term(bench: DiagnosisData, decisions: Decisions) -> tuple[Candidate | None, Decisions]:
    """Return the foremost trial that passes and that the user sees the good of, and what is decided with that."""
    while able := supported_candidates(decisions):
        first = _best_or_most_probable(bench, able)
        refused = "explained-by-unknown" if may_hide_force(bench, first) else free_run_refusal(bench, first)
        if refused is None:
            return first, decisions
        decisions = [replace(d, reason=refused) if d.candidate is first else d for d in decisions]
    return None, decisions


def _best_or_most_probable(bench: DiagnosisData, able: Sequence[Candidate]) -> Candidate:
    """Return the trial that leaves least; where even that leaves something unknown, the one likeliest to be there.

    What leaves least is no better then: a spring of a tenth of its usual stiffness far from its rest is a force.
    """
    first = best_candidate(bench, able)
    if len(able) == 1 or not significant_lack_of_fit(*lack_of_fit(bench, first.full)):
        return first
    ranked = [first, *(t for t in able if t is not first)]
    places = [Term(t, tuple(other for other in able if other is not t)) for t in ranked]
    return most_probable_equivalent(bench, max(places, key=lambda place: posterior_probability(bench, place)))


def most_probable_equivalent(bench: DiagnosisData, place: Term) -> Candidate:
    """Return what stands best of the named effect and of what leaves as much in its place, beside something unknown."""
    return max(
        [place.candidate, *place.equivalents(bench, complete=False)], key=lambda t: log_odds_among_equivalents(bench, t)
    )


def may_hide_force(bench: DiagnosisData, trial: Candidate) -> bool:
    """Whether an effect that states bounds leaves a force over, any of which would stay hidden within them.

    But not one that is likelier there than not, by what else it explains.
    """
    left = significant_lack_of_fit(*lack_of_fit(bench, trial.full)) if trial.effect.is_set_valued else []
    return (
        not predicts_point_force(trial.effect, left)
        and posterior_probability(bench, Term(trial, ())) < MIN_NAMED_PROBABILITY
    )


def free_run_refusal(bench: DiagnosisData, trial: Candidate) -> Reason | None:
    """Return why the error that the user sees speaks against a trial, None where it does not.

    Where no more than noise is left, it must fall by more than chance moves it: a sure and tiny effect is one that the
    rig's description, the smoothing or the clock may have as well.
    """
    if raises_free_run_error(bench, trial):
        return "raises-error"
    return (
        "immaterial"
        if is_at_noise_floor(trial.reduced) and not bench.free_run_error_falls_clearly(trial.reduced, trial.full)
        else None
    )


def raises_free_run_error(bench: DiagnosisData, trial: Candidate) -> bool:
    """Whether a trial raises the error that the user sees.

    What readings show alone does not: what is unknown besides may have leant on it, as a piston's friction on a bias of
    its accelerometer.
    """
    return bench.free_run_error_rises(trial.reduced, trial.full) and not Term(trial, ()).is_measured_exclusively(bench)
