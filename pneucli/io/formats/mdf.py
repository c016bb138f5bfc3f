"""MDF4: channels by name; only groups that hold a wanted channel are read, each with its own clock.

Conversions by formula and by ranges of integers are evaluated here: asammdf 8 leaves raw numbers where it cannot
evaluate a formula, and misses every range of integers.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.errors import InputError
from pneucli.imports import library_of_extra
from pneucli.io.clock import known_start
from pneucli.io.column_reader import ColumnReader
from pneucli.io.expression import Expression
from pneucli.io.formats.base import Format
from pneucli.io.packed import check_expanded_size
from pneucli.io.raw_file import ColumnValues

_NO_SYNC, _TIME = 0, 1  # of a channel's synchronisation type (ASAM MDF 4, block CN)
_Where = tuple[int, int]  # group, channel
_FORMULA, _RANGES, _TEXTS = 3, 6, 7  # types of conversion; those from the last one on give texts, or take them
_STRINGS = range(6, 10)  # types of data of a channel


def open_mdf(path: Path) -> ColumnReader:
    """List the channels; the name of any group's master stands for the clock of the group that it is read with."""
    with _opened(path) as file:
        masters = {(group, file.masters_db[group]) for group in file.masters_db if _has_clock(file, group)}
        found = [(name, where) for name, places in file.channels_db.items() for where in places]
        channels = [(name, where) for name, where in found if where not in masters and _is_signal(file, where)]
        often = Counter(name for name, _ in channels)
        places = {name if often[name] == 1 else f"{where[0]}/{name}": where for name, where in channels}
        shared = sorted({name for name, where in found if where in masters} - places.keys())
        units = {name: _unit(file.groups[g].channels[c]) for name, (g, c) in places.items()}
        texts = [name for name, where in places.items() if _holds_text(file, where)]
        timed = {name: group for name, (group, _) in places.items() if _has_clock(file, group)}
        start = known_start(file.header.start_time)
    groups = {f"clock of group {group}": group for group in sorted(set(timed.values()))}
    clocks = {name: f"clock of group {group}" for name, group in timed.items()}

    def fetch(wanted: Sequence[str]) -> list[ColumnValues]:
        with _opened(path) as file:
            group = _group(path, file, wanted, {name: where[0] for name, where in places.items()} | groups)
            is_timed = not places.keys() >= set(wanted)
            if is_timed and not _has_clock(file, group):
                where, mend = f'{path}, channel "{wanted[0]}"', "name a channel of stamps as time"
                raise InputError(where, "its group has no clock", "a master channel", mend, code="E045")
            counts = file.groups[group].channel_group
            check_expanded_size(path, counts.cycles_nr * max(counts.samples_byte_nr, 8))
            time = np.asarray(file.get_master(group), dtype=np.float64) if is_timed else np.empty(0)
            return [_recorded(path, file, name, places[name]) if name in places else time for name in wanted]

    names, own = [*places, *shared, *groups], {"own_clocks": clocks, "shared_clocks": shared, "texts": texts}
    return ColumnReader(path, MDF.name, names, fetch, units, start=start, **own)  # type: ignore[arg-type]


def _opened(path: Path) -> closing[Any]:
    return closing(library_of_extra("asammdf", "mdf", path).MDF(path))


def _group(path: Path, file: Any, names: Sequence[str], groups: Mapping[str, int]) -> int:
    """Return the group of the columns; the longest one where only the clock is wanted."""
    found = {groups[name] for name in names if name in groups}
    if len(found) > 1:
        listed = ", ".join(f'"{name}"' for name in names[:10])
        mend = "read each as a signal of its own, not in one expression"
        raise InputError(str(path), f"{listed} are of several groups", "columns of one clock", mend, code="E042")
    timed = [group for group in file.masters_db if _has_clock(file, group)]
    return found.pop() if found else int(max(timed, key=lambda one: file.groups[one].channel_group.cycles_nr))


def _has_clock(file: Any, group: int) -> bool:
    """Return whether a group has a master, its own or another's, that counts time, not angle, distance or index."""
    remote = getattr(file.groups[group].channel_group, "cg_master_index", None)  # MDF 3 has none
    owner = group if remote is None else remote
    if owner not in file.masters_db:
        return False
    master = file.groups[owner].channels[file.masters_db[owner]]
    return getattr(master, "sync_type", _TIME) in (_NO_SYNC, _TIME)  # MDF 3 knows time alone


def _recorded(path: Path, file: Any, name: str, where: _Where) -> ColumnValues:
    """Return the physical values of a channel, NaN where invalid; raises InputError where a formula is not known."""
    conversion = file.groups[where[0]].channels[where[1]].conversion
    kind = getattr(conversion, "conversion_type", None) if getattr(conversion, "id", b"##CC") == b"##CC" else None
    own = kind in (_FORMULA, _RANGES)
    signal = file.get(group=where[0], index=where[1], ignore_invalidation_bits=True, raw=own)
    values = np.asarray(signal.samples)
    if kind == _FORMULA:
        try:
            values = _by_formula(str(conversion.formula), values.astype(np.float64))
        except ValueError as error:
            channel = f'{path}, channel "{name}"'
            mend = "export the numbers, or leave it out"
            raise InputError(channel, str(error), "numbers", mend, code="E043") from error
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
    open_mdf,
    magic=(b"MDF ",),
    column="a channel; `group/channel` where names repeat; groups with clocks of their own are joined",
    extra="mdf",
    used="conversions, formulas and ranges included; texts are labels; invalid samples are missing; masters of angle, "
    "distance and index are channels, no clocks",
    unused="flags of channels; formulas of several channels are refused",
)
