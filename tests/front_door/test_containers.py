"""Containers of other programs, with clocks of their own: told by their first bytes, read, or refused in one line."""

import json
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pneucli.arrays import Array
from pneucli.config import load
from pneucli.errors import InputError
from pneucli.io.artifacts import sha256_of
from pneucli.io.formats import open_raw
from pneucli.io.raw_file import Channel, ColumnRequest, RawFile
from pneucli.io.signal_reader import open_signals
from pneucli.paths import matching_files
from pneucli.pipeline.graph import Context
from pneucli.stages import ingest, init

from .judge import FILL_IN, judge
from .laboratory import COUNT, RATE, command, position, pressure, write_workbook

T = np.arange(COUNT) / RATE
U, P, X = command(T), pressure(T) / 1e5, 1e3 * position(T)
SLOW = T[::4] * (1 + 5e-5) + 2e-4  # a clock four times slower, with offset and drift
Writer = Callable[[Path], Path]


def tdms_waveforms(folder: Path) -> Path:
    from nptdms import ChannelObject, TdmsWriter

    start = np.datetime64("2024-03-21T14:05:07")
    late = np.datetime64("2024-03-21T14:05:07.050000")

    def waveform(name: str, values: Array, begin: np.datetime64, step: float, unit: str) -> ChannelObject:
        properties = {"wf_start_time": begin, "wf_increment": step, "wf_start_offset": 0.0, "unit_string": unit}
        return ChannelObject("Messung", name, values, properties=properties)

    path = folder / "run.tdms"
    with TdmsWriter(path) as writer:
        writer.write_segment(
            [
                waveform("U", U[::10].copy(), start, 0.01, "V"),
                waveform("P1", P[50:].copy(), late, 0.001, "bar"),
                waveform("Pos", X[::4].copy(), start, 0.004, "mm"),
            ]
        )
    return path


def tdms_groups(folder: Path) -> Path:
    from nptdms import ChannelObject, TdmsWriter

    path = folder / "run.tdms"
    channels = [("Fast", "Time [s]", T), ("Fast", "P1 [bar]", P), ("Slow", "Time [s]", SLOW)]
    channels += [("Slow", "Pos [mm]", 1e3 * position(SLOW)), ("Slow", "U [V]", command(SLOW))]
    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject(group, name, values) for group, name, values in channels])
    return path


def tdms_groups_in_other_units(folder: Path) -> Path:
    """Each group has a clock of its own: seconds of fast readings, milliseconds of slow ones."""
    from nptdms import ChannelObject, TdmsWriter

    path = folder / "run.tdms"
    channels = [("Fast", "Time", T, "s"), ("Fast", "P1", P, "bar"), ("A slow one", "Time", 1e3 * SLOW, "ms")]
    channels += [("A slow one", "Pos", 1e3 * position(SLOW), "mm"), ("Fast", "U", U, "V")]
    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject(g, n, v, properties={"unit_string": unit}) for g, n, v, unit in channels])
    return path


def mdf_rasters(folder: Path) -> Path:
    from asammdf import MDF, Signal

    changes = np.concatenate([[0], np.flatnonzero(np.diff(U)) + 1])
    path = folder / "run.mf4"
    with MDF(version="4.10") as mdf:
        mdf.append([Signal(U[changes], T[changes], name="u", unit="V")])
        mdf.append([Signal(P, T, name="p1", unit="bar")])
        mdf.append([Signal(1e3 * position(SLOW), SLOW, name="x", unit="mm")])
        mdf.save(path)
    return path


