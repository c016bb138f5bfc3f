"""The look of a text file: encoding, delimiter, decimal mark, header, and what is written around and into numbers."""

from __future__ import annotations

import codecs
import csv
import re
import string
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from pathlib import Path
from typing import AnyStr, NamedTuple

from pneucli.errors import InputError, UnitError
from pneucli.io.clock import has_date, is_date, is_date_or_time
from pneucli.io.raw_file import RawFile
from pneucli.units import parse_unit

_BLANK = "(?:\u00a0|\u2007|\u2009|\u202f)"  # blanks at which no line is broken
_SET = r"[^\s,=]+=[^\s,=]+"


@dataclass(frozen=True)
class Rewriting:
    """A pattern of a line and what is read for it, for text and for bytes in UTF-8; ``{}`` is the delimiter.

    ``seen``: the pattern that tells that a text is written so, where that is another one, ``told`` what else has to;
    ``said``: what of a text is left out.
    """

    pattern: str
    plain: str
    seen: str = ""
    said: str = ""
    told: Callable[[str], bool] = bool

    def of(self, delimiter: str) -> tuple[re.Pattern[str], str]:
        """Return pattern and replacement in a text that is cut by a delimiter."""
        return re.compile(self.pattern.replace("{}", re.escape(delimiter)), re.MULTILINE), self.plain.replace(
            "{}", delimiter
        )


KEY = r"(?:^|(?<=[,;\t ]))[A-Za-z_]\w*(?:[ ]?[:=][ ]?(?=[-+]?\.?\d)|=(?=[^\s=]))"  # as in "p1:1.02", "state=on"
KEYED = Rewriting(KEY, "")


def _cuts_stamps(text: str) -> bool:
    """Return whether a comma before milliseconds cuts stamps in two: the line above the rows has a field less."""
    lines = text.split("\n")
    first = next((n for n, line in enumerate(lines) if re.search(r"\d\d:\d\d:\d\d,\d{3},", line)), 0)
    return first > 0 and lines[first].count(",") == lines[first - 1].count(",") + 1


_JSON_IN_LINE = r"^[^{}\n]*\{[\"'][^{}\n]+\}\s*$"
_REWRITINGS = (
    Rewriting(r"^(?:\[(\d[\dT:., /-]*)\]|([\d:.,]+)\s*->)\s*", r"\1\2{}"),  # a stamp, as logs and serial monitors write
    Rewriting(
        r"^(\d[\d.,:/T+-]*(?: \d[\d.,:]*)?)\s[^\n=}{]*?(?=\b[A-Za-z_]\w*[ ]?[:=][ ]?[-+]?\.?\d)", r"\1{}"
    ),  # words of a log between a stamp and the first key
    Rewriting(r"^(\d{10}):(\d{1,9})(?={})", r"\1{}\2"),  # seconds since 1970, and nanoseconds
    Rewriting(rf"(?<=\d){_BLANK}(?=\d{{3}}(?!\d))", ""),  # between thousands
    Rewriting(_BLANK, " "),
    Rewriting("(?<![\\w.])−(?=[\\d.,])", "-"),  # the minus of typography
    Rewriting(r"(?<={})(?<! )[ ]*([+-])[ ]+(?=\.?\d)", r"\1"),  # a sign apart from its number: "+   1.013"
    Rewriting(r"(?:^|(?<=[{}\"]))'(?=[-+]?\.?\d)", ""),  # in front of what a spreadsheet is not to take for a formula
    Rewriting(r"(?<![\w.])([+-]?(?:\d+(?:\.\d*)?|\.\d+))[dD](?=[+-]\d{1,3}(?![\w.]))", r"\1E"),  # as Fortran writes
    Rewriting(r"(?<=[\d.])(?:\*|[ ]?[x×*][ ]?10)\^[({]?([+-]?\d+)[)}]?", r"E\1"),  # 1.5x10^-3, 1.5*^-3
    Rewriting(r"(?:^|(?<={}))\((\d(?:(?!{})[\d.,])*)\)(?=[ ]*(?:{}|\r?$))", r"-\1"),  # as in accounts
    Rewriting(r"(?:^|(?<={}))(\d(?:(?!{})[\d.,])*)-(?=[ ]*(?:{}|\r?$))", r"-\1"),  # the sign behind
    Rewriting(
        r"(?<=[\d.])[ ]?(?:±|\+/-|\+-)[ ]?(?:(?!{})[\d.,eE+-])+",
        "",
        said="what stands behind ± in a cell, its uncertainty, is left out",
    ),
    Rewriting(r"(\d\d:\d\d:\d\d),(\d{3})(?={})", r"\1.\2", told=_cuts_stamps),  # as Python's logging writes
    Rewriting(r"^\{(?=[\"'])", "", seen=_JSON_IN_LINE),  # as Python writes a dictionary
    Rewriting(r"(?:(?<=\d)[^\d{\n]*|\s+)\{(?=[\"'])", "{}", seen=_JSON_IN_LINE),  # what a program logs behind a stamp
    Rewriting(r"[}\"']", "", seen=_JSON_IN_LINE),
    Rewriting(
        r" (?=[^\s,=]+=|\d{10,19}\s*$)", ",", seen=rf"^[^\s,=]+(?:,{_SET})* {_SET}(?:,{_SET})* \d{{10,19}}\s*$"
    ),  # line protocol: a name and tags, fields, and a stamp, apart by blanks
)


