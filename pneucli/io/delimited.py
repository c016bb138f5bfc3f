"""CSV and its kin, streamed through pyarrow as plain UTF-8; what cannot be read is found again, line by line."""

from __future__ import annotations

import codecs
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from datetime import datetime
from itertools import chain, islice
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa
import pyarrow.csv as pcsv

from pneucli.errors import InputError, UnitError
from pneucli.io import arrow_compute as pc
from pneucli.io.clock import Clock
from pneucli.io.column_reader import counted_words, words_message
from pneucli.io.raw_file import NO_CLOCKS, ColumnRequest, ColumnValues, RawFile, Reader, Repair
from pneucli.io.text_layout import (
    HEAD_BYTES,
    MAX_LINES_ABOVE,
    MIN_ROWS_ABOVE,
    NULL_TEXTS,
    TextLayout,
    detect_layout,
    hexadecimal_value,
    in_bytes,
    is_value,
    lines_above,
    part_bounds,
    table_end,
)
from pneucli.units import Dimension, Unit, parse_unit

BLOCK_BYTES = 4 << 20
BLOCK_ROWS = 4096  # read at once in the search for a fault
HEXADECIMAL = "hexadecimal counts"
TAIL_BYTES, MAX_LAST_ROWS = 1 << 16, 50  # that are kept of the last rows
MAX_TRAILER_LINES = 20  # behind the rows
Row = tuple[int, str, list[str]]  # line number, text, fields


