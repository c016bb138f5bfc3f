"""Part of ``init``: what stands in a raw file of which nothing is known, and how its tables hold channels and runs.

A long table has a label, a stamp and a value in each row. Runs stand below one another under a number of the run, or
beside one another as repeated columns.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.init.clock_columns import computed_clocks, is_increasing, may_be_clock, paired_clocks
from pneucli.init.column_names import NOUNS, read_name
from pneucli.init.role_evidence import pressure_behind_valve
from pneucli.init.stated_scales import with_stated_scales
from pneucli.init.survey_types import Column, Survey
from pneucli.init.units import told_state
from pneucli.io.clock import CounterClock, continuous_stamps
from pneucli.io.delimited import DelimitedReader
from pneucli.io.file_units import WrittenUnit, read_unit, unit_in_brackets, unit_in_file
from pneucli.io.formats import is_text, open_raw, unpacked
from pneucli.io.packed import named_as
from pneucli.io.raw_file import ColumnKey, ColumnRequest, ColumnValues, RawFile, Reader
from pneucli.io.signal_repairs import JUDGES, bad_rows, good_words
from pneucli.io.text_layout import head_of
from pneucli.io.text_sniffer import MAX_PREAMBLE_LINES, SniffedLayout, apply_sniffed, sniff, stated_numbers
from pneucli.io.timestamp_order import NEWEST_FIRST, Table, align_tables, falls
from pneucli.paths import file_on_disk
from pneucli.units import is_unit, parse_unit, same_dimension

MAX_LABELS = 30  # channels of a long table
MAX_RUNS = 200  # runs in one table
MIN_PAUSE = 100  # samples between two runs
MIN_REPEATED_STAMPS = 0.2  # of the rows of a long table whose channels were sampled together
MIN_READINGS = 2  # that repeat in an array of structs, each of which is a run: of one each is another channel
MIN_NAMED = 0.5  # of the labels, that name a quantity
_VALUE = re.compile(
    r"(?i)(?:var|tag|signal|raw)?[\s_]?value|val|payload|reading|data|y|wert|valeur|valor|_value|numeric_value"
)
_LABEL = re.compile(
    r"(?i)topic|tag|name|node|channel|signal|variable|sensor|metric|field|item|point|label|_measurement"
)
_SOURCE = re.compile(r"(?i)source|device|measured|origin")
_SERVER = re.compile(r"(?i)server|receiv|arriv|logged|ingest")
_RUN_WORDS = r"run|test|trial|rep|repeat|repetition|measurement|recording|versuch|messung|lauf|essai|prueba"
_RUN_COLUMN = re.compile(
    rf"(?i)(?:.*[_\s/.])?(?:{_RUN_WORDS}|experiment|batch|shot)s?(?:[_\s.]*(?:id|no|nr|number|index|#))?\.?"
)
_RUN_TAG = re.compile(rf"(?i)[\s_\-./(#]*(?<![a-z])(?:{_RUN_WORDS})s?[\s_\-.#/]*(\d+)\)?")
_VALIDITY = re.compile(r"(?i)(.+?)[\s_./:-]*(?:is[\s_]?)?(valid(?:ity)?|ok|good|quality|status)")
_ELEMENT = re.compile(r"(?<=\w)/(\d+)(?=/)")  # of an array of structs

Labels = Mapping[str, ColumnValues]  # columns of text, or of numbers that were read as text, by name


def long_table(columns: Sequence[Column], labels: Labels) -> list[Column]:
    """Return clock and channels of a long table, however many further columns it has; nothing where it is none.

    The label is the column of text by which stamps rise within each channel; the value is the column of numbers that is
    no stamp and changes; of several stamps that of the source counts.
    """
    stamps = computed_clocks(columns) or [one for one in columns if _may_be_stamp(one)]
    others = [one for one in columns if not any(one is stamp or _is_part(one, stamp) for stamp in stamps)]
    values = [one for one in others if one.finite_values.size and np.ptp(one.finite_values) > 0]
    named = [one for one in values if _VALUE.fullmatch(one.name.rpartition("/")[2].strip())]
    if not stamps or not (len(values) == 1 or len(named) == 1):
        return []
    value = named[0] if len(named) == 1 else values[0]
    stamps.sort(key=lambda one: (bool(_SERVER.search(one.name)), not _SOURCE.search(one.name)))
    parted = ([key for key, own in labels.items() if _parts_channels(own, one.values)] for one in stamps)
    clock, fitting = next(((one, keys) for one, keys in zip(stamps, parted, strict=True) if keys), (stamps[0], []))
    if not fitting:
        return []
    key = max(fitting, key=lambda name: (bool(_LABEL.search(name)), -len(set(labels[name]))))
    texts = labels[key]
    names = dict.fromkeys(text for text in texts if text)
    said = next((own for other, own in labels.items() if other != key and all(map(is_unit, set(own)))), None)
    numbers = (one for one in values if one is not value and JUDGES.fullmatch(one.name.strip()))
    beside = {one.name: [f"{number:g}" for number in one.values] for one in numbers}
    judged = bad_rows({**labels, **beside})
    split, good = [], np.ones(texts.size, dtype=bool) if judged is None else ~judged[1]
    for name in names:
        rows = (texts == name) & good
        one = replace(value, name=name, values=value.values[rows], where=(key, name), unit="")
        split.append(one if said is None else with_unit_beside(one, said[rows]))
    return [replace(clock, values=clock.values[(texts == split[0].name) & good]), *split]


def with_unit_beside(column: Column, texts: ColumnValues | None) -> Column:
    """Return a column in the unit that a column beside it holds; one that changes from row to row is asked for."""
    units = [] if texts is None or column.unit else [*dict.fromkeys(text for text in texts if text)]
    if not units or not all(map(is_unit, units)):
        return column
    return in_unit(column, read_unit(units[0])) if len(units) == 1 else replace(column, written=" or ".join(units))


def in_unit(column: Column, unit: WrittenUnit) -> Column:
    """Return a column in a unit that a line above the table says; a word that is none is no unit of it."""
    return replace(column, unit=unit.unit, scale=unit.scale) if unit.unit and unit.certain else column


def with_validity(
    columns: Sequence[Column], labels: Labels, as_text: Callable[[Column], ColumnValues]
) -> tuple[list[Column], set[str]]:
    """Return the columns without the rows that a column of their own calls bad, and the names of these columns.

    It is called as the other one with a word more (``p1_valid``, ``p1 status``), and holds one word or number for good
    and others for bad.
    """
    stems = [_letters(re.sub(r"[\[(].*", "", one.name)) for one in columns]
    bare = {stem: one for stem, one in zip(stems, columns, strict=True) if stem and stems.count(stem) == 1}
    by_name = {one.name: one for one in columns}
    found: dict[int, tuple[ColumnKey, str, ColumnValues]] = {}
    for name in [*labels, *by_name]:
        called = _VALIDITY.fullmatch(name.strip())
        own = bare.get(_letters(called[1])) if called else None
        if called is None or own is None or own.name == name:
            continue
        number = by_name.get(name)
        texts = labels[name] if name in labels else as_text(number) if number is not None else None
        if (
            texts is not None
            and texts.size == own.values.size
            and len(good := good_words(texts, called[2].lower())) == 1
        ):
            key: ColumnKey = name if name in labels or number is None else number.key
            found[id(own)] = key, good[0], texts == good[0]
    used = {str(key) for key, *_ in found.values()}
    kept = [one for one in columns if str(one.key) not in used]
    return [_valid_rows(one, *found[id(one)]) if id(one) in found else one for one in kept], used


def _valid_rows(column: Column, key: ColumnKey, good: str, rows: ColumnValues) -> Column:
    return replace(column, where=(key, good), values=np.where(rows.astype(bool), column.values, np.nan))


def _is_part(column: Column, stamp: Column) -> bool:
    return stamp.computed and f"`{column.key}`" in str(stamp.key)


def _letters(name: str) -> str:
    return re.sub(r"[\W_]", "", name.lower())


def _may_be_stamp(column: Column) -> bool:
    """Return whether a column never goes back, and is called like a clock or in a unit of time."""
    known = column.finite_values
    rises = bool(known.size > 1 and np.mean(np.diff(known) >= 0) > 0.9 and np.ptp(known) > 0)
    return rises and may_be_clock(column)


def _parts_channels(texts: ColumnValues, clock: Array) -> bool:
    """Return whether labels part the rows into channels: stamps rise in each, and repeat over all or names tell."""
    names = [name for name in dict.fromkeys(texts) if name]
    if not 1 < len(names) <= min(MAX_LABELS, texts.size // 2):
        return False
    if not all(_rises(clock[texts == name]) for name in names):
        return False
    repeated = float(np.mean(np.diff(clock) == 0)) if clock.size > 1 else 0.0
    nouns = [bool(read_name(Column(name, name, "", clock[:0]), False).nouns) for name in names]
    return repeated > MIN_REPEATED_STAMPS or float(np.mean(nouns)) >= MIN_NAMED


def _rises(stamps: Array) -> bool:
    known = stamps[np.isfinite(stamps)]
    return known.size > 0 and (known.size < 2 or float(np.mean(np.diff(known) > 0)) > 0.9)


def runs_below_one_another(
    columns: Sequence[Column], labels: Labels, as_text: Callable[[Column], ColumnValues]
) -> list[tuple[str, list[Column]]]:
    """Return the columns of each run of a table in which a column says the run; nothing where none does.

    Each value of that column stands in one stretch of rows; the clock starts anew there, or the column is called so.
    """
    counted = {one.name: one for one in columns if _is_run_number(one)}
    found: dict[str, ColumnValues] = {name: as_text(one) for name, one in counted.items()} | dict(labels)
    for name, texts in found.items():
        edges = np.flatnonzero(texts[1:] != texts[:-1]) + 1
        names = list(dict.fromkeys(texts))
        if not 1 < len(names) == edges.size + 1 <= MAX_RUNS or texts.size < 8 * len(names):
            continue
        others = [one for one in columns if one.name != name]
        places = {one.name for one in others if name in counted and read_name(one, False).nouns}  # of a map
        clocks = (one for one in others if may_be_clock(one) or one.name not in places)
        starts_anew = any(_table_starts_anew(one.values, edges) for one in clocks)
        if starts_anew or _RUN_COLUMN.fullmatch(name.strip()):
            key: ColumnKey = counted[name].key if name in counted else name
            return [(str(run), _rows_of(others, key, str(run), texts == run)) for run in names]
    return []


def _is_run_number(column: Column) -> bool:
    known = column.values
    if column.unit or read_name(column, False).has(NOUNS["time"]):
        return False
    whole = bool(known.size and np.all(np.isfinite(known)) and np.all(known == np.floor(known)))
    return whole and 1 < np.unique(known).size <= MAX_RUNS


def _table_starts_anew(values: Array, edges: ColumnValues) -> bool:
    """Return whether a column rises but where the runs meet, and goes back, or on after a pause, at each of these."""
    if np.count_nonzero(np.diff(values) < 0) > MAX_RUNS:
        return False
    steps = np.diff(CounterClock().unwrap(values))
    inside, at_edges = np.delete(steps, edges - 1), steps[edges - 1]
    rises = bool(inside.size) and bool(np.all(inside[np.isfinite(inside)] > 0))
    return rises and bool(np.all((at_edges < 0) | (at_edges > MIN_PAUSE * np.median(inside))))


def _rows_of(columns: Sequence[Column], key: ColumnKey, run: str, rows: ColumnValues) -> list[Column]:
    called = sorted(columns, key=may_be_clock, reverse=True)
    clock = next((one for one in called if one.unit == "s" or is_increasing(one.values[rows])), None)
    return [replace(one, values=one.values[rows], where=None if one is clock else (key, run)) for one in columns]


def runs_beside_one_another(columns: Sequence[Column]) -> list[tuple[str, list[Column]]]:
    """Return the columns of each run of a table whose names say it, such as ``"p1 run2"``; nothing where none do.

    Columns without a run belong to each of them. Names that stand again from the clock's on say it as well.
    """
    names = [one.name for one in columns]
    width = names.index(names[0], 1) if names and names.count(names[0]) > 1 else 0
    if width > MIN_READINGS and names == names[:width] * (len(names) // width) and may_be_clock(columns[0]):
        starts = range(0, len(names), width)
        return [(str(run), [*columns[at : at + width]]) for run, at in enumerate(starts, 1)]
    tags = [_RUN_TAG.search(one.name) or _ELEMENT.search(one.name) for one in columns]
    runs = list(dict.fromkeys(tag[1] for tag in tags if tag))
    plain = [one.name.replace(tag[0], "") if tag else one.name for one, tag in zip(columns, tags, strict=True)]
    table = list(zip(columns, plain, tags, strict=True))
    repeated = {stem for one, stem, tag in table if tag and plain.count(stem) > 1 and not may_be_clock(one)}
    called = any(_RUN_TAG.search(one.name) for one in columns)
    if len(runs) < 2 or len(repeated) < (1 if called else MIN_READINGS):
        return []
    return [(run, [replace(one, name=stem) for one, stem, tag in table if not tag or tag[1] == run]) for run in runs]


MAX_SURVEY_ROWS = 200_000  # rows that are looked at
SPARSE = 0.1  # of the rows of the longest clock: fewer are those of a command that is logged on change
_RATE = re.compile(r"\((\d+(?:\.\d+)?) (k)?Hz\)")
MAX_TEXTS = 3  # texts of a column that are shown


def survey_parts(raw: RawFile) -> list[Survey]:
    """Read what there is; a file of several runs is several recordings.

    Runs begin where the header and the clock start anew, or where a column says the run, or stand beside one another.
    Raises InputError as :func:`survey_file` does.
    """
    found = survey_file(raw)
    if found.parts:
        return [survey_file(replace(raw, part=number)) for number in range(1, found.parts + 1)]
    return [replace(found, columns=columns, run=run) for run, columns in found.runs] or [found]


def survey_file(raw: RawFile) -> Survey:
    """Read what there is; raises InputError where it cannot be read, or holds no numbers."""
    if not file_on_disk(raw.path).exists():
        raise InputError(str(raw.path), "no such file", "a raw file", "check the path", code="E002")
    inner = unpacked(raw.path)
    with named_as(raw.path, inner):
        found = _survey_text(replace(raw, path=inner)) if is_text(inner) else _survey_binary(replace(raw, path=inner))
    return replace(found, raw=replace(found.raw, path=raw.path))


def _survey_text(raw: RawFile) -> Survey:
    found = sniff(raw)
    stated = apply_sniffed(raw, found)
    reader = DelimitedReader(stated)
    columns, labels = _text_columns(reader, found)
    if max((one.values.size for one in columns), default=0) < 2:
        told = "one row of numbers" if columns else "no column of numbers"
        raise InputError(str(raw.path), told, "rows of numbers", "say --skip-rows or --delimiter", code="E041")
    bare = replace(stated, delimiter=raw.delimiter)
    plain = raw.delimiter is None and _same_table(bare, reader)
    lines = head_of(raw).lines
    columns = with_stated_scales(columns, lines[:MAX_PREAMBLE_LINES], True)
    columns, unused, runs = _shaped(reader, columns, labels)
    parts = 0 if runs else _parts(columns, reader)
    scalars, state = stated_numbers(lines, found), told_state(lines[:MAX_PREAMBLE_LINES])
    return Survey(bare if plain else stated, True, columns, scalars, unused, parts, runs, state=state)


def _shaped(
    reader: Reader, columns: Sequence[Column], labels: Mapping[str, ColumnValues]
) -> tuple[list[Column], list[str], list[tuple[str, list[Column]]]]:
    """Return the columns of a table as one of signals, what is left out in words, and the columns of each run."""
    words = [one.message for one in reader.repairs if one.kind in ("words", "matlab-object")]
    if any(falls(one.values) for one in columns if may_be_clock(one)):
        columns = [replace(one, values=one.values[::-1]) for one in columns]
        labels = {key: own[::-1] for key, own in labels.items()}
        words.append(NEWEST_FIRST)
    if long := long_table(columns, labels):
        used = {one.where[0] for one in long if one.where is not None}
        used |= {key for key, own in labels.items() if all(map(is_unit, set(own)))}
        taken = {one.key for one in long}
        further = [one for one in columns if one.key not in taken and not one.unit and not _is_part(one, long[0])]
        beside = {one.name: [f"{value:g}" for value in one.values] for one in further} | dict(labels)
        return long, [*words, *(_counted(key, own) for key, own in beside.items() if key not in used)], []

    def as_text(column: Column) -> ColumnValues:
        return _read(reader, [ColumnRequest(list(reader.names).index(str(column.key)), text=True)])[0]

    named = all(isinstance(one.key, str) and list(reader.names).count(one.key) == 1 for one in columns)
    timed = named and not computed_clocks(columns)
    runs = runs_below_one_another(columns, labels, as_text) if timed else []
    runs = runs or runs_beside_one_another(columns)
    valid, told = with_validity(columns, labels, as_text) if timed and not runs else (list(columns), set[str]())
    clocked = [(run, _with_clocks(own)) for run, own in runs]
    by_run = {one.where[0] for _, own in runs for one in own if one.where is not None}
    unused = [*words, *(_counted(key, own) for key, own in labels.items() if key not in by_run | told)]
    return (clocked[0][1] if clocked else _with_clocks(valid)), unused, clocked


def _with_clocks(columns: Sequence[Column]) -> list[Column]:
    found = [*computed_clocks(columns), *columns]
    behind = pressure_behind_valve(found, [read_name(one, False) for one in found])
    return _aligned(paired_clocks([*found, *behind]))


def _counted(key: str, texts: Iterable[Any]) -> str:
    """Return a column of text in words: what stands in it, and how often."""
    often = Counter(str(text) for text in texts if text)
    listed = ", ".join(f'"{text}" {count} times' for text, count in often.most_common(MAX_TEXTS))
    return f'"{key}": texts, {listed}' + ", ..." * (len(often) > MAX_TEXTS)


def _parts(columns: Sequence[Column], reader: DelimitedReader) -> int:
    """Return how many recordings a text holds, between headers, comments or blank lines; 0 where it is one.

    A clock goes back, or pauses, at each of them; where the header stands again it need go back but once.
    """
    clock = next((one.finite_values for one in columns if is_increasing(one.finite_values)), np.empty(0))
    steps = np.diff(CounterClock().unwrap(clock)) if clock.size else clock
    usual = np.median(steps) if steps.size else 0.0
    back, pauses = (int(np.count_nonzero(own)) for own in (steps < 0, steps > MIN_PAUSE * usual))
    marks = reader.parts - 1 if back or pauses else 0
    return marks + 1 if marks and (marks in (back, pauses) or (back and reader.header_lines)) else 0


def _same_table(raw: RawFile, reader: DelimitedReader) -> bool:
    """Return whether reading finds the same columns by itself."""
    try:
        return DelimitedReader(raw).names == reader.names
    except InputError:
        return False


def _text_columns(reader: DelimitedReader, found: SniffedLayout) -> tuple[list[Column], dict[str, ColumnValues]]:
    """Return the columns of numbers, and those of text by their keys."""
    numbers = [n for n in range(len(reader.names)) if n not in {*reader.labels, *reader.dates}]
    asks = [ColumnRequest(n, thousands=found.thousands.get(n)) for n in numbers]
    labels = [ColumnRequest(n, text=True) for n in sorted(reader.labels)]
    read = _read(reader, [*asks, *labels])
    columns = []
    for ask, values in zip(asks, read, strict=False):
        name = found.names[ask.position] if ask.position < len(found.names) else ""
        often = reader.names.count(reader.names[ask.position]) > 1
        key: ColumnKey = ask.position + 1 if not found.header or often or not name else name
        title = found.titles[ask.position] if ask.position < len(found.titles) else ""
        one = _column(reader, ask.position, key, title or name, values, ask.thousands)
        above = found.units[ask.position] if ask.position < len(found.units) else ""
        columns.append(one if one.unit or not above else in_unit(one, read_unit(above)))
    by_place = {ask.position: values for ask, values in zip(labels, read[len(asks) :], strict=True)}
    columns = [with_unit_beside(one, by_place.get(ask.position + 1)) for ask, one in zip(asks, columns, strict=True)]
    if not any(found.names):  # each row says what stands behind: "valve_V;5.00;p1_bar;1.02"; one text is the rig's
        before = [set(by_place.get(ask.position - 1, ())) for ask in asks]
        if sum(len(own) == 1 for own in before) > 1:
            named = zip(columns, before, strict=True)
            columns = [replace(one, name=str(*own)) if len(own) == 1 and not one.name else one for one, own in named]
    return columns, {str(reader.names[place]): values for place, values in by_place.items()}


def _column(
    reader: Reader, place: int, key: ColumnKey, name: str, values: Array, thousands: str | None = None
) -> Column:
    """Return a column with the unit that the file states; stamps of a calendar are read in s."""
    if place in reader.stamps:
        return Column(key, name, "s", values, thousands=thousands)
    file_unit = unit_in_file(reader, place)
    if file_unit is None:
        return Column(key, name, "", values, thousands=thousands)
    written = "" if file_unit.unit and file_unit.certain else file_unit.text
    return Column(key, name, file_unit.unit, values, thousands=thousands, scale=file_unit.scale, written=written)


def _read(reader: Reader, asks: Sequence[ColumnRequest]) -> list[ColumnValues]:
    parts: list[list[ColumnValues]] = []
    if not asks:  # all columns hold dates alone
        return []
    for batch in reader.batches(asks):
        parts.append(batch)
        if sum(one[0].size for one in parts) >= MAX_SURVEY_ROWS:
            break
    if not parts:
        return [np.empty(0) for _ in asks]
    return [np.concatenate(column) for column in zip(*parts, strict=True)]


def _survey_binary(raw: RawFile) -> Survey:
    """Survey a binary file, column by column or clock by clock: what has another length than most is left out."""
    reader = open_raw(raw)
    stamps = set(reader.clocks.values())
    columns, unused = [], []
    labels: dict[str, ColumnValues] = {}
    for place, name in enumerate(reader.names):
        if stamps and place in reader.clock_names and place not in reader.clocks:
            continue  # stands for the clocks of the others
        try:
            (values,) = _read(reader, [ColumnRequest(place, text=place in reader.labels)])
        except InputError as error:
            unused.append(f'"{name}": {error.found}')
            continue
        if place in reader.labels:
            labels[name] = values
            continue
        clock = reader.names[reader.clocks[place]] if place in reader.clocks else None
        columns.append(replace(_column(reader, place, name, name, values), clock=clock))
    columns = [with_unit_beside(one, labels.get(f"{one.name.rpartition('/')[0]}/unit")) for one in columns]
    single = [one for one in columns if one.values.size == 1]
    told = [one.name if unit_in_brackets(one.name) or not one.unit else f"{one.name} [{one.unit}]" for one in single]
    scalars = {name: float(one.values[0]) for name, one in zip(told, single, strict=True)} | _rate_of_group(columns)
    columns = [one for one in columns if one.values.size > 1]
    if not columns:
        raise InputError(
            str(raw.path), "no column of numbers", "a recording", "export vectors of one clock", code="E041"
        )
    if stamps:
        shared = next(
            (_column(reader, n, reader.names[n], reader.names[n], np.empty(0)) for n in reader.clock_names), None
        )
        texts = [_counted(name, own) for name, own in labels.items()]
        runs = [(run, _aligned(own, shared)) for run, own in runs_beside_one_another(columns)]
        return Survey(
            raw, False, runs[0][1] if runs else _aligned(columns, shared), scalars, [*unused, *texts], runs=runs
        )
    sizes = Counter(one.values.size for one in columns)
    usual = max(sizes, key=lambda size: (sizes[size], size))
    other = [
        f'"{one.name}": {one.values.size} values, most have {usual}' for one in columns if one.values.size != usual
    ]
    kept = [one for one in columns if one.values.size == usual]
    found, left, runs = _shaped(reader, kept, {name: own for name, own in labels.items() if own.size == usual})
    return Survey(raw, False, found, scalars, [*unused, *other, *left], runs=runs)


def _rate_of_group(columns: Sequence[Column]) -> dict[str, float]:
    """Return the rate (Hz) that the one group of all columns is called after, as recorders of NI do; else nothing."""
    groups = {one.name.rpartition("/")[0] for one in columns}
    said = _RATE.search(groups.pop()) if len(groups) == 1 else None
    return {"rate": float(said[1]) * (1e3 if said[2] else 1.0)} if said else {}


def _aligned(columns: Sequence[Column], shared: Column | None = None) -> list[Column]:
    """Return columns over one table of stamps, where some have clocks of their own; the clock that is shared first.

    ``shared`` is the column that stands for each column's own clock, where the file has one.
    """
    clocks = {column.clock for column in columns if column.clock is not None}
    if not clocks:
        return list(columns)
    by_key = {column.key: column for column in columns}
    first = next(column for column in columns if column.key in clocks)
    owners: dict[ColumnKey, list[Column]] = {}
    for column in columns:
        if column.key not in clocks:
            owners.setdefault(first.key if column.clock is None else column.clock, []).append(column)
    tables, start = [], 0
    for clock, own in owners.items():
        time = _seconds(by_key[clock])
        known = np.flatnonzero(np.isfinite(time[: min(one.values.size for one in own)]))
        tables.append(
            Table(
                time[known],
                {str(n): one.values[known] for n, one in enumerate(columns) if one in own},
                np.arange(start, start + known.size),
            )
        )
        start += known.size
    longest = max(table.time.size for table in tables)
    sparse = [name for one in tables if one.time.size < SPARSE * longest for name in one.columns]
    table = align_tables(tables, sparse, lambda row: f"row {row + 1}").table
    clock_column = first if shared is None else replace(shared, unit=shared.unit or first.unit or "s")
    factor = parse_unit(clock_column.unit).factor if _is_timed(clock_column) else 1.0
    aligned = [replace(one, values=table.columns[str(n)]) for n, one in enumerate(columns) if str(n) in table.columns]
    aligned = [replace(one, clock=None) if shared or one.clock == first.key else one for one in aligned]
    return [replace(clock_column, values=table.time / factor, is_clock=True), *aligned]


def _is_timed(clock: Column) -> bool:
    return bool(clock.unit) and same_dimension(clock.unit, "s")


def _seconds(clock: Column) -> Array:
    """Return the stamps of a clock in s, or in its own numbers where it says no unit."""
    time = continuous_stamps(clock.values)
    return np.asarray(time * parse_unit(clock.unit).factor) if _is_timed(clock) else time
