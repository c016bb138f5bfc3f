"""The rows of a fleet's table: the pipeline file of a row, its stored result, and all as Parquet datasets."""

import csv
import json
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date, datetime
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import tomlkit

from pneucli.arrays import Array
from pneucli.errors import InputError, did_you_mean, environment_error, printable, require_known
from pneucli.figure import FIGURE_COLUMNS, Figure, named, read, to_json
from pneucli.io.artifacts import Provenance, TableWriter, schema_from
from pneucli.io.result_store import Store, is_remote
from pneucli.messages.changes import Change, Repeatability
from pneucli.messages.compare import evaluation_error
from pneucli.messages.diagnose import Answer, selected_step

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
    require_known((RIG, DATE), columns, str(path), "no column {}", f"{RIG}, {DATE}, and keys", code="E081")
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


SCHEMA = "pneucli/fleet-row/1"
RESULT, ROWS = "row.json", "rows"
RECORDINGS = "recordings"
SAFE_CHARACTERS = " +,=@()"  # unchanged in a folder's name, in addition to letters, digits and _.-~


@dataclass(frozen=True)
class RowResult:
    """What a row came to: what a fleet keeps of its diagnosis, or why it failed.

    ``since`` is the date that it was compared with, ``key`` the digest of its inputs, ``stamp`` one that is had without
    reading them. ``again``: the next run repeats it; ``bad``: it cannot be a baseline; ``same``: it was there already.
    """

    schema: str
    rig: str
    date: str
    line: int = 0
    since: str | None = None
    verdict: str | None = None
    missing: Sequence[str] = ()
    error_train: float | None = None
    error_test: float | None = None
    error_after: float | None = None
    parameters: Mapping[str, Figure] = field(default_factory=dict)
    changes: Sequence[Change] = ()
    p_value: float | None = None
    repeat: Mapping[str, Sequence[float]] | None = None
    repeatability: Repeatability | None = None
    sentence: str = ""
    report: str | None = None
    failure: str | None = None
    cause: str | None = None
    again: bool = False
    bad: bool = False
    program: str | None = None
    stamp: str | None = None
    key: str | None = None
    seconds: float = 0.0
    core_seconds: float = 0.0
    same: bool = False


def folder_name(text: str) -> str:
    """Return a folder name for a text; different texts give different folder names."""
    return quote(text, safe=SAFE_CHARACTERS)


def row_pipeline(template: str, row: FleetRow, folders: tuple[Path, Path]) -> str:
    """Return the template's text with the row's values in it, and every path absolute.

    Args:
        template: The text of the template pipeline.
        row: The row of the table.
        folders: The folders of template and table, to which their paths are relative.

    Raises:
        InputError: The template has no table for a key, and none can be made.

    """
    document = tomlkit.parse(template)
    for table in document.get(RECORDINGS, []):
        _make_paths_absolute(table, folders[0])
    if plugins := document.get("model", {}).get("plugins"):
        document["model"]["plugins"] = [_path(str(p), folders[0]) for p in plugins]
    for key, value in row.values.items():
        last = key.rpartition(".")[2]
        _set(document, key, _path(value, folders[1]) if last == "file" and isinstance(value, str) else value)
    document["pipeline"]["name"] = re.sub(r'[/\\:*?"<>|]', "_", row.rig)[:60]
    return tomlkit.dumps(document)


def _make_paths_absolute(table: Any, folder: Path) -> None:
    for one in (table, *table.get("more", [])):
        if isinstance(one.get("file"), str):
            one["file"] = _path(one["file"], folder)


def _path(text: str, folder: Path) -> str:
    """Return a path from ``folder`` as an absolute one; what begins with a variable or is a URL stays as it is."""
    return text if is_remote(text) or text.startswith(("$", "~")) else os.path.normpath(folder / text)


def _set(document: Any, key: str, value: Any) -> None:
    parts = key.split(".")
    table = document
    if parts[0] == RECORDINGS:
        table = next(t for t in document[RECORDINGS] if t.get("name") == parts[1])
        parts = parts[2:]
    for part in parts[:-1]:
        table = table.setdefault(part, tomlkit.table())
    table[parts[-1]] = value


def require_columns(template: Mapping[str, Any], columns: Iterable[str], keys_at: Any, where: str) -> None:
    """Raise InputError for columns that name no key of a pipeline file, or no recording of the template.

    ``keys_at(location)`` returns the keys that the table at ``location`` may have.
    """
    names = [str(t.get("name")) for t in template.get(RECORDINGS, [])]
    for column in columns:
        parts = column.split(".")
        if parts[0] == RECORDINGS and (len(parts) < 3 or parts[1] not in names):
            mend = did_you_mean(parts[1] if len(parts) > 1 else "", names)
            raise InputError(
                f"{where}, column {column}", "no such recording in the template", "by its name", mend, code="E081"
            )
        location = (parts[0], *parts[2:]) if parts[0] == RECORDINGS else tuple(parts)
        for depth, name in enumerate(location):
            if keys := keys_at(location[:depth]):
                require_known([name], keys, f"{where}, column {column}", 'no key "{}"', code="E081")


