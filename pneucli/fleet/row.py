"""One row of a fleet, done where its data are: a pipeline of its own, in a folder that goes when it is done."""

from __future__ import annotations

import json
import re
import tempfile
import time
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import tomlkit

from pneucli.changes.repeatability import RepeatDifferences, VariancePrior
from pneucli.errors import InputError, environment_error
from pneucli.fleet.row_pipelines import folder_name, raw_file_names
from pneucli.fleet.table import FleetRow
from pneucli.io import remote_files
from pneucli.io.artifacts import sha256_of
from pneucli.io.result_store import Store, store_at
from pneucli.pipeline.graph import STAGES
from pneucli.pipeline.manifest import MANIFEST_FILE as MANIFEST
from pneucli.pipeline.manifest import digest, program_digest, program_versions
from pneucli.pipeline.runner import Pipeline, open_pipeline
from pneucli.stages import changes, diagnose, ingest
from pneucli.stages.pipeline_data import MODEL_FILE
from pneucli.stages.pipeline_file import load_pipeline_file

SCHEMA = "pneucli/fleet-row/1"
RESULT, PIPELINE, REFERENCE, REPORT = "row.json", "pipeline.toml", "reference", "report.html"
ROWS = "rows"
EMPTY_RESULT: Mapping[str, Any] = {
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
# what a fleet asks of a rig's own report: no controllers
PRELOADED_STAGES = (ingest, diagnose)  # with this module, so that a worker that is forked from it has them
ROW_STAGES = STAGES | {"report": replace(STAGES["report"], optional=("diagnose",))}


@dataclass(frozen=True)
class Job:
    """One row to be done into ``out``, a folder or a URL; ``text`` is its pipeline.

    ``reference_date`` is the date it is held against, ``reference_key`` tells which result of that date, ``program`` and
    ``plugins`` (SHA-256 by path) what the client has. Where ``store_reference`` is set, later dates are held against this one.
    A ``stated_healthy`` date is stated to be so: nothing is named there. ``repeats`` are what such dates said of the first
    one, ``prior`` what those of all rigs say together.
    """

    out: str
    row: FleetRow
    text: str
    reference_date: str | None = None
    reference_key: str = ""
    alarm_rate: float = 1e-3
    reports: str = "changed"
    store_reference: bool = False
    stated_healthy: bool = False
    repeats: tuple[RepeatDifferences, ...] = ()
    prior: Mapping[str, VariancePrior] | None = None
    program: Mapping[str, str] = field(default_factory=dict)
    plugins: Mapping[str, str] = field(default_factory=dict)

    @property
    def store(self) -> Store:
        """Where the fleet's results are."""
        return store_at(self.out)

    @property
    def folder(self) -> str:
        """The row's own folder in the store."""
        return row_folder(self.row)

    @property
    def dependencies(self) -> list[Any]:
        """All that the result depends on, but the files."""
        settings: list[Any] = [
            self.reference_date,
            self.reference_key,
            self.alarm_rate,
            self.reports,
            self.store_reference,
        ]
        settings += [self.stated_healthy, self.repeats, self.prior]
        return [program_digest(), self.text, dict(self.plugins), settings]


class ProgramMismatchError(Exception):
    """Raised by a worker that does not run the client's program or plug-ins."""


def row_folder(row: FleetRow) -> str:
    """Return the folder of a row, below that of the fleet."""
    return f"{ROWS}/{folder_name(row.rig)}/{folder_name(row.date)}"


def read_result(store: Store, row: FleetRow) -> dict[str, Any] | None:
    """Return what is known of a row; None where it was never done, or by another version."""
    return parse_result(store.read(f"{row_folder(row)}/{RESULT}"))


def read_results(store: Store, rows: Sequence[FleetRow]) -> dict[tuple[str, str], dict[str, Any]]:
    """Return what is known of several rows, by rig and date."""
    names = {row.key: f"{row_folder(row)}/{RESULT}" for row in rows if not row.fault}
    content = store.read_all(names.values())
    found = {key: parse_result(content[name]) for key, name in names.items()}
    return {key: result for key, result in found.items() if result is not None}


def parse_result(content: bytes | None) -> dict[str, Any] | None:
    """Return the result that a row's file holds; None where it holds none that this version wrote."""
    try:
        result: dict[str, Any] = json.loads(content or b"")
    except ValueError:
        return None
    return result if result.get("schema") == SCHEMA else None


def write_result(store: Store, row: FleetRow, result: Mapping[str, Any]) -> None:
    """Write what became of a row, atomically."""
    store.write(f"{row_folder(row)}/{RESULT}", json.dumps(result, allow_nan=False))


def input_stamp(job: Job) -> str:
    """Return a digest of all that a row's result depends on, its files by size and time: nothing is read.

    Raises InputError where a remote file does not answer.
    """
    stamps = {name: _stamp(name) for name in raw_file_names(tomllib.loads(job.text))}
    return digest([job.dependencies, stamps])


def _stamp(name: str) -> str:
    if remote_files.is_remote(name):
        return remote_files.content_stamp(name)
    try:
        status = Path(name).stat()
    except OSError:  # a glob, a variable, or no such file
        return _glob_stamp(name)
    return f"{status.st_size} {status.st_mtime_ns}"


def _glob_stamp(name: str) -> str:
    path = Path(name)
    try:
        return " ".join(f"{p} {p.stat().st_size} {p.stat().st_mtime_ns}" for p in sorted(path.parent.glob(path.name)))
    except (OSError, ValueError, NotImplementedError):
        return ""


def process_row(job: Job) -> dict[str, Any]:
    """Do one row, write its result into its folder and return it; what goes wrong with the row is its failure.

    Raises OtherProgram where this worker runs something else than the client.
    """
    require_same_program(job)
    begun, used = time.perf_counter(), time.process_time()
    with tempfile.TemporaryDirectory(prefix="pneucli-fleet-") as scratch:
        try:
            result = _process(job, Path(scratch))
        except Exception as error:  # one row must not stop the others
            result = failure_result(job.row, error) | {"stamp": _stamp_or_none(job)}
    if result.get("same"):
        return result
    result["seconds"] = round(time.perf_counter() - begun, 3)
    result["core_seconds"] = round(
        time.process_time() - used, 3
    )  # of this process: of this row, where it does one at a time
    write_result(job.store, job.row, result)
    return result


def _stamp_or_none(job: Job) -> str | None:
    try:
        return input_stamp(job)
    except InputError:
        return None


def require_same_program(job: Job) -> None:
    """Raise OtherProgram where program or plug-ins here are not those of the client."""
    here = program_versions()
    differ = [
        f"{what} is {here.get(what)}, not {there}" for what, there in job.program.items() if here.get(what) != there
    ]
    for path, sha in job.plugins.items():
        mine = sha256_of(path) if Path(path).is_file() else "not there"
        differ += [f"the plug-in {path} is {mine[:12]}, not {sha[:12]}"] if mine != sha else []
    if differ:
        raise ProgramMismatchError("; ".join(differ))


def failure_result(row: FleetRow, error: BaseException) -> dict[str, Any]:
    """Return the result of a row that failed. What may have been chance, or the surroundings, is tried again."""
    refusal = environment_error(error) if isinstance(error, OSError | MemoryError) else None
    told = refusal or error
    text = str(told) if isinstance(told, InputError) else f"fault of the program: {type(error).__name__}: {error}"
    said = told.found if isinstance(told, InputError) else type(error).__name__
    again = not isinstance(error, InputError)
    return _result_header(row) | {
        **EMPTY_RESULT,
        "failure": text,
        "cause": failure_cause(said),
        "again": again,
        "bad": True,
    }


def failure_cause(text: str) -> str:
    """Return what is common to like failures: a message without its names, paths and numbers."""
    text = re.sub(r"\"[^\"]*\"|'[^']*'", '"…"', text.splitlines()[0] if text else "unknown")
    text = re.sub(r"\S*/\S+", "…", text)
    return re.sub(r"[-+]?\d[\d.,e+-]*", "#", text)[:120]


def _result_header(row: FleetRow) -> dict[str, Any]:
    return {"schema": SCHEMA, "rig": row.rig, "date": row.date, "line": row.line, "since": None}


def _process(job: Job, scratch: Path) -> dict[str, Any]:
    if job.row.fault:
        raise InputError(f"line {job.row.line} of the table", job.row.fault)
    stamp, (text, hashes) = input_stamp(job), _fetch_inputs(job, scratch)
    key = digest([job.dependencies, hashes])
    former = read_result(job.store, job.row)
    if former is not None and former.get("key") == key and not former.get("again"):
        write_result(job.store, job.row, former | {"stamp": stamp})  # its files were touched, not changed
        return former | {"stamp": stamp, "same": True}
    file = scratch / PIPELINE
    file.write_text(text, encoding="utf-8")
    pipeline = open_pipeline(file, load_pipeline_file, scratch / "artifacts", ROW_STAGES)
    answer = dict(pipeline.update(["diagnose"], {"diagnose": _options(job, scratch)})["diagnose"].answer)
    if job.stated_healthy:
        answer["changes"] = []
    _store_row_files(job, pipeline)
    result = (
        _result_header(job.row)
        | _result_from_diagnosis(answer)
        | {"since": job.reference_date, "program": program_digest(), "failure": None}
    )
    result |= {"report": _write_report(job, pipeline, answer), "cause": None, "again": False}
    return result | {"bad": answer["verdict"] == "inconclusive", "stamp": stamp, "key": key}


def _options(job: Job, scratch: Path) -> dict[str, Any]:
    if job.reference_date is None:
        return {}
    old = job.store.local_copy(f"{row_folder(replace(job.row, date=job.reference_date))}/{REFERENCE}", scratch)
    return changes.baseline_options(old, job.alarm_rate, job.repeats, job.prior)


def _fetch_inputs(job: Job, scratch: Path) -> tuple[str, dict[str, str]]:
    """Return the pipeline with its remote files fetched, and the SHA-256 of each file by the name that it has there."""
    document = tomlkit.parse(job.text)
    hashes: dict[str, str] = {}
    tables: Any = document.get("recordings", [])
    for number, one in enumerate(one for table in tables for one in (table, *table.get("more", []))):
        name = str(one["file"])
        if remote_files.is_remote(name):
            folder = scratch / "raw" / str(number)
            folder.mkdir(parents=True)
            one["file"] = str(remote_files.fetch(name, folder))
        path = Path(str(one["file"]))
        found = [path] if path.is_file() else sorted(path.parent.glob(path.name)) if "*" in path.name else []
        hashes |= {f"{name} {hit.name}": sha256_of(hit) for hit in found}
    return tomlkit.dumps(document), hashes


def _store_row_files(job: Job, pipeline: Pipeline) -> None:
    """Keep the row's pipeline file, and what later dates are held against."""
    job.store.write(f"{job.folder}/{PIPELINE}", job.text)
    for name in (changes.REFERENCE_FILE, MODEL_FILE, MANIFEST) if job.store_reference else ():
        job.store.copy_file(f"{job.folder}/{REFERENCE}/{name}", pipeline.artifacts / "diagnose" / name)


def _result_from_diagnosis(answer: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a fleet keeps of a diagnosis."""
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


def _write_report(job: Job, pipeline: Pipeline, answer: Mapping[str, Any]) -> str | None:
    """Make the rig's own report where one is asked for; return its path below the fleet's folder."""
    if job.reports == "none" or (job.reports == "changed" and not answer.get("changes")):
        return None
    pipeline.update(["report"])
    job.store.copy_file(f"{job.folder}/{REPORT}", pipeline.artifacts / "report" / REPORT)
    return f"{job.folder}/{REPORT}"
