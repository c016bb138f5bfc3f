"""Refits that need nothing of each other: one after another here, or elsewhere at once, with the same results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import zip_longest
from typing import Literal
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from pneucli.diagnose.adequacy import Remainder, held_out_remainders, remainders
from pneucli.diagnose.cross_validation import models_by_turn
from pneucli.diagnose.evidence import Gain, gain, wald
from pneucli.diagnose.free_run_adequacy import ASTRAY
from pneucli.diagnose.score import fitted_costs, unseen_costs
from pneucli.diagnose.smooth_term import Channel
from pneucli.experiments import Part
from pneucli.identify.estimation.blocks import block_numbers
from pneucli.identify.estimation.fit import Effort, Fit
from pneucli.identify.estimation.model_fit import Signature, fit_added, fit_without, refit, signatures, starts
from pneucli.identify.residuals import View
from pneucli.physics.declaration import Effect
from pneucli.simulate.model import Model
from pneucli.simulate.rig_quantities import facts_of


@dataclass(frozen=True)
class Refit:
    """A fit from ``state``: with ``effect`` more (from signatures ``ranked``, where known), without, or to the end."""

    kind: Literal["with", "without", "to the end"]
    state: State
    effect: Effect
    ranked: tuple[Signature, ...] | None = None


Refits = Callable[["Bench", Sequence[Refit]], "list[State]"]


def here(bench: Bench, refits: Sequence[Refit]) -> list[State]:
    """Return the states that refits end in, done one after another."""
    return [bench.fitted(one) for one in refits]


Array = NDArray[np.float64]


RANKING = Effort(12, 5e-3)  # of a first fit, which only ranks: about what is MATERIAL
RISE = 1.05  # of an error that rests on few stick-slips, whose start noise shifts; a fall by as much is chance too
READING = frozenset({"pressure sensor"})  # faults of it cannot show where no pressure is recorded
Screened = tuple[Effect, list[Signature]]
Errors = Mapping[str, float | None]
Remainders = tuple[list[Remainder], list[Remainder]]


@dataclass(frozen=True)
class Bench:
    """The data of a diagnosis: views to fit, views held out, and the effects that may be missing.

    Where none is held out, ``turns`` has for each fitted view the turn in which it is (:mod:`pneucli.diagnose.cross_validation`).
    ``covered`` are parts whose effects the model's valve shows already; ``given`` names the effects that the model had
    before; ``shown`` is the error that the user sees, by use. ``implausible``: a check of the recordings failed.
    ``refits`` does several that need nothing of each other.
    """

    train: Sequence[View]
    held_out: Sequence[View]
    effects: Mapping[str, Effect]
    covered: frozenset[Part] = frozenset()
    given: tuple[str, ...] = ()
    progress: Callable[[str], None] = field(default=lambda _: None)
    turns: tuple[int, ...] = ()
    shown: Callable[[Model], Errors] | None = None
    implausible: bool = False
    refits: Refits = here

    @property
    def checked(self) -> bool:
        """Whether there are data that a fit has not seen."""
        return bool(self.held_out or self.turns)

    @cached_property
    def hypotheses(self) -> int:
        """How many starts are screened in all: the size of the family of tests."""
        return sum(1 for e in self.effects.values() if self.can_show(e) for _ in e.parameters)

    def can_show(self, effect: Effect) -> bool:
        """Whether the effect acts in any view that is fitted."""
        if effect.part in self.covered or not any(view.feels(effect) for view in self.train):
            return False
        return effect.sides != READING or any({"p1", "p2"} & view.experiment.raw.keys() for view in self.train)

    def felt(self, state: State, effect: Effect) -> tuple[float, int]:
        """Return the fitted cost of what the effect acts in, and how many residuals are behind it.

        What it cannot act in says nothing of it, however much is left there.
        """
        felt = self.acts_in(effect)[: state.train.size]
        return float(state.train[felt].sum()), int(state.counts[: state.train.size][felt].sum())

    def parts(self, state: State, effect: Effect) -> list[tuple[float, float]]:
        """Return the cost of what the effect acts in and how many residuals are behind it: fitted, and held out apart.

        Held out by turns it is one part.
        """
        felt, edge = self.acts_in(effect), state.train.size
        parts = (slice(0, edge), slice(edge, state.costs.size))
        sums = [(float(state.costs[p][felt[p]].sum()), float(state.counts[p][felt[p]].sum())) for p in parts]
        return [(cost, count) for cost, count in sums if count]

    def alone(self, state: State, effect: Effect) -> list[tuple[float, float]]:
        """Return the same of the readings that show such an effect alone: nothing of nothing where there are none."""
        return [_read_alone(state.model, views, effect) for views in (self.train, self.held_out)]

    def acts_in(self, effect: Effect) -> NDArray[np.bool_]:
        """Return in which blocks of a state's costs the effect acts (B,)."""
        return np.repeat([view.feels(effect) for view in self.views], self.blocks)

    @cached_property
    def views(self) -> tuple[View, ...]:
        """The fitted views, then those held out."""
        return (*self.train, *self.held_out)

    @cached_property
    def blocks(self) -> tuple[int, ...]:
        """How many blocks of time each of these views has."""
        return tuple(int(block_numbers([view])[-1]) + 1 for view in self.views)

    def channel(self, found: Fit, kind: type[View], name: str) -> Channel:
        """Return what laws of signals make of a channel, as some fit of this bench has its flows."""
        if (kind, name) not in self._channels:
            self._channels[kind, name] = Channel(found, self.train, kind, name)
        return self._channels[kind, name]

    @cached_property
    def remaining(self) -> WeakKeyDictionary[State, Remainders]:
        """What states leave over, as far as it was asked for; a state that nobody needs any more is let go."""
        return WeakKeyDictionary()

    @cached_property
    def _channels(self) -> dict[tuple[type[View], str], Channel]:
        return {}

    def state(self, found: Fit) -> State:
        """Return a fit with its costs."""
        train, counts = fitted_costs(found, self.train)
        if not self.held_out and not self.turns:
            return State(found, train, np.zeros(0), train, counts)
        if self.turns:
            test, _ = unseen_costs(models_by_turn(found, self.train, self.turns), self.train, found.errors)
            return State(found, train, test, test, counts)
        starts = [view.carried(found.model) for view in self.held_out]
        test, more = unseen_costs([found.model] * len(starts), self.held_out, starts)
        return State(found, train, test, np.concatenate([train, test]), np.concatenate([counts, more]))

    def can_start(self, state: State, effect: Effect) -> bool:
        """Whether an effect has a typical size at a state: one that is counted in dry friction has none without."""
        model = state.model
        return bool(starts(effect, facts_of(model, [v.experiment for v in self.train]), model.rig.known))

    def lacking(self, state: State) -> list[Effect]:
        """Return the effects that a state lacks and that can show."""
        return [e for e in self.effects.values() if self.can_show(e) and e.name not in state.names]

    def screen(self, state: State) -> list[Screened]:
        """Return the effects that the state lacks with their signatures, by what the best one promises."""
        ranked = [(e, found) for e, found in self.screened(state, self.lacking(state)) if found[0].gain > 0.0]
        return sorted(ranked, key=lambda pair: -pair[1][0].gain)

    def screened(self, state: State, effects: Sequence[Effect]) -> list[Screened]:
        """Return the signatures of effects at a state, best first; those without any are left out."""
        out = []
        for i, effect in enumerate(effects):
            self.progress(f"screening {effect.name}, {len(effects) - i - 1} left")
            found = signatures(effect, state.fit, self.train)
            if found:
                out.append((effect, found))
        return out

    def fitted(self, one: Refit) -> State:
        """Do one refit."""
        if one.kind == "with":
            self.progress(f"fitting {one.effect.name}")
            return self.state(fit_added(one.state.fit, self.train, one.effect, effort=RANKING, ranked=one.ranked))
        if one.kind == "without":
            return self.state(fit_without(one.state.fit, self.train, one.effect))
        return self.state(refit(one.state.fit, self.train))

    def added(self, state: State, effects: Sequence[Effect], ranked: Sequence[Sequence[Signature]] = ()) -> list[Trial]:
        """Refit with each effect (from signatures ``ranked``), and hold it against data that the fit has not seen."""
        refits = [Refit("with", state, e, tuple(s) if s else None) for e, s in zip_longest(effects, ranked)]
        ended = self.refits(self, refits)
        return [self.trial(state, after, effect) for after, effect in zip(ended, effects, strict=True)]

    def polished(self, trials: Sequence[Trial]) -> list[Trial]:
        """Fit trials to the end."""
        ended = self.refits(self, [Refit("to the end", t.state, t.effect) for t in trials])
        return [self.trial(t.before, after, t.effect) for after, t in zip(ended, trials, strict=True)]

    def without(self, state: State, effects: Sequence[Effect]) -> list[State]:
        """Refit without each of the effects, one at a time."""
        return self.refits(self, [Refit("without", state, effect) for effect in effects])

    def raises(self, before: State, after: State) -> bool:
        """Whether the error that the user sees rises: for all uses, or in their mean by more than chance may."""
        ratios = self._ratios(before, after)
        return bool(ratios) and (min(ratios) > 1.0 or float(np.prod(ratios)) > RISE ** len(ratios))

    def falls(self, before: State, after: State) -> bool:
        """Whether the error that the user sees falls in the mean of all uses."""
        return self.shown is None or float(np.prod(self._ratios(before, after))) < 1.0

    def lowers(self, before: State, after: State) -> bool:
        """Whether it falls in that mean by more than chance may."""
        ratios = self._ratios(before, after)
        return not ratios or float(np.prod(ratios)) < RISE ** -len(ratios)

    def strays(self, before: State, after: State) -> bool:
        """Whether it rises for all uses by as much as tells a model that does not replay."""
        ratios = self._ratios(before, after)
        return bool(ratios) and min(ratios) > ASTRAY

    def _ratios(self, before: State, after: State) -> list[float]:
        """Return the error that the user sees after over that before, for each use that has one."""
        if self.shown is None:
            return []
        old, new = self.shown(before.model), self.shown(after.model)
        return [b / a for a, b in zip(old.values(), new.values(), strict=True) if a and b is not None]

    def trial(self, before: State, after: State, effect: Effect) -> Trial:
        """Return what the step from one state to the other is worth."""
        train, test = gain(before.train, after.train), gain(before.test, after.test)
        return Trial(effect, before, after, train, test, self._chance(wald(after.fit, effect), train, test))

    def _chance(self, p_value: float, train: Gain, test: Gain) -> float:
        """Return the chance of an effect, by its parameters (NaN where it has no null) or by what it gains.

        Parameters that are known only together stand within their errors of their nulls, however much they explain:
        recordings held out apart are a second test, and of two the better one counts twice (Bonferroni).
        """
        if np.isnan(p_value):
            return train.p_value
        return min(2.0 * min(p_value, test.p_value), 1.0) if self.held_out else p_value


