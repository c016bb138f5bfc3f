"""The one clock of all formats: stamps, in whatever a file has them, to seconds since the first, and when that was.

Stamps are texts, times and dates of Arrow, or calendar time of NumPy. Of numbers only certain repairs are made: a
counter that wraps goes on, and stamps that are coarser than the sampling period are spread.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from itertools import chain
from typing import Any

import numpy as np
import pyarrow as pa
from dateutil import parser

from pneucli.arrays import Array, Indices
from pneucli.io import arrow_compute as pc
from pneucli.io.raw_file import Batch, ColumnValues, Repair, joined
from pneucli.messages.formatting import format_plain

_MONTH = r"[^\s\d.,:;/-]{3,10}\.?"
_DATE = (
    rf"\d{{4}}-W\d\d-\d|\d{{4}}-\d{{3}}|\d{{1,4}}[-./]\d{{1,2}}[-./]\d{{1,4}}|\d{{1,2}}\.?[- ]{_MONTH}[- ]\d{{2,4}}|"
    rf"{_MONTH} \d{{1,2}},? \d{{4}}"
)
_DAY = rf"(?P<day>{_DATE})"
_PATTERN = (
    rf"^\s*(?:{_DAY}(?:[T,]|\s)\s*)?"
    r"(?:(?P<hour>\d{1,2}):(?P<minute>\d{2})(?::(?P<second>\d{2}(?:[.,:;]\d+)?))?|"
    r"(?P<minutes>\d{1,2}):(?P<seconds>\d{2}[.,]\d+))\s*(?P<half>[AaPp]\.? ?[Mm]\.?)?"
    r"\s*(?P<zone>Z|[A-Z]{3,4}|[+-]\d{2}(?::?\d{2})?)?\s*$"
)
_STAMP = re.compile(_PATTERN)
_FIELDS = ("day", "hour", "minute", "second", "minutes", "seconds", "half", "zone")
_ONLY_DATE = re.compile(rf"\s*(?:{_DATE})\s*")
_COMPACT = r"^\s*((?:19|20)\d\d)([01]\d)([0-3]\d)[T_ -]?([0-2]\d):?([0-5]\d):?([0-5]\d)"
_SPELLINGS = (  # of stamps, and what is read in their place
    (r"^\s*(?:L?DT|L?TOD|DATE_AND_TIME|TIME_OF_DAY)#", ""),  # IEC 61131-3
    (r"^(\d{4})[-_](\d\d)[-_](\d\d)[-_T ](\d\d)[-_](\d\d)[-_](\d\d)[._](\d+)$", r"\1-\2-\3 \4:\5:\6.\7"),
    (r"^(\d{4}[-/]\d{1,2}[-/]\d{1,2})-(\d)", r"\1 \2"),
    (r"UTC([+-]\d)", r"\1"),
    (r"^(.*)(?:上午|午前|오전) ?(.+)$", r"\1\2 AM"),
    (r"^(.*)(?:下午|午後|오후) ?(.+)$", r"\1\2 PM"),
    (r"^(?:(\d{4}[-.]\d\d[-.]\d\d)[-T ])?(\d\d)\.(\d\d)\.(\d\d\.\d+)$", r"\1 \2:\3:\4"),
    (r"^[A-Z][a-z]{2},? ([A-Z][a-z]{2}) +(\d{1,2}) (\d\d:\d\d:\d\d(?:\.\d+)?) (\d{4})$", r"\2 \1 \4 \3"),  # of C
    (r"^(\d+)h ?(\d+)m(?:in)? ?(\d+(?:\.\d+)?)s$", r"PT\1H\2M\3S"),
    (_COMPACT + r"(\d{3}|\d{6}|\d{9})$", r"\1-\2-\3 \4:\5:\6.\7"),
    (_COMPACT + r"($|[^\d])", r"\1-\2-\3 \4:\5:\6\7"),
    (r"^\s*(\d{4})[:-](\d{3})[:/T ](\d\d:\d\d)", r"\1-\2 \3"),  # a year and its day
    (r"^\s*(\d+)(?:\.| ?d(?:ays?)?,? ?| )(\d{1,2}):(\d\d):(\d\d(?:\.\d+)?)$", r"P\1DT\2H\3M\4S"),  # of .NET, pandas
)
_SPANS = {"d": 86_400.0, "h": 3600.0, "m": 60.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # s
_PARTS = "T?".join(rf"(?:(?P<{unit}>\d+(?:\.\d+)?){unit}_?)?" for unit in _SPANS)
_SPAN = rf"(?i)^\s*(?:(?:L?T|L?TIME)#|P)(?:{_PARTS})\s*$"  # T#5s10ms of IEC 61131-3, PT5.01S of ISO 8601
_IS_SPAN = re.compile(_SPAN)
_DAYS_BEFORE = r"^\s*(\d+) days?, ?"  # as Python writes durations


_MONTHS = {  # the first letters of months as they are not in English
    **dict.fromkeys(("jän", "ene", "gen"), "Jan"),
    **dict.fromkeys(("fév", "fev"), "Feb"),
    **dict.fromkeys(("mär", "mrz", "mae", "maa", "mrt"), "Mar"),
    **dict.fromkeys(("avr", "abr"), "Apr"),
    **dict.fromkeys(("mai", "mei", "maj", "mag"), "May"),
    **dict.fromkeys(("juin", "giu"), "Jun"),
    **dict.fromkeys(("juil", "lug"), "Jul"),
    **dict.fromkeys(("aoû", "aou", "ago"), "Aug"),
    **dict.fromkeys(("set",), "Sep"),
    **dict.fromkeys(("okt", "ott"), "Oct"),
    **dict.fromkeys(("dez", "déc", "dic"), "Dec"),
}
SECONDS_PER_DAY, SECONDS_PER_HOUR = 86_400.0, 3600.0  # s


def is_date_or_time(text: str) -> bool:
    """Return whether ``text`` is a time of day, with or without its date, or a duration as T#5s10ms."""
    plain = _spelled_out(text)
    return _STAMP.match(plain) is not None or _is_span(plain)


