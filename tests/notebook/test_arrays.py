"""Recordings that are arrays are diagnosed as the same recordings in files are."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pneucli
from pneucli.document import read_toml
from pneucli.io.artifacts import read_table
from pneucli.notebook.data_frames import select_rows


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
