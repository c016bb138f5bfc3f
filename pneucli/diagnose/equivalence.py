"""Of effects that explain the data alike: which one to name, and which are told beside it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pneucli.diagnose.data import Bench, State, Trial
from pneucli.diagnose.evidence import from_null, gain
from pneucli.diagnose.hypothesis_tests import ALPHA, NOISE, material
from pneucli.diagnose.smooth_term import Channel, Law
from pneucli.identify.estimation.fit import Fit
from pneucli.physics.declaration import Effect

ONE_PARAMETER = 3.84  # chi-square of one degree of freedom, exceeded by chance once in 20
SLIGHTLY = 0.05  # of the cost, and of what an effect takes of it


def foremost(bench: Bench, trials: Sequence[Trial]) -> Trial:
    """Return the trial that leaves least, or the simplest of those that leave as little.

    Of equals a sensor's fault comes last: sensors are calibrated, rigs are not. Bounds of a force hold as well as the
    law of it, and say little of how the piston moves: that must replay as well.
    """
    best = min(trials, key=lambda t: t.state.cost)
    alike = [t for t in trials if as_good(t.state, best.state) or simpler(t, best)]
    alike.sort(key=lambda t: (len(t.effect.parameters), _of_sensor(t), t.state.cost))
    return next(t for t in alike if not any(_bounds_stray(bench, t, other) for other in alike))


def _bounds_stray(bench: Bench, trial: Trial, other: Trial) -> bool:
    """Whether a trial states bounds of a force and replays far worse than another does."""
    return trial.effect.bounds and bench.strays(other.state, trial.state)


def _of_sensor(trial: Trial) -> bool:
    return trial.effect.part == "sensor"


def as_good(state: State, best: State) -> bool:
    """Whether the data cannot tell that ``state`` explains them less well than ``best``.

    It costs no more for certain or, in units of the variance that is left, no more than one parameter takes up by
    chance: twins differ by the last digits of their fits, which is certain in every block.
    """
    more = state.cost - best.cost
    within_chance = more < ONE_PARAMETER * max(best.cost / max(best.samples, 1), 1.0)
    return within_chance or not gain(state.costs, best.costs).certain


def simpler(trial: Trial, best: Trial) -> bool:
    """Whether a trial has fewer parameters and leaves no more than does not matter.

    However certain: one parameter more takes up what the true law leaves of the rig's imperfections.
    """
    more = trial.state.cost - best.state.cost
    matters = min(material(best.state.cost, best.state.samples), SLIGHTLY * (trial.before.cost - trial.state.cost))
    return len(trial.effect.parameters) < len(best.effect.parameters) and more < matters


def equal(rival: Trial, best: State) -> bool:
    """Whether the data cannot tell an effect's rival from it, where noise alone is left.

    It is as good, or costs so little more that what is known of the noise and of the state at each restart does not
    decide.
    """
    more, gained = rival.state.cost - best.cost, rival.before.cost - rival.state.cost
    return as_good(rival.state, best) or more < SLIGHTLY * min(best.cost, gained + more)


LEAST = 0.005  # of what there was: what is left beyond noise is not known better
INDEPENDENT = 10  # readings, as which what is unknown besides counts (docs/diagnosis.md)
BY_CHANCE = math.exp(ONE_PARAMETER / INDEPENDENT)  # the ratio of what two leave that is no more than chance


def _no_less(left: float, mine: float) -> bool:
    """Whether what one leaves is no more than what another does, and what it takes no less, but for chance."""
    return left < BY_CHANCE * mine and BY_CHANCE * (1.0 - left) > 1.0 - mine


@dataclass(frozen=True)
class Place:
    """One effect of the last model: ``named``, the step to it from the model without, and what passed all tests there
    in its place.
    """

    named: Trial
    rivals: tuple[Trial, ...]

    def alike(self, bench: Bench, *, complete: bool) -> list[Trial]:
        """Return the rivals that the data cannot tell from the named effect.

        Where it is not ``complete``, what is left is no noise that would average out, but a few independent readings of
        something unknown: of two that leave about as much of what the named one acts in, and take about as much, the
        one may be ahead by chance. What explains more of something else is no rival there.
        """
        if complete:
            return [t for t in self.rivals if equal(t, self.named.state)]
        mine = self.left(bench)
        return [t for t in self.rivals if _no_less(self.left(bench, t), mine)]

    def read_alone(self, bench: Bench) -> bool:
        """Whether readings show such an effect alone, and show anything of it: a direct reading beats an inference."""
        return bool(self._left(bench.alone, self.named.state))

    def left(self, bench: Bench, trial: Trial | None = None) -> float:
        """Return the part of the squares beyond noise that a trial leaves there, the named one if none is given.

        Of readings that show such an effect alone, where there are such (:meth:`read_alone`). Else of what the named
        effect acts in. Of the fitted recordings or of those held out, of which it leaves more: a stand-in takes up the
        ones and not the others.
        """
        after = (trial or self.named).state
        left = self._left(bench.alone, after) or self._left(bench.parts, after)
        return min(max([LEAST, *left]), 1.0 / LEAST) if left else 1.0

    def _left(self, parts: Callable[[State, Effect], Sequence[tuple[float, float]]], after: State) -> list[float]:
        """Return what a state leaves of each part in which more than noise was."""
        pairs = zip(parts(self.named.before, self.named.effect), parts(after, self.named.effect), strict=True)
        return [(end - n) / (start - n) for (start, n), (end, _) in pairs if start > NOISE * n]


Array = NDArray[np.float64]


def outdone(bench: Bench, place: Place) -> Law | None:
    """Return a law of one signal that stands better in the place of an effect; None where none surely does.

    In the channel of which the effect takes most the law leaves less, as surely as if it were one effect more and by as
    much as matters, and beside it next to nothing is left for the effect. A law of which the effect is a part says
    nothing against it: a sensor with a curved characteristic has a scale, too.
    """
    channel = _most(bench, place)
    return None if channel is None else _Contest(channel, place).won()


@dataclass(frozen=True)
class _Contest:
    """An effect in its place against laws, in one channel."""

    channel: Channel
    place: Place

    def won(self) -> Law | None:
        """Return the law that wins: it explains what the model without the effect leaves, and better than this does."""
        ranked = self.channel.ranked(self._before)
        laws = [*ranked, *(self.channel.courses(self._before, ranked[0]) if ranked else ())]
        there, named = float(self.channel.costs(self._before).sum()), float(self._named.sum())
        able = [law for law in laws if there * (1.0 - law.share) < named]
        return next((law for law in able if not self._has_it(law) and self._better(law, len(laws))), None)

    def _has_it(self, law: Law) -> bool:
        """Whether the effect, to first order, is a part of what a law may be; not known of one that has no null.

        Beside the derivatives of the model without it: friction that grows with the pressure is so many times the dry
        friction, whose own derivative has the effect in it where that is in the model.
        """
        away = from_null(self._after, self.place.named.effect)
        return away is not None and self.channel.lacks(self._before, law, self._after.jacobian @ away) < SLIGHTLY

    def _better(self, law: Law, tried: int) -> bool:
        left, named = self.channel.unseen(self._before, law), float(self._named.sum())
        better = gain(self._named, left)
        sure = better.certain and better.p_value * tried < ALPHA
        if not (sure and better.total > material(named, self.channel.readings(self._after))):
            return False
        beside = float((left - self.channel.unseen(self._after, law)).sum())
        return beside < SLIGHTLY * (self.channel.settled(self._before) - named)

    @property
    def _before(self) -> Fit:
        return self.place.named.before.fit

    @property
    def _after(self) -> Fit:
        return self.place.named.state.fit

    @cached_property
    def _named(self) -> Array:
        return self.channel.costs(self._after)


def _most(bench: Bench, place: Place) -> Channel | None:
    """Return the channel of which an effect takes most; None where it takes nothing of any."""
    before, after, effect = place.named.before.fit, place.named.state.fit, place.named.effect
    where = dict.fromkeys((type(v), name) for v in bench.train if v.feels(effect) for name in v.channels)
    channels = [bench.channel(after, *each) for each in where]
    taken = [float((c.costs(before) - c.costs(after)).sum()) for c in channels]
    return channels[int(np.argmax(taken))] if taken and max(taken) > 0.0 else None
