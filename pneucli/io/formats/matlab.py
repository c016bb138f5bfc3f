"""MATLAB v5: variables are read one by one, and only those that hold a wanted column.

The format: MathWorks, "MAT-File Format", chapter 1. An element is a tag, of type and size, and its data. A matrix holds
elements in turn, and so does a compressed element once it is expanded. Elements are looked at before scipy reads them.
Level 4 is plain matrices, in which Dymola writes its results.
"""

from __future__ import annotations

import mmap
import re
import struct
import zlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pneucli.errors import InputError
from pneucli.io.column_reader import ColumnReader, clocks_by_group, column_names, split_columns, tells_rate, titled
from pneucli.io.formats.base import Format
from pneucli.io.packed import MIN_EXPANSION_LIMIT, check_expanded_size
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
ALL = range(1 << 20)  # variables
SAVE_AS_STRUCT = (
    "save what it holds as vectors: s.t = ts.Time; s.p1 = ts.Data; save('run.mat', '-struct', 's') "
    "(of a timetable: s = table2struct(timetable2table(tt), 'ToScalar', true); of logsout: each getElement(k).Values)"
)


def open_mat(path: Path) -> ColumnReader:
    """List the columns: a vector by its name, ``struct/field``, column 2 of a matrix as ``m/2``.

    Raises InputError where the file holds nothing but objects of MATLAB, which only MATLAB reads.
    """
    variables = _listed(path)
    owner: dict[str, str] = {}
    units: dict[str, str] = {}
    clocks: dict[str, str] = {}
    titles, own = dict[str, str](), dict[str, str]()
    sizes: dict[str, int] = {}
    for name, shape, kind in variables:
        if kind in _NUMBERS:
            owner |= dict.fromkeys(column_names(name, shape), name)
        elif kind in ("struct", "cell"):
            found = _load(path, [name])
            owner |= dict.fromkeys(found.columns, name)
            sizes |= {column: values.size for column, values in found.columns.items()}
            units, clocks, titles = units | found.units, clocks | found.clocks, titles | found.titles
    objects = [name for name, _, kind in variables if kind in _OBJECTS and name]
    if objects and not owner:
        raise only_objects(path, objects)
    listed = [name for name, _, kind in variables if kind in ("char", "cell") and name not in {*owner.values()}]
    texts = {name: _listed_texts(array) for name, array in (_tree(path, listed) if listed else {}).items()}
    for name, columns in [(name, column_names(name, shape)) for name, shape, kind in variables if kind in _NUMBERS]:
        called, said = titled(name, columns, texts.values())
        titles, own = titles | called, own | said
        own |= dict(zip(columns, texts.get(f"{name}_units", ()), strict=False)) if len(columns) == 1 else {}
    keys = {titles.get(name, name): name for name in owner}
    units = {titles.get(name, name): unit for name, unit in (units | own).items()}

    def fetch(wanted: Sequence[str]) -> list[ColumnValues]:
        columns = _load(path, list(dict.fromkeys(owner[keys[name]] for name in wanted))).columns
        return [columns[keys[name]].ravel() for name in wanted]

    clocks = clocks or clocks_by_group(list(owner), sizes)
    clocks = {titles.get(name, name): titles.get(clock, clock) for name, clock in clocks.items()}
    reader = ColumnReader(path, MATLAB.name, list(keys), fetch, units, own_clocks=clocks)
    if objects:
        message = f"{_listed_objects(objects)}, left out; {SAVE_AS_STRUCT}"
        reader.repairs.append(Repair("", "matlab-object", len(objects), message))
    return reader


def _listed(path: Path) -> list[tuple[str, tuple[int, ...], str]]:
    """Return name, shape and kind of each variable; all as structs beside an object of which SciPy lists nothing."""
    from scipy.io import loadmat, whosmat  # noqa: PLC0415 - slow to import, and few recordings are MATLAB's

    try:
        return [*whosmat(path)]
    except TypeError:  # SciPy asks an object for its shape, which it has not read
        check_expanded_size(path, expanded_size(path, ALL), of="the file")
        check_types(path, ALL)
    tree = loadmat(path)
    objects = tree.pop("None")["s0"]  # SciPy's name of the last one
    plain = [(name, (), "struct") for name in tree if not name.startswith("__")]
    return [*plain, *((str(name, "latin-1"), (), "opaque") for name in objects)]


