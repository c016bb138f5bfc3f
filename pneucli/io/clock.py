"""The one clock of all formats: stamps, in whatever a file has them, to seconds since the first, and when that was.

Stamps are texts, times and dates of Arrow, or calendar time of NumPy. What only numbers tell (wraps, coarse steps) is
in :mod:`pneucli.io.clock_repairs`.
"""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pyarrow as pa
from dateutil import parser

from pneucli.io import arrow_compute as pc
from pneucli.io.raw_file import ColumnValues

_MONTH = r"[^\s\d.,:;/-]{3,10}\.?"
_DATE = rf"\d{{1,4}}[-./]\d{{1,2}}[-./]\d{{1,4}}|\d{{1,2}}\.?[- ]{_MONTH}[- ]\d{{2,4}}|{_MONTH} \d{{1,2}},? \d{{4}}"
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
    (r"^'", ""),  # in front of what Excel is not to read
    (r"^(?:(\d{4}-\d\d-\d\d)[-T ])?(\d\d)\.(\d\d)\.(\d\d\.\d+)$", r"\1 \2:\3:\4"),
    (r"^[A-Z][a-z]{2},? ([A-Z][a-z]{2}) +(\d{1,2}) (\d\d:\d\d:\d\d(?:\.\d+)?) (\d{4})$", r"\2 \1 \4 \3"),  # of C
    (r"^(\d+)h ?(\d+)m(?:in)? ?(\d+(?:\.\d+)?)s$", r"PT\1H\2M\3S"),
    (_COMPACT + r"(\d{3}|\d{6}|\d{9})$", r"\1-\2-\3 \4:\5:\6.\7"),
    (_COMPACT + r"($|[^\d])", r"\1-\2-\3 \4:\5:\6\7"),
    (r"^\s*(\d+)(?:\.| days? )(\d\d):(\d\d):(\d\d(?:\.\d+)?)$", r"P\1DT\2H\3M\4S"),  # durations of .NET, pandas
)
_SPANS = {"d": 86_400.0, "h": 3600.0, "m": 60.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # s
_PARTS = "T?".join(rf"(?:(?P<{unit}>\d+(?:\.\d+)?){unit}_?)?" for unit in _SPANS)
_SPAN = rf"(?i)^\s*(?:(?:L?T|L?TIME)#|P)(?:{_PARTS})\s*$"  # T#5s10ms of IEC 61131-3, PT5.01S of ISO 8601
_IS_SPAN = re.compile(_SPAN)


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
        found: datetime = parser.parse(text, dayfirst=day_first and not year_first, yearfirst=year_first)
    except (parser.ParserError, OverflowError) as error:
        raise ValueError(f'"{text}"') from error
    return found


def _seconds_since(first: str, texts: list[str | None], day_first: bool) -> list[float]:
    zero = _parse_date(first, day_first)
    return [(_parse_date(text, day_first) - zero).total_seconds() if text else np.nan for text in texts]
