"""The difference of two independent estimates, from their 95 % intervals alone.

:mod:`pneucli.changes.comparison` tests what changed in one model between two dates, from the blocks of both sets of
recordings. Two finished runs may have different models, and keep values and intervals only; this module compares those.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class IntervalDifference:
    """The difference b - a of two estimates, with the 95 % interval ``(low, high)`` of the difference."""

    value: float
    low: float
    high: float

    @property
    def beyond(self) -> bool:
        """Whether the interval of the difference excludes zero."""
        return not self.low <= 0.0 <= self.high


def interval_difference(
    a: float, a_ci95: Sequence[float | None] | None, b: float, b_ci95: Sequence[float | None] | None
) -> IntervalDifference | None:
    """Return the difference of two independent estimates with its 95 % interval.

    Each end of the interval follows from the ends that face each other, so intervals may be asymmetric. For symmetric
    ones the half width is the root of the sum of the squared half widths.

    Args:
        a: The first estimate.
        a_ci95: The ends of its 95 % interval; an end may be None.
        b: The second estimate, in the unit of the first.
        b_ci95: The ends of its 95 % interval.

    Returns:
        The difference; None where an end of an interval is missing or the interval of the difference is infinite.

    References:
        G. Y. Zou and A. Donner, Statistics in Medicine 27 (2008) 1693-1702 (method of variance estimates recovery).

    >>> interval_difference(10.0, (7.0, 13.0), 15.0, (11.0, 19.0))
    IntervalDifference(value=5.0, low=0.0, high=10.0)
    """
    ends = [*(a_ci95 or (None,)), *(b_ci95 or (None,))]
    if len(ends) != 4 or any(end is None for end in ends):
        return None
    a_low, a_high, b_low, b_high = (float(end) for end in ends if end is not None)
    difference = b - a
    low = difference - math.hypot(b - b_low, a_high - a)
    high = difference + math.hypot(b_high - b, a - a_low)
    return IntervalDifference(difference, low, high) if math.isfinite(high - low) else None
