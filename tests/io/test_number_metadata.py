"""Metadata without which a number means something else: units of stamps, packing, marks of nothing, kinds of clocks."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.io.formats import open_raw
from pneucli.io.raw_file import ColumnRequest, RawFile, Reader

TICKS = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}


def opened(path: Path) -> Reader:
    return open_raw(RawFile(path, {}))


def column(reader: Reader, name: str) -> np.ndarray:
    (values,) = zip(*reader.batches([ColumnRequest(list(reader.names).index(name))]), strict=True)
    return np.concatenate(values)


def unit(reader: Reader, name: str) -> str | None:
    return reader.units.get(list(reader.names).index(name))


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


def test_datasets_that_stand_for_nothing_are_no_columns(tmp_path: Path) -> None:
    """A dimension of netCDF without a variable reads as zeros under the name of a clock."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"], file["none"], file["p1"] = np.zeros(3), np.array([0, 7], "u8"), np.arange(3.0)
        file["time"].attrs["NAME"] = b"This is a netCDF dimension but not a netCDF variable.         3"
        file["none"].attrs.update({"MATLAB_class": b"double", "MATLAB_empty": np.uint8(1)})
    assert list(opened(tmp_path / "a.h5").names) == ["p1"]


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
