"""A small fleet from the exam's rig, as `pneucli fleet` does it: what changed, what failed, and what is done again."""

import json
import os
import shutil
from collections import deque
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pyarrow.dataset as ds
import pytest

from benchmarks.fleet import CHANGES, FLEET_FILE, TABLE_FILE, TEMPLATE_FILE, write_fleet
from pneucli.cli.command import HowToRun
from pneucli.cli.commands.diagnose import _baseline_options
from pneucli.config import load_fleet
from pneucli.errors import InputError
from pneucli.executors import ThreadEngine
from pneucli.fleet import row
from pneucli.fleet import run as stage
from pneucli.fleet.output import evaluate_checks
from pneucli.fleet.row import Job, ProgramMismatchError, require_same_program
from pneucli.fleet.row_files import FleetRow, RowResult, failure_cause, failure_result
from pneucli.pipeline.manifest import read_manifest
from pneucli.pipeline.runner import open_pipeline
from pneucli.stages.changes import REFERENCE_FILE, read_baseline
from pneucli.stages.pipeline_file import load_pipeline_file

ADDED = "odd,2026-01-01,,,,,,,none.csv,,,\nodd,soon,,,,,,,,,,\n"


@dataclass(frozen=True)
class Done:
    """A fleet's folder, what was hidden in it, and the answer of its first run."""

    folder: Path
    truth: dict[str, list[str]]
    answer: dict[str, Any]

    @property
    def out(self) -> Path:
        return self.folder / "out"

    def again(self) -> dict[str, Any]:
        return stage.run(load_fleet(self.folder / FLEET_FILE), self.out)


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Done:
    """Three rigs at two dates, one with a change; a row whose file is not there, and one without a date."""
    folder = tmp_path_factory.mktemp("plant")
    truth = write_fleet(folder, rigs=3, dates=2, changed=0.2, seed=4)
    with (folder / TABLE_FILE).open("a", encoding="utf-8") as file:
        file.write(ADDED)
    with (folder / FLEET_FILE).open("a", encoding="utf-8") as file:
        file.write('reports = "none"\n\n[checks]\n"fleet.failed" = { max = 0 }\n"fleet.rigs" = { min = 1 }\n')
    return Done(folder, truth, stage.run(load_fleet(folder / FLEET_FILE), folder / "out"))


def test_the_rig_that_changed_is_named_with_what_changed_and_no_other(done: Done) -> None:
    found = {one["rig"]: [c["effect"] or c["name"] for c in one["changes"]] for one in done.answer["changes"]}
    assert found == done.truth


def test_a_failed_row_states_its_cause_and_stops_no_other(done: Done) -> None:
    assert (done.answer["rows"], done.answer["failed"]) == (8, 2)
    results = ds.dataset(done.out / "results", partitioning="hive").to_table().to_pylist()
    failures = {(r["rig"], r["date"]): r["failure"] for r in results if r["failure"]}
    assert "none.csv" in failures["odd", "2026-01-01"]
    assert "no date" in failures["odd", "unknown"]
    assert {r["verdict"] for r in results if not r["failure"]} <= {"adequate", "missing-effect", "unexplained"}


def test_parameters_have_values_with_intervals_for_every_row_that_was_done(done: Done) -> None:
    rows = ds.dataset(done.out / "parameters", partitioning="hive").to_table().to_pylist()
    assert {"rig", "name", "value", "unit", "ci_low", "ci_high", "date"} == rows[0].keys()
    coulomb = [r for r in rows if r["name"] == "friction.coulomb"]
    assert len(coulomb) == 6
    assert {r["unit"] for r in coulomb} == {"N"}
    determined = [r for r in coulomb if r["ci_low"] is not None]  # else an effect may take its place
    assert len(determined) >= 5
    assert all(r["ci_low"] < r["value"] < r["ci_high"] for r in determined)


@pytest.mark.parametrize("library", ["pandas", "polars", "duckdb"])
def test_the_dataset_is_read_by(library: str, done: Done) -> None:
    module = pytest.importorskip(library)
    results = done.out / "results"
    if library == "pandas":
        assert len(module.read_parquet(results)) == 8
    elif library == "polars":
        assert module.read_parquet(results / "**" / "*.parquet", hive_partitioning=True).height == 8
    else:
        query = f"select count(*), count(distinct date) from read_parquet('{results}/**/*.parquet')"
        assert module.connect().execute(query).fetchone() == (8, 3)


