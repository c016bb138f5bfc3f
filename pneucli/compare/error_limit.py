"""How far the error of a correct model exceeds the expected one by chance.

The motion of a few seconds holds a few dozen restarts, and between two of them its error is about one random number.
The error of a whole recording therefore scatters by some ten per cent even if the model is right.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from pneucli.distributions import chi_square_tail, chi_square_upper_quantile

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
        return 2.0 * self.mean**2 / self.variance if self.variance > 0.0 else math.inf

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
        return ErrorDistribution(self.mean + square, self.variance + 2.0 * square**2)


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
