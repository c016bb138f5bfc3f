"""Write the fleet's results as Parquet datasets, a folder for each date, as pandas, polars and DuckDB read them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pyarrow as pa

from pneucli.fleet.trends import Trend
from pneucli.io.artifacts import Provenance, TableWriter, schema_of

PART_FILE = "part-0.parquet"
RESULTS, PARAMETERS, CHANGES, TRENDS = "results", "parameters", "changes", "trends.parquet"
_TEXT, _NUMBER, _LIST = pa.string(), pa.float64(), pa.list_(pa.string())
COLUMNS: Mapping[str, Mapping[str, Any]] = {
    RESULTS: {
        **dict.fromkeys(("rig", "verdict"), _TEXT),
        "missing": _LIST,
        **dict.fromkeys(("error_train", "error_test", "seconds", "core_seconds"), _NUMBER),
        **dict.fromkeys(("failure", "cause", "since"), _TEXT),
        "changed": _LIST,
        "p_value": _NUMBER,
        **dict.fromkeys(("report", "program"), _TEXT),
    },
    PARAMETERS: {"rig": _TEXT, "name": _TEXT, "value": _NUMBER, "unit": _TEXT, "ci_low": _NUMBER, "ci_high": _NUMBER},
    CHANGES: {
        **dict.fromkeys(("rig", "name", "effect"), _TEXT),
        **dict.fromkeys(("before", "after"), _NUMBER),
        "unit": _TEXT,
        **dict.fromkeys(("ci_low", "ci_high", "confidence", "confidence_alone"), _NUMBER),
        "indistinguishable_from": _LIST,
        "since": _TEXT,
    },
}
UNITS = {
    **dict.fromkeys(("error_train", "error_test", "p_value", "confidence", "confidence_alone"), "1"),
    **dict.fromkeys(("seconds", "core_seconds"), "s"),
    **dict.fromkeys(("value", "ci_low", "ci_high", "before", "after", "error"), "see column unit"),
}


def write_datasets(out: Path, results: Sequence[Mapping[str, Any]], provenance: Provenance) -> None:
    """Write the datasets of all rows; remove the dates that the table no longer has."""
    for name in COLUMNS:
        by_date: dict[str, list[dict[str, Any]]] = {str(r["date"]): [] for r in results}
        for result in results:
            by_date[str(result["date"])] += [dict(record) for record in _records(name, result)]
        for date, records in by_date.items():
            _write(out / name / f"date={quote(date)}" / PART_FILE, name, records, provenance)
        _remove_others(out / name, {f"date={quote(date)}" for date in by_date})


def _records(name: str, result: Mapping[str, Any]) -> Iterable[Mapping[str, Any]]:
    if name == RESULTS:
        return [{**result, "changed": [c["name"] for c in result["changes"]]}]
    if name == PARAMETERS:
        return [
            {"rig": result["rig"], "name": n, "value": p["value"], "unit": p["unit"]} | _interval(p)
            for n, p in result["parameters"].items()
        ]
    return [{**c, **_interval(c), "rig": result["rig"], "since": result["since"]} for c in result["changes"]]


def _interval(one: Mapping[str, Any]) -> dict[str, Any]:
    low, high = one.get("ci95") or (None, None)
    return {"ci_low": low, "ci_high": high}


def _write(path: Path, name: str, records: Sequence[Mapping[str, Any]], provenance: Provenance) -> None:
    types = COLUMNS[name]
    schema = schema_of(types, units=UNITS, schema=f"pneucli/fleet/{name}/1", provenance=provenance)
    with TableWriter(path, schema) as writer:
        writer.write({column: [record.get(column) for record in records] for column in types})


def _remove_others(folder: Path, present: set[str]) -> None:
    """Remove the parts of dates that the table no longer has, and only files that this program wrote."""
    for old in folder.glob(f"date=*/{PART_FILE}"):
        if old.parent.name not in present:
            old.unlink()
            if not any(old.parent.iterdir()):
                old.parent.rmdir()


def write_trends(path: Path, trends: Sequence[Trend], provenance: Provenance) -> None:
    """Write a row for each rig, parameter and date; ``level`` numbers the levels between change points, from 0."""
    types: dict[str, Any] = {
        "rig": _TEXT,
        "name": _TEXT,
        "date": _TEXT,
        "value": _NUMBER,
        "error": _NUMBER,
        "unit": _TEXT,
    }
    types["level"] = pa.int32()
    rows = [
        (t.rig, t.name, date, value, error, t.unit, sum(i >= b for b in t.change_points))
        for t in trends
        for i, (date, value, error) in enumerate(zip(t.dates, t.values, t.errors, strict=True))
    ]
    columns = list(zip(*rows, strict=True)) if rows else [()] * len(types)
    schema = schema_of(types, units=UNITS | {"level": "1"}, schema="pneucli/fleet/trends/1", provenance=provenance)
    with TableWriter(path, schema) as writer:
        writer.write(dict(zip(types, map(list, columns), strict=True)))
