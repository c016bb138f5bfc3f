"""The discrepancy that no named effect explains: its channel, size and time constant, and the signal that it depends
on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pneucli.diagnose.adequacy import MIN_TRIMMED_RATIO, LackOfFit
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.equivalence import CHANCE_COST_RATIO
from pneucli.diagnose.periodic_term import PeriodicTerm, find_period
from pneucli.diagnose.smooth_term import SmoothTerm
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.residuals import ResidualModel
from pneucli.simulate.model import Model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Discrepancy:
    """One channel of one subsystem: its rms over that of noise (``size``), the correlation time in s (None where
    unknown), the signal of which it is a function (or None), and its share of all squares in excess of noise.
    """

    subsystem: str
    channel: str
    size: float
    time_constant: float | None
    over: str | None
    share: float


def describe_discrepancies(data: DiagnosisData, fit: Fit, lacks: Sequence[LackOfFit]) -> list[Discrepancy]:
    """Return the channels in which a fit leaves more than noise, the largest share first."""
    lack_by_channel = {(r.kind, r.channel): r for r in reversed(lacks) if r.ratio > MIN_TRIMMED_RATIO}
    residuals = {key: _residuals(fit.model, data.residual_models, *key) for key in lack_by_channel}
    excess = {
        key: sum(max(float(r @ r) - np.count_nonzero(r), 0.0) for r, _ in residuals[key]) for key in lack_by_channel
    }
    signals = [describe_lack_of_fit(data, fit, r).variable for r in lack_by_channel.values()]
    total = max(sum(excess.values()), 1e-9)
    found = [
        Discrepancy(r.kind.title, r.channel, r.ratio, _correlation_time(residuals[key]), over, excess[key] / total)
        for (key, r), over in zip(lack_by_channel.items(), signals, strict=True)
    ]
    return sorted(found, key=lambda d: -d.share)


def _residuals(
    model: Model, residual_models: Sequence[ResidualModel], kind: type[ResidualModel], channel: str
) -> list[tuple[Array, float]]:
    """Return the residuals (n,) in units of noise and the sampling period (s) of each recording."""
    members = [v for v in residual_models if type(v) is kind and channel in v.channels]
    return [(v.residual(model)[channel] / v.noise[channel], v.experiment.recording.period) for v in members]


def _correlation_time(residuals: Sequence[tuple[Array, float]]) -> float | None:
    """Return the time in s in which the pooled autocorrelation falls to 1/e of its value at one sample."""
    if not residuals:
        return None
    period = min(p for _, p in residuals)
    covariances = [_autocovariance(r) for r, p in residuals if p == period]
    length = min(c.size for c in covariances)
    pooled = np.sum([c[:length] for c in covariances], axis=0)
    if length < 3 or not pooled[1] > 0.0:
        return None
    decayed = np.flatnonzero(pooled[1:] < pooled[1] / np.e)
    return float(decayed[0] * period) if decayed.size else None


def _autocovariance(values: Array) -> Array:
    """Return the sums of products of values (n,) at lags 0 to n // 2."""
    power = np.abs(np.fft.rfft(values, 2 * values.size)) ** 2
    return np.asarray(np.fft.irfft(power)[: values.size // 2])


MIN_EXPLAINED_SHARE = 0.05  # of the squares: a function of a signal that explains less is not reported

DiscrepancyKind = Literal[
    "free-run",  # only the free run fails; each subsystem fits by itself
    "shapeless",  # the residual is no function of any signal
    "irregular",  # a smooth function of a signal explains a minor part
    "smooth",  # a smooth function of a signal
    "periodic",  # the residual repeats over time or position
]


@dataclass(frozen=True)
class UnexplainedResidual:
    """The residual that no effect explains: its channel, its ratio to noise, and the signal that it depends on.

    ``share`` is the part of the squares that a function of the ``variable`` explains in left-out recordings; for a
    periodic one it may be that in the fitted ones. ``acts_as`` has the quantities as which it may act, the best first.
    ``simple_shape`` is a key of SIMPLE_SHAPES that explains about as much, ``other_signals`` explain about as much as
    the variable. ``period`` is in s or m. ``smooth_term`` is the function itself.
    """

    subsystem: str
    channel: str
    ratio: float
    kind: DiscrepancyKind
    variable: str | None = None
    acts_as: tuple[str, ...] = ()
    period: float | None = None
    simple_shape: str | None = None
    share: float | None = None
    other_signals: tuple[str, ...] = ()
    smooth_term: SmoothTerm | None = None


def describe_lack_of_fit(data: DiagnosisData, fit: Fit, worst: LackOfFit) -> UnexplainedResidual:
    """Describe a significant lack of fit."""
    where = UnexplainedResidual(worst.kind.title, worst.channel, worst.ratio, "free-run")
    members = [m for m in data.train if type(m) is worst.kind and worst.channel in m.channels]
    if not members:
        return where
    channel = data.spline_regression(fit, worst.kind, worst.channel)
    ranked = channel.ranked_terms(fit)
    periodic = find_period(fit.model, members, worst.channel)
    best = ranked[0] if ranked and ranked[0].share > MIN_EXPLAINED_SHARE else None
    if periodic is not None and (best is None or periodic.variable == best.signal or periodic.share > best.share):
        return _periodic(where, periodic, best if best is not None and best.signal == periodic.variable else None)
    if best is None:
        return replace(where, kind="shapeless")
    found = replace(where, variable=best.signal, share=best.share, smooth_term=best, acts_as=(best.acts_as,))
    found = replace(found, simple_shape=channel.simplest_shape(fit, best))
    if CHANCE_COST_RATIO * (1.0 - best.share) > 1.0:
        return replace(found, kind="irregular")
    close = [one for one in ranked if 1.0 - one.share < CHANCE_COST_RATIO * (1.0 - best.share)]
    acts_as = dict.fromkeys([best.acts_as, *(one.acts_as for one in close if one.signal == best.signal)])
    others = tuple(name for name in dict.fromkeys(one.signal for one in close) if name != best.signal)
    return replace(found, kind="smooth", acts_as=tuple(acts_as), other_signals=others)


def _periodic(where: UnexplainedResidual, periodic: PeriodicTerm, smooth: SmoothTerm | None) -> UnexplainedResidual:
    return replace(
        where,
        kind="periodic",
        variable=periodic.variable,
        acts_as=() if smooth is None else (smooth.acts_as,),
        period=periodic.length,
        share=periodic.share if smooth is None else max(smooth.share, periodic.share),
        smooth_term=smooth,
    )
