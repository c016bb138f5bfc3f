"""Text in the ways in which labs write it, and files of every format that are damaged, odd or too large."""

import gc
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pneucli.errors import InputError
from pneucli.io import packed
from pneucli.io.formats import matlab
from pneucli.io.raw_file import Channel, RawFile
from pneucli.io.signal_reader import open_signals

T = np.arange(50) * 1e-3
P = 3.0 + np.sin(40 * T)
CHANNELS = {"time": Channel("t"), "p1": Channel("p", factor=1e5, offset=1e5)}


def write_parquet(path: Path) -> None:
    pq.write_table(pa.table({"t": T, "p": P}), path)


def write_mdf(path: Path) -> None:
    from asammdf import MDF, Signal

    with MDF(version="4.10") as mdf:
        mdf.append([Signal(P, T, name="p")])
        mdf.save(path)


def read(raw: RawFile) -> dict[str, np.ndarray]:
    parts = list(open_signals(raw).batches())
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


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
    "Fortran's exponents": (
        b"t  p\n0.0D+00  1.2345D+03\n5.0D-01  2.25D+00\n1.5D+00  nan\n",
        {},
    ),
    "quotes against formulas": (b"t,p\n'0,\"'1234.5\"\n0.5,'+2.25\n1.5,\n", {}),
    "uncertainties": ("t,p\n0,1234.5 ± 0.2\n0.5,2.25±0.2\n1.5,\n".encode(), {}),
    "a minus of typography": ("t,p\n−0,1234.5\n0.5,2.25\n1.5,\n".encode(), {}),
    "no-break thousands": ("t;p\n0;1\u202f234,5\n0,5;2,25\n1,5;\n".encode(), {}),
    "durations of IEC 61131-3": (b"t,p\nT#0s,1234.5\nT#500ms,2.25\nT#1s_500ms,\n", {}),
    "durations of ISO 8601": (b"t,p\nPT0S,1234.5\nPT0.5S,2.25\nPT1.5S,\n", {}),
    "durations with days": (b"t,p\n0 days 00:00:00,1234.5\n0 days 00:00:00.5,2.25\n0 days 00:00:01.5,\n", {}),
    "compact stamps": (b"t,p\n20260311T235959.5,1234.5\n20260312T000000,2.25\n20260312T000001,\n", {}),
    "stamps of digits": (b"t,p\n20260311235959500,1234.5\n20260312000000000,2.25\n20260312000001000,\n", {}),
    "IEC's date and time": (
        b"t,p\nDT#2026-03-11-23:59:59.5,1234.5\nDT#2026-03-12-00:00:00,2.25\nDT#2026-03-12-00:00:01,\n",
        {},
    ),
    "months in German": (
        "t;p\n31. März 2026 23:59:59,5;1234,5\n1. Apr. 2026 00:00:00;2,25\n1. Apr. 2026 00:00:01;\n".encode(),
        {},
    ),
    "below the range": (b"t,p\n0,1234.5\n0.5,2.25\n1.5,<1.0\n", {}),
    "line protocol": (
        b"rig,bench=3 t=0,p=1234.5 1773220502000000000\nrig,bench=3 t=0.5,p=2.25 1773220502500000000\n"
        b"rig,bench=3 t=1.5,p=nan 1773220503000000000\n",
        {"header": False},
    ),
    "a last line cut off": (b"t,p\n0,1234.5\n0.5,2.25\n1.5,nan\n2.", {}),
}


@pytest.mark.parametrize("way", TEXTS)
def test_text_is_read_as_it_was_meant(tmp_path: Path, way: str) -> None:
    content, options = TEXTS[way]
    (tmp_path / "a.csv").write_bytes(content)
    signals = read(RawFile(tmp_path / "a.csv", {"time": Channel("t"), "p1": Channel("p")}, **options))
    np.testing.assert_array_equal(signals["time"], EXPECTED[0])
    np.testing.assert_array_equal(signals["p1"], EXPECTED[1])


def test_a_point_beside_decimal_commas_stands_between_thousands(tmp_path: Path) -> None:
    raw = RawFile(tmp_path / "a.csv", {"time": Channel("t"), "p1": Channel("p")})
    raw.path.write_text("t;p\n0,00;701.428\n0,01;1.699.900\n")
    np.testing.assert_array_equal(read(raw)["p1"], [701428, 1699900])
    raw.path.write_text("t;p\n0;1,235\n1;7.013\n")
    with pytest.raises(InputError, match="1,235"):  # nothing tells which of both parts thousands
        read(raw)


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
    assert str(tmp_path / "a.csv") in message
    assert [word for word in words if word not in message] == []


