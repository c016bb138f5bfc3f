"""Beside something unknown: how sure an effect is, and whether it is named."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pneucli.diagnose.adequacy import LackOfFit, significant_lack_of_fit
from pneucli.diagnose.calibration import MIN_NAMED_PROBABILITY, Evidence, probability
from pneucli.diagnose.candidate import Decision, Reason
from pneucli.diagnose.data import Candidate, DiagnosisData, FittedModel, lack_of_fit
from pneucli.diagnose.equivalence import DISCREPANCY_READINGS, Term, nonparametric_rival
from pneucli.diagnose.evidence import disagreement, relative_effect_size, significance
from pneucli.diagnose.free_run_error import removed_error_share
from pneucli.diagnose.hypothesis_tests import passing_candidates
from pneucli.diagnose.validity import refuted_by_reading
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

LARGE_LACK_OF_FIT = 3.5  # times the expected rms: where so much is left, more than one thing acts
MIN_SHARE_IF_LARGE = 0.25  # of what exceeds noise, where much is left
MIN_SHARE = 0.95  # the same where little is left: an effect that resembles one unknown would leave little too
MIN_SHARE_WITHOUT_HELD_OUT = 0.9  # the same where no recording was held out to contradict it
PROBABILITY_FLOOR = 1e-6  # no effect is there, or absent, with less doubt
MAX_DISAGREEMENT = 0.5  # of an effect's size: recordings that want it changed by more do not show this effect


def decide(
    bench: DiagnosisData,
    last: FittedModel,
    trial: Candidate,
    unexplained: Sequence[LackOfFit],
    term: Term | None,
    equivalents: Sequence[str] = (),
) -> DecisionWithEvidence:
    """Return the decision about an effect that was added, and what it rests on, its ``term`` in the last model too.

    What is more likely a stand-in for something unknown is not named; where no exam tells how likely that is, only
    beside something that is ``unexplained``. ``equivalents`` are the effects that the data cannot tell from it.
    """
    evidence = collect_evidence(bench, last, trial, term, equivalents, complete=not unexplained)
    failed: list[tuple[bool, Reason]] = [
        (refuted_by_reading(trial.full.model, trial.effect, bench.train), "contradicted-by-reading"),
        (has_unmeasured_force(bench.train, trial.effect), "cannot-show"),
        (not _is_probable(bench, last, trial, unexplained, evidence), "explained-by-unknown"),
        (bool(unexplained) and not _reduces_free_run_error(bench, trial, term), "raises-error"),
    ]
    reason: Reason = next((why for fails, why in failed if fails), "supported")
    if reason == "supported" and term is not None and _has_better_smooth_rival(bench, term):
        reason = "explained-by-signal"
    return Decision(trial.effect, reason, trial), evidence


def _is_probable(
    bench: DiagnosisData, last: FittedModel, trial: Candidate, left: Sequence[LackOfFit], evidence: Evidence
) -> bool:
    """Whether an effect is likelier there than absent; where no exam tells, whether it takes enough of what is left."""
    if has_calibration(bench, trial.effect):
        return probability(evidence) >= MIN_NAMED_PROBABILITY
    if not left:
        return True
    share, agree = (
        explained_excess_cost(trial.reduced, trial.full),
        disagreement_between_recordings(bench, last, trial.effect.name),
    )
    return predicts_point_force(trial.effect, left) and passes_fallback(bench, share, agree, left)


def _has_better_smooth_rival(bench: DiagnosisData, place: Term) -> bool:
    """Whether a law of one signal stands better in an effect's place, of what no readings show alone."""
    return not place.is_measured_exclusively(bench) and nonparametric_rival(bench, place) is not None