def test_junit_metrics_and_checks_are_written_for_continuous_integration(done: Done) -> None:
    suite = ElementTree.parse(done.out / "junit.xml").getroot()[0]
    assert (suite.get("tests"), suite.get("failures")) == ("10", "4")  # two that failed, one that changed, one check
    assert [c.passed for c in evaluate_checks(load_fleet(done.folder / FLEET_FILE), done.answer)] == [False, True]
    parser = pytest.importorskip("prometheus_client.openmetrics.parser")
    text = (done.out / "metrics.txt").read_text(encoding="utf-8")
    values = {s.name: s.value for family in parser.text_string_to_metric_families(text) for s in family.samples
              if s.labels.keys() == {"fleet"}}  # fmt: skip
    assert (values["pneucli_fleet_rows"], values["pneucli_fleet_failed"]) == (8, 2)


def result_of(done: Done, rig: str, date: str) -> Path:
    return done.out / "rows" / rig / date / "row.json"


def test_only_changed_rows_run_again(done: Done, tmp_path: Path) -> None:
    copy = Done(tmp_path / "plant", done.truth, done.answer)
    shutil.copytree(done.folder, copy.folder)
    config = load_fleet(copy.folder / FLEET_FILE)
    before = {p: p.read_bytes() for p in (copy.out / "rows").rglob("row.json")}
    for path in before:  # the copy's files have other paths
        path.unlink()
    kept = stage.Fleet(config, copy.out)
    assert kept.queue_pending()
    assert {job.row.rig for job in kept.job_queue} >= {"rig-00000", "rig-00001", "rig-00002"}


def test_a_second_run_does_nothing_and_gives_the_same(done: Done) -> None:
    again = done.again()
    assert again["done"] == 0
    assert {k: v for k, v in again.items() if k not in {"done", "unchanged", "seconds"}} == {
        k: v for k, v in done.answer.items() if k not in {"done", "unchanged", "seconds"}
    }


def test_a_new_time_stamp_is_checked_and_a_changed_file_runs_again(done: Done) -> None:
    raw = sorted((done.folder / "raw" / "rig-00001" / "2026-01-02").glob("*.csv"))[0]
    os.utime(raw, (1e9, 1e9))
    assert done.again()["done"] == 0
    raw.write_text(raw.read_text(encoding="utf-8") + "# the end\n", encoding="utf-8")
    again = done.again()
    assert (again["done"], again["unchanged"]) == (1, 7)


def test_a_lost_result_is_computed_again(done: Done) -> None:
    """What a kill leaves: some results are there, others not."""
    lost = result_of(done, "rig-00000", "2026-01-02")
    before = json.loads(lost.read_text(encoding="utf-8"))
    lost.unlink()
    assert done.again()["done"] == 1
    after = json.loads(lost.read_text(encoding="utf-8"))
    times = ("seconds", "core_seconds")
    assert all(after[key] > 0.0 for key in times)
    assert after | dict.fromkeys(times) == before | dict.fromkeys(times)


def test_the_page_is_one_file_that_carries_all_rigs(done: Done) -> None:
    page = (done.out / "report.html").read_text(encoding="utf-8")
    assert all(name in page for name in ("rig-00000", "rig-00001", "rig-00002", "odd", "is no date"))
    assert "http" not in page.replace("http://www.w3.org/2000/svg", "").replace("http-equiv", "")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[fleet]\nname = "a"\ntemplate = "t.toml"\n', "table"),
        (f'[fleet]\nname = "a"\ntemplate = "{TEMPLATE_FILE}"\ntable = "{TABLE_FILE}"\nalarmrate = 1', "alarm_rate"),
        (f'[fleet]\nname = "a"\ntemplate = "none.toml"\ntable = "{TABLE_FILE}"\n', "none.toml"),
    ],
)
def test_a_fleet_file_that_is_wrong_is_refused(done: Done, text: str, says: str, tmp_path: Path) -> None:
    file = tmp_path / "fleet.toml"
    file.write_text(text, encoding="utf-8")
    for name in (TEMPLATE_FILE, TABLE_FILE):
        shutil.copy(done.folder / name, tmp_path / name)
    with pytest.raises(InputError, match=says):
        stage.run(load_fleet(file), tmp_path / "out")


