"""Texts of blocks below one another, each with keys, such as its name, above its numbers: Octave, imc."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from itertools import groupby
from pathlib import Path

import numpy as np

from pneucli.io.column_reader import ColumnReader, number_in, split_columns, tells_rate
from pneucli.io.formats.base import Format
from pneucli.io.raw_file import ColumnValues
from pneucli.io.text_layout import text_of

_KEY = re.compile(r"[#%\s]*([^\W\d][\w -]*?)\s*[:=]\s*(.*?)\s*")
_NAMES = ("name", "channel", "kanal", "signal", "kanalname")
_UNITS = re.compile(r"(?i)(?:y[- ]?)?(?:units?|einheit)")
_NUMBER = r"-?\d[\d.eE+-]*(?:,\d+)?"
_FIRST_BLOCK = (  # comments, a key of the name, further keys, three rows of numbers
    rf"(?i)(?:[#%][^\n]*\n|\s*\n)*[#% ]*(?:{'|'.join(_NAMES)})\s*[:=][^\n]*\n"
    rf"(?:[#% ]*[^\W\d][^\n:=]*[:=][^\n]*\n|\s*\n){{1,20}}(?:[ \t]*{_NUMBER}(?:[ \t]+{_NUMBER})*\s*\n){{3}}"
)


def open_blocks(path: Path) -> ColumnReader:
    """List the blocks by their names; what a key says of rate or period is a column of one value."""
    columns: dict[str, ColumnValues] = {}
    units: dict[str, str] = {}
    for keys, values in _blocks(path):
        name = next((keys[key] for key in keys if key.lower() in _NAMES), "")
        found = split_columns(name, values) if name else {}
        columns |= found
        units |= dict.fromkeys(found, next((own for key, own in keys.items() if _UNITS.fullmatch(key)), ""))
        columns |= {f"{name}/{key}": _numbers([own]).ravel() for key, own in keys.items() if name and tells_rate(key)}
    return ColumnReader.of_columns(path, BLOCKS.name, columns, {name: own for name, own in units.items() if own}, {})


def _blocks(path: Path) -> Iterator[tuple[Mapping[str, str], ColumnValues]]:
    """Yield the keys of each block and its numbers, shape ``(rows, columns)``; lines of words are passed over."""
    lines = [line for line in text_of(path).splitlines() if line.strip()]
    keys: dict[str, str] = {}
    for keyed, own in groupby(lines, lambda line: _KEY.fullmatch(line) is not None):
        if keyed:
            keys = {found[1]: found[2] for line in own if (found := _KEY.fullmatch(line))}
        elif keys and (values := _numbers([*own])).size:
            yield keys, values


def _numbers(lines: list[str]) -> ColumnValues:
    rows = [[number_in(text.replace(",", ".")) for text in line.split()] for line in lines]
    rows = [row for row in rows if row and not np.isnan(row).all() and len(row) == len(rows[0])]
    return np.array(rows, dtype=np.float64)


BLOCKS = Format(
    "text of named blocks",
    "Octave, imc (text)",
    open_blocks,
    pattern=_FIRST_BLOCK.encode(),
    column="a block",
    used="unit, period",
)
