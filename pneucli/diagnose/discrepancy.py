"""What stays unexplained beside what is named: where it is, how large, how slow, and over which signal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.diagnose.adequacy import MIN_TRIMMED_RATIO, LackOfFit
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.equivalence import CHANCE_COST_RATIO
from pneucli.diagnose.periodic_term import PeriodicTerm, find_period
from pneucli.diagnose.smooth_term import SmoothTerm
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.residuals import ResidualModel
from pneucli.messages.formatting import format_percent
from pneucli.quantities import signal_title
from pneucli.simulate.model import Model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Discrepancy:
    """One channel of one subsystem: its rms over that of noise, the time in s over which it stays alike (None where
    that is not known), the signal of which it is a function (or None), and its part of all squares beyond noise.
    """

    subsystem: str
    channel: str
    size: float
    time_constant: float | None
    over: str | None
    share: float


def describe_discrepancies(bench: DiagnosisData, fit: Fit, left: Sequence[LackOfFit]) -> list[Discrepancy]:
    """Return what is more than noise of what a fit leaves over in all views, the largest part first."""
    seen = {(r.kind, r.channel): r for r in reversed(left) if r.ratio > MIN_TRIMMED_RATIO}
    residuals = {key: _residuals(fit.model, bench.views, *key) for key in seen}
    beyond = {key: sum(max(float(r @ r) - np.count_nonzero(r), 0.0) for r, _ in residuals[key]) for key in seen}
    signals = [describe_lack_of_fit(bench, fit, r).variable for r in seen.values()]
    total = max(sum(beyond.values()), 1e-9)
    found = [
        Discrepancy(r.kind.title, r.channel, r.ratio, _correlation_time(residuals[key]), over, beyond[key] / total)
        for (key, r), over in zip(seen.items(), signals, strict=True)
    ]
    return sorted(found, key=lambda d: -d.share)


def _residuals(
    model: Model, views: Sequence[ResidualModel], kind: type[ResidualModel], channel: str
) -> list[tuple[Array, float]]:
    """Return the residuals (n,) in units of noise and the sampling period (s) of each view."""
    mine = [v for v in views if type(v) is kind and channel in v.channels]
    return [(v.residual(model)[channel] / v.noise[channel], v.experiment.recording.period) for v in mine]


def _correlation_time(residuals: Sequence[tuple[Array, float]]) -> float | None:
    """Return the time in s after which the autocorrelation has fallen to 1/e of that at one sample, pooled."""
    if not residuals:
        return None
    period = min(p for _, p in residuals)
    alike = [_autocovariance(r) for r, p in residuals if p == period]
    length = min(c.size for c in alike)
    pooled = np.sum([c[:length] for c in alike], axis=0)
    if length < 3 or not pooled[1] > 0.0:
        return None
    fallen = np.flatnonzero(pooled[1:] < pooled[1] / np.e)
    return float(fallen[0] * period) if fallen.size else None


def _autocovariance(values: Array) -> Array:
    """Return the sums of products of values (n,) at lags 0 to n // 2."""
    power = np.abs(np.fft.rfft(values, 2 * values.size)) ** 2
    return np.asarray(np.fft.irfft(power)[: values.size // 2])


MIN_EXPLAINED_SHARE = 0.05  # share that a law of a signal must explain to be spoken of
FREE_RUN_ONLY_TEXT = "something that shows only where all is simulated together (by itself each subsystem fits)"
SHAPELESS_TEXT = "something without a shape over any signal"


@dataclass(frozen=True)
class UnexplainedResidual:
    """Where the unexplained stands, how many times its noise, and of what it is a function, in words.

    ``share`` is the part of the squares that a function of the ``variable`` explains of recordings that were left out;
    of a sine (``law``) it may be a part of the fitted ones. Functions of those in ``other_signals`` explain about as much, and
    each of the ways to act over the ``variable`` that ``character`` tells.
    ``smooth_term`` is the function itself, ``law`` the name of a simple one that comes near it.
    """

    subsystem: str
    channel: str
    ratio: float
    variable: str | None
    character: str
    law: str | None = None
    share: float | None = None
    other_signals: tuple[str, ...] = ()
    smooth_term: SmoothTerm | None = None


def describe_lack_of_fit(bench: DiagnosisData, fit: Fit, worst: LackOfFit) -> UnexplainedResidual:
    """Describe a remainder of a fit, such as the worst."""
    where = worst.kind.title, worst.channel, worst.ratio
    same = [v for v in bench.train if type(v) is worst.kind and worst.channel in v.channels]
    if not same:
        return UnexplainedResidual(*where, None, FREE_RUN_ONLY_TEXT)
    channel = bench.spline_regression(fit, worst.kind, worst.channel)
    ranked = channel.ranked_terms(fit)
    repeats = find_period(fit.model, same, worst.channel)
    best = ranked[0] if ranked and ranked[0].share > MIN_EXPLAINED_SHARE else None
    if repeats is not None and (best is None or repeats.variable == best.signal or repeats.share > best.share):
        course = best if best is not None and best.signal == repeats.variable else None
        share = repeats.share if course is None else max(course.share, repeats.share)
        return UnexplainedResidual(
            *where, repeats.variable, _describe_period(repeats, course), "a sine", share, (), course
        )
    if best is None:
        return UnexplainedResidual(*where, None, SHAPELESS_TEXT)
    if CHANCE_COST_RATIO * (1.0 - best.share) > 1.0:
        character = f"mostly without a shape; {format_percent(best.share)} of it is {_describe_smooth_term(best)}"
        return UnexplainedResidual(
            *where, best.signal, character, channel.simplest_shape(fit, best), best.share, (), best
        )
    close = [law for law in ranked if 1.0 - law.share < CHANCE_COST_RATIO * (1.0 - best.share)]
    ways = [law.acts_as for law in close if law.signal == best.signal]
    also = tuple(name for name in dict.fromkeys(law.signal for law in close) if name != best.signal)
    return UnexplainedResidual(
        *where,
        best.signal,
        _describe_smooth_term(best, ways),
        channel.simplest_shape(fit, best),
        best.share,
        also,
        best,
    )


def _describe_period(repeats: PeriodicTerm, course: SmoothTerm | None) -> str:
    unit, what = (
        "s" if repeats.variable == "time" else "m",
        "something" if course is None else _with_article(course.acts_as),
    )
    return f"{what} that repeats over {signal_title(repeats.variable)}, period {repeats.length:.3g} {unit}"


def _describe_smooth_term(law: SmoothTerm, ways: Sequence[str] = ()) -> str:
    """Return a law in words, as whichever of some ways it may act: those that explain about as much."""
    acts = " or ".join(_with_article(way) for way in dict.fromkeys([law.acts_as, *ways]))
    if law.signal == "time":
        return f"{acts} that drifts over each recording"
    return f"{acts}, a function of {signal_title(law.signal)}"


def _with_article(way: str) -> str:
    return f"an {way}" if way[0] in "aeio" else f"a {way}"
