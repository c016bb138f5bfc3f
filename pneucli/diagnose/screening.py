"""Screening: a score test ranks the effects that the model lacks, and only the most promising are refitted."""

from __future__ import annotations

from collections.abc import Sequence

from pneucli.diagnose.candidate import Decision
from pneucli.diagnose.data import DiagnosisData, ScreenedEffect
from pneucli.diagnose.hypothesis_tests import apply_tests
from pneucli.diagnose.score import FittedModel

MAX_REFITS = 6  # effects at most in one round
SHARED_REFITS = 3  # of them are divided among the subsystems by their shares of the cost
MIN_CHI2 = 12.0  # predicted reduction of the cost, chi-square with one degree of freedom: p = 1/2000
MIN_RELATIVE_SHARE = 0.01  # of the largest predicted share


def score_test_screen(
    data: DiagnosisData, fitted: FittedModel, screened: Sequence[ScreenedEffect]
) -> list[ScreenedEffect]:
    """Return the effects with the largest predicted cost reduction, the best first.

    The reduction is divided by the cost of the residuals that the effect influences. Without this a friction effect
    would lose against effects on gas and valve wherever those residuals are 20 times their noise.
    """
    scored = [(s[0].gain / data.sensitive_cost(fitted, e)[0], (e, s)) for e, s in screened if s[0].gain > MIN_CHI2]
    scored.sort(key=lambda one: -one[0])
    leaders = [pair for _, pair in _subsystem_leaders(data, fitted, scored)]
    promising = [pair for share, pair in scored if share > MIN_RELATIVE_SHARE * scored[0][0] and pair not in leaders]
    selected = [*leaders, *promising[: MAX_REFITS - len(leaders)]]
    return [pair for _, pair in scored if pair in selected]


def _subsystem_leaders(
    data: DiagnosisData, fitted: FittedModel, scored: Sequence[tuple[float, ScreenedEffect]]
) -> list[tuple[float, ScreenedEffect]]:
    """Return the best effects of each subsystem, the best first; their number is its share of the cost, times
    SHARED_REFITS, and SHARED_REFITS in all.

    An effect that influences every residual, such as a fault of a sensor, belongs to no subsystem. Subsystems overlap
    (chamber 1, chamber 2, both), so without the limit their effects would take every refit from the best one.
    """
    total = float(fitted.train_costs.sum())
    subsystems: dict[bytes, list[tuple[float, ScreenedEffect]]] = {}
    for one in scored:
        subsystems.setdefault(data.sensitive_blocks(one[1][0]).tobytes(), []).append(one)
    leaders = []
    for members in subsystems.values():
        cost = data.sensitive_cost(fitted, members[0][1][0])[0]
        if cost < total:
            leaders += members[: int(SHARED_REFITS * cost / total)]
    return sorted(leaders, key=lambda one: -one[0])[:SHARED_REFITS]


CONVERGED_COST_RATIO = (
    1.05  # times the lowest cost: candidates within it are refitted to convergence before the comparison
)
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
    candidates = data.refit_with(fitted, [effect for effect, _ in screened_in], [tests for _, tests in screened_in])
    rivals = [*(c.full for c in candidates), *([reference] if reference else [])]
    cost_limit = CONVERGED_COST_RATIO * min((rival.cost for rival in rivals), default=0.0)
    converged = data.refit_to_convergence([c for c in candidates if c.full.cost < cost_limit])
    refitted = {c.effect.name: c for c in [*candidates, *converged]}
    others = [
        Decision(e, "not-promising") for e in data.absent_effects(fitted.model) if e.name not in {*excluded, *refitted}
    ]
    return apply_tests(data, sorted(refitted.values(), key=lambda c: c.full.cost)) + others