def _without_field_behind(width: int) -> Rewriting:
    """Return what leaves out all that stands behind the columns."""
    return Rewriting(rf"^((?:[^{{}}\r\n]*{{}}){{{width - 1}}}[^{{}}\r\n]*){{}}.*$", r"\1")


def rewritings_in(text: str) -> tuple[Rewriting, ...]:
    """Return the ways of writing that a text shows.

    >>> len(rewritings_in("1.0D+02 2.0D+00")), len(rewritings_in("D+02 2.0"))
    (1, 0)
    """
    return tuple(
        one
        for one in _REWRITINGS
        if re.search(one.seen or one.pattern.replace("{}", ","), text, re.MULTILINE) and one.told(text)
    )


def in_bytes(rewritings: tuple[Rewriting, ...], delimiter: str) -> Iterator[tuple[re.Pattern[bytes], bytes]]:
    """Yield patterns and replacements for text in UTF-8."""
    for pattern, plain in (one.of(delimiter) for one in rewritings):
        yield re.compile(pattern.pattern.encode(), re.MULTILINE), plain.encode()


HEAD_BYTES = 1 << 18
MIN_EASTERN_SHARE = 0.7  # of the letters, that are usual ones of an Eastern code page
_EASTERN_WORD = re.compile("[\u3040-\u30ff\u4e00-\u9fff\uff66-\uff9f]+")
MIN_ROWS_ABOVE = 20  # of a table that ends at a blank line
MAX_LINES_ABOVE = 40  # of a block that has a header of its own
NULL_TEXTS = (
    *("", "-", "--", "NaN", "nan", "NAN", "-nan", "n/a", "N/A", "NA", "null", "NULL", "None", "#N/A", "#NV"),
    *("1.#QNAN", "-1.#IND", "---", "----", "#VALUE!", "#DIV/0!", "#REF!", "#NUM!"),
    *("OL", "OVER", "OVERFLOW", "OVERLOAD", "UNDER", "ERR", "ERROR", "Error", "BAD", "Bad", "INVALID", "Invalid"),
    *("*" * number for number in range(1, 13)),  # a field too narrow for its number
)
_BEGINS_NUMBER = "0123456789+-.,'\"#"  # or a row, or a comment
_POINTS_BEFORE_COMMA = re.compile(r"[+-]?\d{1,3}(?:\.\d{3})+,\d+")
_POINTS_BETWEEN_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:\.\d{3})+(?:,\d+)?")
_COMMAS_BETWEEN_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:,\d{3})+(?:\.\d+)?")
_CELL = re.compile(r"([+-]?(?:\d[\d.,]*|[.,]\d+)(?:[eE][+-]?\d+)?)\s*([^\d\s.,+-].*)")  # a number and its unit
_HEXADECIMAL = re.compile(r"(?i)(?:0x|16#|\$)[\dA-F]+|\d[\dA-F]{3,}h")
_WORD = re.compile(r"[\dA-F]{4}|[\dA-F]{8}|[\da-f]{4}|[\da-f]{8}")
_KEY = re.compile(KEY)
SWITCHES = {"true": 1.0, "false": 0.0, "on": 1.0, "off": 0.0, "ein": 1.0, "aus": 0.0}
_NUMBER_OF_KEY = re.compile(r"[ ]?[:=][ ]?[-+]?\.?\d")
MIN_KEYED = 2  # cells of a line that say a name and a number, where others say none
BRACKETS = re.compile(r"^[\[(<{]\s*(.*?)\s*[\])>}]$")
_DELIMITERS = ("\t", ";", ",", " ")
_BLANK_NAMES = (" ", r"\s+", "whitespace")  # as some programs call blanks
_DELIMITER_MARKS = (*_BLANK_NAMES, "\t", *(mark for mark in string.punctuation if mark not in "\"#'+-."))


