"""Whether a signal says anything beyond noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import betainccinv

Array = NDArray[np.float64]

MIN_BLOCKS = 8  # blocks
FALSE_ALARM_PROBABILITY = 1e-6  # that white noise seems to move, at one width of blocks


def is_inactive(values: Array) -> bool:
    """Whether ``values``, shape ``(n,)``, are constant or nothing but white noise, as far as enough were measured.

    F test of the means of blocks of 4, 16, 64, ... samples against the scatter within them: of white noise no sample
    knows its neighbour, while of anything that moves, or of coloured noise, it does.
    """
    finite = values[np.isfinite(values)]
    if finite.size < 4 * MIN_BLOCKS:
        return False
    if np.ptp(finite) == 0.0:
        return True
    width = 4
    while finite.size // width >= MIN_BLOCKS:
        count = finite.size // width
        block = finite[: count * width].reshape(count, width)
        within = float(block.var(axis=1, ddof=1).mean())
        between = width * float(block.mean(axis=1).var(ddof=1))
        if between > within * _f_quantile(count - 1, count * (width - 1)):
            return False
        width *= 4
    return True


def _f_quantile(between: int, within: int) -> float:
    """Return what F, of so many degrees of freedom between and within blocks, exceeds in false alarms only."""
    share = float(betainccinv(0.5 * between, 0.5 * within, FALSE_ALARM_PROBABILITY))
    return share * within / ((1.0 - share) * between)
