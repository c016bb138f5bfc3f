"""Text exports of scopes that are no plain table: TwinCAT's, a clock a channel; Tektronix's, keys in columns."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pneucli.errors import InputError
from pneucli.io.column_reader import ColumnReader
from pneucli.io.raw_file import ColumnValues
from pneucli.io.text_layout import HEAD_BYTES, decode_head, detect_encoding

NAME = "TwinCAT scope export"
TEKTRONIX = "Tektronix export"
_SAMPLE_TIME = re.compile(r"(?i)sample\s*-?time\s*\[(\w+)\]")
_TWINCAT = ("SymbolComment", "SymbolName", "SampleTime")


def scope_format(head: bytes) -> str | None:
    """Return the name of the export, by its header; None where it is none of them."""
    text = head.decode("latin-1").replace("\0", "")
    if all(word in text for word in _TWINCAT) and "Data-Type" in text:
        return NAME
    lines = [line.split(",") for line in text.splitlines()[:3]]
    is_tektronix = len(lines) == 3 and all(len(line) in (5, 6) for line in lines) and lines[0][0] == "Record Length"
    return TEKTRONIX if is_tektronix else None


def open_scope(path: Path) -> ColumnReader:
    """List the channels; each has a clock of its own."""
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    rows = decode_head(path, path.read_bytes(), detect_encoding(path, head)).splitlines()
    return _tektronix(path, rows) if scope_format(head) == TEKTRONIX else _twincat(path, rows)


def _twincat(path: Path, lines: Sequence[str]) -> ColumnReader:
    delimiter = max("\t;,", key=lambda mark: sum(line.count(mark) for line in lines[:20]))
    rows = [[field.strip() for field in line.split(delimiter)] for line in lines]
    at = next(n for n, row in enumerate(rows) if row and row[0].lower().startswith("symbolcomment"))
    start = next((n for n in range(at, len(rows)) if _is_data(rows[n])), len(rows))
    keys: dict[str, list[str]] = {}
    for row in rows[max(0, at - 1) : start]:
        if len(row) > 1 and row[0]:
            keys[row[0]] = row[1::2]
    names = keys.get("Name") or keys.get("SymbolName") or []
    body = [row for row in rows[start:] if _is_data(row)]
    if not names or not body:
        raise InputError(str(path), f"a {NAME} without rows", "rows of numbers", "export it again", code="E041")
    comma = delimiter != "," and not any("." in field for row in body[:20] for field in row)
    width = 2 * len(names)
    table = np.array([[_number(field, comma) for field in [*row[:width], *[""] * (width - len(row))]] for row in body])
    unit = next((match[1] for key in keys if (match := _SAMPLE_TIME.match(key))), "ms")
    units = next((values for key, values in keys.items() if key.lower() in ("unit", "units")), [])
    return _with_clocks(path, names, table, unit, units)


def _with_clocks(
    path: Path, names: Sequence[str], table: ColumnValues, unit: str, units: Sequence[str]
) -> ColumnReader:
    columns: dict[str, ColumnValues] = {}
    clocks: dict[str, str] = {}
    file_units: dict[str, str] = {}
    for number, name in enumerate(names):
        own = name if names.count(name) == 1 else f"{name}/{number + 1}"
        stamps, values = table[:, 2 * number], table[:, 2 * number + 1]
        there = np.isfinite(stamps)
        columns |= {f"{own}/time": stamps[there], own: values[there]}
        clocks[own] = f"{own}/time"
        file_units |= {f"{own}/time": unit} | ({own: units[number]} if number < len(units) and units[number] else {})
    return ColumnReader.of_columns(path, NAME, columns, file_units, clocks)


def _tektronix(path: Path, lines: Sequence[str]) -> ColumnReader:
    rows = [[field.strip() for field in line.split(",")] for line in lines if line.strip()]
    keys = {row[0]: row[1] for row in rows if row[0]}
    table = np.array([[_number(field, False) for field in row[3:5]] for row in rows if len(row) > 4])
    name = keys.get("Source", "CH1")
    units = {"time": {"S": "s"}.get(keys.get("Horizontal Units", "s"), "s"), name: keys.get("Vertical Units", "V")}
    return ColumnReader.of_columns(path, TEKTRONIX, {"time": table[:, 0], name: table[:, 1]}, units, {})


def _is_data(row: Sequence[str]) -> bool:
    filled = [field for field in row if field]
    return bool(filled) and all(np.isfinite(_number(field, "," in field)) for field in filled)


def _number(field: str, comma: bool) -> float:
    try:
        return float(field.replace(",", ".") if comma else field)
    except ValueError:
        return np.nan
