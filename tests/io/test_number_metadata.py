"""Metadata without which a number means something else: units of stamps, packing, marks of nothing, kinds of clocks."""

import json
import re
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat

from pneucli.errors import InputError
from pneucli.io.clock import difference_of_starts
from pneucli.io.formats import open_raw
from pneucli.io.raw_file import ColumnRequest, RawFile, Reader
from pneucli.stages import init

TICKS = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}


def opened(path: Path) -> Reader:
    return open_raw(RawFile(path, {}))


def column(reader: Reader, name: str) -> np.ndarray:
    (values,) = zip(*reader.batches([ColumnRequest(list(reader.names).index(name))]), strict=True)
    return np.concatenate(values)


def unit(reader: Reader, name: str) -> str | None:
    return reader.units.get(list(reader.names).index(name))


@pytest.mark.parametrize("kind", ["virtual", "external"])
def test_numbers_in_other_files_are_refused(tmp_path: Path, kind: str) -> None:
    """HDF5 reads 0 where such a file was not copied (findings/h5py-parts-missing.sh)."""
    layout = h5py.VirtualLayout(shape=(3,), dtype="i4")
    layout[:] = h5py.VirtualSource("part.h5", "p", shape=(3,), dtype="i4")
    with h5py.File(tmp_path / "all.h5", "w") as file:
        if kind == "virtual":
            file.create_virtual_dataset("p", layout)
        else:
            file.create_dataset("p", (3,), dtype="f8", external=[("p.raw", 0, 24)])
    with pytest.raises(InputError, match="stand in other files"):
        column(opened(tmp_path / "all.h5"), "p")


@pytest.mark.parametrize(
    ("at", "key", "value"),
    [("run", "sampling_rate", 100), ("run/p", "dt", 0.01), ("/", "fs", 100), ("/", "Period (ns)", 1e7)],
)
def test_a_rate_that_an_attribute_says_is_the_clock(tmp_path: Path, at: str, key: str, value: float) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["run/p"], file["run/u"] = 3 + np.sin(np.arange(200) / 20), np.arange(200) // 50 % 2
        file[at].attrs[key] = value
    init.create(tmp_path / "rig", [tmp_path / "a.h5"])
    text = (tmp_path / "rig" / "pipeline.toml").read_text(encoding="utf-8")
    expression = "row / 100" if value == 100 else "row * 0.01"
    assert re.search(f'time = {{ expression = "{re.escape(expression)}" }} .*{re.escape(key)}', text)