def test_a_reader_that_is_left_half_made_does_not_complain_when_it_is_collected(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_mdf(tmp_path / "whole.mf4")
    whole, complaints = (tmp_path / "whole.mf4").read_bytes(), list[object]()
    monkeypatch.setattr("sys.unraisablehook", complaints.append)
    for share in np.linspace(0.02, 0.98, 9):
        (tmp_path / "a.mf4").write_bytes(whole[: int(share * len(whole))])
        with suppress(InputError):  # of some only what is not read is cut off
            read(RawFile(tmp_path / "a.mf4", CHANNELS))
        gc.collect()
    assert complaints == []


def test_an_extra_that_is_not_installed_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "nptdms", None)
    (tmp_path / "a.tdms").write_bytes(b"TDSm")
    with pytest.raises(InputError, match=r"pip install 'pneucli\[tdms\]'"):
        read(RawFile(tmp_path / "a.tdms", CHANNELS))


def test_columns_of_different_length_are_refused(tmp_path: Path) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "a.mat", {"t": T, "p": P[:7]})
    with pytest.raises(InputError, match="7 values"):
        read(RawFile(tmp_path / "a.mat", CHANNELS))


def damaged_page(path: Path) -> None:
    write_parquet(path)
    content = bytearray(path.read_bytes())
    content[20:60] = bytes(40)
    path.write_bytes(bytes(content))


def twice(path: Path) -> None:
    table = pa.table([pa.array(T), pa.array(P), pa.array(P)], names=["t", "p", "p"])
    pq.write_table(table, path)


def words(path: Path) -> None:
    pq.write_table(pa.table({"t": T, "p": ["fault"] * T.size}), path)


def without_a_clock(path: Path) -> None:
    from asammdf import MDF, Signal

    with MDF(version="4.10") as mdf:
        mdf.append([Signal(P, T, name="p")])
        mdf.append([Signal(P, T, name="p")])
        path = mdf.save(path.with_suffix(".mf4"), overwrite=True).rename(path)


@pytest.mark.parametrize(
    ("write", "says"),
    [
        (damaged_page, "cannot be read as Parquet"),
        (twice, r'2 columns are called "p".*"p" \(column 2\), "p" \(column 3\)'),
        (words, r'column "p" of string.*float64'),
        (without_a_clock, r'2 columns are called "p".*"0/p" \(column 1\), "1/p"'),
    ],
)
def test_what_a_binary_file_holds_wrongly_is_said(tmp_path: Path, write: Callable[[Path], None], says: str) -> None:
    write(tmp_path / "a")
    channels = {"time": Channel("time" if write is without_a_clock else "t"), "p1": Channel("p")}
    with pytest.raises(InputError, match=f"(?s){says}"):
        read(RawFile(tmp_path / "a", channels))


def an_array_a_run(path: Path) -> None:
    pq.write_table(pa.table({"run": [1], "t": [list(T)], "p": [list(P)]}), path)


def an_array_a_channel(path: Path) -> None:
    step = float(T[1] - T[0])
    pq.write_table(pa.table({"name": ["p", "q"], "dt": [step, step], "p": [list(P), list(P + 1.0)]}), path)


def an_array_a_sample(path: Path) -> None:
    pq.write_table(pa.table({"t": T, "p": [[v] for v in P]}), path)


def structs(path: Path) -> None:
    pq.write_table(pa.table({"t": T, "row": [{"p": v} for v in P]}), path)


@pytest.mark.parametrize("write", [an_array_a_run, an_array_a_channel, an_array_a_sample, structs])
def test_arrays_and_structs_in_the_rows_of_a_table_are_its_samples(
    tmp_path: Path, write: Callable[[Path], None]
) -> None:
    write(tmp_path / "a.parquet")
    own = ("name", "p") if write is an_array_a_channel else None
    channels = {"time": Channel("time" if own else "t"), "p1": Channel("p", where=own)}
    rows = read(RawFile(tmp_path / "a.parquet", channels))
    assert np.allclose(rows["time"] - rows["time"][0], T - T[0])
    assert np.allclose(rows["p1"], P)


