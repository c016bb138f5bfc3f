"""What a residual has to do with itself and with the inputs: correlation over the lag, and what chance would give.

A model that has all there is leaves a residual that knows nothing of the inputs. Source of the bounds: M. S. Bartlett,
On the theoretical specification and sampling properties of autocorrelated time-series, J. R. Statist. Soc. Suppl. 8
(1946) 27; G. E. P. Box, G. M. Jenkins, Time Series Analysis (1970), ch. 11.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import correlate

from pneucli.compare.channel_errors import Comparison
from pneucli.quantities import Z95

Array = NDArray[np.float64]

MAX_LAGS = 100  # lags up to the horizon
NON_INPUT_SIGNALS = ("x_ref", "p_ref", "flow", "temperature")  # recorded beside, and not what drives the model


@dataclass(frozen=True)
class Correlation:
    """Correlation of one residual with itself (``against`` is its channel) or with an input, over ``lag`` (s, (k,)).

    A positive lag: the input comes first. ``confidence_bound``: within plus and minus it lie 95 % of the correlations of a
    residual that has nothing to do with the input, given how slowly both change; with itself, of white noise.
    """

    recording: str
    use: str
    channel: str
    against: str
    lag: Array
    correlation: Array
    bound: float


def residual_correlations(comparison: Comparison, max_lag: float) -> Iterator[Correlation]:
    """Yield every channel's correlation with itself and with each input, for lags up to ``max_lag`` (s).

    Samples that were not measured count as the mean. What does not change, or is too short, has none.
    """
    experiment = comparison.experiment
    r = experiment.recording
    inputs = [n for n in experiment.raw if n not in (*experiment.channels, *NON_INPUT_SIGNALS, "time")]
    lags = _lags(max_lag, r.period, r.time.size)
    if not lags.size:
        return
    driving = {name: one for name in inputs if (one := _normalised(experiment.raw[name])) is not None}
    theirs = {name: _cross_correlation(one, one) for name, one in driving.items()}
    for channel in experiment.channels:
        residual = _normalised(comparison.residual(channel))
        if residual is None:
            continue
        own = _cross_correlation(residual, residual)
        mine = lags[lags >= 0]
        white = Z95 / float(np.sqrt(residual.size))
        yield Correlation(r.name, r.use, channel, channel, np.asarray(mine * r.period), _at_lags(own, mine), white)
        for name, other in driving.items():
            cross, edge = _at_lags(_cross_correlation(residual, other), lags), confidence_bound(own, theirs[name])
            yield Correlation(r.name, r.use, channel, name, np.asarray(lags * r.period), cross, edge)


def confidence_bound(own: Array, other: Array) -> float:
    """Return the 95 % bound of the correlation of two series that are independent (Bartlett's formula).

    ``own`` and ``other`` are the correlations of each with itself (2 n - 1,). Where both change slowly there are
    few independent samples, and the bound is wide. Distant lags, which say little, count less.
    """
    n = (other.size + 1) // 2
    taper = 1.0 - np.abs(np.arange(1 - n, n)) / n
    return float(Z95 * np.sqrt(max(float(np.sum(taper * own * other)), 1.0) / n))


def _lags(longest: float, period: float, samples: int) -> NDArray[np.int64]:
    most = min(round(longest / period), samples // 4)
    return (
        np.unique(np.linspace(-most, most, 2 * MAX_LAGS + 1).round()).astype(np.int64)
        if most >= 1
        else np.zeros(0, int)
    )


def _normalised(values: Array) -> Array | None:
    """Return a series (n,) of mean 0 and norm 1, 0 where it was not measured; None where it does not change."""
    seen = np.isfinite(values)
    if not seen.any():
        return None
    centred = np.where(seen, values - np.mean(values[seen]), 0.0)
    size = float(np.linalg.norm(centred))
    return centred / size if size > 1e-12 * max(1.0, float(np.abs(values[seen]).max())) else None


def _cross_correlation(first: Array, second: Array) -> Array:
    return np.asarray(correlate(first, second, mode="full", method="fft"))


def _at_lags(full: Array, lags: NDArray[np.int64]) -> Array:
    return np.asarray(full[full.size // 2 + lags])
