"""How far the error of a correct model exceeds the expected one by chance.

The motion of a few seconds holds a few dozen restarts, and between two of them its error is about one random number.
The error of a whole recording therefore scatters by some ten per cent even if the model is right.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pneucli.distributions import chi_square_upper_quantile

Array = NDArray[np.float64]

TAIL = 0.05  # of correct models whose error exceeds the limit


def error_limit(recordings: Sequence[Sequence[Array]]) -> float | None:
    """Return the error below which 95 % of correct models stay, in units of the expected one.

    Every segment starts with noise of its own, so the errors of segments are independent; those of the channels of one
    recording are not. Their sum has about a chi-square distribution with the mean and the variance of the draws.

    Args:
        recordings: For each recording the mean squares of each channel over the square of its expected error, by draw
            and segment, each (draws, segments).

    Returns:
        The limit of the root mean square over all channels; None without a channel.

    References:
        F. E. Satterthwaite, Biometrics Bull. 2 (1946) 110-114.

    >>> error_limit([[np.array([[0.25, 0.75], [0.25, 0.75]])]])  # a mean square of 1 in every draw
    1.0
    """
    sums = [np.sum(squares, axis=0) for squares in recordings if len(squares)]
    channels = sum(len(squares) for squares in recordings)
    if not channels:
        return None
    mean = sum(float(one.mean(axis=0).sum()) for one in sums) / channels
    variance = sum(float(one.var(axis=0, ddof=1).sum()) for one in sums) / channels**2
    if variance <= 0.0:
        return math.sqrt(mean)
    freedom = 2.0 * mean**2 / variance
    return math.sqrt(mean * chi_square_upper_quantile(TAIL, freedom) / freedom)