@dataclass(frozen=True)
class TextLayout:
    """How a text file is written; ``skip`` physical lines stand before the first row, ``delimiter`` " " is blanks.

    ``units`` is the line below the header, if that is none of numbers; ``stamps`` are the columns (from 0) of times of
    day, with or without their dates, ``dates`` those of dates alone, ``labels`` those of other text;
    ``dated_stamps`` are those of ``stamps`` that have their dates. ``repeated`` are the lines of the header, which may
    stand again among the rows; ``lines`` is how many lines after ``skip`` are read, all where it is None. ``cells``
    has the unit of columns in whose cells a unit stands behind each number; ``hexadecimal`` are those of whole numbers
    to the base 16, and of ``switches``.
    """

    encoding: str
    delimiter: str
    decimal: str
    skip: int
    names: tuple[str, ...]
    units: tuple[str, ...] = ()
    stamps: frozenset[int] = frozenset()
    labels: frozenset[int] = frozenset()
    dates: frozenset[int] = frozenset()
    dated_stamps: frozenset[int] = frozenset()
    line_end: str = "\n"
    repeated: tuple[str, ...] = ()
    lines: int | None = None
    cells: Mapping[int, str] = field(default_factory=dict)
    hexadecimal: frozenset[int] = frozenset()
    switches: frozenset[int] = frozenset()
    rewritings: tuple[Rewriting, ...] = ()

    def split(self, line: str) -> list[str]:
        """Return the fields of one line, without blanks around them."""
        for pattern, plain in (one.of(self.delimiter) for one in self.rewritings):
            line = pattern.sub(plain, line)
        if self.delimiter == " ":
            return line.split()
        try:
            fields = next(csv.reader([line], delimiter=self.delimiter, skipinitialspace=True), [])
        except csv.Error:  # quotes left open, fields without end
            fields = line.split(self.delimiter)
        return [field.strip() for field in fields]


class Head(NamedTuple):
    """The beginning of a text: how it is encoded, what ends its lines, and its whole lines."""

    encoding: str
    text: str
    line_end: str
    lines: list[str]


def head_of(raw: RawFile) -> Head:
    """Return the beginning of a text; raises InputError where it is none."""
    with raw.path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    head = head.rstrip(b"\0") if len(head) < HEAD_BYTES else head  # room that a recorder kept, and did not fill
    encoding = raw.encoding or detect_encoding(raw.path, head)
    text = decode_head(raw.path, head, encoding)
    line_end = "\n" if "\n" in text else "\r"
    lines = [line.rstrip("\r") for line in text.rstrip("\r\n").split(line_end)]
    if len(head) == HEAD_BYTES and len(lines) > 1:
        lines.pop()
    return Head(encoding, text, line_end, lines)


def with_keys(plain: TextLayout, lines: Sequence[str]) -> TextLayout:
    """Return a layout with the names that cells of rows say, the same in each row; as it is where they say none.

    >>> with_keys(TextLayout("", ",", "", 0, ()), ["t:0,p1:1.02", "t:1,p1:1.03"]).names
    ('t', 'p1')
    >>> with_keys(TextLayout("", " ", "", 0, ()), ["9:15 INFO t=0 p1=1.02", "9:15 INFO t=1 p1=1.03"]).names
    ('', '', 't', 'p1')
    """
    rows, numbers = set(), 0
    for line in lines:
        found = [_KEY.match(field) for field in plain.split(line)]
        keys = [re.split(r"\s?[:=]", one[0])[0] if one else "" for one in found]
        rows.add(tuple(keys))
        told = (one and _NUMBER_OF_KEY.match(one.string, len(key)) for one, key in zip(found, keys, strict=True))
        numbers = sum(map(bool, told))
    if len(rows) != 1 or numbers < MIN_KEYED:
        return plain
    return replace(plain, names=rows.pop(), rewritings=(*plain.rewritings, KEYED))


