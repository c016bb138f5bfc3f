"""HDF5, frames of pandas and MATLAB v7.3: by paths; only datasets with a wanted column are read."""

from __future__ import annotations

import pickletools
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pneucli.errors import InputError
from pneucli.imports import library_of_extra
from pneucli.io.column_reader import (
    ColumnReader,
    as_text,
    clocks_by_group,
    column_names,
    packing,
    split_columns,
    tells_rate,
    titles_and_units,
)
from pneucli.io.formats.base import Format
from pneucli.io.formats.matlab import LABELS, NUMBERS, only_objects
from pneucli.io.packed import check_expanded_size
from pneucli.io.raw_file import ColumnValues
from pneucli.paths import natural_order

_NO_NUMBERS = ("char", "cell", "string", "function_handle", "struct")
_INTEGERS = [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
_MATLAB_NUMBERS = ("double", "single", "logical", *_INTEGERS)
_MISSING = ("_FillValue", "missing_value")
_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"
_STAMPS = re.compile(r"(datetime|timedelta)(?:64)?(?:\[(s|ms|us|ns)[,\]].*)?")


class Place(NamedTuple):
    """Where a column stands: a dataset, the field of a table, and the column of a matrix; None where there is none.

    Or which ``attribute`` it is, of one value.

    ``stamps``: the type of NumPy whose integers they are, such as ``datetime64[us]``; None where they are numbers.
    """

    dataset: str
    field: str | None = None
    column: int | None = None
    stamps: str | None = None
    attribute: str | None = None


def frame_columns(group: Any, path: str) -> dict[str, Place]:
    """Return the columns of a frame of pandas, in either of its two formats; empty where a group holds none."""
    if as_text(group.attrs.get("pandas_type")) not in ("frame", "series", "frame_table", "series_table"):
        return {}
    if "table" in group:
        return dict(_table_columns(group["table"], path))
    found: dict[str, Place] = {}
    index = "axis1" if "axis1" in group else "index"
    if index in group and group[index].dtype.kind in "iuf":
        found[f"{path}/index"] = Place(f"{path}/{index}", stamps=_stamps(group[index].attrs.get("kind")))
    if "values" in group:  # a series
        found[path] = Place(f"{path}/values")
    for block in (key.removesuffix("_values") for key in group if key.endswith("_values")):
        values = group[f"{block}_values"]
        for number, name in enumerate(group[f"{block}_items"][()].tolist()):
            if values.dtype.kind in "iufb":
                stamps = _stamps(values.attrs.get("value_type"))
                found[f"{path}/{as_text(name)}"] = Place(f"{path}/{block}_values", column=number, stamps=stamps)
    return found


def _stamps(kind: Any) -> str | None:
    """Return the type of stamps or durations that pandas names; nanoseconds where it names no unit, as it once did."""
    found = _STAMPS.fullmatch(as_text(kind))
    return f"{found[1]}64[{found[2] or 'ns'}]" if found else None


def _table_columns(table: Any, path: str) -> Iterator[tuple[str, Place]]:
    for field in table.dtype.names or ():
        kind = table.dtype[field]
        if field == "index":
            yield f"{path}/index", Place(f"{path}/table", field, stamps=_stamps(table.attrs.get("index_kind")))
        elif kind.base.kind in "iufb" and kind.shape:
            names = _pickled_texts(table.attrs.get(f"{field}_kind"))
            stamps = _stamps(table.attrs.get(f"{field}_dtype"))
            for number in range(kind.shape[0]):
                name = names[number] if number < len(names) else f"{field}/{number + 1}"
                yield f"{path}/{name}", Place(f"{path}/table", field, number, stamps)
        elif kind.kind in "iufb":
            yield f"{path}/{field}", Place(f"{path}/table", field)


def _pickled_texts(pickled: Any) -> list[str]:
    """Return the texts of a pickled list, read without running it."""
    raw = pickled.encode("latin-1") if isinstance(pickled, str) else bytes(pickled or b"")
    try:
        return [
            str(argument)
            for code, argument, _ in pickletools.genops(raw)
            if "UNICODE" in code.name or "STRING" in code.name
        ]
    except ValueError:
        return []


def struct_array_columns(file: Any, group: Any, path: str) -> dict[str, Place]:
    """Return the columns of an array of structs of MATLAB v7.3, whose fields are references: each by its label."""
    by_word = {key.lower(): key for key in group if getattr(group.get(key), "dtype", None) is not None}
    by_word = {word: key for word, key in by_word.items() if group[key].dtype.kind == "O"}
    numbers = next((by_word[word] for word in NUMBERS if word in by_word), None)
    if numbers is None:
        return {}
    labels = next((by_word[word] for word in LABELS if word in by_word), None)
    found: dict[str, Place] = {}
    for number, reference in enumerate(np.ravel(group[numbers][()])):
        dataset: Any = file[reference] if reference else None
        label = _referenced_text(file, group, labels, number) or str(number + 1)
        if getattr(dataset, "dtype", None) is not None and dataset.dtype.kind in "iufb":
            found[f"{path}/{label}"] = Place(dataset.name)
    return found


def _referenced_text(file: Any, group: Any, labels: str | None, number: int) -> str:
    if labels is None:
        return ""
    return _letters(file, np.ravel(group[labels][()])[number])


def _letters(file: Any, reference: Any) -> str:
    """Return the text that a cell of MATLAB refers to; empty where it is none."""
    letters = np.ravel(file[reference][()])
    return "".join(map(chr, letters.tolist())).strip() if letters.dtype.kind in "iu" and letters.all() else ""


def is_matlab_object(node: Any) -> bool:
    """Return whether a dataset or group of MATLAB v7.3 is an object, which only MATLAB reads."""
    kind = as_text(node.attrs.get("MATLAB_class"))
    return "MATLAB_object_decode" in node.attrs or bool(kind and kind not in (*_NO_NUMBERS, *_MATLAB_NUMBERS))


def is_no_number(dataset: Any) -> bool:
    """Return whether MATLAB says that the integers of a dataset are letters or other things that are no numbers."""
    return as_text(dataset.attrs.get("MATLAB_class")) in _NO_NUMBERS


def is_empty(dataset: Any) -> bool:
    """Return whether a dataset has no data: an empty array of MATLAB, stored as its size, or a dimension of netCDF."""
    return "MATLAB_empty" in dataset.attrs or as_text(dataset.attrs.get("NAME")).startswith(_NO_VARIABLE)


def unpacked(attributes: Mapping[str, Any], array: Any, factor: float, offset: float) -> Any:
    """Return the values of a dataset that may be packed, NaN where one is missing or not valid.

    Fill values and limits count in the numbers as they are stored (CF conventions 1.11, sections 2.5.1 and 8.1).
    """
    if array.dtype.kind not in "iuf":
        return array
    low, high = np.ravel(attributes.get("valid_range", (-np.inf, np.inf)))
    low, high = _first(attributes, "valid_min", low), _first(attributes, "valid_max", high)
    missing = [mark for key in _MISSING if key in attributes for mark in np.ravel(attributes[key])]
    lost = np.isin(array, missing) | (array < low) | (array > high)
    values = array if (factor, offset) == (1.0, 0.0) else array * factor + offset
    return np.where(lost, np.nan, values) if lost.any() else values


def _packing(dataset: Any, column: int | None = None) -> tuple[float, float] | None:
    """Return the packing of a dataset, or of a column of a matrix whose attributes have a number for each."""
    said, count = dict(dataset.attrs), len(column_names("", dataset.shape))
    if column is not None:
        said = {key: own[column] if np.shape(own) == (count,) and column < count else own for key, own in said.items()}
    return packing(said, whole=dataset.dtype.kind in "iu")


def _first(attributes: Any, key: str, otherwise: float) -> Any:
    return np.ravel(attributes.get(key, otherwise))[0]


def open_hdf5(path: Path) -> ColumnReader:
    """List the columns: a dataset, ``matrix/2``, or a field of a table, each below its path."""
    h5py = library_of_extra("h5py", "hdf5", path)
    owner: dict[str, Place] = {}
    units: dict[str, str] = {}
    sizes: dict[str, int] = {}
    objects: list[str] = []
    foreign: list[str] = []
    with h5py.File(path, "r") as file:
        nodes = [*_nodes(h5py, file)]
        texts = [(name.rpartition("/")[0], node) for name, node in nodes if _kind(node) in ("O", "S")]
        for name, node in nodes:
            if is_matlab_object(node):
                objects.append(name)
            elif isinstance(node, h5py.Dataset) and not _kind(node):
                foreign.append(name)
            elif isinstance(node, h5py.Dataset):
                beside = [one for group, one in texts if group == name.rpartition("/")[0]]
                found = dict(_dataset_columns(name, node, beside))
                owner |= found
                units |= zip(found, _titles_and_units(node, len(found), beside)[1], strict=True)
                sizes |= dict.fromkeys(found, max(node.shape, default=1))
            else:
                found = frame_columns(node, name) or struct_array_columns(file, node, name)
                owner |= found
                sizes |= {column: max(file[place.dataset].shape) for column, place in found.items()}
            owner |= _rates(name, node)
    if objects and not owner:
        raise only_objects(path, objects)
    if foreign and not owner:
        found_there = f'"{foreign[0]}": a type that NumPy lacks, such as the times of PyTables (Time64Col)'
        raise InputError(str(path), found_there, "numbers", "store the times as Float64Col", code="E041")

    def fetch(wanted: Sequence[str]) -> list[ColumnValues]:
        with h5py.File(path, "r") as file:
            datasets = {owner[name].dataset for name in wanted if owner[name].attribute is None}
            check_expanded_size(path, sum(file[name].size * file[name].dtype.itemsize for name in datasets))
            return [_read(file, owner[name]) for name in wanted]

    names = list(owner)
    units |= {name: "s" for name, place in owner.items() if place.stamps}
    return ColumnReader(path, HDF5.name, names, fetch, units, own_clocks=clocks_by_group(names, sizes))


def _rates(path: str, node: Any) -> dict[str, Place]:
    """Return the attributes of a group or dataset that say a rate, or the time between samples, or what a count is."""
    is_open = _kind(node) and _packing(node) is None
    said = [key for key in node.attrs if is_open or tells_rate(key)]
    numbers = [key for key in said if np.size(node.attrs[key]) == 1 and np.asarray(node.attrs[key]).dtype.kind in "iuf"]
    return {f"{path}/{key}".lstrip("/"): Place(path or "/", attribute=key) for key in numbers}


def _kind(dataset: Any) -> str:
    """Return the letter of a dataset's type in NumPy; empty of a group, and where it has none."""
    try:
        return str(dataset.dtype.kind)
    except (AttributeError, TypeError):
        return ""


def _dataset_columns(name: str, dataset: Any, beside: Sequence[Any]) -> Iterator[tuple[str, Place]]:
    if is_no_number(dataset) or is_empty(dataset):
        return
    for field in dataset.dtype.names or [None]:
        kind = dataset.dtype[field] if field else dataset.dtype
        if kind.kind in "fiub":
            own = f"{name}/{field}" if field else name
            columns = column_names(own, dataset.shape)
            columns = [f"{own}/{text}" for text in _titles_and_units(dataset, len(columns), beside)[0]] or columns
            for number, column in enumerate(columns):
                yield column, Place(name, field, number if len(columns) > 1 else None)


def _read(file: Any, place: Place) -> ColumnValues:
    if place.attribute is not None:
        return np.ravel(file[place.dataset].attrs[place.attribute])
    dataset = file[place.dataset]
    attributes, packed = dict(dataset.attrs), _packing(dataset, place.column)
    if dataset.is_virtual or dataset.external:  # where such a file is gone or cut, HDF5 reads 0
        where = f'{file.filename}, dataset "{place.dataset}"'
        mend = "write them into this one, as h5repack does"
        raise InputError(where, "its numbers stand in other files", "numbers in one file", mend, code="E044")
    absent = [*_absent_parts(dataset)]
    array = dataset[()] if place.field is None else dataset[place.field]
    if absent:
        array = np.asarray(array, dtype=np.float64)
        for part in absent:
            (array if isinstance(part, tuple) else array.reshape(-1))[part] = np.nan
    if place.column is not None:
        array = list(split_columns("", array).values())[place.column] if array.ndim > 1 else array
    if place.stamps is not None:
        array = np.asarray(array).astype(np.int64).view(place.stamps)
    return np.ravel(unpacked(attributes, array, *(packed or (1.0, 0.0))))


def _absent_parts(dataset: Any) -> Iterator[tuple[slice, ...] | slice]:
    """Yield the parts of a dataset, or of it as flat, that nobody wrote.

    HDF5 reads its fill value there, 0 where none is stated.
    """
    if dataset.chunks is not None:
        firsts = [range(0, side, step) for side, step in zip(dataset.shape, dataset.chunks, strict=True)]
        if (count := dataset.id.get_num_chunks()) < prod(map(len, firsts)):
            written = {dataset.id.get_chunk_info(n).chunk_offset for n in range(count)}
            for first in (one for one in product(*firsts) if one not in written):
                yield tuple(slice(a, a + step) for a, step in zip(first, dataset.chunks, strict=True))
    elif dataset.size and not dataset.id.get_storage_size():
        yield slice(None)


def _titles_and_units(dataset: Any, count: int, texts: Sequence[Any]) -> tuple[Sequence[str], Sequence[str]]:
    """Return what attributes, or datasets of texts beside a matrix, call its columns, and the unit of each."""
    said = {key.lower(): _texts(own) for key, own in dataset.attrs.items()}
    units = next((own for key, own in said.items() if key in ("unit", "units") and len(own) == count > 1), [])
    named = [own for key, own in said.items() if not key.startswith("unit")]
    titles, beside = titles_and_units([*named, *_texts_of(texts, count)], count)
    told = units or beside or [_unit(dataset)] * count
    packed = [_packing(dataset, number) if count > 1 else (1.0, 0.0) for number in range(count)]
    return titles, ["counts" if own is None else unit for own, unit in zip(packed, told, strict=True)]


def _texts_of(texts: Sequence[Any], count: int) -> Iterator[list[str]]:
    """Yield the texts of each dataset that has one a column of a matrix: strings, or a cell array of MATLAB.

    Or those of as many datasets of one text each, by the numbers in their names (RTXI).
    """
    cells = [(one, np.ravel(one[()])) for one in texts if count > 1 and one.size in (1, count)]
    found = [
        [as_text(cell) if isinstance(cell, str | bytes) else _letters(one.file, cell) for cell in own]
        for one, own in sorted(cells, key=lambda pair: natural_order(Path(pair[0].name)))
    ]
    yield from (own for own in found if len(own) == count)
    yield [own[0] for own in found if len(own) == 1]


def _texts(attribute: Any) -> list[str]:
    """Return the texts of an attribute that is an array of them."""
    own = list(attribute) if np.ndim(attribute) == 1 else []
    return [as_text(one) for one in own] if all(isinstance(one, str | bytes) for one in own) else []


def _unit(dataset: Any) -> str:
    """Return the unit that stands in a dataset's attributes, if any; counts where these leave open what one is."""
    if _packing(dataset) is None:
        return "counts"
    found = [dataset.attrs.get(key) for key in ("unit", "units", "Unit", "Units")]
    first = [np.ravel(one)[0] for one in found if np.size(one) == 1]  # a text, or an array of one
    texts = [one.decode(errors="replace") if isinstance(one, bytes) else one for one in first]
    return next((text for text in texts if isinstance(text, str)), "")


def _nodes(h5py: Any, file: Any) -> Iterator[tuple[str, Any]]:
    """Yield path and node of each dataset, and of groups that hold a frame, an array of structs, an object or a rate.

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
        if _rates("", node) or any(isinstance(node[key], h5py.Dataset) and _kind(node[key]) == "O" for key in inner):
            yield prefix, node
        waiting += [(f"{prefix}/{key}".lstrip("/"), node[key]) for key in reversed(inner)]


def _is_own(h5py: Any, group: Any, key: str) -> bool:
    if isinstance(group.get(key, getlink=True), h5py.ExternalLink):
        return False
    return isinstance(group.get(key), h5py.Group | h5py.Dataset)


HDF5 = Format(
    "HDF5",
    "HDF5, netCDF, MATLAB v7.3, frames of pandas",
    open_hdf5,
    pattern=rb"(?s)(?:.{512})?\x89HDF\r\n\x1a\n",  # MATLAB writes a block before it
    column="a path, `group/name`",
    extra="hdf5",
    used="unit, `scale_factor`, `add_offset`, `conversion`, a clear `gain` and `offset`; `_FillValue`, "
    "`missing_value`, values beyond `valid_range` and parts that nobody wrote are missing; `milliseconds since ...` is "
    "a unit and a start; the unit of stamps and durations of pandas; empty arrays of MATLAB are no columns",
    unused="fill values that no attribute states; the unit of dates that `savemat` turned into numbers: state it",
)
