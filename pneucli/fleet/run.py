"""``fleet``: a pipeline for each row of a table, what changed in which rig, and the results of all."""

from __future__ import annotations

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
from pneucli.changes.repeatability import Prior, Repeat, pooled
from pneucli.config import FleetConfig, keys_at
from pneucli.document import read
from pneucli.errors import InputError
from pneucli.executors import Engine, Outcome, engine_from, stream
from pneucli.fleet import row as fleet_row
from pneucli.fleet.dataset import COLUMNS, PART, TRENDS, write_datasets, write_trends
from pneucli.fleet.row import Job, OtherProgram, failed, read_results, write_result
from pneucli.fleet.row_pipelines import files_of, pipeline_of, require_columns
from pneucli.fleet.table import Row, read_rows
from pneucli.fleet.trends import Trend, trends_of
from pneucli.io.artifacts import Provenance, sha256_of
from pneucli.io.remote_files import is_remote
from pneucli.io.result_store import Folder, mirror, store_at
from pneucli.pipeline import lock
from pneucli.pipeline.context import Progress, silent
from pneucli.pipeline.manifest import identity

Z95 = 1.959964
Result = Mapping[str, Any]


def run(
    config: FleetConfig,
    out: Path | str,
    executor: str | None = None,
    progress: Progress = silent,
    say: Callable[[str], None] = lambda message: None,
) -> dict[str, Any]:
    """Do all rows that are new or changed, write datasets, page, JUnit and metrics; return the answer of ``--json``.

    ``out`` is a folder, or the URL of one on an S3-like store, which has no lock against a second client.

    Raises InputError where fleet file, table or template are at fault as a whole, or the executor cannot work.
    """
    fleet = Fleet(config, out)
    with lock.held(Path(out), say) if isinstance(fleet.store, Folder) else nullcontext():
        begun = time.monotonic()
        if fleet.lacking():
            with engine_from(executor, identity, preload=fleet_row.__name__) as engine:
                fleet.do(engine, progress)
        return _written(fleet, time.monotonic() - begun)


