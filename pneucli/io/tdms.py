"""NI TDMS: ``group/channel``; a channel's values are read only if it is wanted, with the clock of its waveform."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.errors import UnitError
from pneucli.io.column_reader import ColumnReader, clocks_by_group, import_extra, to_vector
from pneucli.io.damaged_files import check_expanded_size
from pneucli.io.raw_file import ColumnValues
from pneucli.units import parse_unit, same_dimension

NAME = "TDMS"
CLOCK = "time"  # stands for the waveform's own clock, where no channel is called so
_Columns = dict[str, Callable[[], Any]]


def open_tdms(path: Path) -> ColumnReader:
    """List the channels; waveforms whose start times, increments or lengths differ have a clock each."""
    tdms = import_extra("nptdms", "tdms", path).TdmsFile
    with tdms.open(path) as file:
        channels = _channels(file)
        columns, clocks = _columns(channels)
        units = {name: str(channel.properties.get("unit_string") or "") for name, channel in channels.items()}
        sizes = {name: len(channel) for name, channel in channels.items()}
    names = list(columns)
    file_units = {
        number: units.get(name) or "s" for number, name in enumerate(names) if units.get(name) or name not in units
    }
    clocks = clocks or clocks_by_group(list(channels), sizes)

    def fetch(wanted: Sequence[str]) -> list[ColumnValues]:
        with tdms.open(path) as file:
            channels = _channels(file)
            check_expanded_size(path, sum(8 * len(channel) for name, channel in channels.items() if name in wanted))
            columns = _columns(channels)[0]
            return [to_vector(columns[name]()) for name in wanted]

    return ColumnReader(path, NAME, names, fetch, file_units, own_clocks=clocks, shared_clock=CLOCK if clocks else None)


def _channels(file: Any) -> dict[str, Any]:
    return {f"{c.group_name}/{c.name}": c for group in file.groups() for c in group.channels()}


def _columns(channels: Mapping[str, Any]) -> tuple[_Columns, dict[str, str]]:
    """Return what reads each column, the clocks of waveforms among them, and the clock of each channel by name."""
    columns: _Columns = {name: channel.read_data for name, channel in channels.items()}
    clocked = {name: channel for name, channel in channels.items() if _x_unit(channel)}
    if not clocked or any(name.rsplit("/", 1)[-1] == CLOCK for name in columns):
        return columns, {}
    timings = {name: _timing(channel) for name, channel in clocked.items()}
    first = min((start for start, _, _, _ in timings.values() if start is not None), default=None)
    columns[CLOCK] = _clock(*max(timings.values(), key=lambda timing: timing[3]), first)
    if len(set(timings.values())) == 1:
        return columns, {}
    columns |= {f"{name}/{CLOCK}": _clock(*timing, first) for name, timing in timings.items()}
    return columns, {name: f"{name}/{CLOCK}" for name in timings}


def _x_unit(channel: Any) -> float:
    """Return what 1 on a waveform's x axis is in s; 0 where the channel is no waveform over time (over a frequency)."""
    if not channel.properties.get("wf_increment"):
        return 0.0
    text = str(channel.properties.get("wf_xunit_string") or "s")
    try:
        unit = parse_unit(text)
    except UnitError:
        return 0.0
    return unit.factor if same_dimension(text, "s") else 0.0


def _timing(channel: Any) -> tuple[Any, float, float, int]:
    """Return start, offset and increment in s, and the number of samples of a waveform."""
    start = channel.properties.get("wf_start_time")
    unit = _x_unit(channel)
    numbers = (unit * float(channel.properties.get(key) or 0.0) for key in ("wf_start_offset", "wf_increment"))
    return (None if start is None else np.datetime64(start, "ns"), *numbers, len(channel))  # type: ignore[return-value]


def _clock(start: Any, offset: float, increment: float, count: int, first: Any) -> Callable[[], ColumnValues]:
    after = 0.0 if start is None or first is None else float((start - first) / np.timedelta64(1, "s"))
    return lambda: after + offset + increment * np.arange(count)
