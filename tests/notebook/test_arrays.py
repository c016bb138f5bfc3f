"""Recordings that are arrays are diagnosed as the same recordings in files are."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pneucli
from pneucli.document import read_toml
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
