"""Part of ``init``: tables that hold channels, or whole recordings, below or beside one another.

A long table has a label, a stamp and a value in each row; runs stand below one another under a number of the run, or
beside one another as repeated columns.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pneucli.arrays import Array
from pneucli.init.clock_columns import is_increasing, may_be_clock
from pneucli.init.column_names import NOUNS, read_name
from pneucli.init.survey_types import Column
from pneucli.io.clock import CounterClock
from pneucli.io.file_units import WrittenUnit, read_unit
from pneucli.io.raw_file import ColumnKey, ColumnValues
from pneucli.io.text_sniffer import is_unit

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
_GOOD = re.compile(r"(?i)good|ok|valid|true")
_BAD = re.compile(
    r"(?i)bad|not? ?ok|nok|invalid|false|uncertain|fault|error|fail(?:ed|ure)?|stale|timeout|(?:under|over)-?range"
)
_OPC_GOOD = 192  # quality of OPC DA (0xC0), below which a value is bad or uncertain
_ELEMENT = re.compile(r"(?<=\w)/(\d+)(?=/)")  # of an array of structs

Labels = Mapping[str, ColumnValues]  # columns of text, or of numbers that were read as text, by name


def long_table(columns: Sequence[Column], labels: Labels) -> list[Column]:
    """Return clock and channels of a long table, however many further columns it has; nothing where it is none.

    The label is the column of text by which stamps rise within each channel; the value is the column of numbers that is
    no stamp and changes; of several stamps that of the source counts.
    """
    stamps = [one for one in columns if _may_be_stamp(one)]
    others = [one for one in columns if all(one is not stamp for stamp in stamps)]
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
    split = []
    for name in names:
        rows = texts == name
        one = replace(value, name=name, values=value.values[rows], where=(key, name), unit="")
        split.append(one if said is None else with_unit_beside(one, said[rows]))
    return [replace(clock, values=clock.values[texts == split[0].name]), *split]


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
        if texts is not None and texts.size == own.values.size and (good := _good_of(texts, called[2].lower())):
            key: ColumnKey = name if name in labels or number is None else number.key
            found[id(own)] = key, good, texts == good
    used = {str(key) for key, *_ in found.values()}
    kept = [one for one in columns if str(one.key) not in used]
    return [_valid_rows(one, *found[id(one)]) if id(one) in found else one for one in kept], used


def _valid_rows(column: Column, key: ColumnKey, good: str, rows: ColumnValues) -> Column:
    return replace(column, where=(key, good), values=np.where(rows.astype(bool), column.values, np.nan))


def _letters(name: str) -> str:
    return re.sub(r"[\W_]", "", name.lower())


def _good_of(texts: ColumnValues, called: str) -> str:
    """Return the word or number that calls a value good where all others call it bad; empty where none does."""
    words = [str(text).strip() for text in dict.fromkeys(texts)]
    numbers = [float(word) if word.replace(".", "", 1).isdigit() else None for word in words]
    if called in ("quality", "status"):
        good = [n is not None and n >= _OPC_GOOD for n in numbers]
        bad = [n is not None and n < _OPC_GOOD for n in numbers]
    else:
        good, bad = [n == 1.0 for n in numbers], [n == 0.0 for n in numbers]
    good = [one or bool(_GOOD.fullmatch(word)) for one, word in zip(good, words, strict=True)]
    bad = [one or bool(_BAD.fullmatch(word)) for one, word in zip(bad, words, strict=True)]
    told = sum(good) == 1 and len(words) > 1 and all(a != b for a, b in zip(good, bad, strict=True))
    return words[good.index(True)] if told else ""


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
        starts_anew = any(_starts_anew(one.values, edges) for one in clocks)
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


def _starts_anew(values: Array, edges: ColumnValues) -> bool:
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