def _read_alone(model: Model, views: Sequence[View], effect: Effect) -> tuple[float, float]:
    """Return the squares, in units of the noise, of readings that show such an effect alone, and their number."""
    left = [view.residual(model)[c] / view.noise[c] for view in views for c in view.alone(effect)]
    return float(sum(r @ r for r in left)), float(sum(np.count_nonzero(r) for r in left))


@dataclass(frozen=True, eq=False)
class State:
    """A fitted model and what it leaves over, as costs by block: ``train`` as fitted, ``test`` held out.

    ``costs`` counts each reading once, held out where it is; ``counts`` are the residuals behind each of them, zeros of
    what does not count left out.
    """

    fit: Fit
    train: Array
    test: Array
    costs: Array
    counts: Array

    @property
    def samples(self) -> int:
        """How many residuals are behind the costs: what noise alone would cost."""
        return int(self.counts.sum())

    @property
    def model(self) -> Model:
        """The fitted model."""
        return self.fit.model

    @property
    def names(self) -> list[str]:
        """The effects that the model has."""
        return [e.name for e in self.fit.model.effects]

    @property
    def cost(self) -> float:
        """The sum of all costs."""
        return float(self.costs.sum())


def remains(bench: Bench, state: State) -> Remainders:
    """Return what a state leaves over in the fitted and in the held-out views."""
    if state not in bench.remaining:
        bench.remaining[state] = remainders(state.model, bench.train), held_out_remainders(state.fit, bench.held_out)
    return bench.remaining[state]


@dataclass(frozen=True)
class Trial:
    """The step from ``before`` to ``state`` by one effect.

    With its gains on trained and held-out data, and ``p_value`` of its parameters, not adjusted.
    """

    effect: Effect
    before: State
    state: State
    train: Gain
    test: Gain
    p_value: float