class DelimitedReader(Reader):
    """A delimited text file of any size; rows are read in blocks of 4 MB."""

    def __init__(self, raw: RawFile) -> None:
        self._raw = raw
        self._look: TextLayout = detect_layout(raw)
        self.names: Sequence[str] = self._look.names
        self.repairs: list[Repair] = []
        self.rows = 0
        self.clocks = NO_CLOCKS
        self.clock_names: frozenset[int] = frozenset()
        self.start: datetime | None = None
        self.losses: Counter[str] = Counter()
        above = {number: unit for number, unit in enumerate(self._look.units) if unit not in NULL_TEXTS}
        self.units = {
            **self._look.cells,
            **above,
            **dict.fromkeys(self._look.hexadecimal - self._look.switches, HEXADECIMAL),
        }
        self._words: dict[int, Counter[str]] = {}
        if self._look.units:
            self.repairs.append(Repair("", "units-line", 1, "the line below the header holds no number: units"))
        self.repairs += [Repair("", "left-out", 1, one.said) for one in self._look.rewritings if one.said]
        self._date_of = _dates_beside(self._look)
        if self._date_of:
            place, date = next(iter(self._date_of.items()))
            message = f'the dates of "{self.names[place]}" stand in "{self.names[date]}"'
            self.repairs.append(Repair("time", "date-column", 1, message))
        self._stamps = {number: Clock() for number in self._look.stamps}
        self.labels = self._look.labels
        self.dates = self._look.dates  # columns of dates alone
        self.stamps = self._look.stamps  # columns of dates and times of day, read in seconds
        self.header_lines = 0
        self._bad: list[str] = []
        self._events: Counter[str] = Counter()

    def batches(self, asks: Sequence[ColumnRequest]) -> Iterator[list[ColumnValues]]:
        """Yield the asked columns; raises InputError with line and column where a row does not fit."""
        self._bad, self._words, self._events = [], {}, Counter()
        try:
            with closing(NormalizedTextStream(self._raw.path, self._look)) as stream:
                while block := stream.read(BLOCK_BYTES):
                    if block.strip():
                        table = self._parse(block, asks)
                        self.rows += table.num_rows
                        yield [self._values(table, ask) for ask in asks]
        except (pa.ArrowInvalid, UnicodeDecodeError) as error:
            raise self._first_fault(asks, str(error)) from error
        if stream.second_table:
            line, text = stream.second_table
            self._look = replace(self._look, lines=line - 1 - self._look.skip)
            message = f'what stands below the rows, from line {line} on ("{text[:60]}"), was passed over'
            self.repairs.append(Repair("", "trailer", 1, message))
        if self._bad:
            self._drop_last_lines(asks, stream)
        elif not stream.second_table and not stream.ends_with_newline:
            self._note_unterminated_last_line(stream)
        for place, words in self._words.items():
            if words:
                message = words_message(self.names[place], words)
                self.repairs.append(Repair("", "words", sum(words.values()), message))
        if self._events:
            message = f"lines that end in a word and hold no readings were passed over: {counted_words(self._events)}"
            self.repairs.append(Repair("", "event", sum(self._events.values()), message))
        self.start = next((stamps.start for stamps in self._stamps.values() if stamps.start), None)
        self.header_lines = stream.header_lines
        if stream.header_lines:
            message = f"the header stands again {stream.header_lines} times among the rows and was passed over"
            self.repairs.append(Repair("", "header-again", stream.header_lines, message))
        if stream.comment_lines:
            message = f"{stream.comment_lines} comment lines (#) among the rows were passed over"
            self.repairs.append(Repair("", "comment", stream.comment_lines, message))

    @property
    def parts(self) -> int:
        """How many parts the file has, between headers that stand again, comments, or blank lines."""
        return len(part_bounds(self._raw.path, self._look))

    def locate(self, row: int) -> str:
        """Return file and line of a data row."""
        number = next(islice((n for n, _ in self._rows()), row, None), 0)
        return f"{self._raw.path}, line {number}"

    def _parse(self, block: bytes, asks: Sequence[ColumnRequest]) -> Any:
        """Return a table of whole rows; Arrow reads from memory only, so that none of its threads calls Python."""
        try:
            return self._table(block, asks, self._as_text)
        except pa.ArrowInvalid:  # words among the numbers, or rows that do not fit
            self._bad = []
            return self._table(block, asks, lambda _: True)

    def _table(self, block: bytes, asks: Sequence[ColumnRequest], is_text: Callable[[ColumnRequest], bool]) -> Any:
        types = {f"c{ask.position}": pa.string() if is_text(ask) else pa.float64() for ask in asks}
        types |= {f"c{self._date_of[ask.position]}": pa.string() for ask in asks if ask.position in self._date_of}
        delimiter = "\t" if self._look.delimiter == " " else self._look.delimiter
        source: Any = pa.BufferReader(block)
        table = pcsv.read_csv(
            source,
            read_options=pcsv.ReadOptions(column_names=[f"c{n}" for n in range(len(self.names))]),
            parse_options=pcsv.ParseOptions(delimiter=delimiter, invalid_row_handler=self._on_bad_row),
            convert_options=pcsv.ConvertOptions(
                check_utf8=False,
                column_types=types,
                include_columns=list(types),
                null_values=list(NULL_TEXTS),
                decimal_point=self._look.decimal,
            ),
        )
        return table.combine_chunks()

    def _as_text(self, ask: ColumnRequest) -> bool:
        own = ask.decimal is not None and ask.decimal != self._look.decimal
        marked = bool(ask.thousands or self._raw.thousands)
        read = self._stamps.keys() | self._look.cells.keys() | self._look.hexadecimal
        return ask.text or own or marked or ask.position in read

    def _event(self, line: str) -> str:
        """Return the word at the end of a line that is shorter than the others, as of a trigger; else nothing."""
        fields = self._fields(line)
        is_event = len(fields) < len(self.names) and fields[-1][:1].isalpha()
        return fields[-1] if is_event and fields[-1] not in NULL_TEXTS else ""

    def _on_bad_row(self, row: Any) -> Literal["skip", "error"]:
        if event := self._event(row.text):
            self._events[event] += 1
            return "skip"
        self._bad.append(row.text)
        return "skip" if len(self._bad) <= MAX_TRAILER_LINES else "error"

    def _values(self, table: Any, ask: ColumnRequest) -> ColumnValues:
        column = _array(table, ask.position)
        if ask.text:
            return np.array([str(value).strip() for value in column.to_pylist()], dtype=object)
        if ask.position in self._stamps:
            return self._seconds(table, ask)
        if pa.types.is_string(column.type):
            column = self._numbers(column, ask, self._words.setdefault(ask.position, Counter()))
        return np.asarray(column.to_numpy(zero_copy_only=False))

    def _seconds(self, table: Any, ask: ColumnRequest) -> ColumnValues:
        texts = _array(table, ask.position)
        if len(self._stamps) == 1:
            texts = _with_stamps_above(texts)
        if ask.position in self._date_of:
            dates = _array(table, self._date_of[ask.position])
            texts = pc.binary_join_element_wise(pc.utf8_trim_whitespace(dates), pc.utf8_trim_whitespace(texts), " ")
        try:
            return self._stamps[ask.position].seconds(texts)
        except ValueError as error:
            bad = str(error)[1:-1].rpartition(" ")[2] if ask.position in self._date_of else str(error)[1:-1]
            where = next((f"{self._raw.path}, line {n}" for n, line in self._rows() if bad in line), self._raw.path)
            where = f'{where}, column "{self.names[ask.position]}"'
            raise InputError(
                where, f'"{bad}"', "a date or time of day as above it", "mend the line", code="E045"
            ) from error

    def _numbers(self, column: Any, ask: ColumnRequest, words: Counter[str] | None = None) -> Any:
        """Return texts as numbers; words become null and are counted, units behind numbers are taken off."""
        plain = pc.utf8_trim_whitespace(column)
        plain = pc.if_else(pc.is_in(plain, value_set=pa.array(list(NULL_TEXTS))), pa.scalar(None, pa.string()), plain)
        if ask.position in self._look.hexadecimal:
            numbers = plain.dictionary_encode()
            values = [hexadecimal_value(text) for text in numbers.dictionary.to_pylist()]
            return pc.take(pa.array(values, pa.float64()), numbers.indices)
        is_word = pc.invert(pc.match_substring_regex(plain, r"^[^<>≤≥]*\d|^[+-]?inf$"))  # "<1.0" is no reading
        if words is not None and pc.any(is_word).as_py():
            words.update(plain.filter(is_word).drop_null().to_pylist())
        plain = pc.if_else(is_word, pa.scalar(None, pa.string()), plain)
        factors = None
        if ask.position in self._look.cells:
            plain, factors = _without_units(plain, self._look.cells[ask.position])
        if thousands := ask.thousands or self._raw.thousands:
            plain = pc.replace_substring(plain, thousands, "")
        decimal = ask.decimal or self._look.decimal
        if decimal == "," and not thousands:
            plain = pc.replace_substring_regex(plain, r"\.(\d{3})", r"\1")  # no other point stands in such a number
        if decimal not in (".", thousands):
            plain = pc.replace_substring(plain, decimal, ".")
        numbers = plain.cast(pa.float64())
        return numbers if factors is None else pc.multiply(numbers, factors)

    def _rows(self) -> Iterator[tuple[int, str]]:
        """Yield line number (from 1) and text of every data row."""
        last = None if self._look.lines is None else self._look.skip + self._look.lines
        with self._raw.path.open(encoding=self._look.encoding, errors="replace", newline=self._look.line_end) as file:
            header, waiting = (*self._look.repeated, "")[0], list[tuple[int, str]]()
            for number, line in enumerate(chain(islice(file, last), [None])):
                plain = "" if line is None else line.strip()
                if header and plain == header:
                    above = lines_above([text for _, text in waiting], header, self._look.delimiter)
                    del waiting[len(waiting) - above :]
                elif line is not None and number >= self._look.skip and plain and plain[0] != "#":
                    waiting += [(number + 1, line.rstrip("\r\n"))] * (plain not in self._look.repeated)
                ready = waiting if line is None else waiting[:-MAX_LINES_ABOVE]
                yield from (row for row in ready if not self._event(row[1].strip()))
                del waiting[: len(ready)]

    def _drop_last_lines(self, asks: Sequence[ColumnRequest], stream: NormalizedTextStream) -> None:
        """A logger that was cut off in its last line loses that line only; words behind the rows are none of them.

        Any other odd row is an error.
        """
        rows = stream.last_rows()
        readings = [n for n, line in enumerate(rows) if not self._event(line)][-len(self._bad) :]
        last = [self._fields(rows[n]) for n in readings]
        if last != [self._fields(row) for row in self._bad]:
            raise self._first_fault(asks, "")
        if last[0][0] and not is_value(last[0][0]):
            behind = rows[readings[0] :]
            self._events -= Counter(map(self._event, behind))
            message = f'{len(behind)} lines behind the rows, from "{last[0][0]}" on, were passed over'
            self.repairs.append(Repair("", "trailer", len(behind), message))
            return
        if len(last) > 1 or len(last[0]) >= len(self.names):
            raise self._first_fault(asks, "")
        self.rows += 1
        self.losses["truncated"] += 1
        self.repairs.append(Repair("", "truncated", 1, f"line {stream.last_line}, the last, is cut off: left out"))

    def _note_unterminated_last_line(self, stream: NormalizedTextStream) -> None:
        """Say that the last line has no end, and of its last number that it may be cut off, unless all are as long."""
        decimals = {len(line.rpartition(self._look.decimal)[2]) for line in stream.last_rows()}
        kind, what = ("cut-number", "its last number") if len(decimals) > 1 else ("no-line-end", "what comes after it")
        message = f"line {stream.last_line}, the last, has no end: {what} may be cut off; kept"
        self.repairs.append(Repair("", kind, 1, message))

    def _fields(self, row: str) -> list[str]:
        return row.split() if self._look.delimiter == " " else self._look.split(row.rstrip("\r\n"))

    def _first_fault(self, asks: Sequence[ColumnRequest], error: str) -> InputError:
        """Find the first row that does not fit; rows are read by thousands, and one by one where thousands hold one."""
        rows = self._rows()
        while block := [(number, line, self._look.split(line)) for number, line in islice(rows, BLOCK_ROWS)]:
            if any(len(fields) != len(self.names) for *_, fields in block) or not self._readable(block, asks):
                for n, row in enumerate(block):
                    if found := self._fault_of(row, asks):
                        widths = {len(fields) for *_, fields in block[n : n + MIN_ROWS_ABOVE]}
                        return self._another_table(row) if widths == {len(row[2])} - {len(self.names)} else found
        return InputError(str(self._raw.path), error, "rows of numbers", "mend the file", code="E043")

    def _another_table(self, row: Row) -> InputError:
        number, line, fields = row
        found = f"from here on {len(fields)} columns in place of {len(self.names)}: {line[:60]!r}"
        mend = "cut the file there, and give the rows below it a header of their own"
        return InputError(f"{self._raw.path}, line {number}", found, f"{len(self.names)} as above", mend, code="E043")

    def _fault_of(self, row: Row, asks: Sequence[ColumnRequest]) -> InputError | None:
        number, line, fields = row
        where = f"{self._raw.path}, line {number}"
        if len(fields) != len(self.names):
            wanted = f"{len(self.names)} (delimiter {self._look.delimiter!r})"
            return InputError(
                where, f"{len(fields)} columns: {line[:60]!r}", wanted, "mend the line, or state delimiter", code="E043"
            )
        for ask in asks:
            if not self._readable([row], [ask]):
                column = f'{where}, column "{self.names[ask.position]}"'
                mend = "mend the line, or state decimal, thousands, skip_rows or header = false"
                return InputError(column, f'"{fields[ask.position]}"', "a number", mend, code="E043")
        return None

    def _readable(self, rows: Sequence[Row], asks: Sequence[ColumnRequest]) -> bool:
        """Return whether the numbers that are asked for can be read in all rows, each as long as the header."""
        numeric = (ask for ask in asks if not ask.text and ask.position not in self._stamps)
        try:
            for ask in numeric:
                self._numbers(pa.array([fields[ask.position] for *_, fields in rows]), ask)
        except pa.ArrowInvalid:
            return False
        return True


