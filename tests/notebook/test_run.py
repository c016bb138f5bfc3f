"""What a notebook sees of a run: the artifacts, as they are, with units; the valve; the model to be asked."""

import json
import re
import shutil
import subprocess
import sys
import urllib.error
import urllib.request
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

import pneucli
from pneucli.errors import InputError
from pneucli.io.artifacts import read_table
from pneucli.notebook import run
from tests.notebook.conftest import FIXTURES


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("signals", "ingest/signals"),
        ("residuals", "compare/residuals"),
        ("parameters", "identify/parameters"),
        ("ladder", "diagnose/ladder"),
        ("candidates", "diagnose/candidates"),
    ],
)
def test_a_table_is_the_artifact_with_its_units(axis: pneucli.Run, name: str, file: str) -> None:
    table = getattr(axis, name)
    written = read_table(axis.artifacts / f"{file}.parquet")
    assert list(table.columns) == list(written)
    assert table.attrs["units"].keys() == written.keys()
    numeric = [c for c in table if table[c].dtype.kind == "f"]
    assert numeric
    for column in numeric:
        np.testing.assert_array_equal(table[column], written[column])


def test_units_of_signals_are_si(axis: pneucli.Run) -> None:
    units = axis.signals.attrs["units"]
    assert {c: units[c] for c in ("time", "p1", "x", "a")} == {"time": "s", "p1": "Pa", "x": "m", "a": "m/s^2"}
    assert axis.signals.attrs["schema"] == "pneucli/ingest/signals/1"


def test_asking_for_a_table_brings_its_stage_up_to_date(axis: pneucli.Run) -> None:
    axis.residuals  # noqa: B018 - asking is what brings it up
    before = (axis.artifacts / "compare" / "stage.json").stat().st_mtime_ns
    assert axis.answer("compare")["error"]["test"] < 1.5
    assert (axis.artifacts / "compare" / "stage.json").stat().st_mtime_ns == before


def test_a_folder_of_artifacts_opens_without_its_pipeline_file(valve: pneucli.Run, tmp_path: Path) -> None:
    valve.residuals  # noqa: B018
    sent = shutil.copytree(valve.artifacts, tmp_path / "sent")
    here = pneucli.open(sent)
    assert here.recordings == valve.recordings
    assert here.answer("compare") == valve.answer("compare")
    free = [pneucli.simulate(run, recording="stairs_2")["p1"] for run in (here, valve)]
    np.testing.assert_array_equal(*free)
    with pytest.raises(pneucli.InputError, match="this stage has not run"):
        here.answer("design")


def test_a_folder_without_artifacts_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(pneucli.InputError, match="no stage's artifacts are here"):
        pneucli.open(tmp_path)
    with pytest.raises(pneucli.InputError, match="no such file"):
        pneucli.open(tmp_path / "nowhere.toml")


def test_the_map_is_that_of_the_artifact_at_its_points_and_lies_between_them_elsewhere(valve: pneucli.Run) -> None:
    table = valve.valve.map
    some = table.iloc[:: max(1, len(table) // 50)]
    np.testing.assert_allclose(valve.valve.dp_dt(some["u"], some["p"]), some["p_gradient"], rtol=1e-9, atol=1e-6)
    u = np.unique(table["u"])[-3:-1]
    low, middle, high = valve.valve.dp_dt([u[0], u.mean(), u[1]], 4e5)
    assert min(low, high) <= middle <= max(low, high)


def test_the_command_for_a_gradient_gives_that_gradient(valve: pneucli.Run) -> None:
    wanted = valve.valve.dp_dt([1.5, 4.0, 8.0], 4e5)
    command = valve.valve.command(wanted, 4e5)
    np.testing.assert_allclose(command, [1.5, 4.0, 8.0], atol=0.05)
    np.testing.assert_allclose(valve.valve.dp_dt(command, 4e5), wanted, rtol=0.02)
    assert valve.valve.reachable(wanted, 4e5).all()


def test_an_unreachable_gradient_gives_the_limit_and_an_unidentified_one_nan(valve: pneucli.Run) -> None:
    most = valve.valve.inverse["u"].max()
    assert valve.valve.command(1e12, 4e5) == pytest.approx(most, rel=1e-6)
    assert not valve.valve.reachable(1e12, 4e5)
    assert np.isnan(valve.valve.dp_dt(5.0, 1e8))
    assert np.isnan(valve.valve.command(0.0, 1e8))
    with pytest.raises(pneucli.InputError, match="there is no map of chamber 2"):
        valve.valve_2  # noqa: B018


def test_correlation_is_square_with_ones(valve: pneucli.Run) -> None:
    table = valve.correlation
    assert list(table.index) == list(table.columns) == list(valve.parameters["name"][: len(table)])
    np.testing.assert_array_equal(np.diag(table), 1.0)
    np.testing.assert_allclose(table, table.T)


def test_it_loads_nothing_heavy_until_it_is_used() -> None:
    heavy = "{'numpy', 'pandas', 'numba', 'matplotlib', 'pyarrow', 'pydantic', 'scipy'}"
    code = f"import sys, pneucli, json; print(json.dumps(sorted({heavy} & set(sys.modules))))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(run.stdout) == []


def test_the_packages_of_the_same_name_are_found_and_called() -> None:
    from pneucli import simulate
    from pneucli.diagnose.candidate import Reason
    from pneucli.simulate import layout

    assert simulate.layout is layout
    assert callable(simulate)
    assert Reason
    assert {"open", "simulate", "diagnose", "from_arrays"} <= set(dir(pneucli))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        pneucli.nothing  # noqa: B018


def test_a_run_shows_itself_at_a_glance(axis: pneucli.Run, valve: pneucli.Run) -> None:
    axis.bring_up("compare")
    text = repr(axis)
    assert "model       base" in text
    assert "× noise on test recordings" in text
    assert "driven_2" in text
    assert "<table>" in axis._repr_html_()
    assert repr(valve.valve).startswith("ValveMap: −10 to 10 V")
    assert ".residuals()" in repr(axis.plot)


def test_names_in_an_overview_are_escaped() -> None:
    assert "<b>" not in run.as_html("Run <b>", [("recordings", "<b>")])


def test_an_empty_folder_has_an_overview(tmp_path: Path) -> None:
    assert "none has run" in run.as_text("Run", run.run_overview(tmp_path))


# --- the workbench from a notebook: a frame, guarded as from the command line, and ended by hand


pytest.importorskip("aiohttp")


def status(address: str) -> int:
    try:
        with urllib.request.urlopen(address, timeout=10) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        error.close()
        return error.code


def test_a_run_is_shown_in_a_frame_until_it_is_closed(axis: pneucli.Run) -> None:
    page = axis.workbench()
    assert page.address in page._repr_html_()
    assert status(page.address) == 200
    assert status(page.address[:-1]) == 403
    page.close()
    with pytest.raises(urllib.error.URLError):
        status(page.address)


def test_a_folder_of_artifacts_has_nothing_to_change(axis: pneucli.Run) -> None:
    axis.bring_up("compare")
    with pytest.raises(InputError, match="artifacts alone"):
        pneucli.open(axis.artifacts).workbench()


# --- the examples of the documentation run, and so does the notebook


DOCS = FIXTURES.parent / "docs"


def test_every_example_of_the_page_runs(
    axis: pneucli.Run, valve: pneucli.Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for one in (axis, valve):
        one.bring_up("compare", "diagnose")
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
