"""The model under a command of one's own: as the stage simulates it, from where one says, with one's own numbers."""

from typing import Any

import numpy as np
import pytest

import pneucli
from pneucli.io.artifacts import read_table


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
