"""How writers lay out HDF5: frames of pandas, and structs, texts and objects of MATLAB v7.3."""

from __future__ import annotations

import pickletools
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from pneucli.io.mat_struct import LABELS, NUMBERS

_NO_NUMBERS = ("char", "cell", "string", "function_handle", "struct")
_INTEGERS = [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
_MATLAB_NUMBERS = ("double", "single", "logical", *_INTEGERS)


class Place(NamedTuple):
    """Where a column stands: a dataset, the field of a table, and the column of a matrix; None where there is none.

    ``calendar``: whether its integers are nanoseconds since 1970.
    """

    dataset: str
    field: str | None = None
    column: int | None = None
    calendar: bool = False


def frame_columns(group: Any, path: str) -> dict[str, Place]:
    """Return the columns of a frame of pandas, in either of its two formats; empty where a group holds none."""
    if _text(group.attrs.get("pandas_type")) not in ("frame", "series", "frame_table", "series_table"):
        return {}
    if "table" in group:
        return dict(_table_columns(group["table"], path))
    found: dict[str, Place] = {}
    index = "axis1" if "axis1" in group else "index"
    if index in group and group[index].dtype.kind in "iuf":
        kind = _text(group[index].attrs.get("kind"))
        found[f"{path}/index"] = Place(f"{path}/{index}", calendar=kind.startswith("datetime"))
    if "values" in group:  # a series
        found[path] = Place(f"{path}/values")
    for block in (key.removesuffix("_values") for key in group if key.endswith("_values")):
        for number, name in enumerate(group[f"{block}_items"][()].tolist()):
            if group[f"{block}_values"].dtype.kind in "iufb":
                found[f"{path}/{_text(name)}"] = Place(f"{path}/{block}_values", column=number)
    return found


def _table_columns(table: Any, path: str) -> Iterator[tuple[str, Place]]:
    for field in table.dtype.names or ():
        kind = table.dtype[field]
        if field == "index":
            calendar = _text(table.attrs.get("index_kind")).startswith("datetime")
            yield f"{path}/index", Place(f"{path}/table", field, calendar=calendar)
        elif kind.base.kind in "iufb" and kind.shape:
            names = _pickled_texts(table.attrs.get(f"{field}_kind"))
            for number in range(kind.shape[0]):
                name = names[number] if number < len(names) else f"{field}/{number + 1}"
                yield f"{path}/{name}", Place(f"{path}/table", field, number)
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


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    return value if isinstance(value, str) else "" if value is None else str(value)