def retest_without_refused(
    bench: DiagnosisData, last: FittedModel, weights: Sequence[DecisionWithEvidence], unexplained: Sequence[LackOfFit]
) -> list[DecisionWithEvidence]:
    """Return what is decided about the effects of the ``last`` model, named only what is good without those refused.

    The user will not add those. So a force on the piston may undo what an offset of its pressure does there, which
    stands in for something unknown; by itself it is nothing.
    """
    refused = [d.effect for d, _ in weights if not d.supported]
    stood_in = any(d.reason == "explained-by-signal" for d, _ in weights)
    if not (unexplained or stood_in) or not refused or len(refused) == len(weights):
        return list(weights)
    for effect in refused:
        (last,) = bench.refit_without(last, [effect])
    now = unexplained or significant_lack_of_fit(*lack_of_fit(bench, last))
    return [
        _retested(bench, last, one, now, same=bool(unexplained) or not now) if one[0].supported else one
        for one in weights
    ]


def _retested(
    bench: DiagnosisData, last: FittedModel, known: DecisionWithEvidence, left: Sequence[LackOfFit], *, same: bool
) -> DecisionWithEvidence:
    """Return what is known of a named effect, or what the named model says of it where it does not pass there.

    So too where it is not the ``same``: beside what was taken for noise something is left without those refused.
    """
    effect = known[0].effect
    (before,) = bench.refit_without(last, [effect])
    place = Term(bench.candidate(before, last, effect), ())
    stays = bool(passing_candidates(bench, before, [place.candidate])) and _reduces_free_run_error(
        bench, place.candidate, place
    )
    return known if stays and same else decide(bench, last, place.candidate, left, place, known[1].effects[1:])


def _reduces_free_run_error(bench: DiagnosisData, trial: Candidate, place: Term | None) -> bool:
    """Whether the error that the user sees falls, as a rung of the ladder or in its place beside all others.

    Or readings show the effect alone, which need no such proof.
    """
    if bench.free_run_error_falls(trial.reduced, trial.full) or place is None:
        return bench.free_run_error_falls(trial.reduced, trial.full)
    return bench.free_run_error_falls(place.candidate.reduced, place.candidate.full) or place.is_measured_exclusively(
        bench
    )


def predicts_point_force(effect: Effect, unexplained: Sequence[LackOfFit]) -> bool:
    """Whether an effect states a force wherever one is left over; bounds alone would keep any force within them."""
    return not (effect.is_set_valued and any(r.kind.predicts_force for r in unexplained))


def has_unmeasured_force(views: Sequence[ResidualModel], effect: Effect) -> bool:
    """Whether an effect shows only in balances of forces of which a pressure that acts on the piston was not recorded.

    Chamber 2 is shut or driven and p2 is missing: its force is missing too, and a spring would stand in for it.
    """
    felt = [view for view in views if view.is_sensitive_to(effect)]
    return bool(felt) and all(lacks_p2(view) for view in felt)


def lacks_p2(view: ResidualModel) -> bool:
    """Whether a view is of the forces on a piston of whose shut or driven chamber 2 no pressure was recorded."""
    return type(view) is ForceBalance and view.experiment.p2_is_unmeasured


def has_calibration(bench: DiagnosisData, effect: Effect) -> bool:
    """Whether exams have recordings of this kind: only there is the law of the probability known.

    They have no force alone, and always a recording that was held out.
    """
    return bench.has_held_out_data and all(
        type(view) in (ChamberPressures, ForceBalance, ImposedMotion, ForceBalanceInferredP2)
        for view in bench.train
        if view.is_sensitive_to(effect)
    )


def passes_fallback(bench: DiagnosisData, share: float, disagreement: float, unexplained: Sequence[LackOfFit]) -> bool:
    """Whether an effect is more than a stand-in where no exam tells: it takes most, or much is left beside it."""
    if disagreement > MAX_DISAGREEMENT and bench.has_held_out_data:
        return False
    if not bench.has_held_out_data:
        return share > MIN_SHARE_WITHOUT_HELD_OUT
    return share > MIN_SHARE or (share > MIN_SHARE_IF_LARGE and unexplained[0].ratio > LARGE_LACK_OF_FIT)