class Fleet:
    """The rows of a fleet, what is known of each, and in which order they are done."""

    def __init__(self, config: FleetConfig, out: Path | str) -> None:
        self.config, self.out, self.store = config, str(out), store_at(str(out))
        folder = config.path.parent
        where = str(config.path)
        self.template = paths.expand(config.fleet.template, folder, f"{where}, key fleet.template")
        self.table = paths.expand(config.fleet.table, folder, f"{where}, key fleet.table")
        self.text, document = read(self.template)
        self.rows = read_rows(self.table)
        columns = dict.fromkeys(name for row in self.rows for name in row.values)
        require_columns(document, columns, keys_at, str(self.table))
        self.program = identity()
        self.former: Mapping[tuple[str, str], Result] = {}
        self.results: dict[tuple[str, str], Result] = {}
        self.ready: deque[Job] = deque()
        self.rigs: dict[str, deque[Row]] = {}
        for row in sorted(self.rows, key=lambda r: (r.rig, r.date)):
            self.rigs.setdefault(row.rig, deque()).append(row)
        number = config.fleet.healthy
        self.healthy = {rig: [r.key for r in [*rows][:number]] for rig, rows in self.rigs.items()} if number > 1 else {}
        self.unknown = {key for keys in self.healthy.values() for key in keys}
        self.learned = not self.unknown
        self.prior: Mapping[str, Prior] = {}
        self.references: dict[str, Row] = {}
        self.done = self.renewed = 0

    def lacking(self) -> bool:
        """Fill ``ready`` with what can be done now; whether there is anything at all to do."""
        self.former = read_results(self.store, self.rows)
        for rig in self.rigs:
            self._next(rig)
        self._learn_once()
        return bool(self.ready)

    def _learn_once(self) -> None:
        """Take from the dates that are stated to be healthy how well rigs of this kind repeat, and go on with all."""
        if self.learned or self.unknown:
            return
        self.learned, self.prior = True, pooled(map(self._repeats, self.rigs))
        for rig in self.rigs:
            self._next(rig)

    def _next(self, rig: str) -> None:
        """Go on with a rig: its dates one by one until one is not bad, then all the others against that one."""
        waiting = self.rigs[rig]
        while waiting:
            if not self.learned and waiting[0].key not in self.healthy[rig]:
                return  # how well rigs of this kind repeat is not known yet
            job = self._job(waiting.popleft())
            result = self._known(job)
            if result is None:
                self.ready.append(job)
                if rig not in self.references:
                    return
            else:
                self._take(job, result)

    def _take(self, job: Job, result: Result) -> None:
        """Note a result; the first of a rig that is not bad is what its other dates are held against."""
        self.results[job.row.key] = result
        self.unknown.discard(job.row.key)
        self.done += 1
        if job.row.rig not in self.references and not result["bad"]:
            self.references[job.row.rig] = job.row

    def _repeats(self, rig: str) -> tuple[Repeat, ...]:
        """Return what the dates of a rig that are stated to be healthy said of its first one."""
        first = self.references.get(rig)
        known = [self.results[key] for key in self.healthy.get(rig, []) if key in self.results]
        return tuple(r["repeat"] for r in known if first is not None and r["since"] == first.date and r.get("repeat"))

    def _job(self, row: Row) -> Job:
        first = self.references.get(row.rig)
        stated = row.key in self.healthy.get(row.rig, ())
        repeats = () if first is None or stated else self._repeats(row.rig)
        try:
            text = pipeline_of(self.text, row, (self.template.parent, self.table.parent))
        except (InputError, KeyError, TypeError, ValueError, StopIteration) as error:
            row, text = replace(row, fault=row.fault or f"its values do not fit the template: {error}"), ""
        return Job(
            self.out,
            row,
            text,
            since=None if first is None else first.date,
            reference_key="" if first is None else str(self.results[first.key].get("key")),
            alarm_rate=self.config.fleet.alarm_rate,
            reports=self.config.fleet.reports,
            keeps=first is None,
            healthy=stated,
            repeats=repeats,
            prior=self.prior if repeats else None,
            program=self.program,
            plugins=self._plugins(text),
        )

    def _plugins(self, text: str) -> dict[str, str]:
        named = tomllib.loads(text).get("model", {}).get("plugins", []) if "plugins" in text else []
        files = [hit for name in named for hit in paths.named(str(name), self.template.parent, str(self.template))]
        return {str(path): sha256_of(path) for path in files if path.is_file()}

    def _known(self, job: Job) -> Result | None:
        """Return what is known of a row, where nothing has changed since; what is remote its worker must ask."""
        if job.row.fault:
            result = failed(job.row, InputError(f"line {job.row.line} of the table", job.row.fault))
            return result | {"seconds": 0.0}
        former = self.former.get(job.row.key)
        if former is None or former.get("again") or any(map(is_remote, files_of(tomllib.loads(job.text)))):
            return None
        return former if former.get("stamp") == fleet_row.stamp_of(job) else None

    def do(self, engine: Engine, progress: Progress) -> None:
        """Do what is ready, and what becomes so."""
        begun, before = time.monotonic(), self.done
        for outcome in stream(engine, fleet_row.work, self.ready):
            self._take(outcome.job, self._result(outcome))
            self.renewed += not self.results[outcome.job.row.key].get("same")
            self._next(outcome.job.row.rig)
            self._learn_once()
            share = self.done / len(self.rows)
            left = (time.monotonic() - begun) * (len(self.rows) - self.done) / max(self.done - before, 1)
            bad = sum(r["failure"] is not None for r in self.results.values())
            progress(f"{self.done} of {len(self.rows)} rows, {bad} failed, about {_duration(left)} to go", share)

    def _result(self, outcome: Outcome[Job]) -> Result:
        if outcome.error is None:
            result: Result = outcome.result
            return result
        if isinstance(outcome.error, OtherProgram):
            mend = "install the same on client and workers, then give the same command again"
            raise InputError("--executor", f"a worker differs: {outcome.error}", "the client's program", mend)
        result = failed(outcome.job.row, outcome.error) | {"seconds": 0.0}
        write_result(self.store, outcome.job.row, result)
        return result

    def ordered(self) -> list[Result]:
        """Return the results in the table's order."""
        return [self.results[row.key] for row in self.rows]

    @contextmanager
    def written(self) -> Iterator[Path]:
        """Yield the folder into which all is written that tells of all rows; a store is made like it in the end."""
        if isinstance(self.store, Folder):
            yield self.store.path
            return
        with TemporaryDirectory(prefix="pneucli-fleet-") as folder:
            yield Path(folder)
            mirror(Path(folder), self.store, dict.fromkeys(COLUMNS, PART))

    def trends(self) -> list[Trend]:
        """Return each parameter over its rig's dates."""
        return trends_of(list(_records(self.ordered())))


