"""One effect put to the test: screened by its signature, refitted with the whole model, held out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pneucli.diagnose.evidence import Gain, block_costs, gain, wald
from pneucli.diagnose.remainder import drawn_rms
from pneucli.experiments import Part
from pneucli.identify.effects import Signature, fit_added, fit_without, refit, signatures
from pneucli.identify.fit import Fit, Problem, block_numbers
from pneucli.identify.views import View
from pneucli.physics.declaration import Effect
from pneucli.simulate.model import Model

Array = NDArray[np.float64]


ROUNDS = 5  # of a first fit, which only ranks
KNOWN = 0.8  # of the noise's power, at least
RISE = 1.05  # of an error that rests on few stick-slips, whose start noise shifts
Screened = tuple[Effect, list[Signature]]


@dataclass(frozen=True)
class Bench:
    """The data of a diagnosis: views to fit, views held out, and the effects that may be missing.

    ``covered`` are parts whose effects the model's valve shows already; ``given`` names the effects that the model had
    before; ``errors`` is the error that the user sees, of a model, by
    use: an effect that raises it is not added; ``shown`` is the same over each model's own noise.
    """

    train: Sequence[View]
    held_out: Sequence[View]
    effects: Mapping[str, Effect]
    covered: frozenset[Part] = frozenset()
    given: tuple[str, ...] = ()
    progress: Callable[[str], None] = field(default=lambda _: None)
    errors: Callable[[Model], Mapping[str, float | None]] | None = None
    shown: Callable[[Model], Mapping[str, float | None]] | None = None

    @cached_property
    def hypotheses(self) -> int:
        """How many starts are screened in all: the size of the family of tests."""
        return sum(1 for e in self.effects.values() if self.can_show(e) for _ in e.parameters)

    def can_show(self, effect: Effect) -> bool:
        """Whether the effect acts in any view that is fitted."""
        return effect.part not in self.covered and any(view.feels(effect) for view in self.train)

    def state(self, found: Fit) -> State:
        """Return a fit with its costs."""
        train = costs(found.model, self.train, found.residual, found.errors)
        if not self.held_out:
            return State(found, train, np.zeros(0), np.zeros(0))
        problem = Problem(found.model, self.held_out, ())
        test = np.concatenate(problem.data(found.model))
        return State(found, train, test, costs(found.model, self.held_out, test, problem.errors))

    def screen(self, state: State) -> list[Screened]:
        """Return the effects that the state lacks with their signatures, by what the best one promises."""
        lacking = [e for e in self.effects.values() if self.can_show(e) and e.name not in state.names]
        ranked = [(e, found) for e, found in self.screened(state, lacking) if found[0].gain > 0.0]
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

    def added(self, state: State, effect: Effect, ranked: Sequence[Signature] | None = None) -> Trial:
        """Refit with the effect and hold it against the data that the fit has not seen."""
        self.progress(f"fitting {effect.name}")
        found = fit_added(state.fit, self.train, effect, rounds=ROUNDS, ranked=ranked)
        return self.trial(state, self.state(found), effect)

    def polished(self, before: State, trial: Trial) -> Trial:
        """Fit a trial to the end."""
        found = refit(trial.state.fit, self.train)
        return self.trial(before, self.state(found), trial.effect)

    def without(self, state: State, effect: Effect) -> State:
        """Refit without one of the effects."""
        return self.state(fit_without(state.fit, self.train, effect))

    def no_worse(self, before: State, trials: Sequence[Trial]) -> list[Trial]:
        """Return the trials whose simulation, which the user sees, does not err more than that of ``before``.

        In the mean of fitted and held-out recordings.
        """
        if self.errors is None or not trials:
            return list(trials)
        old = self.errors(before.model)

        def raised(new: Mapping[str, float | None]) -> bool:
            ratios = [b / a for a, b in zip(old.values(), new.values(), strict=True) if a and b is not None]
            return bool(ratios) and float(np.prod(ratios)) > RISE ** len(ratios)

        return [t for t in trials if not raised(self.errors(t.state.model))]

    def falls(self, before: State, after: State) -> bool:
        """Whether the error over its own model's noise, which the ladder shows, falls in the mean of both uses."""
        if self.shown is None:
            return True
        old, new = self.shown(before.model), self.shown(after.model)
        ratios = [b / a for a, b in zip(old.values(), new.values(), strict=True) if a and b is not None]
        return float(np.prod(ratios)) < 1.0

    def trial(self, before: State, after: State, effect: Effect) -> Trial:
        """Return what the step from one state to the other is worth."""
        train = gain(before.train, after.train)
        p_value = wald(after.fit, effect)
        return Trial(
            effect, after, train, gain(before.test, after.test), train.p_value if np.isnan(p_value) else p_value
        )


def costs(model: Model, views: Sequence[View], residual: Array, errors: Sequence[Mapping[str, Array]]) -> Array:
    """Return the cost by block of residuals (N,): their squares, and the volume of what the starts may err by."""
    blocks = block_numbers(views)
    volume = np.concatenate([view.volume(mine) for view, mine in zip(views, errors, strict=True)])
    return block_costs(allowed(model, views, residual), blocks) + np.bincount(blocks, weights=volume)


def allowed(model: Model, views: Sequence[View], residual: Array) -> Array:
    """Return residuals (N,) scaled, channel by channel, for what a correct model of this kind would show of noise.

    A model that undoes a lag amplifies noise, one that smooths over it (a lag in the balance of forces, a delay by half
    a sample) shows less; without the allowance a wrong one could leave less. The noise is no more than what is left; a
    channel is made smaller than the sensors' noise only so far as that is not known better.
    """
    parts, first = [], 0
    for view in views:
        drawn = drawn_rms(model, view, view.carried(model))
        for channel in view.channels:
            part = residual[first : first + view.experiment.time.size]
            first += part.size
            cost, noise = float(part @ part), float(np.count_nonzero(part))
            more = max(drawn[channel] ** 2, KNOWN)
            fair = max(cost - (more - 1.0) * min(noise, cost / more), KNOWN * min(cost, noise))
            parts.append(part * np.sqrt(fair / cost) if cost > 0.0 else part)
    return np.concatenate(parts)


@dataclass(frozen=True)
class State:
    """A fitted model and what it leaves over: costs by block of the training and of the held-out views."""

    fit: Fit
    train: Array
    test_residual: Array
    test: Array

    @property
    def model(self) -> Model:
        """The fitted model."""
        return self.fit.model

    @property
    def names(self) -> list[str]:
        """The effects that the model has."""
        return [e.name for e in self.fit.model.effects]

    @property
    def samples(self) -> int:
        """How many residuals there are, trained and held out, zeros of what does not count left out."""
        return int(np.count_nonzero(self.fit.residual) + np.count_nonzero(self.test_residual))

    @property
    def costs(self) -> Array:
        """All blocks' costs, trained and held out."""
        return np.concatenate([self.train, self.test])

    @property
    def cost(self) -> float:
        """Their sum."""
        return float(self.costs.sum())


@dataclass(frozen=True)
class Trial:
    """An effect added to a state: gains on trained and held-out data; ``p_value`` of its parameters, not adjusted."""

    effect: Effect
    state: State
    train: Gain
    test: Gain
    p_value: float
