"""NI TDMS: ``group/channel``; a channel's values are read only if it is wanted, with the clock of its waveform.

A file that was appended to states start and increment anew, in a later segment: each such piece of a waveform has its
own. nptdms 1.10 keeps the last statement alone, so the pieces are noted while it reads the segments.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pneucli.errors import InputError, UnitError
from pneucli.imports import library_of_extra
from pneucli.io.clock import known_start
from pneucli.io.column_reader import ColumnReader, clocks_by_group
from pneucli.io.formats.base import Format
from pneucli.io.packed import check_expanded_size
from pneucli.io.raw_file import ColumnValues
from pneucli.units import parse_unit, same_dimension

CLOCK = "time"  # stands for the waveform's own clock, where no channel is called so
_SCALE_TYPE = re.compile(r"NI_Scale\[\d+\]_Scale_Type")
_SCALES = (  # types of scale that nptdms applies; it leaves the numbers of others as they are
    *("Linear", "Polynomial", "Table", "RTD", "Thermocouple", "Thermistor", "Strain", "Add", "Subtract", "AdvancedAPI"),
)
_START, _STEP, _OFFSET, _UNIT = "wf_start_time", "wf_increment", "wf_start_offset", "wf_xunit_string"
_Columns = dict[str, Callable[[], Any]]


class _Piece(NamedTuple):
    """A stretch of a waveform: how many samples stand before it, its start, offset and increment (s)."""

    first: int
    start: Any
    offset: float
    step: float


class _Timing(NamedTuple):
    """The clock of a waveform: its pieces, and the number of its samples."""

    pieces: tuple[_Piece, ...]
    samples: int


def open_tdms(path: Path) -> ColumnReader:
    """List the channels; waveforms whose start times, increments or lengths differ have a clock each."""
    tdms = library_of_extra("nptdms", "tdms", path).TdmsFile
    stated = _stated_by_segment(path)
    with tdms.open(path) as file:
        channels = _channels(file)
        columns, clocks, start = _columns(channels, stated)
        units = {name: str(channel.properties.get("unit_string") or "") for name, channel in channels.items()}
        sizes = {name: len(channel) for name, channel in channels.items()}
    names = list(columns)
    units |= dict.fromkeys((name for name in names if name not in units), "s")
    clocks = clocks or clocks_by_group(list(channels), sizes)

    def fetch(wanted: Sequence[str]) -> list[ColumnValues]:
        with tdms.open(path) as file:
            channels = _channels(file)
            check_expanded_size(path, sum(8 * len(channel) for name, channel in channels.items() if name in wanted))
            columns = _columns(channels, stated)[0]
            for name in wanted:
                _check_scales(path, name, channels.get(name))
            return [np.ravel(columns[name]()) for name in wanted]

    shared = (CLOCK,) * bool(clocks)
    return ColumnReader(path, TDMS.name, names, fetch, units, start=start, own_clocks=clocks, shared_clocks=shared)


def _check_scales(path: Path, name: str, channel: Any) -> None:
    properties = {} if channel is None else channel.properties
    for key, kind in properties.items():
        if _SCALE_TYPE.fullmatch(key) and kind not in _SCALES and properties.get("NI_Scaling_Status") != "scaled":
            where, found = f'{path}, channel "{name}"', f'a scale of the type "{kind}", which is not known'
            mend = "export the scaled values, or leave the channel out"
            raise InputError(where, found, "a linear scale, a polynomial or a table", mend, code="E044")


def _stated_by_segment(path: Path) -> dict[str, list[tuple[int, dict[str, Any]]]]:
    """Return, by the path of a channel, what segments state of its clock, after how many samples."""
    reader_class: Any = library_of_extra("nptdms.reader", "tdms", path).TdmsReader
    found: dict[str, list[tuple[int, dict[str, Any]]]] = {}
    counts: dict[str, int] = {}

    class Noting(reader_class):  # type: ignore[misc]
        def _update_object_properties(self, properties: Mapping[str, Any] | None) -> None:
            super()._update_object_properties(properties)
            for channel, own in (properties or {}).items():
                clock = {key: value for key, value in own if key in (_START, _STEP, _OFFSET, _UNIT)}
                if clock:
                    found.setdefault(channel, []).append((counts.get(channel, 0), clock))
            counts.update({channel: int(one.num_values) for channel, one in self.object_metadata.items()})

    reader = Noting(str(path))
    try:
        reader.read_metadata()
    finally:
        reader.close()
    return found


def _channels(file: Any) -> dict[str, Any]:
    return {f"{c.group_name}/{c.name}": c for group in file.groups() for c in group.channels()}


def _columns(
    channels: Mapping[str, Any], stated: Mapping[str, Sequence[tuple[int, dict[str, Any]]]]
) -> tuple[_Columns, dict[str, str], datetime | None]:
    """Return what reads each column, clocks of waveforms among them, the clock of each channel, and when it reads 0."""
    columns: _Columns = {name: channel.read_data for name, channel in channels.items()}
    clocked = {name: channel for name, channel in channels.items() if _x_unit(channel)}
    if not clocked or any(name.rsplit("/", 1)[-1] == CLOCK for name in columns):
        return columns, {}, None
    timings = {name: _timing(channel, stated.get(channel.path, ())) for name, channel in clocked.items()}
    starts = [piece.start for timing in timings.values() for piece in timing.pieces if piece.start is not None]
    first = min(starts, default=None)
    start = None if first is None else known_start(first.astype("datetime64[us]").item().replace(tzinfo=UTC))
    columns[CLOCK] = _clock(max(timings.values(), key=lambda timing: timing.samples), first)
    if len(set(timings.values())) == 1:
        return columns, {}, start
    columns |= {f"{name}/{CLOCK}": _clock(timing, first) for name, timing in timings.items()}
    return columns, {name: f"{name}/{CLOCK}" for name in timings}, start


def _x_unit(channel: Any) -> float:
    """Return what 1 on a waveform's x axis is in s; 0 where the channel is no waveform over time (over a frequency)."""
    if not channel.properties.get(_STEP):
        return 0.0
    text = str(channel.properties.get(_UNIT) or "s")
    try:
        unit = parse_unit(text)
    except UnitError:
        return 0.0
    return unit.factor if same_dimension(text, "s") else 0.0


