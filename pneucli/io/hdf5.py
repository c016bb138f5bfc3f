"""HDF5 and MATLAB v7.3: datasets by their paths; a dataset is read only if one of its columns is wanted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pneucli.io.column_reader import ColumnReader, column_names, import_extra, split_columns, to_vector
from pneucli.io.damaged_files import check_expanded_size
from pneucli.io.raw_file import ColumnValues

NAME = "HDF5"


def open_hdf5(path: Path) -> ColumnReader:
    """List the columns: a dataset, ``matrix/2``, or a field of a table, each below its path."""
    h5py = import_extra("h5py", "hdf5", path)
    owner: dict[str, tuple[str, str | None]] = {}  # column -> dataset, field
    units: dict[str, str] = {}
    with h5py.File(path, "r") as file:
        for name, dataset in _datasets(h5py, file):
            for field in dataset.dtype.names or [None]:
                kind = (dataset.dtype[field] if field else dataset.dtype).kind
                if kind in "fiub":
                    own = f"{name}/{field}" if field else name
                    owner |= dict.fromkeys(column_names(own, dataset.shape), (name, field))
                    units |= dict.fromkeys(column_names(own, dataset.shape), _unit(dataset))

    def fetch(wanted: Sequence[str]) -> list[ColumnValues]:
        columns: dict[str, ColumnValues] = {}
        with h5py.File(path, "r") as file:
            parts = dict.fromkeys(owner[name] for name in wanted)
            check_expanded_size(path, sum(file[name].size * file[name].dtype.itemsize for name, _ in parts))
            for name, field in parts:
                array = file[name][()] if field is None else file[name][field]
                own = f"{name}/{field}" if field else name
                columns |= {key: to_vector(part) for key, part in split_columns(own, array).items() if key in wanted}
        return [columns[name] for name in wanted]

    said = {number: units[name] for number, name in enumerate(owner) if units[name]}
    return ColumnReader(path, NAME, list(owner), fetch, said)


def _unit(dataset: Any) -> str:
    """Return the unit that stands in a dataset's attributes, if any."""
    found = [dataset.attrs.get(key) for key in ("unit", "units", "Unit", "Units")]
    texts = [one.decode(errors="replace") if isinstance(one, bytes) else one for one in found]
    return next((text for text in texts if isinstance(text, str)), "")


def _datasets(h5py: Any, file: Any) -> Iterator[tuple[str, Any]]:
    """Yield path and dataset, in order; each group once, as groups may hold one another, and nothing of other files."""
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
        inner = [key for key in node if not key.startswith("#") and _is_own(h5py, node, key)]
        waiting += [(f"{prefix}/{key}".lstrip("/"), node[key]) for key in reversed(inner)]


def _is_own(h5py: Any, group: Any, key: str) -> bool:
    if isinstance(group.get(key, getlink=True), h5py.ExternalLink):
        return False
    return isinstance(group.get(key), h5py.Group | h5py.Dataset)
