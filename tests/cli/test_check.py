"""``pneucli check``: what a pipeline reads and lacks is said, and nothing is run."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import Command

FRICTION = """
[pipeline]
name = "slow"
[signals]
time = { column = "t", unit = "s" }
force = { column = "F", unit = "N" }
x = { column = "X", unit = "mm" }
[[recordings]]
name = "strokes"
file = "strokes.csv"
experiment = "friction"
use = "train"
chamber_2 = "open"
"""


@pytest.fixture
def strokes(tmp_path: Path) -> Path:
    """A pipeline of one slow to-and-fro motion, with its raw file."""
    time = 0.01 * np.arange(400)
    rows = np.column_stack([time, 30.0 * np.sign(np.cos(time)), 50.0 * np.sin(time), 2.0 + 0.1 * np.sin(time)])
    np.savetxt(tmp_path / "strokes.csv", rows, delimiter=",", header="t,F,X,P", comments="", fmt="%.6f")
    file = tmp_path / "slow.toml"
    file.write_text(FRICTION)
    return file


def test_a_pipeline_that_reads_is_listed_signal_by_signal(pneucli: Command, strokes: Path) -> None:
    answer = json.loads(pneucli("check", strokes, "--json").out)
    assert answer["faults"] == []
    (one,) = answer["recordings"]
    assert {row["signal"]: (row["column"], row["unit"]) for row in one["signals"]} == {
        "time": ("t", "s"),
        "force": ("F", "N"),
        "x": ("X", "mm"),
    }


def test_where_nothing_is_missing_the_exit_code_is_0_and_run_comes_next(pneucli: Command, strokes: Path) -> None:
    result = pneucli("check", strokes)
    assert result.code == 0, result.out + result.err
    assert "pneucli run" in result.out


def test_a_piston_area_that_a_pressure_asks_for_is_missing_with_exit_2(pneucli: Command, strokes: Path) -> None:
    strokes.write_text(FRICTION.replace("[[recordings]]", 'p1 = { column = "P", unit = "bar" }\n[[recordings]]'))
    result = pneucli("check", strokes)
    assert result.code == 2
    assert "piston_area_1" in result.out


def test_a_column_that_is_not_there_is_named_with_exit_2(pneucli: Command, strokes: Path) -> None:
    strokes.write_text(FRICTION.replace('column = "X"', 'column = "Y"'))
    result = pneucli("check", strokes)
    assert result.code == 2
    assert 'no column "Y"' in " ".join(result.out.split())  # lines wrap where the path ends
    assert "no file has" not in result.out  # of the other signals, in a file that was not read


def test_every_column_that_no_file_has_is_a_fault_with_the_one_that_is_like_it(pneucli: Command, strokes: Path) -> None:
    """Without p2 the recording can be read, as another one."""
    signals = 'p2 = { column = "PP", unit = "bar" }\nv = { column = "Q", unit = "m/s" }\n[[recordings]]'
    strokes.write_text(FRICTION.replace("[[recordings]]", signals))
    result = pneucli("check", strokes, "--json")
    faults = json.loads(result.out)["faults"]
    assert result.code == 2
    assert [one["found"].rpartition(": ")[2] for one in faults] == ['no column "PP"', 'no column "Q"']
    assert [one["mend"].partition("; ")[0] for one in faults] == ['did you mean "P"?', "free: P"]
    assert faults[0]["where"].endswith("slow.toml, line 8, key signals.p2.column")


def test_a_column_that_may_be_absent_is_no_fault(pneucli: Command, strokes: Path) -> None:
    signals = 'p2 = { column = "PP", unit = "bar", optional = true }\n[[recordings]]'
    strokes.write_text(FRICTION.replace("[[recordings]]", signals))
    answer = json.loads(pneucli("check", strokes, "--json").out)
    assert answer["faults"] == []
    assert answer["left_out"] == ["[signals] p2: absent from 1 of 1 recordings; optional"]


def test_a_chamber_that_is_not_there_has_no_empty_mend(pneucli: Command, strokes: Path) -> None:
    strokes.write_text(FRICTION + "chamber = 3\n")
    result = pneucli("check", strokes)
    assert "wanted: 1 or 2" in result.err
    assert "mend" not in result.err


def test_a_raw_file_that_is_not_there_is_named_with_exit_2(pneucli: Command, strokes: Path) -> None:
    (strokes.parent / "strokes.csv").unlink()
    result = pneucli("check", strokes)
    assert result.code == 2
    assert "strokes.csv" in result.out + result.err


def test_what_waits_to_be_filled_in_does_not_hide_the_rest(pneucli: Command, strokes: Path) -> None:
    rig = '[rig.cylinder]\npiston_area_1 = "? cm^2"\n[signals]'
    pressure = 'p1 = { column = "P", unit = "bar", scale = "?" }\n[[recordings]]'
    strokes.write_text(FRICTION.replace("[signals]", rig).replace("[[recordings]]", pressure))
    result = pneucli("check", strokes, "--json")
    assert result.code == 2
    answer = json.loads(result.out)
    assert [row["signal"] for row in answer["recordings"][0]["signals"]] == ["time", "p1", "x", "force"]
    assert [one["where"].rpartition(" ")[2] for one in answer["faults"]] == [
        "rig.cylinder.piston_area_1",
        "signals.p1",
    ]
    assert 'such as "1 cm^2"' in answer["faults"][0]["wanted"]
    assert answer["missing"] == []


def test_a_parameter_in_a_unit_of_another_quantity_is_named_with_exit_2(pneucli: Command, strokes: Path) -> None:
    """What identify would refuse, before anything is read whole."""
    stated = '[model.parameters]\n"friction.viscous" = { fixed = "3 bar" }\n[signals]'
    strokes.write_text(FRICTION.replace("[signals]", stated, 1))
    result = pneucli("check", strokes, "--json")
    assert result.code == 2
    (fault,) = json.loads(result.out)["faults"]
    assert fault["where"].endswith('key model.parameters."friction.viscous".fixed')
    assert fault["found"] == '"3 bar" has not the dimension of N s/m'


def test_no_stage_is_run_and_nothing_is_written(pneucli: Command, strokes: Path) -> None:
    before = sorted(strokes.parent.rglob("*"))
    pneucli("check", strokes)
    assert sorted(strokes.parent.rglob("*")) == before


def test_of_a_file_that_is_gone_check_says_that_alone(pneucli: Command, strokes: Path) -> None:
    (strokes.parent / "strokes.csv").unlink()
    answer = json.loads(pneucli("check", strokes, "--json").out)
    assert [one["found"].partition(" /")[0] for one in answer["faults"]] == ["no file"]
    assert answer["left_out"] == []


def test_check_says_which_line_a_file_is_cut_off_in(pneucli: Command, strokes: Path) -> None:
    raw = strokes.parent / "strokes.csv"
    raw.write_text(raw.read_text() + "4.00,3")
    assert "line 402, the last, is cut off" in " ".join(pneucli("check", strokes).out.split())


def test_a_column_that_a_signal_takes_is_not_proposed_to_another(pneucli: Command, strokes: Path) -> None:
    strokes.write_text(FRICTION.replace("[[recordings]]", 'p1 = { column = "F1", unit = "bar" }\n[[recordings]]'))
    said = " ".join(pneucli("check", strokes).out.split())
    assert 'no column "F1"' in said
    assert 'did you mean "F"' not in said
    assert "free: P" in said
