"""What files state of their columns, away from the columns: scales, runs, ticks, names and units of other places."""

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from pneucli.io.formats import open_raw
from pneucli.io.raw_file import ColumnRequest, RawFile, Reader
from pneucli.stages import init
from pneucli.units import parse_quantity

N = 200
T = np.arange(N) * 0.01
P = 3 + np.sin(T * 3)  # bar, gauge
X = 50 - 40 * np.cos(T * 3)  # mm
U = np.repeat([0.0, 4.0, -3.0, 2.0], N // 4)


def signals(tmp_path: Path, *files: Path) -> dict[str, str]:
    """Return the lines that init writes below [signals], by signal."""
    init.create(tmp_path / "p", list(files))
    text = (tmp_path / "p" / "pipeline.toml").read_text()
    body = text.partition("[signals]")[2].partition("[[recordings]]")[0]
    return {line.partition(" = ")[0]: line for line in body.splitlines() if " = " in line}


def table(path: Path, header: str, *columns: Any, top: str = "", form: str = "%.6g", end: str = "") -> Path:
    rows = "\n".join(",".join(form % value for value in row) for row in zip(*columns, strict=True))
    path.write_text(f"{top}{header}\n{rows}\n{end}")
    return path


def opened(path: Path) -> tuple[Reader, dict[str, np.ndarray]]:
    reader = open_raw(RawFile(path, {}))
    places = [n for n in range(len(reader.names)) if n not in reader.labels]
    read = {reader.names[n]: np.concatenate([own[0] for own in reader.batches([ColumnRequest(n)])]) for n in places}
    return reader, read


@pytest.mark.parametrize(
    ("top", "raw", "said"),
    [
        ("# P1: 4-20 mA = 0-10 bar (gauge)\n", ("P1 [mA]", 4 + 1.6 * P), "0.625 * `P1 [mA]` - 2.5"),
        ("# pressure: 0..10 V = 0...10 bar\n", ("P1 [V]", P), "1 * `P1 [V]`"),
        ("# P2: 4-20 mA = 0-10 bar\n# P1: 4-20 mA = 0-16 bar\n", ("P1 [mA]", 4 + P), "1 * `P1 [mA]` - 4"),
    ],
)
def test_a_scale_above_the_table_is_that_of_the_sensor(tmp_path: Path, top: str, raw: Any, said: str) -> None:
    file = table(tmp_path / "a.csv", f"t [s],valve [V],{raw[0]},x [mm]", T, U, raw[1], X, top=top)
    assert f'expression = "{said}", unit = "bar"' in signals(tmp_path, file)["p1"]


def test_counts_to_a_millimetre_above_the_table_are_those_of_the_encoder(tmp_path: Path) -> None:
    file = table(
        tmp_path / "a.csv",
        "t_s,valve_V,p1_bar,pos_counts",
        T,
        U,
        P,
        np.round(X * 200),
        top="# encoder: 200 counts/mm\n",
    )
    assert 'expression = "0.005 * `pos_counts`", unit = "mm" }' in signals(tmp_path, file)["x"]


def test_the_scale_of_another_sensor_is_not_taken(tmp_path: Path) -> None:
    top = "# P2: 4-20 mA = 0-10 bar\n"
    file = table(tmp_path / "a.csv", "t [s],valve [V],P1 [mA],x [mm]", T, U, 4 + P, X, top=top)
    assert 'scale = "?"' in signals(tmp_path, file)["p1"]


def test_readings_beyond_a_stated_range_are_not_of_that_scale(tmp_path: Path) -> None:
    top = "# P1: 4-20 mA = 0-10 bar\n"
    file = table(tmp_path / "a.csv", "t [s],valve [V],P1 [mA],x [mm]", T, U, 40 * P, X, top=top)
    assert 'scale = "?"' in signals(tmp_path, file)["p1"]


def test_a_state_in_the_name_of_a_flow_is_that_of_its_volume(tmp_path: Path) -> None:
    header = 't [s],valve [V],tank [bar],"Flow [NL/min] (20 °C, 1013 mbar)"'
    flow = signals(tmp_path, table(tmp_path / "a.csv", header, T, U, P, 10 * P))["flow"]
    assert parse_quantity("20 °C", "K") == pytest.approx(293.15)
    assert float(flow.partition("scale = ")[2].split()[0].strip(",")) == pytest.approx(273.15 / 293.15, rel=1e-3)


def test_ticks_count_as_many_a_second_as_the_file_says(tmp_path: Path) -> None:
    ticks = 912_345_678_901 + np.round(T * 1e7)
    file = table(
        tmp_path / "a.csv",
        "Ticks,U [V],p1 [bar],x [mm]",
        ticks,
        U,
        P,
        X,
        top="# TickFrequency: 10000000\n",
        form="%.15g",
    )
    assert 'unit = "s", scale = 1e-07' in signals(tmp_path, file)["time"]


@pytest.mark.parametrize("mark", ["# run 2\n", "\n\n", "# t,p1\n"])
def test_runs_that_comments_or_blank_lines_part_are_recordings(tmp_path: Path, mark: str) -> None:
    rows = "\n".join(f"{t:.2f},{u:.2f},{p:.4f},{x:.3f}" for t, u, p, x in zip(T, U, P, X, strict=True)) + "\n"
    (tmp_path / "a.csv").write_text(f"t_s,u_V,p1_bar,x_mm\n{rows}{mark}{rows}")
    init.create(tmp_path / "p", [tmp_path / "a.csv"])
    text = (tmp_path / "p" / "pipeline.toml").read_text()
    assert [line for line in text.splitlines() if line.startswith("part")] == ["part = 1", "part = 2"]


def test_comments_in_one_run_part_nothing(tmp_path: Path) -> None:
    rows = [f"{t:.2f},{u:.2f},{p:.4f},{x:.3f}\n" for t, u, p, x in zip(T, U, P, X, strict=True)]
    (tmp_path / "a.csv").write_text(
        "t_s,u_V,p1_bar,x_mm\n" + "".join(rows[:100]) + "# valve warm\n" + "".join(rows[100:])
    )
    init.create(tmp_path / "p", [tmp_path / "a.csv"])
    assert "part = " not in (tmp_path / "p" / "pipeline.toml").read_text()


@pytest.mark.parametrize(
    ("said", "clock"),
    [
        ("Cycle time: 10 ms", "row * 0.01"),
        ("Abtastrate: 0,1 kHz", "row / 100"),
        ("Zeitraster;10000;us", "row * 0.01"),
        ("Recording time: 10 s", "row / ?"),
    ],
)
def test_a_cycle_time_above_the_table_is_the_clock(tmp_path: Path, said: str, clock: str) -> None:
    rows = "\n".join(f"{u};{p};{x}" for u, p, x in zip(U, P, X, strict=True))
    (tmp_path / "a.csv").write_text(f"{said}\nU [V];p1 [bar];x [mm]\n{rows}\n")
    assert clock in signals(tmp_path, tmp_path / "a.csv")["time"]


def test_whole_seconds_and_nanoseconds_are_the_clock_of_a_long_table(tmp_path: Path) -> None:
    rows = [
        f"{name},{1_718_000_000 + int(t)},{round(t % 1 * 1e9)},{own:.4f}\n"
        for t, u, p in zip(3 * T, U, P, strict=True)
        for name, own in (("valve_V", u), ("p1_bar", p))
    ]
    (tmp_path / "a.csv").write_text("tag,seconds,nanos,value\n" + "".join(rows))
    assert "`seconds` + 1e-09 * `nanos`" in signals(tmp_path, tmp_path / "a.csv")["time"]
    (tmp_path / "b.csv").write_text("".join(f"{a}:{b},{tag},{v}" for tag, a, b, v in (row.split(",") for row in rows)))
    assert "where" in signals(tmp_path / "b", tmp_path / "b.csv")["p1"]


def test_a_stamp_that_stands_once_a_second_is_that_of_the_rows_below(tmp_path: Path) -> None:
    rows = "\n".join(
        f"{f'2024-06-01 12:00:{n // 50:02d}' if n % 50 == 0 else ''},{u},{p:.4f}"
        for n, (u, p) in enumerate(zip(U, P, strict=True))
    )
    (tmp_path / "a.csv").write_text(f"DateTime,Valve V,Tank bar\n{rows}\n")
    _, read = opened(tmp_path / "a.csv")
    np.testing.assert_array_equal(read["DateTime"], np.arange(N) // 50)


@pytest.mark.parametrize(
    "whole",
    [
        {"p1": [{"ts": 1000 * n, "value": f"{p}"} for n, p in enumerate(P)], "u": [{"ts": 0, "value": "1"}]},
        [
            {"t": n, "metrics": [{"name": "p1", "value": float(p)}, {"name": "u", "value": 0.0}]}
            for n, p in enumerate(P)
        ],
        {"result": [{"metric": {"__name__": "p1"}, "values": [[n, f"{p}"] for n, p in enumerate(P)]}]},
    ],
)
def test_json_names_series_by_key_metric_or_reading(tmp_path: Path, whole: Any) -> None:
    (tmp_path / "a.json").write_text(json.dumps(whole))
    reader, read = opened(tmp_path / "a.json")
    channel = [n for n, name in enumerate(reader.names) if name == "channel"]
    if channel:
        (labels,) = (
            np.concatenate(own) for own in zip(*reader.batches([ColumnRequest(channel[0], text=True)]), strict=True)
        )
        np.testing.assert_allclose(read["value"][labels == "p1"], P)
    else:
        np.testing.assert_allclose(next(own for own in read.values() if own.size == N and not np.ptp(own - P)), P)


def test_a_map_of_units_in_json_is_of_the_columns_of_these_names(tmp_path: Path) -> None:
    whole = {"meta": {"rate_hz": 100, "units": {"p1": "kPa"}}, "data": {"p1": [*P], "u": [*U]}}
    (tmp_path / "a.json").write_text(json.dumps(whole))
    found = signals(tmp_path, tmp_path / "a.json")
    assert 'unit = "kPa"' in found["p1"]
    assert "row / 100" in found["time"]


def test_texts_beside_a_matrix_name_its_columns_in_structs_and_archives(tmp_path: Path) -> None:
    data, names = np.c_[U, P], np.array(["valve", "p_cap"], dtype=object)
    savemat(tmp_path / "a.mat", {"file1": {"data": data, "signalNames": names}})
    np.savez(tmp_path / "a.npz", data=data, channels=names.astype("U"), units=np.array(["V", "bar"]))
    assert [*opened(tmp_path / "a.mat")[1]] == ["file1/data/valve", "file1/data/p_cap"]
    reader, read = opened(tmp_path / "a.npz")
    assert [*reader.units.values()] == ["V", "bar"]
    np.testing.assert_array_equal(read["data/p_cap"], P)


def test_a_rate_in_the_struct_of_a_signal_and_the_unit_beside_a_value_count(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"Ch1": {"Name": "p1", "Unit": "bar", "SampleFrequency": 100.0, "Data": P}})
    assert "row / 100" in signals(tmp_path, tmp_path / "a.mat")["time"]
    savemat(tmp_path / "b.mat", {"p1": P, "u": U, "isi": 10.0, "isi_units": "ms"})
    assert "row * 0.01" in signals(tmp_path / "b", tmp_path / "b.mat")["time"]


def test_datasets_of_one_text_name_the_columns_of_the_matrix_beside_them(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["run/1 valve (V)"], file["run/2 p1 (Pa)"] = "valve (V)", "p1 (Pa)"
        file["run/data"] = np.c_[U, P]
    assert [*opened(tmp_path / "a.h5")[1]] == ["run/data/valve (V)", "run/data/p1 (Pa)"]


def test_each_column_of_a_packed_matrix_has_its_own_packing(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["m"] = np.c_[np.arange(9), np.arange(9), np.arange(9)].astype("i2")
        file["m"].attrs.update(scale=[0.5, 0.25, 0.25], offset=[0.0, 0.3, 2.0])
    reader, read = opened(tmp_path / "a.h5")
    np.testing.assert_allclose(read["m/2"], 0.25 * np.arange(9) + 0.3)
    assert reader.units == {2: "counts"}  # a whole offset may be one of counts


@pytest.mark.parametrize(
    "key", ["# name: {}\n# type: matrix\n# rows: 200\n# columns: 1\n", "Kanal: {}\ny-Einheit: bar\ndx: 0,01\n"]
)
def test_blocks_below_one_another_are_columns(tmp_path: Path, key: str) -> None:
    decimal = "," if "," in key else "."
    blocks = [
        key.format(name) + "\n".join(f"{v:.4f}".replace(".", decimal) for v in own)
        for name, own in (("u", U), ("p", P))
    ]
    (tmp_path / "a.txt").write_text("\n\n".join(blocks) + "\n")
    reader, read = opened(tmp_path / "a.txt")
    np.testing.assert_allclose(read["p"], P, atol=1e-4)
    assert ("p/dx" in read) == (decimal == ",") == ("bar" in reader.units.values())


def test_files_of_position_and_of_pressure_over_one_time_are_one_recording(tmp_path: Path) -> None:
    stamps = 1_718_000_000 + T
    one = table(tmp_path / "x.csv", "time,x_mm,v_mm_s", stamps, X, np.gradient(X, T), form="%.14g")
    two = table(tmp_path / "p.csv", "time,u_V,p1_bar", stamps, U, P, form="%.14g")
    init.create(tmp_path / "p", [one, two])
    assert (tmp_path / "p" / "pipeline.toml").read_text().count("[[recordings]]") == 1


@pytest.mark.parametrize(
    ("header", "wanted"),
    [
        ("t [s],Laser (in V),Laser (in mm),valve [V],p1 [bar]", "Laser (in mm)"),
        ("t [s],Stroke (V); AVE,Stroke (mm); AVE,valve (V); AVE,p1 (bar); AVE", "Stroke (mm); AVE"),
    ],
)
def test_a_reading_in_its_unit_goes_before_the_volts_of_its_sensor(tmp_path: Path, header: str, wanted: str) -> None:
    found = signals(tmp_path, table(tmp_path / "a.csv", header, T, X / 10, X, U, P))
    assert f'column = "{wanted}", unit = "mm" }}' in found["x"]
    assert found.keys() >= {"u", "p1"}


def test_a_pressure_at_the_cylinder_goes_before_that_at_the_valve(tmp_path: Path) -> None:
    header = "t [s],u [V],p_A valve port [bar],p_A cylinder [bar],x [mm]"
    assert "p_A cylinder" in signals(tmp_path, table(tmp_path / "a.csv", header, T, U, P + 0.1, P, X))["p1"]
