"""Which set of effects: forward, backward, and pairs where no single effect opens the way."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from pneucli.diagnose.adequacy import Remainder, too_much
from pneucli.diagnose.calibration import NAMED
from pneucli.diagnose.candidate import Decision, passed
from pneucli.diagnose.data import Bench, State, Trial, remains
from pneucli.diagnose.equivalence import Place
from pneucli.diagnose.evidence import gain
from pneucli.diagnose.hypothesis_tests import material, supported
from pneucli.diagnose.next_term import leading, spoils
from pneucli.diagnose.posterior import likely
from pneucli.diagnose.screening import Round, tried
from pneucli.identify.estimation.model_fit import Signature
from pneucli.physics.declaration import Effect

MOST_EFFECTS = 4
PAIRS = 3


@dataclass(frozen=True)
class Search:
    """The way taken: ``rungs`` from the model as it is to the last, each with one effect more.

    ``places`` holds every effect of the last model with what passed in its place; ``decisions`` what became of the
    others that were screened, one for each; ``doubted`` are those of them that were added and were likelier absent.
    """

    rungs: tuple[State, ...]
    places: dict[str, Place]
    decisions: tuple[Decision, ...]
    train: tuple[Remainder, ...]
    test: tuple[Remainder, ...]
    doubted: tuple[Trial, ...] = ()

    @property
    def last(self) -> State:
        """The model with all that was found."""
        return self.rungs[-1]

    @property
    def added(self) -> list[str]:
        """The effects found, in the order to add them: that of the rungs, which may not be that of the last model."""
        return [next(n for n in after.names if n not in before.names) for before, after in pairwise(self.rungs)]

    @property
    def adequate(self) -> bool:
        """Whether nothing is left over beyond noise."""
        return not too_much(self.train, self.test)


def search(bench: Bench, base: State) -> Search:
    """Find the effects that explain what ``base`` leaves over."""
    rungs, rounds = _forward(bench, [base], [])
    if len(rungs) <= 2 and too_much(*remains(bench, rungs[-1])):
        rungs, rounds = _pairs(bench, rungs, rounds)
    rungs, places, refused = _revise(bench, rungs, rounds)
    last = rungs[-1]
    doubted = [d for d in refused if d.reason == "explained-by-unknown" and d.effect.name not in last.names]
    train, test = remains(bench, last)
    return Search(
        rungs=tuple(rungs),
        places=places,
        decisions=decided(rounds, refused, last.names),
        doubted=tuple(d.trial for d in doubted if d.trial is not None),
        train=tuple(train),
        test=tuple(test),
    )


def decided(rounds: Sequence[Round], refused: Sequence[Decision], names: Sequence[str]) -> tuple[Decision, ...]:
    """Return the decision about each effect that was screened and is not among ``names``.

    What was ``refused`` after it was taken stays so; else the first fit decides, against the model that lacked most.
    What passed and is not in the last model is needless there: the last round found nothing left for it.
    """
    tried = [d for each in rounds for d in each]
    ranked = [*refused, *(d for d in tried if d.trial is not None), *(d for d in tried if d.trial is None)]
    found: dict[str, Decision] = {}
    for d in ranked:
        if d.effect.name not in names:
            found.setdefault(d.effect.name, replace(d, reason="needless") if d.supported else d)
    return tuple(found.values())


def _forward(bench: Bench, rungs: list[State], rounds: list[Round]) -> tuple[list[State], list[Round]]:
    while len(rungs) <= MOST_EFFECTS:
        leader, decisions = leading(bench, tried(bench, rungs[-1]))
        rounds.append(decisions)
        if leader is None:
            break
        rungs.append(leader.state)
    return rungs, rounds


def _revise(bench: Bench, rungs: list[State], rounds: list[Round]) -> tuple[list[State], dict[str, Place], Round]:
    """Drop what should not stay beside later additions.

    Returns the rungs, the place of each effect, and what was refused after it was taken.
    """
    base = rungs[0]
    rungs, without, refused = _pruned(bench, base, rungs)
    return rungs, _places(bench, base, rungs[-1], rounds[0], without), refused


def _pruned(bench: Bench, base: State, rungs: list[State]) -> tuple[list[State], dict[str, State], Round]:
    """Return the rungs without what should not stay, states without single effects of the last, and what was refused.

    What made others needless and may not stay itself gives them back.
    """
    last, needless, without = _without_needless(bench, base, rungs[-1])
    ladder, raising = _ladder(bench, base, last, rungs)
    before = [state for state in rungs if not {d.effect.name for d in raising} & set(state.names)]
    if raising and len(before) > len(ladder):
        return before, {}, raising
    return ladder, without if ladder[-1] is last else {}, needless + raising


def _places(bench: Bench, base: State, last: State, known: Round, less: Mapping[str, State]) -> dict[str, Place]:
    """Return the place of each effect: with it what passes there in its stead.

    ``known`` is the round of the base, which lacks one effect alone where one was found; ``less`` are states without
    single effects.
    """
    places: dict[str, Place] = {}
    names = last.names[len(base.names) :]
    for name in names:
        alone = base if len(names) == 1 else less.get(name)
        before = bench.without(last, [bench.effects[name]])[0] if alone is None else alone
        decisions = known if len(names) == 1 else tried(bench, before, [name], last)
        rivals = tuple(t for t in passed(decisions) if t.effect.name != name)
        places[name] = Place(bench.trial(before, last, bench.effects[name]), rivals)
    return places


def _without_needless(bench: Bench, base: State, last: State) -> tuple[State, Round, dict[str, State]]:
    """Return the state without effects that should not stay beside the others, one after the other; and these.

    Returns, too, the states that lack one more, by its name, where more than one effect is left.
    """
    refused: Round = []
    without: dict[str, State] = {}
    while len(names := last.names[len(base.names) :]) > 1:
        effects = [bench.effects[name] for name in names]
        without = dict(zip(names, bench.without(last, effects), strict=True))
        least = _least(bench, last, [bench.trial(without[e.name], last, e) for e in effects])
        if least is None:
            break
        refused.append(least)
        last = without[least.effect.name]
    return last, refused, without


def _least(bench: Bench, last: State, trials: Sequence[Trial]) -> Decision | None:
    """Return which of the last state's effects should go first, None where all should stay.

    Beside something unknown the least likely, if it is likelier absent: such a one takes from the others what is
    theirs, so that these are not missed. Then one that is not supported beside the others, the least missed; but what
    the data would certainly and noticeably miss stays: it may not be supported alone, and yet carry the others.
    """
    if too_much(*remains(bench, last)):
        chance, unlikely = min(((likely(bench, Place(t, ())), t) for t in trials), key=lambda each: each[0])
        if chance < NAMED:
            return Decision(unlikely.effect, "explained-by-unknown", unlikely)
    needless = [t for t in trials if not supported(bench, t.before, [t]) and not _missed(t.before, last)]
    least = min(needless, key=lambda t: t.before.cost, default=None)
    return None if least is None else Decision(least.effect, "needless", least)


def _missed(before: State, last: State) -> bool:
    missed = gain(before.costs, last.costs)
    return missed.certain and missed.total > material(before.cost, before.samples)


def _ladder(bench: Bench, base: State, last: State, known: Sequence[State]) -> tuple[list[State], Round]:
    """Return the states from base to last, the effect that explains most first, and what no rung can take.

    No rung spoils the error that the user sees: what does so wherever it is added is left out, and what has no size to
    start from on any rung.
    """
    if known[-1] is last and not any(bench.raises(before, after) for before, after in pairwise(known)):
        return list(known), []
    rungs, refused = [base], []
    waiting = [e for e in last.model.effects if e.name not in base.names]
    while waiting:
        ended = len(waiting) == 1
        here = [e for e in waiting if ended or bench.can_start(rungs[-1], e)]
        trials = [bench.trial(rungs[-1], last, here[0])] if ended else bench.added(rungs[-1], here)
        able = [t for t in trials if not spoils(bench, t)]
        if not able:
            refused += [Decision(t.effect, "raises-error", t) for t in trials]
            refused += [Decision(e, "cannot-show") for e in waiting if e not in here]
            break
        first = min(able, key=lambda t: t.state.cost)
        rungs.append(first.state)
        waiting.remove(first.effect)
    return rungs, refused


def _pairs(bench: Bench, rungs: list[State], rounds: list[Round]) -> tuple[list[State], list[Round]]:
    """Try pairs where single effects led nowhere: beside each of the best fits what promises most there.

    A base that lacks two bends to both, and hides the signature of the one under what the other bent. Pairs that the
    last round has fitted are known.
    """
    base, last = rungs[0], rungs[-1]
    known = [{*last.names, d.effect.name} for d in rounds[-1] if d.trial is not None]
    fitted = [d.trial for d in rounds[0] if d.trial is not None and d.effect.name not in last.names]
    best = rungs
    for first in sorted(fitted, key=lambda t: float(t.state.train.sum()))[:PAIRS]:
        for other, found in bench.screen(first.state)[:1]:
            if {*first.state.names, other.name} in known:
                continue
            way = _both(bench, base, first, other, found)
            if way is not None and gain(best[-1].costs, way[-1].costs).certain:
                best = way
    if best is rungs:
        return rungs, rounds
    return _forward(bench, best, rounds[:1])


def _both(bench: Bench, base: State, first: Trial, other: Effect, found: Sequence[Signature]) -> list[State] | None:
    """Return the way over both effects, where each is supported beside the other.

    Where even both leave something unknown each must be likely, too.
    """
    (second,) = bench.added(first.state, [other], [found])
    if not supported(bench, first.state, [second]):
        return None
    (without,) = bench.without(second.state, [first.effect])
    beside = bench.trial(without, second.state, first.effect)
    if not supported(bench, without, [beside]):
        return None
    stand_in = min(likely(bench, Place(t, ())) for t in (second, beside)) < NAMED
    if stand_in and too_much(*remains(bench, second.state)):
        return None
    return [base, first.state, second.state]
