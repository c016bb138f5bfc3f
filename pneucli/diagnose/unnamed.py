"""A law of one signal in the place of an effect: a rival that needs no name.

Some effect of the catalogue resembles most unknown ones and takes up so much of them that what is left may pass for
noise. So each is held against functions of one signal (:mod:`pneucli.diagnose.laws`): where one explains more of
recordings that it has not seen than the effect does of those to which it was fitted, the effect but stands in for it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
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
from pneucli.physics.declaration import Effect

Array = NDArray[np.float64]


def outdone(bench: Bench, place: Place) -> Law | None:
    """Return a law of one signal that stands better in the place of an effect; None where none surely does.

    In the channel of which the effect takes most the law leaves less, as surely as if it were one effect more and by as
    much as matters, and beside it next to nothing is left for the effect. A law of which the effect is a part says
    nothing against it: a sensor with a curved characteristic has a scale, too.
    """
    channel = _most(bench, place)
    return None if channel is None else _Contest(channel, place).won()


def absent(found: Fit, effect: Effect) -> Fit | None:
    """Return what a fit is to first order where an effect is absent, without its parameters; None without a null."""
    away = from_null(found, effect)
    if away is None:
        return None
    others = [not f.name.startswith(f"{effect.name}.") for f in found.free]
    residual = np.where(found.residual == 0.0, 0.0, found.residual - found.jacobian @ away)
    return replace(found, residual=residual, jacobian=found.jacobian[:, others])


@dataclass(frozen=True)
class _Contest:
    """An effect in its place against laws, in one channel."""

    channel: Channel
    place: Place

    def won(self) -> Law | None:
        """Return the law that wins, from the model without the effect or, to first order, from the one with it."""
        found = (law for fit in (self._before, self._gone) if fit is not None for law in self._rivals(fit))
        return next(found, None)

    def _rivals(self, fit: Fit) -> Iterator[Law]:
        """Yield the laws that explain what a fit without the effect leaves, and better than the effect does."""
        ranked = self.channel.ranked(fit)
        laws = [*ranked, *(self.channel.courses(fit, ranked[0]) if ranked else ())]
        there, named = float(self.channel.costs(fit).sum()), float(self._named.sum())
        for law in laws:
            able = there * (1.0 - law.share) < named
            if able and not self._has_it(law) and self._better(fit, law, len(laws)):
                yield law

    def _has_it(self, law: Law) -> bool:
        """Whether the effect is a part of what a law may be."""
        if self._gone is None:
            return False
        change = self._gone.residual - self._after.residual
        return self.channel.lacks(self._gone, law, change) < SLIGHTLY

    def _better(self, fit: Fit, law: Law, tried: int) -> bool:
        left, named = self.channel.unseen(fit, law), float(self._named.sum())
        better = gain(self._named, left)
        sure = better.certain and better.p_value * tried < ALPHA
        if not (sure and better.total > material(named, self.channel.readings(self._after))):
            return False
        beside = float((left - self.channel.unseen(self._after, law)).sum())
        return beside < SLIGHTLY * (self.channel.settled(fit) - named)

    @property
    def _before(self) -> Fit:
        return self.place.named.before.fit

    @property
    def _after(self) -> Fit:
        return self.place.named.state.fit

    @cached_property
    def _gone(self) -> Fit | None:
        return absent(self._after, self.place.named.effect)

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
