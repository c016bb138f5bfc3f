"""What a notebook sees of a run: the artifacts, as they are, with units; the valve; the model to be asked."""

import json
import re
import shutil
import subprocess
import sys
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

import pneucli
from pneucli.document import read_toml
from pneucli.errors import InputError
from pneucli.io.artifacts import read_table
from pneucli.notebook import run
from pneucli.notebook.data_frames import select_rows
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


# --- recordings that are arrays are diagnosed as the same recordings in files are


@pytest.fixture(scope="module")
def recordings(axis: pneucli.Run) -> list[dict[str, Any]]:
    """The axis's recordings as arrays, as they would stand in a notebook."""
    _, document = read_toml(axis.pipeline.path)  # type: ignore[union-attr]
    keys = ("name", "experiment", "use", "chamber_2")
    return [
        {k: one[k] for k in keys}
        | {"data": select_rows(axis.signals, {"recording": one["name"]}).drop(columns="recording")}
        for one in document["recordings"]
    ]


@pytest.fixture(scope="module")
def rig(axis: pneucli.Run) -> dict[str, Any]:
    return dict(axis.pipeline.tables["rig"])  # type: ignore[union-attr]


def test_arrays_and_files_have_the_same_diagnosis(
    axis: pneucli.Run, recordings: list[dict[str, Any]], rig: dict[str, Any]
) -> None:
    of_arrays, of_files = pneucli.diagnose(recordings, rig, quiet=True), pneucli.diagnose(axis)
    assert (of_arrays.verdict, of_arrays.missing) == (of_files.verdict, of_files.missing) == ("adequate", [])
    errors = [d.ladder["error_test"].to_numpy() for d in (of_arrays, of_files)]
    np.testing.assert_allclose(*errors, rtol=1e-3)
    assert len(of_arrays.candidates) == len(of_files.candidates)


def test_a_simulated_effect_is_named(recordings: list[dict[str, Any]], rig: dict[str, Any]) -> None:
    """The pull of a slope, 25 N toward x = 0, as pressures would show it: p1 carries it."""
    heavier = []
    for one in recordings:
        data = one["data"].copy()
        data["p1"] += 25.0 / 8.04e-4
        heavier.append(one | {"data": data})
    found = pneucli.diagnose(heavier, rig, exclude=["pressure-offset", "spring-force"], quiet=True)
    assert found.missing == ["constant-force"]
    force = found.candidates[found.candidates["effect"] == "constant-force"].iloc[0]
    assert force["ci_low"] - 0.5 < 25.0 < force["ci_high"] + 0.5
    assert found.confidence["constant-force"] > 0.9


def test_the_files_are_kept_in_the_given_folder(
    recordings: list[dict[str, Any]], rig: dict[str, Any], tmp_path: Path
) -> None:
    run = pneucli.from_arrays(recordings, rig, folder=tmp_path / "kept", quiet=True)
    assert run.recordings == [one["name"] for one in recordings]
    assert (tmp_path / "kept" / "pipeline.toml").is_file()
    again = pneucli.open(tmp_path / "kept" / "pipeline.toml", quiet=True)
    assert again.recordings == run.recordings


WHOLE = {"name": "a", "experiment": "friction", "use": "train", "chamber_2": "open"}
FAULTY = [
    (WHOLE | {"p1": np.ones(3)}, "no time"),
    (WHOLE | {"time": np.arange(3.0), "p1": np.ones(4)}, r"shape \(4,\)"),
    ({k: v for k, v in WHOLE.items() if k != "use"} | {"time": np.arange(3.0)}, "use is missing"),
]


@pytest.mark.parametrize(("one", "said"), FAULTY)
def test_faulty_arrays_are_input_errors(one: dict[str, Any], said: str) -> None:
    with pytest.raises(pneucli.InputError, match=said):
        pneucli.from_arrays([one], {})


# --- the model under a command of one's own: as the stage simulates it, from where one says, with one's own numbers


def test_a_simulated_recording_equals_that_of_the_stage(valve: pneucli.Run) -> None:
    valve.bring_up("simulate")
    stage = read_table(valve.artifacts / "simulate" / "open_loop.parquet")
    mine = (np.array(stage["scenario"]) == "stairs_2") & (np.array(stage["channel"]) == "p1")
    table = pneucli.simulate(valve, recording="stairs_2")
    np.testing.assert_allclose(table["p1"], np.asarray(stage["value"])[mine])
    np.testing.assert_array_equal(table["measured_p1"], np.asarray(stage["measured"])[mine])


def test_the_vessel_fills_up_to_the_supply_and_no_further(valve: pneucli.Run) -> None:
    table = pneucli.simulate(valve, u=np.full(6000, 10.0), p_supply=5e5, start={"p1": 2e5})
    assert table["p1"].iloc[0] == pytest.approx(2e5, rel=1e-3)
    assert np.diff(table["p1"]).min() > -10.0  # Pa: the last of it is numerical
    assert table["p1"].iloc[-1] == pytest.approx(5e5, rel=1e-3)
    assert table.attrs["units"] == {"time": "s", "u": "V", "p_supply": "Pa", "p1": "Pa"}


def test_the_first_slope_is_what_the_map_says(valve: pneucli.Run) -> None:
    table = pneucli.simulate(valve, u=np.full(20, 5.0), time=np.arange(20) * 1e-4, start={"p1": 4e5})
    slope = np.polyfit(table["time"], table["p1"], 1)[0]
    assert slope == pytest.approx(float(valve.valve.dp_dt(5.0, 4e5)), rel=0.02)


def test_another_parameter_changes_the_run(valve: pneucli.Run) -> None:
    command = {"u": np.full(500, 5.0), "start": {"p1": 2e5}}
    volume = valve.model.rig.vessel_volume
    usual = pneucli.simulate(valve, **command)
    twice = pneucli.simulate(valve, **command, parameters={"rig.vessel_volume": 2 * (volume or 0.0)})
    rises = [t["p1"].iloc[40] - 2e5 for t in (usual, twice)]
    assert rises[1] == pytest.approx(rises[0] / 2, rel=0.05)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "no command"),
        ({"u": [1.0, 2.0], "p_supply": [1.0, 2.0, 3.0]}, "p_supply"),
        ({"u": [1.0, np.nan]}, "what is no number"),
        ({"u": [1.0, 2.0], "time": [0.0, 0.0]}, "do not rise"),
        ({"u": [1.0, 2.0], "start": {"y": 1.0}}, "no part of the state"),
        ({"u": [1.0, 2.0], "experiment": "friction"}, "friction"),
        ({"u": [1.0, 2.0], "parameters": {"rig.vesel_volume": 1.0}}, 'did you mean "rig.vessel_volume"'),
        ({"recording": "stairs_3"}, "did you mean"),
        ({"recording": "stairs_2", "u": [1.0, 2.0]}, "its own inputs"),
    ],
)
def test_contradicting_arguments_are_input_errors(valve: pneucli.Run, given: dict[str, Any], said: str) -> None:
    with pytest.raises(pneucli.InputError, match=said):
        pneucli.simulate(valve, **given)


def test_a_command_is_refused_where_the_run_has_no_valve(axis: pneucli.Run) -> None:
    with pytest.raises(pneucli.InputError, match="no valve"):
        pneucli.simulate(axis, u=[1.0, 2.0])
