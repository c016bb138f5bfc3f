"""The quantisation step of a signal: the resolution of its converter or counter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def quantisation_step(values: Array) -> float:
    """Return the quantisation step of a signal: the largest step of which all differences are multiples.

    A command that holds few levels has no step: 24 levels are needed, or a change in every twentieth sample.

    Args:
        values: Signal, shape (n,).

    Returns:
        The step in the unit of the signal; 0 where there is none.

    >>> noise = np.random.default_rng(1).standard_normal(1000)
    >>> round(quantisation_step(0.25 * np.round(noise / 0.25)), 6)
    0.25
    """
    finite = values[np.isfinite(values)]
    levels = np.unique(finite)
    changes = np.count_nonzero(np.diff(finite))
    if levels.size < 4 or (levels.size < 24 and changes < 0.05 * finite.size):
        return 0.0
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-9 * max(np.ptp(levels), float(np.abs(levels).max()) * 1e-4)]
    for parts in range(1, 9):
        step = float(gaps.min()) / parts
        narrow = gaps[gaps < 50 * step]  # wide gaps carry rounding errors
        if narrow.size >= 3 and np.all(np.abs(narrow / step - np.round(narrow / step)) < 0.02):
            return float(np.median(narrow / np.round(narrow / step)))
    return _rounded_step(levels, gaps)


MAX_ROUNDING = 0.3  # of a converter's step, to which its readings may be rounded where they are written
MIN_SINGLE_STEPS = 8  # gaps of one step that tell it


def _rounded_step(levels: Array, gaps: Array) -> float:
    """Return the step of a converter whose readings are written with few digits; 0 where there is none.

    Steps of 0.12875 written with two digits are gaps of 0.12 and 0.13: no level is a multiple of a step, but each is
    one within the rounding.
    """
    single = gaps[gaps < 1.5 * gaps.min()] if gaps.size else gaps
    rounding = float(np.ptp(single)) if single.size else 0.0
    if single.size < MIN_SINGLE_STEPS or not 0.0 < rounding < MAX_ROUNDING * float(single.min()):
        return 0.0
    step = float(single.mean())
    for _ in range(3):
        count = np.round((levels - levels[0]) / step)
        step = float(np.sum(count * (levels - levels[0])) / np.sum(count**2))
    left = np.abs(levels - levels[0] - np.round((levels - levels[0]) / step) * step)
    return step if float(left.max()) <= 1.001 * rounding else 0.0
