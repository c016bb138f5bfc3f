"""MDF4: channels by name; only groups that hold a wanted channel are read, and those of several clocks are joined."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.errors import InputError
from pneucli.io.column_reader import import_extra, to_vector
from pneucli.io.damaged_files import check_expanded_size, library_errors_as_input_errors
from pneucli.io.raw_file import ColumnRequest, ColumnValues, Repair
from pneucli.io.timestamp_order import Table, join_tables

NAME = "MDF4"
_Where = tuple[int, int]  # group, channel


class MdfReader:
    """An MDF file; the name of any group's master stands for the clock of every group."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._mdf = import_extra("asammdf", "mdf", path).MDF
        self.repairs: list[Repair] = []
        self.rows = 0
        self.losses: Counter[str] = Counter()
        with self._open() as file:
            masters = set(file.masters_db.items())
            found = [(name, where) for name, places in file.channels_db.items() for where in places]
            channels = [(name, where) for name, where in found if where not in masters and _is_signal(file, where)]
            self._clocks = {name for name, where in found if where in masters}
            often = Counter(name for name, _ in channels)
            self._where = {name if often[name] == 1 else f"{where[0]}/{name}": where for name, where in channels}
            units = {name: str(file.groups[g].channels[c].unit or "") for name, (g, c) in self._where.items()}
        self.names: Sequence[str] = [*self._where, *sorted(self._clocks - self._where.keys())]
        self.units = {number: units[name] for number, name in enumerate(self._where) if units[name]}
        self.start: datetime | None = None

    def batches(self, asks: Sequence[ColumnRequest]) -> Iterator[list[ColumnValues]]:
        """Yield all rows at once, NaN where a group has no record at another one's stamp."""
        names = [self.names[ask.position] for ask in asks]
        with library_errors_as_input_errors(self._path, NAME, self.repairs), self._open() as file:
            groups = self._groups(file, [name for name in names if name in self._where])
            if not self._where.keys() >= set(names):
                self._check_clocks(file, groups)
            tables = self._tables(file, groups)
        table, self.losses = join_tables(tables, lambda row: self._place(tables, row))
        self.rows = sum(one.time.size for one in tables)
        yield [table.columns.get(name, table.time) for name in names]

    def locate(self, row: int) -> str:
        """Return file and record (from 1)."""
        return f"{self._path}, record {row + 1}"

    def _place(self, tables: Sequence[Table], row: int) -> str:
        inside = next(row - int(one.rows[0]) for one in tables if one.rows.size and row <= one.rows[-1])
        return self.locate(inside)

    @contextmanager
    def _open(self) -> Iterator[Any]:
        file = self._mdf(self._path)
        try:
            yield file
        finally:
            file.close()

    def _groups(self, file: Any, names: Sequence[str]) -> dict[int, list[str]]:
        """Return the channels to read by group; the longest group where only the clock is wanted."""
        groups: dict[int, list[str]] = {}
        for name in names:
            groups.setdefault(self._where[name][0], []).append(name)
        return groups or {max(file.masters_db, key=lambda group: file.groups[group].channel_group.cycles_nr): []}

    def _check_clocks(self, file: Any, groups: Mapping[int, list[str]]) -> None:
        for group, names in groups.items():
            if group not in file.masters_db and file.groups[group].channel_group.cg_master_index is None:
                where = f'{self._path}, channel "{names[0]}"'
                raise InputError(
                    where, "its group has no clock", "a master channel", "name a channel of stamps as time"
                )

    def _tables(self, file: Any, groups: Mapping[int, list[str]]) -> list[Table]:
        sizes = [file.groups[group].channel_group for group in groups]
        check_expanded_size(self._path, sum(one.cycles_nr * max(one.samples_byte_nr, 8) for one in sizes))
        tables, first = [], 0
        for group, names in groups.items():
            time = to_vector(file.get_master(group))
            columns = {name: _values(file, self._where[name]) for name in names}
            for name, values in columns.items():
                if values.size != time.size:
                    where, found = f'{self._path}, channel "{name}"', f"{values.size} values over {time.size} stamps"
                    raise InputError(where, found, "a value a stamp", "export it again")
            tables.append(Table(time, columns, np.arange(first, first + time.size)))
            first += time.size
        return tables


def _values(file: Any, where: _Where) -> ColumnValues:
    """Return a channel's values as they are recorded, NaN where the file itself marks them invalid."""
    signal = file.get(group=where[0], index=where[1], ignore_invalidation_bits=True)
    values = to_vector(signal.samples)
    if signal.invalidation_bits is not None:
        values[np.asarray(signal.invalidation_bits, dtype=np.bool_)] = np.nan
    return values


def _is_signal(file: Any, where: _Where) -> bool:
    return not str(file.groups[where[0]].channels[where[1]].name).startswith("CAN_")