def _is_span(text: str) -> bool:
    found = _IS_SPAN.match(text)
    return found is not None and any(found.groups())


def _spelled_out(text: str) -> str:
    for spelling, plain in _SPELLINGS:
        text = re.sub(spelling, plain, text)
    return text


def is_date(text: str) -> bool:
    """Return whether ``text`` is a date without a time of day."""
    if not _ONLY_DATE.fullmatch(text):
        return False
    try:
        return 1900 < _parse_date(text, day_first=True).year < 2200
    except ValueError:
        return False


def has_date(text: str) -> bool:
    """Return whether ``text`` is a time of day with its date."""
    found = _STAMP.match(_spelled_out(text))
    return bool(found and found["day"])


class Clock:
    """Turns the texts of one column into seconds, batch by batch; ``start`` is the first stamp, if it has a date.

    Of day and month the one comes first that makes the shorter recording. A clock without dates
    goes on after midnight. Offsets from UTC count, so that a change of summer time is none of the clock.
    """

    def __init__(self) -> None:
        self._first: float | None = None  # s, of the first stamp since its own midnight
        self._day = ""  # of the first stamp
        self._day_first: bool | None = None  # None as long as nothing tells
        self._last = -np.inf
        self._midnights = 0.0
        self._round = SECONDS_PER_DAY  # s, after which a clock without dates begins anew
        self._zone: float | None = None  # s, of the first stamp, where one is written
        self._stamp: Any = None  # the first one of calendar time

    @property
    def start(self) -> datetime | None:
        """When the clock reads 0, if its stamps have dates; in UTC where the file says so, else as it stands."""
        if self._stamp is not None:
            found = self._stamp.astype("datetime64[us]").item()
        elif self._day and self._first is not None:
            found = _parse_date(self._day, self._day_first is not False)
            found += timedelta(seconds=self._first - (self._zone or 0.0))
        else:
            return None
        return known_start(found if self._zone is None else found.replace(tzinfo=UTC))

    def seconds(self, stamps: Any) -> ColumnValues:
        """Return seconds since the first stamp, NaN where there is none; durations and times of day in s.

        ``stamps`` is an array of Arrow, or calendar time or durations of NumPy. Raises ValueError with the first text
        that is no stamp.
        """
        if isinstance(stamps, np.ndarray):
            return self._of_calendar(stamps)
        if pa.types.is_time(stamps.type):
            return np.asarray(stamps.cast(pa.time64("ns")).cast(pa.int64()).cast(pa.float64()).to_numpy(False)) * 1e-9
        if pa.types.is_temporal(stamps.type):
            self._zone = 0.0 if getattr(stamps.type, "tz", None) else None
            return self._of_calendar(stamps.to_numpy(zero_copy_only=False))
        return self._of_texts(stamps)

    def _of_calendar(self, stamps: ColumnValues) -> ColumnValues:
        if stamps.dtype.kind == "m":
            return np.asarray(stamps / np.timedelta64(1, "s"), dtype=np.float64)
        valid = np.flatnonzero(~np.isnat(stamps))
        if self._stamp is None and valid.size:
            self._stamp = stamps[valid[0]]
        first = np.datetime64("NaT") if self._stamp is None else self._stamp
        return np.asarray((stamps - first) / np.timedelta64(1, "s"), dtype=np.float64)

    def _of_texts(self, texts: Any) -> ColumnValues:
        if pc.any(pc.match_substring_regex(texts, _DAYS_BEFORE)).as_py():  # none before the first day is over
            texts = pc.replace_substring_regex(texts, rf"(?:{_DAYS_BEFORE})?(\d+):(\d\d):(\d\d.*)$", r"P0\1DT\2H\3M\4S")
            since = _seconds_of_spans(pc.extract_regex(texts, _SPAN))
            return since if self._first is None else since - self._first
        known = next((text for text in texts.to_pylist() if text), "")
        for spelling, plain in _SPELLINGS if _spelled_out(known) != known else ():
            texts = pc.replace_substring_regex(texts, spelling, plain)
        if _is_span(_spelled_out(known)):
            return _seconds_of_spans(pc.extract_regex(texts, _SPAN))
        parts = pc.extract_regex(texts, _PATTERN)
        lost = pc.and_(pc.is_null(parts), pc.match_substring_regex(texts, r"\d"))  # a word stamps no row
        if pc.any(lost).as_py():
            text = texts.filter(lost)[0].as_py()
            raise ValueError(f'"{text}"')
        field: dict[str, Any] = {name: pc.struct_field(parts, name) for name in _FIELDS}
        hour, minute, second = (_number(field[name]) for name in ("hour", "minute", "second"))
        half = np.array([text[:1].lower() for text in pc.fill_null(field["half"], "").to_pylist()])
        hour = np.where(half != "", hour % 12 + 12 * (half == "p"), hour)
        clock = 3600 * hour + 60 * minute + np.nan_to_num(second)
        within_hour = 60 * _number(field["minutes"]) + _number(field["seconds"])  # as Excel shows 12:34.5
        if np.isfinite(within_hour).any():
            clock, self._round = np.where(np.isfinite(clock), clock, within_hour), SECONDS_PER_HOUR
        stamped = np.flatnonzero(np.isfinite(clock))
        if not stamped.size:
            return np.asarray(clock)
        if self._first is None:
            self._first, self._day = float(clock[stamped[0]]), field["day"][int(stamped[0])].as_py() or ""
        since = self._days(field["day"].dictionary_encode()) if self._day else self._over_midnight(clock, stamped)
        return np.asarray(clock - self._first + since - self._zone_change(field["zone"].dictionary_encode()))

    def _zone_change(self, zones: Any) -> ColumnValues:
        """Return by how many seconds the offset from UTC of each stamp differs from that of the first one."""
        offsets = [_offset(text) for text in zones.dictionary.to_pylist()]
        written = [offset for offset in offsets if offset is not None]
        if self._zone is None and written:
            self._zone = written[0]
        first = self._zone or 0.0
        changes = np.array([*(0.0 if offset is None else offset - first for offset in offsets), 0.0])
        return np.asarray(changes[pc.fill_null(zones.indices, len(offsets)).to_numpy(zero_copy_only=False)])

    def _days(self, days: Any) -> ColumnValues:
        """Return seconds from the first stamp's midnight to that of each stamp."""
        texts = days.dictionary.to_pylist()
        orders = {first: _seconds_since(self._day, texts, first) for first in (True, False)}
        if self._day_first is None and orders[True] != orders[False]:
            self._day_first = bool(np.nanmax(np.abs(orders[True])) < np.nanmax(np.abs(orders[False])))
        values = np.array([*orders[self._day_first is not False], np.nan])
        return np.asarray(values[pc.fill_null(days.indices, len(texts)).to_numpy(zero_copy_only=False)])

    def _over_midnight(self, clock: ColumnValues, known: ColumnValues) -> ColumnValues:
        plain = clock[known]
        steps = np.diff(plain, prepend=self._last if np.isfinite(self._last) else plain[0])
        days = self._midnights + self._round * np.cumsum(steps < -self._round / 2)
        self._last, self._midnights = float(plain[-1]), float(days[-1])
        since = np.full(clock.size, np.nan)
        since[known] = days
        return since