def test_a_dictionary_column_is_read(tmp_path: Path) -> None:
    labels = pa.array(["p", "x"] * 25).dictionary_encode()
    pq.write_table(pa.table({"t": pa.array(T).dictionary_encode(), "v": P, "channel": labels}), tmp_path / "a")
    signals = read(RawFile(tmp_path / "a", {"time": Channel("t"), "p1": Channel("v", where=("channel", "p"))}))
    np.testing.assert_array_equal(signals["p1"], P[::2])
    np.testing.assert_array_equal(signals["time"], T[::2])


def test_one_column_for_two_signals_is_refused(tmp_path: Path) -> None:
    write_parquet(tmp_path / "a")
    with pytest.raises(InputError, match='p1 and p2 are both column "p"'):
        open_signals(RawFile(tmp_path / "a", {**CHANNELS, "p2": Channel(2)}))


@pytest.mark.parametrize("name", ["pipe", "folder"])
def test_what_is_no_regular_file_is_refused_at_once(tmp_path: Path, name: str) -> None:
    import os

    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match=r"a folder|no regular file"):
        open_signals(RawFile(tmp_path / name, CHANNELS))


@contextmanager
def peak_below(limit: float) -> Iterator[None]:
    """Hold what is done inside to so many bytes at once."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < limit
    finally:
        tracemalloc.stop()


HUGE = 400_000_000  # values: 3.2 GB


def hdf5_bomb(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:  # chunks that were never written: a few kB
        file.create_dataset("t", shape=(HUGE,), chunks=(1 << 20,), dtype="f8", compression="gzip")
        file["p"] = P


def parquet_bomb(path: Path) -> None:
    rows = pa.table({"t": np.zeros(1 << 20), "p": np.zeros(1 << 20)})
    with pq.ParquetWriter(path, rows.schema) as writer:
        for _ in range(8):
            writer.write_table(rows)


def mat_bomb(path: Path) -> None:
    """A vector of 63 MB of zeros, which zlib makes 0.06 MB of."""
    import struct
    import zlib

    def element(kind: int, *parts: bytes) -> bytes:
        content = b"".join(parts)
        return struct.pack("<II", kind, len(content)) + content + b"\0" * (-len(content) % 8)

    def numbers(name: bytes, count: int) -> list[bytes]:
        shape = element(6, struct.pack("<II", 6, 0)) + element(5, struct.pack("<ii", 1, count)) + element(1, name)
        return [struct.pack("<II", 14, len(shape) + 8 + 8 * count) + shape + struct.pack("<II", 9, 8 * count)]

    stream, blank = zlib.compressobj(9), bytes(1 << 20)
    body = stream.compress(numbers(b"t", 60 << 17)[0])
    body += b"".join(stream.compress(blank) for _ in range(60)) + stream.flush()
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    path.write_bytes(head + struct.pack("<II", 15, len(body)) + body)


@pytest.mark.parametrize(
    ("write", "most"),
    [(hdf5_bomb, 5e6), (parquet_bomb, 5e6), (mat_bomb, 150e6)],  # scipy expands 128 kB at a time
)
def test_what_a_file_expands_to_is_bounded_and_said(
    tmp_path: Path, write: Callable[[Path], None], most: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (packed, matlab):
        monkeypatch.setattr(module, "MIN_EXPANSION_LIMIT", 32 << 20)
    write(tmp_path / "a")
    assert (tmp_path / "a").stat().st_size < 300_000
    with (
        peak_below(most),
        pytest.raises(InputError, match=r"expand to (3200|67|63) MB, from a file of 0\.\d+ MB"),
    ):
        read(RawFile(tmp_path / "a", {"time": Channel("t")}))


MAT_LAYOUTS = {
    "vectors": {"t": T, "p": P},
    "struct": {"rec": {"t": T, "p": P}},
    "nested": {"a": {"rec": {"t": T, "p": P}}},
}


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("layout", MAT_LAYOUTS)
@pytest.mark.parametrize("kind", [0, 8, 11, 14, 15, 19, 255])
def test_numbers_of_a_type_that_matlab_does_not_have_are_refused(
    tmp_path: Path, layout: str, kind: int, *, compressed: bool
) -> None:
    """scipy's reader looks such a type up in C, past the end of its table, and ends the process."""
    import struct
    import zlib

    from scipy.io import savemat

    savemat(tmp_path / "a.mat", MAT_LAYOUTS[layout])
    raw = (tmp_path / "a.mat").read_bytes()
    tag = struct.pack("<II", 9, 8 * T.size)
    assert raw.count(tag) == 2
    at = raw.rindex(tag)
    raw = raw[:at] + struct.pack("<II", kind, 8 * T.size) + raw[at + 8 :]
    if compressed:
        first = 136 + int.from_bytes(raw[132:136], "little") if layout == "vectors" else 128
        body = zlib.compress(raw[first:])
        raw = raw[:first] + struct.pack("<II", 15, len(body)) + body
    (tmp_path / "a.mat").write_bytes(raw)
    prefix = {"vectors": "", "struct": "rec/", "nested": "a/rec/"}[layout]
    with pytest.raises(InputError, match=f"data of type {kind}, which is none"):
        read(RawFile(tmp_path / "a.mat", {"time": Channel(f"{prefix}t"), "p1": Channel(f"{prefix}p")}))


