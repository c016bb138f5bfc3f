"""Which format a raw file has, told by its first bytes, and the readers of all formats but text."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from operator import getitem
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from pneucli.errors import InputError
from pneucli.io.delimited import DelimitedReader
from pneucli.io.raw import Ask, Columns, RawFile, Reader, Repair, Values


def open_raw(raw: RawFile) -> Reader:
    """Open a raw file of any format that is known.

    Raises InputError where it is unreadable, cut off, or needs an extra that is not installed.
    """
    with raw.path.open("rb") as file:
        head = file.read(1024)
    for magic, (opener, name) in _FORMATS.items():
        if head.startswith(magic) or (name == "HDF5" and head[512 : 512 + len(magic)] == magic):
            return _guarded(opener, raw.path, name)
    if raw.path.suffix.lower() in _BINARY and not head.strip():
        raise InputError(str(raw.path), "the file is empty", "a recording", "record it again or leave it out")
    return DelimitedReader(raw)


def _guarded(opener: Callable[[Path], Reader], path: Path, name: str) -> Reader:
    try:
        reader = opener(path)
    except (InputError, MemoryError):
        raise
    except Exception as error:  # the readers' libraries raise all kinds of things on damaged files
        found = f"cannot be read as {name}: {type(error).__name__}: {error}"
        raise InputError(str(path), found, f"a whole {name} file", "copy or export it again") from error
    if not reader.names:
        raise InputError(str(path), "holds no columns of numbers", f"a whole {name} file", "copy or export it again")
    return reader


def _library(module: str, extra: str, path: Path) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        wanted = f'the extra "{extra}"'
        raise InputError(str(path), f"{module} is not installed", wanted, f'pip install "pneucli[{extra}]"') from error


@dataclass
class ParquetReader:
    """A Parquet file, in batches."""

    path: Path
    names: Sequence[str]
    repairs: list[Repair] = field(default_factory=list)

    def batches(self, asks: Sequence[Ask]) -> Iterator[list[Values]]:
        """Yield the asked columns; time stamps of a calendar become seconds since the first of them."""
        first: dict[int, Any] = {}
        wanted = [self.names[ask.position] for ask in asks]
        for batch in pq.ParquetFile(self.path).iter_batches(1 << 20, columns=list(dict.fromkeys(wanted))):
            columns = [batch.column(name) for name in wanted]
            yield [_plain(column, ask, first) for column, ask in zip(columns, asks, strict=True)]

    def place(self, row: int) -> str:
        """Return file and row (from 1)."""
        return f"{self.path}, row {row + 1}"


def _plain(column: Any, ask: Ask, first: dict[int, Any]) -> Values:
    if ask.text:
        return np.array([str(value).strip() for value in column.to_pylist()], dtype=object)
    if pa.types.is_temporal(column.type):
        return seconds(column.to_numpy(zero_copy_only=False), first, ask.position)
    return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False))


def seconds(stamps: Values, first: dict[int, Any], key: int = 0) -> Values:
    """Return calendar time or durations as seconds since the first stamp that was seen under ``key``."""
    if stamps.dtype.kind == "m":
        return np.asarray(stamps / np.timedelta64(1, "s"), dtype=np.float64)
    start = first.setdefault(key, stamps[0])
    return np.asarray((stamps - start) / np.timedelta64(1, "s"), dtype=np.float64)


def _parquet(path: Path) -> Reader:
    return ParquetReader(path, pq.read_schema(path).names)


def _mat(path: Path) -> Reader:
    from scipy.io import loadmat  # noqa: PLC0415

    tree = loadmat(path, squeeze_me=True, struct_as_record=True)
    return _from_tree(path, {key: value for key, value in tree.items() if not key.startswith("__")})


def _from_tree(path: Path, tree: Mapping[str, Any]) -> Columns:
    leaves = dict(_leaves(tree, ""))
    return Columns(path, list(leaves), lambda name: _vector(leaves[name]))


def _leaves(node: Any, prefix: str) -> Iterator[tuple[str, Values]]:
    """Yield the vectors of nested tables; column 2 of a matrix ``m`` is called ``m/2``."""
    if isinstance(node, Mapping):
        for key, value in node.items():
            yield from _leaves(value, f"{prefix}/{key}" if prefix else str(key))
        return
    array = np.atleast_1d(node)
    if array.dtype.names:
        fields = {name: array[name][0] if array.size == 1 else array[name] for name in array.dtype.names}
        yield from _leaves(fields, prefix)
    elif array.dtype.kind in "fiubmM":
        array = array.squeeze() if array.size > 1 else array.ravel()
        if array.ndim == 1:
            yield prefix, array
        elif array.ndim == 2:
            rows = array if array.shape[0] < array.shape[1] else array.T
            yield from ((f"{prefix}/{number}", row) for number, row in enumerate(rows, 1))


def _vector(values: Any) -> Values:
    array = np.asarray(values).ravel()
    return seconds(array, {}) if array.dtype.kind in "mM" else array.astype(np.float64)


def _hdf5(path: Path) -> Reader:
    h5py = _library("h5py", "hdf5", path)

    def branch(group: Any) -> dict[str, Any]:
        inner = {key: group[key] for key in group if not key.startswith("#")}
        return {key: branch(node) if isinstance(node, h5py.Group) else node[()] for key, node in inner.items()}

    with h5py.File(path, "r") as file:
        return _from_tree(path, branch(file))


def _tdms(path: Path) -> Reader:
    tdms = _library("nptdms", "tdms", path).TdmsFile.read(path)
    channels = {f"{c.group_name}/{c.name}": c for group in tdms.groups() for c in group.channels()}
    columns: dict[str, Callable[[], Any]] = {name: partial(getitem, c, slice(None)) for name, c in channels.items()}
    clocked = [channel for channel in channels.values() if "wf_increment" in channel.properties]
    if clocked and not any(name.rsplit("/", 1)[-1] == "time" for name in columns):
        columns["time"] = clocked[0].time_track
    return Columns(path, list(columns), lambda name: _vector(columns[name]()))


def _mdf(path: Path) -> Reader:
    asammdf = _library("asammdf", "mdf", path)
    mdf = asammdf.MDF(path)
    masters = {group: mdf.get_master(group) for group in range(len(mdf.groups))}
    places = {name: where[0] for name, where in mdf.channels_db.items() if _is_signal(mdf, where[0])}
    longest = max(masters, key=lambda group: masters[group].size)
    clock = np.unique(np.concatenate(list(masters.values())))
    clock_name = next((n for n, (g, c) in places.items() if mdf.masters_db.get(g) == c and g == longest), "time")

    def fetch(name: str) -> Values:
        if name == clock_name:
            return clock
        signal = mdf.select([(name, *places[name])])[0]
        values = np.full(clock.size, np.nan)
        values[np.searchsorted(clock, signal.timestamps)] = signal.samples.astype(np.float64)
        return values

    return Columns(path, list(dict.fromkeys([*places, clock_name])), fetch)


def _is_signal(mdf: Any, place: tuple[int, int]) -> bool:
    channel = mdf.groups[place[0]].channels[place[1]]
    return not str(channel.name).startswith("CAN_")


_FORMATS: dict[bytes, tuple[Callable[[Path], Reader], str]] = {
    b"PAR1": (_parquet, "Parquet"),
    b"TDSm": (_tdms, "TDMS"),
    b"MDF ": (_mdf, "MDF4"),
    b"\x89HDF\r\n\x1a\n": (_hdf5, "HDF5"),
    b"MATLAB 5.0": (_mat, "MATLAB v5"),
}
_BINARY = (".mat", ".tdms", ".mf4", ".mdf", ".h5", ".hdf5", ".parquet")