def parse_since(unit: str) -> datetime | None:
    """Return the date of a unit such as ``"milliseconds since 2026-03-11 09:15:02"``; None where it says none."""
    found = SINCE.search(unit)
    if found is None:
        return None
    try:
        return known_start(parser.parse(found[1]))
    except (parser.ParserError, OverflowError):
        return None


def known_start(date: datetime | None) -> datetime | None:
    """Return when a clock reads 0, in UTC where the zone is known; None before 1990, as of a clock that was never set.

    >>> known_start(datetime.fromisoformat("2026-03-11 09:15+01:00")).hour, known_start(datetime(1904, 1, 1))
    (8, None)
    """
    if date is None or date.year < EARLIEST_YEAR:
        return None
    return date if date.tzinfo is None else date.astimezone(UTC)


EARLIEST_YEAR = 1990


SINCE = re.compile(r"(?i)\s+since\s+(.+)$")


def difference_of_starts(first: datetime, other: datetime) -> tuple[float, float]:
    """Return by how many seconds a clock started after another one, and the zone in s that was taken off.

    Where one start is in UTC and the other one in a time of day whose zone is not written, whole quarters of an hour
    between them are that zone.
    """
    seconds = (other.replace(tzinfo=None) - first.replace(tzinfo=None)).total_seconds()
    if (first.tzinfo is None) == (other.tzinfo is None):
        return seconds, 0.0
    zone = QUARTER_HOUR * round(seconds / QUARTER_HOUR)
    return seconds - zone, zone


