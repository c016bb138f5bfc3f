"""Correlation of a residual with itself and with the inputs over the lag, and its bounds under independence.

The residual of a correct model is independent of the inputs.

References:
    M. S. Bartlett, J. R. Statist. Soc. Suppl. 8 (1946) 27-41.
    G. E. P. Box, G. M. Jenkins, Time Series Analysis (1970), ch. 11.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array, Integers
from pneucli.compare.channel_errors import Comparison
from pneucli.quantities import Z95

MAX_LAGS = 100  # lags up to the horizon
NON_INPUT_SIGNALS = ("x_ref", "p_ref", "flow", "temperature")  # recorded, but no input of the model


@dataclass(frozen=True)
class Correlation:
    """Correlation of one residual with itself (``against`` is its channel) or with an input.

    Attributes:
        lag: Lag in s, shape (k,); at a positive lag the input comes first.
        correlation: Correlation, shape (k,).
        bound: 95 % of the correlations with an independent input lie within plus and minus the bound, given how slowly
            both change; with itself, those of white noise.
    """

    recording: str
    use: str
    channel: str
    against: str
    lag: Array
    correlation: Array
    bound: float


def residual_correlations(comparison: Comparison, max_lag: float) -> Iterator[Correlation]:
    """Yield the correlation of every channel with itself and with each input.

    Samples that were not measured count as the mean. A constant or very short signal has no correlation.

    Args:
        comparison: A comparison of a model with an experiment.
        max_lag: Largest lag in s.

    Returns:
        Iterator over correlations.
    """
    experiment = comparison.experiment
    r = experiment.recording
    inputs = [n for n in experiment.raw if n not in (*experiment.channels, *NON_INPUT_SIGNALS, "time")]
    lags = _lags(max_lag, r.period, r.time.size)
    if not lags.size:
        return
    driving = {name: one for name in inputs if (one := _normalised(experiment.raw[name])) is not None}
    input_autocorrelations = {name: _cross_correlation(one, one) for name, one in driving.items()}
    for channel in experiment.channels:
        residual = _normalised(comparison.residual(channel))
        if residual is None:
            continue
        own = _cross_correlation(residual, residual)
        own_lags = lags[lags >= 0]
        white = Z95 / float(np.sqrt(residual.size))
        yield Correlation(
            r.name, r.use, channel, channel, np.asarray(own_lags * r.period), _at_lags(own, own_lags), white
        )
        for name, other in driving.items():
            cross, edge = (
                _at_lags(_cross_correlation(residual, other), lags),
                confidence_bound(own, input_autocorrelations[name]),
            )
            yield Correlation(r.name, r.use, channel, name, np.asarray(lags * r.period), cross, edge)


def confidence_bound(own: Array, other: Array) -> float:
    """Return the 95 % bound for the correlation of two independent series (Bartlett's formula).

    Where both change slowly there are few independent samples, and the bound is wide. Large lags are tapered.

    Args:
        own: Autocorrelation of one series, shape (2 n - 1,).
        other: Autocorrelation of the other series, shape (2 n - 1,).

    Returns:
        The bound.

    >>> white = np.zeros(199)
    >>> white[99] = 1.0
    >>> round(confidence_bound(white, white), 3)
    0.196
    """
    n = (other.size + 1) // 2
    taper = 1.0 - np.abs(np.arange(1 - n, n)) / n
    return float(Z95 * np.sqrt(max(float(np.sum(taper * own * other)), 1.0) / n))


def _lags(max_lag: float, period: float, samples: int) -> Integers:
    max_samples = min(round(max_lag / period), samples // 4)
    return (
        np.unique(np.linspace(-max_samples, max_samples, 2 * MAX_LAGS + 1).round()).astype(np.int64)
        if max_samples >= 1
        else np.zeros(0, int)
    )


def _normalised(values: Array) -> Array | None:
    """Return a series (n,) of mean 0 and norm 1, 0 where it was not measured; None for a constant series."""
    measured = np.isfinite(values)
    if not measured.any():
        return None
    centred = np.where(measured, values - np.mean(values[measured]), 0.0)
    size = float(np.linalg.norm(centred))
    return centred / size if size > 1e-12 * max(1.0, float(np.abs(values[measured]).max())) else None


def _cross_correlation(first: Array, second: Array) -> Array:
    """Return the full cross-correlation of two series of n samples, at the lags 1 - n to n - 1."""
    from scipy.fft import irfft, next_fast_len, rfft  # noqa: PLC0415 - slow to import

    n = first.size
    length = next_fast_len(2 * n - 1, real=True)
    full = irfft(rfft(first, length) * np.conj(rfft(second, length)), length)
    return np.concatenate([full[length - n + 1 :], full[:n]])


def _at_lags(full: Array, lags: Integers) -> Array:
    return np.asarray(full[full.size // 2 + lags])
