"""The table of a fleet: a row a rig and date, its columns named like keys of the pipeline file."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date, datetime
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from pneucli.errors import InputError, did_you_mean, printable

RIG, DATE = "rig", "date"
TEXT_KEYS = ("file", "name", "use", "experiment")  # values of these keys stay texts even if they look like numbers
MAX_RIG_NAME_LENGTH = 100  # characters of a rig's name


@dataclass(frozen=True)
class FleetRow:
    """One rig at one date: its line of the table and its values by dotted key; a row with a ``fault`` is not run."""

    line: int
    rig: str
    date: str
    values: Mapping[str, Any]
    fault: str = ""

    @property
    def key(self) -> tuple[str, str]:
        """Rig and date."""
        return self.rig, self.date


def read_rows(path: Path) -> list[FleetRow]:
    """Return all rows of a table (CSV or Parquet), in its order; an error of one row goes into its ``fault``.

    Raises InputError where the table as a whole cannot be read or has no column ``rig`` or ``date``.
    """
    columns, records = _parquet(path) if path.suffix == ".parquet" else _csv(path)
    for name in (RIG, DATE):
        if name not in columns:
            raise InputError(
                str(path), f"no column {name}", f"{RIG}, {DATE}, and keys", did_you_mean(name, columns), code="E081"
            )
    if twice := [name for name in columns if columns.count(name) > 1]:
        raise InputError(
            str(path), f"two columns are called {twice[0]}", "each key once", "remove one of them", code="E081"
        )
    return _mark_duplicates([_row(line, record) for line, record in records])


def _csv(path: Path) -> tuple[list[str], list[tuple[int, dict[str, Any]]]]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            start = file.read(1 << 16)
            file.seek(0)
            delimiter = max(",;\t", key=start.partition("\n")[0].count)
            reader = csv.reader(file, delimiter=delimiter)
            head = [cell.strip() for cell in next(reader, [])]
            records = [(reader.line_num, cells) for cells in reader if any(cells)]
    except OSError as error:
        raise InputError(
            str(path), f"cannot be read: {error.strerror}", "the fleet's table", "check table", code="E003"
        ) from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(str(path), f"not a CSV table in UTF-8: {error}", "CSV or Parquet", code="E081") from error
    for line, cells in records:
        if len(cells) != len(head):
            raise InputError(
                f"{path}, line {line}", f"{len(cells)} cells", f"{len(head)}, as the header has", code="E081"
            )
    return head, [(line, dict(zip(head, cells, strict=True))) for line, cells in records]


def _parquet(path: Path) -> tuple[list[str], list[tuple[int, dict[str, Any]]]]:
    try:
        table = pq.read_table(path)
    except FileNotFoundError as error:
        raise InputError(str(path), "no such file", "the fleet's table", "check table", code="E002") from error
    except (OSError, pa.ArrowInvalid) as error:
        raise InputError(str(path), f"not a Parquet file: {error}", "CSV or Parquet", code="E081") from error
    return table.column_names, list(enumerate(table.to_pylist(), 1))


def _row(line: int, record: Mapping[str, Any]) -> FleetRow:
    rig, when = str(record[RIG] or "").strip(), record[DATE]
    values = {k: _value(k, v) for k, v in record.items() if k not in (RIG, DATE) and v is not None and v != ""}
    try:
        day = _iso_date(when)
    except ValueError:
        return FleetRow(
            line, rig or f"line {line}", "unknown", values, f'"{when}" is no date; wanted one such as 2026-11-22'
        )
    if not rig or printable(rig) != rig or len(rig) > MAX_RIG_NAME_LENGTH or rig.startswith("."):
        fault = f'"{printable(rig)[:MAX_RIG_NAME_LENGTH]}" cannot be the name of a rig'
        return FleetRow(line, f"line {line}", day, values, fault)
    return FleetRow(line, rig, day, values)


def _iso_date(value: Any) -> str:
    """Return a date, or a date with a time of day, in ISO 8601."""
    if isinstance(value, datetime):
        return value.isoformat(timespec="seconds") if value.time() != datetime.min.time() else value.date().isoformat()
    if isinstance(value, date):
        return value.isoformat()
    text = str(value).strip()
    return (
        date.fromisoformat(text).isoformat()
        if len(text) <= len("2026-01-01")
        else _iso_date(datetime.fromisoformat(text))
    )


def _value(key: str, value: Any) -> Any:
    """Return a cell as a value of the pipeline file: a number or a truth value where it reads as one, else the text."""
    if not isinstance(value, str) or key.rpartition(".")[2] in TEXT_KEYS:
        return value
    text = value.strip()
    try:
        return float(text)
    except ValueError:
        return {"true": True, "false": False}.get(text, text)


def _mark_duplicates(rows: Sequence[FleetRow]) -> list[FleetRow]:
    """Return the rows; a row that repeats rig and date of an earlier row gets a fault."""
    first: dict[tuple[str, str], int] = {}
    out = []
    for row in rows:
        line = first.setdefault(row.key, row.line)
        fault = f"{row.rig} at {row.date} is already in line {line}"
        is_good = line == row.line or row.fault
        out.append(row if is_good else replace(row, rig=f"{row.rig} (line {row.line})", fault=fault))
    return out
