"""Which effects are worth a fit: those whose signatures promise most of what they act in."""

from __future__ import annotations

from collections.abc import Sequence

from pneucli.diagnose.candidate import Decision
from pneucli.diagnose.data import DiagnosisData, FittedModel, ScreenedEffect
from pneucli.diagnose.hypothesis_tests import MIN_COST_SHARE, apply_tests

MAX_REFITS = 6  # of the effects that promise most
SHARED_REFITS = 3  # of them, that go to the subsystems by their parts of the residual
MIN_CHI2 = 12.0  # the fall of the cost that a signature must promise: a chi-square that chance gives once in 2000
MIN_RELATIVE_SHARE = 0.01  # of the share that the best signature promises


def score_test_screen(
    bench: DiagnosisData, state: FittedModel, screened: Sequence[ScreenedEffect]
) -> list[ScreenedEffect]:
    """Return the effects whose best signatures promise most, the best first.

    What counts is the share of what they act in: where gas and valve are 20 times their noise off, all that friction
    may explain is less than a hundredth of all.
    """
    worth = [(s[0].gain / bench.sensitive_cost(state, e)[0], (e, s)) for e, s in screened if s[0].gain > MIN_CHI2]
    worth.sort(key=lambda one: -one[0])
    chosen = [pair for _, pair in _subsystem_leaders(bench, state, worth)]
    promising = [pair for share, pair in worth if share > MIN_RELATIVE_SHARE * worth[0][0] and pair not in chosen]
    kept = [*chosen, *promising[: MAX_REFITS - len(chosen)]]
    return [pair for _, pair in worth if pair in kept]


def _subsystem_leaders(
    bench: DiagnosisData, state: FittedModel, worth: Sequence[tuple[float, ScreenedEffect]]
) -> list[tuple[float, ScreenedEffect]]:
    """Return the best effects of each subsystem, so many as its part of the residual is of ``SHARED_REFITS``.

    An effect that acts everywhere, such as a sensor's fault, belongs to no subsystem.
    """
    total = float(state.train_costs.sum())
    groups: dict[bytes, list[tuple[float, ScreenedEffect]]] = {}
    for one in worth:
        groups.setdefault(bench.sensitive_blocks(one[1][0]).tobytes(), []).append(one)
    leaders = []
    for group in groups.values():
        cost = bench.sensitive_cost(state, group[0][1][0])[0]
        if cost < total:
            leaders += group[: int(SHARED_REFITS * cost / total)]
    return leaders


CONVERGED_COST_RATIO = 1.05  # times the least cost: such trials are fitted to the end before they are compared
Decisions = list[Decision]  # about the effects that a rung lacks


def screen_and_refit(
    bench: DiagnosisData, state: FittedModel, without: Sequence[str] = (), named: FittedModel | None = None
) -> Decisions:
    """Decide on every effect that the state lacks: the best of the screen are refitted and come first.

    ``named`` is what they are to be compared with, besides one another.
    """
    likely = score_test_screen(
        bench, state, [(e, s) for e, s in bench.ranked_signatures(state) if e.name not in without]
    )
    trials = bench.refit_with(state, [effect for effect, _ in likely], [found for _, found in likely])
    rivals = [*(t.full for t in trials), *([named] if named else [])]
    close = CONVERGED_COST_RATIO * min((rival.cost for rival in rivals), default=0.0)
    matter = [t for t in trials if t.train_gain.total > MIN_COST_SHARE * bench.sensitive_cost(state, t.effect)[0]]
    polished = bench.refit_to_convergence([t for t in matter if t.full.cost < close])
    ended = {t.effect.name: t for t in [*trials, *polished]}
    others = [Decision(e, "not-promising") for e in bench.absent_effects(state) if e.name not in {*without, *ended}]
    return apply_tests(bench, state, sorted(ended.values(), key=lambda t: t.full.cost)) + others
