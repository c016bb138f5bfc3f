"""Files whose columns are read whole: MATLAB's, HDF5, JSON and TDMS, and what all readers of columns share."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from pneucli.errors import InputError
from pneucli.io.clock import Clock, is_date_or_time, parse_since
from pneucli.io.file_units import unit_in_brackets
from pneucli.io.packed import library_errors_as_input_errors
from pneucli.io.raw_file import ColumnRequest, ColumnValues, Reader, Repair
from pneucli.units import is_unit, parse_unit, same_dimension

FetchColumns = Callable[[Sequence[str]], list[ColumnValues]]


@dataclass
class ColumnReader(Reader):
    """A file of the format ``format``; ``fetch`` opens it and returns the columns of the given names, no others.

    Columns are arrays of numbers, of calendar time, or of texts; ``texts`` are those that are neither numbers nor
    stamps. ``start`` is when the clock reads 0, where the file says it or once stamps were read. ``own_clocks`` has the
    column of stamps of each column whose clock the file knows; ``shared_clocks`` stand for the clock of whatever column
    they are read with. All are by name.
    """

    path: Path
    format: str
    names: Sequence[str]
    fetch: FetchColumns
    own_units: Mapping[str, str] = field(default_factory=dict)
    repairs: list[Repair] = field(default_factory=list)
    rows: int = 0
    losses: Counter[str] = field(default_factory=Counter)
    start: datetime | None = None
    own_clocks: Mapping[str, str] = field(default_factory=dict)
    shared_clocks: Collection[str] = ()
    texts: Collection[str] = ()

    @classmethod
    def of_columns(
        cls,
        path: Path,
        format: str,
        columns: Mapping[str, ColumnValues],
        units: Mapping[str, str],
        clocks: Mapping[str, str],
        start: datetime | None = None,
        texts: Collection[str] = (),
    ) -> ColumnReader:
        """Return the reader of columns that were read already; units and clocks are by the names of columns."""
        if clocks and "time" not in columns:  # stands for each column's own clock
            longest = max(dict.fromkeys(clocks.values()), key=lambda name: columns[name].size)
            columns = {**columns, "time": columns[longest]}
            units = {**units, **({"time": units[longest]} if longest in units else {})}
        shared = ("time",) * bool(clocks)
        own = {"start": start, "own_clocks": clocks, "shared_clocks": shared, "texts": texts}
        return cls(path, format, list(columns), lambda wanted: [columns[name] for name in wanted], units, **own)  # type: ignore[arg-type]

    @classmethod
    def of_arrays(
        cls,
        path: Path,
        format: str,
        shapes: Mapping[str, Sequence[int]],
        load: Callable[[Collection[str]], Mapping[str, ColumnValues]],
        texts: Collection[Sequence[str]] = (),
    ) -> ColumnReader:
        """Return the reader of arrays by name, each a column or a matrix of them; ``load`` reads the named ones.

        ``texts`` are the arrays of texts beside them, which may name the columns of a matrix and their units.
        """
        owner = {column: name for name, shape in shapes.items() for column in column_names(name, shape)}
        titles, units = dict[str, str](), dict[str, str]()
        for name, shape in shapes.items():
            called, said = titled(name, column_names(name, shape), texts)
            titles, units = titles | called, units | {called.get(column, column): unit for column, unit in said.items()}
        keys = {titles.get(column, column): column for column in owner}

        def fetch(wanted: Sequence[str]) -> list[ColumnValues]:
            arrays = load(dict.fromkeys(owner[keys[name]] for name in wanted).keys())
            columns = {key: one for name, array in arrays.items() for key, one in split_columns(name, array).items()}
            return [np.ravel(columns[keys[name]]) for name in wanted]

        return cls(path, format, list(keys), fetch, units)

    def __post_init__(self) -> None:
        place = {name: number for number, name in enumerate(self.names)}
        known = self.own_clocks.items()
        self.units = {n: unit for n, name in enumerate(self.names) if (unit := self.own_units.get(name))}
        self.clocks = {place[name]: place[clock] for name, clock in known if name in place and clock in place}
        self.clock_names = frozenset(n for n, name in enumerate(self.names) if name in self.shared_clocks)
        self.labels = frozenset(n for n, name in enumerate(self.names) if name in self.texts)
        self.stamps: set[int] = set()

    def batches(self, asks: Sequence[ColumnRequest]) -> Iterator[list[ColumnValues]]:
        """Yield all rows at once; raises InputError where the columns differ in length."""
        wanted = [self.names[ask.position] for ask in asks]
        with library_errors_as_input_errors(self.path, self.format, self.repairs):
            fetched = dict(zip(dict.fromkeys(wanted), self.fetch(list(dict.fromkeys(wanted))), strict=True))
        for name, column in fetched.items():
            if column.size != fetched[wanted[0]].size:
                found = f'{column.size} values, but "{wanted[0]}" has {fetched[wanted[0]].size}'
                where = f'{self.path}, column "{name}"'
                raise InputError(where, found, "columns of one length", "take signals of one clock only", code="E042")
        self.rows += fetched[wanted[0]].size
        yield [self._values(ask, fetched[name]) for ask, name in zip(asks, wanted, strict=True)]

    def _values(self, ask: ColumnRequest, column: ColumnValues) -> ColumnValues:
        if ask.text:
            return np.array([as_text(value) for value in column], dtype=object)
        try:
            values, clock, words = column_values(column)
        except ValueError as error:
            where = f'{self.path}, column "{self.names[ask.position]}"'
            mend = "take it with where, as a label, or export numbers"
            raise InputError(where, str(error), "numbers", mend, code="E043") from error
        if words:
            name = self.names[ask.position]
            self.repairs.append(Repair("", "words", sum(words.values()), words_message(name, words)))
        self.stamps |= {ask.position} if clock else set()
        self.start = self.start or (clock and clock.start) or parse_since(self.units.get(ask.position, ""))
        return values

    def locate(self, row: int) -> str:
        """Return file and row (from 1)."""
        return f"{self.path}, row {row + 1}"


def column_names(name: str, shape: Sequence[int]) -> list[str]:
    """Return what an array's columns are called: its ``name``, or ``name/1``, ... along a matrix's shorter side."""
    sides = [side for side in shape if side != 1]
    if len(sides) < 2:
        return [name]
    return [f"{name}/{number}" for number in range(1, min(sides) + 1)] if len(sides) == 2 else []


def split_columns(name: str, array: ColumnValues) -> dict[str, ColumnValues]:
    """Return the columns of an array, shape ``(n,)`` each, by the names of :func:`column_names`."""
    array = array.reshape([side for side in array.shape if side != 1] or [-1])
    if array.ndim == 2 and array.shape[0] >= array.shape[1]:
        array = array.T
    return dict(zip(column_names(name, array.shape), array if array.ndim == 2 else [array], strict=False))


def column_values(column: Any) -> tuple[ColumnValues, Clock | None, Counter[str]]:
    """Return a column as float64, shape ``(n,)``, the clock of stamps, and the words among its numbers by count.

    Calendar time becomes seconds since the first stamp, and words become NaN. Raises ValueError where texts are no
    numbers, or where words are as many as numbers.
    """
    array = np.asarray(column).ravel()
    clock = Clock()
    if array.dtype.kind in "mM":
        return clock.seconds(array), clock, Counter()
    if array.dtype.kind not in "OUS":
        return array.astype(np.float64), None, Counter()
    texts = [as_text(value) for value in array]
    known = [text for text in texts if text]
    if known and all(map(is_date_or_time, known[:STAMPS_TRIED])):
        return clock.seconds(pa.array(texts, pa.string())), clock, Counter()
    numbers = np.array([number_in(text) for text in texts], dtype=np.float64)
    words = Counter(text for text, number in zip(texts, numbers, strict=True) if text and np.isnan(number))
    words -= Counter({text: count for text, count in words.items() if text.lower() in _NO_NUMBER})
    if words and 2 * sum(words.values()) >= len(known):
        raise ValueError(f'texts, such as "{next(iter(words))}"')
    return numbers, None, words


def words_message(column: str, words: Mapping[str, int]) -> str:
    """Return what is said of words that stand among the numbers of a column."""
    return f'"{column}": {counted_words(words)}: no numbers; missing'


def counted_words(words: Mapping[str, int]) -> str:
    """Return the most frequent words with their counts.

    >>> counted_words({"BAD": 2, "STOP": 1})
    '"BAD" 2 times, "STOP" 1 times'
    """
    return ", ".join(f'"{word}" {count} times' for word, count in Counter(words).most_common(5))


def is_label_column(texts: Collection[Any]) -> bool:
    """Return whether a column of texts holds labels: neither numbers nor dates and times."""
    known = [text for text in map(as_text, texts) if text and text.lower() not in _NO_NUMBER]
    values = sum(np.isfinite(number_in(text)) or is_date_or_time(text) for text in known)
    return bool(known) and 2 * values <= len(known)


def number_in(text: str | float) -> float:
    """Return the number that a text is, NaN where it is none."""
    try:
        return float(text)
    except ValueError:
        return np.nan


def as_text(value: Any) -> str:
    """Return what stands in a cell as a text; empty where nothing stands."""
    if value is None:
        return ""
    return value.decode(errors="replace").strip("\0 ") if isinstance(value, bytes) else str(value).strip()


_FACTORS = re.compile(r"(?i)scale(?:_?factor)?|scaling|gain|slope|conversion(?:_?factor)?|multiplier")
_OFFSETS = re.compile(r"(?i)(?:add_?)?offset|intercept")


def packing(said: Mapping[str, Any], *, whole: bool) -> tuple[float, float] | None:
    """Return factor and offset that attributes say of packed numbers; None where they may be meant in several ways.

    Those of CF (conventions 1.11, section 8.1) are certain. Others count for ``whole`` numbers alone: a gain below 1 is
    one count in the unit, a larger one may be an amplifier's, and a whole offset one of counts. What Neurodata Without
    Borders calls ``conversion`` is no amplifier's, and its ``offset`` stands in the unit.
    """
    is_nwb = whole and "conversion" in said
    is_cf = is_nwb or not whole or bool(said.keys() & {"scale_factor", "add_offset"})
    clear = ("conversion", "offset") if is_nwb else ("scale_factor", "add_offset")
    factor = _said_number(said, re.compile(clear[0]) if is_cf else _FACTORS, 1.0)
    offset = _said_number(said, re.compile(clear[1]) if is_cf else _OFFSETS, 0.0)
    certain = is_cf or offset == 0.0 or (abs(factor) < 1.0 and offset % 1.0 != 0.0)
    return (factor, offset) if certain and (is_cf or abs(factor) <= 1.0) else None


def _said_number(said: Mapping[str, Any], key: re.Pattern[str], otherwise: float) -> float:
    found = (number_in(np.ravel(own)[0]) for name, own in said.items() if key.fullmatch(name) and np.size(own) == 1)
    return next(found, otherwise)


def titles_and_units(arrays: Iterable[Sequence[str]], count: int) -> tuple[Sequence[str], Sequence[str]]:
    """Return what arrays of texts beside a matrix call its columns, and their units; each empty where none tells."""
    told = [own for own in arrays if len(own) == count > 1 and all(own)]
    units = next((own for own in told if all(map(is_unit, own))), ())
    return next((own for own in told if own is not units and len({*own}) == count), ()), units


def titled(
    name: str, columns: Sequence[str], texts: Collection[Sequence[str]]
) -> tuple[dict[str, str], dict[str, str]]:
    """Return the titles and the units that arrays of texts give to the columns of a matrix, by column."""
    called, said = titles_and_units(texts, len(columns))
    titles = {column: f"{name}/{text}" for column, text in zip(columns, called, strict=False)}
    return titles, dict(zip(columns, said, strict=False))


STAMPS_TRIED = 20  # texts of a column that tell whether it holds dates and times
_NO_NUMBER = frozenset(("", "nan", "none", "null", "-", "--", "n/a", "na"))


def clocks_by_group(names: Sequence[str], sizes: Mapping[str, int]) -> dict[str, str]:
    """Return the clock of each column by name: the column of its group that is called like one and is as long.

    None where there is one group, or one clock for all: then every column of stamps is a column like others.
    """
    own: dict[str, str] = {}
    for name in names:
        group, slash, last = name.rpartition("/")
        if slash and _CLOCK_NAME.fullmatch(last):
            own.setdefault(group, name)
    found = {}
    for name in names:
        clock = own.get(name.rpartition("/")[0])
        if clock is not None and clock != name and sizes.get(clock) == sizes.get(name):
            found[name] = clock
    return found if len(set(found.values())) > 1 else {}


_CLOCK_NAME = re.compile(
    r"(?i)(?:time(?:_s)?|t(?:_s)?|zeit|(?:time)?stamps?|tout|temps|tiempo|clock)\s*(?:[\[(].*[\])])?"
)
# what single values that say a rate, or the time between samples, are called, and the unit behind
_CYCLE = r"sampl\w*?|scan|abtast|cycle|zyklus|task|aufzeichnungs"
_TAKEN = rf"{_CYCLE}|data|acquisition|record\w*?|mess"
_RATE_NAMES = re.compile(rf"(?i)(?:fs|f_s|fsample|rate|(?:{_TAKEN})[ _]?(?:rate|fre[qk]\w*?))(?![^\W_])")
_PERIOD_NAMES = re.compile(
    rf"(?i)(?:ts|t_s|d[tx]|isi|delta(?:[ _]?[tx])?|tsample|time[ _]?step|(?:x[ _]?)?increment|h[ _]?resolution|"
    rf"zeitraster|(?:{_CYCLE})[ _]?(?:time|zeit|takt)|(?:(?:{_TAKEN})[ _]?)?(?:intervall?|period))(?![^\W_])"
)
_TICK_NAMES = re.compile(r"(?i)(?:ticks?|timer|counter|qpc)[ _]?(?:fre[qk]\w*|rate|per[ _]?s(?:ec\w*)?)(?![^\W_])")
_UNIT_BEHIND = re.compile(r"[\W_]([A-Za-zµ]+)\W*$")
SAME_RATE = 0.02  # by which two statements of one rate may differ


def stated_period(scalars: Mapping[str, float]) -> tuple[str, float] | None:
    """Return what single values say of the time between two samples (s), with the name that says it; None: nothing."""
    told = {name: own * _factor_in(name) for name, own in scalars.items() if own > 0 and tells_rate(name)}
    found = {name: 1.0 / own if is_rate(name) else own for name, own in told.items()}
    agree = found and max(found.values()) < (1 + SAME_RATE) * min(found.values())
    return next(iter(found.items())) if agree else None


def _factor_in(name: str) -> float:
    """Return what one is in Hz or s, in the unit at the end of a name: ``Period (ns)``, ``rate_kHz``."""
    unit = unit_in_brackets(name) or (behind[1] if (behind := _UNIT_BEHIND.search(name)) else "")
    timed = is_unit(unit) and same_dimension(unit, "Hz" if is_rate(name) else "s")
    return parse_unit(unit).factor if timed else 1.0


def tells_ticks(name: str) -> bool:
    """Return whether a single value of this name is how many ticks of its counter a clock has in a second."""
    return _TICK_NAMES.search(name) is not None


def is_rate(name: str) -> bool:
    """Return whether a single value of this name is a rate."""
    return _RATE_NAMES.match(name.rpartition("/")[2].strip()) is not None


def tells_rate(name: str) -> bool:
    """Return whether a single value of this name is a rate, or the time between samples."""
    return is_rate(name) or _PERIOD_NAMES.match(name.rpartition("/")[2].strip()) is not None
