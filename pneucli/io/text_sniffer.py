"""Where the table begins in a text of which nothing is known: preamble, header, units, delimiter and marks.

What is found is for people to see and to state: ``init`` writes it down, and reading takes what is stated.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from pneucli.errors import InputError, UnitError
from pneucli.io.clock import is_date_or_time
from pneucli.io.column_reader import is_rate, number_in, tells_rate, tells_ticks
from pneucli.io.file_units import unit_in_brackets
from pneucli.io.raw_file import RawFile
from pneucli.io.text_layout import (
    BRACKETS,
    NULL_TEXTS,
    Rewriting,
    TextLayout,
    bare_hexadecimal,
    head_of,
    is_cell,
    is_value,
    number_and_unit,
    rewritings_in,
    table_end,
    with_keys,
)
from pneucli.units import is_count, is_unit, parse_unit, same_dimension

MAX_LINES = 2000  # lines that are looked at
DELIMITERS = ("\t", ";", ",", " ", "|")
MAX_HEADER_LINES = 4  # lines right above the rows, one of which names the columns
MIN_TABLE_ROWS = 3  # rows in a row that a table begins with
MIN_TABLE_SHARE = 0.1  # of the longest run of rows, that the table begins with
MIN_USUAL_SHARE = 0.5  # of the lines of a table, that are as wide: else they are a log of sentences
MIN_SIDE = 10  # columns a line, of a table that lies on its side
MIN_VALUE_SHARE = 0.8  # share of the rows that tells what a column is
_THOUSANDS = re.compile(
    r"[+-]?\d{1,3}(?:(?:([.,])\d{3}){2,}|(?:([.,])\d{3})+(?!\2)[.,]\d+|(?:(['’ ])\d{3})+(?:[.,]\d+)?)"
)
_MAX_COLUMNS = 1000  # columns


@dataclass(frozen=True)
class SniffedLayout:
    """How a text is written: what has to be stated to read it, and what its columns are called.

    ``thousands`` maps columns (from 0) to their mark. ``names`` and ``units`` are empty where there are none;
    ``titles`` are the names that lines above the table give to its columns, such as to ``CH1``.
    """

    header: bool
    skip_rows: int
    delimiter: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    thousands: dict[int, str]
    titles: tuple[str, ...] = ()


def sniff(raw: RawFile) -> SniffedLayout:
    """Look at the first lines of a text; what ``raw`` states stays as it is (``header = True`` states nothing).

    Raises InputError where no rows of numbers are found.
    """
    head = head_of(raw)
    lines, rewritings = head.lines[:MAX_LINES], rewritings_in(head.text)
    keys = Counter(one[1] for one in map(_READING.fullmatch, lines) if one)
    if 2 * sum(count for count in keys.values() if count > 1) > sum(map(bool, map(str.strip, lines))) and len(keys) > 1:
        told, mend = f"a line for each reading: {', '.join([*keys][:4])}", "write those of one instant into one row"
        raise InputError(str(raw.path), told, "a row for each sample", f"{mend}, with its time stamp", code="E041")
    marks = [raw.delimiter] if raw.delimiter else DELIMITERS
    tables = [_DelimitedTable(lines, mark, raw.skip_rows, rewritings) for mark in marks]
    found = max(tables, key=lambda one: (one.score, one.delimiter != " ", one.width))  # a blank also parts dates
    if sideways := next((one for one in tables if one.lies_on_its_side), None):
        where, told = f"{raw.path}, line 1", f"{sideways.width} columns, and a channel in each line"
        raise InputError(
            where, told, "a row for each sample", "transpose the table, or export it in columns", code="E041"
        )
    if found.is_cut_in_numbers:
        told, mend = "the comma cuts columns and stands in numbers", "export it with semicolons, or with points"
        raise InputError(str(raw.path), told, "a mark for each", mend, code="E041")
    if not raw.skip_rows and (line := found.line_of_another_table):
        told, mend = f"the columns become {found.width} here", f"cut the file there, or say --skip-rows {line - 1}"
        raise InputError(f"{raw.path}, line {line}", told, "as many columns as above", mend, code="E043")
    if not found.score:
        told = f"no table of numbers, but {next(filter(str.strip, lines), '')[:60]!r}"
        wanted, mend = "rows of numbers", "say --skip-rows, --delimiter or --decimal, or export it as CSV"
        raise InputError(str(raw.path), told, wanted, mend, code="E041")
    return found.describe(raw.header)


def stated_numbers(lines: Sequence[str], found: SniffedLayout) -> dict[str, float]:
    """Return what the lines above a table say of its sampling rate (Hz) or period (s), by the names that they use."""
    numbers: dict[str, float] = {}
    lines = lines[: max(found.skip_rows, 1) + MAX_PREAMBLE_LINES]
    cut = [TextLayout("", found.delimiter, "", 0, ()).split(line) for line in lines[: found.skip_rows]]
    below = [f"{name}: {value}" for row, under in pairwise(cut) for name, value in zip(row, under, strict=False)]
    for line in (*lines, *below):
        if (match := _STATED_NUMBER.match(line)) and (tells_rate(match[1].strip()) or tells_ticks(match[1])):
            name, unit = match[1].strip(), (match[2] or match[4] or "").strip()
            number = float(match[3].split(",")[0] if found.delimiter == "," else match[3].replace(",", "."))
            wanted = "Hz" if is_rate(name) or tells_ticks(name) else "s"
            try:
                numbers[name] = number * (parse_unit(unit).factor if unit and same_dimension(unit, wanted) else 1.0)
            except UnitError:
                continue
    return numbers


_READING = re.compile(r"\s*([^\W\d][\w ./-]*?)\s*[:=]\s*[-+]?[\d.]+\s*[^\s\d]{0,6}\s*")  # "Humidity: 44.4 %"
MAX_PREAMBLE_LINES = 60
_STATED_NUMBER = re.compile(
    r'[#%;"\s]*([^\W\d][\w ]*?)\s*(?:[\[(]([^\])]*)[\])])?["\s]*[:=,;\s]+"?'
    r'(\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)"?[\s;,]*"?((?:[A-Za-zµ][A-Za-zµ/]*)?)'
)


class _DelimitedTable:
    """The lines of a text, cut by one delimiter."""

    def __init__(self, lines: Sequence[str], delimiter: str, skip: int, rewritings: tuple[Rewriting, ...]) -> None:
        plain = TextLayout("", delimiter, "", 0, (), rewritings=rewritings)
        lines = lines[: table_end(lines, plain.split)]
        self._lines, self._skip, self.delimiter = lines, skip, delimiter
        last = [line for line in lines if not _is_skipped(line)][-MIN_TABLE_ROWS:]
        cut = with_keys(plain, last)
        self._keys = cut.names
        self._rows = [() if _is_skipped(line) else tuple(cut.split(line)) for line in lines]
        tail = [row for row in self._rows[max(skip, len(lines) // 2) :] if row] or [r for r in self._rows[skip:] if r]
        tail = [row for row in tail if any(map(is_cell, row))] or tail  # not the header, where it stands again
        self.width = Counter(map(len, tail)).most_common(1)[0][0] if tail else 0
        self._tail = [row for row in tail if len(row) == self.width]
        self._rows = [self._without_comment(n) for n in range(len(self._rows))]
        there = self._there = [[row[n] for row in self._tail if row[n] not in NULL_TEXTS] for n in range(self.width)]
        self._numeric = [n for n in range(self.width) if _share(map(is_cell, there[n])) >= MIN_VALUE_SHARE]
        self._scales: tuple[str, ...] = ()
        self._scale_line = -1
        self.start = self._first_row()
        usual = len(self._tail) / max(len(tail), 1)
        usual *= usual >= MIN_USUAL_SHARE
        words = bare_hexadecimal(self._tail, self.width)
        cells = _share(n in self._numeric or n in words or not there[n] for n in range(self.width))
        single = 0.1 if self.width == 1 else 1.0  # cut by nothing
        single *= 0.9 if delimiter == " " and all("\t" in line for line in last) else 1.0  # a tab cuts there, too
        self.score = (
            usual * cells * single if self._numeric and self.start is not None and self.width < _MAX_COLUMNS else 0
        )

    @property
    def lies_on_its_side(self) -> bool:
        """Whether each line has the samples of one channel: a name before them, or more of them than there are rows."""
        rows = [row for row in self._rows if row and len(row) == self.width]
        named = not any(is_cell(row[0]) for row in rows) and len({row[0] for row in rows}) == len(rows)
        told = named or self.width >= _MAX_COLUMNS or len(rows) < MIN_TABLE_ROWS
        return (
            bool(rows)
            and told
            and self.width > MIN_SIDE * len(rows)
            and all(is_cell(row[-1] or row[-2]) for row in rows)
        )

    @property
    def line_of_another_table(self) -> int:
        """The line at which the rows begin, where many rows of another width stand above; 0 where few do."""
        above = [row for row in self._rows[: self.start or 0] if len(row) > 1 and all(map(is_cell, row))]
        return (self.start or 0) + 1 if len(above) > MIN_TABLE_SHARE * len(self._rows) else 0

    @property
    def is_cut_in_numbers(self) -> bool:
        """Whether a decimal comma cuts numbers: digits alone, and nearly twice as many columns as names."""
        header = self._rows[self.start - 1] if self.start and self.delimiter == "," else ()
        few = 1 < len(header) < self.width - 1 and not any(map(is_value, header))
        return few and all(re.fullmatch(r"[+-]?\d*", field) for row in self._tail for field in row)

    def _without_comment(self, line: int) -> tuple[str, ...]:
        """Return the fields of a line, without what LabVIEW writes below "Comment" in the first row alone."""
        row, above = self._rows[line], self._rows[line - 1] if line else ()
        return row[:-1] if len(row) == len(above) == self.width + 1 and above[-1] == "Comment" else row

    def _is_row(self, row: tuple[str, ...]) -> bool:
        if len(row) != self.width or not self._numeric:
            return False
        if any(row[n] not in NULL_TEXTS and not is_cell(row[n]) for n in range(self._numeric[0]) if not self._there[n]):
            return False  # a line of keys above rows whose first column is empty
        fields = [row[n] for n in self._numeric]
        return any(map(is_cell, fields)) and all(is_cell(field) or field in NULL_TEXTS for field in fields)

    def _first_row(self) -> int | None:
        there = [n for n, row in enumerate(self._rows) if row and n >= self._skip]
        good = [self._is_row(self._rows[n]) for n in there]
        starts = [at for at in range(len(there)) if all(good[at : at + MIN_TABLE_ROWS]) and not (at and good[at - 1])]
        if not starts:
            return None
        first, *others = starts
        for at in others:  # a small table may stand above, with a header of its own
            few = [*good, False].index(False, first) - first < MIN_TABLE_SHARE * ([*good, False].index(False, at) - at)
            is_header = not self._has_value(there[at - 1]) and self._rows[there[at - 1]] != self._rows[there[first - 1]]
            first = at if few and is_header else first
        below = there[min(first + 1, len(there) - 1)]
        if not _are_scales(self._rows[there[first]], self._rows[below]):
            return there[first]
        self._scales, self._scale_line = self._rows[there[first]], there[first]
        return below

    def describe(self, header: bool) -> SniffedLayout:
        start = self.start or 0
        if self._keys:
            return SniffedLayout(False, start, self.delimiter, self._keys, (), self._thousands())
        above = [n for n in range(self._skip, start) if not _is_skipped(self._lines[n]) and n != self._scale_line]
        paired = self._paired(above) if header else None
        names, units, at = paired or (self._header(above) if header else ((), (), None))
        further = [n for n in above if at is not None and n > at]  # lines that reading does not pass over
        direct = at is not None and not self._scales and len(further) == bool(units)
        skip = at if direct and at is not None else start if above or self._skip else 0
        skip = 0 if direct and not [n for n in above if n < skip] else skip
        names = names or self._names_in_comment(start)
        titles, own = ((), ()) if paired else self._channel_table(above, names)
        titles = titles or (() if paired else self._other_lines(above, names))
        wide = (self._rows[n] for n in above if len(self._rows[n]) == self.width and n != at)
        units = units or own or next((row for row in wide if _are_units(row)), ()) or self._units_told(start, names)
        scales = self._keyed(above, _SCALES) or self._scales or ("",) * len(units)
        units = units or tuple(unit_in_brackets(name) for name in names) * bool(self._scales)
        units = tuple(BRACKETS.sub(r"\1", text) for text in units)
        scaled = zip(scales, units, strict=False)
        units = tuple(f"{own} {unit}" if unit and own not in _NO_SCALES else unit for own, unit in scaled)
        return SniffedLayout(direct, skip, self.delimiter, names, units, self._thousands(), titles)

    def _header(self, above: list[int]) -> tuple[tuple[str, ...], tuple[str, ...], int | None]:
        """Return names, units and the names' line: those above the rows that are as wide as they are."""
        ends = range(self.width - (not self._there[-1]), self.width + 2)  # a row may end with a delimiter alone
        wide = [n for n in above if len(self._rows[n]) in ends]
        above_rows = self._rows[above[-1]] if above and not wide else ()
        if len(above_rows) == self.width - 1 and self._counts_rows():
            return ("", *above_rows), (), None  # R names rows, and not their column
        if self.delimiter == " " and above_rows:
            return self._names_in_columns(self._lines[above[-1]]), (), None
        keyed = [n for n in wide if _TITLES.fullmatch(self._rows[n][0]) or _UNITS.fullmatch(self._rows[n][0])]
        others = [n for n in wide if n not in keyed]  # the keyed ones are lines of a table of channels
        titles = self._keyed(keyed, _TITLES)
        wide = others or wide
        if titles:
            others = [n for n in others if not self._stands_apart(self._rows[n])]  # further keys
        first, *rest = self._rows[wide[-1]][: self.width] if wide else ("",)
        stamped = is_date_or_time(first) and not any(map(is_value, rest))  # a serial monitor stamps names as well
        titles = ("time", *rest) if stamped else titles
        numbers = wide and not titles and all(map(self._has_value, wide)) and self._names_numbers(wide[-1])
        if not numbers and (stamped or (titles and not others) or not wide or self._has_value(wide[-1])):
            return titles, self._keyed(keyed, _UNITS), None
        for before, units in reversed([*pairwise(wide)]):
            if _are_units(self._rows[units]) and not all(map(is_value, self._rows[before])):
                texts = [n for n in wide if n <= before and not self._has_value(n)]
                names = max(texts, key=lambda n: (self._distinct(n), n), default=before)
                return self._rows[names][: self.width], self._rows[units][: self.width], names
        last = -1 if numbers else next((n for n in reversed(wide) if self._has_value(n)), -1)
        below = [n for n in wide[-MAX_HEADER_LINES:] if n > last]
        most = max(below, key=lambda n: (self._has_units(n), self._distinct(n), n))
        if self._rows[most][0] in _MARKS and len(self._rows[most]) > self.width:
            return self._rows[most][1:], (), None
        return self._rows[most][: self.width], (), most

    def _names_numbers(self, line: int) -> bool:
        """Return whether a line names columns, some by numbers: words above the stamps, and no number twice."""
        row = self._rows[line][: self.width]
        words = [n for n, field in enumerate(row) if field and not is_cell(field)]
        return len(words) > 1 and words[0] == 0 == self._numeric[0] and len(set(row)) == len(row)

    def _counts_rows(self) -> bool:
        """Return whether the first column counts rows."""
        first = [row[0] for row in self._tail]
        return all(map(str.isdigit, first)) and all(int(b) == int(a) + 1 for a, b in pairwise(first))

    def _paired(self, above: list[int]) -> tuple[tuple[str, ...], tuple[str, ...], None] | None:
        """Return names and units of columns that follow their stamps, where lines have a key above each stamp.

        LabVIEW (X_Columns Multi) has "X_Value" there, its units above blanks, and a column of comments behind.
        """
        rows = [row[: self.width] for row in (self._rows[n] for n in above) if self.width <= len(row) <= self.width + 1]
        keyed = [row for row in rows if self.width > 2 and {*row[::2]} <= {row[0], ""}]
        paired = {row[0]: row[1::2] for row in keyed if "" not in row[::2] or _UNITS.fullmatch(row[0])}
        names, units = (next((paired[one] for one in paired if key.fullmatch(one)), ()) for key in (_STAMPED, _UNITS))
        if not names:
            return None
        columns = tuple(text for name in names for text in (f"{name} time", name))
        return columns, tuple(text for unit in units for text in ("", unit)), None

    def _keyed(self, lines: list[int], key: re.Pattern[str]) -> tuple[str, ...]:
        """Return what the last line behind a key says of the columns; the key has no column, or an empty one."""
        found = [self._rows[n] for n in lines if key.fullmatch(self._rows[n][0])]
        if not found or (not self._stands_apart(found[-1]) and self._there[0]):
            return ()
        return found[-1][1:] if self._stands_apart(found[-1]) else ("", *found[-1][1 : self.width])

    def _stands_apart(self, line: tuple[str, ...]) -> bool:
        """Return whether the key of a line takes a field more than the rows have."""
        return len(line) > self.width and line[-1] != ""

    def _has_value(self, line: int) -> bool:
        return any(is_value(field) for field in self._rows[line] if field not in NULL_TEXTS)

    def _has_units(self, line: int) -> bool:
        """Return whether most names of a line end with a unit in brackets."""
        return _share(is_unit(unit_in_brackets(field)) for field in self._rows[line] if field) > MIN_VALUE_SHARE

    def _distinct(self, line: int) -> int:
        """Return how many columns different texts name: a line that says "Value" of each column names none."""
        return min(len({field for field in self._rows[line] if field}), self.width)

    def _channel_table(self, above: list[int], names: tuple[str, ...]) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return what lines above the table call its columns, and their units: a line a channel, or a line of names."""
        titles, units = dict[int, str](), dict[int, str]()
        lines = [self._rows[n] for n in above if self._rows[n][: self.width] != names and len(self._rows[n]) > 1]
        channels = [n for n, row in enumerate(lines) if row[0] in names and row[0]]
        if len({lines[n][0] for n in channels}) > 1:
            heading = lines[channels[0] - 1] if channels[0] else ()
            title = next((n for n, text in enumerate(heading) if n and _TITLES.search(text)), 1)
            for row in (lines[n] for n in channels):
                titles.setdefault(names.index(row[0]), row[title] if title < len(row) else "")
                units.setdefault(names.index(row[0]), next((text for text in reversed(row[1:]) if is_unit(text)), ""))
        lengths = Counter(len(row) for row in lines)
        for row in lines:
            found = titles if _TITLES.fullmatch(row[0]) else units if _UNITS.fullmatch(row[0]) else {}
            tabled = 2 < len(row) < self.width and lengths[len(row)] > 1  # the rows have further columns behind
            if tabled or len(row) in (self.width, self.width + 1):
                for place, text in enumerate(row[1:], 0 if self._stands_apart(row) else 1):
                    found.setdefault(place, text)
        titles = {n: text for n, text in titles.items() if n < len(names)}
        named = {n: f"{text} {names[n]}" if [*titles.values()].count(text) > 1 else text for n, text in titles.items()}
        width = range(len(names))
        tell = any(titles.values()), any(units.values())
        return tuple(named.get(n, "") for n in width) * tell[0], tuple(units.get(n, "") for n in width) * tell[1]

    def _other_lines(self, above: list[int], names: tuple[str, ...]) -> tuple[str, ...]:
        """Return the names where the line of names has none for a column, or the same one again, and another line has.

        A name above several columns stands above the first of them.
        """
        wide = [self._rows[n] for n in above if len(self._rows[n]) == self.width == len(names)]
        others = [row for row in wide if row != names and not _are_units(row)]
        words = [[any(map(str.isalpha, one)) * one for one in row] for row in others]  # rules of dashes say nothing
        texts = [next((row[n] for row in words if row[n] and not is_value(row[n])), "") for n in range(len(names))]
        own = [name or text for name, text in zip(names, texts, strict=True)]
        groups, below = sorted((names, tuple(texts)), key=lambda line: len(set(line)), reverse=True)
        told = all(text or group or not there for text, group, there in zip(below, groups, self._there, strict=False))
        if names and len(set(below) - {""}) <= len(names) // 2 and "" in groups and told:
            spread = list[str]()
            for text, there in zip(groups, self._there, strict=True):  # an empty column belongs to no group
                spread.append(spread[-1] if spread and there and not text else text)
            named = zip(spread, below, strict=True)
            own = [text if name.lower() in _VALUES and text else f"{text} {name}".strip() for text, name in named]
        return tuple(own) if tuple(own) != names else ()

    def _names_in_columns(self, line: str) -> tuple[str, ...]:
        """Return the names in a header of columns of fixed width, in which names and units are apart by one blank."""
        for fields in (re.split(r"\s{2,}", line.strip()), re.findall(r"[^\s\[(]+(?:\s?[\[(][^\])]*[\])])?", line)):
            if len(fields) == self.width and not any(map(is_value, fields)):
                return tuple(fields)
        return ()

    def _names_in_comment(self, start: int) -> tuple[str, ...]:
        """Return the names in a comment right above the rows, as numpy and gnuplot write them."""
        comments = [_BEFORE_NAMES.sub("", line) for line in self._lines[:start] if _is_comment(line)]
        own, commas = (TextLayout("", mark, "", 0, ()) for mark in (self.delimiter, ","))
        cut = [*map(own.split, comments), *map(commas.split, comments[-1:])]  # blanks may cut the rows alone
        fitting = [fields for fields in cut if len(fields) == self.width]
        return tuple(fitting[-1]) if fitting and not any(map(is_value, fitting[-1])) else ()

    def _units_told(self, start: int, names: tuple[str, ...]) -> tuple[str, ...]:
        """Return the units that comments above the rows tell in words: "aortic pressure in mmHg"."""
        told = [_IN_WORDS.fullmatch(line.strip(" \t#%.")) for line in self._lines[:start] if _is_comment(line)]
        said = {word: one[2] for one in told if one and is_unit(one[2]) for word in one[1].lower().split()}
        units = tuple(said.get(name.lower(), "") for name in names)
        return units * any(units)

    def _thousands(self) -> dict[int, str]:
        """Return the columns that have more than one mark in a number."""
        hits = {n: [_THOUSANDS.fullmatch(row[n]) for row in self._tail] for n in range(self.width)}
        found = {
            n: hit[1] or hit[2] or hit[3]
            for n, column in hits.items()
            for hit in [next(filter(None, column), None)]
            if hit
        }
        if any(_POINT.fullmatch(field) for row in self._tail for field in row):  # a comma is no decimal mark there
            fitting = (n for n, own in enumerate(self._there) if own and all(map(_GROUPED.fullmatch, own)))
            found |= {n: "," for n in fitting if n not in found and any("," in text for text in self._there[n])}
        return found


_POINT, _GROUPED = re.compile(r"[+-]?\d+\.\d+"), re.compile(r"[+-]?\d{1,3}(?:,\d{3})*")
_IN_WORDS = re.compile(r"([\w ]+?) in (\S+)")
_VALUES = ("y", "value", "wert")  # below the name of a channel, beside its stamps
_BEFORE_NAMES = re.compile(r"(?i)^[\s#%]*(?:(?:column|field)s?(?: names?)?\s*[:=])?\s*")  # "# columns: t, p1"
_MARKS = ("%", ";", "//", "!")  # in front of a line of names, apart by a blank
_TITLES = re.compile(
    r"(?i)(?:channel |signal |trace)?names?|signals?|waveforms?|series|labels?|titles?|comments?|descriptions?|tags?|"
    r"bezeichnung|kanalname"
)
_STAMPED = re.compile(rf"{_TITLES.pattern}|X_Value")
_SCALES = re.compile(r"(?i)(?:scale|scaling)(?:[ _]?factors?)?s?|factors?|multipliers?|gains?")
_NO_SCALES = ("", "1", "1.0")
_POWER_OF_TEN = re.compile(r"10*(?:\.0*)?|0\.0*1|1(?:\.0*)?[eE][+-]?\d+")
_UNITS = re.compile(r"(?i)(?:v|vert_|y[ _]?)?units?(?:[ _]labels?)?|einheit(?:en)?|eu|eng\.? units?")


def apply_sniffed(raw: RawFile, found: SniffedLayout) -> RawFile:
    """Return ``raw`` with what has to be stated to read it as found."""
    return replace(raw, header=found.header, skip_rows=found.skip_rows, delimiter=found.delimiter)


def _are_units(fields: Sequence[str]) -> bool:
    """Return whether most of what stands in a line are units; dates, times and nothing have none."""
    counted = {re.sub(r"\d+$", "", field) for field in fields[1:]}
    if len(fields) > 2 and len(counted) == 1 and len(set(fields)) == len(fields):
        return False  # channels by their numbers: K1, K2, K3
    return (
        sum((is_unit(field) and not number_and_unit(field)) or is_count(field.strip("[](){}<> ")) for field in fields)
        >= 0.6 * sum(field not in NULL_TEXTS for field in fields)
        > 0
    )


def _are_scales(row: Sequence[str], below: Sequence[str]) -> bool:
    """Return whether the first row of a table are factors of its columns: powers of ten, and no stamp before the next.

    >>> _are_scales(["1", "0.001"], ["0.00", "7013"]), _are_scales(["0.001", "10"], ["0.002", "10"])
    (True, False)
    """
    fields = [field for field in row if field not in NULL_TEXTS]
    if len(fields) < 2 or not all(map(_POWER_OF_TEN.fullmatch, fields)) or not set(fields) - {*_NO_SCALES}:
        return False
    return not number_in(row[0]) <= number_in(below[0].replace(",", "."))


def _is_skipped(line: str) -> bool:
    return not line.strip() or _is_comment(line)


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith("#")


def _share(flags: object) -> float:
    listed = list(flags)  # type: ignore[call-overload]
    return sum(listed) / len(listed) if listed else 0.0
