"""The trend of each parameter of a rig over its dates, and the dates at which its level changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MIN_DATES = 3  # two dates show no trend
# times the logarithm of the number of dates, for each additional level: its value and the place of its change
CHANGE_POINT_PENALTY = 3.0


@dataclass(frozen=True)
class Trend:
    """One parameter of one rig over its dates: values, standard errors, and the indices at which a new level begins."""

    rig: str
    name: str
    unit: str
    dates: tuple[str, ...]
    values: tuple[float, ...]
    errors: tuple[float, ...]
    change_points: tuple[int, ...] = ()


def find_change_points(values: Array, errors: Array) -> tuple[int, ...]:
    """Return the indices at which the level of a series changes.

    Dynamic programming finds the exact minimum of the weighted sum of squares about piecewise constant levels, plus
    Schwarz's penalty for each change. A standard error below the scatter of neighbouring values is raised to it.

    Args:
        values: The series, shape (n,).
        errors: Standard errors, shape (n,), same unit.

    Returns:
        The index of the first value of each level but the first one.

    """
    n = values.size
    if n < MIN_DATES:
        return ()
    weight = 1.0 / np.maximum(errors, robust_scatter(values)) ** 2
    sums = [np.concatenate([[0.0], np.cumsum(weight * values**k)]) for k in (0, 1, 2)]
    penalty = CHANGE_POINT_PENALTY * np.log(n)
    best, last = np.full(n + 1, np.inf), np.zeros(n + 1, dtype=int)
    best[0] = -penalty
    for end in range(1, n + 1):
        w, first, second = (s[end] - s[:end] for s in sums)
        cost = best[:end] + np.maximum(second - first**2 / w, 0.0) + penalty
        last[end] = int(np.argmin(cost))
        best[end] = cost[last[end]]
    changes, end = [], n
    while (end := int(last[end])) > 0:
        changes.append(end)
    return tuple(reversed(changes))


def robust_scatter(values: Array) -> float:
    """Return the standard deviation of values about a piecewise constant level, from the median of their steps."""
    steps = np.abs(np.diff(values))
    tiny = 1e-12 * float(np.max(np.abs(values), initial=1e-300))
    return max(float(np.median(steps)) / (0.6745 * np.sqrt(2.0)), tiny) if steps.size >= MIN_DATES else tiny


def parameter_trends(records: Sequence[tuple[str, str, str, str, float, float]]) -> list[Trend]:
    """Return the trends of (rig, date, name, unit, value, error), by rig and name, dates in order."""
    groups: dict[tuple[str, str, str], list[tuple[str, float, float]]] = {}
    for rig, date, name, unit, value, error in records:
        if np.isfinite(value):
            groups.setdefault((rig, name, unit), []).append((date, value, error if np.isfinite(error) else 0.0))
    return [_trend(key, sorted(points)) for key, points in groups.items() if len(points) >= MIN_DATES]


def _trend(key: tuple[str, str, str], points: Sequence[tuple[str, float, float]]) -> Trend:
    dates, values, errors = zip(*points, strict=True)
    rig, name, unit = key
    return Trend(rig, name, unit, dates, values, errors, find_change_points(np.array(values), np.array(errors)))
