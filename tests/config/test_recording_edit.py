"""New recordings go into the pipeline file; everything else in it stays as it was."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from pneucli.config.effect_edit import append_recordings
from pneucli.errors import InputError

TEXT = """# my rig
[pipeline]
name = "a"   # short

[[recordings]]
name = "one"
file = "one.csv"   # the first
experiment = "axis"

[model]
effects = []  # none
"""


def test_comments_and_layout_stay(tmp_path: Path):
    file = tmp_path / "pipeline.toml"
    file.write_text(TEXT, encoding="utf-8")
    append_recordings(file, [{"name": "two", "file": "two.csv", "use": "test"}])
    text = file.read_text(encoding="utf-8")
    for line in TEXT.splitlines():
        assert line in text
    recordings = tomllib.loads(text)["recordings"]
    assert recordings[1] == {"name": "two", "file": "two.csv", "use": "test"}
    assert recordings[0]["name"] == "one"


def test_a_file_without_recordings_gets_its_first(tmp_path: Path):
    file = tmp_path / "pipeline.toml"
    file.write_text('[pipeline]\nname = "a"\n', encoding="utf-8")
    append_recordings(file, [{"name": "two"}, {"name": "three"}])
    assert [r["name"] for r in tomllib.loads(file.read_text(encoding="utf-8"))["recordings"]] == ["two", "three"]


def test_recordings_that_are_no_tables_are_refused_and_the_file_stays(tmp_path: Path):
    file = tmp_path / "pipeline.toml"
    file.write_text("recordings = 3\n", encoding="utf-8")
    with pytest.raises(InputError):
        append_recordings(file, [{"name": "two"}])
    assert file.read_text(encoding="utf-8") == "recordings = 3\n"


def test_the_first_recordings_of_a_file_are_separated_by_one_blank_line(tmp_path: Path) -> None:
    file = tmp_path / "pipeline.toml"
    file.write_text('[compare]\nhorizon = "1 s"\n', encoding="utf-8")
    append_recordings(file, [{"name": "one"}, {"name": "two"}])
    expected = '[compare]\nhorizon = "1 s"\n\n[[recordings]]\nname = "one"\n\n[[recordings]]\nname = "two"\n'
    assert file.read_text(encoding="utf-8") == expected
