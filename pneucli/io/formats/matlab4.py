"""MATLAB level 4 and the results of Dymola, which are written in it."""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pneucli.io.column_reader import ColumnReader, column_names, split_columns
from pneucli.io.damaged_files import check_expanded_size
from pneucli.io.formats.base import Format
from pneucli.io.raw_file import ColumnValues

_HEADER = struct.Struct("<5i")
_MAX_NAME = 64  # characters
_DYMOLA = {"Aclass", "name", "dataInfo"}
_UNIT = re.compile(r"\[([^][|:]+)(?:\|[^][|]*)?\](?=[^][]*$)")  # the last brackets; a colon begins a type, no unit


def is_mat4(head: bytes, _: Path) -> bool:
    """Return whether a file begins with a matrix of level 4: type, rows, columns, imaginary flag, length of name."""
    if len(head) < _HEADER.size + 2:
        return False
    for order in "<>":
        kind, rows, columns, imaginary, length = struct.unpack(f"{order}5i", head[: _HEADER.size])
        usual = 0 <= kind <= 4052 and kind // 100 % 10 == 0 and kind % 10 in (0, 1, 2) and kind // 10 % 10 <= 5
        sizes = 0 < rows < 1 << 30 and 0 <= columns < 1 << 30 and imaginary in (0, 1) and 1 < length <= _MAX_NAME
        name = head[_HEADER.size : _HEADER.size + length].rstrip(b"\0")
        if usual and sizes and (kind >= 1000) == (order == ">") and name.replace(b"_", b"").isalnum():
            return True
    return False


def open_mat4(path: Path) -> ColumnReader:
    """List the columns: vectors by name, columns of matrices by number; the trajectories of Dymola by their names."""
    from scipy.io import loadmat, whosmat  # noqa: PLC0415 - slow to import, and few recordings are MATLAB's

    variables = whosmat(path)
    check_expanded_size(path, 8 * sum(int(np.prod(shape)) for _, shape, kind in variables if kind != "char"))
    if {name for name, _, _ in variables} >= _DYMOLA:
        columns, units = _dymola(path)
        return ColumnReader.of_columns(path, MATLAB_4.name, columns, units, {})
    owner: dict[str, str] = {}
    for name, shape, kind in variables:
        if kind not in ("char", "sparse"):
            owner |= dict.fromkeys(column_names(name, shape), name)

    def fetch(wanted: Sequence[str]) -> list[ColumnValues]:
        tree = loadmat(path, variable_names=list({owner[name] for name in wanted}))
        found: dict[str, ColumnValues] = {}
        for name in dict.fromkeys(owner[name] for name in wanted):
            found |= split_columns(name, np.asarray(tree[name], dtype=np.float64))
        return [np.ravel(found[name]) for name in wanted]

    return ColumnReader(path, MATLAB_4.name, list(owner), fetch)


def _dymola(path: Path) -> tuple[dict[str, ColumnValues], dict[str, str]]:
    """Return the trajectories and their units, by name.

    ``dataInfo`` says of each name in which matrix, in which column, and with which sign. ``description`` ends with the
    unit of the stored numbers, then that in which Dymola displays them: ``Pressure [Pa|bar]``.
    """
    from scipy.io import loadmat  # noqa: PLC0415 - slow to import, and few recordings are MATLAB's

    tree = loadmat(path, chars_as_strings=False)
    transposed = "binTrans" in ["".join(row).strip("\0 ") for row in tree["Aclass"]]
    letters, info = tree["name"], np.asarray(tree["dataInfo"], dtype=np.int64)
    remarks = tree.get("description", letters[:0])
    if transposed:
        letters, info, remarks = letters.T, info.T, remarks.T
    texts = ["".join(row).strip("\0 ") for row in remarks] if len(remarks) == len(letters) else [""] * len(letters)
    found: dict[str, ColumnValues] = {}
    units: dict[str, str] = {}
    for row, (matrix, column, *_), text in zip(letters, info.tolist(), texts, strict=True):
        name = "".join(row).strip("\0 ")
        data = tree.get(f"data_{matrix or 2}")
        if data is None:
            continue
        data = np.asarray(data.T if transposed else data, dtype=np.float64)
        if name and data.shape[0] > 2:  # constants have a matrix of two rows
            found[name] = np.sign(column or 1) * data[:, abs(column or 1) - 1]
            if unit := _UNIT.search(text):
                units[name] = unit[1].replace(".", "*")  # Modelica's N.m
    return found, units


MATLAB_4 = Format(
    "MATLAB v4",
    "MATLAB v4, Dymola",
    open_mat4,
    recognises=is_mat4,
    column="a vector, a column `m/2`, a trajectory",
    used="Dymola's units",
)
