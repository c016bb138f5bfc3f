"""Part of ``init``: the columns that hold stamps, or parts of stamps, and which columns they belong to."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pneucli.init.survey_types import Array, Column
from pneucli.io.clock_repairs import spread_stamps

MIN_INCREASING = 0.98  # of the steps of a clock, that do not go back: a counter may wrap now and then
MIN_MOVING = 0.5  # of the steps of a clock that is not coarse, that go on
MAX_STEP_SPREAD = 0.5  # of its median, that a column of time steps may spread
SAME_CLOCK = 1e-3  # of its length, that a clock which tells the same time may differ from a line over another

_SECONDS = re.compile(r"(?i)(?:.*[/_.\s])?(?:header[/_.]stamp[/_.])?(?:s|secs?|seconds?|tv_sec|epoch)")
_FRACTIONS = (  # of a second, in columns of their own: names, seconds of one, and how many there are in a second
    (re.compile(r"(?i)(?:.*[/_.\s])?(?:ns|nsecs?|nanosecs?|nanoseconds?|tv_nsec)"), 1e-9),
    (re.compile(r"(?i)(?:.*[/_.\s])?(?:us|µs|usecs?|microsecs?|microseconds?|tv_usec)"), 1e-6),
    (re.compile(r"(?i)(?:.*[/_.\s])?(?:ms|msecs?|millis|millisecs?|milliseconds?)"), 1e-3),
)
_STEPS = re.compile(r"(?i)d_?t|delta[_ ]?t(?:ime)?|time[_ ]?step|dtime|loop[_ ]?time|(?:sample[_ ]?)?interval")
_CLOCK = re.compile(r"(?i)(?:.*[/_.\s])?(?:t|time|zeit|timestamp|stamp|clock|tout|temps)(?:[_ ]?\d+)?(?:[_ /.].*)?")
_BARE = re.compile(r"\s*[\[(<{][^\])>}]*[\])>}]\s*$")


def is_increasing(values: Array) -> bool:
    """Return whether numbers go on like the stamps of a clock, also of a coarse one that rows share."""
    steps = np.diff(values)
    if not steps.size or float(np.mean(steps >= 0)) <= MIN_INCREASING:
        return False
    return float(np.mean(steps > 0)) > MIN_MOVING or spread_stamps(values) is not None


def computed_clocks(columns: Sequence[Column]) -> list[Column]:
    """Return the clock that several columns, or steps of time, make together; nothing where they make none."""
    return [*_with_fraction(columns), *_of_steps(columns)][:1]


def _with_fraction(columns: Sequence[Column]) -> Iterator[Column]:
    """Yield whole seconds with a fraction in another column, as ROS and C write them."""
    for seconds in columns:
        if not _is_name(_SECONDS, seconds) or not _is_whole(seconds.values) or seconds.where is not None:
            continue
        for fraction in columns:
            for pattern, size in _FRACTIONS:
                if _is_name(pattern, fraction) and _is_below(fraction.values, round(1 / size)):
                    values = seconds.values + size * fraction.values
                    if is_increasing(values[np.isfinite(values)]):
                        text = f"{_quoted(seconds)} + {size:g} * {_quoted(fraction)}"
                        yield Column(text, "time", "s", values, computed=True)


def _of_steps(columns: Sequence[Column]) -> Iterator[Column]:
    """Yield the sum of a column of time steps, where no column rises like a clock."""
    if any(_is_clock(column) for column in columns):
        return
    for steps in columns:
        known = steps.finite_values
        if not _is_name(_STEPS, steps) or not known.size or known.min() < 0 or np.median(known) <= 0:
            continue
        spread = float(np.median(np.abs(known - np.median(known))) / np.median(known))
        if spread < MAX_STEP_SPREAD and not is_increasing(known):
            text = f"cumsum({_quoted(steps)})"
            yield Column(text, "time", steps.unit, np.cumsum(np.nan_to_num(steps.values)), computed=True)


def paired_clocks(columns: Sequence[Column]) -> list[Column]:
    """Return the columns, each with the clock that stands before it, where several clocks do not tell one time."""
    at = [n for n, column in enumerate(columns) if _is_clock(column) and not column.computed]
    apart = [n for n in at if n == at[0] or (n - 1 not in at and not _tells_same(columns[at[0]], columns[n]))]
    if len(apart) < 2 or at[0] != 0:
        return list(columns)
    found = []
    for n, column in enumerate(columns):
        clock = columns[max(one for one in apart if one <= n)]
        found.append(column if n in at else replace(column, clock=clock.key))
    return found


def _tells_same(first: Column, other: Column) -> bool:
    """Return whether two clocks are in one line over the same rows."""
    both = np.isfinite(first.values) & np.isfinite(other.values)
    if not np.array_equal(np.isfinite(first.values), np.isfinite(other.values)) or np.count_nonzero(both) < 3:
        return False
    a, b = first.values[both], other.values[both]
    slope, offset = np.polyfit(a - a[0], b - b[0], 1)
    return bool(np.abs(b - b[0] - slope * (a - a[0]) - offset).max() < SAME_CLOCK * max(float(np.ptp(b)), 1e-300))


def _is_clock(column: Column) -> bool:
    named = _CLOCK.fullmatch(_BARE.sub("", column.name).strip()) is not None or column.unit in (
        "s",
        "ms",
        "us",
        "min",
        "h",
    )
    return named and column.where is None and is_increasing(column.finite_values)


def _is_name(pattern: re.Pattern[str], column: Column) -> bool:
    return pattern.fullmatch(_BARE.sub("", column.name).strip().rpartition("/")[2]) is not None


def _is_whole(values: Array) -> bool:
    known = values[np.isfinite(values)]
    return bool(known.size) and bool(np.all(known == np.floor(known))) and bool(np.all(np.diff(known) >= 0))


def _is_below(values: Array, limit: int) -> bool:
    known = values[np.isfinite(values)]
    return (
        bool(known.size) and bool(np.all(known >= 0) and np.all(known < limit)) and float(np.max(known)) > 0.5 * limit
    )


def _quoted(column: Column) -> str:
    return f"`{column.key}`"
