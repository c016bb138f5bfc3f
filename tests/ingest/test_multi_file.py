"""A recording in several files: their clocks are moved as stated, as their dates say, or until a signal agrees."""

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from pneucli.config import load
from pneucli.errors import InputError
from pneucli.io.multi_file import estimate_clock_offset
from pneucli.io.recordings import load_recordings
from pneucli.pipeline.graph import Context
from pneucli.stages import ingest

HEAD = """
[pipeline]
name = "two"
[signals]
time = { column = "t", unit = "s" }
x = { column = "x", unit = "mm" }
p1 = { column = "p", unit = "bar" }
[[recordings]]
file = "slow*.csv"
experiment = "friction"
use = "train"
[[recordings.more]]
file = "fast*.csv"
"""


def motion(time: np.ndarray) -> np.ndarray:
    return 100 + 30 * np.sin(2 * time) + 10 * np.sin(5.3 * time) + 5 * time


def write(path: Path, clock: np.ndarray | list[str], **columns: np.ndarray) -> None:
    rows = [
        ",".join([str(stamp), *(f"{v:.5f}" for v in row)]) for stamp, *row in zip(clock, *columns.values(), strict=True)
    ]
    path.write_text("\n".join([",".join(["t", *columns]), *rows]) + "\n")


def two(folder: Path, shift: float = 0.0, *, with_x: bool = False) -> None:
    """Positions at 50 Hz, pressures at 200 Hz on a clock that began ``shift`` s later."""
    rng = np.random.default_rng(2)
    slow, fast = np.arange(400) * 0.02, np.arange(1000) * 0.005 + 0.5
    write(folder / "slow.csv", slow, x=motion(slow) + 0.01 * rng.standard_normal(slow.size))
    also = {"x": motion(fast) + 0.01 * rng.standard_normal(fast.size)} if with_x else {}
    write(folder / "fast.csv", fast - shift, p=3 + np.sin(fast), **also)


def ingested(folder: Path, more: str = "") -> tuple[dict, list]:
    (folder / "p.toml").write_text(HEAD + more)
    answer = ingest.run(Context(folder / "p.toml", load(folder / "p.toml"), folder / "out", folder))
    return answer, load_recordings(folder / "out")


def test_files_of_one_recording_become_one_table_with_nan_between(tmp_path: Path) -> None:
    two(tmp_path)
    answer, (one,) = ingested(tmp_path)
    (row,) = answer["recordings"]
    assert (row["rows_read"], row["samples"]) == (1400, 1000)
    assert (row["joined"], row["no_overlap"]) == (250, 150)  # positions before and after the pressures are cut off
    there = np.isfinite(one["p1"])
    np.testing.assert_allclose(one["p1"][there], 1e5 * (3 + np.sin(one.time[there])), atol=2)
    assert np.isfinite(one["x"]).sum() == 250


def test_an_offset_that_is_stated_moves_the_clock(tmp_path: Path) -> None:
    two(tmp_path, shift=0.37)
    _, (one,) = ingested(tmp_path, 'offset = "370 ms"\n')
    there = np.isfinite(one["p1"])
    np.testing.assert_allclose(one["p1"][there], 1e5 * (3 + np.sin(one.time[there])), atol=2)


def test_an_offset_is_found_where_both_files_hold_a_signal(tmp_path: Path) -> None:
    two(tmp_path, shift=0.3712, with_x=True)
    answer, (one,) = ingested(tmp_path, 'offset = "find"\nmatch = "x"\n')
    (told,) = [r["message"] for r in answer["repairs"] if r["kind"] == "offset"]
    found = float(told.split("moved by ")[1].split(" ±")[0])
    assert found == pytest.approx(0.3712, abs=5e-4)
    there = np.isfinite(one["p1"])
    np.testing.assert_allclose(one["p1"][there], 1e5 * (3 + np.sin(one.time[there])), atol=60)
    assert np.isfinite(one["x"]).sum() == 250  # of the first file only, where both were recorded


