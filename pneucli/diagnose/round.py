"""One round of the search: every effect that a state lacks is put to the test."""

from __future__ import annotations

from collections.abc import Sequence

from pneucli.diagnose.decision import Decision
from pneucli.diagnose.judge import MATERIAL, judged
from pneucli.diagnose.promise import promising
from pneucli.diagnose.trial import Bench, State

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
