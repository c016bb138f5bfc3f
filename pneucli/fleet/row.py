"""One row of a fleet, processed where its data are: its own pipeline in a temporary folder."""

import tempfile
import time
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import tomlkit

from pneucli.changes.comparison import RepeatDifferences, VariancePrior
from pneucli.errors import InputError
from pneucli.figure import read
from pneucli.fleet.row_files import (
    FleetRow,
    RowResult,
    failure_result,
    raw_file_names,
    read_result,
    result_from_diagnosis,
    row_folder,
    write_result,
)
from pneucli.io.artifacts import sha256_of
from pneucli.io.result_store import Store, content_stamp, fetch, is_remote, store_at
from pneucli.messages.diagnose import Answer
from pneucli.pipeline.graph import STAGES
from pneucli.pipeline.manifest import MANIFEST_FILE as MANIFEST
from pneucli.pipeline.manifest import digest, program_digest, program_versions
from pneucli.pipeline.runner import Pipeline, open_pipeline
from pneucli.stages import changes, diagnose, ingest
from pneucli.stages.changes import REFERENCE_FILE
from pneucli.stages.pipeline_data import MODEL_FILE
from pneucli.stages.pipeline_file import load_pipeline_file

PIPELINE, REFERENCE, REPORT = "pipeline.toml", "reference", "report.html"
PRELOADED_STAGES = (ingest, diagnose)  # imported with this module, so that forked workers have them
# a rig's own report has no controllers
ROW_STAGES = STAGES | {"report": replace(STAGES["report"], optional=("diagnose",))}


@dataclass(frozen=True)
class Job:
    """One row to be processed.

    Attributes:
        out: The store of the fleet, a folder or a URL.
        row: The row of the table.
        text: The row's pipeline file.
        reference_date: The date that this one is compared with; None for the first.
        reference_key: The digest of that date's inputs.
        alarm_rate: The accepted rate of false alarms.
        reports: Which rigs get a report of their own.
        store_reference: Whether later dates are compared with this one.
        stated_healthy: Whether the fleet file states that the rig was healthy; no change is reported then.
        repeats: The differences between the healthy dates and the first one.
        prior: The repeatability of all rigs together.
        program: The versions that the client runs.
        plugins: The SHA-256 of each plug-in of the client, by path.

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
        """The store of the fleet's results."""
        return store_at(self.out)

    @property
    def folder(self) -> str:
        """The row's own folder in the store."""
        return row_folder(self.row)

    @property
    def dependencies(self) -> list[Any]:
        """Everything that the result depends on, except the files."""
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
    """A worker runs another program, or other plug-ins, than the client."""


def input_stamp(job: Job) -> str:
    """Return a digest of everything that a row's result depends on; files count by size and time, unread.

    Raises InputError where a remote file does not answer.
    """
    stamps = {name: _stamp(name) for name in raw_file_names(tomllib.loads(job.text))}
    return digest([job.dependencies, stamps])


def _stamp(name: str) -> str:
    if is_remote(name):
        return content_stamp(name)
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


def process_row(job: Job) -> RowResult:
    """Process one row, write its result into its folder and return it; an error becomes the row's failure.

    Raises ProgramMismatchError where this worker runs another program than the client.
    """
    require_same_program(job)
    begun, used = time.perf_counter(), time.process_time()
    with tempfile.TemporaryDirectory(prefix="pneucli-fleet-") as scratch:
        try:
            result = _process(job, Path(scratch))
        except Exception as error:  # one row must not stop the others
            result = replace(failure_result(job.row, error), stamp=_stamp_or_none(job))
    if result.same:
        return result
    result = replace(
        result,
        seconds=round(time.perf_counter() - begun, 3),
        core_seconds=round(time.process_time() - used, 3),  # of the process, which runs one row at a time
    )
    write_result(job.store, job.row, result)
    return result


def _stamp_or_none(job: Job) -> str | None:
    try:
        return input_stamp(job)
    except InputError:
        return None


