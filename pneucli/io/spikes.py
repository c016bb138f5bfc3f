"""Spikes: one to three samples that leave the signal and come back, far beyond anything in their neighbourhood."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MARGIN_SAMPLES = 16  # samples on either side that a spike is judged against
MAX_SPIKE_SAMPLES = 3
MIN_NOISE_RATIO = 12.0  # times the robust deviation of the whole batch
MIN_STEP_RATIO = 8.0  # times the largest step among the neighbours, so that impacts that ring stay
ROUNDING = 1e-12  # of the largest value: smaller steps come from converting units, not from the sensor


def find_spikes(values: Array, noise: float = 0.0) -> Indices:
    """Return the indices of spikes in ``values``, shape ``(n,)``; ``noise`` is a known standard deviation or 0.

    A spike leaves and returns by more than 12 standard deviations of the noise and 8 times the largest step within 16
    samples around it, and it returns to where it left (within an eighth of its height). Samples within one
    spike's width of either end are never judged. A sensor of finite bandwidth cannot give good data of this shape.
    """
    if values.size < 2 * MARGIN_SAMPLES:
        return np.empty(0, dtype=np.intp)
    steps = np.abs(np.diff(values))
    limit = MIN_NOISE_RATIO * max(_robust_deviation(steps, values), noise)
    before = np.flatnonzero(steps > limit)
    found = []
    for width in range(1, MAX_SPIKE_SAMPLES + 1):
        before = before[before + width + 1 < values.size]
        is_spike = _is_spike(values, steps, before, width, limit)
        found += [before[is_spike] + offset for offset in range(1, width + 1)]
        before = before[~is_spike]
    return np.unique(np.concatenate(found))


def _robust_deviation(steps: Array, values: Array) -> float:
    """Robust standard deviation of one sample, from the steps between neighbours; the resolution at least."""
    stride = max(1, steps.size // 65_536)
    sample = steps[::stride]
    sample = sample[np.isfinite(sample)]
    if not sample.size:
        return np.inf
    moving = sample[sample > ROUNDING * float(np.nanmax(np.abs(values[::stride])))]
    resolution = float(moving.min()) if moving.size else np.inf
    return max(float(np.median(sample)) / 0.954, resolution)  # 0.6745 sqrt(2), normal distribution


def _is_spike(values: Array, steps: Array, before: Indices, width: int, limit: float) -> NDArray[np.bool_]:
    """Return, for each sample of ``before``, whether a spike of ``width`` samples follows it."""
    start, end = values[before], values[before + width + 1]
    inside = np.stack([values[before + offset] for offset in range(1, width + 1)])
    height = np.minimum(np.abs(inside - start), np.abs(inside - end)).min(axis=0)
    side = np.sign(inside - start)
    is_spike = (np.abs(end - start) < height / MIN_STEP_RATIO) & (height > limit) & (side == side[0]).all(axis=0)
    candidates = np.flatnonzero(is_spike)
    usual_step = _largest_step_around(steps, before[candidates], width)
    is_spike[candidates] = height[candidates] > MIN_STEP_RATIO * usual_step
    return np.asarray(is_spike)


def _largest_step_around(steps: Array, before: Indices, width: int) -> Array:
    """Return the largest step within the margin before and after each spike; infinite where no step is known."""
    offsets = np.concatenate([np.arange(-MARGIN_SAMPLES, 0), width + 1 + np.arange(MARGIN_SAMPLES)])
    at = before[:, None] + offsets
    around = np.where((at >= 0) & (at < steps.size), steps[np.clip(at, 0, steps.size - 1)], np.nan)
    largest = np.fmax.reduce(around, axis=1, initial=-np.inf)
    return np.where(np.isfinite(largest), largest, np.inf)
