"""MDF4: channels by name; only groups that hold a wanted channel are read, each with its own clock.

Conversions by formula and by ranges of integers are evaluated here: asammdf 8 leaves raw numbers where it cannot
evaluate a formula, and misses every range of integers.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.errors import InputError
from pneucli.io.clock import known_start
from pneucli.io.column_reader import as_text, column_values, import_extra, words_message
from pneucli.io.damaged_files import check_expanded_size, library_errors_as_input_errors
from pneucli.io.expression import Expression
from pneucli.io.formats.base import Format
from pneucli.io.raw_file import ColumnRequest, ColumnValues, Repair

_NO_SYNC, _TIME = 0, 1  # of a channel's synchronisation type (ASAM MDF 4, block CN)
_Where = tuple[int, int]  # group, channel
_FORMULA, _RANGES, _TEXTS = 3, 6, 7  # types of conversion; those from the last one on give texts, or take them
_STRINGS = range(6, 10)  # types of data of a channel


class MdfReader:
    """An MDF file; the name of any group's master stands for the clock of the group that it is read with."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._mdf = import_extra("asammdf", "mdf", path).MDF
        self.repairs: list[Repair] = []
        self.rows = 0
        self.losses: Counter[str] = Counter()
        with self._open() as file:
            self.start: datetime | None = known_start(file.header.start_time)
            masters = {(group, file.masters_db[group]) for group in file.masters_db if _has_clock(file, group)}
            found = [(name, where) for name, places in file.channels_db.items() for where in places]
            channels = [(name, where) for name, where in found if where not in masters and _is_signal(file, where)]
            clocks = {name for name, where in found if where in masters}
            often = Counter(name for name, _ in channels)
            self._where = {name if often[name] == 1 else f"{where[0]}/{name}": where for name, where in channels}
            units = {name: _unit(file.groups[g].channels[c]) for name, (g, c) in self._where.items()}
            groups = {g for g, _ in self._where.values() if _has_clock(file, g)}
            texts = [name for name, place in self._where.items() if _holds_text(file, place)]
        self._clock_groups = {f"clock of group {group}": group for group in sorted(groups)}
        shared = sorted(clocks - self._where.keys())
        self.names: Sequence[str] = [*self._where, *shared, *self._clock_groups]
        self.units = {number: units[name] for number, name in enumerate(self._where) if units[name]}
        self.labels = frozenset(number for number, name in enumerate(self._where) if name in texts)
        self.clock_names = frozenset(range(len(self._where), len(self._where) + len(shared)))
        place = {group: len(self._where) + len(shared) + n for n, group in enumerate(self._clock_groups.values())}
        places = enumerate(self._where.values())
        self.clocks: Mapping[int, int] = {n: place[group] for n, (group, _) in places if group in place}

    def batches(self, requests: Sequence[ColumnRequest]) -> Iterator[list[ColumnValues]]:
        """Yield all rows of one group at once; raises InputError where the columns are of several."""
        names = [self.names[request.position] for request in requests]
        with library_errors_as_input_errors(self._path, MDF.name, self.repairs), self._open() as file:
            group = self._group(file, names)
            is_timed = not self._where.keys() >= set(names)
            if is_timed:
                self._check_clock(file, group, names)
            counts = file.groups[group].channel_group
            check_expanded_size(self._path, counts.cycles_nr * max(counts.samples_byte_nr, 8))
            time = np.asarray(file.get_master(group), dtype=np.float64) if is_timed else np.empty(0)
            columns = {
                name: self._values(file, name, text=request.text)
                for name, request in zip(names, requests, strict=True)
                if name in self._where
            }
        size = time.size if is_timed else next(iter(columns.values())).size
        for name, values in columns.items():
            if values.size != size:
                where, found = f'{self._path}, channel "{name}"', f"{values.size} values over {size} stamps"
                raise InputError(where, found, "a value a stamp", "export it again", code="E045")
        self.rows += size
        yield [columns.get(name, time) for name in names]

    def _values(self, file: Any, name: str, *, text: bool) -> ColumnValues:
        """Return a channel's values, or its texts; NaN where the file itself marks them invalid, or a word stands."""
        try:
            found = _recorded(file, self._where[name])
            if text:
                return np.array([as_text(value) for value in found], dtype=object)
            values, _, words = column_values(found)
        except ValueError as error:
            where = f'{self._path}, channel "{name}"'
            raise InputError(
                where, str(error), "numbers", "export the numbers, or leave it out", code="E043"
            ) from error
        if words:
            self.repairs.append(Repair("", "words", sum(words.values()), words_message(name, words)))
        return values

    def locate(self, row: int) -> str:
        """Return file and record (from 1)."""
        return f"{self._path}, record {row + 1}"

    @contextmanager
    def _open(self) -> Iterator[Any]:
        file = self._mdf(self._path)
        try:
            yield file
        finally:
            file.close()

    def _group(self, file: Any, names: Sequence[str]) -> int:
        """Return the group of the columns; the longest one where only the clock is wanted."""
        groups = {self._where[name][0] for name in names if name in self._where}
        groups |= {self._clock_groups[name] for name in names if name in self._clock_groups}
        if len(groups) > 1:
            listed = ", ".join(f'"{name}"' for name in names[:10])
            mend = "read each as a signal of its own, not in one expression"
            raise InputError(
                str(self._path), f"{listed} are of several groups", "columns of one clock", mend, code="E042"
            )
        if groups:
            return int(groups.pop())
        timed = [group for group in file.masters_db if _has_clock(file, group)]
        return int(max(timed, key=lambda group: file.groups[group].channel_group.cycles_nr))

    def _check_clock(self, file: Any, group: int, names: Sequence[str]) -> None:
        if not _has_clock(file, group):
            where = f'{self._path}, channel "{names[0]}"'
            raise InputError(
                where, "its group has no clock", "a master channel", "name a channel of stamps as time", code="E045"
            )