def detect_layout(raw: RawFile) -> TextLayout:
    """Find out how ``raw`` is written; what it states itself is taken as it stands.

    Raises InputError where the file is empty, holds no rows, or is not text.
    """
    _check_marks(raw)
    head = head_of(raw)
    text, lines = head.text, head.lines
    if not text.strip():
        raise InputError(
            str(raw.path), "the file is empty", "rows of numbers", "record it again or leave it out", code="E041"
        )
    rows = [n for n, line in enumerate(map(str.lstrip, lines)) if line and line[0] != "#" and n >= raw.skip_rows]
    if len(rows) < 1 + raw.header:
        found = "a header line and no rows" if rows else "no rows"
        raise InputError(
            f"{raw.path}, line {len(lines)}", found, "rows of numbers", "record it again or leave it out", code="E041"
        )
    sample = [lines[n] for n in rows[:20]]
    rewritings = rewritings_in(text)
    delimiter = raw.delimiter or _delimiter(sample[raw.header :], sample[0], rewritings)
    delimiter = " " if delimiter in _BLANK_NAMES else delimiter
    plain = TextLayout(
        head.encoding, delimiter, ".", rows[raw.header], (), line_end=head.line_end, rewritings=rewritings
    )
    plain = plain if raw.header else with_keys(plain, sample)
    layout = _with_names(raw, plain, [plain.split(line) for line in sample], rows)
    if raw.header:
        header = [lines[rows[0]], *([lines[rows[1]]] if layout.units else [])]
        layout = replace(layout, repeated=tuple(line.strip() for line in header))
    return layout if raw.part is None else _part(raw, layout)


def _part(raw: RawFile, look: TextLayout) -> TextLayout:
    """Return the layout of one part of a file: where it begins, and how long it is.

    Raises InputError where the file has not so many parts.
    """
    bounds = part_bounds(raw.path, look)
    if not 1 <= (raw.part or 0) <= len(bounds):
        found = f"part {raw.part} is asked for, and by headers, comments and blank lines the file has {len(bounds)}"
        raise InputError(f"{raw.path}, key part", found, f"1 to {len(bounds)}", "change part", code="E047")
    begin, end = bounds[(raw.part or 1) - 1]
    return replace(look, skip=begin, lines=end - begin)


def part_bounds(path: Path, look: TextLayout) -> list[tuple[int, int]]:
    """Return how many lines stand before each part of a file, and up to its end.

    A part begins where the header stands again; where it stands once, below comments (#) or blank lines between rows.
    """
    header = look.repeated[0] if look.repeated else ""
    at, ends, recent, total = list[int](), list[int](), deque[str](maxlen=MAX_LINES_ABOVE), 0
    begins, last_rows, last_row = [look.skip], [0], look.skip  # where the header stands once
    with path.open(encoding=look.encoding, errors="replace", newline=look.line_end) as file:
        for total, line in enumerate(file, 1):
            plain = line.strip()
            if header and plain == header:
                at.append(total + len(look.repeated) - 1)
                ends.append(total - 1 - lines_above([*recent], header, look.delimiter))
            elif plain[:1] not in ("", "#"):
                last_row = max(total, look.skip)
            elif last_row > begins[-1]:
                begins.append(total)
                last_rows.append(last_row)
            else:
                begins[-1] = max(total, look.skip)
            recent.append(line)
    if len(at) < 2:
        at, ends = begins[: -1 if last_row < begins[-1] else None], last_rows
    return [*zip(at, [*ends[1 : len(at)], total], strict=True)]


def lines_above(lines: Sequence[AnyStr], header: AnyStr, delimiter: AnyStr) -> int:
    """Return how many of the last lines belong to a header that stands again below them: those that begin with words.

    Where rows begin with words as well, those of another width than the header.
    """
    mark = delimiter.strip(" " if isinstance(delimiter, str) else b" ") or None  # None: blanks
    width, last = len(header.split(mark)), [line.strip() for line in lines[-MAX_LINES_ABOVE:]][::-1]
    firsts = [line[:1] if isinstance(line, str) else line[:1].decode("latin-1") for line in last]
    words = next((n for n, first in enumerate(firsts) if first and first in _BEGINS_NUMBER), len(last))
    return (
        words
        if words < len(last)
        else next((n for n, line in enumerate(last) if len(line.split(mark)) == width), words)
    )


