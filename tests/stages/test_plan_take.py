"""Recordings of a plan go into the pipeline file as those of their bench; the answer shows before and after."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from pneucli.cli.command import HowToRun
from pneucli.cli.commands.plan import _take
from pneucli.errors import InputError
from pneucli.figure import read
from pneucli.messages.diagnose import Answer as Diagnosis
from pneucli.messages.plan import Answer as Plan
from pneucli.messages.plan import Decided
from pneucli.stages.plan_take import add_recordings, last_answers, taken_answer

PIPELINE = """[pipeline]
name = "rig"

[[recordings]]
name = "axis_1"
file = "raw/axis_1.csv"
experiment = "axis"
use = "train"
chamber_2 = "closed"
take = ["time", "u", "p1"]   # no more
from = "1 s"
"""


def planned(name: str, begin: float, use: str = "train", **more: Any) -> dict[str, Any]:
    shared = {"experiment": "axis", "chamber_2": "closed", "imposed": None, "chamber": 1, "valve": None, "force": 0.0}
    return {"name": name, "use": use, "begin": begin, "end": begin + 5.0, **shared, **more}


PLAN = {"recordings": [planned("plan_1", 0.0), planned("plan_2", 7.0, "test")], "rivals": [{"effect": None}]}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "pipeline.toml").write_text(PIPELINE, encoding="utf-8")
    for name in ("a", "b", "c", "d", "plan_2", "plan_1", "all"):
        (tmp_path / f"{name}.csv").write_text("t,x\n", encoding="utf-8")
    return tmp_path


def recordings(folder: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = tomllib.loads((folder / "pipeline.toml").read_text(encoding="utf-8"))["recordings"]
    return found[1:]


def test_files_follow_the_plan_in_order_with_the_keys_of_their_bench(folder: Path) -> None:
    add_recordings(folder / "pipeline.toml", read(Plan, PLAN), [folder / "a.csv", folder / "b.csv"])
    one, two = recordings(folder)
    assert (one["name"], one["file"], one["use"]) == ("plan_1", "a.csv", "train")
    assert (two["name"], two["file"], two["use"]) == ("plan_2", "b.csv", "test")
    assert one["take"] == ["time", "u", "p1"]
    assert one["chamber_2"] == "closed"
    assert "from" not in one  # a stretch belongs to its own file


def test_files_named_as_planned_are_matched_by_name(folder: Path) -> None:
    add_recordings(folder / "pipeline.toml", read(Plan, PLAN), [folder / "plan_2.csv"])
    assert [(r["name"], r["use"]) for r in recordings(folder)] == [("plan_2", "test")]


def test_one_file_for_the_whole_plan_is_cut_at_the_times_of_the_commands(folder: Path) -> None:
    add_recordings(folder / "pipeline.toml", read(Plan, PLAN), [folder / "all.csv"])
    assert [(r["from"], r["to"]) for r in recordings(folder)] == [("0.000 s", "5.000 s"), ("7.000 s", "12.000 s")]


def test_a_second_round_gets_new_names(folder: Path) -> None:
    for names in (("a", "b"), ("c", "d")):
        add_recordings(folder / "pipeline.toml", read(Plan, PLAN), [folder / f"{name}.csv" for name in names])
    assert [r["name"] for r in recordings(folder)] == ["plan_1", "plan_2", "plan_1_2", "plan_2_2"]


def test_a_shut_valve_and_a_known_force_are_stated(folder: Path) -> None:
    by_hand = {"recordings": [planned("plan_1", 0.0, valve="shut", force=-19.62, added_mass=2.0)], "rivals": []}
    add_recordings(folder / "pipeline.toml", read(Plan, by_hand), [folder / "a.csv"])
    (one,) = recordings(folder)
    assert (one["valve"], one["force"], one["added_mass"]) == ("shut", "-19.62 N", "2 kg")


@pytest.mark.parametrize("files", [["missing.csv"], ["a.csv", "b.csv", "all.csv"]])
def test_a_missing_file_or_one_too_many_is_refused_and_the_file_stays(folder: Path, files: list[str]) -> None:
    with pytest.raises(InputError):
        add_recordings(folder / "pipeline.toml", read(Plan, PLAN), [folder / name for name in files])
    assert (folder / "pipeline.toml").read_text(encoding="utf-8") == PIPELINE


def test_fewer_files_than_recordings_have_to_be_named_as_planned(folder: Path) -> None:
    plan = PLAN | {"recordings": [*PLAN["recordings"], planned("plan_3", 14.0)]}
    with pytest.raises(InputError, match=r"plan_1\.csv, plan_2\.csv, plan_3\.csv"):
        add_recordings(folder / "pipeline.toml", read(Plan, plan), [folder / "a.csv", folder / "b.csv"])
    assert (folder / "pipeline.toml").read_text(encoding="utf-8") == PIPELINE


def test_a_file_is_not_taken_twice(folder: Path) -> None:
    add_recordings(folder / "pipeline.toml", read(Plan, PLAN), [folder / "plan_1.csv"])
    with pytest.raises(InputError, match='already as "plan_1"'):
        add_recordings(folder / "pipeline.toml", read(Plan, PLAN), [folder / "plan_1.csv"])


def test_the_pipeline_file_stays_where_the_recordings_cannot_be_read(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = folder / "pipeline.toml"
    monkeypatch.setattr("pneucli.stages.plan_take.last_answers", lambda *_: (read(Diagnosis, {}), read(Plan, PLAN)))
    with pytest.raises(InputError):
        _take(file, [folder / "a.csv", folder / "b.csv"], HowToRun(quiet=True))
    assert file.read_text(encoding="utf-8") == PIPELINE


def test_without_a_plan_nothing_can_be_taken(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="pneucli plan"):
        last_answers(tmp_path, Path("pipeline.toml"))


def candidate(effect: str, confidence: float, value: float) -> dict[str, Any]:
    parameters = {"mass": {"value": value, "unit": "kg", "ci95": [value - 0.1, value + 0.1]}}
    return {
        "effect": effect,
        "confidence_alone": confidence,
        "indistinguishable_from": [],
        "parameters": parameters,
        "reason": "supported" if confidence > 0.5 else "not-significant",
    }


def test_before_and_after_show_probabilities_intervals_and_what_is_decided() -> None:
    before = {"pipeline": "rig", "verdict": "unexplained", "missing": [], "candidates": [candidate("mass", 0.1, 0.9)]}
    after = before | {"missing": ["mass"], "candidates": [candidate("mass", 0.9, 1.2)]}
    plan = read(Plan, PLAN | {"rivals": [{"effect": "mass"}]})
    found = taken_answer(read(Diagnosis, before), read(Diagnosis, after), plan, [])
    assert found.decided == [Decided("mass", "named")]
    assert (found.effects[0].before, found.effects[0].after) == (0.1, 0.9)
    parameter = found.parameters[0]
    assert parameter.before is not None
    assert parameter.before.value == 0.9
    assert (parameter.after.low, parameter.after.high) == pytest.approx((1.1, 1.3))
    assert found.sentence == "mass is now named."
