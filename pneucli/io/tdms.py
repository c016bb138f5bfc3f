"""NI TDMS: ``group/channel``; a channel's values are read only if it is wanted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from pneucli.io.column_reader import ColumnReader, import_extra, to_vector
from pneucli.io.damaged_files import check_expanded_size
from pneucli.io.raw_file import ColumnValues

NAME = "TDMS"


def open_tdms(path: Path) -> ColumnReader:
    """List the channels; a waveform's own clock is called ``time`` where no channel is."""
    tdms = import_extra("nptdms", "tdms", path).TdmsFile
    with tdms.open(path) as file:
        columns = _columns(file)
        units = [str(channel.properties.get("unit_string") or "") for channel, _ in columns.values()]
        said = {number: unit for number, unit in enumerate(units) if unit and [*columns][number] != "time"}

    def fetch(wanted: Sequence[str]) -> list[ColumnValues]:
        with tdms.open(path) as file:
            columns = _columns(file)
            check_expanded_size(path, sum(8 * len(channel) for name, (channel, _) in columns.items() if name in wanted))
            return [to_vector(columns[name][1]()) for name in wanted]

    return ColumnReader(path, NAME, list(columns), fetch, said)


def _columns(file: Any) -> dict[str, tuple[Any, Callable[[], Any]]]:
    channels = {f"{c.group_name}/{c.name}": c for group in file.groups() for c in group.channels()}
    columns: dict[str, tuple[Any, Callable[[], Any]]] = {name: (c, c.read_data) for name, c in channels.items()}
    clocked = [channel for channel in channels.values() if "wf_increment" in channel.properties]
    if clocked and not any(name.rsplit("/", 1)[-1] == "time" for name in columns):
        columns["time"] = (clocked[0], clocked[0].time_track)
    return columns
