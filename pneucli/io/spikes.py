"""Spikes: one to three samples that leave the signal and come back, far beyond anything in their neighbourhood."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MARGIN_SAMPLES = 16  # samples on either side that a spike is judged against
MAX_SPIKE_SAMPLES = 3
MIN_NOISE_RATIO = 12.0  # times the robust scatter of the whole batch
MIN_STEP_RATIO = 8.0  # times the largest step among the neighbours, so that impacts that ring stay


def find_spikes(values: Array, noise: float = 0.0) -> NDArray[np.intp]:
    """Return the indices of spikes in ``values``, shape ``(n,)``; ``noise`` is a known standard deviation or 0.

    A spike leaves and returns by more than 12 standard deviations of the noise and 8 times the largest step within 16
    samples around it, and where it comes back is where it left (within an eighth of its height). Samples within one
    spike's width of either end are never judged. Good data that look like this: none that a sensor of finite bandwidth
    can give.
    """
    if values.size < 2 * MARGIN_SAMPLES:
        return np.empty(0, dtype=np.intp)
    steps = np.abs(np.diff(values))
    limit = MIN_NOISE_RATIO * max(_robust_deviation(steps), noise)
    leaving = np.flatnonzero(steps > limit)
    found = [_spike_after(values, steps, int(i), limit) for i in leaving]
    return np.unique(np.concatenate([np.empty(0, dtype=np.intp), *found]))


def _robust_deviation(steps: Array) -> float:
    """Robust standard deviation of one sample, from the steps between neighbours; the resolution at least."""
    sample = steps[:: max(1, steps.size // 65_536)]
    sample = sample[np.isfinite(sample)]
    if not sample.size:
        return np.inf
    moving = sample[sample > 0]
    resolution = float(moving.min()) if moving.size else np.inf
    return max(float(np.median(sample)) / 0.954, resolution)  # 0.6745 sqrt(2), normal distribution


def _spike_after(values: Array, steps: Array, last: int, limit: float) -> NDArray[np.intp]:
    """Return the samples of a spike that begins right after ``last``, if there is one."""
    for width in range(1, MAX_SPIKE_SAMPLES + 1):
        back = last + width + 1
        if back >= values.size:
            break
        inside = values[last + 1 : back]
        height = np.min(np.abs(inside - np.array([values[last], values[back]])[:, None]))
        around = np.concatenate([steps[max(0, last - MARGIN_SAMPLES) : last], steps[back : back + MARGIN_SAMPLES]])
        calm = np.nanmax(around) if np.isfinite(around).any() else np.inf
        returns = np.abs(values[back] - values[last]) < height / MIN_STEP_RATIO
        same_side = np.ptp(np.sign(inside - values[last])) == 0
        if returns and same_side and height > max(limit, MIN_STEP_RATIO * calm):
            return np.arange(last + 1, back)
    return np.empty(0, dtype=np.intp)
