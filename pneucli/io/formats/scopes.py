"""Exports of scopes as text: TwinCAT's with a clock a channel, Tektronix' with keys beside the curve."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pneucli.errors import InputError
from pneucli.io.column_reader import ColumnReader, number_in
from pneucli.io.formats.base import Format
from pneucli.io.raw_file import ColumnValues
from pneucli.io.text_layout import text_of

_SAMPLE_TIME = re.compile(r"(?i)sample\s*-?time\s*\[(\w+)\]")
_WORDS = ("SymbolComment", "SymbolName", "SampleTime", "Data-Type")


def _is_twincat(head: bytes, _: Path) -> bool:
    text = head.decode("latin-1").replace("\0", "")
    return all(word in text for word in _WORDS)


def open_twincat(path: Path) -> ColumnReader:
    """List the channels; each has a clock of its own."""
    lines = text_of(path).splitlines()
    delimiter = max("\t;,", key=lambda mark: sum(line.count(mark) for line in lines[:20]))
    rows = [[field.strip() for field in line.split(delimiter)] for line in lines]
    at = next(n for n, row in enumerate(rows) if row and row[0].lower().startswith("symbolcomment"))
    start = next((n for n in range(at, len(rows)) if _is_data(rows[n])), len(rows))
    keys = {row[0]: row for row in rows[max(0, at - 1) : start] if len(row) > 1 and row[0]}
    told = {n for key, row in keys.items() if key != "Name" for n, field in enumerate(row) if field == key}
    stamps = sorted(told)  # a key stands above each column of stamps
    width = max(map(len, keys.values()), default=0)
    places = [n for n in range(width) if n not in told]
    names = _of_channels(keys.get("Name") or keys.get("SymbolName") or [], places)
    body = [row for row in rows[start:] if _is_data(row)]
    if not names or not body:
        raise InputError(str(path), f"a {TWINCAT.name} without rows", "rows of numbers", "export it again", code="E041")
    comma = delimiter != "," and not any("." in field for row in body[:20] for field in row)
    table = np.array([[_number(field, comma) for field in [*row[:width], *[""] * (width - len(row))]] for row in body])
    unit = next((match[1] for key in keys if (match := _SAMPLE_TIME.match(key))), "ms")
    units = next((_of_channels(row, places) for key, row in keys.items() if key.lower() in ("unit", "units")), [])
    pairs = [(max(n for n in stamps if n < place), place) for place in places]
    return _with_clocks(path, names, [(table[:, clock], table[:, place]) for clock, place in pairs], unit, units)


def _of_channels(row: Sequence[str], places: Sequence[int]) -> list[str]:
    """Return what a line says of the channels, which stand at ``places``; several may follow one column of stamps."""
    return [row[n] for n in places if n < len(row)]


def _with_clocks(
    path: Path,
    names: Sequence[str],
    pairs: Sequence[tuple[ColumnValues, ColumnValues]],
    unit: str,
    units: Sequence[str],
) -> ColumnReader:
    columns: dict[str, ColumnValues] = {}
    clocks: dict[str, str] = {}
    file_units: dict[str, str] = {}
    for number, name in enumerate(names):
        own = name if names.count(name) == 1 else f"{name}/{number + 1}"
        stamps, values = pairs[number]
        there = np.isfinite(stamps)
        columns |= {f"{own}/time": stamps[there], own: values[there]}
        clocks[own] = f"{own}/time"
        file_units |= {f"{own}/time": unit} | ({own: units[number]} if number < len(units) and units[number] else {})
    return ColumnReader.of_columns(path, TWINCAT.name, columns, file_units, clocks)


def _is_data(row: Sequence[str]) -> bool:
    filled = [field for field in row if field]
    return bool(filled) and all(np.isfinite(_number(field, "," in field)) for field in filled)


def _number(field: str, comma: bool) -> float:
    return number_in(field.replace(",", ".") if comma else field)


TWINCAT = Format(
    "TwinCAT scope export",
    "TwinCAT scope (text)",
    open_twincat,
    recognises=_is_twincat,
    used="unit and sample time",
)


def _is_tektronix(head: bytes, _: Path) -> bool:
    lines = [line.split(",") for line in head.decode("latin-1").replace("\0", "").splitlines()[:3]]
    return len(lines) == 3 and all(len(line) in (5, 6) for line in lines) and lines[0][0] == "Record Length"


def open_tektronix(path: Path) -> ColumnReader:
    """List the clock and the one channel."""
    rows = [[field.strip() for field in line.split(",")] for line in text_of(path).splitlines() if line.strip()]
    keys = {row[0]: row[1] for row in rows if row[0]}
    table = np.array([[number_in(field) for field in row[3:5]] for row in rows if len(row) > 4])
    name = keys.get("Source", "CH1")
    units = {"time": {"S": "s"}.get(keys.get("Horizontal Units", "s"), "s"), name: keys.get("Vertical Units", "V")}
    return ColumnReader.of_columns(path, TEKTRONIX.name, {"time": table[:, 0], name: table[:, 1]}, units, {})


TEKTRONIX = Format(
    "Tektronix export",
    "Tektronix (text)",
    open_tektronix,
    recognises=_is_tektronix,
    column="the name of the source",
    used="units",
)
