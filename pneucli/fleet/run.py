"""``fleet``: a pipeline for each row of a table, what changed in which rig, and the results of all."""

import math
import time
import tomllib
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

from pneucli import paths
from pneucli.changes.comparison import RepeatDifferences, VariancePrior, pool_priors
from pneucli.config import FleetConfig, keys_at
from pneucli.config.load import FleetTable
from pneucli.document import read_toml
from pneucli.errors import InputError
from pneucli.executors import Engine, Outcome, engine_from, run_jobs
from pneucli.fleet import row as fleet_row
from pneucli.fleet.row import Job, ProgramMismatchError
from pneucli.fleet.row_files import (
    COLUMNS,
    PART_FILE,
    TRENDS,
    FleetRow,
    RowResult,
    Trend,
    failure_result,
    parameter_trends,
    raw_file_names,
    read_results,
    read_rows,
    require_columns,
    row_pipeline,
    write_datasets,
    write_result,
    write_trends,
)
from pneucli.io.artifacts import Provenance, sha256_of
from pneucli.io.result_store import is_remote, mirror_folder, store_at
from pneucli.messages.fleet import Answer, Failures, HealthySpread, RigChanges, progress_text
from pneucli.pipeline.graph import NO_PROGRESS, Progress
from pneucli.pipeline.manifest import folder_lock, program_versions
from pneucli.quantities import Z95


def fleet_answer(
    settings: FleetTable, results: Sequence[RowResult], trends: Sequence[Trend], done: int, out: str, seconds: float
) -> Answer:
    """Return the answer that ``--json`` prints: counts, the rigs that changed, the failures by cause.

    ``done`` is the number of rows that this run processed in so many seconds, ``out`` the store of the results.
    """
    failures = Counter(str(r.cause) for r in results if r.failure is not None)
    changed = [RigChanges(r.rig, r.date, r.since or "", r.changes) for r in results if r.changes]
    return Answer(
        schema="pneucli/fleet/1",
        fleet=settings.name,
        rigs=len({r.rig for r in results}),
        rows=len(results),
        done=done,
        unchanged=len(results) - done,
        failed=sum(failures.values()),
        changed=len({c.rig for c in changed}),
        alarm_rate=settings.alarm_rate,
        repeatability=repeatability(settings.healthy, results),
        verdicts=Counter(r.verdict for r in results if r.verdict),
        missing=dict(Counter(name for r in results for name in r.missing).most_common()),
        changes=sorted(changed, key=lambda c: -max(one.confidence for one in c.changes)),
        failures=[Failures(cause, n) for cause, n in failures.most_common()],
        breaks=sum(bool(t.change_points) for t in trends),
        out=out,
        seconds=round(seconds, 2),
    )


def repeatability(dates: int, results: Sequence[RowResult]) -> HealthySpread | None:
    """Return the relative spread of each parameter between healthy dates, the median over the rigs."""
    last = {r.rig: (r, known) for r in results if (known := r.repeatability)}
    spreads: dict[str, list[float]] = {}
    for r, known in last.values():
        for name, one in known.parameters.items():
            if name in r.parameters and (value := r.parameters[name].value):
                spreads.setdefault(name, []).append(one.value / abs(value))
    parameters = {name: round(median(values), 5) for name, values in spreads.items()}
    return HealthySpread(len(last), dates, parameters) if last else None


def parameter_records(results: Sequence[RowResult]) -> Iterator[tuple[str, str, str, str, float, float]]:
    """Yield each parameter of each row: rig, date, name, unit, value, standard error."""
    for r in results:
        for name, p in r.parameters.items():
            if all(map(math.isfinite, (p.value, p.low, p.high))):
                yield r.rig, r.date, name, p.unit, p.value, (p.high - p.low) / (2.0 * Z95)


def run(
    config: FleetConfig,
    out: Path | str,
    executor: str | None = None,
    progress: Progress = NO_PROGRESS,
    notify: Callable[[str], None] = lambda message: None,
) -> dict[str, Any]:
    """Process all new and changed rows; write datasets, page, JUnit and metrics; return the answer of ``--json``.

    Args:
        config: The fleet file.
        out: A folder, or the URL of a folder on an S3-like store, which has no lock against a second client.
        executor: Where the rows are processed, as ``--executor`` states it.
        progress: Called after each row.
        notify: Called with messages for the user.

    Raises:
        InputError: The fleet file, the table or the template is at fault, or the executor cannot work.

    """
    fleet = Fleet(config, out)
    with folder_lock(Path(out), notify) if fleet.store.folder is not None else nullcontext():
        begun = time.monotonic()
        if fleet.queue_pending():
            with engine_from(executor, program_versions, preload=fleet_row.__name__) as engine:
                fleet.process_queue(engine, progress)
        return _write_results(fleet, time.monotonic() - begun)