def _has_clock(file: Any, group: int) -> bool:
    """Return whether a group has a master, its own or another's, that counts time, not angle, distance or index."""
    remote = getattr(file.groups[group].channel_group, "cg_master_index", None)  # MDF 3 has none
    owner = group if remote is None else remote
    if owner not in file.masters_db:
        return False
    master = file.groups[owner].channels[file.masters_db[owner]]
    return getattr(master, "sync_type", _TIME) in (_NO_SYNC, _TIME)  # MDF 3 knows time alone


def _recorded(file: Any, where: _Where) -> ColumnValues:
    """Return the physical values of a channel, NaN where invalid; raises ValueError where a formula is not known."""
    conversion = file.groups[where[0]].channels[where[1]].conversion
    kind = getattr(conversion, "conversion_type", None) if getattr(conversion, "id", b"##CC") == b"##CC" else None
    own = kind in (_FORMULA, _RANGES)
    signal = file.get(group=where[0], index=where[1], ignore_invalidation_bits=True, raw=own)
    values = np.asarray(signal.samples)
    if kind == _FORMULA:
        values = _by_formula(str(conversion.formula), values.astype(np.float64))
    elif kind == _RANGES:
        values = _by_ranges(conversion, values)
    if signal.invalidation_bits is not None:
        values = values.astype(np.float64) if values.dtype.kind in "fiub" else values.astype(object)
        values[np.asarray(signal.invalidation_bits, dtype=np.bool_)] = np.nan if values.dtype.kind == "f" else ""
    return values


def _by_formula(formula: str, raw: ColumnValues) -> ColumnValues:
    """Return the values of an algebraic conversion of ASAM MDF 4, block CC, type 3, in which X is the raw value."""
    expression = Expression(formula.replace("X1", "X").replace("x1", "X"))
    names = {str(name) for name in expression.columns}
    if not names <= {"X", "x"}:
        raise ValueError(f'its conversion "{formula}" is no formula over X')
    expression.check()
    return expression.values(dict.fromkeys(expression.columns, raw))


def _by_ranges(conversion: Any, raw: ColumnValues) -> ColumnValues:
    """Return the values of a conversion by ranges: the upper end of one belongs to it for integers alone."""
    values = np.full(raw.size, float(conversion.default))
    for number in range((conversion.val_param_nr - 1) // 3 - 1, -1, -1):  # the first that holds counts
        low, high = getattr(conversion, f"lower_{number}"), getattr(conversion, f"upper_{number}")
        inside = (raw >= low) & ((raw <= high) if raw.dtype.kind in "iu" else (raw < high))
        values[inside] = getattr(conversion, f"phys_{number}")
    return values


def _holds_text(file: Any, where: _Where) -> bool:
    """Return whether a channel holds texts, or its conversion gives texts."""
    channel = file.groups[where[0]].channels[where[1]]
    kind = getattr(channel.conversion, "conversion_type", 0) if channel.conversion is not None else 0
    is_new = getattr(channel.conversion, "id", b"##CC") == b"##CC"
    return bool(is_new and kind >= _TEXTS) or channel.data_type in _STRINGS


def _unit(channel: Any) -> str:
    """Return a channel's unit: its own, else that of its conversion, where MDF 3 and some MDF 4 have it alone."""
    return str(getattr(channel, "unit", "") or getattr(channel.conversion, "unit", "") or "")


def _is_signal(file: Any, where: _Where) -> bool:
    return not str(file.groups[where[0]].channels[where[1]].name).startswith("CAN_")


MDF = Format(
    "MDF4",
    "MDF4",
    MdfReader,
    magic=(b"MDF ",),
    column="a channel; `group/channel` where names repeat; groups with clocks of their own are joined",
    extra="mdf",
    used="conversions, formulas and ranges included; texts are labels; invalid samples are missing; masters of angle, "
    "distance and index are channels, no clocks",
    unused="flags of channels; formulas of several channels are refused",
)
