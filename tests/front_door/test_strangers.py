"""What recordings of strangers hold: each is read right, doubted, or refused in words."""

import re
from datetime import timedelta
from pathlib import Path

import h5py
import numpy as np
import pytest

from pneucli.config import load
from pneucli.errors import InputError
from pneucli.init.survey import survey_file
from pneucli.io.raw_file import RawFile
from pneucli.messages.init import Answer
from pneucli.pipeline.graph import Context
from pneucli.stages import ingest, init

T = np.arange(600) / 100
P = 1.0 + 2.0 * np.sin(T) ** 2
ON = (T % 2 < 1).astype(int)


def rows(*columns: object, mark: str = ",") -> str:
    return "".join(mark.join(str(field) for field in row) + "\n" for row in zip(*columns, strict=True))  # type: ignore[call-overload]


def looked_at(folder: Path, text: str, name: str = "a.csv") -> Answer:
    folder.mkdir(exist_ok=True)
    (folder / name).write_text(text, encoding="utf-8")
    return init.create(folder / "rig", [folder / name])


def roles(answer: Answer) -> dict[str, str | int]:
    return {one.signal: one.column for one in answer.columns if one.signal}


def note(answer: Answer, signal: str) -> str:
    return next(one.why for one in answer.columns if one.signal == signal)