def require_same_program(job: Job) -> None:
    """Raise ProgramMismatchError where program or plug-ins here are not those of the client."""
    own = program_versions()
    differences = [
        f"{what} is {own.get(what)}, not {version}" for what, version in job.program.items() if own.get(what) != version
    ]
    for path, sha in job.plugins.items():
        own_sha = sha256_of(path) if Path(path).is_file() else "not there"
        differences += [f"the plug-in {path} is {own_sha[:12]}, not {sha[:12]}"] if own_sha != sha else []
    if differences:
        raise ProgramMismatchError("; ".join(differences))


def _process(job: Job, scratch: Path) -> RowResult:
    if job.row.fault:
        raise InputError(f"line {job.row.line} of the table", job.row.fault, code="E081")
    stamp, (text, hashes) = input_stamp(job), _fetch_inputs(job, scratch)
    key = digest([job.dependencies, hashes])
    former = read_result(job.store, job.row)
    if former is not None and former.key == key and not former.again:
        write_result(job.store, job.row, replace(former, stamp=stamp))  # only the times of its files changed
        return replace(former, stamp=stamp, same=True)
    file = scratch / PIPELINE
    file.write_text(text, encoding="utf-8")
    pipeline = open_pipeline(file, load_pipeline_file, scratch / "artifacts", ROW_STAGES)
    answer = read(Answer, pipeline.update(["diagnose"], {"diagnose": _options(job, scratch)})["diagnose"].answer)
    if job.stated_healthy:
        answer = replace(answer, changes=[])
    _store_row_files(job, pipeline)
    return replace(
        result_from_diagnosis(job.row, answer),
        since=job.reference_date,
        report=_write_report(job, pipeline, changed=bool(answer.changes)),
        program=program_digest(),
        stamp=stamp,
        key=key,
    )


def _options(job: Job, scratch: Path) -> dict[str, Any]:
    if job.reference_date is None:
        return {"baseline": True} if job.store_reference else {}
    old = job.store.local_copy(f"{row_folder(replace(job.row, date=job.reference_date))}/{REFERENCE}", scratch)
    return changes.baseline_options(old, job.alarm_rate, job.repeats, job.prior)


def _fetch_inputs(job: Job, scratch: Path) -> tuple[str, dict[str, str]]:
    """Return the pipeline with its remote files fetched, and the SHA-256 of each file by its name in the pipeline."""
    document = tomlkit.parse(job.text)
    hashes: dict[str, str] = {}
    tables: Any = document.get("recordings", [])
    for number, one in enumerate(one for table in tables for one in (table, *table.get("more", []))):
        name = str(one["file"])
        if is_remote(name):
            folder = scratch / "raw" / str(number)
            folder.mkdir(parents=True)
            one["file"] = str(fetch(name, folder))
        path = Path(str(one["file"]))
        matches = [path] if path.is_file() else sorted(path.parent.glob(path.name)) if "*" in path.name else []
        hashes |= {f"{name} {match.name}": sha256_of(match) for match in matches}
    return tomlkit.dumps(document), hashes


def _store_row_files(job: Job, pipeline: Pipeline) -> None:
    """Store the row's pipeline file and, for the first date, the baseline of later comparisons."""
    job.store.write(f"{job.folder}/{PIPELINE}", job.text)
    for name in (REFERENCE_FILE, MODEL_FILE, MANIFEST) if job.store_reference else ():
        job.store.copy_file(f"{job.folder}/{REFERENCE}/{name}", pipeline.artifacts / "diagnose" / name)


def _write_report(job: Job, pipeline: Pipeline, *, changed: bool) -> str | None:
    """Make the rig's own report where one is asked for; return its path below the fleet's folder."""
    if job.reports == "none" or (job.reports == "changed" and not changed):
        return None
    pipeline.update(["report"])
    job.store.copy_file(f"{job.folder}/{REPORT}", pipeline.artifacts / "report" / REPORT)
    return f"{job.folder}/{REPORT}"
