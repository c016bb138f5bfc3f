"""MATLAB v5: variables are read one by one, and only those that hold a wanted column."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat, whosmat

from pneucli.io.column_reader import ColumnReader, column_names, split_columns, to_vector
from pneucli.io.damaged_files import check_expanded_size
from pneucli.io.mat_elements import check_types, expanded_size
from pneucli.io.raw_file import ColumnValues

NAME = "MATLAB v5"
_NUMBERS = ("double", "single", "logical", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64")


def open_mat(path: Path) -> ColumnReader:
    """List the columns: a vector by its name, ``struct/field``, column 2 of a matrix as ``m/2``."""
    variables = whosmat(path)
    owner: dict[str, str] = {}
    for name, shape, kind in variables:
        if kind in _NUMBERS:
            owner |= dict.fromkeys(column_names(name, shape), name)
        elif kind == "struct":
            owner |= dict.fromkeys(_load(path, [name]), name)

    def fetch(wanted: Sequence[str]) -> list[ColumnValues]:
        columns = _load(path, list(dict.fromkeys(owner[name] for name in wanted)))
        return [to_vector(columns[name]) for name in wanted]

    return ColumnReader(path, NAME, list(owner), fetch)


def _load(path: Path, variables: list[str]) -> dict[str, ColumnValues]:
    wanted = {k for k, (name, _, _) in enumerate(whosmat(path)) if name in variables}
    check_expanded_size(path, expanded_size(path, wanted), of=f'the variables "{", ".join(variables)[:60]}"')
    check_types(path, wanted)
    tree = loadmat(path, variable_names=variables, squeeze_me=True, struct_as_record=True)
    return dict(_leaves({name: tree[name] for name in variables}, ""))


def _leaves(node: Any, prefix: str) -> Iterator[tuple[str, ColumnValues]]:
    """Yield the columns of nested structs."""
    if isinstance(node, Mapping):
        for key, value in node.items():
            yield from _leaves(value, f"{prefix}/{key}" if prefix else str(key))
        return
    array = np.atleast_1d(node)
    if array.dtype.names:
        fields = {name: array[name][0] if array.size == 1 else array[name] for name in array.dtype.names}
        yield from _leaves(fields, prefix)
    elif array.dtype.kind in "fiub":
        yield from split_columns(prefix, array).items()