def _array(table: Any, position: int) -> Any:
    column = table.column(f"c{position}")
    return column.chunk(0) if column.num_chunks else pa.array([], column.type)


def _with_stamps_above(texts: Any) -> Any:
    """Return stamps, of which most rows have none, as they stand above: a logger wrote each but once."""
    blank = pc.or_kleene(pc.is_null(texts), pc.equal(pc.utf8_trim_whitespace(texts), ""))
    stamped = np.flatnonzero(~pc.fill_null(blank, True).to_numpy(zero_copy_only=False))
    if stamped.size < MIN_STAMPS or 2 * stamped.size > np.ptp(stamped):
        return texts
    return pc.fill_null_forward(pc.if_else(blank, pa.scalar(None, pa.string()), texts))


def _without_units(cells: Any, first: str) -> tuple[Any, Any]:
    """Return the numbers of cells with units, as texts, and what one of each unit is in the first; None: all alike.

    Raises ArrowInvalid where a cell has a unit of another kind.
    """
    parts = pc.extract_regex(cells, r"^(?P<number>[+-]?[\d.,]+(?:[eE][+-]?\d+)?)\s*(?P<unit>[^\d\s.,+-].*)?$")
    units = pc.fill_null(pc.struct_field(parts, "unit"), "").dictionary_encode()
    texts = units.dictionary.to_pylist()
    if set(texts) <= {first, ""}:
        return pc.struct_field(parts, "number"), None
    try:
        wanted, known = parse_unit(first), [parse_unit(text or first) for text in texts]
    except UnitError as error:
        raise pa.ArrowInvalid(str(error)) from error
    if any(_kind(one) != _kind(wanted) for one in known):
        raise pa.ArrowInvalid("units of several kinds")
    factors = pa.array([one.factor / wanted.factor for one in known])
    return pc.struct_field(parts, "number"), pc.take(factors, units.indices)