def raw_file_names(document: Mapping[str, Any]) -> list[str]:
    """Return the raw files that a pipeline's tables name, as they are named."""
    tables = [one for table in document.get(RECORDINGS, []) for one in (table, *table.get("more", []))]
    return [str(one["file"]) for one in tables if isinstance(one.get("file"), str)]


def row_folder(row: FleetRow) -> str:
    """Return the folder of a row, relative to the folder of the fleet."""
    return f"{ROWS}/{folder_name(row.rig)}/{folder_name(row.date)}"


def read_result(store: Store, row: FleetRow) -> RowResult | None:
    """Return the stored result of a row; None where there is none of this version."""
    return parse_result(store.read(f"{row_folder(row)}/{RESULT}"))


def read_results(store: Store, rows: Sequence[FleetRow]) -> dict[tuple[str, str], RowResult]:
    """Return the stored results of several rows, by rig and date."""
    names = {row.key: f"{row_folder(row)}/{RESULT}" for row in rows if not row.fault}
    content = store.read_all(names.values())
    found = {key: parse_result(content[name]) for key, name in names.items()}
    return {key: result for key, result in found.items() if result is not None}


def parse_result(content: bytes | None) -> RowResult | None:
    """Return the result in the content of a row's file; None where another version wrote it."""
    try:
        result: dict[str, Any] = json.loads(content or b"")
    except ValueError:
        return None
    return read(RowResult, result) if result.get("schema") == SCHEMA else None


def write_result(store: Store, row: FleetRow, result: RowResult) -> None:
    """Write the result of a row, atomically."""
    store.write(f"{row_folder(row)}/{RESULT}", json.dumps(to_json(result), allow_nan=False))


def failure_result(row: FleetRow, error: BaseException) -> RowResult:
    """Return the result of a failed row; the next run repeats the row unless its input is at fault."""
    environment = environment_error(error) if isinstance(error, OSError | MemoryError) else None
    reported = environment or error
    if isinstance(reported, InputError):
        text, cause = str(reported), failure_cause(reported.found)
    else:
        name = type(error).__name__
        text, cause = f"fault of the program: {name}: {error}", failure_cause(name)
    again = not isinstance(error, InputError)
    return RowResult(SCHEMA, row.rig, row.date, row.line, failure=text, cause=cause, again=again, bad=True)


def failure_cause(text: str) -> str:
    """Return a failure's message without names, paths and numbers, so that equal causes have equal texts."""
    text = re.sub(r"\"[^\"]*\"|'[^']*'", '"…"', text.splitlines()[0] if text else "unknown")
    text = re.sub(r"\S*/\S+", "…", text)
    return re.sub(r"[-+]?\d[\d.,e+-]*", "#", text)[:120]


def result_from_diagnosis(row: FleetRow, answer: Answer) -> RowResult:
    """Return the part of a diagnosis that a fleet stores."""
    first, last, since = answer.ladder[0], selected_step(answer), answer.since
    effects = {f"{c.effect}.{p}": value for c in answer.named for p, value in c.parameters.items()}
    return RowResult(
        schema=SCHEMA,
        **named(row, "rig date line"),
        **named(answer, "verdict missing sentence"),
        **named(first, "error_train error_test"),
        error_after=evaluation_error(last.error)[1],
        parameters={**(answer.parameters or {}), **effects},
        changes=answer.changes or (),
        **({} if since is None else named(since, "p_value repeat repeatability")),
        bad=answer.verdict == "inconclusive",
    )


MIN_DATES = 3  # two dates show no trend

# times the logarithm of the number of dates, for each additional level: its value and the place of its change
CHANGE_POINT_PENALTY = 3.0


@dataclass(frozen=True)
class Trend:
    """One parameter of one rig over its dates: values, standard errors, and the indices at which a new level begins."""

    rig: str
    name: str
    unit: str
    dates: tuple[str, ...]
    values: tuple[float, ...]
    errors: tuple[float, ...]
    change_points: tuple[int, ...] = ()


PART_FILE = "part-0.parquet"
RESULTS, PARAMETERS, CHANGES, TRENDS = "results", "parameters", "changes", "trends.parquet"
LISTS = dict.fromkeys(("missing", "changed", "indistinguishable_from"), pa.list_(pa.string()))
COLUMNS = {
    RESULTS: "rig, verdict, missing, error_train [1], error_test [1], seconds [s], core_seconds [s], failure, cause, "
    "since, changed, p_value [1], report, program",
    PARAMETERS: f"rig, name, {FIGURE_COLUMNS}",
    CHANGES: "rig, name, effect, before [see column unit], after [see column unit], unit, ci_low [see column unit], "
    "ci_high [see column unit], confidence [1], confidence_alone [1], indistinguishable_from, since",
}


def write_datasets(out: Path, results: Sequence[RowResult], provenance: Provenance) -> None:
    """Write the datasets of all rows; remove the dates that the table no longer has."""
    for name in COLUMNS:
        by_date: dict[str, list[dict[str, Any]]] = {r.date: [] for r in results}
        for result in results:
            by_date[result.date] += _records(name, result)
        for day, records in by_date.items():
            _write(out / name / f"date={quote(day)}" / PART_FILE, name, records, provenance)
        _remove_others(out / name, {f"date={quote(day)}" for day in by_date})


