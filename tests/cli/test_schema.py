"""``schema``, and ``effects`` of a pipeline file with effects of one's own."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from tests.cli.conftest import Command

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "docs" / "examples" / "rod_wiper.py"
OWN = """[pipeline]
name = "own"
[[recordings]]
file = "a.csv"
experiment = "friction"
use = "train"
[model]
plugins = ["rod_wiper.py"]
"""


def test_the_schema_is_printed_as_json(pneucli: Command) -> None:
    result = pneucli("schema")
    made = json.loads(result.out)
    assert made["$schema"].endswith("2020-12/schema")
    assert made == json.loads((ROOT / "docs" / "pipeline.schema.json").read_text(encoding="utf-8"))
    assert result.err == ""


def test_effects_of_a_pipeline_file_are_the_catalogues_and_its_own(pneucli: Command, tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text(OWN)
    shutil.copy(EXAMPLE, tmp_path)
    listed = pneucli("effects", tmp_path / "own.toml", "--json")
    names = [one["name"] for one in json.loads(listed.out)["effects"]]
    assert {"rod-wiper", "stribeck"} <= set(names)
    told = pneucli("effects", tmp_path / "own.toml", "rod-wiper").out
    assert told.startswith("rod-wiper: Wiper that scrapes on the way back (part: cylinder)")
    assert "dry_factor" in told
    assert pneucli("effects", "stribeck").out.startswith("stribeck: ")
    unknown = pneucli("effects", "rod-wiper")
    assert unknown.code == 2


def test_a_fault_of_an_own_effect_is_an_input_error_that_names_its_file(pneucli: Command, tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text(OWN)
    text = EXAMPLE.read_text(encoding="utf-8")
    (tmp_path / "rod_wiper.py").write_text(text.replace("gain * filled(x)", "gain * full(x)"))
    result = pneucli("effects", tmp_path / "own.toml", "rod-wiper")
    assert result.code == 2
    assert "rod_wiper.py" in result.err
    assert '"full"' in result.err
    assert "Traceback" not in result.err


def test_the_thesis_is_named_in_full_where_it_is_cited(pneucli: Command) -> None:
    told = pneucli("effects", "stribeck").out
    assert "K. Széll, Direct Modeling and Robust Control of a Servo-pneumatic System, PhD thesis" in told