@pytest.mark.parametrize("kind", ["chunks", "matrix in chunks", "contiguous"])
def test_what_nobody_wrote_of_a_dataset_is_missing(tmp_path: Path, kind: str) -> None:
    """A recorder that stopped: HDF5 reads them as 0."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        if kind == "contiguous":
            file.create_dataset("p", (9,), dtype="i2")
        elif kind == "chunks":
            file.create_dataset("p", (9,), dtype="i2", chunks=(4,))[:4] = np.arange(1, 5)
        else:
            file.create_dataset("p", (9, 2), dtype="f4", chunks=(4, 1))[:4, 1] = np.arange(1, 5)
    found = column(opened(tmp_path / "a.h5"), "p/2" if kind == "matrix in chunks" else "p")
    wanted = [np.nan] * 9 if kind == "contiguous" else [1, 2, 3, 4, *[np.nan] * 5]
    np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize("kind", ["datetime64[{}]", "datetime64[{}, UTC]", "timedelta64[{}]"])
@pytest.mark.parametrize("tick", TICKS)
@pytest.mark.parametrize("form", ["fixed", "table"])
def test_stamps_of_a_pandas_frame_count_in_the_unit_that_it_names(
    tmp_path: Path, form: str, tick: str, kind: str
) -> None:
    """pandas 3 writes microseconds where pandas 2 wrote nanoseconds (findings/pandas-hdf-ticks.sh)."""
    seconds = np.array([0, 2, 5])
    stamps = seconds * TICKS[tick] + (1_767_225_600 * TICKS[tick] if kind.startswith("date") else 0)
    text = kind.format(tick)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        group = file.create_group("run")
        if form == "fixed":
            group.attrs["pandas_type"] = b"frame"
            group["axis1"], group["block0_items"], group["block0_values"] = stamps, [b"stamp"], stamps[:, None]
            group["axis1"].attrs["kind"], group["block0_values"].attrs["value_type"] = text, text
        else:
            group.attrs["pandas_type"] = b"frame_table"
            table = np.zeros(3, dtype=[("index", "i8"), ("values_block_0", "i8", (1,))])
            table["index"], table["values_block_0"] = stamps, stamps[:, None]
            group["table"] = table
            group["table"].attrs.update({"index_kind": text, "values_block_0_dtype": text})
            group["table"].attrs["values_block_0_kind"] = b"(lp0\nVstamp\np1\na."
    reader = opened(tmp_path / "a.h5")
    for name in ("run/index", "run/stamp"):
        np.testing.assert_array_equal(column(reader, name), seconds)
        assert unit(reader, name) == "s"


def test_stamps_of_older_frames_count_in_nanoseconds(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        group = file.create_group("run")
        group.attrs["pandas_type"] = b"frame"
        group["axis1"] = np.array([0, 10**7])
        group["axis1"].attrs["kind"] = b"datetime64"
    np.testing.assert_array_equal(column(opened(tmp_path / "a.h5"), "run/index"), [0, 0.01])


def test_packed_numbers_are_unpacked_and_what_is_missing_or_not_valid_is_nan(tmp_path: Path) -> None:
    """As CF packs: fill values and limits count in the stored numbers."""
    with h5py.File(tmp_path / "a.nc", "w") as file:
        file["p1"] = np.array([100, 300, -32768, -1, 700], "i2")
        marks = {"_FillValue": np.array([-32768], "i2"), "missing_value": np.int16(-1)}
        packing = {"scale_factor": np.array([0.01]), "add_offset": 2.0, "units": np.array(["bar"], dtype=object)}
        file["p1"].attrs.update(marks | packing)
        file["p2"] = np.array([100, 300, 700, 500, -1], "i2")
        file["p2"].attrs.update(packing | {"valid_range": np.array([0, 500], "i2")})
        file["x"] = np.array([1, 2, 3, 4, 5], "i2")
        file["x"].attrs.update({"valid_max": np.int16(4), "valid_min": np.int16(2)})
    reader = opened(tmp_path / "a.nc")
    np.testing.assert_allclose(column(reader, "p1"), [3, 5, np.nan, np.nan, 9])
    np.testing.assert_allclose(column(reader, "p2"), [3, 5, np.nan, 7, np.nan])
    np.testing.assert_array_equal(column(reader, "x"), [np.nan, 2, 3, 4, np.nan])
    assert unit(reader, "p1") == "bar"


@pytest.mark.parametrize(
    ("said", "kind", "read"),
    [
        ({"gain": 0.01, "offset": -0.5}, "i2", [0.5, 6.5]),
        ({"Slope": 0.01}, "u2", [1.0, 7.0]),
        ({"scale_factor": 2.0, "add_offset": 3.0}, "i2", [203.0, 1403.0]),
        ({"conversion": 20.0, "offset": 300.0}, "i2", [2300.0, 14300.0]),  # of Neurodata Without Borders
        ({"gain": 10.0}, "i2", None),  # of an amplifier?
        ({"gain": 0.01, "offset": 2048}, "i2", None),  # in counts?
        ({"gain": 0.01, "offset": -0.5}, "f8", [100.0, 700.0]),
    ],
)
@pytest.mark.parametrize("form", ["a.h5", "a.parquet"])
def test_a_gain_of_whole_numbers_is_applied_where_it_has_one_meaning_and_else_asked_for(
    tmp_path: Path, form: str, said: dict[str, float], kind: str, read: list[float] | None
) -> None:
    raw = np.array([100, 700], kind)
    if form == "a.h5":
        with h5py.File(tmp_path / form, "w") as file:
            file["p1"] = raw
            file["p1"].attrs.update(said | {"unit": "bar"})
    else:
        texts = {key: str(one) for key, one in said.items()} | {"unit": "bar"}
        field = pa.field("p1", pa.from_numpy_dtype(raw.dtype), metadata=texts)
        pq.write_table(pa.table([pa.array(raw)], schema=pa.schema([field])), tmp_path / form)
    reader = opened(tmp_path / form)
    assert unit(reader, "p1") == ("counts" if read is None else "bar")
    np.testing.assert_allclose(column(reader, "p1"), [100.0, 700.0] if read is None else read)


@pytest.mark.parametrize("form", ["a.parquet", "a.npz", "a.json"])
def test_stamps_of_a_calendar_are_known_to_be_read_in_seconds(tmp_path: Path, form: str) -> None:
    stamps = np.datetime64("2026-03-11T09:15:02", "ms") + np.arange(3) * np.timedelta64(10, "ms")
    if form == "a.parquet":
        pq.write_table(pa.table({"time": stamps, "p1": [1.0, 2.0, 3.0]}), tmp_path / form)
    elif form == "a.npz":
        np.savez(tmp_path / form, time=stamps, p1=np.arange(3.0))
    else:
        (tmp_path / form).write_text(json.dumps([{"time": str(one), "p1": 1.0} for one in stamps]), encoding="utf-8")
    reader = opened(tmp_path / form)
    np.testing.assert_allclose(column(reader, "time"), [0.0, 0.01, 0.02])
    assert {list(reader.names).index("time")} == {*reader.stamps}


def test_datasets_that_stand_for_nothing_are_no_columns(tmp_path: Path) -> None:
    """A dimension of netCDF without a variable reads as zeros under the name of a clock."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"], file["none"], file["p1"] = np.zeros(3), np.array([0, 7], "u8"), np.arange(3.0)
        file["time"].attrs["NAME"] = b"This is a netCDF dimension but not a netCDF variable.         3"
        file["none"].attrs.update({"MATLAB_class": b"double", "MATLAB_empty": np.uint8(1)})
    assert list(opened(tmp_path / "a.h5").names) == ["p1"]


