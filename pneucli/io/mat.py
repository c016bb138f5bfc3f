"""MATLAB v5: variables are read one by one, and only those that hold a wanted column."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from scipy.io import loadmat, whosmat

from pneucli.io.guard import LEAST, check_size
from pneucli.io.raw import Values
from pneucli.io.whole import WholeReader, columns_of, split, vector

NAME = "MATLAB v5"
_NUMBERS = ("double", "single", "logical", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64")
_HEADER, _COMPRESSED, _BLOCK = 128, 15, 1 << 20
_SHRINKS = 1032  # zlib's best


def open_mat(path: Path) -> WholeReader:
    """List the columns: a vector by its name, ``struct/field``, column 2 of a matrix as ``m/2``."""
    variables = whosmat(path)
    owner: dict[str, str] = {}
    for name, shape, kind in variables:
        if kind in _NUMBERS:
            owner |= dict.fromkeys(columns_of(name, shape), name)
        elif kind == "struct":
            owner |= dict.fromkeys(_load(path, [name]), name)

    def fetch(wanted: Sequence[str]) -> list[Values]:
        columns = _load(path, list(dict.fromkeys(owner[name] for name in wanted)))
        return [vector(columns[name]) for name in wanted]

    return WholeReader(path, NAME, list(owner), fetch)


def _load(path: Path, variables: list[str]) -> dict[str, Values]:
    listed = [name for name, _, _ in whosmat(path)]
    sizes = dict(zip(listed, _sizes(path, {k for k, name in enumerate(listed) if name in variables}), strict=False))
    check_size(path, sum(sizes.get(name, 0) for name in variables), of=f'the variables "{", ".join(variables)[:60]}"')
    tree = loadmat(path, variable_names=variables, squeeze_me=True, struct_as_record=True)
    return dict(_leaves({name: tree[name] for name in variables}, ""))


def _leaves(node: Any, prefix: str) -> Iterator[tuple[str, Values]]:
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
        yield from split(prefix, array).items()


def _sizes(path: Path, wanted: set[int]) -> Iterator[int]:
    """Yield how many bytes each variable of the file expands to; its own size where it is small or not wanted."""
    end = path.stat().st_size
    with path.open("rb") as file:
        order = "little" if file.read(_HEADER)[126:128] == b"IM" else "big"
        for number in range(end):
            tag = file.read(8)
            if len(tag) < 8:
                return
            kind, size = (int.from_bytes(part, order) for part in (tag[:4], tag[4:]))  # type: ignore[arg-type]
            after = file.tell() + size
            large = number in wanted and kind == _COMPRESSED and size * _SHRINKS > LEAST
            yield _expanded(file, size) if large else min(size, end)
            file.seek(after)


def _expanded(file: BinaryIO, size: int) -> int:
    """Return how many bytes the next ``size`` bytes of ``file`` expand to."""
    stream, total = zlib.decompressobj(), 0
    while size > 0 and not stream.eof:
        block = file.read(min(size, _BLOCK))
        size -= _BLOCK
        while block and not stream.eof:
            total += len(stream.decompress(block, _BLOCK))
            block = stream.unconsumed_tail
    return total