STAMPS = [f"11/21/2015,10:{n // 60:02d}:{n % 60:02d}" for n in range(600)]
NAMED = {  # text, and what its columns are taken for
    "serial numbers as names": (
        "Date,Time,2050012,2044813,2051151\n" + rows(STAMPS, P + 99, P + 99.1, P + 99.2),
        {"time": "Time"},  # one reading thrice, of which nothing says what it is
    ),
    "a vector beside a pressure": (
        "t [s],p1 [bar],GyroX,GyroY,GyroZ\n" + rows(T, P, np.sin(T), np.cos(T), T % 1),
        {"time": "t [s]", "p1": "p1 [bar]"},
    ),
    "a battery that empties in steps": (
        "t [s],Pressure (Bar),Battery Level (%)\n" + rows(T, P, 100 - T // 1),
        {"time": "t [s]", "p1": "Pressure (Bar)"},
    ),
    "a sensor's own volts": (
        "t [s],Pressure (bar),Average Pressure Voltage (mV)\n" + rows(T, P, np.round(40 + P, 1)),
        {"time": "t [s]", "p1": "Pressure (bar)"},
    ),
    "a quantity that steps in a unit of its own": (
        "t [s],p1 [bar],Gs [kg/m2s]\n" + rows(T, P, 40 + ON),
        {"time": "t [s]", "p1": "p1 [bar]"},
    ),
    "a lamp beside nothing that it may move": (
        "t [s],LED,Signal\n" + rows(T, ON, P),
        {"time": "t [s]"},
    ),
    "a speed of a motor": (
        "t [s],p1 [bar],rpm\n" + rows(T, P, 1500 + T),
        {"time": "t [s]", "p1": "p1 [bar]"},
    ),
    "absolute and relative readings of one sensor": (
        "t [s],Pressure_Rel,Pressure_abs\n" + rows(T, P - 1, P),
        {"time": "t [s]", "p1": "Pressure_Rel"},
    ),
    "loads over pairs of columns, apart by an empty one": (
        "t [s],100 grams,,,200 grams,\n,Pressure (psi),disp (mm),,Pressure (psi),disp (mm)\n"
        + rows(T, 15 * P, P, [""] * 600, 15 * P + T, P),
        {
            "time": "t [s]",
            "p1": "100 grams Pressure (psi)",
            "p2": "200 grams Pressure (psi)",
            "x": "100 grams disp (mm)",
        },
    ),
    "volts of inputs, and the same again behind them": (
        "Time [s],AIN0,AIN1,AIN2,y0,y1,y2,y3\n"
        + rows(T, 5 * ON, P, np.cos(T), 5 * ON, 10 * P, 3 * np.cos(T), np.sin(3 * T)),
        {"time": "Time [s]", "u": "AIN0"},
    ),
    "a reading that is logged twice": (
        "t [s],p1 [bar],position [mm],y\n" + rows(T, P, 40 * np.cos(T), 8 * np.cos(T) + 1),
        {"time": "t [s]", "p1": "p1 [bar]", "x": "position [mm]"},
    ),
    "a position that follows its reference": (
        "t [s],p1 [bar],x_ref [mm],x [mm]\n" + rows(T, P, np.round(40 * np.cos(T)), np.round(40 * np.cos(T)) + 0.01),
        {"time": "t [s]", "p1": "p1 [bar]", "x_ref": "x_ref [mm]", "x": "x [mm]"},
    ),
    "joints of a robot": (
        "t [s],p1 [bar],q1,q2,q3\n" + rows(T, P, np.sin(T), np.cos(T), np.sin(3 * T)),
        {"time": "t [s]", "p1": "p1 [bar]"},
    ),
    "names before each number": (
        "".join(
            f"{t:.2f};rig.valve_V;{5 * on};rig.p1_bar;{p:.4f};rig.x_mm;{10 * np.cos(t):.3f};\n"
            for t, on, p in zip(T, ON, P, strict=True)
        ),
        {"time": 1, "u": "rig.valve_V", "p1": "rig.p1_bar", "x": "rig.x_mm"},
    ),
    "a setpoint of a unit A": (
        "t [s],p1 [bar],A Setpoint\n" + rows(T, P, np.round(P, 1)),
        {"time": "t [s]", "p1": "p1 [bar]"},
    ),
    "mains of a pump": (
        "t [s],p1 [bar],Voltage\n" + rows(T, P, 230 + 20 * np.cos(9 * T)),
        {"time": "t [s]", "p1": "p1 [bar]"},
    ),
    "steps of a recipe": (
        "t [s],p1 [bar],Step\n" + rows(T, P, 4 + T // 1),
        {"time": "t [s]", "p1": "p1 [bar]"},
    ),
    "a barometer's altitude": (
        "t [s],p1 [bar],Altitude [m]\n" + rows(T, P, np.cos(T)),
        {"time": "t [s]", "p1": "p1 [bar]"},
    ),
    "a map over two places": (
        "x,y,p1 [bar]\n" + rows(np.tile(np.arange(20), 30), np.repeat(np.arange(30), 20), P),
        {"x": "x", "p1": "p1 [bar]"},
    ),
    "runs whose command rises as a clock does": (
        "mode,pwm,pressure [kPa],timestamp\n"
        + rows(["fill"] * 300 + ["vent"] * 300, np.tile(np.arange(300) / 2, 2), P, 1769108526.2 + T),
        {"time": "timestamp", "u": "pwm", "p1": "pressure [kPa]"},
    ),
}


@pytest.mark.parametrize("way", NAMED)
def test_columns_have_the_roles_that_their_names_and_numbers_tell(way: str, tmp_path: Path) -> None:
    text, wanted = NAMED[way]
    assert roles(looked_at(tmp_path, text)) == wanted


def test_a_unit_that_a_comment_tells_in_words_is_read(tmp_path: Path) -> None:
    answer = looked_at(tmp_path, "# pressure in mmHg\n# t, pressure\n" + rows(T, 60 * P))
    assert next(one.unit for one in answer.columns if one.signal == "p1").startswith("mmHg")


def test_a_clock_that_starts_anew_without_a_header_is_told_before_it_is_refused(tmp_path: Path) -> None:
    answer = looked_at(tmp_path, "t [s],p1 [bar],u [V]\n" + 2 * rows(T, P, ON))
    assert "row 601: the time goes back" in note(answer, "time")


def test_a_clock_without_a_unit_tells_the_other_rate(tmp_path: Path) -> None:
    answer = looked_at(tmp_path, "Timestamp,p1 [bar],u [V]\n" + rows(1000 * np.arange(600) + 35, P, ON))
    assert "(in ms 1 Hz)" in note(answer, "time")


def test_a_files_name_tells_the_unit_of_pressures_that_have_none(tmp_path: Path) -> None:
    answer = looked_at(tmp_path, "t [s],measured_p,u [V]\n" + rows(T, 3 * P, ON), "sine_0-9psi.csv")
    assert next(one.unit for one in answer.columns if one.signal == "p1") == "psi"
    answer = looked_at(tmp_path / "supply", "t [s],measured_p,u [V]\n" + rows(T, 160 * P, ON), "run_6bar.csv")
    assert next(one.unit for one in answer.columns if one.signal == "p1") == "?", "kPa, psi, mbar or mmHg"


def test_a_unit_in_capitals_counts_behind_what_it_measures(tmp_path: Path) -> None:
    answer = looked_at(tmp_path, "t [s],A Abs Press PSIA,A Mass Flow SLPM,Loop PV\n" + rows(T, 15 + P, P, ON))
    assert {one.signal: one.unit for one in answer.columns if one.signal in ("p1", "flow")} == {
        "p1": "PSIA",
        "flow": "SLPM",
    }


def test_a_chamber_that_rests_at_ambient_pressure_may_expand_below_it(tmp_path: Path) -> None:
    expands = 1.01 + 3 * np.sin(np.maximum(T - 0.5, 0)) ** 3 * np.where(np.sin(np.maximum(T - 0.5, 0)) > 0, 1, 0.1)
    answer = looked_at(tmp_path, "t [s],p1 [bar],u [V]\n" + rows(T, expands, ON))
    assert "absolute: it rests at 1.01 bar" in note(answer, "p1")


def test_a_clock_that_goes_on_by_one_is_asked_for_its_unit(tmp_path: Path) -> None:
    answer = looked_at(tmp_path, rows(np.arange(600), P, np.cos(T), mark=","))
    assert "signals.time" in [one.key for one in answer.fill_in]


def test_a_tank_that_rests_full_rests_at_no_ambient_pressure(tmp_path: Path) -> None:
    answer = looked_at(tmp_path, "t [s],pressure,u [V]\n" + rows(T, 101 - 80 * np.sin(T / 2) ** 2, ON))
    assert next(one.unit for one in answer.columns if one.signal == "p1") == "?", "101 psi are no 101 kPa"


def test_a_table_whose_lines_end_with_a_mark_may_lie_on_its_side(tmp_path: Path) -> None:
    stamps = [f"2026/03/11 09:{n // 60:02d}:{n % 60:02d}" for n in range(300)]
    lines = ["Group1", *stamps], ["DM0", *P[:300]], ["DM1", *ON[:300]]
    with pytest.raises(InputError, match="a channel in each line"):
        looked_at(tmp_path, "".join(",".join(map(str, one)) + ",\n" for one in lines))


def test_a_velocity_turns_where_x_does(tmp_path: Path) -> None:
    answer = looked_at(tmp_path, "t [s],pressure [bar],angle [deg],motor_speed\n" + rows(T, P, 30 * P, 200 * np.sin(T)))
    assert next(one.unit for one in answer.columns if one.signal == "v") == "rad/s"


def test_numbers_that_no_pressure_has_are_asked_for_their_unit(tmp_path: Path) -> None:
    assert "signals.p1" in [one.key for one in looked_at(tmp_path, rows(5 * np.sin(T)), "a.txt").fill_in]


ODD_STAMPS = {
    "a day of the year": [f"2026-{123 + n // 400}T09:{n // 60 % 60:02d}:{n % 60:02d}" for n in range(600)],
    "a day of the year as space agencies write it": [f"2026:123:09:{n // 60:02d}:{n % 60:02d}.0" for n in range(600)],
    "days and a time": [f"{n // 400} 09:{n // 60 % 60:02d}:{n % 60:02d}" for n in range(600)],
}


@pytest.mark.parametrize("way", ODD_STAMPS)
def test_stamps_count_days(way: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("Time;p1 [bar]\n" + rows(ODD_STAMPS[way], P, mark=";"), encoding="utf-8")
    (time, _) = survey_file(RawFile(tmp_path / "a.csv", {})).columns
    wanted = np.arange(600.0) + 86_400.0 * (np.arange(600) >= 400) * ("space" not in way)
    np.testing.assert_allclose(time.values - time.values[0], wanted)


REFUSED = {
    "a logger that grew a column": (
        "t,p1,p2\n" + rows(T, P, P) + rows(T + 6, P, P, P),
        r"line 602: the columns become 4 here",
    ),
    "a logger that grew a column later": (
        "t,p1,p2\n" + 4 * rows(T, P, P) + rows(T + 6, P, P, P),
        r"line 2402: from here on 4 columns in place of 3",
    ),
    "two lines of samples": (
        ",".join(map(str, np.arange(2000) / 7)) + "\n" + ",".join(map(str, np.arange(2000) / 3)) + "\n",
        "2000 columns, and a channel in each line",
    ),
    "two samples of many channels": (
        ",".join(map(str, np.arange(100) / 7)) + "\n" + ",".join(map(str, np.arange(100) / 3)) + "\n",
        "100 columns, and a channel in each line",
    ),
    "a line for each reading": (
        "".join(f"Temperature: {20 + p:.2f} C\nPressure: {p:.3f} bar\n\n" for p in P),
        "a line for each reading: Temperature, Pressure",
    ),
    "a program": (
        "count : UDINT;\nbegin\ncount := start;\nend\n",
        r"no table of numbers, but 'count : UDINT;'",
    ),
    "a log of sentences": (
        "".join(f"2026-03-24 11:2{n % 10}:0{n % 7} [INFO]:{' word' * (n // 4 % 5)}\n" for n in range(90)),
        "no table of numbers",
    ),
}


@pytest.mark.parametrize("way", REFUSED)
def test_what_is_no_recording_is_refused_in_its_own_words(way: str, tmp_path: Path) -> None:
    text, found = REFUSED[way]
    with pytest.raises(InputError, match=found):
        looked_at(tmp_path, text)


def test_a_force_alone_is_told_to_need_a_motion(tmp_path: Path) -> None:
    answer = looked_at(tmp_path, "t [s],Force [lbs]\n" + rows(T, P))
    assert "record p1 (and p2, p_supply), or x beside the force" in "".join(answer.cannot)


def test_channels_of_twincat_may_share_a_column_of_stamps(tmp_path: Path) -> None:
    """A scope of several sample times writes one column of stamps for each of them, and shorter rows below."""
    head = "Name\tscope\n\nName\tfast\tName\tu\tp1\nSymbolComment\t\tSymbolComment\t\t\n"
    head += "Data-Type\tREAL64\tData-Type\tREAL64\tREAL64\nSampleTime[ms]\t5\tSampleTime[ms]\t10\t10\n"
    head += "SymbolName\tMAIN.fast\tSymbolName\tMAIN.u\tMAIN.p1\nUnit\tV\tUnit\tV\tbar\n\n"
    slow = [f"\t{10 * n}\t{ON[n]}\t{P[n]:.4f}" for n in range(300)] + [""] * 300
    body = "".join(f"{5 * n}\t{n % 7}{rest}\n" for n, rest in enumerate(slow))
    (tmp_path / "a.csv").write_text(head + body, encoding="utf-8")
    found = {one.name: one for one in survey_file(RawFile(tmp_path / "a.csv", {})).columns}
    p1 = found["p1"].values
    np.testing.assert_allclose(p1[np.isfinite(p1)][:100], np.round(P[:100], 4))
    assert found["p1"].unit == "bar"


def test_a_group_that_is_called_after_its_rate_has_a_clock(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["Data (100.000000 Hz)/p_tank [bar]"], file["Data (100.000000 Hz)/valve [V]"] = P, ON
    answer = init.create(tmp_path / "rig", [tmp_path / "a.h5"])
    assert 'time = { expression = "row / 100" }' in Path(answer.pipeline).read_text(encoding="utf-8")


def test_rows_that_are_counted_beside_a_clock_tell_no_unit_and_leave_it_to_people(tmp_path: Path) -> None:
    answer = looked_at(tmp_path, ",0,1\n" + rows(range(600), np.arange(600.0), P))
    assert note(answer, "time").startswith("CHECK no unit is stated")
    answer = looked_at(tmp_path / "two", rows(range(600), T, P))
    assert roles(answer)["time"] == 2


def test_the_abscissa_of_labview_is_the_clock_whatever_rises_beside_it(tmp_path: Path) -> None:
    answer = looked_at(tmp_path, "X_Value\tp1 [bar]\tSecond [s]\n" + rows(T, P, T, mark="\t"))
    assert roles(answer) == {"time": "X_Value", "p1": "p1 [bar]"}


def test_an_angle_that_goes_on_evenly_is_no_clock(tmp_path: Path) -> None:
    answer = looked_at(tmp_path, "曲轴转角,缸压力 [bar]\n" + rows(np.arange(600) / 10 - 30, P))
    assert roles(answer) == {"p1": "缸压力 [bar]", "x": "曲轴转角"}


def test_pressures_without_units_are_in_one(tmp_path: Path) -> None:
    answer = looked_at(tmp_path, "t [s],p1,p2\n" + rows(T, 110 + P, 40 + P))
    assert {one.unit.split()[0] for one in answer.columns if one.signal.startswith("p")} == {"?"}


def test_a_command_that_is_logged_on_change_is_one(tmp_path: Path) -> None:
    changed = {0: 3, 20: 5, 100: 7, 130: 3, 210: 9, 290: 4, 330: 6, 480: 5, 560: 8}
    level = [changed.get(n, "") for n in range(600)]
    answer = looked_at(tmp_path, "t [s],XV-1 [V],p1 [bar]\n" + rows(T, level, P))
    assert roles(answer)["u"] == "XV-1 [V]"


def test_rows_may_end_in_a_tab_and_begin_with_blanks(tmp_path: Path) -> None:
    lines = "".join(f"   {t:.2f}\t  {p:.4f}\t{u}\t\n" for t, p, u in zip(T, P, ON, strict=True))
    assert roles(looked_at(tmp_path, lines, "a.dat"))["time"] == 1


LOGGED = {  # a log of a program: JSON behind stamps, or behind words, or as Python writes it; names before numbers
    "Python": ("{{'t': {t:.2f}, ", {"time": "t", "p1": "p1_bar", "u": "u"}),
    "stamps": ("2026-03-11 09:15:{t:06.3f} INFO {{", {"time": 1, "p1": "p1_bar", "u": "u"}),
    "words": ('INFO data {{"t": {t:.2f}, ', {"time": "t", "p1": "p1_bar", "u": "u"}),
}


@pytest.mark.parametrize("way", LOGGED)
def test_objects_of_json_in_the_lines_of_a_log_are_rows(way: str, tmp_path: Path) -> None:
    begin, wanted = LOGGED[way]
    text = "".join(begin.format(t=t) + f'"p1_bar": {p:.4f}, "u": {u}}}\n' for t, p, u in zip(T, P, ON, strict=True))
    assert roles(looked_at(tmp_path, text, "a.log")) == wanted


def test_runs_whose_names_stand_again_are_recordings_of_their_own(tmp_path: Path) -> None:
    again = "t [s],p1 [bar],u [V],t [s],p1 [bar],u [V]\n" + rows(T, P, ON, T, 4.0 - P, ON)
    answer = looked_at(tmp_path, again)
    assert len(answer.recordings) == 2
    assert "p2" not in roles(answer)


@pytest.mark.parametrize(("against", "driven"), [(False, True), (True, True), (True, False)])
def test_a_piston_that_its_valve_drives_against_its_pressures_is_doubted(
    against: bool, driven: bool, tmp_path: Path
) -> None:
    """Of chambers that a motion from outside compresses the same pressures are no doubt."""
    t = np.arange(2000) * 0.01
    x, push = 100.0 + 90.0 * np.sin(t), (-1.0 if against else 1.0) * np.cos(t)
    signals = {"t [s]": t, "x [mm]": x, "p1 [bar]": 4.0 + push, "p2 [bar]": 4.0 - push}
    signals |= {"u [V]": np.sign(np.cos(t))} if driven else {}
    answer = looked_at(tmp_path, ",".join(signals) + "\n" + rows(*signals.values()))
    assert ("moves against" in note(answer, "p1")) == (against and driven)


@pytest.mark.parametrize("start", [86_395, 3 * 86_395])
def test_durations_as_python_writes_them_pass_a_day(start: int, tmp_path: Path) -> None:
    stamps = [f'"{timedelta(seconds=start + float(t))}"' for t in T]
    (tmp_path / "a.csv").write_text("time,p1 [bar]\n" + rows(stamps, P), encoding="utf-8")
    time = survey_file(RawFile(tmp_path / "a.csv", {})).columns[0].values
    np.testing.assert_allclose(time - time[0], T, atol=1e-6)


def test_a_row_with_stamps_of_two_clocks_is_two_samples(tmp_path: Path) -> None:
    few = np.arange(20)
    text = "Time (s),p1 (bar),Time (v) (s),v (m/s)\n" + rows(few, P[:20], few**1.1 + 0.5, np.sin(few))
    pipeline = Path(looked_at(tmp_path, text).pipeline)
    pipeline.write_text(re.sub(r'"\? (\S+)"', r'"8 \1"', pipeline.read_text(encoding="utf-8")), encoding="utf-8")
    (tmp_path / "out").mkdir()
    found = ingest.run(Context(pipeline, load(pipeline), tmp_path / "out", tmp_path))
    assert [one["samples"] for one in found["recordings"]] == [40]