def _kind(unit: Unit) -> tuple[Dimension, float, bool]:
    return unit.dimension, unit.offset, unit.gauge


def _dates_beside(look: TextLayout) -> dict[int, int]:
    """Return the column of dates for each column of times of day without dates, where there is one."""
    return {
        place: min(look.dates, key=lambda date: (abs(date - place), date))
        for place in look.stamps - look.dated_stamps
        if look.dates
    }


MIN_STAMPS = 3  # of a column that holds one now and then
MAX_LINE_BYTES = 16 << 20  # bytes of a line
_WORDS_BELOW = re.compile(rb"\n[ \t\r]*\n\s*\"?[A-Za-z\[(*=\x80-\xff]")
_COMMENT = re.compile(rb"^[ \t]*#[^\n]*\n?", re.MULTILINE)
_BLANKS = re.compile(rb"[ \t]+")


class NormalizedTextStream:
    """The rows of a text file as plain UTF-8 without comment lines; blanks as delimiters become one tab.

    Reads the file once, from the front, in whole lines, so that a file of any size passes through bounded memory.
    ``header_lines`` counts the headers that stand again among the rows and were passed over, ``comment_lines``
    counts the comment lines among the rows; ``ends_with_newline`` says whether the last row had an end of line.
    ``last_line`` is the number, from 1, of the last line that holds something;
    ``second_table`` has line (from 1) and text of the first line below the table that belongs to it no more.
    """

    def __init__(self, path: Path, look: TextLayout) -> None:
        self._path = path
        self._file = path.open("rb", buffering=0)
        self._encoding = look.encoding
        self._decoder = (
            None if _is_ascii_compatible(look.encoding) else codecs.getincrementaldecoder(look.encoding)("replace")
        )
        self._blanks = look.delimiter == " "
        self._delimiter = look.delimiter.encode()
        self._padding = re.compile(rb" *%b *" % re.escape(self._delimiter))
        blank = b" " if look.delimiter == "\t" else rb"[ \t]"  # a tab at an end parts a field
        self._edges = re.compile(rb"^%b+|%b+(?=\r?$)" % (blank, blank), re.MULTILINE)
        self._line_end = look.line_end.encode()
        self._rewritings = [*in_bytes(look.rewritings, "\t" if self._blanks else look.delimiter)]
        self._skip = look.skip
        self._left = look.lines
        self._repeated = [line.encode() for line in look.repeated]
        self._rest = self._tail = b""
        self.last_line = 0
        self._split, self._line, self._begun = look.split, 0, False
        self.second_table: tuple[int, str] | None = None
        self._over = False
        self.comment_lines = 0
        self.header_lines = 0
        self.ends_with_newline = True

    def read(self, size: int = -1) -> bytes:
        """Return about ``size`` bytes of whole rows; nothing at the end."""
        while not self._over:
            if block := self._plain(self._lines(max(size, HEAD_BYTES))):
                self._tail = (self._tail + block)[-TAIL_BYTES:]
                return block
        return b""

    def last_rows(self) -> list[str]:
        """Return some of the last rows that were read."""
        lines = self._tail.decode(errors="replace").split("\n")
        return [line.rstrip("\r") for line in lines[-MAX_LAST_ROWS:] if line.strip()]

    def _lines(self, size: int) -> bytes:
        block = self._file.read(size)
        self._over = not block
        if self._decoder is None:
            block = block.rstrip(b"\0")
        else:
            block = self._decoder.decode(block, final=self._over).encode()
        if self._line_end != b"\n":
            block = block.replace(self._line_end, b"\n")
        if self._over:
            block, self._rest = self._rest + block, b""
            self.ends_with_newline = not block.strip()
            return block
        end = block.rfind(b"\n") + 1
        lines, self._rest = (self._rest + block[:end], block[end:]) if end else (b"", self._rest + block)
        if len(self._rest) > MAX_LINE_BYTES:
            found, mend = f"a line of more than {MAX_LINE_BYTES >> 20} MB", "check the file, record or copy it again"
            raise InputError(str(self._path), found, "rows of numbers", mend, code="E041")
        return lines

    def _plain(self, block: bytes) -> bytes:
        while self._skip and block:
            block = block.partition(b"\n")[2]
            self._skip -= 1
            self._line += 1
        if _WORDS_BELOW.search(block):
            block = self._first_table(block)
        self.last_line = self._line + block.rstrip().count(b"\n") + 1 if block.strip() else self.last_line
        self._line, self._begun = self._line + block.count(b"\n"), True
        if self._left is not None:
            block = self._within_part(block)
        if not self._decoder and not block.isascii():
            block = block.decode(self._encoding, "replace").encode()
        if self._repeated and self._repeated[0] and self._repeated[0] in block:
            block = self._without_headers(block)
        if b"#" in block:
            block, comments = _COMMENT.subn(b"", block)
            self.comment_lines += comments
        for pattern, plain in self._rewritings:
            block = pattern.sub(plain, block)
        if self._blanks:
            return _BLANKS.sub(b"\t", self._edges.sub(b"", block))
        padded = b" " + self._delimiter in block or self._delimiter + b" " in block
        return self._padding.sub(self._delimiter, self._edges.sub(b"", block)) if padded else block

    def _first_table(self, block: bytes) -> bytes:
        """Return the lines of a block up to where another table, or words, begin below a blank line."""
        encoding = "utf-8" if self._decoder else self._encoding
        lines = block.decode(encoding, "replace").split("\n")
        above = [line.decode() for line in self._repeated]
        begins = table_end([*above, *lines], self._split, 1 if self._begun else MIN_ROWS_ABOVE)
        if begins is None:
            return block
        begins -= len(above)
        at = next(n for n in range(begins, len(lines)) if lines[n].strip())
        self.second_table, self._over = (self._line + at + 1, lines[at].strip()), True
        return b"\n".join(block.split(b"\n")[:begins]) + b"\n"

    def _within_part(self, block: bytes) -> bytes:
        """Return the lines of a block that belong to the part that is read."""
        lines = block.splitlines(keepends=True)[: self._left]
        self._left = (self._left or 0) - len(lines)
        return b"".join(lines)

    def _without_headers(self, block: bytes) -> bytes:
        """Return a block without the lines of the header that stand again in it, and without those right above them."""
        kept: list[bytes] = []
        for line in block.splitlines(keepends=True):
            if line.strip() not in self._repeated:
                kept.append(line)
            elif line.strip() == self._repeated[0]:
                self.header_lines += 1
                del kept[len(kept) - lines_above(kept, self._repeated[0], self._delimiter) :]
        return b"".join(kept)

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def _is_ascii_compatible(encoding: str) -> bool:
    """Return whether the first 128 characters are bytes as in ASCII: then lines may be cut before they are decoded."""
    plain = bytes(range(128))
    try:
        return plain.decode(encoding).encode() == plain
    except UnicodeDecodeError:
        return False