def test_a_worker_with_another_program_or_plug_in_refuses_the_row(tmp_path: Path) -> None:
    row = FleetRow(2, "a", "2026-01-01", {})
    with pytest.raises(ProgramMismatchError, match="pneucli is"):
        require_same_program(Job(str(tmp_path), row, "", program={"pneucli": "0.0.0 other"}))
    with pytest.raises(ProgramMismatchError, match=r"plug-in .*mine\.py is not there"):
        require_same_program(Job(str(tmp_path), row, "", plugins={str(tmp_path / "mine.py"): "0" * 64}))


def test_failures_of_one_kind_have_one_cause_and_those_of_the_program_are_tried_again() -> None:
    texts = [f'no file /data/rig-{n}/x.csv, "{n}" rows' for n in (1, 2)]
    assert len({failure_cause(text) for text in texts}) == 1
    row = FleetRow(2, "a", "2026-01-01", {})
    assert failure_result(row, ZeroDivisionError("x")).again
    assert not failure_result(row, InputError("a", "b")).again


# --- dates that are stated to be healthy: what they say of a rig's repeatability is known before any other is done


DATES = tuple(f"2026-01-0{k}" for k in range(1, 6))


def plant(folder: Path, rigs: int, healthy: int) -> stage.Fleet:
    """A fleet of rigs at five dates, the first ones of which are stated to be healthy."""
    write_fleet(folder / "made", rigs=1, dates=1, changed=0.0)
    for name in (FLEET_FILE, TEMPLATE_FILE):
        (folder / name).write_text((folder / "made" / name).read_text(encoding="utf-8"), encoding="utf-8")
    rows = [f"rig-{k:02d},{date}" for k in range(rigs) for date in DATES]
    (folder / TABLE_FILE).write_text("\n".join(["rig,date", *rows, ""]), encoding="utf-8")
    with (folder / FLEET_FILE).open("a", encoding="utf-8") as file:
        file.write(f"healthy = {healthy}\n")
    return stage.Fleet(load_fleet(folder / FLEET_FILE), folder / "out")


def healthy_done(fleet: stage.Fleet, monkeypatch: pytest.MonkeyPatch, bad: tuple[str, str] = ("", "")) -> list[row.Job]:
    """Do a fleet whose rows say that friction differs by a tenth of its number; return the jobs in their order."""
    jobs: list[row.Job] = []

    def work(job: row.Job) -> RowResult:
        jobs.append(job)
        repeat = {"friction.coulomb": [0.1 * len(jobs), 0.1, 0.1]} if job.reference_date else None
        about = RowResult("", job.row.rig, job.row.date, since=job.reference_date, key=job.row.date)
        return replace(about, verdict="adequate", repeat=repeat, bad=job.row.key == bad)

    monkeypatch.setattr(row, "process_row", work)
    engine = ThreadEngine(1)
    try:
        assert fleet.queue_pending()
        fleet.process_queue(engine, lambda *_: None)
    finally:
        engine.close()
    return jobs