def only_objects(path: Path, objects: Sequence[str]) -> InputError:
    """Return the error of a file that holds nothing but objects."""
    found = f"{_listed_objects(objects)}, which only MATLAB reads"
    return InputError(str(path), found, "vectors, or structs of vectors", SAVE_AS_STRUCT, code="E041")


def _listed_objects(objects: Sequence[str]) -> str:
    return ", ".join(f'"{name}"' for name in objects[:5]) + ": objects of MATLAB (timeseries, timetable, Dataset)"


def _listed_texts(array: Any) -> list[str]:
    """Return the texts of an array of them, empty where an element is none."""
    cells = [np.ravel(one) for one in np.ravel(array)]
    return [str(one[0]).strip() if one.size == 1 and one.dtype.kind in "US" else "" for one in cells]


def _load(path: Path, variables: list[str]) -> StructColumns:
    tree, found = _tree(path, variables), StructColumns()
    for name in variables:
        found.add(tree[name], name)
    found.link_numbered_clocks()
    return found


def _tree(path: Path, variables: list[str]) -> dict[str, Any]:
    from scipy.io import loadmat, whosmat  # noqa: PLC0415 - slow to import, and few recordings are MATLAB's

    try:
        wanted: Collection[int] = {k for k, (name, _, _) in enumerate(whosmat(path)) if name in variables}
    except TypeError:
        wanted = ALL
    check_expanded_size(path, expanded_size(path, wanted), of=f'the variables "{", ".join(variables)[:60]}"')
    check_types(path, wanted)
    tree: dict[str, Any] = loadmat(path, variable_names=variables, squeeze_me=True, struct_as_record=True)
    return {name: tree[name] for name in variables}


MATLAB = Format(
    "MATLAB v5",
    "MATLAB v5",
    open_mat,
    magic=(b"MATLAB 5.0",),
    column="a vector; a field, `struct/field`; column 2 of a matrix, `m/2`",
    used="name, unit and clock of a struct that holds a signal (Simulink, dSPACE); names beside a matrix",
    unused="objects (`timeseries`, `timetable`) are refused: save them as structs",
)


_MATRIX_HEADER = struct.Struct("<5i")
_MAX_NAME = 64  # characters
_DYMOLA = {"Aclass", "name", "dataInfo"}
_UNIT = re.compile(r"\[([^][|:]+)(?:\|[^][|]*)?\](?=[^][]*$)")  # the last brackets; a colon begins a type, no unit


def is_mat4(head: bytes, _: Path) -> bool:
    """Return whether a file begins with a matrix of level 4: type, rows, columns, imaginary flag, length of name."""
    if len(head) < _MATRIX_HEADER.size + 2:
        return False
    for order in "<>":
        kind, rows, columns, imaginary, length = struct.unpack(f"{order}5i", head[: _MATRIX_HEADER.size])
        usual = 0 <= kind <= 4052 and kind // 100 % 10 == 0 and kind % 10 in (0, 1, 2) and kind // 10 % 10 <= 5
        sizes = 0 < rows < 1 << 30 and 0 <= columns < 1 << 30 and imaginary in (0, 1) and 1 < length <= _MAX_NAME
        name = head[_MATRIX_HEADER.size : _MATRIX_HEADER.size + length].rstrip(b"\0")
        if usual and sizes and (kind >= 1000) == (order == ">") and name.replace(b"_", b"").isalnum():
            return True
    return False