def _timing(channel: Any, stated: Sequence[tuple[int, dict[str, Any]]]) -> _Timing:
    """Return the pieces of a waveform's clock; what a later segment does not state stays as it was."""
    unit, known = _x_unit(channel), dict[str, Any]()
    pieces: list[_Piece] = []
    for first, own in stated or [(0, channel.properties)]:
        known |= own
        start: Any = known.get(_START)
        start = start.as_datetime64("ns") if hasattr(start, "as_datetime64") else start
        offset, step = (unit * float(known.get(key) or 0.0) for key in (_OFFSET, _STEP))
        piece = _Piece(first, None if start is None else np.datetime64(start, "ns"), offset, step)
        if pieces and piece[1:] == pieces[-1][1:]:
            continue
        pieces = [one for one in pieces if one.first < first]
        pieces.append(piece)
    return _Timing(tuple(pieces), len(channel))


def _clock(timing: _Timing, first: Any) -> Callable[[], ColumnValues]:
    def stamps() -> ColumnValues:
        ends = [*(piece.first for piece in timing.pieces[1:]), timing.samples]
        return np.concatenate([_stamps(piece, end, first) for piece, end in zip(timing.pieces, ends, strict=True)])

    return stamps


def _stamps(piece: _Piece, end: int, first: Any) -> ColumnValues:
    after = 0.0 if piece.start is None or first is None else float((piece.start - first) / np.timedelta64(1, "s"))
    return np.asarray(after + piece.offset + piece.step * np.arange(end - piece.first))


TDMS = Format(
    "TDMS",
    "NI TDMS",
    open_tdms,
    magic=(b"TDSm",),
    column="`group/channel`; a waveform's own clock is `time` where no channel has that name",
    extra="tdms",
    used="scales (unknown ones are refused), unit, start and increment of each run that was appended",
    unused="a waveform over Hz or mm has no clock",
)
