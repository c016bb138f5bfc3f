"""Logs of robots: MCAP and rosbag2; the numbers of each topic on the topic's own clock.

The clock is the header's stamp where messages have one, else when a message was logged.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.errors import InputError
from pneucli.imports import library_of_extra
from pneucli.io.clock import known_start
from pneucli.io.column_reader import ColumnReader
from pneucli.io.formats.base import Format
from pneucli.io.raw_file import ColumnValues

EXTRA = "mcap"
SCHEMA_BYTES = 1 << 16  # of a database of SQLite, in whose first pages its tables are defined
MAX_ARRAY = 64  # numbers of one message that become columns: more are pictures and clouds of points
_UNITS = {  # by type of message and field, as their definitions say
    ("FluidPressure", "fluid_pressure"): "Pa",
    ("Temperature", "temperature"): "degC",
    ("Range", "range"): "m",
}
_Row = tuple[int, int | None, dict[str, float]]  # when it was logged, its own stamp in ns, and numbers by field
_STORES = ("LATEST", "ROS2_JAZZY", "ROS2_IRON", "ROS2_HUMBLE", "ROS2_GALACTIC", "ROS2_FOXY")  # definitions of messages


def open_mcap(path: Path) -> ColumnReader:
    """Read an MCAP file: messages of ROS 2, and JSON."""
    found = "this is an MCAP file, and mcap"
    reader_module = library_of_extra("mcap.reader", EXTRA, path, found)
    decoders = [library_of_extra("mcap_ros2.decoder", EXTRA, path, found).DecoderFactory(), _Json()]
    topics: dict[str, list[_Row]] = {}
    types: dict[str, str] = {}
    with path.open("rb") as file:
        reader = reader_module.make_reader(file, decoder_factories=decoders)
        _check_encodings(path, reader)
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            topics.setdefault(channel.topic, []).append(_row(decoded, message.log_time))
            types[channel.topic] = schema.name if schema is not None else ""
    return _reader(path, "MCAP", topics, types)


def open_rosbag2(path: Path) -> ColumnReader:
    """Read the database of a rosbag2; types that it does not define are those of ROS 2 itself."""
    if b"CREATE TABLE messages" not in path.read_bytes()[:SCHEMA_BYTES]:
        found = "this is a database of SQLite, and no rosbag2"
        raise InputError(str(path), found, "a file of recorded numbers", "export its table as CSV", code="E040")
    found = "this is a database of rosbag2, and rosbags"
    highlevel = library_of_extra("rosbags.highlevel", EXTRA, path, found)
    typesys = library_of_extra("rosbags.typesys", EXTRA, path, found)
    stores = [getattr(typesys.Stores, name) for name in _STORES if hasattr(typesys.Stores, name)]
    for number, store in enumerate(stores, 1):
        topics: dict[str, list[_Row]] = {}
        types: dict[str, str] = {}
        try:
            with highlevel.AnyReader([path], default_typestore=typesys.get_typestore(store)) as reader:
                for connection, stamp, raw in reader.messages():
                    decoded = reader.deserialize(raw, connection.msgtype)
                    topics.setdefault(connection.topic, []).append(_row(decoded, stamp))
                    types[connection.topic] = connection.msgtype
        except Exception:  # definitions of another release: messages end too early, or too late
            if number == len(stores):
                raise
        else:
            break
    return _reader(path, "rosbag2", topics, types)


class _Json:
    """Decodes messages of JSON, as ``mcap`` asks of a decoder."""

    def decoder_for(self, message_encoding: str, _schema: Any) -> Any:
        return json.loads if message_encoding == "json" else None


def _check_encodings(path: Path, reader: Any) -> None:
    summary = reader.get_summary()
    channels = [*summary.channels.values()] if summary is not None else []
    encodings = {channel.message_encoding for channel in channels}
    schemas = {summary.schemas[channel.schema_id].encoding for channel in channels if channel.message_encoding == "cdr"}
    encodings |= {f'cdr of "{one}"' for one in schemas - {"ros2msg", "ros2idl"}}
    if unread := sorted(encodings - {"cdr", "json"}):
        found = f"an MCAP file whose messages are in {', '.join(unread)}"
        raise InputError(
            str(path), found, "messages of ROS 2 (cdr) or JSON", "convert it, or export it as CSV", code="E044"
        )


def _reader(path: Path, name: str, topics: Mapping[str, list[_Row]], types: Mapping[str, str]) -> ColumnReader:
    columns: dict[str, ColumnValues] = {}
    clocks: dict[str, str] = {}
    units: dict[str, str] = {}
    stamped = {topic: _stamps(rows) for topic, rows in topics.items() if rows}
    first = min((stamps[0] for stamps in stamped.values()), default=0)
    for topic, rows in topics.items():
        fields = dict.fromkeys(field for *_, numbers in rows for field in numbers)
        if not fields:
            continue
        base = topic.strip("/")
        clock = f"{base}/time"
        columns[clock], units[clock] = 1e-9 * np.array([stamp - first for stamp in stamped[topic]]), "s"
        for field in fields:
            column = f"{base}/{field}"
            columns[column] = np.array([numbers.get(field, np.nan) for *_, numbers in rows])
            clocks[column] = clock
            units[column] = _UNITS.get((types.get(topic, "").rpartition("/")[2], field), "")
    return ColumnReader.of_columns(
        path, name, columns, units, clocks, known_start(datetime.fromtimestamp(1e-9 * first, UTC))
    )


def _stamps(rows: Sequence[_Row]) -> list[int]:
    """Return the stamps of a topic: its own, else when it was logged where none of its messages has a stamp but 0."""
    own = [stamp for _, stamp, _ in rows if stamp is not None]
    return own if len(own) == len(rows) and any(own) else [logged for logged, *_ in rows]


def _row(message: Any, logged: int) -> _Row:
    fields = dict(_fields(message))
    stamp = _stamp(fields.pop("header", None))
    numbers: dict[str, float] = {}
    for name, value in fields.items():
        numbers |= dict(_numbers(name, value, fields.get("name")))
    return logged, stamp, numbers


def _fields(message: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(message, Mapping):
        yield from message.items()
        return
    names = getattr(message, "__slots__", None) or vars(message)
    for name in names:
        if not name.startswith("_"):
            yield name, getattr(message, name)


def _stamp(header: Any) -> int | None:
    stamp = dict(_fields(header)).get("stamp") if header is not None else None
    if stamp is None:
        return None
    parts = dict(_fields(stamp))
    seconds, rest = (
        parts.get("sec", parts.get("secs", 0)),
        parts.get("nanosec", parts.get("nsec", parts.get("nsecs", 0))),
    )
    return int(seconds) * 10**9 + int(rest)


def _numbers(name: str, value: Any, labels: Any) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a field, at any depth; those of a list by the message's own names, if it has as many."""
    if isinstance(value, bool | int | float | np.number):
        yield name, float(value)
    elif isinstance(value, list | tuple | np.ndarray):
        if 0 < len(value) <= MAX_ARRAY:
            named = isinstance(labels, list) and len(labels) == len(value) and name != "name"
            for number, one in enumerate(value, 1):
                yield from _numbers(f"{name}/{labels[number - 1] if named else number}", one, None)
    elif not isinstance(value, str | bytes) and (isinstance(value, Mapping) or hasattr(value, "__slots__")):
        for inner, one in _fields(value):
            yield from _numbers(f"{name}/{inner}", one, None)


MCAP = Format(
    "MCAP",
    "MCAP (ROS 2, JSON)",
    open_mcap,
    magic=(b"\x89MCAP0\r\n",),
    column="`topic/field`",
    extra=EXTRA,
    used="the stamp of the header, a stamp of 0 s included; units of `FluidPressure`, `Temperature`, `Range`",
)
ROSBAG_2 = Format(
    "rosbag2",
    "rosbag2",
    open_rosbag2,
    magic=(b"SQLite format 3\x00",),
    column="`topic/field`",
    extra=EXTRA,
    used="as MCAP",
)
