"""Which effects are worth a fit: those whose signatures promise most of what they act in."""

from __future__ import annotations

from collections.abc import Sequence

from pneucli.diagnose.candidate import Decision
from pneucli.diagnose.data import Bench, Screened, State
from pneucli.diagnose.hypothesis_tests import MATERIAL, judged

REFITS = 6  # of the effects that promise most
WORTH = 12.0  # the fall of the cost that a signature must promise: a chi-square that chance gives once in 2000
HOPELESS = 0.01  # of the share that the best signature promises


def promising(bench: Bench, state: State, screened: Sequence[Screened]) -> list[Screened]:
    """Return the effects whose best signatures promise most, the best first.

    What counts is the share of what they act in: where gas and valve are 20 times their noise off, all that friction
    may explain is less than a hundredth of all.
    """
    worth = [(s[0].gain / bench.felt(state, e)[0], (e, s)) for e, s in screened if s[0].gain > WORTH]
    worth.sort(key=lambda one: -one[0])
    return [pair for share, pair in worth[:REFITS] if share > HOPELESS * worth[0][0]]


CLOSE = 1.05  # times the least cost: such trials are fitted to the end before they are compared
Round = list[Decision]  # about the effects that a rung lacks


def tried(bench: Bench, state: State, without: Sequence[str] = (), named: State | None = None) -> Round:
    """Decide on every effect that the state lacks: the best of the screen are refitted and come first.

    ``named`` is what they are to be compared with, besides one another.
    """
    likely = promising(bench, state, [(e, s) for e, s in bench.screen(state) if e.name not in without])
    trials = bench.added(state, [effect for effect, _ in likely], [found for _, found in likely])
    rivals = [*(t.state for t in trials), *([named] if named else [])]
    close = CLOSE * min((rival.cost for rival in rivals), default=0.0)
    matter = [t for t in trials if t.train.total > MATERIAL * bench.felt(state, t.effect)[0]]
    polished = bench.polished([t for t in matter if t.state.cost < close])
    ended = {t.effect.name: t for t in [*trials, *polished]}
    others = [Decision(e, "not-promising") for e in bench.lacking(state) if e.name not in {*without, *ended}]
    return judged(bench, state, sorted(ended.values(), key=lambda t: t.state.cost)) + others
