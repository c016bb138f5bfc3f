"""The plan after a diagnosis of a friction bench: rivals, their power, and a weight where motion shows nothing."""

import csv
import json
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneucli import messages
from pneucli.cli.command import HowToRun
from pneucli.cli.commands.plan import _take
from pneucli.config import load
from pneucli.errors import InputError
from pneucli.figure import read
from pneucli.io.artifacts import read_table
from pneucli.messages.diagnose import Answer as Diagnosis
from pneucli.messages.plan import Answer as Plan
from pneucli.messages.plan import Decided
from pneucli.pipeline.graph import Context
from pneucli.stages import ingest, plan
from pneucli.stages.pipeline_file import load_rig_description
from pneucli.stages.plan_take import add_recordings, last_answers, taken_answer
from tests.stages.chain import known_as_declared

BENCH = Path(__file__).parents[2] / "fixtures" / "friction_null_coulomb" / "pipeline.toml"


def candidate(effect: str, confidence: float, *alike: str, named: bool = False) -> dict[str, Any]:
    return {
        "effect": effect,
        "confidence": confidence,
        "confidence_alone": confidence,
        "indistinguishable_from": list(alike),
        "supported": named,
        "reason": "supported" if named else "not-significant",
        "parameters": {"size": {}},
    }


DIAGNOSES: dict[str, dict[str, Any]] = {
    "nothing": {"missing": [], "candidates": [], "data": "0123456789abcdef"},
    "a mass, or a scale": {
        "missing": ["extra-mass"],
        "candidates": [candidate("extra-mass", 0.6, "pressure-scale", named=True)],
        "data": "0123456789abcdef",
    },
    "a lag": {"missing": [], "candidates": [candidate("pressure-lag", 0.3)], "data": "0123456789abcdef"},
}


@pytest.fixture(scope="module")
def ingested(tmp_path_factory: pytest.TempPathFactory) -> Context:
    out = tmp_path_factory.mktemp("plan")
    (out / "ingest").mkdir()
    context = Context(BENCH, load(BENCH), out / "ingest", out)
    return replace(context, answers={"ingest": ingest.run(context)})


def planned(ingested: Context, out: Path, diagnosis: dict[str, Any], **options: Any) -> dict[str, Any]:
    answers = {**ingested.answers, "diagnose": diagnosis}
    return plan.run(replace(ingested, out=out, answers=answers, options={"minutes": 1.0, **options}))


def test_a_mass_that_no_motion_tells_from_a_scale_of_the_pressures_gets_a_weight(
    ingested: Context, tmp_path: Path
) -> None:
    answer = planned(ingested, tmp_path, DIAGNOSES["a mass, or a scale"])
    json.dumps(answer, allow_nan=False)
    known_as_declared("plan", {key: value for key, value in answer.items() if key not in ("files", "folder")})
    assert [r["name"] for r in answer["rivals"]] == [
        "best model", "pressure-scale in place of extra-mass", "without extra-mass"
    ]  # fmt: skip
    expected = {e["rival"]: e for e in answer["expected"]}
    assert expected["without extra-mass"]["probability_before"] == pytest.approx(0.4)
    assert expected["pressure-scale in place of extra-mass"]["power"] >= 0.8
    assert {r["kind"] for r in answer["recordings"] if r["by_hand"]} == {"known-force"}
    assert {r["use"] for r in answer["recordings"]} == {"train", "test"}
    assert set(answer["recordings"][0]["times_noise"]) == {"pressure-scale", "extra-mass"}
    assert {"commands.csv", "plan.html", "power.parquet", "steps.md"} <= set(answer["files"])
    assert "Hang a weight of 2.00 kg" in messages.render("plan", answer, "bench.toml", verbose=True)


def test_what_motion_shows_needs_no_weight_and_other_data_draw_another_programme(
    ingested: Context, tmp_path: Path
) -> None:
    lag = DIAGNOSES["a lag"]
    one, other = (planned(ingested, tmp_path, lag | {"data": data}, minutes=0.4) for data in ("0" * 16, "f" * 16))
    assert one["manual"] == []
    assert [r["kind"] for r in one["recordings"]] != [r["kind"] for r in other["recordings"]]
    assert [e["effect"] for e in one["expected"]] == ["pressure-lag"]


