"""MATLAB v5: variables are read one by one, and only those that hold a wanted column.

The format: MathWorks, "MAT-File Format", chapter 1. An element is a tag, of type and size, and its data. A matrix holds
elements in turn, and so does a compressed element once it is expanded. Elements are looked at before scipy reads them.
"""

from __future__ import annotations

import mmap
import zlib
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from pneucli.errors import InputError
from pneucli.io.column_reader import ColumnReader, clocks_by_group, column_names
from pneucli.io.damaged_files import MIN_EXPANSION_LIMIT, check_expanded_size
from pneucli.io.formats.base import Format
from pneucli.io.mat_struct import StructColumns
from pneucli.io.raw_file import ColumnValues, Repair

Order = Literal["little", "big"]
Bytes = mmap.mmap | bytes

_HEADER, _TAG, _BLOCK = 128, 8, 1 << 20
_MATRIX, _COMPRESSED = 14, 15
_DATA_TYPES = frozenset((1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18))  # types of numbers and text
_PLAIN_CLASSES = range(4, 16)  # classes of matrices that hold numbers or text, no matrices
_SPARSE, _COMPLEX = 5, 0x0800  # that class, and the flag of numbers with an imaginary part
_MAX_ZLIB_RATIO = 1032  # zlib's best


def expanded_size(path: Path, wanted: Collection[int]) -> int:
    """Return how many bytes the wanted variables, by their place in the file, expand to; their own size if small."""
    total = 0
    with _mapped(path) as whole:
        for kind, begin, end in _variables(whole, wanted):
            large = kind == _COMPRESSED and (end - begin) * _MAX_ZLIB_RATIO > MIN_EXPANSION_LIMIT
            total += _expanded_bytes(whole, begin, end) if large else end - begin
    return total


def check_types(path: Path, wanted: Collection[int]) -> None:
    """Raise ValueError where a wanted variable holds data of no type: there scipy's reader would end the process."""
    with _mapped(path) as whole:
        for kind, begin, end in _variables(whole, wanted):
            if kind == _COMPRESSED:
                expanded = zlib.decompress(whole[begin:end])
                _count_elements(expanded, 0, len(expanded), _order(whole))
            else:
                _count_elements(whole, begin - _TAG, end, _order(whole))


@contextmanager
def _mapped(path: Path) -> Iterator[mmap.mmap]:
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as whole:
        yield whole


def _order(whole: mmap.mmap) -> Order:
    return "little" if whole[_HEADER - 2 : _HEADER] == b"IM" else "big"


def _variables(whole: mmap.mmap, wanted: Collection[int]) -> Iterator[tuple[int, int, int]]:
    """Yield the type of each wanted variable, and where its data begin and end."""
    at, number, order = _HEADER, 0, _order(whole)
    while at + _TAG <= len(whole):
        kind, size = _word(whole, at, order), _word(whole, at + 4, order)
        begin = at + _TAG
        at, number = begin + size, number + 1
        if number - 1 in wanted:
            yield kind, begin, min(at, len(whole))


def _word(data: Bytes, at: int, order: Order) -> int:
    return int.from_bytes(data[at : at + 4], order)


def _count_elements(data: Bytes, begin: int, end: int, order: Order, allowed: Collection[int] = (_MATRIX,)) -> int:
    """Return the number of elements in a stretch of data; raise ValueError where one is of none of the allowed types.

    Or where a matrix of numbers ends before them: what comes next in the file would be taken for them.
    """
    number = 0
    while begin + _TAG <= end:
        kind, size = _word(data, begin, order), _word(data, begin + 4, order)
        if kind >> 16:  # both in one word, and up to four bytes of data beside it
            kind, size = kind & 0xFFFF, 0
        if kind not in allowed:
            raise ValueError(f"data of type {kind}, which is none")
        begin, number = begin + _TAG, number + 1
        if kind == _MATRIX and size:
            flags = _word(data, begin + _TAG, order)
            plain = flags & 0xFF in _PLAIN_CLASSES
            parts = _count_elements(
                data, begin, min(begin + size, end), order, _DATA_TYPES if plain else _DATA_TYPES | {_MATRIX}
            )
            if plain and parts < 4 + 2 * (flags & 0xFF == _SPARSE) + bool(flags & _COMPLEX):  # flags, shape, name, data
                raise ValueError("a matrix without its numbers")
        begin += size + -size % 8
    return number


