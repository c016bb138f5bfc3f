"""Part of ``init``: the unit of a clock that says none. A guess is a CHECK unless two things agree."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from pneucli.arrays import Array
from pneucli.init.clock_columns import is_increasing
from pneucli.init.survey_types import Column
from pneucli.io.clock_repairs import CounterClock
from pneucli.messages.formatting import format_plain
from pneucli.units import parse_unit, same_dimension

CLOCK_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
SLOW_UNITS = {"min": 60.0, "h": 3600.0, "d": 86_400.0}
RATES = (0.05, 1e5)  # Hz, of loggers on rigs: from a digitised figure to a fast oscilloscope
ODD_RATES = (1e-3, 1e7)  # Hz: slower, or faster, the unit is another one
DURATIONS = (0.05, 1e6)  # s, of recordings: from one step of a valve to a week
SAME = 0.02  # by which two statements of one rate may differ
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
_RATE_NAMES = re.compile(r"(?i)^(?:fs|f_s|fsample|rate|(?:sample|sampling|scan|data)[ _]?(?:rate|frequency|freq))\b")
_PERIOD_NAMES = re.compile(
    r"(?i)^(?:ts|t_s|dt|delta_?[tx]|tsample|sample[ _]?time|(?:x[ _]?)?increment|h_?resolution|"
    r"(?:sampl(?:e|ing)[ _]?)?(?:interval|period))\b"
)
Vote = tuple[str, str]  # unit, and why
AGREE = 2.0  # things that speak for a unit without a doubt
LIKELIER = "it is the likelier of several units"  # decides where nothing else speaks, and counts for nothing else


def guess_clock_unit(column: Column, columns: Sequence[Column], scalars: Mapping[str, float]) -> tuple[str, str]:
    """Return the unit that the stamps of a clock are in, and why; with CHECK where only one thing speaks for it."""
    values = CounterClock().unwrap(column.finite_values)
    steps = np.diff(values)
    steps = steps[steps > 0]
    if not steps.size:
        return "s", "CHECK no unit is stated, and the stamps do not tell one: taken for s"
    period, length = float(np.median(np.diff(values))) or float(np.median(steps)), float(np.ptp(values))
    votes = [*_votes(column, columns, scalars, period, length)]
    count = {one: sum(_weight(why) for unit, why in votes if unit == one) for one, _ in votes}
    if not count:
        return "s", f"CHECK no unit is stated, and a sample every {format_plain(period, 4)} suits none: taken for s"
    best = max(count, key=lambda unit: count[unit])
    factor = (CLOCK_UNITS | SLOW_UNITS)[best]
    rate = f"a sample every {format_plain(period, 4)} is taken for {format_plain(1 / (period * factor), 4)} Hz"
    reasons = dict.fromkeys(reason for unit, reason in votes if unit == best)
    why = " and ".join([one for one in reasons if one != LIKELIER] or reasons)
    others = [unit for unit in count if unit != best]
    if count[best] >= AGREE and (not others or count[best] > 2 * max(count[unit] for unit in others)):
        return best, f"{best}: {why}"
    doubt = f"; {', '.join(others)} is as likely" if others and count[others[0]] == count[best] else ""
    return best, f"CHECK no unit is stated: {rate}, as {why}{doubt}"


def unusual_rate(seconds: Array) -> str:
    """Return a doubt where stamps in s, in a stated unit, give a rate that no recording of a rig has; else nothing."""
    steps = np.diff(seconds)
    period = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 1.0
    if ODD_RATES[0] < 1.0 / period < ODD_RATES[1]:
        return ""
    return f"CHECK the unit of the clock: a sample every {format_plain(period, 3)} s"


def _weight(why: str) -> float:
    return 0.5 if why == LIKELIER else 1.0


def stated_period(scalars: Mapping[str, float]) -> tuple[str, float] | None:
    """Return what single values say of the time between two samples (s), with the name that says it; None: nothing."""
    for name, value in scalars.items():
        plain = name.rpartition("/")[2].strip()
        if value > 0 and (_RATE_NAMES.match(plain) or _PERIOD_NAMES.match(plain)):
            return name, 1.0 / value if _RATE_NAMES.match(plain) else value
    return None


def is_rate(name: str) -> bool:
    """Return whether a single value of this name is a rate, and no time between samples."""
    return _RATE_NAMES.match(name.rpartition("/")[2].strip()) is not None


def _votes(
    column: Column, columns: Sequence[Column], scalars: Mapping[str, float], period: float, length: float
) -> Iterator[Vote]:
    values = column.finite_values
    for pattern, unit in _WORDS:
        if pattern.search(column.name):
            yield unit, "its name says so"
            break
    yield from _date_votes(values, period)
    yield from _second_clock_votes(column, columns)
    if (stated := stated_period(scalars)) is not None:
        near = [u for u, factor in CLOCK_UNITS.items() if abs(period * factor / stated[1] - 1.0) < SAME]
        yield from ((unit, f'"{stated[0]}" of the file says so') for unit in near)
    plausible = _plausible(period, length)
    if len(plausible) == 1:
        yield plausible[0], "no other unit gives a rate and a duration of recordings"
    elif plausible and values.size:
        usual = next((unit for unit in plausible if period * CLOCK_UNITS[unit] < 0.6), plausible[0])
        yield usual, LIKELIER


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
            yield unit, "only so the stamps are dates of this century, counted from 1970"
            yield unit, "the rate is one of recordings"
    is_day = any(low < first < high for low, high in DAYS)
    if is_day and np.any(values != np.floor(values)) and RATES[0] <= 1.0 / (period * 86_400.0) <= RATES[1]:
        yield "d", "only so the stamps are dates of this century, as Excel and MATLAB count days"
        yield "d", "the rate is one of recordings"


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
        both = np.isfinite(own) & np.isfinite(other.values)
        a, b = own[both], other.values[both]
        if a.size < 3 or not np.ptp(a) or abs(np.corrcoef(a - a[0], b - b[0])[0, 1]) < 0.9999:
            continue
        known = [other.unit] if other.unit and same_dimension(other.unit, "s") else _of_clock(other)
        for unit in known:
            factor = parse_unit(unit).factor * float(np.ptp(b) / np.ptp(a))
            near = [one for one, size in (CLOCK_UNITS | SLOW_UNITS).items() if abs(factor / size - 1.0) < SAME]
            yield from ((one, f'"{other.name}" goes as fast') for one in near)
        if known:
            return


def _of_clock(other: Column) -> list[str]:
    """Return the only unit in which another clock gives a rate and a duration of recordings; empty where it is none."""
    if not re.search(r"(?i)time|zeit|clock|stamp|(?<![a-z])t(?![a-z])", other.name):
        return []
    values = other.finite_values
    found = _plausible(float(np.median(np.diff(values))) or np.inf, float(np.ptp(values)))
    return found if len(found) == 1 else []
