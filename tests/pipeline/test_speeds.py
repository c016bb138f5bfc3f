"""Before a stage begins: what it has before it, and about how long it takes."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from pneucli.pipeline import workload
from pneucli.pipeline.graph import Context, Progress, Workload
from pneucli.pipeline.manifest import Stamp
from tests.pipeline import toys


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache, and nothing known of other machines."""
    monkeypatch.setattr(workload, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(workload, "DEMO_RUNS", {})
    return tmp_path / workload.SPEEDS_FILE


def test_the_last_run_of_the_pipeline_tells_by_its_work() -> None:
    assert workload.estimate("compare", Path("a.toml"), 10.0) is None
    workload.remember("compare", Path("a.toml"), 10.0, 4.0)
    workload.remember("compare", Path("a.toml"), 10.0, 5.0)
    assert workload.estimate("compare", Path("a.toml"), 20.0) == pytest.approx(10.0)
    assert workload.estimate("diagnose", Path("a.toml"), 20.0) is None


def test_of_other_pipelines_the_one_alike_in_size_tells() -> None:
    workload.remember("compare", Path("small.toml"), 10.0, 5.0)
    workload.remember("compare", Path("large.toml"), 1e6, 100.0)
    assert workload.estimate("compare", Path("new.toml"), 2e6) == pytest.approx(200.0)
    assert workload.estimate("compare", Path("new.toml"), 20.0) == pytest.approx(10.0)
    assert workload.estimate("compare", Path("small.toml"), 1e6) == pytest.approx(5e5)  # its own, however unlike


@pytest.mark.parametrize(
    "text", ["", "[]", '{"compare": 1}', '{"compare": {"a": [1]}}', '{"compare": {"a": ["x", 1]}}']
)
def test_a_damaged_file_counts_as_none(cache: Path, text: str) -> None:
    cache.write_text(text)
    assert workload.estimate("compare", Path("a.toml"), 1.0) is None
    workload.remember("compare", Path("a.toml"), 1.0, 2.0)
    assert workload.estimate("compare", Path("a.toml"), 1.0) == pytest.approx(2.0)


def test_on_a_new_machine_the_demo_on_another_one_tells_by_the_speed_of_both(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workload, "DEMO_RUNS", {"compare": workload.DemoRun(10.0, 4.0, 1.0)})
    monkeypatch.setattr(workload, "_slowness", lambda: 3.0)
    assert workload.estimate("compare", Path("a.toml"), 20.0) == pytest.approx(27.0)
    assert workload.estimate("diagnose", Path("a.toml"), 20.0) is None
    workload.remember("compare", Path("b.toml"), 20.0, 7.0)
    assert workload.estimate("compare", Path("a.toml"), 20.0) == pytest.approx(7.0)


def test_the_file_does_not_grow_for_ever() -> None:
    for number in range(workload.MAX_PIPELINES + 1):
        workload.remember("compare", Path(f"{number}.toml"), 1.0 + number, 7.0 * (1.0 + number) ** 2)
    assert workload.estimate("compare", Path("0.toml"), 1.0) == pytest.approx(14.0)  # as that of 1.toml


def test_a_stage_says_what_it_has_before_it_and_about_how_long(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def work(stage: str, context: Context, files: Mapping[str, Stamp]) -> Workload:
        return Workload(f"{len(files)} files", 1.0)

    class Begun(Progress):
        def begin(self, work: str, seconds: float | None) -> None:
            begun.append((work, seconds))

    begun: list[tuple[str, float | None]] = []
    said: list[str] = []
    file = toys.new(tmp_path / "rig")
    pipeline = replace(toys.toy(file), workload=work)
    pipeline.update(["raw"], progress=Begun(), notify=said.append)
    monkeypatch.setattr(workload, "estimate", lambda stage, path, units: 130.0)
    (tmp_path / "rig" / "raw" / "c.csv").write_text("0")
    pipeline.update(["raw"], progress=Begun(), notify=said.append)
    assert said == [
        "running raw (first time): 2 files; no estimate yet",
        "running raw (new raw/c.csv): 3 files; about 2 min",
    ]
    assert begun == [("raw", None), ("raw", 130.0)]


def test_what_a_stage_took_is_remembered(tmp_path: Path) -> None:
    pipeline = replace(toys.toy(toys.new(tmp_path / "rig")), workload=lambda *about: Workload("", 2.0))
    pipeline.update(["model"])
    assert workload.estimate("model", pipeline.path, 4.0) == pytest.approx(
        2.0 * pipeline.update(["model"])["model"].manifest.seconds
    )
