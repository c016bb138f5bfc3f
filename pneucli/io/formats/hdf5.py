"""HDF5 and MATLAB v7.3: datasets by their paths; a dataset is read only if one of its columns is wanted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.errors import InputError
from pneucli.io.column_reader import ColumnReader, clocks_by_group, column_names, import_extra, split_columns
from pneucli.io.damaged_files import check_expanded_size
from pneucli.io.formats.base import Format
from pneucli.io.formats.matlab import SAVE_AS_STRUCT
from pneucli.io.hdf5_layouts import (
    Place,
    frame_columns,
    is_empty,
    is_matlab_object,
    is_no_number,
    struct_array_columns,
    unpacked,
)
from pneucli.io.raw_file import ColumnValues


def open_hdf5(path: Path) -> ColumnReader:
    """List the columns: a dataset, ``matrix/2``, or a field of a table, each below its path."""
    h5py = import_extra("h5py", "hdf5", path)
    owner: dict[str, Place] = {}
    units: dict[str, str] = {}
    sizes: dict[str, int] = {}
    objects: list[str] = []
    with h5py.File(path, "r") as file:
        for name, node in _nodes(h5py, file):
            if is_matlab_object(node):
                objects.append(name)
            elif isinstance(node, h5py.Dataset):
                found = dict(_dataset_columns(name, node))
                owner |= found
                units |= dict.fromkeys(found, _unit(node))
                sizes |= dict.fromkeys(found, max(node.shape, default=1))
            else:
                found = frame_columns(node, name) or struct_array_columns(file, node, name)
                owner |= found
                sizes |= {column: max(file[place.dataset].shape) for column, place in found.items()}
    if objects and not owner:
        found_there = f'"{objects[0]}": an object of MATLAB (timeseries, timetable, Dataset), which only MATLAB reads'
        raise InputError(str(path), found_there, "vectors, or structs of vectors", SAVE_AS_STRUCT, code="E041")

    def fetch(wanted: Sequence[str]) -> list[ColumnValues]:
        with h5py.File(path, "r") as file:
            datasets = {owner[name].dataset for name in wanted}
            check_expanded_size(path, sum(file[name].size * file[name].dtype.itemsize for name in datasets))
            return [_read(file, owner[name]) for name in wanted]

    names = list(owner)
    units |= {name: "s" for name, place in owner.items() if place.stamps}
    file_units = {number: units[name] for number, name in enumerate(names) if units.get(name)}
    return ColumnReader(path, HDF5.name, names, fetch, file_units, own_clocks=clocks_by_group(names, sizes))


def _dataset_columns(name: str, dataset: Any) -> Iterator[tuple[str, Place]]:
    if is_no_number(dataset) or is_empty(dataset):
        return
    for field in dataset.dtype.names or [None]:
        kind = dataset.dtype[field] if field else dataset.dtype
        if kind.kind in "fiub":
            own = f"{name}/{field}" if field else name
            columns = column_names(own, dataset.shape)
            for number, column in enumerate(columns):
                yield column, Place(name, field, number if len(columns) > 1 else None)


def _read(file: Any, place: Place) -> ColumnValues:
    array = file[place.dataset][()] if place.field is None else file[place.dataset][place.field]
    if place.column is not None:
        array = list(split_columns("", array).values())[place.column] if array.ndim > 1 else array
    if place.stamps is not None:
        array = np.asarray(array).astype(np.int64).view(place.stamps)
    return np.ravel(unpacked(file[place.dataset], array))


def _unit(dataset: Any) -> str:
    """Return the unit that stands in a dataset's attributes, if any."""
    found = [dataset.attrs.get(key) for key in ("unit", "units", "Unit", "Units")]
    first = [np.ravel(one)[0] for one in found if np.size(one) == 1]  # a text, or an array of one
    texts = [one.decode(errors="replace") if isinstance(one, bytes) else one for one in first]
    return next((text for text in texts if isinstance(text, str)), "")


def _nodes(h5py: Any, file: Any) -> Iterator[tuple[str, Any]]:
    """Yield path and node of every dataset, and of the groups that hold a frame, an array of structs or an object.

    In order; each group once, as groups may hold one another, and nothing of other files.
    """
    seen = set()
    waiting = [("", file)]
    while waiting:
        prefix, node = waiting.pop()
        if isinstance(node, h5py.Dataset):
            if node.shape is not None:
                yield prefix, node
            continue
        address = h5py.h5o.get_info(node.id).addr
        if address in seen:
            continue
        seen.add(address)
        if is_matlab_object(node) or "pandas_type" in node.attrs:
            yield prefix, node
            continue
        inner = [key for key in node if not key.startswith("#") and _is_own(h5py, node, key)]
        if any(isinstance(node[key], h5py.Dataset) and node[key].dtype.kind == "O" for key in inner):
            yield prefix, node
        waiting += [(f"{prefix}/{key}".lstrip("/"), node[key]) for key in reversed(inner)]


def _is_own(h5py: Any, group: Any, key: str) -> bool:
    if isinstance(group.get(key, getlink=True), h5py.ExternalLink):
        return False
    return isinstance(group.get(key), h5py.Group | h5py.Dataset)


MAGIC = b"\x89HDF\r\n\x1a\n"
MATLAB_BLOCK = 512  # bytes that MATLAB writes before it


def _is_hdf5(head: bytes, _: Path) -> bool:
    return MAGIC in (head[: len(MAGIC)], head[MATLAB_BLOCK : MATLAB_BLOCK + len(MAGIC)])


HDF5 = Format(
    "HDF5",
    "HDF5, netCDF, MATLAB v7.3, frames of pandas",
    open_hdf5,
    recognises=_is_hdf5,
    column="a path, `group/name`",
    extra="hdf5",
    used="unit, `scale_factor`, `add_offset`; `_FillValue`, `missing_value` and values beyond `valid_range` are "
    "missing; `milliseconds since ...` is a unit and a start; the unit of stamps and durations of pandas; empty arrays "
    "of MATLAB are no columns",
    unused="fill values that no attribute states; the unit of dates that `savemat` turned into numbers: state it",
)
