"""The examples of the documentation run, and so does the notebook."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import matplotlib as mpl
import pytest

import pneucli
from tests.notebook.conftest import FIXTURES

DOCS = FIXTURES.parent / "docs"


def test_every_example_of_the_page_runs(
    axis: pneucli.Run, valve: pneucli.Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for run in (axis, valve):
        run.bring_up("compare", "diagnose")
    shutil.copytree(axis.artifacts, tmp_path / "artifacts" / "axis-7")
    shutil.copytree(FIXTURES / "valve_null", tmp_path, dirs_exist_ok=True)
    (tmp_path / "pipeline.toml").rename(tmp_path / "valve-3.toml")
    shutil.copytree(valve.artifacts, tmp_path / "artifacts" / "valve_null")
    monkeypatch.chdir(tmp_path)
    examples = re.findall(r"```python\n(.*?)```", (DOCS / "results.md").read_text(encoding="utf-8"), re.DOTALL)
    assert len(examples) >= 10
    names: dict[str, object] = {}
    with mpl.rc_context():
        for example in examples:
            exec(compile(example, f"docs/results.md: {example.splitlines()[0]}", "exec"), names)
    assert names["found"].verdict == "adequate"  # type: ignore[attr-defined]
    assert (tmp_path / "correlation.png").is_file()


def test_the_notebook_runs_from_beginning_to_end(tmp_path: Path) -> None:
    nbformat = pytest.importorskip("nbformat", reason="no nbformat (extra dev)")
    nbclient = pytest.importorskip("nbclient", reason="no nbclient (extra dev)")
    shutil.copytree(FIXTURES / "valve_null", tmp_path / "fixtures" / "valve_null")
    (tmp_path / "docs").mkdir()
    notebook = nbformat.read(DOCS / "notebook.ipynb", as_version=4)
    assert all(not cell.get("outputs") for cell in notebook.cells)  # the repository holds what was asked, not answers
    done = nbclient.NotebookClient(
        notebook, timeout=120, resources={"metadata": {"path": str(tmp_path / "docs")}}
    ).execute()
    outputs = [output for cell in done.cells for output in cell.get("outputs", [])]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 3
    assert "Nothing is missing" in "".join(output.get("text", "") for output in outputs)
