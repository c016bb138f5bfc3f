"""Part of ``init``: the columns that hold stamps, or parts of stamps, and which columns they belong to."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from pneucli.arrays import Array
from pneucli.init.column_names import NOUNS, read_name
from pneucli.init.survey_types import Column
from pneucli.io.clock_repairs import spread_stamps

MIN_INCREASING = 0.98  # of the steps of a clock, that do not go back: a counter may wrap now and then
MIN_STAMPS = 9  # of a coarse clock that is not called one
MIN_MOVING = 0.5  # of the steps of a clock that is not coarse, that go on
MAX_STEP_SPREAD = 0.5  # of its median, that a column of time steps may spread
SAME_CLOCK = 1e-3  # of its length, that a clock which tells the same time may differ from a line over another

MIN_WRAPS = 3  # whole seconds after which a fraction begins anew, where its name does not say that it is one
_FRACTION = re.compile(r"(?i)(?<![a-z])[mµun]s(?:ecs?)?(?![a-z])|milli|micro|nano|frac|sub[\s_-]?sec|tv_[un]sec")
FRACTIONS = tuple(10.0**n for n in range(1, 10))  # how many there are in a second
_PARTS = (  # of a time of day in columns of their own: names, and seconds of one
    (re.compile(r"(?i)(?:.*[/_.\s])?(?:h|hours?|stunden?|heures?)"), 3600.0, 24.0),
    (re.compile(r"(?i)(?:.*[/_.\s])?(?:m|mins?|minutes?|minuten?)"), 60.0, 60.0),
    (re.compile(r"(?i)(?:.*[/_.\s])?(?:s|secs?|seconds?|sekunden?|secondes?)"), 1.0, 61.0),
)
_STEPS = re.compile(r"(?i)d_?t|delta[_ ]?t(?:ime)?|time[_ ]?step|dtime|loop[_ ]?time|(?:sample[_ ]?)?interval")
_INTERVAL = re.compile(r"(?i)\w+[_ ]interval")  # of steps only where a unit is written: some count in tens of ms
_BARE = re.compile(r"\s*[\[(<{][^\])>}]*[\])>}]\s*$")


def is_increasing(values: Array, *, named: bool = False) -> bool:
    """Return whether numbers go on like the stamps of a clock, also of a coarse one that rows share.

    What is not ``named`` a clock has to have more such stamps: a command that rises in steps has a few.
    """
    steps = np.diff(values)
    if not steps.size or float(np.mean(steps >= 0)) <= MIN_INCREASING:
        return False
    several = named or np.count_nonzero(steps) > MIN_STAMPS
    return float(np.mean(steps > 0)) > MIN_MOVING or bool(several and spread_stamps(values) is not values)


def counts_rows(column: Column) -> bool:
    """Return whether a column only counts rows, which tells no time."""
    return bool(np.all(np.diff(column.finite_values) == 1.0))


def computed_clocks(columns: Sequence[Column]) -> list[Column]:
    """Return the clock that several columns, or steps of time, make together; nothing where they make none."""
    return [*_with_fraction(columns), *_of_parts(columns), *_of_digits(columns), *_of_steps(columns)][:1]


def _with_fraction(columns: Sequence[Column]) -> Iterator[Column]:
    """Yield whole seconds, or stamps in whole seconds, with the fraction of a second that stands in another column.

    A fraction begins anew at each second and rises in between, whatever it is called: the second that it begins anew
    with goes on by as much as its own steps lead to expect only in the unit that it counts in.
    """
    for seconds in columns:
        if not _is_whole(seconds.values) or seconds.where is not None or seconds.computed:
            continue
        for fraction in columns:
            if fraction is seconds or (in_a_second := _fractions_in_a_second(seconds.values, fraction)) is None:
                continue
            values = seconds.values + fraction.values / in_a_second
            if is_increasing(values[np.isfinite(values)]):
                text = f"{_quoted(seconds)} + {1 / in_a_second:g} * {_quoted(fraction)}"
                yield Column(text, "time", "s", values, computed=True)


def _fractions_in_a_second(seconds: Array, fraction: Column) -> float | None:
    """Return how many steps of a fraction make a second; None where it is no fraction of these seconds."""
    both = np.isfinite(seconds) & np.isfinite(fraction.values)
    whole, part = seconds[both], fraction.values[both]
    if part.size < 2 or part.min() < 0 or not np.ptp(part):
        return None
    ticks, steps = np.diff(whole), np.diff(part)
    inside, at_ticks = steps[ticks == 0], ticks == 1
    wraps = 1 if _FRACTION.search(fraction.name) or fraction.unit in ("ms", "us", "ns") else MIN_WRAPS
    if inside.size < wraps or np.count_nonzero(at_ticks) < wraps or float(np.mean(inside > 0)) < MIN_INCREASING:
        return None
    usual = float(np.median(inside))
    wanted = float(np.median((usual - steps[at_ticks]) / ticks[at_ticks]))
    nearest = min(FRACTIONS, key=lambda one: abs(one - wanted))
    return nearest if part.max() < nearest and abs(nearest - wanted) < max(0.02 * nearest, usual) else None


def _of_parts(columns: Sequence[Column]) -> Iterator[Column]:
    """Yield the time of day of hours, minutes and seconds in columns of their own."""
    found: list[tuple[Column, float]] = []
    for pattern, size, limit in _PARTS:
        fitting = [one for one in columns if _is_name(pattern, one) and one.unit in ("", "h", "min", "s", "m")]
        fitting = [
            one
            for one in fitting
            if one.finite_values.size and 0 <= one.finite_values.min() <= one.finite_values.max() < limit
        ]
        found += [(one, size) for one in fitting[:1]]
    if len(found) < 2 or found[-1][1] != 1.0:
        return
    values = np.sum([size * one.values for one, size in found], axis=0)
    if is_increasing(values[np.isfinite(values)]):
        text = " + ".join(_quoted(one) if size == 1.0 else f"{size:g} * {_quoted(one)}" for one, size in found)
        yield Column(text, "time", "s", values, computed=True)


def _of_digits(columns: Sequence[Column]) -> Iterator[Column]:
    """Yield the time of day of numbers such as 91557.25, for 09:15:57.25: each minute begins 40 after the last."""
    for one in columns:
        known = one.finite_values
        if (
            one.unit not in ("", "s")
            or one.where is not None
            or not known.size
            or not 0 <= known.min() <= known.max() < 240_000
        ):
            continue
        minutes, hours = np.floor(one.values / 100), np.floor(one.values / 10_000)
        values = one.values - 40 * minutes - 2400 * hours
        over = np.diff(minutes[np.isfinite(minutes)]) > 0
        within = np.all(known % 100 < 60) and np.all(known // 100 % 100 < 60)
        if within and over.any() and is_increasing(known) and np.all(np.diff(known)[over] >= 40):
            at = _quoted(one)
            yield Column(
                f"{at} - 40 * floor({at} / 100) - 2400 * floor({at} / 10000)", "time", "s", values, computed=True
            )


def _of_steps(columns: Sequence[Column]) -> Iterator[Column]:
    """Yield the sum of a column of time steps, where no column rises like a clock."""
    if any(_is_clock(column) for column in columns):
        return
    for steps in columns:
        known = steps.finite_values
        called = _is_name(_STEPS, steps) or (steps.unit and _is_name(_INTERVAL, steps))
        if not called or not known.size or known.min() < 0 or np.median(known) <= 0:
            continue
        spread = float(np.median(np.abs(known - np.median(known))) / np.median(known))
        if spread < MAX_STEP_SPREAD and not is_increasing(known):
            values = np.cumsum(np.nan_to_num(steps.values))
            yield replace(steps, key=f"cumsum({_quoted(steps)})", name="time", values=values, computed=True)


def paired_clocks(columns: Sequence[Column]) -> list[Column]:
    """Return the columns, each with a clock of its own, where several clocks do not tell one time.

    A clock that is called after a column is that column's, else it is that of the columns behind it.
    """
    at = [n for n, column in enumerate(columns) if _is_clock(column) and not column.computed]
    apart = [n for n in at if n == at[0] or not _tells_same(columns[at[0]], columns[n])]
    if len(apart) < 2:
        return list(columns)
    called = {stem: n for n in at if (stem := _stem(columns[n].name))}
    named = {n: called[_stem(one.name)] for n, one in enumerate(columns) if n not in at and _stem(one.name) in called}
    behind = [n for n in apart if n == at[0] or n - 1 not in at]
    if not named and (len(behind) < 2 or at[0] != 0):
        return list(columns)
    found = []
    for n, column in enumerate(columns):
        clock = columns[named.get(n, max((one for one in behind if one <= n), default=at[0]))]
        found.append(column if n in at else replace(column, clock=clock.key))
    return found


def _stem(name: str) -> str:
    """Return a name without its unit, words of time and of values, and what is no letter or digit."""
    plain = _BARE.sub("", name).strip()
    return re.sub(r"[\W_]+", "", _TIME_WORDS.sub("", plain)).lower()


_TIME_WORDS = re.compile(r"(?i)time[\s_]*stamps?|(?<![a-z])(?:times?|zeit|stamps?|t|value[xy]?|val|wert)(?![a-z])")


def repeated_clocks(columns: Sequence[Column]) -> set[int]:
    """Return the positions of clocks that only tell the time of an earlier one again: they are no signals."""
    at = [n for n, column in enumerate(columns) if _is_clock(column)]
    return {n for n in at[1:] if _tells_same(columns[at[0]], columns[n])}


def _tells_same(first: Column, other: Column) -> bool:
    """Return whether two clocks are in one line over the same rows."""
    both = np.isfinite(first.values) & np.isfinite(other.values)
    if not np.array_equal(np.isfinite(first.values), np.isfinite(other.values)) or np.count_nonzero(both) < 3:
        return False
    a, b = first.values[both], other.values[both]
    slope, offset = np.polyfit(a - a[0], b - b[0], 1)
    return bool(np.abs(b - b[0] - slope * (a - a[0]) - offset).max() < SAME_CLOCK * max(float(np.ptp(b)), 1e-300))


def may_be_clock(column: Column) -> bool:
    """Return whether a column is called like a clock, or is in a unit of time."""
    if column.unit:
        return column.unit in ("s", "ms", "us", "ns", "min", "h", "d")
    return read_name(column, False).has(NOUNS["time"])


def _is_clock(column: Column) -> bool:
    return may_be_clock(column) and column.where is None and is_increasing(column.finite_values, named=True)


def _is_name(pattern: re.Pattern[str], column: Column) -> bool:
    return pattern.fullmatch(_BARE.sub("", column.name).strip().rpartition("/")[2]) is not None


def _is_whole(values: Array) -> bool:
    known = values[np.isfinite(values)]
    return bool(known.size) and bool(np.all(known == np.floor(known))) and bool(np.all(np.diff(known) >= 0))


def _quoted(column: Column) -> str:
    return f"`{column.key}`"