def _records(results: Sequence[Result]) -> Iterator[tuple[str, str, str, str, float, float]]:
    for r in results:
        for name, p in r["parameters"].items():
            low, high = p["ci95"]
            if None not in (p["value"], low, high):
                yield r["rig"], r["date"], name, p["unit"], p["value"], (high - low) / (2.0 * Z95)


def _duration(seconds: float) -> str:
    return f"{seconds / 60:.0f} min" if seconds > 90 else f"{seconds:.0f} s"


def _written(fleet: Fleet, seconds: float) -> dict[str, Any]:
    from pneucli.fleet.output import write  # noqa: PLC0415 - jinja takes a moment

    results, trends = fleet.ordered(), fleet.trends()
    made_of = Provenance({"table": sha256_of(fleet.table), "template": sha256_of(fleet.template)}, _asked(fleet))
    answer = answer_of(fleet, results, trends) | {"seconds": round(seconds, 2)}
    with fleet.written() as out:
        write_datasets(out, results, made_of)
        write_trends(out / TRENDS, trends, made_of)
        write(out, fleet.config, answer, results, trends)
    return answer


def _asked(fleet: Fleet) -> dict[str, Any]:
    return {"fleet": fleet.config.fleet.model_dump()}


def answer_of(fleet: Fleet, results: Sequence[Result], trends: Sequence[Trend]) -> dict[str, Any]:
    """Return the answer that ``--json`` prints: counts, who changed, who failed and why."""
    failures = Counter(str(r["cause"]) for r in results if r["failure"] is not None)
    changed = [{"rig": r["rig"], "date": r["date"], "since": r["since"], "changes": r["changes"]}
               for r in results if r["changes"]]  # fmt: skip
    return {
        "schema": "pneucli/fleet/1",
        "fleet": fleet.config.fleet.name,
        "rigs": len(fleet.rigs),
        "rows": len(results),
        "done": fleet.renewed,
        "unchanged": len(results) - fleet.renewed,
        "failed": sum(failures.values()),
        "changed": len({c["rig"] for c in changed}),
        "alarm_rate": fleet.config.fleet.alarm_rate,
        "repeatability": repeatability(fleet.config.fleet.healthy, results),
        "verdicts": dict(Counter(r["verdict"] for r in results if r["verdict"])),
        "missing": dict(Counter(name for r in results for name in r["missing"]).most_common()),
        "changes": sorted(changed, key=lambda c: -max(one["confidence"] for one in c["changes"])),
        "failures": [{"cause": cause, "rows": n} for cause, n in failures.most_common()],
        "breaks": sum(bool(t.breaks) for t in trends),
        "out": str(fleet.store),
    }


def repeatability(dates: int, results: Sequence[Result]) -> dict[str, Any] | None:
    """Return by which part of itself each parameter differs from healthy date to healthy date, the median of rigs."""
    last = {r["rig"]: r for r in results if r.get("repeatability")}
    sizes: dict[str, list[float]] = {}
    for r in last.values():
        for name, one in r["repeatability"]["parameters"].items():
            if value := r["parameters"].get(name, {}).get("value"):
                sizes.setdefault(name, []).append(one["value"] / abs(value))
    parameters = {name: round(median(mine), 5) for name, mine in sizes.items()}
    return {"rigs": len(last), "dates": dates, "parameters": parameters} if last else None