def open_mat4(path: Path) -> ColumnReader:
    """List the columns: vectors by name, columns of matrices by number; the trajectories of Dymola by their names."""
    from scipy.io import loadmat, whosmat  # noqa: PLC0415 - slow to import, and few recordings are MATLAB's

    variables = whosmat(path)
    check_expanded_size(path, 8 * sum(int(np.prod(shape)) for _, shape, kind in variables if kind != "char"))
    if {name for name, _, _ in variables} >= _DYMOLA:
        columns, units = _dymola(path)
        return ColumnReader.of_columns(path, MATLAB_4.name, columns, units, {})

    def load(wanted: Collection[str]) -> dict[str, ColumnValues]:
        tree = loadmat(path, variable_names=list(wanted))
        return {name: np.asarray(tree[name], dtype=np.float64) for name in wanted}

    shapes = {name: shape for name, shape, kind in variables if kind not in ("char", "sparse")}
    return ColumnReader.of_arrays(path, MATLAB_4.name, shapes, load)


def _dymola(path: Path) -> tuple[dict[str, ColumnValues], dict[str, str]]:
    """Return the trajectories and their units, by name.

    ``dataInfo`` says of each name in which matrix, in which column, and with which sign. ``description`` ends with the
    unit of the stored numbers, then that in which Dymola displays them: ``Pressure [Pa|bar]``.
    """
    from scipy.io import loadmat  # noqa: PLC0415 - slow to import, and few recordings are MATLAB's

    tree = loadmat(path, chars_as_strings=False)
    transposed = "binTrans" in ["".join(row).strip("\0 ") for row in tree["Aclass"]]
    letters, info = tree["name"], np.asarray(tree["dataInfo"], dtype=np.int64)
    remarks = tree.get("description", letters[:0])
    if transposed:
        letters, info, remarks = letters.T, info.T, remarks.T
    texts = ["".join(row).strip("\0 ") for row in remarks] if len(remarks) == len(letters) else [""] * len(letters)
    found: dict[str, ColumnValues] = {}
    units: dict[str, str] = {}
    for row, (matrix, column, *_), text in zip(letters, info.tolist(), texts, strict=True):
        name = "".join(row).strip("\0 ")
        data = tree.get(f"data_{matrix or 2}")
        if data is None:
            continue
        data = np.asarray(data.T if transposed else data, dtype=np.float64)
        if name and data.shape[0] > 2:  # constants have a matrix of two rows
            found[name] = np.sign(column or 1) * data[:, abs(column or 1) - 1]
            if unit := _UNIT.search(text):
                units[name] = unit[1].replace(".", "*")  # Modelica's N.m
    return found, units


MATLAB_4 = Format(
    "MATLAB v4",
    "MATLAB v4, Dymola",
    open_mat4,
    recognises=is_mat4,
    column="a vector, a column `m/2`, a trajectory",
    used="Dymola's units",
)


NUMBERS = ("values", "data", "value", "signal", "ydata")
LABELS = ("label", "name", "signalname", "title", "blockname")
_STAMPS = ("time", "t", "tout", "timestamps", "xdata")
_UNITS = ("unit", "units")
_CLOCK_NUMBER = "xindex"  # of dSPACE: which of the X belongs to a Y, from 1


