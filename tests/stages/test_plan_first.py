"""The first programme of a vessel that is only described: files, commands, powers."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.io.artifacts import read_table
from pneucli.pipeline.context import Context
from pneucli.stages import plan
from pneucli.stages.pipeline_file import load_rig_description

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
def planned(tmp_path_factory: pytest.TempPathFactory):
    folder = tmp_path_factory.mktemp("first")
    return plan.run(context(folder, to=["c"])), folder / "out"


def test_the_answer_keeps_the_machine_time_and_holds_a_recording_out(planned) -> None:
    answer, _ = planned
    assert answer["schema"] == "pneucli/plan/1"
    assert 0.0 < answer["seconds"] <= 60.0
    assert "test" in [r["use"] for r in answer["recordings"]]
    assert answer["first"]


def test_commands_stay_within_the_stated_distance_of_the_null(planned) -> None:
    answer, out = planned
    with (out / "commands.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    u = np.array([float(row["u [V]"]) for row in rows])
    assert set(rows[0]) == {"time [s]", "u [V]", "recording"}
    assert np.abs(u - 5.0).max() <= 2.0
    assert u[0] == u[-1] == 5.0
    assert float(rows[-1]["time [s]"]) == pytest.approx(answer["seconds"], abs=2e-3)
    assert {row["recording"] for row in rows} - {""} == {r["name"] for r in answer["recordings"]}


def test_the_power_table_has_a_typical_and_a_detectable_size_of_each_effect(planned) -> None:
    _, out = planned
    table = read_table(out / "power.parquet")
    assert {"effect", "parameter", "size", "unit", "power"} <= set(table)
    typical = np.asarray(table["typical"], dtype=bool)
    assert "chamber-leak" in np.array(table["effect"])[typical]
    power = np.asarray(table["power"])
    assert np.all((power >= 0.0) & (power <= 1.0))
    assert np.all(power[~typical] == 0.8)
    assert "valve-deadband" not in table["effect"]  # part of a valve's map


def test_page_steps_and_player_are_written(planned) -> None:
    answer, out = planned
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
