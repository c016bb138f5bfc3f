"""The error of a correct model: sensor noise, and noise of restart states and inputs propagated through the model
(interface, section 3).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.distributions import chi_square_tail, chi_square_upper_quantile
from pneucli.executors import map_in_threads, simulations_at_once
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.outputs import NOISE_SEED, iterate_deviations

TAIL = 0.01  # of correct models whose error exceeds the limit: a rig in a hundred is asked for what it does not lack


class ErrorDistribution(NamedTuple):
    """The distribution of the mean square error of correct models, over the expected one: about chi-square.

    References:
        F. E. Satterthwaite, Biometrics Bull. 2 (1946) 110-114.

    >>> certain = ErrorDistribution(mean=1.0, variance=0.0)
    >>> certain.limit(0.01), certain.p_value(1.1), certain.p_value(0.9)
    (1.0, 0.0, 1.0)
    >>> one_number = ErrorDistribution(mean=1.0, variance=2.0)  # chi-square with one degree of freedom
    >>> round(one_number.limit(0.01), 3), round(one_number.p_value(1.0), 3)
    (2.576, 0.317)
    """

    mean: float
    variance: float

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the chi-square distribution with this mean and variance."""
        return 2.0 * self.mean * self.mean / self.variance if self.variance > 0.0 else math.inf

    def limit(self, tail: float = TAIL) -> float:
        """Return the root mean square error that the share ``tail`` of correct models exceeds."""
        if not math.isfinite(self.freedom):
            return math.sqrt(self.mean)
        return math.sqrt(self.mean * chi_square_upper_quantile(tail, self.freedom) / self.freedom)

    def p_value(self, error: float) -> float:
        """Return the share of correct models whose root mean square error exceeds ``error``."""
        if not math.isfinite(self.freedom):
            return float(error**2 <= self.mean)
        return chi_square_tail(error**2 / self.mean * self.freedom, self.freedom)

    def with_uncertain_parameters(self, square: float) -> ErrorDistribution:
        """Return the distribution where uncertain parameters add the mean square ``square``, over the expected one.

        Parameters err once for all recordings, so that what they add is taken to be one squared normal number.
        """
        return ErrorDistribution(self.mean + square, self.variance + 2.0 * square * square)

    def with_uncertain_noise(self, error: float) -> ErrorDistribution:
        """Return the distribution where the noise, of which all errors are multiples, has a relative standard error.

        It is one for all recordings, and its square errs by twice as much.

        >>> ErrorDistribution(1.0, 0.0).with_uncertain_noise(0.1)
        ErrorDistribution(mean=1.0, variance=0.04000000000000001)
        """
        return ErrorDistribution(self.mean, self.variance + (2.0 * error * self.mean) ** 2)


NOISE_DRAWS = 6
MOTION_CHANNELS = ("x", "v", "a")


class ExpectedError(NamedTuple):
    """The error of a correct model in one recording, by channel.

    ``rms``: SI. ``squares``: the contribution of each segment between restarts to the mean square, in each draw, SI
    squared, (draws, segments). ``population``: squares of segments over that of ``rms``, of all draws and of all
    recordings of the same kind, (P,); the same segments in each channel. ``undetermined``: the segments that
    start at a velocity which the readings leave open, so that no draw tells how they err, (segments,) or (1,) for all.
    ``noise_error``: the relative standard error of the noise of the channel's sensor, where it was estimated.
    """

    rms: dict[str, float]
    squares: dict[str, Array]
    population: dict[str, Array] = {}  # noqa: RUF012 - a tuple has no default factory
    undetermined: Mask = np.zeros(1, dtype=bool)
    noise_error: dict[str, float] = {}  # noqa: RUF012 - a tuple has no default factory

    def relative_squares(self, channel: str) -> Array:
        """Return the squares of the segments of a channel over that of its rms, in all draws, (draws x segments,)."""
        squares, noise = self.squares[channel], self.rms[channel]
        return np.ravel(squares) * squares.shape[1] / noise**2 if noise > 0.0 else np.zeros(squares.size)

    def distribution(self, channels: Sequence[str], *, certain_noise: bool = False) -> ErrorDistribution:
        """Return the distribution of the mean square error over channels that a correct model may have.

        Every segment starts with noise of its own, so the errors of segments are independent; those of the channels of
        one recording are not. ``certain_noise``: without the error of the noise, which other recordings share.
        """
        of_segments = np.mean([self.population[c] for c in channels], axis=0)
        draws, segments = next(iter(self.squares.values())).shape
        variance = float(of_segments.var(ddof=1)) / segments * (1.0 + 1.0 / draws)  # of an error, and of its mean
        found = ErrorDistribution(float(of_segments.mean()), variance)
        return found if certain_noise else found.with_uncertain_noise(noise_error([(self, channels)]))