@dataclass
class StructColumns:
    """Columns by name, the unit of each, and the clock of those that have one of their own, both by name.

    A struct that holds one signal (Simulink's scopes and logs, dSPACE's experiments) has its numbers under ``values``
    or ``Data`` and its name under ``label`` or ``Name``; the column is then called by that name. ``titles`` are what
    texts beside a matrix call its columns.
    """

    columns: dict[str, ColumnValues] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    clocks: dict[str, str] = field(default_factory=dict)
    titles: dict[str, str] = field(default_factory=dict)
    _numbered: dict[str, int] = field(default_factory=dict)  # of dSPACE

    def add(self, node: Any, name: str) -> None:
        """Add what a variable holds, at any depth."""
        if isinstance(node, Mapping):
            self._add_struct(node, name)
            return
        array = np.atleast_1d(node)
        cells = [np.atleast_1d(one) for one in array.ravel()] if array.dtype.kind == "O" else [array]
        if all(one.dtype.names for one in cells):
            self._add_elements([_fields(one) for cell in cells for one in cell.ravel()], name)
        elif array.dtype.kind in "fiub":
            self._add_array(array, name)

    def link_numbered_clocks(self) -> None:
        """Give each column that says the number of its clock that clock."""
        for name, number in self._numbered.items():
            before, slash, _ = name.rpartition("/Y/")
            stamps = [one for one in self.columns if slash and one.startswith(f"{before}/X/")]
            if 1 <= number <= len(stamps):
                self.clocks[name] = stamps[number - 1]

    def _add_elements(self, elements: Sequence[Mapping[str, Any]], name: str) -> None:
        if len(elements) == 1:
            self._add_struct(elements[0], name)
            return
        for number, one in enumerate(elements, 1):
            self._add_struct(one, f"{name}/{_text(one, LABELS) or number}", labelled=True)

    def _add_struct(self, fields: Mapping[str, Any], name: str, *, labelled: bool = False) -> None:
        by_word = {key.lower(): key for key in fields}
        flat = dict(_leaves(fields, ""))
        numbers = [key for key, leaf in flat.items() if _last(key) in NUMBERS and _is_numeric(leaf)]
        label = _text(fields, LABELS)
        if len(numbers) != 1 or not (label or labelled):
            texts = [_listed_texts(value) for value in fields.values()]
            for key, value in fields.items():
                own, before = f"{name}/{key}" if name else key, {*self.columns}
                self.add(value, own)
                added = [column for column in self.columns if column not in before]
                called, said = titled(own, added, texts)
                self.titles, self.units = self.titles | called, self.units | said
            return
        for key in filter(tells_rate, fields):
            self.add(fields[key], f"{name}/{key}")
        own = name if labelled else f"{name}/{label}"
        own = f"{own}/{sum(one.startswith(own) for one in self.columns) + 1}" if own in self.columns else own
        added = self._add_array(np.asarray(flat[numbers[0]]), own)
        unit = next((_text({"unit": leaf}, _UNITS) for key, leaf in flat.items() if _last(key) in _UNITS), "")
        self.units |= dict.fromkeys(added, unit) if unit else {}
        stamps = [key for key, leaf in flat.items() if _last(key) in _STAMPS and _is_numeric(leaf)]
        if stamps and np.size(flat[stamps[0]]) > 1:
            clock = f"{own}/time"
            self.columns[clock] = np.ravel(flat[stamps[0]])
            self.clocks |= dict.fromkeys(added, clock)
        elif _CLOCK_NUMBER in by_word:
            number = np.ravel(fields[by_word[_CLOCK_NUMBER]])
            self._numbered |= dict.fromkeys(added, int(number[0]) if number.size else 0)

    def _add_array(self, array: ColumnValues, name: str) -> list[str]:
        found = split_columns(name, array)
        self.columns |= found
        return list(found)


def _fields(element: Any) -> dict[str, Any]:
    return {key: element[key] for key in element.dtype.names}


def _leaves(fields: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    """Yield the fields of a struct, and of structs of one element within it, by their paths."""
    for key, value in fields.items():
        array = np.atleast_1d(value)
        if array.dtype.names and array.size == 1:
            yield from _leaves(_fields(array.ravel()[0]), f"{prefix}{key}/")
        else:
            yield f"{prefix}{key}", value


def _last(path: str) -> str:
    return path.rpartition("/")[2].lower()


def _is_numeric(value: Any) -> bool:
    return np.atleast_1d(value).dtype.kind in "fiub" and np.size(value) > 0


def _text(fields: Mapping[str, Any], words: Sequence[str]) -> str:
    """Return the first text that stands under one of the words."""
    by_word = {key.lower(): value for key, value in fields.items()}
    for word in words:
        value = by_word.get(word)
        array = np.atleast_1d(value) if value is not None else np.empty(0)
        if array.dtype.kind in "US" and array.size == 1 and str(array.ravel()[0]).strip():
            return str(array.ravel()[0]).strip()
    return ""
