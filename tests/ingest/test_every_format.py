"""One law for all formats: the same rows, written in every one, give the same signals and the same repairs."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneucli import messages
from pneucli.config import load
from pneucli.errors import InputError
from pneucli.io.artifacts import read_table
from pneucli.io.recordings import load_recordings
from pneucli.pipeline.graph import Context
from pneucli.stages import ingest
from pneucli.stages.ingest import LOSS_MESSAGES, loss_column

Columns = dict[str, np.ndarray]
N = 120
PIPELINE = """
[pipeline]
name = "bench"
[rig]
vessel = {{ volume = "160 cm^3" }}
[signals]
time = {{ column = "{clock}", unit = "s" }}
u = {{ column = "{u}", unit = "V"{u_where} }}
p1 = {{ column = "{p1}", unit = "bar", noise = "2 mbar"{p1_where} }}
[[recordings]]
name = "a"
file = "{file}"
experiment = "valve"
use = "train"
{more}
"""


def clean() -> Columns:
    rng = np.random.default_rng(3)
    t = 1e-3 * np.arange(N)
    return {"t": t, "u": np.where(t > 0.05, 2.0, 0.0), "p1": 1 + 5 * (1 - np.exp(-t / 0.03)) + rng.normal(0, 2e-3, N)}


def text(delimiter: str, decimal: str = ".") -> Callable[[Path, Columns], None]:
    def write(path: Path, data: Columns) -> None:
        rows = [
            delimiter.join(repr(float(v)).replace(".", decimal) for v in row)
            for row in zip(*data.values(), strict=True)
        ]
        path.write_text("\n".join([delimiter.join(data), *rows]) + "\n")

    return write


def long_text(path: Path, data: Columns) -> None:
    rows = [
        f"{float(t)!r},{name},{float(values[k])!r}"
        for k, t in enumerate(data["t"])
        for name, values in ((n, v) for n, v in data.items() if n != "t")
    ]
    path.write_text("\n".join(["t,channel,value", *rows]) + "\n")


def tdms(path: Path, data: Columns) -> None:
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(str(path)) as writer:
        for part in np.array_split(np.arange(data["t"].size), 3):
            writer.write_segment([ChannelObject("g", name, values[part]) for name, values in data.items()])


def mat5(path: Path, data: Columns) -> None:
    from scipy.io import savemat

    savemat(path, {"rec": data, "image": np.zeros((3, 4, 5))}, do_compression=True)


def hdf5(path: Path, data: Columns) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        for name, values in data.items():
            file.create_dataset(f"g/{name}", data=values, compression="gzip")


def mat73(path: Path, data: Columns) -> None:
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in data.items():
            file.create_dataset(name, data=values[None, :])
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def parquet(path: Path, data: Columns) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table(data), path, row_group_size=50)


def mdf4(path: Path, data: Columns) -> None:
    from asammdf import MDF, Signal

    with MDF(version="4.10") as mdf:
        signals = [Signal(values, data["t"], name=name) for name, values in data.items() if name != "t"]
        mdf.append(signals, common_timebase=True)
        path = mdf.save(path.with_suffix(".mf4")).rename(path)


FORMATS = {
    "comma": text(","),
    "semicolon": text(";", ","),
    "tab": text("\t"),
    "long": long_text,
    "tdms": tdms,
    "mat5": mat5,
    "mat73": mat73,
    "hdf5": hdf5,
    "parquet": parquet,
    "mdf4": mdf4,
}


def ingested(name: str, data: Columns, folder: Path, more: str = "") -> tuple[dict[str, Any], Columns]:
    """Write ``data`` in a format and ingest it: the answer, and the signals."""
    FORMATS[name](folder / "raw", data)
    long = name == "long"
    messages = {
        "u": "value" if long else "u",
        "p1": "value" if long else "p1",
        "clock": "time" if name == "mdf4" else "t",
    }
    for signal in ("u", "p1"):
        messages[f"{signal}_where"] = f', where = {{ column = "channel", equals = "{signal}" }}' if long else ""
    (folder / "p.toml").write_text(PIPELINE.format(file="raw", more=more, **messages))
    answer = ingest.run(Context(folder / "p.toml", load(folder / "p.toml"), folder / "out", folder))
    (one,) = load_recordings(folder / "out")
    table = read_table(folder / "out" / "recordings.parquet")
    (row,) = answer["recordings"]
    assert {key: row[key] for key in ("rows_read", "samples")} == {
        "rows_read": int(table["rows_read"][0]),
        "samples": one.time.size,
    }
    assert row["rows_read"] == one.time.size + sum(int(table[loss_column(kind)][0]) for kind in LOSS_MESSAGES)
    return answer, {"t": one.time, "u": one["u"], "p1": one["p1"]}


def repairs(answer: dict[str, Any]) -> set[tuple[str, str, int]]:
    return {(one["signal"], one["kind"], one["count"]) for one in answer["repairs"]}


def expected_rows(name: str, rows: int) -> int:
    return 2 * rows if name == "long" else rows


faults = st.fixed_dictionaries(
    {
        "same": st.sampled_from([(), (40,), (40, 41, 42, 80)]),
        "back": st.sampled_from([(), (60,), (60, 61)]),
        "blank": st.sampled_from([(), (20,), (0, 70, 119)]),
        "missing": st.sampled_from([(), (30,), (30, 100)]),
        "huge": st.sampled_from([(), (90,), (90, 91)]),
        "more": st.sampled_from(["", 'from = "0.01 s"\nto = "0.1 s"']),
    }
)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(fault=faults)
def test_every_format_gives_the_same_signals_and_the_same_repairs(fault: dict[str, Any]) -> None:
    data = clean()
    for k in fault["same"]:
        data["t"][k] = data["t"][k - 1]
    for k in fault["back"]:
        data["t"][k] -= 0.02
    data["t"][list(fault["blank"])] = np.nan
    data["p1"][list(fault["missing"])] = np.nan
    data["p1"][list(fault["huge"])] = 1e308
    results = {}
    for name in FORMATS:
        with tempfile.TemporaryDirectory() as folder:
            results[name] = ingested(name, data, Path(folder), fault["more"])
    answer, signals = results["comma"]
    lost = len(fault["same"]) + len(fault["back"]) + len(fault["blank"])
    assert answer["recordings"][0]["samples"] + answer["recordings"][0]["outside"] == N - lost
    for name, (other, values) in results.items():
        assert repairs(other) == repairs(answer), name
        assert other["recordings"][0]["rows_read"] == expected_rows(name, N), name
        for signal, column in values.items():
            np.testing.assert_allclose(column, signals[signal], rtol=1e-12, equal_nan=True, err_msg=name)


@pytest.mark.parametrize("name", FORMATS)
def test_a_clock_that_runs_back_is_refused_in_every_format(name: str, tmp_path: Path) -> None:
    data = clean()
    data["t"][60:] -= 0.03
    with pytest.raises(InputError, match=r" \d+: the time goes back from 0\.059 s to 0\.03 s") as error:
        ingested(name, data, tmp_path)
    at = {"long": "line 122", "comma": "line 62", "semicolon": "line 62", "tab": "line 62"}
    assert at.get(name, "row 61") in str(error.value)
    assert not list((tmp_path / "out").glob("*.parquet"))


def test_rows_that_were_lost_are_printed(tmp_path: Path) -> None:
    data = clean()
    data["t"][40] = data["t"][39]
    answer, _ = ingested("long", data, tmp_path)
    said = " ".join(messages.render("ingest", answer, "p.toml").split())
    assert "a: of 240 rows 119 became samples: 1 row repeats a time stamp; the last was kept, 120 rows" in said