def collect_evidence(
    bench: DiagnosisData,
    last: FittedModel,
    trial: Candidate,
    term: Term | None,
    equivalents: Sequence[str] = (),
    *,
    complete: bool,
) -> Evidence:
    """Return what tells the effect of a trial, as it is in the ``last`` state, from a stand-in.

    ``equivalents``: effects that the data cannot tell from it. ``complete``: the last state leaves nothing but noise.
    """
    share = (
        None
        if bench.free_run_errors is None
        else removed_error_share(bench.free_run_errors(trial.reduced.model), bench.free_run_errors(trial.full.model))
    )
    left = 1.0 if term is None else term.remaining_share(bench)
    sure, size = _significance_and_size(bench, last, trial.effect)
    return Evidence(
        share,
        sure,
        size,
        complete,
        left,
        acts_only_under_imposed_motion(bench, trial.effect),
        (trial.effect.name, *equivalents),
    )


def posterior_probability(bench: DiagnosisData, term: Term) -> float:
    """Return the probability that an effect, in its place beside others and something unknown, is there.

    Or one of those in its place that the data cannot tell from it.
    """
    alike = [t.effect.name for t in term.equivalents(bench, complete=False)]
    return probability(collect_evidence(bench, term.candidate.full, term.candidate, term, alike, complete=False))


def log_odds_among_equivalents(bench: DiagnosisData, trial: Candidate) -> float:
    """Return the log of how likely a trial is against others that leave as much in its place.

    Its odds, whatever effect it is: the unknown that one of them resembles, all of them do; and one that is larger than
    usual is no likelier than its twin. And what is left of the error that the user sees, as so many independent
    readings: a balance of forces has few break-aways, and a trajectory hangs on them.
    """
    evidence = collect_evidence(bench, trial.full, trial, Term(trial, ()), complete=False)
    alone = evidence._replace(share=None, size=min(evidence.size, 1.0), effects=())
    p = min(max(probability(alone), PROBABILITY_FLOOR), 1.0 - PROBABILITY_FLOOR)
    errors = [] if bench.free_run_errors is None else [e for e in bench.free_run_errors(trial.full.model).values() if e]
    return math.log(p / (1.0 - p)) - DISCREPANCY_READINGS * (float(np.mean(np.log(errors))) if errors else 0.0)


def acts_only_under_imposed_motion(bench: DiagnosisData, effect: Effect) -> bool:
    """Whether an effect acts in nothing but recordings whose motion is imposed and whose force is measured."""
    return all(type(view) is ImposedMotion for view in bench.train if view.is_sensitive_to(effect))


def _significance_and_size(bench: DiagnosisData, state: FittedModel, effect: Effect) -> tuple[float, float]:
    facts = rig_quantities(state.model, [view.experiment for view in bench.train])
    size = relative_effect_size(state.fit, effect, facts, bench.train)
    return significance(state.fit, effect, bench.train), size


def disagreement_between_recordings(bench: DiagnosisData, state: FittedModel, name: str) -> float:
    """Return by which part of its size single recordings want an effect changed; of one alone, its quarters."""
    names = [view.experiment.recording.name for view in bench.train]
    alone, number = len(set(names)) == 1, np.unique(names, return_inverse=True)[1]
    parts = [
        _quarters(view) if alone else np.full(_residual_count(view), i)
        for view, i in zip(bench.train, number, strict=True)
    ]
    return disagreement(state.fit, bench.effects[name], np.concatenate(parts), bench.train)


def _residual_count(view: ResidualModel) -> int:
    return view.experiment.time.size * len(view.channels)


def _quarters(view: ResidualModel) -> NDArray[np.int64]:
    """Return the quarter of the recording in which each residual stands."""
    n = view.experiment.time.size
    return np.tile(np.arange(n) * 4 // n, len(view.channels))


def explained_excess_cost(before: FittedModel, after: FittedModel) -> float:
    """Return the share of what exceeds noise that a step takes away, on fitted and on held-out recordings."""
    return (before.cost - after.cost) / max(before.cost - before.residual_count, 1e-9)