def table_end(lines: Sequence[str], split: Callable[[str], list[str]], least: int = MIN_ROWS_ABOVE) -> int | None:
    """Return at which blank line (from 0) a table ends, as words or another table follow; None where it goes on.

    ``least``: how many rows stand above it. Below a blank line rows may go on, a header may stand again, and a line of
    words may stand between rows: all that is one table.
    """
    for n, line in enumerate(lines):
        if line.strip() or n < least or not all(_is_row(split(one)) for one in lines[n - least : n]):
            continue
        below = [one for one in lines[n + 1 : n + 1 + MAX_LINES_ABOVE] if one.strip()]
        words = split(below[0]) if below else [""]
        if not words[0] or is_cell(words[0]) or words[0].startswith("#"):
            continue
        earlier = {one.strip() for one in lines[:n]}
        again = any(one.strip() in earlier and not _is_row(split(one)) for one in below)
        width = len(split(lines[n - 1]))
        goes_on = len(words) != width and any(len(own) == width and _is_row(own) for own in map(split, below[1:4]))
        if not again and not goes_on:
            return n
    return None


def _is_row(fields: Sequence[str]) -> bool:
    return bool(fields) and (is_cell(fields[0]) or (not fields[0] and any(map(is_cell, fields))))


def _with_names(raw: RawFile, plain: TextLayout, sample: list[list[str]], rows: list[int]) -> TextLayout:
    first = sample[raw.header]
    units = raw.header and len(rows) > 2 and not any(map(is_value, first)) and any(map(is_value, sample[2]))
    body = sample[raw.header + units :]
    numbers = [str(number + 1) for number in range(len(first))]
    names = sample[0] if raw.header else list(plain.names) or numbers
    if raw.header and len(body[0]) == len(names) + 1 and not body[0][-1]:
        names = [*names, ""]  # every row ends with a delimiter, the header does not
    if _has_comments(names[-1] if raw.header else first[-1], raw.header, body, len(names)):
        names = names[:-1]  # LabVIEW's last column, of which only rows with a comment have a field
        if plain.delimiter != " ":
            plain = replace(plain, rewritings=(*plain.rewritings, _without_field_behind(len(names))))
    if raw.header and all(map(_is_number, names)):
        where = f"{raw.path}, line {rows[0] + 1}"
        raise InputError(
            where, "numbers where the header should be", "names of the columns", "header = false", code="E047"
        )
    decimal = raw.decimal or _decimal(body)
    skip = rows[raw.header + units]
    units_row = tuple(BRACKETS.sub(r"\1", field) for field in first) if units else ()
    kinds = {"stamps": is_date_or_time, "dates": is_date, "dated_stamps": has_date}
    columns = {kind: _columns_of(body, test, len(names)) for kind, test in kinds.items()}
    cells = _units_in_cells(body, len(names))
    columns["hexadecimal"] = _columns_of(body, is_marked_hexadecimal, len(names)) | bare_hexadecimal(body, len(names))
    columns["switches"] = _columns_of(body, lambda field: field.lower() in SWITCHES, len(names))
    columns["hexadecimal"] |= columns["switches"]
    texts = _columns_of(body, lambda field: not is_value(field), len(names))
    blank = {n for n in range(len(names)) if not any(n < len(row) and row[n] for row in body)}
    texts |= {n for n in blank if raw.header and not names[n]}  # what a later row has there is no reading
    columns["labels"] = texts - cells.keys() - columns["hexadecimal"]
    return replace(plain, decimal=decimal, skip=skip, names=tuple(names), units=units_row, cells=cells, **columns)  # type: ignore[arg-type]


def _has_comments(last: str, header: bool, body: list[list[str]], width: int) -> bool:
    """Return whether the rows but for the first are one field shorter than the line of names, or than the first row."""
    told = last.lower() == "comment" if header else bool(last) and not is_value(last)
    return told and {len(row) for row in body[1:] or body} == {width - 1}