def test_without_a_question_every_effect_has_its_power(ingested: Context, tmp_path: Path) -> None:
    answer = planned(ingested, tmp_path, DIAGNOSES["nothing"], minutes=0.4)
    found = {e["effect"]: e["power"] for e in answer["expected"]}
    assert found == {p["effect"]: p["power"] for p in answer["power"] if p["typical"]}
    assert found["friction-hysteresis"] > 0.8


def test_an_effect_that_the_bench_cannot_show_is_in_question_without_power(ingested: Context, tmp_path: Path) -> None:
    asked = {"effects": ["valve-lag", "stribeck"], "minutes": 0.4}
    answer = planned(ingested, tmp_path, DIAGNOSES["nothing"], **asked)
    assert [(e["effect"], e["power"] > 0.8) for e in answer["expected"]] == [("valve-lag", False), ("stribeck", True)]


def test_an_unknown_effect_and_limits_without_a_manoeuvre_are_refused(ingested: Context, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="stribeck"):
        planned(ingested, tmp_path, DIAGNOSES["nothing"], effects=["stribek"])
    narrow = load(BENCH).model_copy(update={"plan": load(BENCH).plan.model_copy(update={"max_pressure": 1e4})})
    with pytest.raises(InputError, match=r"the nearest is .* pressure of chamber 1"):
        planned(replace(ingested, config=narrow), tmp_path, DIAGNOSES["nothing"])
    with pytest.raises(InputError, match="--minutes"):
        planned(ingested, tmp_path, DIAGNOSES["nothing"], minutes=0.1)


# --- the first programme of a vessel that is only described: files, commands, powers


RIG = """[pipeline]
name = "new-rig"

[rig]
ambient_pressure = "1 bar"
supply_pressure = "7 bar"

[rig.vessel]
volume = "160 cm^3"

[rig.valve]
null = "5 V"

[plan]
max_command = "2 V"
"""


def context(folder: Path, text: str = RIG, **options) -> Context:
    file = folder / "pipeline.toml"
    file.write_text(text, encoding="utf-8")
    out = folder / "out"
    out.mkdir(exist_ok=True)
    return Context(file, load_rig_description(file), out, folder, options={"first": True, "minutes": 1.0, **options})


@pytest.fixture(scope="module")
def plan_first_planned(tmp_path_factory: pytest.TempPathFactory):
    folder = tmp_path_factory.mktemp("first")
    return plan.run(context(folder, to=["c"])), folder / "out"


def test_the_answer_keeps_the_machine_time_and_holds_a_recording_out(plan_first_planned) -> None:
    answer, _ = plan_first_planned
    assert answer["schema"] == "pneucli/plan/1"
    assert 0.0 < answer["seconds"] <= 60.0
    assert "test" in [r["use"] for r in answer["recordings"]]
    assert answer["first"]


def test_commands_stay_within_the_stated_distance_of_the_null(plan_first_planned) -> None:
    answer, out = plan_first_planned
    with (out / "commands.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    u = np.array([float(row["u [V]"]) for row in rows])
    assert set(rows[0]) == {"time [s]", "u [V]", "recording"}
    assert np.abs(u - 5.0).max() <= 2.0
    assert u[0] == u[-1] == 5.0
    assert float(rows[-1]["time [s]"]) == pytest.approx(answer["seconds"], abs=2e-3)
    assert {row["recording"] for row in rows} - {""} == {r["name"] for r in answer["recordings"]}


def test_the_power_table_has_a_typical_and_a_detectable_size_of_each_effect(plan_first_planned) -> None:
    _, out = plan_first_planned
    table = read_table(out / "power.parquet")
    assert {"effect", "parameter", "size", "unit", "power"} <= set(table)
    typical = np.asarray(table["typical"], dtype=bool)
    assert "chamber-leak" in np.array(table["effect"])[typical]
    power = np.asarray(table["power"])
    assert np.all((power >= 0.0) & (power <= 1.0))
    assert np.all(power[~typical] == 0.8)
    assert "valve-deadband" not in table["effect"]  # part of a valve's map


def test_page_steps_and_player_are_written(plan_first_planned) -> None:
    answer, out = plan_first_planned
    assert set(answer["files"]) >= {"commands.csv", "steps.md", "power.parquet", "plan.html", "pneucli_player.c"}
    page = (out / "plan.html").read_text(encoding="utf-8")
    assert "new-rig: next experiment" in page
    assert "http://" not in page.replace("http://www.w3.org", "")


def test_commands_about_an_unknown_null_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"rig\.valve\.null"):
        plan.run(context(tmp_path, RIG.replace('null = "5 V"', 'null = "identify"')))


