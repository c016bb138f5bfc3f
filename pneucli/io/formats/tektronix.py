"""Tektronix' exports of one channel as text, with keys beside the curve."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pneucli.io.column_reader import ColumnReader, number_in
from pneucli.io.formats.base import Format
from pneucli.io.text_layout import text_of


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
    used="units and the name of the source",
)
