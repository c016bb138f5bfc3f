"""Write the fleet's results as Parquet datasets, a folder for each date, as pandas, polars and DuckDB read them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pyarrow as pa

from pneucli.arrays import Array
from pneucli.figure import FIGURE_COLUMNS, Figure, to_json
from pneucli.fleet.row_files import RowResult
from pneucli.io.artifacts import Provenance, TableWriter, schema_from

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
        for date, records in by_date.items():
            _write(out / name / f"date={quote(date)}" / PART_FILE, name, records, provenance)
        _remove_others(out / name, {f"date={quote(date)}" for date in by_date})


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
    for rig, date, name, unit, value, error in records:
        if np.isfinite(value):
            groups.setdefault((rig, name, unit), []).append((date, value, error if np.isfinite(error) else 0.0))
    return [_trend(key, sorted(points)) for key, points in groups.items() if len(points) >= MIN_DATES]


def _trend(key: tuple[str, str, str], points: Sequence[tuple[str, float, float]]) -> Trend:
    dates, values, errors = zip(*points, strict=True)
    rig, name, unit = key
    return Trend(rig, name, unit, dates, values, errors, find_change_points(np.array(values), np.array(errors)))