def test_dates_tell_the_offset(tmp_path: Path) -> None:
    two(tmp_path)
    slow, fast = np.arange(100) * 0.02, np.arange(100) * 0.01
    dates = [(datetime(2024, 3, 21, 23, 59, 59) + timedelta(seconds=t)).isoformat(" ", "milliseconds") for t in slow]
    write(tmp_path / "slow.csv", dates, x=motion(slow))
    write(tmp_path / "fast.csv", [f"2024-03-22 00:00:00.{round(1000 * t):03d}" for t in fast], p=fast + 1)
    answer, (one,) = ingested(tmp_path)
    there = np.isfinite(one["p1"])
    assert one.time[there][0] == pytest.approx(1.0)
    there = np.isfinite(one["x"])
    np.testing.assert_allclose(one["x"][there], 1e-3 * motion(one.time[there]), atol=1e-7)
    assert any("moved by 1 s, as the dates" in r["message"] for r in answer["repairs"])


def test_a_date_in_one_of_two_files_alone_is_told(tmp_path: Path) -> None:
    two(tmp_path)
    assert not [r for r in ingested(tmp_path)[0]["repairs"] if r["kind"] == "offset"]
    slow = np.arange(100) * 0.02
    dates = [(datetime(2024, 3, 21, 23, 59, 59) + timedelta(seconds=t)).isoformat(" ", "milliseconds") for t in slow]
    write(tmp_path / "slow.csv", dates, x=motion(slow))
    (told,) = [r["message"] for r in ingested(tmp_path)[0]["repairs"] if r["kind"] == "offset"]
    assert told.startswith("fast.csv: no date says when its clock starts")


def test_each_file_of_a_glob_has_its_own_further_file(tmp_path: Path) -> None:
    two(tmp_path)
    for n in (1, 2):
        (tmp_path / f"slow_{n}.csv").write_text((tmp_path / "slow.csv").read_text())
        (tmp_path / f"fast_{n}.csv").write_text((tmp_path / "fast.csv").read_text())
    (tmp_path / "slow.csv").unlink()
    (tmp_path / "fast.csv").unlink()
    _, recordings = ingested(tmp_path)
    assert [sorted(one.signals) for one in recordings] == [["p1", "x"], ["p1", "x"]]
    (tmp_path / "fast_2.csv").unlink()
    with pytest.raises(InputError, match=r"key more\.1: 1 files \[E049\]\n  wanted: 2, one for each"):
        ingested(tmp_path)


def test_a_clock_that_runs_back_is_refused_with_its_place_in_its_own_file(tmp_path: Path) -> None:
    two(tmp_path)
    clock = np.arange(100) * 0.01
    clock[60:] -= 0.5
    write(tmp_path / "fast.csv", clock, p=clock + 1)
    with pytest.raises(InputError, match=r"fast\.csv, line 62"):
        ingested(tmp_path)


def test_a_signal_that_no_file_has_is_refused(tmp_path: Path) -> None:
    two(tmp_path)
    path = tmp_path / "p.toml"
    path.write_text(HEAD.replace('"p", unit', '"q", unit').replace('"train"', '"train"\ntake = ["x", "p1"]'))
    context = Context(path, load(path), tmp_path / "out", tmp_path)
    with pytest.raises(InputError, match=r'no column "q" \[E042\]\n  wanted: one of "t", "x", "t", "p"'):
        ingest.run(context)


T = np.arange(500) * 0.01
OTHERS = {
    "nothing alike": (np.random.default_rng(1).standard_normal(500), "is not alike in both files"),
    "not there": (None, "is not recorded in both files"),
}


@pytest.mark.parametrize("way", OTHERS)
def test_an_offset_that_nothing_tells_is_refused(way: str) -> None:
    values, says = OTHERS[way]
    other = {"time": T} if values is None else {"time": T, "x": values}
    with pytest.raises(InputError, match=says):
        estimate_clock_offset({"time": T, "x": motion(T)}, other, "x", "here")


def test_a_motion_that_repeats_itself_tells_no_offset() -> None:
    long, short = np.arange(4000) * 0.01, np.arange(800) * 0.01
    with pytest.raises(InputError, match="and as well at"):
        estimate_clock_offset(
            {"time": long, "x": np.sin(3 * long)}, {"time": short, "x": np.sin(3 * short)}, "x", "here"
        )


def test_find_and_match_belong_together(tmp_path: Path) -> None:
    two(tmp_path)
    for more in ('offset = "find"\n', 'match = "x"\n'):
        with pytest.raises(InputError, match="belong together"):
            ingested(tmp_path, more)