def _units_in_cells(body: list[list[str]], width: int) -> dict[int, str]:
    """Return the first unit of each column in all of whose cells a unit stands behind a number."""
    parts: dict[int, list[tuple[str, str] | None]] = {}
    for number, column in enumerate(zip_longest(*body, fillvalue="")):
        parts[number] = [number_and_unit(text) for text in column if text not in NULL_TEXTS]
    return {number: own[0][1] for number, own in parts.items() if number < width and own and own[0] and all(own)}


def number_and_unit(text: str) -> tuple[str, str] | None:
    """Return a number and the unit behind it, as in ``"1.012 bar"``; None where a text is no such cell.

    >>> number_and_unit("-0.5 mbar"), number_and_unit("1.2"), number_and_unit("3 runs")
    (('-0.5', 'mbar'), None, None)
    """
    found = _CELL.fullmatch(text.strip())
    if found is None:
        return None
    try:
        parse_unit(found[2])
    except UnitError:
        return None
    return found[1], found[2]


def is_cell(field: str) -> bool:
    """Return whether a field is a value, or a number with its unit, or to the base 16."""
    return is_value(field) or number_and_unit(field) is not None or is_marked_hexadecimal(field)


def is_marked_hexadecimal(field: str) -> bool:
    """Return whether a field is a number to the base 16 that says so: 0x1F, 16#1F, 1Fh, $1F."""
    return _HEXADECIMAL.fullmatch(field) is not None


def bare_hexadecimal(body: Sequence[Sequence[str]], width: int) -> frozenset[int]:
    """Return the columns of words of 16 or 32 bits without a mark, of which one at least has letters among digits."""
    words = _columns_of(body, lambda field: _WORD.fullmatch(field) is not None, width)
    mixed = _columns_of(body, lambda field: not field.isalpha(), width) - _columns_of(body, str.isdigit, width)
    return words if words & mixed else frozenset()


def hexadecimal_value(field: str) -> float:
    """Return a whole number to the base 16, of which the first of 16 or 32 bits is the sign, or a switch's state.

    >>> hexadecimal_value("0x00FF"), hexadecimal_value("16#FFFE"), hexadecimal_value("3FFh")
    (255.0, -2.0, 1023.0)
    """
    if field.lower() in SWITCHES:
        return SWITCHES[field.lower()]
    digits = re.sub(r"(?i)^(?:0x|16#|\$)|h$", "", field)
    number, bits = int(digits, 16), 4 * len(digits)
    return float(number - (1 << bits) if bits in (16, 32) and number >> (bits - 1) else number)


def _columns_of(body: Sequence[Sequence[str]], test: Callable[[str], bool], width: int) -> frozenset[int]:
    """Return the columns in whose rows something stands, and all of that passes ``test``."""
    columns = [[field for field in column if field not in NULL_TEXTS] for column in zip_longest(*body, fillvalue="")]
    return frozenset(number for number, fields in enumerate(columns[:width]) if fields and all(map(test, fields)))


def is_value(field: str) -> bool:
    """Return whether a field is a number, a date or a time of day."""
    return _is_number(field) or is_date_or_time(field) or is_date(field)


def _check_marks(raw: RawFile) -> None:
    """Raise InputError where a mark that the recording states cannot be one."""
    marks = (("delimiter", raw.delimiter, _DELIMITER_MARKS), ("decimal", raw.decimal, (".", ",")))
    for key, value, usable in marks:
        if value is not None and value not in usable:
            wanted = "a comma, a semicolon, a tab or the like" if key == "delimiter" else "a point or a comma"
            raise InputError(f"{raw.path}, key {key}", f'"{value}"', wanted, f"change {key}", code="E047")
    if raw.decimal and raw.decimal in (raw.delimiter, raw.thousands):
        found = f'"{raw.decimal}" is the decimal mark and another one'
        raise InputError(f"{raw.path}, key decimal", found, "a mark for each", "change one of them", code="E047")


_NUMBER = re.compile(
    r"[+-]?(?:\d{1,3}(?: \d{3})+(?:[.,]\d+)?|[\d.,'’]*\d[\d.,'’]*(?:[eE][+-]?\d+)?)|nan|NaN|[+-]?inf|[+-]?∞"
)


