"""The same recording in every format that is read, and text in the ways in which labs write it."""

import gc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pneucli.errors import InputError
from pneucli.io.raw import Channel, RawFile
from pneucli.io.signals import open_signals

T = np.arange(50) * 1e-3
P = 3.0 + np.sin(40 * T)
CHANNELS = {"time": Channel("t"), "p1": Channel("p", factor=1e5, offset=1e5)}


def write_parquet(path: Path) -> None:
    pq.write_table(pa.table({"t": T, "p": P}), path)


def write_mat5(path: Path) -> None:
    from scipy.io import savemat

    savemat(path, {"t": T[:, None], "data": {"p": P[None, :]}, "gain": 3.0})


def write_hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        file["t"], file["data/p"] = T[None, :], P[None, :]


def write_mat73(path: Path) -> None:
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"], file["data/p"] = T[None, :], P[None, :]
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, written by a test".ljust(128))


def write_tdms(path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject("group", "t", T), ChannelObject("group", "p", P)])


def write_mdf(path: Path) -> None:
    from asammdf import MDF, Signal

    with MDF(version="4.10") as mdf:
        mdf.append([Signal(P, T, name="p")])
        mdf.save(path)


def read(raw: RawFile) -> dict[str, np.ndarray]:
    parts = list(open_signals(raw).batches())
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("a.parquet", write_parquet),
        ("a.mat", write_mat5),
        ("a.h5", write_hdf5),
        ("b.mat", write_mat73),
        ("a.tdms", write_tdms),
    ],
)
def test_every_format_gives_the_same_signals(tmp_path: Path, name: str, write: Callable[[Path], None]) -> None:
    write(tmp_path / name)
    signals = read(RawFile(tmp_path / name, CHANNELS))
    np.testing.assert_array_equal(signals["time"], T)
    np.testing.assert_array_equal(signals["p1"], P * 1e5 + 1e5)


def test_mdf4_brings_its_master_as_time(tmp_path: Path) -> None:
    write_mdf(tmp_path / "a.mf4")
    signals = read(RawFile(tmp_path / "a.mf4", {"time": Channel("time"), "p1": Channel("p")}))
    np.testing.assert_array_equal(signals["time"], T)
    np.testing.assert_array_equal(signals["p1"], P)


