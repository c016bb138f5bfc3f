"""Dates that are stated to be healthy: what they say of a rig's repeatability is known before any other is done."""

from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from benchmarks.fleet import CHANGES, FLEET_FILE, TABLE_FILE, TEMPLATE_FILE, write_fleet
from pneucli.cli.command import HowToRun
from pneucli.cli.commands.diagnose import _baseline_options
from pneucli.config import load_fleet
from pneucli.errors import InputError
from pneucli.executors.engine import ThreadEngine
from pneucli.fleet import row
from pneucli.fleet import run as stage
from pneucli.fleet.row_files import RowResult
from pneucli.pipeline.manifest import read_manifest
from pneucli.pipeline.runner import open_pipeline
from pneucli.stages.changes import REFERENCE_FILE, read_baseline
from pneucli.stages.pipeline_file import load_pipeline_file

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


def done(fleet: stage.Fleet, monkeypatch: pytest.MonkeyPatch, bad: tuple[str, str] = ("", "")) -> list[row.Job]:
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
    jobs = done(plant(tmp_path, rigs=9, healthy=3), monkeypatch)
    assert len(jobs) == 45
    first = deque(job.row.date in DATES[:3] for job in jobs)
    assert list(first) == [True] * 27 + [False] * 18
    assert [job.stated_healthy for job in jobs] == list(first)
    for job in jobs[27:]:
        assert len(job.repeats) == 2
        assert set(job.prior or {}) == {"friction.coulomb"}
    assert all(job.repeats == () and job.prior is None for job in jobs[:27])


def test_a_failed_first_date_is_not_a_repeat(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    jobs = done(plant(tmp_path, rigs=1, healthy=3), monkeypatch, bad=("rig-00", DATES[0]))
    assert [job.reference_date for job in jobs] == [None, None, DATES[1], DATES[1], DATES[1]]
    assert [len(job.repeats) for job in jobs] == [0, 0, 0, 1, 1]


def test_without_stated_healthy_dates_no_date_waits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    jobs = done(plant(tmp_path, rigs=2, healthy=1), monkeypatch)
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