def noise_error(channels: Sequence[tuple[ExpectedError, Sequence[str]]]) -> float:
    """Return the relative standard error of the noise in the mean of the squares of channels.

    Args:
        channels: The channels of each recording; those of one name share a sensor, whose noise errs once.

    Returns:
        The error; 0 where all noise is stated.
    """
    names = Counter(name for _, own in channels for name in own)
    errors = {name: one.noise_error.get(name, 0.0) for one, own in channels for name in own}
    return math.hypot(*(count / names.total() * errors[name] for name, count in names.items()))


def expected_error(
    model: Model, experiment: Experiment, draws: int = NOISE_DRAWS, seed: int = NOISE_SEED
) -> ExpectedError:
    """Return the error that a correct model would have.

    Args:
        model: The model.
        experiment: The experiment.
        draws: Number of draws of the noise.
        seed: Seed of the generator.

    Returns:
        The error; its rms is at least the noise of the channel's sensor.
    """
    valid = experiment.force_is_determined if experiment.recording.imposed else slice(None)
    segments, count = experiment.segments[valid], experiment.restarts.size
    drawn = [
        {c: np.bincount(segments, d[valid] ** 2, count) / max(segments.size, 1) for c, d in one.items()}
        for one in iterate_deviations(model, experiment, draws, seed)
    ]
    squares = {c: np.array([one[c] for one in drawn]) for c in experiment.channels}
    low_pass = experiment.low_pass is not None
    least = {c: 0.0 if low_pass or c not in experiment.noise else experiment.noise[c].rms for c in squares}
    rms = {c: max(float(np.sqrt(v.sum(axis=1).mean())), least[c]) for c, v in squares.items()}
    errors = {c: experiment.noise[c].relative_error for c in squares if c in experiment.noise}
    return ExpectedError(rms, squares, undetermined=experiment.undetermined_restarts, noise_error=errors)


def expected_rms(
    model: Model, experiment: Experiment, draws: int = NOISE_DRAWS, seed: int = NOISE_SEED
) -> dict[str, float]:
    """Return the rms error (SI, by channel) of :func:`expected_error`."""
    return expected_error(model, experiment, draws, seed).rms


def expected_errors(
    model: Model, experiments: Sequence[Experiment], progress: Callable[[int], None] = lambda _: None
) -> list[ExpectedError]:
    """Return :func:`expected_error` of each experiment, for the motion with an rms pooled over those of one kind.

    Whether a break-away falls before or after a restart determines most of the deviation of the motion, and the few
    draws of one recording may contain none; those of all recordings contain enough. So it is with their scatter.

    Args:
        model: The model.
        experiments: Experiments.
        progress: Called with the number of each experiment, from the thread that simulates it.

    Returns:
        The errors, in order.
    """

    def expected(i: int) -> ExpectedError:
        progress(i)
        return expected_error(model, experiments[i])

    own = map_in_threads(expected, range(len(experiments)), simulations_at_once([e.time for e in experiments]))
    kinds = [(e.recording.experiment, e.recording.imposed) for e in experiments]
    out = []
    for kind, one in zip(kinds, own, strict=True):
        same_kind = [n.rms for k, n in zip(kinds, own, strict=True) if k == kind]
        pooled = {c: _root_mean_square([n[c] for n in same_kind if c in n]) for c in one.rms if c in MOTION_CHANNELS}
        out.append(one._replace(rms=one.rms | pooled))
    return [
        _with_population(one, [n for k, n in zip(kinds, out, strict=True) if k == kind])
        for kind, one in zip(kinds, out, strict=True)
    ]


def _with_population(own: ExpectedError, same_kind: Sequence[ExpectedError]) -> ExpectedError:
    """Return an expected error with the squares of the segments of all recordings that have its channels."""
    alike = [one for one in same_kind if own.squares.keys() <= one.squares.keys()]
    return own._replace(population={c: np.concatenate([one.relative_squares(c) for one in alike]) for c in own.squares})


def _root_mean_square(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def combined_distribution(parts: Sequence[tuple[ErrorDistribution, int]]) -> ErrorDistribution | None:
    """Return the distribution of the mean square error over all channels of several recordings.

    Args:
        parts: For each recording the distribution of its mean square, and the number of its channels. Every recording
            has noise of its own, so that they are independent.

    Returns:
        The distribution; None without a channel.

    >>> combined_distribution([(ErrorDistribution(1.0, 0.5), 2), (ErrorDistribution(1.0, 0.5), 2)])
    ErrorDistribution(mean=1.0, variance=0.25)
    """
    count = sum(channels for _, channels in parts)
    if not count:
        return None
    mean = sum(channels * one.mean for one, channels in parts) / count
    return ErrorDistribution(mean, sum((channels / count) ** 2 * one.variance for one, channels in parts))
