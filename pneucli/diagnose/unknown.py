"""What is known of a remainder that no effect of the catalogue accounts for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pneucli.diagnose.laws import Law
from pneucli.diagnose.periods import Period, period
from pneucli.diagnose.place import BY_CHANCE
from pneucli.diagnose.remainder import Remainder
from pneucli.diagnose.trial import Bench
from pneucli.identify.fit import Fit
from pneucli.quantities import titled
from pneucli.words.numbers import percent

TELLING = 0.05  # share that a law of a signal must explain to be spoken of
REPLAYED = "something that shows only where all is simulated together (by itself each subsystem fits)"
SHAPELESS = "something without a shape over any signal"


@dataclass(frozen=True)
class Unknown:
    """Where the unexplained stands, how many times its noise, and of what it is a function, in words.

    ``share`` is the part of the squares that a function of the ``variable`` explains of recordings that were left out;
    of a sine (``law``) it may be a part of the fitted ones. Functions of those in ``alike`` explain about as much, and
    each of the ways to act over the ``variable`` that ``character`` tells.
    ``course`` is the function itself, ``law`` the name of a simple one that comes near it.
    """

    subsystem: str
    channel: str
    ratio: float
    variable: str | None
    character: str
    law: str | None = None
    share: float | None = None
    alike: tuple[str, ...] = ()
    course: Law | None = None


def describe(bench: Bench, fit: Fit, worst: Remainder) -> Unknown:
    """Describe a remainder of a fit, such as the worst."""
    where = worst.kind.title, worst.channel, worst.ratio
    same = [v for v in bench.train if type(v) is worst.kind and worst.channel in v.channels]
    if not same:
        return Unknown(*where, None, REPLAYED)
    channel = bench.channel(fit, worst.kind, worst.channel)
    ranked = channel.ranked(fit)
    repeats = period(fit.model, same, worst.channel)
    best = ranked[0] if ranked and ranked[0].share > TELLING else None
    if repeats is not None and (best is None or repeats.variable == best.signal or repeats.share > best.share):
        course = best if best is not None and best.signal == repeats.variable else None
        share = repeats.share if course is None else max(course.share, repeats.share)
        return Unknown(*where, repeats.variable, _repeating(repeats, course), "a sine", share, (), course)
    if best is None:
        return Unknown(*where, None, SHAPELESS)
    if BY_CHANCE * (1.0 - best.share) > 1.0:
        character = f"mostly without a shape; {percent(best.share)} of it is {_course(best)}"
        return Unknown(*where, best.signal, character, channel.simple(fit, best), best.share, (), best)
    close = [law for law in ranked if 1.0 - law.share < BY_CHANCE * (1.0 - best.share)]
    ways = [law.way for law in close if law.signal == best.signal]
    also = tuple(name for name in dict.fromkeys(law.signal for law in close) if name != best.signal)
    return Unknown(*where, best.signal, _course(best, ways), channel.simple(fit, best), best.share, also, best)


def _repeating(repeats: Period, course: Law | None) -> str:
    unit, what = "s" if repeats.variable == "time" else "m", "something" if course is None else _a(course.way)
    return f"{what} that repeats over {titled(repeats.variable)}, period {repeats.length:.3g} {unit}"


def _course(law: Law, ways: Sequence[str] = ()) -> str:
    """Return a law in words, as whichever of some ways it may act: those that explain about as much."""
    acts = " or ".join(_a(way) for way in dict.fromkeys([law.way, *ways]))
    if law.signal == "time":
        return f"{acts} that drifts over each recording"
    return f"{acts}, a function of {titled(law.signal)}"


def _a(way: str) -> str:
    return f"an {way}" if way[0] in "aeio" else f"a {way}"
