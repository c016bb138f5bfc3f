"""Which set of effects: forward, backward, swaps, and pairs where no single effect opens the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.diagnose.evidence import gain, holm
from pneucli.diagnose.remainder import Remainder, remainders, too_much
from pneucli.diagnose.trial import Array, Bench, State, Trial
from pneucli.identify.least_squares import inverse
from pneucli.identify.parameters import null_value
from pneucli.physics.declaration import Effect

MOST_EFFECTS = 4
REFITS = 6  # of the effects that the screen ranks highest
PAIRS = 3
WORTH = 12.0  # the fall of the cost that a signature must promise: a chi-square that chance gives once in 2000
HOPELESS = 0.01  # of what the best signature promises
ALPHA = 0.02  # of naming any effect where none is, before it is held out
SURE = 1e-4  # the same for what shows so rarely that the data held out cannot be certain
FEW = 5.0  # blocks in which it shows there
MATERIAL = 0.004  # of the cost: less does not change what the user sees
SECOND = 0.02  # the same once effects were found and what is left is noise: their own form errs by as much
RESOLUTION = 0.5  # of a sampling period: a time shorter than this may be the clock's, or the model's own step
NOISE = 1.05  # times as much as sensors' noise alone would leave
CLOSE = 1.05  # times the least cost: such trials are fitted to the end before they are compared
SWAPS = 3


@dataclass(frozen=True)
class Search:
    """The way taken: ``rungs`` from the model as it is to the last, each with one effect more.

    ``rounds`` holds what was tried from each rung; ``rivals`` for every effect named what was tried in its place.
    """

    rungs: tuple[State, ...]
    rounds: tuple[tuple[Trial, ...], ...]
    rivals: dict[str, tuple[Trial, ...]]
    train: tuple[Remainder, ...]
    test: tuple[Remainder, ...]

    @property
    def last(self) -> State:
        """The model with all that was found."""
        return self.rungs[-1]

    @property
    def added(self) -> list[str]:
        """The effects found, in the order to add them."""
        return self.last.names[len(self.rungs[0].names) :]

    @property
    def adequate(self) -> bool:
        """Whether nothing is left over beyond noise."""
        return not too_much(self.train, self.test)


def search(bench: Bench, base: State) -> Search:
    """Find the effects that explain what ``base`` leaves over."""
    rungs, rounds = _forward(bench, [base], [])
    judged = rungs[-1]
    left = remains(bench, judged)
    if too_much(*left):
        whole = _explaining_all(bench, rungs[-1], rounds[-1]) if len(rounds) == len(rungs) else None
        if whole is not None:
            rungs = [*rungs, whole.state]
        elif len(rungs) <= 2:
            rungs, rounds = _pairs(bench, rungs, rounds)
    rungs, rivals = _revise(bench, rungs, rounds)
    if rungs[-1] is not judged:
        left = remains(bench, rungs[-1])
    return Search(tuple(rungs), tuple(map(tuple, rounds)), rivals, tuple(left[0]), tuple(left[1]))


def remains(bench: Bench, state: State) -> tuple[list[Remainder], list[Remainder]]:
    """Return what a state leaves over in the fitted and in the held-out views."""
    return remainders(state.model, bench.train), remainders(state.model, bench.held_out)


def _forward(bench: Bench, rungs: list[State], rounds: list[list[Trial]]) -> tuple[list[State], list[list[Trial]]]:
    while len(rungs) <= MOST_EFFECTS:
        trials = tried(bench, rungs[-1])
        rounds.append(trials)
        leader = leading(bench, rungs[-1], trials)
        if leader is None:
            break
        rungs.append(leader.state)
    return rungs, rounds


def _explaining_all(bench: Bench, before: State, trials: Sequence[Trial]) -> Trial | None:
    """Return the best trial that leaves nothing over, where something is left for certain.

    That there is something needs no proof then, only what it is: the chance is not adjusted for the family, but both
    the fitted and the held-out cost must fall for certain.
    """
    able = supported(bench, before, [t for t in trials if t.train.certain and t.test.certain], hypotheses=1)
    able = sorted(bench.no_worse(before, able), key=lambda t: t.state.cost)
    return able[0] if able and not too_much(*remains(bench, able[0].state)) else None


def tried(bench: Bench, state: State, without: Sequence[str] = ()) -> list[Trial]:
    """Refit with the effects that the screen ranks highest, likeliest first."""
    screened = [(e, s) for e, s in bench.screen(state) if e.name not in without]
    least = max(WORTH, HOPELESS * screened[0][1][0].gain) if screened else WORTH
    likely = [(e, s) for e, s in screened if s[0].gain > least][:REFITS]
    trials = [bench.added(state, effect, found) for effect, found in likely]
    least = min((t.state.cost for t in trials), default=0.0)
    promising = [t.state.cost < CLOSE * least and t.train.total > MATERIAL * float(state.train.sum()) for t in trials]
    ended = [bench.polished(state, t) if more else t for t, more in zip(trials, promising, strict=True)]
    return sorted(ended, key=lambda t: t.state.cost)


def supported(bench: Bench, before: State, trials: Sequence[Trial], hypotheses: int | None = None) -> list[Trial]:
    """Return the trials that are significant in the family of all, hold on data not seen, and matter."""
    adjusted = holm([t.p_value for t in trials], max(hypotheses or bench.hypotheses, len(trials)))
    return [
        t
        for t, p in zip(trials, adjusted, strict=True)
        if p < ALPHA
        and t.train.total > _material(bench, before) * float(before.train.sum())
        and (t.test.certain or not bench.held_out or _rarely_shown(t, p))
        and not _too_short(bench, t)
        and not _out_of_bounds(t)
    ]


def _rarely_shown(trial: Trial, p_value: float) -> bool:
    """Whether the data held out show the effect too rarely to be certain, do not contradict it, and the fitted are.

    Such as a break-away after a long rest: one or two blocks decide, and a bootstrap may draw neither.
    """
    return trial.test.number < FEW and trial.test.total > 0.0 and trial.train.certain and p_value < SURE


def _out_of_bounds(trial: Trial) -> bool:
    """Whether a parameter stands at the bound of what is plausible, other than its null."""
    model = trial.state.model
    nulls = {
        f"{trial.effect.name}.{p.name}": null_value(p, model) for p in trial.effect.parameters if p.null is not None
    }
    return any(e.at_bound and e.name in nulls and e.value != nulls[e.name] for e in trial.state.fit.estimates)


def _material(bench: Bench, before: State) -> float:
    at_noise = before.cost < NOISE * before.samples
    return SECOND if at_noise and set(before.names) - set(bench.given) else MATERIAL


def _too_short(bench: Bench, trial: Trial) -> bool:
    """Whether the effect is but a time that the sampling cannot tell from none."""
    period = max(view.experiment.recording.period for view in bench.train)
    times = [
        trial.state.model.values[f"{trial.effect.name}.{p.name}"]
        for p in trial.effect.parameters
        if p.unit == "s" and p.null == 0.0
    ]
    return len(times) == len(trial.effect.parameters) and all(abs(t) < RESOLUTION * period for t in times)


def leading(bench: Bench, before: State, trials: Sequence[Trial]) -> Trial | None:
    """Return the supported trial that leaves least, the simplest of those that leave as little."""
    able = bench.no_worse(before, supported(bench, before, trials))
    if not able:
        return None
    best = min(able, key=lambda t: t.state.cost)
    equal = [t for t in able if as_good(t.state, best.state)]
    # the simpler one, and a sensor's fault last: sensors are calibrated, rigs are not
    return min(equal, key=lambda t: (len(t.effect.parameters), t.effect.part == "sensor", t.state.cost))


def as_good(state: State, best: State) -> bool:
    """Whether the data cannot tell that ``state`` explains them less well than ``best``."""
    return not gain(state.costs, best.costs).certain


def _revise(
    bench: Bench, rungs: list[State], rounds: list[list[Trial]]
) -> tuple[list[State], dict[str, tuple[Trial, ...]]]:
    """Drop what later additions made needless, put better rivals in place of effects, and keep the equals."""
    base, last = rungs[0], _without_needless(bench, rungs[0], rungs[-1])
    for swaps in range(SWAPS + 1):
        rivals: dict[str, tuple[Trial, ...]] = {}
        better: list[Trial] = []
        names = last.names[len(base.names) :]
        for name in names:
            before = base if len(names) == 1 else bench.without(last, bench.effects[name])
            trials = rounds[0] if len(names) == 1 and swaps == 0 else tried(bench, before, [name])
            rivals[name] = tuple(t for t in supported(bench, before, trials) if t.effect.name != name)
            better = [t for t in rivals[name] if gain(last.costs, t.state.costs).certain]
            if better:
                break
        if not better or swaps == SWAPS:
            break
        last = min(better, key=lambda t: t.state.cost).state
    return _ladder(bench, base, last, rungs), rivals


def _without_needless(bench: Bench, base: State, last: State) -> State:
    """Return the state without effects that are not supported beside the others, the least missed first.

    What the data would certainly and noticeably miss stays: it may not be supported alone, and yet carry the others.
    """
    while len(names := last.names[len(base.names) :]) > 1:
        states = {name: bench.without(last, bench.effects[name]) for name in names}
        needless = [
            before
            for name, before in states.items()
            if not supported(bench, before, [bench.trial(before, last, bench.effects[name])])
            and not _missed(bench, before, last)
        ]
        if not needless:
            break
        last = min(needless, key=lambda state: state.cost)
    return last


def _missed(bench: Bench, before: State, last: State) -> bool:
    missed = gain(before.costs, last.costs)
    return missed.certain and missed.total > _material(bench, before) * before.cost


def _ladder(bench: Bench, base: State, last: State, known: Sequence[State]) -> list[State]:
    """Return the states from base to last, the effect that explains most first."""
    if [s.names for s in known] and known[-1] is last:
        return list(known)
    rungs, waiting = [base], [e for e in last.model.effects if e.name not in base.names]
    while len(waiting) > 1:
        trials = [bench.added(rungs[-1], effect) for effect in waiting]
        first = min(trials, key=lambda t: t.state.cost)
        rungs.append(first.state)
        waiting = [e for e in waiting if e.name != first.effect.name]
    return [*rungs, last] if waiting else rungs


def _pairs(bench: Bench, rungs: list[State], rounds: list[list[Trial]]) -> tuple[list[State], list[list[Trial]]]:
    """Try the pairs that promise most together, where single effects led nowhere."""
    base = rungs[0]
    ranked = bench.screen(base)[:8]
    new = [base.fit.beyond(found[0].change) for _, found in ranked]
    promised = sorted(
        ((_joint(base.fit.unexplained, new[i], new[j]), i, j) for i in range(len(new)) for j in range(i)), reverse=True
    )
    best = rungs
    for _, i, j in promised[:PAIRS]:
        way = _both(bench, base, ranked[i][0], ranked[j][0])
        if way is not None and gain(best[-1].costs, way[-1].costs).certain:
            best = way
    if best is rungs:
        return rungs, rounds
    return _forward(bench, best, rounds[:1])


def _joint(target: Array, a: Array, b: Array) -> float:
    """Return the fall of the cost that two signatures promise together, all three without what the base can do."""
    both = np.column_stack([a, b])
    score = both.T @ target
    return float(score @ inverse(both.T @ both) @ score)


def _both(bench: Bench, base: State, a: Effect, b: Effect) -> list[State] | None:
    """Return the way over both effects, the better one first, where each is supported beside the other."""
    first = min((bench.added(base, e) for e in (a, b)), key=lambda t: t.state.cost)
    other = b if first.effect is a else a
    second = bench.added(first.state, other)
    if not supported(bench, first.state, [second]):
        return None
    without = bench.without(second.state, first.effect)
    if not supported(bench, without, [bench.trial(without, second.state, first.effect)]):
        return None
    return [base, first.state, second.state]