def _expanded_bytes(whole: mmap.mmap, begin: int, end: int) -> int:
    """Return how many bytes a stretch of compressed data expands to."""
    stream, total = zlib.decompressobj(), 0
    while begin < end and not stream.eof:
        block = whole[begin : min(begin + _BLOCK, end)]
        begin += _BLOCK
        while block and not stream.eof:
            total += len(stream.decompress(block, _BLOCK))
            block = stream.unconsumed_tail
    return total


_NUMBERS = ("double", "single", "logical", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64")
_OBJECTS = ("opaque", "object", "function")
SAVE_AS_STRUCT = (
    "save what it holds as vectors: s.t = ts.Time; s.p1 = ts.Data; save('run.mat', '-struct', 's') "
    "(of a timetable: s = table2struct(timetable2table(tt), 'ToScalar', true); of logsout: each getElement(k).Values)"
)


def open_mat(path: Path) -> ColumnReader:
    """List the columns: a vector by its name, ``struct/field``, column 2 of a matrix as ``m/2``.

    Raises InputError where the file holds nothing but objects of MATLAB, which only MATLAB reads.
    """
    from scipy.io import whosmat  # noqa: PLC0415 - slow to import, and few recordings are MATLAB's

    variables = whosmat(path)
    owner: dict[str, str] = {}
    units: dict[str, str] = {}
    clocks: dict[str, str] = {}
    sizes: dict[str, int] = {}
    for name, shape, kind in variables:
        if kind in _NUMBERS:
            owner |= dict.fromkeys(column_names(name, shape), name)
        elif kind == "struct":
            found = _load(path, [name])
            owner |= dict.fromkeys(found.columns, name)
            sizes |= {column: values.size for column, values in found.columns.items()}
            units, clocks = units | found.units, clocks | found.clocks
    objects = [name for name, _, kind in variables if kind in _OBJECTS and name]
    _check_objects(path, objects, owner)

    def fetch(wanted: Sequence[str]) -> list[ColumnValues]:
        columns = _load(path, list(dict.fromkeys(owner[name] for name in wanted))).columns
        return [columns[name].ravel() for name in wanted]

    clocks = clocks or clocks_by_group(list(owner), sizes)
    reader = ColumnReader(path, MATLAB.name, list(owner), fetch, units, own_clocks=clocks)
    if objects:
        listed = ", ".join(f'"{name}"' for name in objects[:5])
        message = f"{listed}: objects of MATLAB (timeseries, timetable, Dataset), left out; {SAVE_AS_STRUCT}"
        reader.repairs.append(Repair("", "matlab-object", len(objects), message))
    return reader


def _check_objects(path: Path, objects: Sequence[str], owner: object) -> None:
    if objects and not owner:
        listed = ", ".join(f'"{name}"' for name in objects[:5])
        found = f"{listed}: objects of MATLAB (timeseries, timetable, Dataset), which only MATLAB reads"
        raise InputError(str(path), found, "vectors, or structs of vectors", SAVE_AS_STRUCT, code="E041")


def _load(path: Path, variables: list[str]) -> StructColumns:
    from scipy.io import loadmat, whosmat  # noqa: PLC0415 - slow to import, and few recordings are MATLAB's

    wanted = {k for k, (name, _, _) in enumerate(whosmat(path)) if name in variables}
    check_expanded_size(path, expanded_size(path, wanted), of=f'the variables "{", ".join(variables)[:60]}"')
    check_types(path, wanted)
    tree = loadmat(path, variable_names=variables, squeeze_me=True, struct_as_record=True)
    found = StructColumns()
    for name in variables:
        found.add(tree[name], name)
    found.link_numbered_clocks()
    return found


MATLAB = Format(
    "MATLAB v5",
    "MATLAB v5",
    open_mat,
    magic=(b"MATLAB 5.0",),
    column="a vector; a field, `struct/field`; column 2 of a matrix, `m/2`",
    used="name, unit and clock of a struct that holds a signal (Simulink, dSPACE)",
    unused="objects (`timeseries`, `timetable`) are refused: save them as structs",
)
