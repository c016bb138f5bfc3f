"""A small fleet from the exam's rig, as `pneucli fleet` does it: what changed, what failed, and what is done again."""

import json
import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pyarrow.dataset as ds
import pytest

from benchmarks.fleet import FLEET_FILE, TABLE_FILE, TEMPLATE_FILE, write_fleet
from pneucli.config import load_fleet
from pneucli.errors import InputError
from pneucli.fleet import run as stage
from pneucli.fleet.output import evaluate_checks
from pneucli.fleet.row import Job, ProgramMismatchError, require_same_program
from pneucli.fleet.row_files import FleetRow, failure_cause, failure_result

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