def _records(name: str, result: RowResult) -> list[dict[str, Any]]:
    if name == RESULTS:
        return [{**to_json(result), "changed": [c.name for c in result.changes]}]
    own = {"rig": result.rig, "since": result.since}
    if name == PARAMETERS:
        return [own | {"name": n} | _figure(p) for n, p in result.parameters.items()]
    return [own | to_json(c) | _figure(c.after) | {"after": _figure(c.after)["value"]} for c in result.changes]


def _figure(one: Figure) -> dict[str, Any]:
    return dict(zip(("value", "unit", "ci_low", "ci_high"), map(to_json, one.row), strict=True))


def _write(path: Path, name: str, records: Sequence[Mapping[str, Any]], provenance: Provenance) -> None:
    lists = {column: kind for column, kind in LISTS.items() if column in COLUMNS[name]}
    schema = schema_from(COLUMNS[name], schema=f"pneucli/fleet/{name}/1", provenance=provenance, **lists)
    with TableWriter(path, schema) as writer:
        writer.write({column: [record.get(column) for record in records] for column in schema.names})


def _remove_others(folder: Path, present: set[str]) -> None:
    """Remove the parts of dates that the table no longer has, and only files that this program wrote."""
    for old in folder.glob(f"date=*/{PART_FILE}"):
        if old.parent.name not in present:
            old.unlink()
            if not any(old.parent.iterdir()):
                old.parent.rmdir()


def write_trends(path: Path, trends: Sequence[Trend], provenance: Provenance) -> None:
    """Write a row for each rig, parameter and date; ``level`` numbers the levels between change points, from 0."""
    rows = [
        (t.rig, t.name, date, value, error, t.unit, sum(i >= b for b in t.change_points))
        for t in trends
        for i, (date, value, error) in enumerate(zip(t.dates, t.values, t.errors, strict=True))
    ]
    columns = "rig, name, date, value [see column unit], error [see column unit], unit, level [1]"
    schema = schema_from(columns, schema="pneucli/fleet/trends/1", provenance=provenance, level=pa.int32())
    cells = list(zip(*rows, strict=True)) if rows else [()] * len(schema.names)
    with TableWriter(path, schema) as writer:
        writer.write(dict(zip(schema.names, map(list, cells), strict=True)))


def find_change_points(values: Array, errors: Array) -> tuple[int, ...]:
    """Return the indices at which the level of a series changes.

    Dynamic programming finds the exact minimum of the weighted sum of squares about piecewise constant levels, plus
    Schwarz's penalty for each change. A standard error below the scatter of neighbouring values is raised to it.

    Args:
        values: The series, shape (n,).
        errors: Standard errors, shape (n,), same unit.

    Returns:
        The index of the first value of each level but the first one.

    """
    n = values.size
    if n < MIN_DATES:
        return ()
    weight = 1.0 / np.maximum(errors, robust_scatter(values)) ** 2
    sums = [np.concatenate([[0.0], np.cumsum(weight * values**k)]) for k in (0, 1, 2)]
    penalty = CHANGE_POINT_PENALTY * np.log(n)
    best, last = np.full(n + 1, np.inf), np.zeros(n + 1, dtype=int)
    best[0] = -penalty
    for end in range(1, n + 1):
        w, first, second = (s[end] - s[:end] for s in sums)
        cost = best[:end] + np.maximum(second - first**2 / w, 0.0) + penalty
        last[end] = int(np.argmin(cost))
        best[end] = cost[last[end]]
    changes, end = [], n
    while (end := int(last[end])) > 0:
        changes.append(end)
    return tuple(reversed(changes))


def robust_scatter(values: Array) -> float:
    """Return the standard deviation of values about a piecewise constant level, from the median of their steps."""
    steps = np.abs(np.diff(values))
    tiny = 1e-12 * float(np.max(np.abs(values), initial=1e-300))
    return max(float(np.median(steps)) / (0.6745 * np.sqrt(2.0)), tiny) if steps.size >= MIN_DATES else tiny


def parameter_trends(records: Sequence[tuple[str, str, str, str, float, float]]) -> list[Trend]:
    """Return the trends of (rig, date, name, unit, value, error), by rig and name, dates in order."""
    groups: dict[tuple[str, str, str], list[tuple[str, float, float]]] = {}
    for rig, day, name, unit, value, error in records:
        if np.isfinite(value):
            groups.setdefault((rig, name, unit), []).append((day, value, error if np.isfinite(error) else 0.0))
    return [_trend(key, sorted(points)) for key, points in groups.items() if len(points) >= MIN_DATES]


def _trend(key: tuple[str, str, str], points: Sequence[tuple[str, float, float]]) -> Trend:
    dates, values, errors = zip(*points, strict=True)
    rig, name, unit = key
    return Trend(rig, name, unit, dates, values, errors, find_change_points(np.array(values), np.array(errors)))