class Fleet:
    """The rows of a fleet, their results, and the order in which they are processed.

    A rig's first date that does not fail becomes its baseline; the later dates are compared with it. Where healthy
    dates are stated, they are processed first, because they say by how much rigs of this kind repeat.
    """

    def __init__(self, config: FleetConfig, out: Path | str) -> None:
        self.config, self.out, self.store = config, str(out), store_at(str(out))
        folder = config.path.parent
        where = str(config.path)
        self.template = paths.expand_path(config.fleet.template, folder, f"{where}, key fleet.template")
        self.table = paths.expand_path(config.fleet.table, folder, f"{where}, key fleet.table")
        self.text, document = read_toml(self.template)
        self.rows = read_rows(self.table)
        columns = dict.fromkeys(name for row in self.rows for name in row.values)
        require_columns(document, columns, keys_at, str(self.table))
        self.program = program_versions()
        self.previous_results: Mapping[tuple[str, str], RowResult] = {}
        self.results: dict[tuple[str, str], RowResult] = {}
        self.job_queue: deque[Job] = deque()
        self.rigs: dict[str, deque[FleetRow]] = {}
        for row in sorted(self.rows, key=lambda r: (r.rig, r.date)):
            self.rigs.setdefault(row.rig, deque()).append(row)
        number = config.fleet.healthy
        self.healthy = {rig: [r.key for r in [*rows][:number]] for rig, rows in self.rigs.items()} if number > 1 else {}
        self.pending_healthy = {key for keys in self.healthy.values() for key in keys}
        self.has_repeatability = not self.pending_healthy
        self.prior: Mapping[str, VariancePrior] = {}
        self.reference_rows: dict[str, FleetRow] = {}
        self.done_count = self.updated_count = 0

    def queue_pending(self) -> bool:
        """Fill ``job_queue`` with the rows that can be processed now; return whether there are any."""
        self.previous_results = read_results(self.store, self.rows)
        for rig in self.rigs:
            self._schedule_rig(rig)
        self._estimate_repeatability_once()
        return bool(self.job_queue)

    def _estimate_repeatability_once(self) -> None:
        """Estimate from the healthy dates how well rigs of this kind repeat; then schedule all other dates."""
        if self.has_repeatability or self.pending_healthy:
            return
        self.has_repeatability, self.prior = True, pool_priors(map(self._healthy_repeats, self.rigs))
        for rig in self.rigs:
            self._schedule_rig(rig)

    def _schedule_rig(self, rig: str) -> None:
        """Queue a rig's dates one by one until one of them can be the baseline, then all the others."""
        waiting = self.rigs[rig]
        while waiting:
            if not self.has_repeatability and waiting[0].key not in self.healthy[rig]:
                return  # until the repeatability of rigs of this kind is estimated
            job = self._make_job(waiting.popleft())
            result = self._cached_result(job)
            if result is None:
                self.job_queue.append(job)
                if rig not in self.reference_rows:
                    return
            else:
                self._store_result(job, result)

    def _store_result(self, job: Job, result: RowResult) -> None:
        """Store a result; a rig's first usable one is its baseline."""
        self.results[job.row.key] = result
        self.pending_healthy.discard(job.row.key)
        self.done_count += 1
        if job.row.rig not in self.reference_rows and not result.bad:
            self.reference_rows[job.row.rig] = job.row

    def _healthy_repeats(self, rig: str) -> tuple[RepeatDifferences, ...]:
        """Return the differences between the healthy dates of a rig and its baseline."""
        first = self.reference_rows.get(rig)
        done = [self.results[key] for key in self.healthy.get(rig, []) if key in self.results]
        return tuple(r.repeat for r in done if first is not None and r.since == first.date and r.repeat)

    def _make_job(self, row: FleetRow) -> Job:
        first = self.reference_rows.get(row.rig)
        stated = row.key in self.healthy.get(row.rig, ())
        repeats = () if first is None or stated else self._healthy_repeats(row.rig)
        try:
            text = row_pipeline(self.text, row, (self.template.parent, self.table.parent))
        except (InputError, KeyError, TypeError, ValueError, StopIteration) as error:
            row, text = replace(row, fault=row.fault or f"its values do not fit the template: {error}"), ""
        return Job(
            self.out,
            row,
            text,
            reference_date=None if first is None else first.date,
            reference_key="" if first is None else str(self.results[first.key].key),
            alarm_rate=self.config.fleet.alarm_rate,
            reports=self.config.fleet.reports,
            store_reference=first is None,
            stated_healthy=stated,
            repeats=repeats,
            prior=self.prior if repeats else None,
            program=self.program,
            plugins=self._plugins(text),
        )

    def _plugins(self, text: str) -> dict[str, str]:
        named = tomllib.loads(text).get("model", {}).get("plugins", []) if "plugins" in text else []
        files = [
            hit
            for name in named
            for hit in paths.matching_files_or_path(str(name), self.template.parent, str(self.template))
        ]
        return {str(path): sha256_of(path) for path in files if path.is_file()}

    def _cached_result(self, job: Job) -> RowResult | None:
        """Return the stored result of an unchanged row; None for remote files, whose state only a worker asks."""
        if job.row.fault:
            return failure_result(job.row, InputError(f"line {job.row.line} of the table", job.row.fault, code="E081"))
        former = self.previous_results.get(job.row.key)
        if former is None or former.again or any(map(is_remote, raw_file_names(tomllib.loads(job.text)))):
            return None
        return former if former.stamp == fleet_row.input_stamp(job) else None

    def process_queue(self, engine: Engine, progress: Progress) -> None:
        """Process the queued rows, and those that become ready while it runs."""
        self._report_progress(progress)
        for outcome in run_jobs(engine, fleet_row.process_row, self.job_queue):
            self._store_result(outcome.job, self._result(outcome))
            self.updated_count += not self.results[outcome.job.row.key].same
            self._schedule_rig(outcome.job.row.rig)
            self._estimate_repeatability_once()
            self._report_progress(progress)

    def _report_progress(self, progress: Progress) -> None:
        failed = sum(r.failure is not None for r in self.results.values())
        progress(progress_text(self.done_count, len(self.rows), failed), self.done_count / len(self.rows))

    def _result(self, outcome: Outcome[Job]) -> RowResult:
        if outcome.error is None:
            result: RowResult = outcome.result
            return result
        if isinstance(outcome.error, ProgramMismatchError):
            mend = "install the same on client and workers, then give the same command again"
            raise InputError(
                "--executor", f"a worker differs: {outcome.error}", "the client's program", mend, code="E080"
            )
        result = failure_result(outcome.job.row, outcome.error)
        write_result(self.store, outcome.job.row, result)
        return result

    def results_in_table_order(self) -> list[RowResult]:
        """Return the results in the table's order."""
        return [self.results[row.key] for row in self.rows]

    @contextmanager
    def output_folder(self) -> Iterator[Path]:
        """Yield the folder of the files about all rows; a remote store is updated from it at the end."""
        if self.store.folder is not None:
            yield self.store.folder
            return
        with TemporaryDirectory(prefix="pneucli-fleet-") as folder:
            yield Path(folder)
            mirror_folder(Path(folder), self.store, dict.fromkeys(COLUMNS, PART_FILE))

    def trends(self) -> list[Trend]:
        """Return each parameter over its rig's dates."""
        return parameter_trends(list(parameter_records(self.results_in_table_order())))


def _write_results(fleet: Fleet, seconds: float) -> dict[str, Any]:
    from pneucli.fleet.output import write_outputs  # noqa: PLC0415 - jinja takes a moment

    results, trends = fleet.results_in_table_order(), fleet.trends()
    inputs = {"table": sha256_of(fleet.table), "template": sha256_of(fleet.template)}
    made_of = Provenance(inputs, {"fleet": fleet.config.fleet.model_dump()})
    found = fleet_answer(fleet.config.fleet, results, trends, fleet.updated_count, str(fleet.store), seconds)
    with fleet.output_folder() as out:
        write_datasets(out, results, made_of)
        write_trends(out / TRENDS, trends, made_of)
        return write_outputs(out, fleet.config, found, results, trends)
