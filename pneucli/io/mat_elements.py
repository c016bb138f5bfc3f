"""The elements of a MATLAB v5 file, looked at before scipy reads them: how far they expand, and what they hold.

The format: MathWorks, "MAT-File Format", chapter 1. An element is a tag, of type and size, and its data. A matrix holds
elements in turn, and so does a compressed element once it is expanded.
"""

from __future__ import annotations

import mmap
import zlib
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from pneucli.io.damaged_files import MIN_EXPANSION_LIMIT

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
