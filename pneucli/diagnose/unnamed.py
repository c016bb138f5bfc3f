"""A law of one signal in the place of an effect: a rival that needs no name.

Some effect of the catalogue resembles most unknown ones and takes up so much of them that what is left may pass for
noise. So each is held against functions of one signal (:mod:`pneucli.diagnose.laws`): where one explains more of
recordings that it has not seen than the effect does of those to which it was fitted, the effect but stands in for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pneucli.diagnose.equals import SLIGHTLY
from pneucli.diagnose.evidence import from_null, gain
from pneucli.diagnose.judge import ALPHA, material
from pneucli.diagnose.laws import Channel, Law
from pneucli.diagnose.place import Place
from pneucli.diagnose.trial import Bench
from pneucli.identify.fit import Fit

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
