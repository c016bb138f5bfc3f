"""Part of ``init``: what lines above a table say of the scale of sensors that it holds in mA, V or counts."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from pneucli.init.clock_columns import computed_column
from pneucli.init.column_names import ABSOLUTE, GAUGE, quantity_kind, read_name
from pneucli.init.survey_types import Column
from pneucli.io.file_units import NUMBER, UP_TO
from pneucli.units import is_count, is_unit

MAX_OUTSIDE = 0.1  # of a sensor's range beyond it: 21 mA, which tell a fault (NAMUR NE 43), are 0.06
_RANGE = rf"({NUMBER}){UP_TO}({NUMBER})\s*"
_OF_RANGE = re.compile(
    rf"{_RANGE}([^\W\d]*)\s*(?:=>?|->|→|:|corresponds to|entspricht)\s*{_RANGE}([^\W\d][\w²³/]*)\s*(\([^)]*\)|[^\W\d]*)"
)  # 4-20 mA = 0-10 bar (gauge)
_OF_ONE = re.compile(rf"({NUMBER})\s*([^\W\d]+)\s*(?:/|per|pro|je)\s*([^\W\d][\w²³]*)")  # 200 counts/mm


_ONE_OF_SEVERAL = re.compile(r"[^\W\d]+\d+|[^\W\d]")  # p2, or A: a line that names it is of no other


class StatedScale(NamedTuple):
    """A scale: unit = factor * raw + offset, the raw range, and the words that say whose it is."""

    factor: float
    offset: float
    range: tuple[float, float]
    raw_unit: str
    unit: str
    words: frozenset[str]


def with_stated_scales(columns: Sequence[Column], lines: Sequence[str], is_text: bool) -> list[Column]:
    """Return the columns, those of sensors computed by the scales that lines above the table state.

    A scale is that of the columns which its line names; where it names none, of those of the quantity of its unit.
    """
    scales = [one for line in lines for one in _scales(line)]
    found = list(columns)
    for scale in scales:
        fitting = [n for n, one in enumerate(columns) if found[n] is one and _is_in(one, scale, is_text)]
        named = [n for n in fitting if _words(columns[n].name) & scale.words]
        kin = [n for n in fitting if read_name(columns[n], is_text).nouns[:1] == [quantity_kind(scale.unit)]]
        kin = [] if any(map(_ONE_OF_SEVERAL.fullmatch, scale.words)) else kin
        for n in named or kin:
            stem = " ".join(word for word in re.split(r"[\s_\[\]()/]+", columns[n].name) if not _is_raw_unit(word))
            reference = next((words.split()[0] for words in (ABSOLUTE, GAUGE) if scale.words & {*words.split()}), "")
            text = f"{scale.factor:.10g} * `{columns[n].key}`"
            text += f" {'-' if scale.offset < 0 else '+'} {abs(scale.offset):.10g}" * bool(scale.offset)
            found[n : n + 1] = computed_column(text, f"{stem} {reference}".strip(), scale.unit, columns) or [columns[n]]
    return found


def _is_in(column: Column, scale: StatedScale, is_text: bool) -> bool:
    """Return whether a column holds raw readings of a scale: in its raw unit, and within its range."""
    unit = column.unit or read_name(column, is_text).unit or column.written
    counts = is_count(scale.raw_unit) or not scale.raw_unit
    same = (not unit or is_count(unit)) if counts else unit == scale.raw_unit
    known, margin = column.finite_values, MAX_OUTSIDE * (scale.range[1] - scale.range[0])
    inside = known.size and scale.range[0] - margin <= known.min() <= known.max() <= scale.range[1] + margin
    return same and bool(inside) and bool(not counts or np.all(known == np.floor(known)))


def _is_raw_unit(word: str) -> bool:
    return (len(word) > 2 and is_count(word)) or quantity_kind(word if is_unit(word) else "") == "command"


def _scales(line: str) -> Iterator[StatedScale]:
    end = 0
    for told in _OF_RANGE.finditer(line):
        low, high, first, last = (float(told[n].replace(",", ".")) for n in (1, 2, 4, 5))
        if is_unit(told[6]) and low < high:
            factor = (last - first) / (high - low)
            words = _words(f"{line[end : told.start()]} {told[7]}")
            yield StatedScale(factor, first - factor * low, (low, high), told[3], told[6], words)
        end = told.end()
    for told in _OF_ONE.finditer(line):
        count, words = float(told[1].replace(",", ".")), _words(line[: told.start()])
        if is_count(told[2]) and is_unit(told[3]) and count:
            yield StatedScale(1 / count, 0.0, (-np.inf, np.inf), told[2], told[3], words)


def _words(text: str) -> frozenset[str]:
    return frozenset(word for word in re.split(r"[\W_]+", text.lower()) if word and not is_unit(word))