def _is_number(field: str) -> bool:
    return _NUMBER.fullmatch(field) is not None


def detect_encoding(path: Path, head: bytes) -> str:
    """Return the encoding of a text; raises InputError where it is none."""
    for mark, name in (
        (codecs.BOM_UTF8, "utf-8-sig"),
        (codecs.BOM_UTF16_LE, "utf-16"),
        (codecs.BOM_UTF16_BE, "utf-16"),
    ):
        if head.startswith(mark):
            return name
    if b"\0" in head:
        if head[1:400:2].count(0) > 150:
            return "utf-16-le"
        found = f"byte 0 at position {head.index(0)}: not a text file"
        raise InputError(
            str(path),
            found,
            "CSV, TDMS, MAT, MDF4, HDF5 or Parquet",
            "check the file, record or copy it again",
            code="E040",
        )
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return _legacy_encoding(head)
    return "utf-8"


def _legacy_encoding(head: bytes) -> str:
    """Return the encoding of a text that is no UTF-8, by where the bytes of its letters lie in each code page."""
    runs = re.findall(rb"[\x80-\xff]+", head)
    leads = b"".join(run[::2] for run in runs)
    usual = sum(0xA1 <= byte < 0xA4 or 0xB0 <= byte < 0xD8 for byte in leads)
    if all(len(run) % 2 == 0 and min(run) > 0xA0 for run in runs) and usual > MIN_EASTERN_SHARE * len(leads):
        return "euc_kr" if max(leads) <= 0xC8 else "gb18030"  # Hangul, or the usual Chinese characters
    if any(len(run) > 3 and min(run) >= 0xC0 for run in runs):
        return "cp1251"  # words of letters alone: Cyrillic
    words = _EASTERN_WORD.findall(head.decode("cp932", "replace"))
    eastern = sum(len(word) for word in words if len(word) > 1) > MIN_EASTERN_SHARE * sum(map(len, words))
    return "cp932" if eastern else "cp1252"  # in Western words such letters stand alone


def text_of(path: Path) -> str:
    """Return a whole text file; raises InputError where it is none."""
    content = path.read_bytes()
    return decode_head(path, content, detect_encoding(path, content[:HEAD_BYTES]))


def decode_head(path: Path, head: bytes, encoding: str) -> str:
    """Return the first bytes of a file as text; raises InputError where they are not of this encoding."""
    try:
        b"".decode(encoding)  # there are codecs that are no encodings of text
        return codecs.getincrementaldecoder(encoding)().decode(head)
    except UnicodeDecodeError as error:
        found = f"byte {head[error.start]:#04x} at position {error.start} is not {encoding}"
        raise InputError(
            str(path), found, "a text file", "check the file, or state its encoding", code="E004"
        ) from error
    except (LookupError, ValueError, TypeError) as error:
        raise InputError(
            str(path), f'no encoding is called "{encoding}"', 'such as "utf-8"', "change encoding", code="E004"
        ) from error


def _delimiter(body: list[str], header: str, rewritings: tuple[Rewriting, ...]) -> str:
    """Return the delimiter that cuts all rows alike, and the header with them; a comma that only cuts digits loses."""
    for delimiter in _DELIMITERS:
        plain = TextLayout("", delimiter, "", 0, (), rewritings=rewritings)
        widths = {len(plain.split(line)) for line in body[:-1] or body}
        if len(widths) == 1 and widths.pop() > 1 and (delimiter != " " or "," not in header or body[0] == header):
            return delimiter
    return next((d for d in "\t;," if d in header), ",")


def _decimal(body: list[list[str]]) -> str:
    """A comma inside a field is the decimal mark where no number has a point, but for those between thousands.

    A point without a comma behind it is one between thousands where a comma stands that parts none.
    """
    numbers = [(number_and_unit(field) or (field, ""))[0] for row in body for field in row]
    fields = [field for field in numbers if _is_number(field) and not is_date(field)]
    commas = [field for field in fields if "," in field]
    is_sure = any(not _COMMAS_BETWEEN_THOUSANDS.fullmatch(field) for field in commas)
    pattern = _POINTS_BETWEEN_THOUSANDS if is_sure else _POINTS_BEFORE_COMMA
    points = any("." in field and not pattern.fullmatch(field) for field in fields)
    return "," if commas and not points else "."
