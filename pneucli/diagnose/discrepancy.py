"""What stays unexplained beside what is named: where it is, how large, how slow, and over which signal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.diagnose.remainder import FAINT, Remainder
from pneucli.diagnose.trial import Bench
from pneucli.diagnose.unknown import describe
from pneucli.identify.fit import Fit
from pneucli.identify.views import View
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


def discrepancies(bench: Bench, fit: Fit, left: Sequence[Remainder]) -> list[Discrepancy]:
    """Return what is more than noise of what a fit leaves over in all views, the largest part first."""
    seen = {(r.kind, r.channel): r for r in reversed(left) if r.ratio > FAINT}
    residuals = {key: _residuals(fit.model, bench.views, *key) for key in seen}
    beyond = {key: sum(max(float(r @ r) - np.count_nonzero(r), 0.0) for r, _ in residuals[key]) for key in seen}
    signals = [describe(bench, fit, r).variable for r in seen.values()]
    total = max(sum(beyond.values()), 1e-9)
    found = [
        Discrepancy(r.kind.title, r.channel, r.ratio, _memory(residuals[key]), over, beyond[key] / total)
        for (key, r), over in zip(seen.items(), signals, strict=True)
    ]
    return sorted(found, key=lambda d: -d.share)


def _residuals(model: Model, views: Sequence[View], kind: type[View], channel: str) -> list[tuple[Array, float]]:
    """Return the residuals (n,) in units of noise and the sampling period (s) of each view."""
    mine = [v for v in views if type(v) is kind and channel in v.channels]
    return [(v.residual(model)[channel] / v.noise[channel], v.experiment.recording.period) for v in mine]


def _memory(residuals: Sequence[tuple[Array, float]]) -> float | None:
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