def test_attributes_name_the_columns_of_a_matrix(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["data"] = np.arange(8.0).reshape(4, 2)
        file["data"].attrs.update({"names": ["u", "p1"], "units": ["V", "bar"]})
        file["plain"] = np.arange(8.0).reshape(4, 2)
        file["own/m"], file["own/names"], file["own/eu"] = np.arange(8.0).reshape(4, 2), ["x", "p2"], ["mm", "kPa"]
    reader = opened(tmp_path / "a.h5")
    assert list(reader.names) == ["data/u", "data/p1", "own/m/x", "own/m/p2", "plain/1", "plain/2"]
    assert reader.units == {0: "V", 1: "bar", 2: "mm", 3: "kPa"}


@pytest.mark.parametrize("texts", [[], ["u", "p1"]])
def test_a_link_to_nothing_beside_a_matrix_is_passed_over(tmp_path: Path, texts: list[str]) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["data"] = np.arange(8.0).reshape(4, 2)
        file["gone"], file["elsewhere"] = h5py.SoftLink("/nowhere"), h5py.ExternalLink("none.h5", "/data")
        if texts:
            file["labels"] = texts
    reader = opened(tmp_path / "a.h5")
    assert list(reader.names) == ["data/u" if texts else "data/1", "data/p1" if texts else "data/2"]
    np.testing.assert_array_equal(column(reader, reader.names[1]), [1, 3, 5, 7])


@pytest.mark.parametrize("kind", ["char", "cell"])
def test_texts_beside_a_matrix_of_matlab_name_its_columns(tmp_path: Path, kind: str) -> None:
    """AcqKnowledge writes ``data``, ``labels`` and ``units``; others cell arrays."""
    texts = {"labels": np.array(["valve", "p1"], object), "units": np.array(["V", "bar"], object)}
    texts = texts if kind == "cell" else {key: own.astype(str) for key, own in texts.items()}
    savemat(tmp_path / "a.mat", {"data": np.arange(8.0).reshape(4, 2), **texts})
    reader = opened(tmp_path / "a.mat")
    assert list(reader.names) == ["data/valve", "data/p1"]
    assert reader.units == {0: "V", 1: "bar"}
    np.testing.assert_array_equal(column(reader, "data/p1"), [1, 3, 5, 7])


def test_structs_in_a_cell_array_are_channels(tmp_path: Path) -> None:
    """What ``logsout`` becomes where each element is saved as a struct."""
    cells = np.empty(2, object)
    cells[:] = [
        {"Name": name, "Values": {"Time": np.arange(3.0), "Data": np.full(3, value), "Units": "bar"}}
        for name, value in (("p1", 1.0), ("p2", 2.0))
    ]
    savemat(tmp_path / "a.mat", {"logsout": {"Name": "logsout", "Elements": cells}})
    reader = opened(tmp_path / "a.mat")
    assert [name for name in reader.names if "time" not in name] == ["logsout/Elements/p1", "logsout/Elements/p2"]
    np.testing.assert_array_equal(column(reader, "logsout/Elements/p2"), [2, 2, 2])


def test_columns_of_a_matrix_of_records_keep_the_name_of_their_field(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["data"] = np.zeros((4, 2), dtype=[("low", "f8"), ("high", "f8")])
        file["data"].attrs["names"] = ["u", "p1"]
    names = ["data/low/u", "data/low/p1", "data/high/u", "data/high/p1"]
    assert list(opened(tmp_path / "a.h5").names) == names


def mdf(path: Path, *, sync: int) -> Reader:
    """An MDF 4 of a group over time, and one whose master counts what ``sync`` says."""
    from asammdf import MDF, Signal

    stamps = np.arange(4) * 0.1
    with MDF(version="4.10") as file:
        file.append([Signal(stamps + 1, stamps, name="p1", unit="bar")])
        file.append([Signal(stamps + 2, stamps + 5, name="x", unit="mm")])
        master = file.groups[1].channels[0]
        master.sync_type, master.name, master.unit = sync, "phi", "rad"
        file.save(path)
    return opened(path)


def test_a_master_of_angle_is_a_channel_and_no_clock(tmp_path: Path) -> None:
    reader = mdf(tmp_path / "a.mf4", sync=2)
    assert list(reader.names) == ["p1", "phi", "x", "time", "clock of group 0"]
    assert dict(reader.clocks) == {0: 4}
    np.testing.assert_allclose(column(reader, "phi"), [5, 5.1, 5.2, 5.3])
    with pytest.raises(InputError, match="its group has no clock"):
        list(reader.batches([ColumnRequest(2), ColumnRequest(3)]))


def test_a_master_of_time_is_a_clock_whatever_it_is_called(tmp_path: Path) -> None:
    assert dict(mdf(tmp_path / "a.mf4", sync=1).clocks) == {0: 4, 1: 5}


@pytest.mark.parametrize(("version", "suffix"), [("4.10", "mf4"), ("3.30", "mdf")])
def test_the_unit_of_an_mdf_conversion_counts_where_the_channel_has_none(
    tmp_path: Path, version: str, suffix: str
) -> None:
    from asammdf import MDF, Signal

    path = tmp_path / f"a.{suffix}"
    with MDF(version=version) as file:
        conversion = {"a": 0.001, "b": 0.0, "unit": "bar"}
        file.append([Signal(np.array([1000, 2000], "i2"), [0.0, 0.1], name="p1", unit="bar", conversion=conversion)])
        if version == "4.10":
            file.groups[0].channels[1].unit = ""
        file.save(path)
    with MDF(path) as file:
        assert not getattr(file.groups[0].channels[1], "unit", "")
    reader = opened(path)
    assert unit(reader, "p1") == "bar"
    np.testing.assert_allclose(column(reader, "p1"), [1, 2])


@pytest.mark.parametrize(("text", "clock"), [("ms", [0.0005, 0.0025]), ("s", [0.5, 2.5]), ("Hz", None), ("mm", None)])
def test_a_waveform_counts_in_the_unit_of_its_axis(tmp_path: Path, text: str, clock: list[float] | None) -> None:
    """A spectrum over Hz, and a force over mm, have no clock."""
    from nptdms import ChannelObject, TdmsWriter

    axis = {"wf_increment": 2.0, "wf_start_offset": 0.5, "wf_samples": 2, "wf_xunit_string": text}
    with TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment([ChannelObject("g", "p", np.arange(2.0), properties=axis)])
    reader = opened(tmp_path / "a.tdms")
    if clock is None:
        assert list(reader.names) == ["g/p"]
    else:
        np.testing.assert_allclose(column(reader, "time"), clock)


RAW = np.array([0, 5, 9, 10, 15, 20, 29, 30], dtype=np.uint8)


def converted(path: Path, samples: np.ndarray, conversion: Any) -> Reader:
    from asammdf import MDF, Signal

    with MDF(version="4.10") as file:
        file.append([Signal(samples, np.arange(samples.size) * 0.1, name="p1", unit="bar", conversion=conversion)])
        file.save(path)
    return opened(path)


@pytest.mark.parametrize(
    ("formula", "of"),
    [
        ("0.25*pow(X,2)", lambda x: 0.25 * x**2),
        ("0.25*X^2", lambda x: 0.25 * x**2),
        ("0.25*X**2", lambda x: 0.25 * x**2),
        ("sqrt(X1) + 1", lambda x: np.sqrt(x) + 1),
    ],
)
def test_formulas_of_mdf_are_evaluated(tmp_path: Path, formula: str, of: Any) -> None:
    reader = converted(tmp_path / "a.mf4", RAW, {"formula": formula})
    np.testing.assert_allclose(column(reader, "p1"), of(RAW.astype(float)))


def test_a_formula_of_mdf_that_is_not_known_is_refused(tmp_path: Path) -> None:
    reader = converted(tmp_path / "a.mf4", RAW, {"formula": "lookup(X, Y)"})
    with pytest.raises(InputError, match="lookup"):
        column(reader, "p1")


@pytest.mark.parametrize("kind", [np.uint8, np.float64])
def test_ranges_of_mdf_hold_their_upper_end_for_integers_alone(tmp_path: Path, kind: Any) -> None:
    """ASAM MDF 4, block CC, type 6."""
    ranges = {f"{key}_{n}": value for n, (low, high, phys) in enumerate(((0, 9, -2), (10, 19, 0), (20, 29, 2)))
              for key, value in (("lower", low), ("upper", high), ("phys", phys))}  # fmt: skip
    reader = converted(tmp_path / "a.mf4", RAW.astype(kind), {**ranges, "default": 9.0})
    of_integers, of_floats = [-2, -2, -2, 0, 0, 2, 2, 9], [-2, -2, 9, 0, 0, 2, 9, 9]
    np.testing.assert_array_equal(column(reader, "p1"), of_integers if kind is np.uint8 else of_floats)


def test_texts_of_mdf_are_labels_and_refused_as_numbers_in_words(tmp_path: Path) -> None:
    texts = {"val_0": 0, "text_0": b"idle", "val_1": 5, "text_1": b"running"}
    reader = converted(tmp_path / "a.mf4", RAW, texts)
    assert list(reader.labels) == [list(reader.names).index("p1")]
    with pytest.raises(InputError, match=r'column "p1": texts, such as "idle"'):
        column(reader, "p1")
    (found,) = zip(*reader.batches([ColumnRequest(list(reader.names).index("p1"), text=True)]), strict=True)
    assert found[0].tolist()[:2] == ["idle", "running"]


def appended(path: Path, *starts: float) -> Reader:
    """A waveform of four samples at 10 Hz for each start (s), each appended to the file by itself."""
    from nptdms import ChannelObject, TdmsWriter

    for number, start in enumerate(starts):
        begin = np.datetime64("2026-01-01T00:00:00") + np.timedelta64(round(1e6 * start), "us")
        own = {"wf_start_time": begin, "wf_increment": 0.1, "wf_start_offset": 0.0}
        with TdmsWriter(path, mode="a" if number else "w") as writer:
            writer.write_segment([ChannelObject("g", "p", np.arange(4.0) + number, properties=own)])
    return opened(path)


def test_each_run_that_was_appended_to_a_tdms_keeps_its_start(tmp_path: Path) -> None:
    clock = column(appended(tmp_path / "a.tdms", 0.0, 3.7, 10.0), "time")
    ticks = 0.1 * np.arange(4)
    np.testing.assert_allclose(clock, np.concatenate([ticks, 3.7 + ticks, 10.0 + ticks]))
    np.testing.assert_allclose(column(appended(tmp_path / "b.tdms", 0.0, 0.0), "time"), 0.1 * np.arange(8))


def test_a_scale_of_tdms_that_is_not_known_is_refused(tmp_path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    for kind in ("Linear", "Neural"):
        scale = {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": kind, "NI_Scale[0]_Linear_Slope": 2.0}
        scale |= {"NI_Scale[0]_Linear_Y_Intercept": 1.0, "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF}
        with TdmsWriter(tmp_path / f"{kind}.tdms") as writer:
            own = {**scale, "NI_Scaling_Status": "unscaled"}
            writer.write_segment([ChannelObject("g", "p", np.arange(3, dtype=np.int16), properties=own)])
    np.testing.assert_allclose(column(opened(tmp_path / "Linear.tdms"), "g/p"), [1, 3, 5])
    with pytest.raises(InputError, match='a scale of the type "Neural"'):
        column(opened(tmp_path / "Neural.tdms"), "g/p")


@pytest.mark.parametrize("first", [0, 5, 1_760_000_000])
@pytest.mark.parametrize("count", [90, 1200])
def test_stamps_of_a_simulation_count_from_its_first_second_on(first: int, count: int) -> None:
    from pneucli.io.formats.ros_bag import _row, _stamps

    ns = first * 10**9 + 10**7 * np.arange(count)
    rows = [
        _row({"header": {"stamp": {"sec": int(t // 10**9), "nanosec": int(t % 10**9)}}, "p1": 1.0}, 7 + n)
        for n, t in enumerate(ns.tolist())
    ]
    assert _stamps(rows) == ns.tolist()
    blank = [_row({"header": {"stamp": {"sec": 0, "nanosec": 0}}, "p1": 1.0}, 7 + n) for n in range(count)]
    assert _stamps(blank) == [7 + n for n in range(count)]


def test_definitions_of_an_older_release_are_tried_where_the_newest_do_not_fit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rosbags import highlevel, typesys

    from pneucli.io.formats.ros_bag import open_rosbag2

    tried = []

    class OfHumble:
        def __init__(self, _: Any, default_typestore: Any) -> None:
            tried.append(default_typestore)

        def __enter__(self) -> Any:
            return self

        def __exit__(self, *_: object) -> None:
            return None

        def messages(self) -> Any:
            return [(SimpleNamespace(topic="/p", msgtype="a/msg/P"), 10**9 * n, b"") for n in range(3)]

        def deserialize(self, *_: object) -> Any:
            if tried[-1] != typesys.Stores.ROS2_HUMBLE:
                raise AssertionError("bytes are left")
            return {"value": 4.0}

    monkeypatch.setattr(highlevel, "AnyReader", OfHumble)
    monkeypatch.setattr(typesys, "get_typestore", lambda store: store)
    (tmp_path / "a.db3").write_bytes(b"SQLite format 3\0 CREATE TABLE messages")
    np.testing.assert_array_equal(column(open_rosbag2(tmp_path / "a.db3"), "p/value"), [4.0] * 3)
    assert tried[-1] == typesys.Stores.ROS2_HUMBLE


START = datetime(2026, 5, 4, 8, 0, 0, 300_000)


def dated_files(folder: Path) -> dict[str, Path]:
    """Files whose clock begins at START: as a start that the file states, or as stamps with dates."""
    import pyarrow as pa
    import pyarrow.parquet as pq
    from asammdf import MDF, Signal
    from nptdms import ChannelObject, TdmsWriter
    from pyarrow import feather

    ticks = [START + timedelta(milliseconds=10 * n) for n in range(30)]
    found = {kind: folder / f"a.{kind}" for kind in ("mf4", "tdms", "parquet", "feather", "jsonl", "csv", "npz", "nc")}
    with MDF(version="4.10") as file:
        file.header.start_time = START.replace(tzinfo=UTC)
        file.append([Signal(np.arange(30.0), 0.01 * np.arange(30), name="p1")])
        file.save(found["mf4"])
    with TdmsWriter(found["tdms"]) as writer:
        wave = {"wf_start_time": np.datetime64(START), "wf_increment": 0.01, "wf_start_offset": 0.0}
        writer.write_segment([ChannelObject("g", "p1", np.arange(30.0), properties=wave)])
    table = pa.table({"time": ticks, "p1": np.arange(30.0)})
    pq.write_table(table, found["parquet"])
    feather.write_feather(table, found["feather"])
    rows = [{"time": f"{t.isoformat()}Z", "p1": n} for n, t in enumerate(ticks)]
    found["jsonl"].write_text("\n".join(map(json.dumps, rows)))
    found["csv"].write_text("time,p1\n" + "".join(f"{t},{n}\n" for n, t in enumerate(ticks)))
    np.savez(found["npz"], time=np.array(ticks, "datetime64[us]"), p1=np.arange(30.0))
    with h5py.File(found["nc"], "w") as file:
        file["p1"], file["time"] = np.arange(30.0), 10.0 * np.arange(30)
        file["time"].attrs["units"] = f"milliseconds since {START}"
    return found


def test_every_format_says_when_its_clock_reads_0(tmp_path: Path) -> None:
    for kind, path in dated_files(tmp_path).items():
        reader = opened(path)
        clock = column(reader, "time")
        assert reader.start is not None, kind
        assert reader.start.replace(tzinfo=None) == START, kind
        scale = 1e-3 if kind == "nc" else 1.0
        np.testing.assert_allclose(scale * (clock - clock[0]), 0.01 * np.arange(30), atol=1e-9)


def test_a_zone_that_a_file_writes_is_taken_off_in_every_format(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq
    from pyarrow import feather

    utc = START.replace(tzinfo=UTC)
    local = utc.astimezone(timezone(timedelta(hours=2)))
    table = pa.table({"time": pa.array([utc, utc], pa.timestamp("us", "Europe/Rome")), "p1": [1.0, 2.0]})
    pq.write_table(table, tmp_path / "a.parquet")
    feather.write_feather(table, tmp_path / "a.feather")
    with h5py.File(tmp_path / "a.nc", "w") as file:
        file["p1"], file["time"] = [1.0, 2.0], [0.0, 1.0]
        file["time"].attrs["units"] = f"seconds since {local}"
    (tmp_path / "a.csv").write_text(f"time,p1\n{local.isoformat()},1\n{local.isoformat()},2\n")
    (tmp_path / "a.jsonl").write_text("\n".join(json.dumps({"time": local.isoformat(), "p1": n}) for n in range(2)))
    for path in sorted(tmp_path.iterdir()):
        reader = opened(path)
        column(reader, "time")
        assert reader.start == utc, path.name


def test_a_clock_that_was_never_set_has_no_start(tmp_path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(tmp_path / "a.tdms") as writer:
        wave = {"wf_start_time": np.datetime64("1904-01-01T00:00:00"), "wf_increment": 0.01}
        writer.write_segment([ChannelObject("g", "p1", np.arange(3.0), properties=wave)])
    (tmp_path / "a.csv").write_text("time,p1\n1970-01-01 00:00:05,1\n1970-01-01 00:00:06,2\n")
    for path in tmp_path.iterdir():
        reader = opened(path)
        column(reader, "time")
        assert reader.start is None, path.name


@pytest.mark.parametrize("hours", [-8.0, -3.5, 0.0, 5.75, 12.0])
def test_a_zone_that_one_of_two_files_does_not_write_is_taken_off(hours: float) -> None:
    local = START + timedelta(hours=hours, seconds=0.3)
    assert difference_of_starts(START.replace(tzinfo=UTC), local) == pytest.approx((0.3, 3600 * hours))
    assert difference_of_starts(START, local) == pytest.approx((3600 * hours + 0.3, 0.0))


def test_times_of_pytables_are_named(tmp_path: Path) -> None:
    """Time64Col has a type of HDF5 that NumPy lacks: other columns are read, and alone it is named."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        space = h5py.h5s.create_simple((3,))
        h5py.h5d.create(file.id, b"t", h5py.h5t.UNIX_D64LE, space)
    with pytest.raises(InputError, match='"t": a type that NumPy lacks'):
        opened(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file["p1"] = [6.0, 6.1, 6.2]
    assert list(opened(tmp_path / "a.h5").names) == ["p1"]
