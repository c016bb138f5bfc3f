"""Recordings of a laboratory's own logger: a line of JSON with names, units, scales and rate, then integers."""

import json
from pathlib import Path

import numpy as np

from pneucli.io.column_reader import ColumnReader
from pneucli.io.formats.base import Format


def _open(path: Path) -> ColumnReader:
    _, line, numbers = path.read_bytes().split(b"\n", 2)
    about = json.loads(line)
    table = np.frombuffer(numbers, "<i2").reshape(-1, len(about["channels"]))
    columns = {"time": np.arange(len(table)) / about["rate"]}
    columns |= {one["name"]: one["scale"] * table[:, n] for n, one in enumerate(about["channels"])}
    units = {"time": "s"} | {one["name"]: one["unit"] for one in about["channels"]}
    return ColumnReader.of_columns(path, LAB_LOG.name, columns, units, clocks={})


LAB_LOG = Format("lab log", "our logger (`.lab`)", _open, magic=(b"LABLOG 1\n",), used="unit, scale and rate")