@pytest.mark.parametrize(
    ("removed", "wanted"),
    [('[rig.vessel]\nvolume = "160 cm^3"\n', "vessel"), ('supply_pressure = "7 bar"\n', "supply_pressure")],
)
def test_a_rig_that_is_not_described_is_refused(tmp_path: Path, removed: str, wanted: str) -> None:
    with pytest.raises(InputError, match=wanted):
        plan.run(context(tmp_path, RIG.replace(removed, "")))


def test_a_plan_is_made_for_the_valve_and_the_spring_that_the_file_states(tmp_path: Path) -> None:
    """A valve with a pressure loop moves another way than a map of areas, and its loop is no effect to be shown."""
    stated = RIG.replace('null = "5 V"', 'kind = "pressure"\nnull = "0 V"')
    answer = plan.run(context(tmp_path, stated))
    assert "pressure-control" not in {p["effect"] for p in answer["power"]}
    cylinder = '[rig.cylinder]\npiston_area_1 = "9.5 cm^2"\nstroke = "0.2 m"\nmoving_mass = "2 kg"\nspring = "2 N/mm"\n'
    model = plan.described_rig(context(tmp_path, stated + cylinder)).expectation.model
    assert {e.name for e in model.effects} == {"pressure-control", "spring-force"}
    assert model.values["spring-force.stiffness"] == 2000.0


# --- recordings of a plan go into the pipeline file as those of their bench; the answer shows before and after


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


def plan_take_planned(name: str, begin: float, use: str = "train", **more: Any) -> dict[str, Any]:
    shared = {"experiment": "axis", "chamber_2": "closed", "imposed": None, "chamber": 1, "valve": None, "force": 0.0}
    return {"name": name, "use": use, "begin": begin, "end": begin + 5.0, **shared, **more}


PLAN = {
    "recordings": [plan_take_planned("plan_1", 0.0), plan_take_planned("plan_2", 7.0, "test")],
    "rivals": [{"effect": None}],
}


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
    by_hand = {
        "recordings": [plan_take_planned("plan_1", 0.0, valve="shut", force=-19.62, added_mass=2.0)],
        "rivals": [],
    }
    add_recordings(folder / "pipeline.toml", read(Plan, by_hand), [folder / "a.csv"])
    (one,) = recordings(folder)
    assert (one["valve"], one["force"], one["added_mass"]) == ("shut", "-19.62 N", "2 kg")


@pytest.mark.parametrize("files", [["missing.csv"], ["a.csv", "b.csv", "all.csv"]])
def test_a_missing_file_or_one_too_many_is_refused_and_the_file_stays(folder: Path, files: list[str]) -> None:
    with pytest.raises(InputError):
        add_recordings(folder / "pipeline.toml", read(Plan, PLAN), [folder / name for name in files])
    assert (folder / "pipeline.toml").read_text(encoding="utf-8") == PIPELINE


def test_fewer_files_than_recordings_have_to_be_named_as_planned(folder: Path) -> None:
    plan = PLAN | {"recordings": [*PLAN["recordings"], plan_take_planned("plan_3", 14.0)]}
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


def plan_take_candidate(effect: str, confidence: float, value: float) -> dict[str, Any]:
    parameters = {"mass": {"value": value, "unit": "kg", "ci95": [value - 0.1, value + 0.1]}}
    return {
        "effect": effect,
        "confidence_alone": confidence,
        "indistinguishable_from": [],
        "parameters": parameters,
        "reason": "supported" if confidence > 0.5 else "not-significant",
    }


def test_before_and_after_show_probabilities_intervals_and_what_is_decided() -> None:
    before = {
        "pipeline": "rig",
        "verdict": "unexplained",
        "missing": [],
        "candidates": [plan_take_candidate("mass", 0.1, 0.9)],
    }
    after = before | {"missing": ["mass"], "candidates": [plan_take_candidate("mass", 0.9, 1.2)]}
    plan = read(Plan, PLAN | {"rivals": [{"effect": "mass"}]})
    found = taken_answer(read(Diagnosis, before), read(Diagnosis, after), plan, [])
    assert found.decided == [Decided("mass", "named")]
    assert (found.effects[0].before, found.effects[0].after) == (0.1, 0.9)
    parameter = found.parameters[0]
    assert parameter.before is not None
    assert parameter.before.value == 0.9
    assert (parameter.after.low, parameter.after.high) == pytest.approx((1.1, 1.3))
    assert found.sentence == "mass is now named."
