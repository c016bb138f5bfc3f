"""JSON: objects or lists, one a line (JSON lines) or listed, or lists by name; columns by their paths."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from pneucli.errors import InputError
from pneucli.io.column_reader import ColumnReader, is_label_column, stated_period
from pneucli.io.formats.base import Format
from pneucli.io.packed import check_expanded_size
from pneucli.io.raw_file import ColumnValues, Repair

_SAMPLES, _STAMPS = ("values", "data", "samples", "y"), ("x", "time", "t", "timestamps")  # keys of a channel
_ROWS = ("data", "values", "rows", "items")  # keys of a table of a series
_SERIES = ("target", "name", "externalId", "metric/__name__")  # paths of its name
_UNITS = re.compile(r"(?i)(?:.*/)?units?/(?:.*/)?([^/]+)")  # of a map from names to units
_FIELD = re.compile(r"[a-z]+_?\d+")  # names that number fields
NO_UNITS: Mapping[str, str] = MappingProxyType({})
EXPANSION = 8  # bytes in memory for one of the text, at most: numbers of two digits become objects


def open_json(path: Path) -> ColumnReader:
    """List the columns: numbers, numbers and stamps as texts, and labels."""
    check_expanded_size(path, EXPANSION * path.stat().st_size)
    repairs: list[Repair] = []
    whole = _parsed(path, repairs)
    said = dict(_leaves(whole, "")) if isinstance(whole, Mapping) else {}
    units = {found[1]: str(unit) for key, unit in said.items() if (found := _UNITS.fullmatch(key))}
    reader = reader_of(path, JSON.name, _columns(whole), units)
    reader.repairs += repairs
    return reader


def reader_of(
    path: Path, format: str, columns: Mapping[str, ColumnValues], said: Mapping[str, str] = NO_UNITS
) -> ColumnReader:
    """Return the reader of columns of numbers and of texts, which are numbers, stamps or labels.

    ``said``: the unit of columns by the last part of their names.
    """
    texts = {name for name, values in columns.items() if values.dtype == object and is_label_column(values)}
    units = {name: said[last] for name in columns if (last := name.rpartition("/")[2]) in said}
    return ColumnReader.of_columns(path, format, columns, units, {}, texts=texts)


def _parsed(path: Path, repairs: list[Repair]) -> Any:
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return _lines(path, text, repairs)


def _columns(whole: Any) -> dict[str, ColumnValues]:
    if isinstance(whole, list) and whole and all(isinstance(row, list) for row in whole):
        head = whole[0] if all(isinstance(name, str) for name in whole[0]) else []
        whole = {"columns": head or list(range(1, len(whole[0]) + 1)), "data": whole[bool(head) :]}
    tables = list(_tables(whole))
    rows: Any
    if len(tables) == 1:
        rows = dict(zip(tables[0][1], map(list, zip(*tables[0][2], strict=True)), strict=True))
    elif tables:
        rows = [{"channel": name, **dict(zip(names, row, strict=True))} for name, names, own in tables for row in own]
    else:
        whole = _frame(whole)
        rows = whole if isinstance(whole, list) and not all(map(_channel, whole)) else _rows(whole)
    if isinstance(rows, Mapping):
        named = ((name, [own] if isinstance(own, int | float) else own) for name, own in rows.items())
        return {name: _vector(values) for name, values in named if _is_column(values)}
    return columns_of_rows([row.get("_source", row) for row in rows if isinstance(row, Mapping)])  # of Elasticsearch


def columns_of_rows(rows: Sequence[Mapping[str, Any]]) -> dict[str, ColumnValues]:
    """Return the columns of objects, one a sample; of a few that hold more samples each than they are, by sample."""
    flat = [sample for row in rows for sample in _samples_of_row(dict(_leaves(row, "")), len(rows))]
    names = dict.fromkeys(name for row in flat for name in row)
    read = {name: [row.get(name) for row in flat] for name in names}
    return {name: _vector(values) for name, values in read.items() if _is_column(values)}


def _samples_of_row(row: dict[str, Any], rows: int) -> Iterator[dict[str, Any]]:
    """Yield the samples of a row of arrays, each with what the row says of all of them; the row where it holds none.

    An array is one of samples where it has more of them than there are rows; of others each number is a column.
    """
    arrays = {name: own for name, own in row.items() if isinstance(own, list) and _is_column(own)}
    short = {name: own for name, own in arrays.items() if len(own) <= max(rows, 1)}
    row |= {f"{name}/{n}" if len(own) > 1 else name: one for name, own in short.items() for n, one in enumerate(own, 1)}
    samples = {name: own for name, own in arrays.items() if name not in short}
    if len({len(own) for own in samples.values()}) != 1:
        yield row
        return
    step = stated_period({name: own for name, own in row.items() if isinstance(own, int | float)})
    for number, values in enumerate(zip(*samples.values(), strict=True)):
        clock = {"time": number * step[1]} if step and "time" not in row else {}
        yield {**row, **clock, **dict(zip(samples, values, strict=True))}


def _tables(node: Any) -> Iterator[tuple[str, list[str], list[list[Any]]]]:
    """Yield name, names of columns and rows of each table whose rows are lists, as pandas, InfluxDB and Grafana do."""
    if isinstance(node, list):
        for one in node:
            yield from _tables(one) if isinstance(one, Mapping) else ()
    elif isinstance(node, Mapping):
        names = node.get("columns", node.get("header"))
        rows = next((node[key] for key in _ROWS if key in node), None)
        flat = dict(_leaves(node, ""))
        name = next((str(flat[key] or "") for key in _SERIES if not isinstance(flat.get(key), list | None)), "")
        unit = node.get("unit", node.get("units"))
        if name and isinstance(rows, list) and rows and all(isinstance(row, Mapping) for row in rows):
            names, rows = [*rows[0]], [[row.get(key) for key in rows[0]] for row in rows]
        if isinstance(node.get("datapoints"), list):
            names, rows = ["value", "timestamp"], node["datapoints"]
        elif isinstance(fields := flat.get("schema/fields"), list) and isinstance(rows, Mapping):
            names, rows = (
                [one.get("name") for one in fields],
                list(map(list, zip(*rows.get("values", ()), strict=True))),
            )
            name, names = (str(names[1]), ["time", "value"]) if len(names) == 2 else (name, names)
        elif name and (samples := _samples(node)) and (stamps := _samples(node, _STAMPS)):
            names, rows = ["time", "value"], [list(pair) for pair in zip(stamps, samples, strict=False)]
        elif names is None and name:
            names = ["time", "value"]  # a series of pairs
        if isinstance(names, list) and isinstance(rows, list) and rows:
            if isinstance(index := node.get("index"), list) and len(index) == len(rows):
                names, rows = ["index", *names], [[n, *row] for n, row in zip(index, rows, strict=True)]
            if all(isinstance(row, list) and len(row) == len(names) for row in rows):
                yield f"{name} [{unit}]" if unit else name, [str(one) for one in names], rows
                return
        for key, one in node.items():  # a list of readings may stand under the name of its series
            listed = isinstance(one, list) and one and isinstance(one[0], Mapping) and "value" in one[0]
            yield from _tables({"name": key, "data": one} if listed and _reading(one[0]) is None else one)


def _lines(path: Path, text: str, repairs: list[Repair]) -> list[Any]:
    rows = []
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    for number, line in lines:
        try:
            rows.append(json.loads(line))
        except json.JSONDecodeError as error:
            if number == lines[-1][0] and rows:
                repairs.append(Repair("", "truncated", 1, f"line {number}, the last, is cut off: left out"))
                break
            where = f"{path}, line {number}"
            raise InputError(
                where, f"no JSON: {error.msg}", "an object a line", "mend the line", code="E044"
            ) from error
    return rows


def _samples(node: Any, keys: Sequence[str] = _SAMPLES) -> list[Any]:
    """Return the list that an object holds under one of the keys, such as ``{"name": "p1", "values": [1.0, 1.1]}``."""
    own = (node[key] for key in keys if _is_column(node.get(key))) if isinstance(node, Mapping) else ()
    return next(iter(own), [])


def _channel(node: Any) -> list[Any]:
    """Return the samples of an object that holds one channel, and no other list."""
    single = isinstance(node, Mapping) and sum(isinstance(own, list) for own in node.values()) == 1
    return _samples(node) if single else []


def _reading(node: Any) -> Any:
    """Return the value of an object that names one reading, as the metrics of Sparkplug do; None of others."""
    value = node.get("value") if isinstance(node, Mapping) and isinstance(node.get("name"), str) else None
    return value if isinstance(value, int | float | str) else None


def _frame(whole: Any) -> Any:
    """Return the lists of a table of pandas, which holds columns by their index or rows by it; else as it is."""
    inner = list(whole.values()) if isinstance(whole, Mapping) else []
    if not inner or not all(isinstance(one, Mapping) and one.keys() == inner[0].keys() for one in inner):
        return whole
    if not all(_is_column(list(one.values())) for one in inner):
        return whole
    outer, names = list(whole), list(inner[0])
    if len(outer) > len(names):
        index, columns = outer, {name: [one[name] for one in inner] for name in names}
    else:
        index, columns = names, {name: list(one.values()) for name, one in zip(outer, inner, strict=True)}
    return {"index": index, **columns}


def _rows(whole: Any) -> Any:
    """Return lists by name, or the list of objects that an object holds under its only such name.

    Where nothing else is a column, at any depth, as in the answers of a database: ``hits/hits``.
    """
    listed = list(whole.values()) if isinstance(whole, Mapping) else [whole]
    by_name = dict(_leaves({"": whole}, ""))
    inside = _lists_of_objects(listed, deep=not any(map(_is_column, by_name.values())))
    if len(inside) != 1 or _channel(inside[0][0]):
        return by_name
    beside = [own for own in listed if isinstance(own, Mapping)]  # may say what field1 and others are
    titles = {key: name for own in beside for key, name in own.items() if _FIELD.fullmatch(key) and name}
    return [{titles.get(key, key): own for key, own in row.items()} for row in inside[0]]


def _lists_of_objects(nodes: Sequence[Any], *, deep: bool) -> list[list[Any]]:
    found = [own for own in nodes if isinstance(own, list) and own and isinstance(own[0], Mapping)]
    inner = [one for own in nodes if isinstance(own, Mapping) for one in own.values()]
    return _lists_of_objects(inner, deep=True) if deep and inner and not found else found


def _leaves(node: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    for key, value in node.items():
        name = f"{prefix}/{key}".strip("/")
        listed = isinstance(value, list) and any(_channel(one) or _reading(one) is not None for one in value)
        for one in value if listed else [value]:
            if (samples := _channel(one) or _reading(one)) is not None:
                named, unit = one.get("name", one.get("label", name)), one.get("unit", one.get("units"))
                yield f"{named} [{unit}]" if unit else str(named), samples
            elif isinstance(one, Mapping):
                yield from _leaves(one, name)
            else:
                yield name, one


def _is_column(values: Any) -> bool:
    known = [value for value in values if value is not None] if isinstance(values, list) else []
    return bool(known) and all(isinstance(value, int | float | str) for value in known)


def _vector(values: Sequence[Any]) -> ColumnValues:
    if any(isinstance(value, str) for value in values):
        return np.array(values, dtype=object)
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


JSON = Format(
    "JSON",
    "JSON, JSON lines",
    open_json,
    pattern=rb"[\xef\xbb\xbf\s]*(?:(?:\[\s*)?\{\s*[\"}]|\[\s*(?:\[|\"[^\"\n]*\"\s*,))",
    column="a name, a path `a/b`, or an array in a row",
)