QUARTER_HOUR = 900.0  # s, of which all zones are multiples


def _offset(text: str | None) -> float | None:
    """Return an offset from UTC in s; None where none is written, or a zone's name alone, such as CET."""
    if not text or text[0].isalpha():
        return 0.0 if text in ("Z", "UTC", "GMT") else None
    hours, minutes = text[1:3], text[3:].strip(":") or "0"
    return (-1.0 if text[0] == "-" else 1.0) * (3600.0 * int(hours) + 60.0 * int(minutes))


def _seconds_of_spans(spans: Any) -> ColumnValues:
    """Return durations in s, NaN where there is none."""
    parts = np.array([one * _number(pc.struct_field(spans, unit)) for unit, one in _SPANS.items()])
    return np.where(np.isfinite(parts).any(axis=0), np.nansum(parts, axis=0), np.nan)


def _number(texts: Any) -> ColumnValues:
    plain = pc.replace_substring_regex(texts, "[,:;]", ".")
    numbers = pc.if_else(pc.equal(plain, ""), pa.scalar(None, pa.string()), plain)
    return np.asarray(numbers.cast(pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64)


def _parse_date(text: str, day_first: bool) -> datetime:
    year_first = re.match(r"\d{4}", text) is not None
    text = re.sub(r"[^\W\d_]{3,}", lambda m: _MONTHS.get(m[0][:4].lower()) or _MONTHS.get(m[0][:3].lower(), m[0]), text)
    try:
        if "-W" in text:
            return datetime.fromisoformat(text)
        if re.fullmatch(r"\d{4}-\d{3}", text):
            return datetime.strptime(text, "%Y-%j")
        found: datetime = parser.parse(text, dayfirst=day_first and not year_first, yearfirst=year_first)
    except (ValueError, OverflowError) as error:
        raise ValueError(f'"{text}"') from error
    return found


def _seconds_since(first: str, texts: list[str | None], day_first: bool) -> list[float]:
    zero = _parse_date(first, day_first)
    return [(_parse_date(text, day_first) - zero).total_seconds() if text else np.nan for text in texts]


LARGEST_DECADE, SMALLEST_DECADE = 2, -9  # of the step of stamps, 10^n s
MAX_ROUNDING = 1e-3  # of that step, by which binary numbers may miss its multiples
MIN_UNEVEN_SHARE = 0.2  # of the period, by which a stamp must miss an even clock to matter
MIN_UNEVEN_STEPS = 8  # fewer are rows that the logger repeated or lost
MAX_SPREAD = 1.25  # steps: an even clock that is cut to steps misses its stamps by up to one, and the line is estimated
MIN_ROWS = 50  # of a run without a gap
MAX_GAP_RATIO = 2.5  # of the usual step between different stamps: a longer one is a gap


@dataclass
class EvenClock:
    """Places rows on the ticks of an even clock, batch by batch; each run of rows without a gap has ticks of its own.

    ``step`` is the step of the stamps in s, ``longest_step`` that between neighbours without a gap; ``rows`` is how
    many rows were placed, ``refused`` how many runs no even clock explains. Whole milliseconds of a controller that
    logs at 2 kHz alternate, and a velocity from them is wrong by as much; where an even clock, read in steps of the
    stamps, explains every stamp, its ticks take their place.
    """

    step: float
    longest_step: float
    rows: int = 0
    refused: int = 0
    _last: float = np.nan  # stamp
    _next_tick: float = np.nan  # of the present run; NaN where it has no ticks yet
    _period: float = np.nan

    @classmethod
    def of(cls, time: Array) -> EvenClock | None:
        """Return the clock of the first stamps in s, shape (n,); None if they are fine, or no even clock has them."""
        if time.size < MIN_ROWS or not np.isfinite(time).all() or np.any(np.diff(time) < 0) or time[0] == time[-1]:
            return None
        step, steps = _step(time), np.diff(time)
        if step is None:
            return None
        longest = max(MAX_GAP_RATIO * float(np.median(steps[steps > 0])), 1.5 * step)
        within = steps[steps <= longest]
        if step < MIN_UNEVEN_SHARE * within.mean() or _uneven_count(within) < MIN_UNEVEN_STEPS:
            return None
        trial = cls(step, longest)
        trial.place(time)
        return None if trial.refused or trial.rows <= 0.5 * time.size else cls(step, longest)

    def place(self, time: Array) -> Array:
        """Return the ticks at which the next rows were recorded, in s; stamps that no even clock explains stay."""
        if not time.size or not np.isfinite(time).all():
            return time
        steps = np.diff(np.concatenate([[self._last], time]))
        runs = np.split(time, np.flatnonzero(~((steps >= 0) & (steps <= self.longest_step))))
        self._last = float(time[-1])
        placed = [self._continued(runs[0])]
        for run in runs[1:]:
            self._next_tick = np.nan
            placed.append(self._continued(run))
        return np.concatenate(placed)

    def _continued(self, stamps: Array) -> Array:
        """Return the ticks of the next rows of the present run: as before where that explains them, or else anew."""
        if not stamps.size:
            return stamps
        k = np.arange(stamps.size)
        ticks = self._next_tick + self._period * k
        if not np.all((ticks - stamps <= MAX_SPREAD * self.step) & (stamps - ticks <= (MAX_SPREAD - 1.0) * self.step)):
            self._next_tick = np.nan
            tells = stamps.size >= MIN_ROWS and _uneven_count(np.diff(stamps)) >= MIN_UNEVEN_STEPS
            period = float(np.cov(k, stamps - stamps[0])[0, 1] / np.var(k, ddof=1)) if tells else self._period
            misses = stamps - stamps[0] - period * k
            if not np.ptp(misses) <= MAX_SPREAD * self.step:
                self.refused += tells
                return stamps
            ticks = stamps[0] + np.max(misses) + period * k  # a stamp tells whole steps that have passed
            self._period = period
        self._next_tick = float(ticks[-1]) + self._period
        self.rows += stamps.size
        return np.asarray(ticks)


def _uneven_count(steps: Array) -> int:
    """Return how many steps differ from the usual one by more than the clock may."""
    usual, period = np.median(steps), np.mean(steps)
    return int(np.count_nonzero(np.abs(steps - usual) > MIN_UNEVEN_SHARE * period))


def _step(time: Array) -> float | None:
    """Return the largest power of ten in s of which all differences of stamps are multiples; None where none is."""
    since_first = time - time[0]
    for decade in range(LARGEST_DECADE, SMALLEST_DECADE - 1, -1):
        multiples = since_first / 10.0**decade
        if np.max(np.abs(multiples - np.round(multiples))) < MAX_ROUNDING:
            return float(10.0**decade)
    return None


# what a counter of stamps counts to, in its own unit: bits; microseconds of 32 bits in ms or s; a day in s, ms, us
COUNTER_PERIODS = (
    *(2.0**16, 2.0**24, 2.0**31, 2.0**32, 2.0**32 / 1e3, 2.0**32 / 1e6),
    *(one * SECONDS_PER_DAY for one in (1.0, 1e3, 1e6)),
)
MAX_WRAP_STEPS = 20.0  # usual steps of the clock, that it may have gone on by where it wraps
MIN_PERIOD_STEPS = 100.0  # usual steps in a period of the counter
MIN_REPEATED_SHARE = 0.5  # of the stamps that repeat the one before: fewer are single faults of the logger
MIN_REGULAR_SHARE = 0.8  # of the runs of equal stamps, that are as long as most of them, within a quarter
MIN_RUNS, MIN_SHARED_ROWS = 2, 16  # whole runs of equal stamps, and rows in all


class CounterClock:
    """Lets a clock whose counter wraps go on, batch by batch; ``count`` is how often it wrapped."""

    def __init__(self) -> None:
        self.count = 0
        self._last = np.nan
        self._added = 0.0

    def unwrap(self, stamps: Array) -> Array:
        """Return raw stamps, in the file's own unit, that go on where the counter wraps."""
        joined = np.concatenate([[self._last], stamps])
        self._last = float(stamps[-1]) if stamps.size and np.isfinite(stamps[-1]) else self._last
        steps = np.diff(joined)
        back = np.flatnonzero(steps < 0)
        forward = steps[steps > 0]
        if (not back.size or not forward.size) and not self._added:
            return stamps
        usual = float(np.median(forward)) if forward.size else 0.0
        added = np.zeros(steps.size)
        for at in back:
            added[at] = _counter_period(-float(steps[at]), usual)
        self.count += int(np.count_nonzero(added))
        total = self._added + np.cumsum(added)
        self._added = float(total[-1]) if total.size else self._added
        return np.asarray(stamps + total)


def _counter_period(backward: float, usual: float) -> float:
    """Return the period of the counter that wrapped; 0 where none explains the step back."""
    near = [
        p for p in COUNTER_PERIODS if 0.0 <= p - backward <= MAX_WRAP_STEPS * usual and p > MIN_PERIOD_STEPS * usual
    ]
    return near[0] if near else 0.0


def spread_repeated_stamps(batches: Iterator[Batch], repairs: list[Repair]) -> Iterator[Batch]:
    """Yield the same rows; those of a coarse clock are spread evenly.

    Stamps of an even clock give way to its ticks (:class:`EvenClock`); other stamps that several rows share
    are spread over these. Which of both is decided by the first batch.
    """
    first = next(batches, None)
    if first is None:
        return
    coarse = _is_coarse(first["time"])
    evenly = coarse and np.ptp(np.diff(_run_edges(first["time"]))[1:-1]) == 0  # as many rows share each stamp
    clock = None if evenly else EvenClock.of(first["time"])
    if clock is None and coarse:
        first, batches = joined([first, *batches]), iter(())
        first["time"], period = _spread(first["time"])
        rows = first["time"].size
        message = f"{rows} rows share their stamps with others, as the clock is coarse; they were spread evenly, "
        message += f"{format_plain(period, 3)} s apart, and each may be off by as much"
        repairs.append(Repair("time", "spread", rows, message))
    for batch in chain([first], batches):
        yield batch if clock is None else batch | {"time": clock.place(batch["time"])}
    if clock is not None:
        cause = f"an even clock, read in steps of {format_plain(clock.step)} s, has these stamps"
        repairs.append(Repair("time", "spread", clock.rows, f"{cause}; {clock.rows} rows were placed on its ticks"))


def continuous_stamps(raw: Array) -> Array:
    """Return raw stamps as they are read: over the wraps of their counter, and spread where the clock is coarse."""
    return spread_stamps(CounterClock().unwrap(raw))


def spread_stamps(time: Array) -> Array:
    """Return the stamps of a coarse clock spread evenly; the same array where the clock is not coarse."""
    return next(spread_repeated_stamps(iter([{"time": time}]), []))["time"]


def _is_coarse(time: Array) -> bool:
    """Return whether most stamps repeat the one before, and equally many rows share each."""
    if time.size < MIN_SHARED_ROWS or not np.isfinite(time).all() or np.any(np.diff(time) < 0):
        return False
    lengths = np.diff(_run_edges(time))[1:-1]
    if lengths.size < MIN_RUNS or np.mean(np.diff(time) == 0) <= MIN_REPEATED_SHARE:
        return False
    usual = float(np.median(lengths))
    return bool(np.mean(np.abs(lengths - usual) <= max(1.0, 0.25 * usual)) >= MIN_REGULAR_SHARE)


def _run_edges(time: Array) -> Indices:
    return np.concatenate([[0], np.flatnonzero(np.diff(time) != 0) + 1, [time.size]])


def _spread(time: Array) -> tuple[Array, float]:
    """Return stamps spread over the rows that share them, and the period of the rows."""
    edges = _run_edges(time)
    lengths = np.diff(edges)
    steps = np.append(np.diff(time[edges[:-1]]), np.nan) / lengths
    period = float(np.median(steps[:-1])) if lengths.size > 1 else 0.0
    steps = np.where(steps < MAX_GAP_RATIO * period, steps, period)
    inside = np.arange(time.size) - np.repeat(edges[:-1], lengths)
    if lengths.size > 2 and lengths[0] < np.median(lengths):  # the recording begins within this stamp
        steps[0] = period
        inside[: lengths[0]] += int(np.median(lengths)) - lengths[0]
    return np.asarray(time + inside * np.repeat(steps, lengths)), period
