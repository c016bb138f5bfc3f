"""The stored result of one row of a fleet: where it is, how it is read, and what it says of a failure."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

from pneucli.errors import InputError, environment_error
from pneucli.fleet.row_pipelines import folder_name
from pneucli.fleet.table import FleetRow
from pneucli.io.result_store import Store

SCHEMA = "pneucli/fleet-row/1"
RESULT, ROWS = "row.json", "rows"
EMPTY_RESULT: dict[str, Any] = {
    "verdict": None,
    "missing": [],
    "error_train": None,
    "error_test": None,
    "parameters": {},
    "changes": [],
    "p_value": None,
    "report": None,
    "failure": None,
    "cause": None,
}


def row_folder(row: FleetRow) -> str:
    """Return the folder of a row, relative to the folder of the fleet."""
    return f"{ROWS}/{folder_name(row.rig)}/{folder_name(row.date)}"


def read_result(store: Store, row: FleetRow) -> dict[str, Any] | None:
    """Return the stored result of a row; None where there is none of this version."""
    return parse_result(store.read(f"{row_folder(row)}/{RESULT}"))


def read_results(store: Store, rows: Sequence[FleetRow]) -> dict[tuple[str, str], dict[str, Any]]:
    """Return the stored results of several rows, by rig and date."""
    names = {row.key: f"{row_folder(row)}/{RESULT}" for row in rows if not row.fault}
    content = store.read_all(names.values())
    found = {key: parse_result(content[name]) for key, name in names.items()}
    return {key: result for key, result in found.items() if result is not None}


def parse_result(content: bytes | None) -> dict[str, Any] | None:
    """Return the result in the content of a row's file; None where another version wrote it."""
    try:
        result: dict[str, Any] = json.loads(content or b"")
    except ValueError:
        return None
    return result if result.get("schema") == SCHEMA else None


def write_result(store: Store, row: FleetRow, result: Mapping[str, Any]) -> None:
    """Write the result of a row, atomically."""
    store.write(f"{row_folder(row)}/{RESULT}", json.dumps(result, allow_nan=False))


def failure_result(row: FleetRow, error: BaseException) -> dict[str, Any]:
    """Return the result of a failed row; the next run repeats the row unless its input is at fault."""
    environment = environment_error(error) if isinstance(error, OSError | MemoryError) else None
    reported = environment or error
    if isinstance(reported, InputError):
        text, cause = str(reported), failure_cause(reported.found)
    else:
        name = type(error).__name__
        text, cause = f"fault of the program: {name}: {error}", failure_cause(name)
    again = not isinstance(error, InputError)
    return result_header(row) | EMPTY_RESULT | {"failure": text, "cause": cause, "again": again, "bad": True}


def failure_cause(text: str) -> str:
    """Return a failure's message without names, paths and numbers, so that equal causes have equal texts."""
    text = re.sub(r"\"[^\"]*\"|'[^']*'", '"…"', text.splitlines()[0] if text else "unknown")
    text = re.sub(r"\S*/\S+", "…", text)
    return re.sub(r"[-+]?\d[\d.,e+-]*", "#", text)[:120]


def result_header(row: FleetRow) -> dict[str, Any]:
    """Return the entries that say to which row a result belongs."""
    return {"schema": SCHEMA, "rig": row.rig, "date": row.date, "line": row.line, "since": None}


def result_from_diagnosis(answer: Mapping[str, Any]) -> dict[str, Any]:
    """Return the part of a diagnosis that a fleet stores."""
    last = next((s for s in reversed(answer["ladder"]) if s["add"] in answer["missing"]), answer["ladder"][0])
    named = {c["effect"]: c for c in answer["candidates"] if c["effect"] in answer["missing"]}
    effects = {f"{name}.{p}": value for name, c in named.items() for p, value in c["parameters"].items()}
    return {
        "verdict": answer["verdict"],
        "missing": answer["missing"],
        "error_train": answer["ladder"][0]["error_train"],
        "error_test": answer["ladder"][0]["error_test"],
        "error_after": last["error_train"] if last["error_test"] is None else last["error_test"],
        "parameters": answer["parameters"] | effects,
        "changes": answer.get("changes", []),
        "p_value": answer.get("since", {}).get("p_value"),
        "repeat": answer.get("since", {}).get("repeat"),
        "repeatability": answer.get("since", {}).get("repeatability"),
        "sentence": answer["sentence"],
    }
