"""The expected deviation of the best model from recordings: noise, and what the model leaves beyond it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.estimation.blocks import residual_counts
from pneucli.identify.residuals import ResidualModel
from pneucli.simulate.experiment import Experiment

Array = NDArray[np.float64]

MIN_BLOCK_TIME = 0.02  # s, of a discrepancy whose correlation time is unknown
MEAN_TIME = 0.02  # s, of the means from which an accumulated change is taken
DeviationByChannel = Mapping[tuple[str, str], "ExpectedDeviation"]


@dataclass(frozen=True)
class LagDifference:
    """How a lag of typical size would change a channel, in units of noise: mean square, and correlation time in s."""

    mean_square: float
    time_constant: float = 0.0

    @classmethod
    def of(cls, rows: Sequence[Array], period: float) -> LagDifference:
        """Return that of differences in some recordings, each (n,) in units of noise."""
        count = sum(row.size for row in rows)
        squares = sum(float(row @ row) for row in rows)
        return cls(squares / count if count else 0.0, float(np.median([_correlation_time(r, period) for r in rows])))


@dataclass(frozen=True)
class ExpectedDeviation:
    """The deviation of the best model from recordings in one channel of one subsystem.

    Attributes:
        ratio: Its rms over the noise; 1: noise alone.
        time_constant: Correlation time in s of what exceeds noise; 0: white.
        path: Accumulated change of the channel in units of noise, see :func:`accumulated_change`, of the recordings
            that left this deviation; 0: unknown.
        lags: Differences in these recordings that each lag would make which the model lacks.
    """

    ratio: float = 1.0
    time_constant: float = 0.0
    path: float = 0.0
    lags: tuple[LagDifference, ...] = ()

    def divisor(self, period: float, path: float = 0.0, lags: Sequence[LagDifference] = ()) -> float:
        """Return the standard deviation per sample, in units of noise, of white noise that tells as little.

        A discrepancy repeats over its correlation time: ``2 time_constant / period`` samples are one reading.

        Args:
            period: Sampling period in s.
            path: Accumulated change of the channel in the recording to be made, in units of noise.
            lags: Differences in it, in the order of the attribute.

        >>> ExpectedDeviation(1.0, 0.1).divisor(1e-3)
        1.0
        >>> round(ExpectedDeviation(2.0, 0.05).divisor(1e-3), 2)  # sqrt(1 + 3 * 100)
        17.35
        >>> round(ExpectedDeviation(2.0, 0.05, path=500.0).divisor(1e-3, 1000.0), 2)  # sqrt(1 + 4 * 3 * 100)
        34.66
        """
        excess, time_constant = self._excess(path, lags)
        return float(np.sqrt(1.0 + excess * max(1.0, 2.0 * time_constant / period)))

    def rms(self, path: float = 0.0, lags: Sequence[LagDifference] = ()) -> float:
        """Return the expected rms over the noise in a recording, in units of noise; arguments as of ``divisor``.

        >>> lag = LagDifference(12.0)  # of typical size; the recordings so far allow half of it
        >>> ExpectedDeviation(2.0, lags=(lag,)).rms(lags=[LagDifference(192.0)])  # sqrt(1 + 192 * 3 / 12)
        7.0
        """
        return float(np.sqrt(1.0 + self._excess(path, lags)[0]))

    def _excess(self, path: float, lags: Sequence[LagDifference]) -> tuple[float, float]:
        """Return the mean square beyond noise, and its correlation time in s: the larger of two.

        A model that errs by a share of a flow or a force errs in proportion to the accumulated change: a recording with
        more of it leaves more, one with less is not trusted to leave less. And every rig has lags that its model lacks:
        of the valve and of lines. Each is as large as the deviation so far allows, at most of typical size. A
        shut chamber keeps an error: the deviation is correlated at least as long as the effect of a lag is.
        """
        known = max(self.ratio**2 - 1.0, 0.0)
        growth = max(path / self.path, 1.0) if self.path > 0.0 else 1.0
        lasting = max([self.time_constant, *(lag.time_constant for lag in lags)])
        found = [known * growth**2]
        for before, after in zip(self.lags, lags, strict=False):
            share = min(1.0, known / before.mean_square) if before.mean_square > 0.0 else 1.0
            found.append(share * after.mean_square)
        return max(found), lasting


def expected_deviations(
    residual_model_list: Sequence[ResidualModel], residual: Array, lags: Sequence[Array] = ()
) -> dict[tuple[str, str], ExpectedDeviation]:
    """Return the deviation of a fitted model in each channel of each subsystem.

    Args:
        residual_model_list: The residual models of the fit.
        residual: Its residuals in units of noise, shape (N,).
        lags: Differences that each lag would make, each (N,) in units of noise.

    Returns:
        The deviation by title of the subsystem and channel.
    """
    parts: dict[tuple[str, str], list[tuple[Array, float, float]]] = {}
    delayed: dict[tuple[str, str], list[list[Array]]] = {}
    for one, values, changes in _by_model(residual_model_list, residual, lags):
        for i, channel in enumerate(one.channels):
            period, path = one.experiment.recording.period, accumulated_change(one.experiment, channel)
            parts.setdefault((one.title, channel), []).append((values[i], period, path))
            delayed.setdefault((one.title, channel), []).append([change[i] for change in changes])
    return {key: _deviation(rows, delayed[key]) for key, rows in parts.items()}


def _by_model(
    models: Sequence[ResidualModel], residual: Array, lags: Sequence[Array]
) -> Iterator[tuple[ResidualModel, Array, list[Array]]]:
    """Yield each residual model with its residuals and its differences by lag, each (channels, n)."""
    offsets = np.cumsum([0, *residual_counts(models)])
    for one, begin, end in zip(models, offsets, offsets[1:], strict=False):
        shape = (len(one.channels), -1)
        yield one, residual[begin:end].reshape(shape), [lag[begin:end].reshape(shape) for lag in lags]


def _deviation(rows: Sequence[tuple[Array, float, float]], delayed: Sequence[Sequence[Array]]) -> ExpectedDeviation:
    squares = sum(float(row @ row) for row, _, _ in rows)
    count = sum(np.count_nonzero(row) for row, _, _ in rows)
    ratio = float(np.sqrt(squares / count)) if count else 1.0
    times = [_correlation_time(row, period) for row, period, _ in rows]
    path = float(np.sqrt(np.average([p**2 for _, _, p in rows], weights=[row.size for row, _, _ in rows])))
    lags = tuple(LagDifference.of(group, rows[0][1]) for group in zip(*delayed, strict=True))
    return ExpectedDeviation(max(ratio, 1.0), float(np.median(times)) if ratio > 1.0 else 0.0, path, lags)


def accumulated_change(experiment: Experiment, channel: str) -> float:
    """Return how far a channel travels since the last restart of the comparison: its total variation, rms over time.

    Args:
        experiment: The recording, and where its comparison restarts.
        channel: The channel.

    Returns:
        Change in units of the sensor's noise; 0 where the channel is not recorded.
    """
    if channel not in experiment.raw or channel not in experiment.noise:
        return 0.0
    noise, period = experiment.noise[channel].rms, experiment.recording.period
    return travelled(experiment.raw[channel] / noise, experiment.restarts, max(1, round(MEAN_TIME / period)))


def travelled(values: Array, restarts: Sequence[int] | NDArray[np.int64], length: int) -> float:
    """Return the rms over time of the total variation since the last restart, of means over some samples.

    Means lower the variation that white noise of variance 1 adds; its expectation is subtracted.

    Args:
        values: Values in units of noise, shape (n,).
        restarts: Samples at which the variation starts anew.
        length: Samples of one mean.

    >>> round(travelled(np.repeat([0.0, 100.0, 0.0, 0.0], 50), [0], 50), 1)  # of 0, 99.84, 199.68 and 199.52
    149.7
    """
    means = values[: values.size // length * length].reshape(-1, length).mean(axis=1)
    if means.size < 2:
        return 0.0
    by_noise = 2.0 / np.sqrt(np.pi * length)
    steps = np.abs(np.diff(means, prepend=means[0]))
    path = np.cumsum(np.append(0.0, steps[1:] - by_noise))
    begins = np.unique(np.asarray(restarts, dtype=np.int64) // length)
    latest = begins[np.maximum(np.searchsorted(begins, np.arange(means.size), side="right") - 1, 0)]
    since = np.maximum(path - path[np.minimum(latest, means.size - 1)], 0.0)
    return float(np.sqrt(np.mean(since**2)))


def _correlation_time(row: Array, period: float) -> float:
    """Return the time in s in which the autocorrelation (n,) falls to 1/e of its value at one sample."""
    power = np.abs(np.fft.rfft(row, 2 * row.size)) ** 2
    covariance = np.fft.irfft(power)[: row.size // 2]
    if covariance.size < 3 or not covariance[1] > 0.0:
        return MIN_BLOCK_TIME
    decayed = np.flatnonzero(covariance[1:] < covariance[1] / np.e)
    return float(decayed[0] * period) if decayed.size else float(0.5 * row.size * period)