def test_tdms_waveforms_bring_their_own_clock(tmp_path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    clock = {"wf_increment": 1e-3, "wf_start_offset": 0.0, "wf_samples": 50}
    with TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment([ChannelObject("group", "p", P, properties=clock)])
    signals = read(RawFile(tmp_path / "a.tdms", {"time": Channel("time"), "p1": Channel("p")}))
    np.testing.assert_allclose(signals["time"], T, atol=1e-15)


EXPECTED = ([0.0, 0.5, 1.5], [1234.5, 2.25, np.nan])
TEXTS = {
    "plain": (b"t,p\n0,1234.5\n0.5,2.25\n1.5,\n", {}),
    "comments": (b"# rig\nt,p\n# first\n0,1234.5\n# a,b\n0.5,2.25\n  # end\n1.5,NaN\n", {}),
    "semicolon and decimal comma": (b"t;p\n0,0;1234,5\n0,5;2,25\n1,5;\n", {}),
    "thousands": (b"t;p\n0,0;1.234,5\n0,5;2,25\n1,5;-\n", {"decimal": ",", "thousands": "."}),
    "tabs and CRLF": (b"t\tp\r\n0\t1234.5\r\n0.5\t2.25\r\n1.5\tNaN\r\n", {}),
    "blanks": (b"  t   p\n  0 1234.5\n0.5    2.25 \n 1.5 nan\n", {}),
    "a line of units": (b"t,p\ns,bar\n0,1234.5\n0.5,2.25\n1.5,\n", {}),
    "quotes": (b'"t","p"\n"0","1234.5"\n"0.5","2.25"\n"1.5",""\n', {}),
    "spaces after commas": (b"t, p\n0, 1234.5\n0.5, 2.25\n1.5, nan\n", {}),
    "rows to skip": (b"made by logger 7\n\nt,p\n0,1234.5\n0.5,2.25\n1.5,\n", {"skip_rows": 1}),
    "UTF-16": ("t,p\n0,1234.5\n0.5,2.25\n1.5,\n".encode("utf-16"), {}),
    "a byte order mark": (b"\xef\xbb\xbft,p\n0,1234.5\n0.5,2.25\n1.5,\n", {}),
    "Latin-1": ("t,p,°\n0,1234.5,1\n0.5,2.25,1\n1.5,,1\n".encode("latin-1"), {}),
    "a delimiter at the end of rows": (b"t;p\n0;1234.5;\n0.5;2.25;\n1.5;;\n", {}),
    "no end of line": (b"t,p\n0,1234.5\n0.5,2.25\n1.5,nan", {}),
    "a last line cut off": (b"t,p\n0,1234.5\n0.5,2.25\n1.5,nan\n2.", {}),
}


@pytest.mark.parametrize("way", TEXTS)
def test_text_is_read_as_it_was_meant(tmp_path: Path, way: str) -> None:
    content, options = TEXTS[way]
    (tmp_path / "a.csv").write_bytes(content)
    signals = read(RawFile(tmp_path / "a.csv", {"time": Channel("t"), "p1": Channel("p")}, **options))
    np.testing.assert_array_equal(signals["time"], EXPECTED[0])
    np.testing.assert_array_equal(signals["p1"], EXPECTED[1])


def test_columns_by_number_without_header_and_marks_of_one_column(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(b"0.000;3.658\n100.000;3.657\n1.200.000;3.6\n")
    channels = {"time": Channel(1, factor=1e-6, thousands="."), "p1": Channel(2)}
    signals = read(RawFile(tmp_path / "a.csv", channels, header=False))
    np.testing.assert_allclose(signals["time"], [0, 0.1, 1.2], rtol=1e-12)
    np.testing.assert_array_equal(signals["p1"], [3.658, 3.657, 3.6])


def test_a_long_table_is_merged_over_all_its_time_stamps(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("channel,t,value\nT,1,280\nT,2,270\np,0,7\np,2,6\n")
    channels = {
        "time": Channel("t"),
        "p1": Channel("value", where=("channel", "p")),
        "temperature": Channel("value", where=("channel", "T")),
    }
    signals = read(RawFile(tmp_path / "a.csv", channels))
    np.testing.assert_array_equal(signals["time"], [0, 1, 2])
    np.testing.assert_array_equal(signals["p1"], [7, np.nan, 6])
    np.testing.assert_array_equal(signals["temperature"], [np.nan, 280, 270])


MALFORMED = {
    "empty file": (b"", {}, ["the file is empty"]),
    "header only": (b"t,p\n", {}, ["line 1", "header line and no rows"]),
    "text in a number": (b"t,p\n0,1\n# c\n1,x7\n", {}, ["line 4", 'column "p"', '"x7"', "a number", "mend"]),
    "a row too short": (b"t,p,q\n0,1,2\n1,2\n2,3,4\n", {}, ["line 3", "2 columns", "wanted: 3", "mend"]),
    "rows too long": (b"t,p\n0,1\n1,2,3\n2,3\n4,5,6\n", {}, ["line 3", "3 columns", "wanted: 2"]),
    "missing column": (b"t,pp\n0,1\n", {}, ['no column "p"', '"pp"', "did you mean"]),
    "wrong delimiter": (b"t;p\n0;1\n", {"delimiter": ","}, ['no column "p"', '"t;p"']),
    "decimal comma read as point": (b"t;p\n0,5;1,5\n", {"decimal": "."}, ["line 2", '"0,5"', "decimal"]),
    "no header": (b"0,1\n1,2\n", {}, ["line 1", "numbers where the header should be", "header = false"]),
    "binary junk": (bytes(range(256)) * 8, {}, ["byte 0", "not a text file", "mend"]),
    "unknown encoding": (b"t,p\n0,1\n", {"encoding": "utf-9"}, ['no encoding is called "utf-9"']),
    "cut-off Parquet": (b"PAR1" + bytes(50), {}, ["cannot be read as Parquet", "copy or export it again"]),
    "cut-off HDF5": (b"\x89HDF\r\n\x1a\n" + bytes(50), {}, ["cannot be read as HDF5"]),
    "cut-off TDMS": (b"TDSm" + bytes(9), {}, ["a whole TDMS file", "copy or export it again"]),
    "cut-off MDF": (b"MDF     4.10    " + bytes(20), {}, ["cannot be read as MDF4"]),
    "cut-off MAT": (b"MATLAB 5.0 MAT-file".ljust(128) + bytes(3), {}, ["cannot be read as MATLAB v5"]),
}


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("fault", MALFORMED)
def test_what_cannot_be_read_says_where_what_and_the_mend(tmp_path: Path, fault: str) -> None:
    content, options, words = MALFORMED[fault]
    (tmp_path / "a.csv").write_bytes(content)
    with pytest.raises(InputError) as error:
        read(
            RawFile(
                tmp_path / "a.csv", {"time": Channel("t"), "p1": Channel("p")}, frozenset({"time", "p1"}), **options
            )
        )
    message = str(error.value)
    del error
    gc.collect()  # asammdf complains when it is collected half-made
    assert str(tmp_path / "a.csv") in message
    assert [word for word in words if word not in message] == []


def test_an_extra_that_is_not_installed_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "nptdms", None)
    (tmp_path / "a.tdms").write_bytes(b"TDSm")
    with pytest.raises(InputError, match=r'pip install "pneucli\[tdms\]"'):
        read(RawFile(tmp_path / "a.tdms", CHANNELS))


def test_columns_of_different_length_are_refused(tmp_path: Path) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "a.mat", {"t": T, "p": P[:7]})
    with pytest.raises(InputError, match="7 values"):
        read(RawFile(tmp_path / "a.mat", CHANNELS))