@pytest.mark.parametrize(
    ("at", "now"),
    [
        (145, b"\x08"),  # the flag of an imaginary part, and the next variable in its place
        (144, b"\x05"),  # the class of sparse matrices, which have two more parts
        (168, b"\x01\0\0\0\x01\0\0\0"),  # a name that takes the place of the numbers
    ],
)
def test_a_matrix_without_its_numbers_is_refused(tmp_path: Path, at: int, now: bytes) -> None:
    """The reader would go on into the next variable, whose tag is no number's."""
    from scipy.io import savemat

    savemat(tmp_path / "a.mat", {"t": T, "p": P})
    raw = bytearray((tmp_path / "a.mat").read_bytes())
    raw[at : at + len(now)] = now
    if len(now) > 1:
        raw = raw[:176] + bytes(8) + raw[176 + 8 + 8 * T.size :]
        raw[132:136] = (48).to_bytes(4, "little")
    (tmp_path / "a.mat").write_bytes(raw)
    matlab.check_types(tmp_path / "a.mat", {1})
    with pytest.raises(ValueError, match="a matrix without its numbers"):
        matlab.check_types(tmp_path / "a.mat", {0})


def with_image(write: str, path: Path) -> None:
    image = np.zeros((1500, 1500))
    if write == "hdf5":
        import h5py

        with h5py.File(path, "w") as file:
            file["t"], file["p"], file["camera/image"] = T, P, image
    elif write == "mat":
        from scipy.io import savemat

        savemat(path, {"t": T, "p": P, "image": image})
    else:
        from nptdms import ChannelObject, TdmsWriter

        with TdmsWriter(path) as writer:
            columns = {"t": T, "p": P, "image": image.ravel()}
            writer.write_segment([ChannelObject("g", name, values) for name, values in columns.items()])


@pytest.mark.parametrize("write", ["hdf5", "mat", "tdms"])
def test_only_what_is_wanted_is_read(tmp_path: Path, write: str) -> None:
    with_image(write, tmp_path / "a")
    read(RawFile(tmp_path / "a", CHANNELS))  # the libraries themselves are loaded
    with peak_below(3e6):  # the image: 18 MB
        signals = read(RawFile(tmp_path / "a", CHANNELS))
    np.testing.assert_array_equal(signals["p1"], P * 1e5 + 1e5)


def test_hdf5_groups_that_hold_one_another_are_walked_once(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "a", "w") as file:
        file["t"], file["data/p"] = T, P
        file["data/again"] = file["/"]
        file["data/elsewhere"] = h5py.ExternalLink("other.h5", "/p")
        file["data/broken"] = h5py.SoftLink("/nowhere")
    opened = open_signals(RawFile(tmp_path / "a", CHANNELS))
    assert list(opened.reader.names) == ["data/p", "t"]


NOTED = {
    "comments among the rows": (b"t,p\n0,1\n# 1,2\n2,3\n", {("comment", 1)}),
    "a last line without end": (b"t,p\n0,1.25\n1,2.5", {("cut-number", 1)}),
    "a last line without end, of numbers as long as those above": (b"t,p\n0,1.25\n1,2.50", {("no-line-end", 1)}),
    "a last line without end, with a decimal comma": (b"t;p\r\n0;1,25\r\n1;2,50", {("no-line-end", 1)}),
    "a last line cut within its end": (b"t;p\r\n0;1,25\r\n1;2,50\r", {("no-line-end", 1)}),
    "a last line without end, between blanks": (b"t p\n0 1.25\n1 2.5", {("cut-number", 1)}),
    "a last line cut off": (b"t,p,q\n0,1,1\n1,2,1\n2,3", {("truncated", 1)}),
    "columns of one name": (b"t,p,q,q\n0,1,1,1\n1,2,1,1\n", {("same-name", 2)}),
}