def twincat(folder: Path) -> Path:
    head = ["Name\tScope\tName\tScope\tName\tScope", "Starttime of export\t1\tStarttime of export\t1", ""]
    head += ["Name\tU\tName\tP1 [bar]\tName\tPos [mm]", "SymbolComment\t\tSymbolComment\t\tSymbolComment\t"]
    head += ["Data-Type\tREAL64\tData-Type\tREAL64\tData-Type\tREAL64", "SampleTime[ms]\t10\tSampleTime[ms]\t1"]
    head += ["SymbolName\tMAIN.u\tSymbolName\tMAIN.p\tSymbolName\tMAIN.x", ""]
    rows = []
    for n in range(COUNT):
        u = f"{10 * n}\t{U[10 * n]}" if 10 * n < COUNT else "\t"
        x = f"{4 * n}\t{X[4 * n]:.4f}" if 4 * n < COUNT else "\t"
        rows.append(f"{u}\t{n}\t{P[n]:.5f}\t{x}")
    path = folder / "run.csv"
    path.write_text("\n".join([*head, *rows, "EOF"]) + "\n", encoding="utf-8")
    return path


def mcap_json(folder: Path) -> Path:
    from mcap.writer import Writer

    path = folder / "run.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema(name="P", encoding="jsonschema", data=b'{"type": "object"}')
        topics = {
            name: writer.register_channel(topic=name, message_encoding="json", schema_id=schema) for name in "upx"
        }
        for n in range(COUNT):
            stamp = 1_711_000_000_000_000_000 + n * 1_000_000
            sent = {"p": {"p1": 1e5 * P[n]}} | ({"u": {"u": U[n]}} if n % 10 == 0 else {})
            sent |= {"x": {"position": position(T)[n]}} if n % 4 == 0 else {}
            for topic, values in sent.items():
                content = json.dumps({name: float(value) for name, value in values.items()}).encode()
                writer.add_message(channel_id=topics[topic], log_time=stamp, publish_time=stamp, data=content)
        writer.finish()
    return path