def test_other_dates_wait_for_all_healthy_ones(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    jobs = healthy_done(plant(tmp_path, rigs=9, healthy=3), monkeypatch)
    assert len(jobs) == 45
    first = deque(job.row.date in DATES[:3] for job in jobs)
    assert list(first) == [True] * 27 + [False] * 18
    assert [job.stated_healthy for job in jobs] == list(first)
    for job in jobs[27:]:
        assert len(job.repeats) == 2
        assert set(job.prior or {}) == {"friction.coulomb"}
    assert all(job.repeats == () and job.prior is None for job in jobs[:27])


def test_a_failed_first_date_is_not_a_repeat(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    jobs = healthy_done(plant(tmp_path, rigs=1, healthy=3), monkeypatch, bad=("rig-00", DATES[0]))
    assert [job.reference_date for job in jobs] == [None, None, DATES[1], DATES[1], DATES[1]]
    assert [len(job.repeats) for job in jobs] == [0, 0, 0, 1, 1]


def test_without_stated_healthy_dates_no_date_waits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    jobs = healthy_done(plant(tmp_path, rigs=2, healthy=1), monkeypatch)
    assert len(jobs) == 10
    assert not any(job.stated_healthy or job.repeats for job in jobs)


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """A rig whose friction never repeats, at four dates, the last with two changes: the pipelines."""
    folder = tmp_path_factory.mktemp("rig")
    write_fleet(folder, rigs=1, dates=4, changed=1.0, seed=3, drift=0.05, changes_per_rig=2)
    text, files = (folder / TEMPLATE_FILE).read_text(encoding="utf-8"), []
    for raw in sorted((folder / "raw").glob("*/*")):
        files.append(folder / f"{raw.name}.toml")
        files[-1].write_text(text.replace('file = "raw/', f'file = "{raw.as_posix()}/'), encoding="utf-8")
    return files


def asked(rig: list[Path], repeats: list[int], date: int) -> dict[str, Any]:
    """The answer of `diagnose DATE --since FIRST --repeat ...`."""
    options = _baseline_options(rig[0], None, HowToRun(quiet=True), [rig[k].parent / f"out-{k}" for k in repeats])
    pipeline = open_pipeline(rig[date], load_pipeline_file, rig[0].parent / f"out-{date}")
    return dict(pipeline.update(["diagnose"], {"diagnose": options})["diagnose"].answer)


def test_a_rig_that_never_repeats_alarms_until_healthy_dates_are_stated(rig: list[Path]) -> None:
    alone = asked(rig, [], 1)
    assert alone["since"]["repeatability"] is None
    assert [c["name"].partition(".")[0] for c in alone["changes"]] == ["friction"]
    known = asked(rig, [1], 2)
    assert known["changes"] == []
    assert known["since"]["repeatability"]["dates"] == 2
    assert known["since"]["repeatability"]["parameters"]["friction.coulomb"]["value"] > 0.0


def test_a_repeat_of_another_model_is_refused(rig: list[Path]) -> None:
    with pytest.raises(InputError, match="no comparison in it"):
        _baseline_options(rig[0], None, HowToRun(quiet=True), [rig[0]])


def test_two_changes_at_once_are_both_in_the_answer(tmp_path: Path) -> None:
    """On this rig; of forty like it 28 (docs/development/experiments.md)."""
    truth = write_fleet(tmp_path, rigs=1, dates=2, changed=1.0, seed=6, changes_per_rig=2)
    with (tmp_path / FLEET_FILE).open("a", encoding="utf-8") as file:
        file.write('reports = "none"\n')
    answer = stage.run(load_fleet(tmp_path / FLEET_FILE), tmp_path / "out")
    (found,) = answer["changes"]
    said = {n for c in found["changes"] for n in (c["name"], c["effect"], *c["indistinguishable_from"])}
    assert set(truth["rig-00000"]) <= said
    assert set(truth["rig-00000"]) <= set(CHANGES)


def test_the_first_comparison_writes_the_baseline_of_the_old_diagnosis(rig: list[Path]) -> None:
    old = rig[0].parent / "artifacts-old"
    pipeline = open_pipeline(rig[0], load_pipeline_file, old)
    pipeline.update(["diagnose"])
    assert not (old / "diagnose" / REFERENCE_FILE).exists()
    _baseline_options(old, None, HowToRun(quiet=True), [])
    baseline = read_baseline(old / "diagnose" / REFERENCE_FILE)
    answer = read_manifest(old / "diagnose").answer
    assert pipeline.stage_status(["diagnose"])["diagnose"].reasons == ()
    assert {c.name: c.value for c in baseline.coordinates} == {n: p["value"] for n, p in answer["parameters"].items()}


def test_a_baseline_needs_the_pipeline_file_as_it_was_diagnosed(rig: list[Path], tmp_path: Path) -> None:
    file = tmp_path / "changed.toml"
    file.write_text(rig[0].read_text(encoding="utf-8"), encoding="utf-8")
    open_pipeline(file, load_pipeline_file, tmp_path / "out").update(["diagnose"])
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace('gas_temperature = "', 'gas_temperature = "1', 1), encoding="utf-8")
    with pytest.raises(InputError, match="has changed since that diagnosis"):
        _baseline_options(tmp_path / "out", None, HowToRun(quiet=True), [])
    file.unlink()
    with pytest.raises(InputError, match=r"no .*changed\.toml"):
        _baseline_options(tmp_path / "out", None, HowToRun(quiet=True), [])
