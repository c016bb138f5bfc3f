"""Screening: a score test ranks the effects that the model lacks, and only the most promising are refitted."""

from __future__ import annotations

from collections.abc import Sequence

from pneucli.diagnose.candidate import Candidate, Decision
from pneucli.diagnose.data import CONVERGED_COST_RATIO, DiagnosisData, ScreenedEffect
from pneucli.diagnose.hypothesis_tests import apply_tests
from pneucli.diagnose.score import FittedModel

MAX_BY_SHARE, MAX_BY_GAIN = 3, 2  # effects that are refitted in one round, by each of the two rankings
MIN_CHI2 = 12.0  # predicted reduction of the cost, chi-square with one degree of freedom: p = 1/2000
MIN_RELATIVE_SHARE = 0.01  # of the largest predicted share


def score_test_screen(
    data: DiagnosisData, fitted: FittedModel, screened: Sequence[ScreenedEffect]
) -> list[ScreenedEffect]:
    """Return the effects to refit: those with the largest predicted shares, and those with the largest gains.

    The share is the predicted reduction over the cost of the residuals that the effect influences. Without it a
    friction effect would lose against effects on gas and valve wherever those residuals are 20 times their noise. By
    the gain itself an effect leads that removes a little of all residuals. What another effect hides, the next round
    finds.
    """
    promising = [(s[0].gain / data.sensitive_cost(fitted, e)[0], (e, s)) for e, s in screened if s[0].gain > MIN_CHI2]
    promising.sort(key=lambda one: -one[0])
    by_share = [pair for share, pair in promising if share > MIN_RELATIVE_SHARE * promising[0][0]]
    by_gain = sorted(by_share, key=lambda pair: -pair[1][0].gain)[:MAX_BY_GAIN]
    return [pair for i, pair in enumerate(by_share) if i < MAX_BY_SHARE or pair in by_gain]


Decisions = list[Decision]  # about the effects that a model lacks


def screen_and_refit(
    data: DiagnosisData, fitted: FittedModel, excluded: Sequence[str] = (), reference: FittedModel | None = None
) -> Decisions:
    """Decide on every effect that the model lacks; the refitted ones come first.

    ``excluded`` effects are not considered. ``reference`` is a further model that the candidates compete with.
    """
    screened_in = score_test_screen(
        data, fitted, [(e, s) for e, s in data.ranked_signatures(fitted) if e.name not in excluded]
    )
    decided = _refit_and_test(data, fitted, screened_in, reference)
    known = {*excluded, *(d.effect.name for d in decided)}
    return decided + [Decision(e, "not-promising") for e in data.absent_effects(fitted.model) if e.name not in known]


def refit_twins(data: DiagnosisData, full: FittedModel, candidate: Candidate, tried: Decisions) -> Decisions:
    """Decide on the twins of a candidate's effect, by its declaration, that ``tried`` has not refitted in its place.

    They look like it, so what else is missing may hide them from a screen. ``full`` is the model they compete with.
    """
    refitted = {d.effect.name for d in tried if d.candidate is not None}
    twins = [
        (e, s)
        for e, s in data.ranked_signatures(candidate.reduced)
        if e.name.partition(":")[0] in candidate.effect.twins and e.name not in refitted and s[0].gain > MIN_CHI2
    ]
    return _refit_and_test(data, candidate.reduced, twins, full)


def _refit_and_test(
    data: DiagnosisData, fitted: FittedModel, screened_in: Sequence[ScreenedEffect], reference: FittedModel | None
) -> Decisions:
    candidates = data.refit_with(fitted, [effect for effect, _ in screened_in], [tests for _, tests in screened_in])
    rivals = [*(c.full for c in candidates), *([reference] if reference else [])]
    cost_limit = CONVERGED_COST_RATIO * min((rival.cost for rival in rivals), default=0.0)
    converged = data.refit_to_convergence([c for c in candidates if c.full.cost < cost_limit])
    refitted = {c.effect.name: c for c in [*candidates, *converged]}
    return apply_tests(data, sorted(refitted.values(), key=lambda c: c.full.cost))