def rosbag2(folder: Path) -> Path:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.LATEST)
    number = store.types["std_msgs/msg/Float64"]
    with Writer(folder / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        topics = {n: writer.add_connection(n, "std_msgs/msg/Float64", typestore=store) for n in ("/u", "/p1", "/pos")}
        for n in range(COUNT):
            stamp = 1_711_000_000_000_000_000 + n * 1_000_000
            values = {"/u": U[n], "/p1": 1e5 * P[n], "/pos": position(T)[n]}
            for topic, value in values.items():
                if topic != "/u" or n % 10 == 0:
                    writer.write(
                        topics[topic], stamp, store.serialize_cdr(number(float(value)), "std_msgs/msg/Float64")
                    )
    return folder / "bag" / "bag.db3"


def clocks_in_one_table(folder: Path) -> Path:
    rows = ["t1 [s],P1 [bar],t2 [s],Pos [mm],U [V]"]
    for n in range(COUNT):
        slow = f"{SLOW[n]:.6f},{1e3 * position(SLOW)[n]:.4f},{command(SLOW)[n]}" if n < SLOW.size else ",,"
        rows.append(f"{T[n]:.4f},{P[n]:.5f},{slow}")
    path = folder / "run.csv"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def pandas_frame(folder: Path) -> Path:
    """A frame as pandas lays it out in its fixed format."""
    import h5py

    path = folder / "run.h5"
    with h5py.File(path, "w") as file:
        group = file.create_group("run")
        group.attrs["pandas_type"] = b"frame"
        names = np.array([b"u [V]", b"p1 [bar]", b"x [mm]"])
        group["axis0"], group["block0_items"] = names, names
        group["axis1"] = T
        group["block0_values"] = np.stack([U, P, X], axis=1)
    return path


def logged_signals(folder: Path) -> Path:
    from scipy.io import savemat

    logged = np.zeros(3, dtype=[("Name", object), ("Values", object)])
    logged[0] = ("U [V]", {"Time": T[::10, None], "Data": U[::10, None]})
    logged[1] = ("P1 [bar]", {"Time": T[:, None], "Data": P[:, None]})
    logged[2] = ("Pos [mm]", {"Time": SLOW[:, None], "Data": 1e3 * position(SLOW)[:, None]})
    savemat(folder / "run.mat", {"logsout": logged})
    return folder / "run.mat"


def dspace(folder: Path) -> Path:
    from scipy.io import savemat

    stamps = np.zeros(2, dtype=[("Name", object), ("Data", object)])
    stamps[0], stamps[1] = ("fast", T), ("slow", SLOW)
    signals = np.zeros(3, dtype=[("Name", object), ("Data", object), ("Unit", object), ("XIndex", object)])
    signals[0] = ("U_valve", U, "V", 1)
    signals[1] = ("P1", P, "bar", 1)
    signals[2] = ("Pos", 1e3 * position(SLOW), "mm", 2)
    savemat(folder / "run.mat", {"exp_001": {"X": stamps, "Y": signals}})
    return folder / "run.mat"


WRITERS: list[Writer] = [
    *(
        tdms_waveforms,
        tdms_groups,
        tdms_groups_in_other_units,
        mdf_rasters,
        twincat,
        mcap_json,
        rosbag2,
        clocks_in_one_table,
        pandas_frame,
    ),
    *(logged_signals, dspace),
]


@pytest.mark.parametrize("write", WRITERS, ids=lambda write: write.__name__)
def test_each_channel_is_read_on_its_own_clock(write: Writer, tmp_path: Path) -> None:
    path = write(tmp_path)
    outcome = judge(path, tmp_path / "work", 0.0)
    assert set(outcome.verdicts.values()) == {"right"}, f"{outcome.verdicts}\n{outcome.why}"


def columns(path: Path) -> dict[str, Array]:
    reader = open_raw(RawFile(path, {}))
    return {name: next(iter(reader.batches([ColumnRequest(n)])))[0] for n, name in enumerate(reader.names)}


def test_tektronix_writes_its_keys_beside_the_curve(tmp_path: Path) -> None:
    keys = [("Record Length", len(T)), ("Sample Interval", 1e-3), ("Trigger Point", 0), ("Source", "CH2")]
    keys += [("Vertical Units", "bar"), ("Horizontal Units", "S")]
    beside = [*(f"{name},{value}," for name, value in keys), *[",,"] * (len(T) - len(keys))]
    rows = [f"{key}, {t:.4f}, {p:.6f}," for key, t, p in zip(beside, T, P, strict=True)]
    (tmp_path / "F0001CH2.CSV").write_text("\n".join(rows) + "\n", encoding="utf-8")
    assert open_raw(RawFile(tmp_path / "F0001CH2.CSV", {})).units == {0: "s", 1: "bar"}
    found = columns(tmp_path / "F0001CH2.CSV")
    np.testing.assert_allclose(found["time"], T, atol=1e-9)
    np.testing.assert_allclose(found["CH2"], P, atol=1e-6)


def test_dymola_names_its_trajectories(tmp_path: Path) -> None:
    from scipy.io import savemat

    names = ["time", "p1", "minus_p1", "torque"]
    letters = np.array([list(name.ljust(8)) for name in names])
    data = np.stack([T, P], axis=1)
    info = np.array([[0, 1, 0, -1], [2, 2, 0, -1], [2, -2, 0, -1], [2, 2, 0, -1]])
    kind = np.array([list(text.ljust(10)) for text in ("1.1", "", "binNormal", "binNormal")])
    texts = ["Time in [s]", "Pressure [1] of the chamber [Pa|bar]", "Negated [1] [:#(type=Real)]", "[N.m]"]
    remarks = np.array([list(text.ljust(40)) for text in texts])
    content = {"Aclass": kind, "name": letters, "description": remarks, "dataInfo": info, "data_2": data}
    savemat(tmp_path / "r.mat", content, format="4")
    assert open_raw(RawFile(tmp_path / "r.mat", {})).units == {0: "s", 1: "Pa", 3: "N*m"}
    found = columns(tmp_path / "r.mat")
    np.testing.assert_allclose(found["p1"], P)
    np.testing.assert_allclose(found["minus_p1"], -P)


def test_objects_of_matlab_are_refused_with_the_way_to_save_them(tmp_path: Path) -> None:
    def element(kind: int, content: bytes) -> bytes:
        return struct.pack("<II", kind, len(content)) + content + b"\0" * (-len(content) % 8)

    flags = element(6, struct.pack("<II", 17, 0))  # mxOPAQUE_CLASS
    texts = b"".join(element(1, text) for text in (b"ts", b"MCOS", b"timeseries"))
    inner = element(
        14,
        element(6, struct.pack("<II", 13, 0))
        + element(5, struct.pack("<ii", 1, 1))
        + element(1, b"")
        + element(6, b"\0\0\0\0"),
    )
    variable = element(14, flags + texts + inner)
    packed = zlib.compress(variable)
    path = tmp_path / "a.mat"
    head = b"MATLAB 5.0 MAT-file".ljust(116) + b"\0" * 8 + b"\x00\x01IM"
    path.write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)
    with pytest.raises(InputError) as caught:
        open_raw(RawFile(path, {}))
    assert "objects of MATLAB" in caught.value.found or "cannot be read as MATLAB" in caught.value.found


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"\x89PNG\r\n\x1a\n" + b"\0" * 99, "this is a picture"),
        (b"7z\xbc\xaf\x27\x1c" + b"\0" * 99, "this is a 7-Zip archive"),
        (b"CDF\x02" + b"\0" * 99, "this is a file of netCDF 3"),
        (b"#ROSBAG V2.0\n" + b"\0" * 99, "this is a bag of ROS 1"),
        (b"\x80\x04\x95" + b"\0" * 99, "this is a pickle of Python"),
        (b"\x1f\x8b" + b"\0" * 99, "cannot be read as gzip"),
        (b"PK\x03\x04" + b"\0" * 99, "cannot be read as zip"),
        (b"a.csv".ljust(257, b"\0") + b"ustar".ljust(255, b"\0"), "this is a tar archive"),
        (
            b"RIG,1,1999\r\n4,3A,1D\r\n1,P1,,,bar,0.001,0,0,-32767,32767,1,1,P\r\n",
            "this is a header of a COMTRADE recording",
        ),
        (b"SQLite format 3\0" + b"\0" * 4000, "this is a database of SQLite, and no rosbag2"),
    ],
)
def test_what_cannot_be_read_is_named(content: bytes, says: str, tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(content)
    with pytest.raises(InputError, match=says):
        open_raw(RawFile(tmp_path / "a", {}))


@pytest.mark.parametrize("clock", ["[h]:mm:ss", "hh:mm:ss.000"])
def test_a_clock_in_excel_goes_on_after_24_hours(tmp_path: Path, clock: str) -> None:
    """Durations have a unit, and hours beyond 24 are no dates of 1900 (findings/excel-stamps.sh)."""
    hours = [22.5, 23.5, 24.0, 25.5, 49.25]
    rows = [[hour / 24, 6.0 + hour] for hour in hours]
    write_workbook(tmp_path / "a.xlsx", [["t", "p1"], *rows], clock=clock)
    reader = open_raw(RawFile(tmp_path / "a.xlsx", {}))
    (values,) = zip(*reader.batches([ColumnRequest(0)]), strict=True)
    np.testing.assert_allclose(np.concatenate(values), [3600 * (hour - hours[0]) for hour in hours], atol=1e-3)


def test_a_clock_in_ods_goes_on_after_24_hours(tmp_path: Path) -> None:
    """A cell of 24 hours or more is handed out as a text (findings/ods-after-24-hours.sh)."""
    import zipfile

    spans = ["PT23H59M58S", "PT23H59M59.500000000S", "PT24H00M00S", "PT49H15M00.25S"]
    names = "".join(
        f'<table:table-cell office:value-type="string"><text:p>{n}</text:p></table:table-cell>' for n in "tp"
    )
    rows = "".join(
        f'<table:table-row><table:table-cell office:value-type="time" office:time-value="{span}"/>'
        '<table:table-cell office:value-type="float" office:value="6.25"/></table:table-row>'
        for span in spans
    )
    kinds = " ".join(
        f'xmlns:{kind}="urn:oasis:names:tc:opendocument:xmlns:{kind}:1.0"' for kind in ("office", "table", "text")
    )
    with zipfile.ZipFile(tmp_path / "a.ods", "w") as archive:
        archive.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        archive.writestr("META-INF/manifest.xml", "<manifest/>")
        archive.writestr(
            "content.xml",
            f"<office:document-content {kinds}><office:body><office:spreadsheet><table:table table:name='S'>"
            f"<table:table-row>{names}</table:table-row>{rows}"
            "</table:table></office:spreadsheet></office:body></office:document-content>",
        )
    (values,) = zip(*open_raw(RawFile(tmp_path / "a.ods", {})).batches([ColumnRequest(0)]), strict=True)
    np.testing.assert_allclose(np.concatenate(values), [0, 1.5, 2, 90_902.25], atol=1e-6)


def test_sheets_with_one_header_are_recordings(tmp_path: Path) -> None:
    head = ["t [s]", "u [V]", "p1 [bar(a)]"]
    runs = [[head, *([float(T[n]), float(U[n]), float(P[n] + k)] for n in range(COUNT - 9 * k))] for k in range(2)]
    write_workbook(tmp_path / "runs.xlsx", [["Operator", "Lab"], ["Year", 2026.0]], *runs)
    init.create(tmp_path / "rig", [tmp_path / "runs.xlsx"])
    text = (tmp_path / "rig" / "pipeline.toml").read_text(encoding="utf-8")
    assert [line for line in text.splitlines() if line.startswith("part")] == ["part = 1", "part = 2"]
    for part in (1, 2):
        (t, p1), *_ = open_raw(RawFile(tmp_path / "runs.xlsx", {}, part=part)).batches([*map(ColumnRequest, (0, 2))])
        np.testing.assert_allclose(p1, P[: t.size] + (part - 1), atol=1e-9)


def test_sheets_of_other_channels_are_columns_on_their_own_clocks(tmp_path: Path) -> None:
    fast = [["t [s]", "p1 [bar(a)]"], *([float(T[n]), float(P[n])] for n in range(COUNT))]
    slow = [["t [s]", "u [V]", "x [mm]"], *([float(T[n]), float(U[n]), float(X[n])] for n in range(0, COUNT, 4))]
    write_workbook(tmp_path / "run.xlsx", slow, fast, [["Name", "Value"], ["C", 3.2]])
    outcome = judge(tmp_path / "run.xlsx", tmp_path / "work", 0.0)
    assert set(outcome.verdicts.values()) == {"right"}, f"{outcome.verdicts}\n{outcome.why}"


def archive_of_two(folder: Path) -> Path:
    import gzip
    import zipfile

    step, later = ("t [s],u [V],p1 [bar],x [mm]\n" + "".join(
        f"{T[n]:.4f},{U[n]},{P[n] + shift:.5f},{X[n]:.4f}\n" for n in range(COUNT)
    ) for shift in (0.0, 0.5))  # fmt: skip
    with zipfile.ZipFile(folder / "a.zip", "w") as archive:
        archive.writestr("step_1.csv", step)
        archive.writestr("later/step_2.csv.gz", gzip.compress(later.encode()))
        archive.writestr("notes.md", "who, when")
        archive.writestr("../outside.csv", step)
    return folder / "a.zip"


def test_every_readable_member_of_a_zip_is_a_recording(tmp_path: Path) -> None:
    answer = init.create(tmp_path / "p", [archive_of_two(tmp_path)])
    assert answer.left_out == ["notes.md: no table of numbers, but 'who, when'"]
    pipeline = tmp_path / "p" / "pipeline.toml"
    text = pipeline.read_text(encoding="utf-8")
    assert 'file = "../a.zip/step_1.csv"' in text
    for mark, value in FILL_IN.items():
        text = text.replace(mark, value)
    pipeline.write_text(text, encoding="utf-8")
    (tmp_path / "out").mkdir()
    found = ingest.run(Context(pipeline, load(pipeline), tmp_path / "out", tmp_path))
    assert [one["samples"] for one in found["recordings"]] == [COUNT, COUNT]
    assert {one["sha256"] for one in found["recordings"]} == {sha256_of(tmp_path / "a.zip")}


@pytest.mark.parametrize(
    ("pattern", "names"),
    [
        ("a.zip/*.csv", ["step_1.csv"]),
        ("a.zip/later/*.gz", ["later/step_2.csv.gz"]),
        ("*.zip/**/*.gz", ["later/step_2.csv.gz"]),
        ("a.zip/step_1.csv", ["step_1.csv"]),
        ("a.zip/*/step_1.csv", []),
        ("b.zip/*.csv", []),
        ("a.zip", [""]),
    ],
)
def test_a_glob_leads_into_a_zip(pattern: str, names: list[str], tmp_path: Path) -> None:
    archive = archive_of_two(tmp_path)
    assert matching_files(pattern, tmp_path, "here") == [archive / name for name in names]


def test_a_zip_of_several_recordings_says_how_to_name_one(tmp_path: Path) -> None:
    archive = archive_of_two(tmp_path)
    with pytest.raises(InputError, match=r"a zip archive of 3 files: step_1\.csv, later/step_2") as caught:
        open_raw(RawFile(archive, {}))
    assert caught.value.mend == 'name one, file = "a.zip/step_1.csv", or several, file = "a.zip/*.csv"'
    with pytest.raises(InputError, match=r'no "step_3\.csv" in the archive'):
        open_raw(RawFile(archive / "step_3.csv", {}))


def test_errors_in_packed_files_name_the_packed_file(tmp_path: Path) -> None:
    import gzip

    (tmp_path / "a.csv.gz").write_bytes(gzip.compress(b"t,p\n0,1\n1,2\n2,1.2.3\n3,4\n"))
    raw = RawFile(tmp_path / "a.csv.gz", {"time": Channel("t"), "p1": Channel("p")})
    with pytest.raises(InputError) as caught:
        list(open_signals(raw).batches())
    assert caught.value.where == f'{tmp_path}/a.csv.gz, line 4, column "p"'


def test_an_archive_in_a_packed_file_is_named_by_the_packed_file(tmp_path: Path) -> None:
    import gzip

    (tmp_path / "a.tar.gz").write_bytes(gzip.compress(b"a.csv".ljust(257, b"\0") + b"ustar".ljust(255, b"\0")))
    with pytest.raises(InputError, match="this is a tar archive") as caught:
        open_raw(RawFile(tmp_path / "a.tar.gz", {}))
    assert caught.value.where == f"{tmp_path}/a.tar.gz"


def texts(folder: Path, kind: str) -> Path:
    import pyarrow as pa
    import pyarrow.parquet as pq
    from pyarrow import feather

    stamps = [f"2024-03-21T14:05:{7 + t:09.6f}" for t in T]
    rows = {"time": stamps, "u [V]": U.tolist(), "p1 [bar]": [f"{p:.5f}" for p in P], "x [mm]": X.tolist()}
    path = folder / f"run.{kind}"
    if kind == "json":
        split = {"columns": list(rows), "index": list(range(COUNT)), "data": list(zip(*rows.values(), strict=True))}
        path.write_text(json.dumps(split), encoding="utf-8")
    elif kind == "parquet":
        pq.write_table(pa.table({**rows, "note": ["as found"] * COUNT}), path)
    else:
        feather.write_feather(pa.table({**rows, "note": ["as found"] * COUNT}), path)
    return path


@pytest.mark.parametrize("kind", ["json", "parquet", "feather"])
def test_numbers_and_stamps_that_stand_as_texts_are_read(kind: str, tmp_path: Path) -> None:
    outcome = judge(texts(tmp_path, kind), tmp_path / "work", 0.0)
    assert outcome.verdict == "right", f"{outcome.verdicts}\n{outcome.why}"
    assert kind == "json" or '# not taken: "note": texts, "as found" ' in outcome.why


def test_a_broken_row_of_text_leaves_no_thread_behind(tmp_path: Path) -> None:
    import threading

    (tmp_path / "a.csv").write_text(
        "t,p\n" + "".join(f"{n},{n}\n" for n in range(50_000)) + "x,y,z\n1,2\n", encoding="utf-8"
    )
    raw = RawFile(tmp_path / "a.csv", {"time": Channel("t"), "p1": Channel("p")})
    before = threading.active_count()
    for _ in range(5):
        with pytest.raises(InputError):
            list(open_signals(raw).batches())
    assert threading.active_count() <= before
