"""MATLAB v5: variables are read one by one, and only those that hold a wanted column."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pneucli.errors import InputError
from pneucli.io.column_reader import ColumnReader, clocks_by_group, column_names
from pneucli.io.damaged_files import check_expanded_size
from pneucli.io.formats.base import Format
from pneucli.io.mat_elements import check_types, expanded_size
from pneucli.io.mat_struct import StructColumns
from pneucli.io.raw_file import ColumnValues, Repair

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

    names = list(owner)
    file_units = {names.index(name): unit for name, unit in units.items()}
    clocks = clocks or clocks_by_group(names, sizes)
    reader = ColumnReader(path, MATLAB.name, names, fetch, file_units, own_clocks=clocks)
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
