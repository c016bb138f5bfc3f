"""How writers lay out HDF5: frames of pandas, and structs, texts and objects of MATLAB v7.3."""

from __future__ import annotations

import pickletools
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from pneucli.io.mat_struct import LABELS, NUMBERS

_NO_NUMBERS = ("char", "cell", "string", "function_handle", "struct")
_INTEGERS = [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
_MATLAB_NUMBERS = ("double", "single", "logical", *_INTEGERS)
_MISSING = ("_FillValue", "missing_value")
_PACKING = (*_MISSING, "scale_factor", "add_offset", "valid_range", "valid_min", "valid_max")
_NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"
_STAMPS = re.compile(r"(datetime|timedelta)(?:64)?(?:\[(s|ms|us|ns)[,\]].*)?")


class Place(NamedTuple):
    """Where a column stands: a dataset, the field of a table, and the column of a matrix; None where there is none.

    ``stamps``: the type of NumPy whose integers they are, such as ``datetime64[us]``; None where they are numbers.
    """

    dataset: str
    field: str | None = None
    column: int | None = None
    stamps: str | None = None


def frame_columns(group: Any, path: str) -> dict[str, Place]:
    """Return the columns of a frame of pandas, in either of its two formats; empty where a group holds none."""
    if _text(group.attrs.get("pandas_type")) not in ("frame", "series", "frame_table", "series_table"):
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
                found[f"{path}/{_text(name)}"] = Place(f"{path}/{block}_values", column=number, stamps=stamps)
    return found


def _stamps(kind: Any) -> str | None:
    """Return the type of stamps or durations that pandas names; nanoseconds where it names no unit, as it once did."""
    found = _STAMPS.fullmatch(_text(kind))
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
    by_word = {key.lower(): key for key in group if getattr(group[key], "dtype", None) is not None}
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
    letters = np.ravel(file[np.ravel(group[labels][()])[number]][()])
    return "".join(map(chr, letters.tolist())).strip() if letters.dtype.kind in "iu" and letters.all() else ""


def is_matlab_object(node: Any) -> bool:
    """Return whether a dataset or group of MATLAB v7.3 is an object, which only MATLAB reads."""
    kind = _text(node.attrs.get("MATLAB_class"))
    return "MATLAB_object_decode" in node.attrs or bool(kind and kind not in (*_NO_NUMBERS, *_MATLAB_NUMBERS))


def is_no_number(dataset: Any) -> bool:
    """Return whether MATLAB says that the integers of a dataset are letters or other things that are no numbers."""
    return _text(dataset.attrs.get("MATLAB_class")) in _NO_NUMBERS


def is_empty(dataset: Any) -> bool:
    """Return whether a dataset has no data: an empty array of MATLAB, stored as its size, or a dimension of netCDF."""
    return "MATLAB_empty" in dataset.attrs or _text(dataset.attrs.get("NAME")).startswith(_NO_VARIABLE)


def unpacked(dataset: Any, array: Any) -> Any:
    """Return the values of a dataset that is packed as netCDF and CF pack, NaN where one is missing or not valid.

    Fill values and limits count in the numbers as they are stored (CF conventions 1.11, sections 2.5.1 and 8.1).
    """
    attributes = dataset.attrs
    if not any(key in attributes for key in _PACKING):
        return array
    low, high = np.ravel(attributes.get("valid_range", (-np.inf, np.inf)))
    low, high = _first(attributes, "valid_min", low), _first(attributes, "valid_max", high)
    missing = [mark for key in _MISSING if key in attributes for mark in np.ravel(attributes[key])]
    values = array * float(_first(attributes, "scale_factor", 1.0)) + float(_first(attributes, "add_offset", 0.0))
    return np.where(np.isin(array, missing) | (array < low) | (array > high), np.nan, values)


def _first(attributes: Any, key: str, otherwise: float) -> Any:
    return np.ravel(attributes.get(key, otherwise))[0]


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    return value if isinstance(value, str) else "" if value is None else str(value)