@pytest.mark.parametrize("way", NOTED)
def test_what_is_odd_in_a_text_is_noted(tmp_path: Path, way: str) -> None:
    content, expected = NOTED[way]
    (tmp_path / "a.csv").write_bytes(content)
    opened = open_signals(RawFile(tmp_path / "a.csv", {"time": Channel("t"), "p1": Channel("p")}))
    rows = sum(batch["time"].size for batch in opened.batches())
    assert {(one.kind, one.count) for one in opened.repairs} == expected
    assert opened.rows == rows + sum(opened.losses.values())


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_text_cut_anywhere_but_at_the_end_of_a_line_says_so(tmp_path: Path, end: str) -> None:
    """There it is a shorter recording, and nothing in it tells."""
    lines = ["t;u;p" + end, *(f"{k};2;{1 + k / 8:.3f}{end}" for k in range(12))]
    whole, ends = "".join(lines).encode(), np.cumsum([len(line) for line in lines])
    for size in range(1, len(whole)):
        (tmp_path / "a.csv").write_bytes(whole[:size])
        try:
            opened = open_signals(RawFile(tmp_path / "a.csv", {"time": Channel("t"), "p1": Channel("p")}))
            rows = sum(batch["time"].size for batch in opened.batches())
        except InputError:
            continue
        told = {one.kind for one in opened.repairs} & {"truncated", "no-line-end", "cut-number"}
        assert bool(told) == (size not in ends), whole[:size][-30:]
        assert rows == np.count_nonzero(ends <= size) - 1 + (size not in ends) - opened.losses["truncated"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"delimiter": "ab"}, 'key delimiter: "ab"'),
        ({"delimiter": "5"}, 'key delimiter: "5"'),
        ({"decimal": "é"}, "wanted: a point or a comma"),
        ({"decimal": ",", "delimiter": ","}, "is the decimal mark and another one"),
        ({"encoding": "rot13"}, 'no encoding is called "rot13"'),
        ({"encoding": "a\0b"}, "no encoding is called"),
    ],
)
def test_marks_and_codecs_that_are_none_are_refused(tmp_path: Path, options: dict[str, str], says: str) -> None:
    (tmp_path / "a.csv").write_bytes(b"t,p\n0,1\n1,2\n")
    with pytest.raises(InputError, match=says):
        read(RawFile(tmp_path / "a.csv", {"time": Channel("t")}, **options))


def test_old_line_ends_and_separators_in_names_lose_no_row(tmp_path: Path) -> None:
    for content in (b"t,p\r0,1\r1,2\r", "t,p\u2028x\u2029\x0c\n0,1\n1,2\n".encode()):
        (tmp_path / "a.csv").write_bytes(content)
        signals = read(RawFile(tmp_path / "a.csv", {"time": Channel("t"), "p1": Channel(2)}))
        np.testing.assert_array_equal(signals["p1"], [1, 2])


def test_a_line_without_end_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from pneucli.io import delimited

    monkeypatch.setattr(delimited, "MAX_LINE_BYTES", 1 << 19)
    (tmp_path / "a.csv").write_bytes(b"t,p\n0,1\n1,2\n" + b"9" * (2 << 20))
    with pytest.raises(InputError, match="a line of more than"):
        read(RawFile(tmp_path / "a.csv", {"time": Channel("t"), "p1": Channel("p")}))


@pytest.mark.parametrize("rows", [5, 40_000])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_last_line_without_end_is_told_by_its_number(tmp_path: Path, end: str, rows: int) -> None:
    lines = ["# a comment", "t,p", "", *(f"{k},{k % 7}.5" for k in range(rows))]
    (tmp_path / "a.csv").write_bytes(end.join(lines).encode())
    opened = open_signals(RawFile(tmp_path / "a.csv", CHANNELS))
    assert sum(batch["time"].size for batch in opened.batches()) == rows
    assert any(f"line {rows + 3}, the last, has no end" in one.message for one in opened.repairs)
