"""A row's pipeline file, made from the template, and its stored result."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote

import tomlkit

from pneucli.errors import InputError, did_you_mean, environment_error
from pneucli.figure import Figure, named, read, to_json
from pneucli.fleet.table import FleetRow
from pneucli.io.remote_files import is_remote
from pneucli.io.result_store import Store
from pneucli.messages.diagnose import Answer, Change, Repeatability

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
        for wrong, keys in _unknown_keys(location, keys_at):
            raise InputError(
                f"{where}, column {column}", f'no key "{wrong}"', "", did_you_mean(wrong, keys), code="E081"
            )


def _unknown_keys(location: tuple[str, ...], keys_at: Any) -> Iterator[tuple[str, list[str]]]:
    for depth, name in enumerate(location):
        keys = keys_at(location[:depth])
        if keys and name not in keys:
            yield name, keys
            return


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
    first, since = answer.ladder[0], answer.since
    last = next((s for s in reversed(answer.ladder) if s.add in answer.missing), first)
    effects = {f"{c.effect}.{p}": value for c in answer.named for p, value in c.parameters.items()}
    return RowResult(
        schema=SCHEMA,
        **named(row, "rig date line"),
        **named(answer, "verdict missing sentence"),
        **named(first, "error_train error_test"),
        error_after=last.error_train if last.error_test is None else last.error_test,
        parameters={**(answer.parameters or {}), **effects},
        changes=answer.changes or (),
        **({} if since is None else named(since, "p_value repeat repeatability")),
        bad=answer.verdict == "inconclusive",
    )
