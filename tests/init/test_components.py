"""Cylinders and valves by part number."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.init.components import COLUMNS, find_component, with_components
from pneucli.stages import init

HEAD = "part,kind,bore,rod,moving_mass,moving_mass_per_stroke,null,source\n"
OWN = "AX-40-{stroke},cylinder,40 mm,16 mm,0.5 kg,1.6 kg/m,,sheet 7\nPV-1,valve,,,,,5 V,sheet 8\n"


@pytest.fixture
def own(tmp_path: Path) -> Path:
    file = tmp_path / "parts.csv"
    file.write_text(HEAD + OWN)
    return file


def rig(text: str) -> dict[str, dict[str, str]]:
    found: dict[str, dict[str, str]] = tomllib.loads(text)["rig"]
    return found


def test_a_cylinder_gives_areas_stroke_and_mass(own: Path) -> None:
    part = find_component("AX-40-250-PPV", "cylinder", own)
    cylinder = rig(with_components("[rig]\n", [part]))["cylinder"]
    assert cylinder == {
        "piston_area_1": f"{np.pi / 4 * 16:.6g} cm^2",
        "piston_area_2": f"{np.pi / 4 * (16 - 2.56):.6g} cm^2",
        "stroke": "250 mm",
        "moving_mass": "0.9 kg",  # 0.5 kg and 1.6 kg/m over 0.25 m
    }


def test_every_line_has_its_source(own: Path) -> None:
    text = with_components("[rig]\n", [find_component("ax-40-100", "cylinder", own)])
    lines = [line for line in text.splitlines() if "=" in line]
    assert lines
    assert all(line.endswith("# ax-40-100: sheet 7") for line in lines)


def test_the_shipped_table_states_only_what_its_sources_do() -> None:
    valve = find_component("SY5000", "valve")
    assert valve.row["source"].startswith("https://")
    text = with_components("[rig]\n", [valve])
    assert rig(text)["valve"] == {"arrangement": "5/3", "kind": "switching"}
    assert "C = 2.8 dm^3/(s bar), b = 0.37" in text
    cylinder = find_component("DSBG-32-200-PPVA-N3", "cylinder")
    assert set(rig(with_components("[rig]\n", [cylinder]))["cylinder"]) == {"piston_area_1", "stroke"}  # no rod


@pytest.mark.parametrize(
    ("number", "kind", "near"), [("DSBG-23-200", "cylinder", "DSBG-32-{stroke}"), ("SY500", "valve", "SY5000")]
)
def test_an_unknown_part_lists_near_names(number: str, kind: str, near: str) -> None:
    with pytest.raises(InputError, match="in the tables") as error:
        find_component(number, kind)
    assert near in error.value.mend
    assert "--components" in error.value.mend


def test_a_valve_is_no_cylinder(own: Path) -> None:
    with pytest.raises(InputError):
        find_component("PV-1", "cylinder", own)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("part,kind,bore\nA,cylinder,40 mm\n", 'no column "source"'),
        ("part,kind,sorce,source\n", 'unknown column "sorce"'),
        ("part,kind,bore,source\nA,cylinder,40 bar,x\n", "line 2, column bore"),
        ("part,kind,bore,source\nA,pump,40 mm,x\n", "line 2"),
    ],
)
def test_a_fault_of_a_table_is_told_with_its_place(tmp_path: Path, text: str, place: str) -> None:
    (tmp_path / "own.csv").write_text(text)
    with pytest.raises(InputError) as error:
        find_component("A", "cylinder", tmp_path / "own.csv")
    assert place in str(error.value)


def test_a_new_pipeline_has_the_parts_in_place_of_questions(tmp_path: Path, own: Path) -> None:
    time = 0.001 * np.arange(400)
    columns = np.column_stack([time, 2 + np.sin(9 * time), 2 - np.sin(9 * time), 80 + 50 * np.cos(9 * time)])
    np.savetxt(tmp_path / "a.csv", columns, delimiter=",", header="t [s],P1 [bar],P2 [bar],x [mm]")
    part = find_component("AX-40-250", "cylinder", own)
    answer = init.create(tmp_path / "p", [tmp_path / "a.csv"], parts=[part])
    assert [one.key for one in answer.fill_in if "piston_area" in one.key or "stroke" in one.key] == []
    assert rig((tmp_path / "p" / "pipeline.toml").read_text())["cylinder"]["stroke"] == "250 mm"


def test_the_page_has_every_column() -> None:
    page = (Path(__file__).parents[2] / "docs" / "rig.md").read_text(encoding="utf-8")
    assert [name for name in COLUMNS if f"`{name}`" not in page] == []
