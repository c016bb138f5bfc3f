"""CSV and its kin, streamed through pyarrow; what cannot be read is found again, line by line, for the message."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from datetime import datetime
from itertools import chain, islice
from typing import Any, Literal

import numpy as np
import pyarrow as pa
import pyarrow.csv as pcsv

from pneucli.errors import InputError, UnitError
from pneucli.io import arrow_compute as pc
from pneucli.io.clock import Clock
from pneucli.io.column_reader import counted_words, words_message
from pneucli.io.raw_file import NO_CLOCKS, ColumnRequest, ColumnValues, RawFile, Repair
from pneucli.io.text_layout import (
    MAX_LINES_ABOVE,
    NULL_TEXTS,
    TextLayout,
    detect_layout,
    hexadecimal_value,
    is_value,
    lines_above,
)
from pneucli.io.text_stream import NormalizedTextStream
from pneucli.units import Dimension, Unit, parse_unit

BLOCK_BYTES = 4 << 20
BLOCK_ROWS = 4096  # read at once in the search for a fault
HEXADECIMAL = "hexadecimal counts"
TAIL_BYTES = 1 << 16
MAX_TRAILER_LINES = 20  # behind the rows
Row = tuple[int, str, list[str]]  # line number, text, fields


class DelimitedReader:
    """A delimited text file of any size; rows are read in blocks of 4 MB."""

    def __init__(self, raw: RawFile) -> None:
        self._raw = raw
        self._look: TextLayout = detect_layout(raw)
        self.names: Sequence[str] = self._look.names
        self.repairs: list[Repair] = []
        self.rows = 0
        self.clocks = NO_CLOCKS
        self.clock_names: frozenset[int] = frozenset()
        self.losses: Counter[str] = Counter()
        above = {number: unit for number, unit in enumerate(self._look.units) if unit not in NULL_TEXTS}
        self.units = {**self._look.cells, **above, **dict.fromkeys(self._look.hexadecimal, HEXADECIMAL)}
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
        self.cells = frozenset(self._look.cells)  # columns in whose cells a unit stands behind each number
        self.header_lines = 0
        self._bad: list[str] = []
        self._events: Counter[str] = Counter()

    @property
    def start(self) -> datetime | None:
        """When the clock reads 0, where it is a calendar's and has been read."""
        return next((stamps.start for stamps in self._stamps.values() if stamps.start), None)

    def batches(self, asks: Sequence[ColumnRequest]) -> Iterator[list[ColumnValues]]:
        """Yield the asked columns; raises InputError with line and column where a row does not fit."""
        self._bad, self._words, self._events = [], {}, Counter()
        try:
            with NormalizedTextStream(self._raw.path, self._look) as stream:
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
            self._drop_last_lines(asks)
        elif not stream.second_table and not stream.ends_with_newline:
            self._note_unterminated_last_line(stream.last_line)
        for place, words in self._words.items():
            if words:
                message = words_message(self.names[place], words)
                self.repairs.append(Repair("", "words", sum(words.values()), message))
        if self._events:
            message = f"lines that end in a word and hold no readings were passed over: {counted_words(self._events)}"
            self.repairs.append(Repair("", "event", sum(self._events.values()), message))
        self.header_lines = stream.header_lines
        if stream.header_lines:
            message = f"the header stands again {stream.header_lines} times among the rows and was passed over"
            self.repairs.append(Repair("", "header-again", stream.header_lines, message))
        if stream.comment_lines:
            message = f"{stream.comment_lines} comment lines (#) among the rows were passed over"
            self.repairs.append(Repair("", "comment", stream.comment_lines, message))

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
        is_event = 1 < len(fields) < len(self.names) and fields[-1][:1].isalpha()
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

    def _tail(self) -> list[str]:
        """Return the last rows, as far as they stand in the last bytes of the file."""
        start = max(0, self._raw.path.stat().st_size - TAIL_BYTES) & ~3  # whole characters
        with self._raw.path.open("rb") as file:
            file.seek(start)
            text = file.read().decode(self._look.encoding, errors="replace")
        lines = text.rstrip().split(self._look.line_end)[0 if start else self._look.skip :]
        return [line.rstrip("\r") for line in lines[-50:] if line.strip() and not line.lstrip().startswith("#")]

    def _drop_last_lines(self, asks: Sequence[ColumnRequest]) -> None:
        """A logger that was cut off in its last line loses that line only; words behind the rows are none of them.

        Any other odd row is an error.
        """
        last = [self._look.split(line) for line in self._tail()[-len(self._bad) :]]
        if last != [self._fields(row) for row in self._bad]:
            raise self._first_fault(asks, "")
        if last[0][0] and not is_value(last[0][0]):
            message = f'{len(last)} lines behind the rows, from "{last[0][0]}" on, were passed over'
            self.repairs.append(Repair("", "trailer", len(last), message))
            return
        if len(last) > 1 or len(last[0]) >= len(self.names):
            raise self._first_fault(asks, "")
        self.rows += 1
        self.losses["truncated"] += 1
        self.repairs.append(Repair("", "truncated", 1, f"line {self._last_line()}, the last, is cut off: left out"))

    def _note_unterminated_last_line(self, number: int) -> None:
        """Say that the last line has no end, and of its last number that it may be cut off, unless all are as long."""
        decimals = {len(line.rpartition(self._look.decimal)[2]) for line in self._tail()}
        kind, what = ("cut-number", "its last number") if len(decimals) > 1 else ("no-line-end", "what comes after it")
        message = f"line {number}, the last, has no end: {what} may be cut off; kept"
        self.repairs.append(Repair("", kind, 1, message))

    def _last_line(self) -> int:
        """Return the number of the last line that holds something."""
        with self._raw.path.open(encoding=self._look.encoding, errors="replace", newline=self._look.line_end) as file:
            return max(number for number, line in enumerate(file, 1) if line.strip())

    def _fields(self, row: str) -> list[str]:
        return row.split() if self._look.delimiter == " " else self._look.split(row.rstrip("\r\n"))

    def _first_fault(self, asks: Sequence[ColumnRequest], error: str) -> InputError:
        """Find the first row that does not fit; rows are read by thousands, and one by one where thousands hold one."""
        rows = self._rows()
        while block := [(number, line, self._look.split(line)) for number, line in islice(rows, BLOCK_ROWS)]:
            if any(len(fields) != len(self.names) for *_, fields in block) or not self._readable(block, asks):
                for row in block:
                    if found := self._fault_of(row, asks):
                        return found
        return InputError(str(self._raw.path), error, "rows of numbers", "mend the file", code="E043")

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
