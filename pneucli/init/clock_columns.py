"""Part of ``init``: the columns that hold stamps, or parts of stamps, and which columns they belong to.

The unit of a clock that says none is guessed, and a CHECK unless two things agree.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pneucli.arrays import Array
from pneucli.init.column_names import NOUNS, read_name
from pneucli.init.survey_types import Column, UnitGuess
from pneucli.io.clock import CounterClock, spread_stamps
from pneucli.io.column_reader import SAME_RATE, stated_period
from pneucli.io.expression import Expression
from pneucli.messages.formatting import format_plain
from pneucli.units import parse_unit, same_dimension

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


def goes_on_evenly(column: Column) -> bool:
    """Return whether a column in no unit rises by the same each row, and counts no rows."""
    steps = np.diff(CounterClock().unwrap(column.finite_values))
    is_even = bool(np.ptp(steps) <= 0.01 * steps[0])
    return is_even and not counts_rows(column) and not _BARE.search(column.name) and suits_a_clock(column)


def suits_a_clock(column: Column) -> bool:
    """Return whether numbers are those of a clock of recordings in some unit."""
    values = CounterClock().unwrap(column.finite_values)
    period, length = float(np.median(np.diff(values))), float(np.ptp(values))
    if epoch_counter(values) or not period:
        return True
    slow = [*SLOW_UNITS.values()]
    return bool(
        _plausible(period, length)
        or [*_date_votes(values, period)]
        or any(RATES[0] <= 1.0 / (period * factor) for factor in slow)
    )


def counts_rows(column: Column) -> bool:
    """Return whether a column only counts rows, which tells no time."""
    return bool(np.all(np.diff(column.finite_values) == 1.0))


def computed_clocks(columns: Sequence[Column]) -> list[Column]:
    """Return the clock that several columns, or steps of time, make together; nothing where they make none."""
    for text in (*_with_fraction(columns), *_of_parts(columns), *_of_digits(columns)):
        if (found := computed_column(text, "time", "s", columns)) and is_increasing(found[0].finite_values):
            return found
    return [*_of_steps(columns)][:1]


def computed_column(text: str, name: str, unit: str, columns: Sequence[Column]) -> list[Column]:
    """Return the column that an expression over others gives; nothing where their names are none for expressions."""
    try:
        values = Expression(text).values({one.key: one.values for one in columns})
    except (ValueError, KeyError):
        return []
    return [Column(text, name, unit, values, computed=True)]


def _with_fraction(columns: Sequence[Column]) -> Iterator[str]:
    """Yield whole seconds, or stamps in whole seconds, with the fraction of a second that stands in another column.

    A fraction begins anew at each second and rises in between, whatever it is called: the second that it begins anew
    with goes on by as much as its own steps lead to expect only in the unit that it counts in.
    """
    for seconds in columns:
        if not _is_whole(seconds.values) or seconds.where is not None or seconds.computed:
            continue
        for fraction in columns:
            if fraction is not seconds and (in_a_second := _fractions_in_a_second(seconds.values, fraction)):
                yield f"{_quoted(seconds)} + {1 / in_a_second:g} * {_quoted(fraction)}"


def _fractions_in_a_second(seconds: Array, fraction: Column) -> float | None:
    """Return how many steps of a fraction make a second; None where it is no fraction of these seconds."""
    both = np.isfinite(seconds) & np.isfinite(fraction.values)
    both[1:] &= (np.diff(seconds) != 0) | (np.diff(fraction.values) != 0)  # several rows may share a stamp
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


def _of_parts(columns: Sequence[Column]) -> Iterator[str]:
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
    if len(found) > 1 and found[-1][1] == 1.0:
        yield " + ".join(_quoted(one) if size == 1.0 else f"{size:g} * {_quoted(one)}" for one, size in found)


def _of_digits(columns: Sequence[Column]) -> Iterator[str]:
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
        over = np.diff(np.floor(known / 100)) > 0
        within = np.all(known % 100 < 60) and np.all(known // 100 % 100 < 60)
        if within and over.any() and is_increasing(known) and np.all(np.diff(known)[over] >= 40):
            at = _quoted(one)
            yield f"{at} - 40 * floor({at} / 100) - 2400 * floor({at} / 10000)"


def _of_steps(columns: Sequence[Column]) -> Iterator[Column]:
    """Yield the sum of a column of time steps, where no column rises like a clock."""
    if any(_is_clock(column) for column in columns):
        return
    for steps in columns:
        known, said = steps.finite_values, read_name(steps, False)
        unit = steps.unit or said.unit
        called = _STEPS.fullmatch(" ".join(said.words)) or (steps.unit and _is_name(_INTERVAL, steps))
        if not called or not known.size or known.min() < 0 or np.median(known) <= 0:
            continue
        spread = float(np.median(np.abs(known - np.median(known))) / np.median(known))
        if spread < MAX_STEP_SPREAD and not is_increasing(known):
            found = computed_column(f"cumsum({_quoted(steps)})", "time", unit, columns)
            yield from (replace(one, scale=steps.scale) for one in found)


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


CLOCK_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
SLOW_UNITS = {"min": 60.0, "h": 3600.0, "d": 86_400.0}
RATES = (0.05, 1e5)  # Hz, of loggers on rigs: from a digitised figure to a fast oscilloscope
ODD_RATES = (1e-3, 1e7)  # Hz: slower, or faster, the unit is another one
DURATIONS = (0.05, 1e6)  # s, of recordings: from one step of a valve to a week
YEARS = (946_684_800.0, 3.0e9)  # s since 1970: from 2000 to 2065; later numbers are those of clocks since 1904
DAYS = ((36_526.0, 58_804.0), (730_486.0, 752_764.0))  # from 2000 to 2060, of Excel since 1900 and MATLAB since year 0
_WORDS = (
    (re.compile(r"(?i)milli|msec|(?<![a-z])ms(?![a-z])"), "ms"),
    (re.compile(r"(?i)micro|usec|µsec|(?<![a-z])[uµ]s(?![a-z])"), "us"),
    (re.compile(r"(?i)nano|nsec|(?<![a-z])ns(?![a-z])"), "ns"),
    (re.compile(r"(?i)(?<![a-z])(?:sec|secs|seconds?|sekunden?|s)(?![a-z])"), "s"),
    (re.compile(r"(?i)minutes?(?![a-z])|(?<![a-z])mins?(?![a-z])"), "min"),
    (re.compile(r"(?i)(?<![a-z])(?:days?|datenum)(?![a-z])"), "d"),
)
AGREE = 2.0  # things that speak for a unit without a doubt


class Vote(NamedTuple):
    """A unit that a clock may be in, and why; one of less than a whole vote decides where nothing else speaks."""

    unit: str
    why: str
    weight: float = 1.0


def guess_clock_unit(column: Column, columns: Sequence[Column], scalars: Mapping[str, float]) -> UnitGuess:
    """Return the unit that the stamps of a clock are in, and why; with CHECK where only one thing speaks for it.

    People have to say it of numbers that go on by one: these are samples, ms or s.
    """
    values = CounterClock().unwrap(column.finite_values)
    steps = np.diff(values)
    steps = steps[steps > 0]
    if not steps.size:
        return UnitGuess("s", "CHECK no unit is stated, and the stamps do not tell one: taken for s")
    period, length = float(np.median(np.diff(values))) or float(np.median(steps)), float(np.ptp(values))
    votes = [*_votes(column, columns, scalars, period, length)]
    count = {one.unit: sum(own.weight for own in votes if own.unit == one.unit) for one in votes}
    if not count:
        suits = f"a sample every {format_plain(period, 4)} suits none"
        return UnitGuess("s", f"CHECK no unit is stated, and {suits}: taken for s")
    best = max(count, key=lambda unit: count[unit])
    factor = (CLOCK_UNITS | SLOW_UNITS)[best]
    rate = f"a sample every {format_plain(period, 4)} is taken for {format_plain(1 / (period * factor), 4)} Hz"
    is_likelier = count[best] < 1.0
    why = " and ".join(dict.fromkeys(one.why for one in votes if one.unit == best and (is_likelier or one.weight == 1)))
    others = [unit for unit in count if unit != best]
    if count[best] >= AGREE and (not others or count[best] > 2 * max(count[unit] for unit in others)):
        return UnitGuess(best, f"{best}: {why}")
    doubt = f"; {', '.join(others)} is as likely" if others and count[others[0]] == count[best] else ""
    if is_likelier:
        rates = {unit: 1 / (period * CLOCK_UNITS[unit]) for unit in _plausible(period, length) if unit != best}
        doubt = f" ({', '.join(f'in {unit} {format_plain(own, 4)} Hz' for unit, own in rates.items())})"
    asked = is_likelier and counts_rows(column)
    return UnitGuess(best, f"CHECK no unit is stated: {rate}, as {why}{doubt}", asked)


def unusual_rate(seconds: Array) -> str:
    """Return a doubt where stamps in s, in a stated unit, give a rate that no recording of a rig has; else nothing."""
    steps = np.diff(seconds)
    period = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 1.0
    if ODD_RATES[0] < 1.0 / period < ODD_RATES[1]:
        return ""
    return f"CHECK the unit of the clock: a sample every {format_plain(period, 3)} s"


def _votes(
    column: Column, columns: Sequence[Column], scalars: Mapping[str, float], period: float, length: float
) -> Iterator[Vote]:
    values = column.finite_values
    for pattern, unit in _WORDS:
        if pattern.search(column.name):
            yield Vote(unit, "its name says so")
            break
    yield from _date_votes(values, period)
    yield from _second_clock_votes(column, columns)
    if (stated := stated_period(scalars)) is not None:
        near = [u for u, factor in CLOCK_UNITS.items() if abs(period * factor / stated[1] - 1.0) < SAME_RATE]
        yield from (Vote(unit, f'"{stated[0]}" of the file says so') for unit in near)
    plausible = _plausible(period, length)
    if len(plausible) == 1:
        yield Vote(plausible[0], "no other unit gives a rate and a duration of recordings")
    elif plausible and values.size:
        usual = next((unit for unit in plausible if period * CLOCK_UNITS[unit] < 0.6), plausible[0])
        yield Vote(usual, "it is the likelier of several units", 0.5)


def _plausible(period: float, length: float) -> list[str]:
    return [
        unit
        for unit, factor in CLOCK_UNITS.items()
        if RATES[0] <= 1.0 / (period * factor) <= RATES[1] and DURATIONS[0] <= length * factor <= DURATIONS[1]
    ]


def _date_votes(values: Array, period: float) -> Iterator[Vote]:
    """Yield twice a unit in which the stamps are dates of this century: by the dates, and by the rate that it gives."""
    first = float(values[0])
    for unit, factor in CLOCK_UNITS.items():
        if YEARS[0] < first * factor < YEARS[1] and RATES[0] <= 1.0 / (period * factor) <= RATES[1]:
            yield Vote(unit, "only so the stamps are dates of this century, counted from 1970")
            yield Vote(unit, "the rate is one of recordings")
    is_day = any(low < first < high for low, high in DAYS)
    if is_day and np.any(values != np.floor(values)) and RATES[0] <= 1.0 / (period * 86_400.0) <= RATES[1]:
        yield Vote("d", "only so the stamps are dates of this century, as Excel and MATLAB count days")
        yield Vote("d", "the rate is one of recordings")


def epoch_counter(values: Array) -> tuple[str, float, str] | None:
    """Return unit, scale and name of stamps that count dates of this century in steps of their own; else None."""
    first = float(values[0]) if values.size else 0.0
    parts = bool(np.any(values != np.floor(values)))
    found = (row for row in _COUNTERS if row[0] < first < row[1] and (row[2] or parts))
    return next((row[3:] for row in found), None)


_COUNTERS = (  # first and last stamp, whether in whole numbers, unit, scale, what it is
    (1e6 * DAYS[0][0], 1e6 * DAYS[0][1], False, "d", 1e-6, "millionths of a day, as WinCC writes Time_ms"),
    (1.26e17, 1.46e17, True, "ns", 100.0, "100 ns since 1601, as Windows and TwinCAT count"),
    (6.3e17, 6.5e17, True, "ns", 100.0, "100 ns since the year 1, as .NET counts"),
)


def _second_clock_votes(column: Column, columns: Sequence[Column]) -> Iterator[Vote]:
    """Yield the unit in which this clock goes as fast as another one whose unit is known, or the only possible."""
    own = column.values
    for other in columns:
        if other is column or other.values.size != own.size or not is_increasing(other.finite_values):
            continue
        if not _tells_same(column, other):
            continue
        a, b = column.finite_values, other.finite_values
        known = [other.unit] if other.unit and same_dimension(other.unit, "s") else _of_clock(other)
        for unit in known:
            factor = parse_unit(unit).factor * float(np.ptp(b) / np.ptp(a))
            near = [one for one, size in (CLOCK_UNITS | SLOW_UNITS).items() if abs(factor / size - 1.0) < SAME_RATE]
            yield from (Vote(one, f'"{other.name}" goes as fast') for one in near)
        if known:
            return


def _of_clock(other: Column) -> list[str]:
    """Return the only unit in which another clock gives a rate and a duration of recordings; empty where it is none."""
    if not re.search(r"(?i)time|zeit|clock|stamp|(?<![a-z])t(?![a-z])", other.name):
        return []
    values = other.finite_values
    found = _plausible(float(np.median(np.diff(values))) or np.inf, float(np.ptp(values)))
    return found if len(found) == 1 else []
