"""``init``: an example that is valid; from raw files a pipeline that says what was seen, and what people must add."""

import tomllib
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from pneucli.config import load
from pneucli.errors import InputError
from pneucli.init.columns import guess_columns
from pneucli.init.survey import Column, Survey, survey_file
from pneucli.io.raw_file import RawFile
from pneucli.messages.init import Answer
from pneucli.pipeline.graph import Context
from pneucli.stages import ingest, init
from pneucli.units import parse_quantity

T = np.arange(600) * 0.01


def write(path: Path, columns: dict[str, np.ndarray], *, top: str = "", mark: str = ",") -> Path:
    rows = (mark.join(f"{value:.6g}" for value in row) for row in zip(*columns.values(), strict=True))
    head = [mark.join(columns)] if any(not name.isdigit() for name in columns) else []
    path.write_text(top + "\n".join([*head, *rows]) + "\n", encoding="utf-8")
    return path


def stroke(pressure: float = 4.0, size: float = 30.0) -> dict[str, np.ndarray]:
    noise = 1e-3 * np.random.default_rng(1).standard_normal(T.size)
    return {"t [s]": T, "p1 [bar]": pressure + noise, "pos [mm]": 50 + size * np.sin(T) + noise, "F [N]": np.cos(T)}


def lines_of(answer: Answer) -> list[str]:
    return Path(answer.pipeline).read_text(encoding="utf-8").splitlines()


def line(answer: Answer, key: str) -> str:
    return next(one for one in lines_of(answer) if one.startswith(f"{key} = "))


def test_the_example_is_a_valid_pipeline(tmp_path: Path) -> None:
    answer = init.create(tmp_path / "my bench")
    assert load(answer.pipeline).name == "my bench"
    with pytest.raises(InputError, match="exists already"):
        init.create(tmp_path / "my bench")


NAMES = {
    "t [ms]": ("time", "ms"),
    "time_s": ("time", "s"),
    "curr_time": ("time", "s"),
    "Zeit / s": ("time", "s"),
    "U_valve [V]": ("u", "V"),
    "Stellgröße [V]": ("u", "V"),
    "Ventil [%]": ("u", "V"),
    "P_supply [bar]": ("p_supply", "bar"),
    "p_s": ("p_supply", "bar"),
    "Y [N]": ("force", "N"),  # a letter of an axis is no position in newtons
    "Analog input 1 [mV]": ("", "mV"),
    "source [psi]": ("p_supply", "psi"),
    "Versorgungsdruck, bar": ("p_supply", "bar"),
    "P1 (kPa)": ("p1", "kPa"),
    "pA": ("p1", "bar"),
    "Tank.Value [bar]": ("p1", "bar"),
    "pTank_bar.Value": ("p1", "bar"),
    "valve V": ("u", "V"),
    "load cell [kg]": ("force", "kgf"),
    "rpm [1/min]": ("", "rpm"),  # of a motor, where x is no angle
    "rpm": ("", "rpm"),
    "psi": ("p1", "psi"),
    "Q1": ("flow", "kg/s"),
    "Force (lbs)": ("force", "lbf"),
    "Average Pressure Voltage (mV)": ("p1", "bar"),
    "Battery Level (%)": ("", "%"),
    "breath_id": ("", ""),
    "Flux (mT)": ("", ""),
    "SP": ("x_ref", "m"),
    "PV": ("x", "m"),
    "supply": ("p_supply", "bar"),
    "valve feedback [V]": ("u", "V"),
    "Pressure A": ("p1", "bar"),
    "Kammerdruck": ("p1", "bar"),
    "p_B [bar]": ("p2", "bar"),
    "Pos [mm]": ("x", "mm"),
    "Kolbenweg": ("x", "m"),
    "pos [deg]": ("x", "deg"),
    "x_soll [mm]": ("x_ref", "mm"),
    "cmd position": ("x_ref", "m"),
    "Druck Soll": ("p_ref", "bar"),
    "Acc [m/s2]": ("a", "m/s2"),
    "group/Force in N": ("force", "N"),
    "Temperatur [°C]": ("temperature", "°C"),
    "Error_kPa": ("", "kPa"),
    "Overshoot [mm]": ("", "mm"),
    "pressure sensor [V]": ("p1", "bar"),
    "P1 [mm]": ("", "mm"),
    "gain": ("", ""),
}


@pytest.mark.parametrize("name", NAMES)
def test_a_column_is_guessed_by_the_words_and_the_unit_of_its_name(name: str) -> None:
    clock = NAMES[name][0] == "time"
    columns = [] if clock else [Column("t", "t", "", T), Column("p1 x", "p1", "bar", 1 + T % 1)]
    extra = [] if NAMES[name][0] in ("p_supply", "p2") else columns[1:]
    values = T if clock else np.sin(T)
    found = Survey(
        RawFile(Path("a"), {}),
        True,
        [*columns[:1], *(columns[1:] if not extra else []), Column(name, name, "", values)],
        {},
    )
    one = guess_columns([found])[-1]
    assert (one.signal, one.unit) == NAMES[name]


def clocked(path: Path, top: str, header: str, stamps: list[str]) -> Path:
    rows = (f"{stamp},{p:.4f},{int(t) % 3}" for stamp, p, t in zip(stamps, 1.0 + np.sin(T) ** 2, T, strict=True))
    path.write_text(f"{top}{header}p_tank [bar],valve [V]\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return path


START = datetime(2026, 3, 11, 9, 15, 57)
LATE = [START + timedelta(seconds=float(t)) for t in T]
CLOCKS = {  # lines above, header and stamps of rows of 10 ms
    "digits of a time of day": ("", "Time,", [f"{one:%H%M%S.%f}" for one in LATE]),
    "a date and digits": ("", "Date,Time,", [f"{one:%Y%m%d},{one:%H%M%S.%f}" for one in LATE]),
    "a count of tens of milliseconds": (
        ",,V\n",
        "Time,Obtaining interval (10ms),",
        [f"{one:%H:%M:%S},{min(n, 1)}" for n, one in enumerate(LATE)],
    ),
    "a rate in several columns": ("SampleRate,100,100\n", "", []),
    "an increment in a column of its own": ("X,CH1,Start,Increment\n0,0,-3,1.0e-2\n", "", []),
}


@pytest.mark.parametrize("way", CLOCKS)
def test_what_makes_a_clock_is_found(tmp_path: Path, way: str) -> None:
    top, header, stamps = CLOCKS[way]
    path = clocked(tmp_path / "a.csv", top, header or "Nr,", stamps or [str(n) for n in range(T.size)])
    answer = init.create(tmp_path / "p", [path])
    filled = Path(answer.pipeline).read_text(encoding="utf-8").replace('"? bar"', '"7 bar"').replace('"? l"', '"1 l"')
    Path(answer.pipeline).write_text(filled, encoding="utf-8")
    (tmp_path / "out").mkdir()
    ingest.run(Context(Path(answer.pipeline), load(answer.pipeline), tmp_path / "out", tmp_path))
    time = pq.read_table(tmp_path / "out" / "signals.parquet").column("time").to_numpy()
    np.testing.assert_allclose(time - time[0], T, atol=1e-6)


UNITS_BESIDE = {"psia": "psia", "bar psia": "?"}


@pytest.mark.parametrize("units", UNITS_BESIDE)
def test_a_column_may_hold_the_unit_of_its_neighbour(tmp_path: Path, units: str) -> None:
    each = units.split()
    rows = (f"{t:.2f},{14.7 + 5 * t:.3f},{each[n * len(each) // T.size]}" for n, t in enumerate(T))
    (tmp_path / "a.csv").write_text("t [s],p_tank,unit\n" + "\n".join(rows) + "\n", encoding="utf-8")
    answer = init.create(tmp_path / "p", [tmp_path / "a.csv"])
    assert f'unit = "{UNITS_BESIDE[units]}"' in line(answer, "p1")


def test_stamps_before_each_value_are_named_by_pairs(tmp_path: Path) -> None:
    """As TwinCAT Scope writes them; a line of another width had ended in a fault."""
    head = "Name,Scope\nName,fValve,Name,fPressureTank\nUnit,V,Unit,bar\n\n"
    rows = (f"{1e3 * t:.0f},{int(t) % 3},{1e3 * t:.0f},{1 + np.sin(t) ** 2:.4f}" for t in T)
    (tmp_path / "a.csv").write_text(head + "\n".join(rows) + "\n", encoding="utf-8")
    answer = init.create(tmp_path / "p", [tmp_path / "a.csv"])
    assert 'column = 2, unit = "V"' in line(answer, "u")
    assert 'column = 4, unit = "bar"' in line(answer, "p1")


def test_a_pressure_that_stands_alone_is_that_of_chamber_1(tmp_path: Path) -> None:
    (found,) = [
        g
        for g in guess_columns([survey_file(RawFile(write(tmp_path / "a.csv", {"t": T, "tank": 2 + T}), {}))])
        if not g.signal
    ]
    assert found.column.name == "tank"  # nothing says that it is a pressure
    (found,) = guess_columns([survey_file(RawFile(write(tmp_path / "a.csv", {"t": T, "tank [psi]": 2 + T}), {}))])[1:]
    assert found.signal == "p1"


def guessed(**columns: np.ndarray) -> dict[str, str]:
    """Return what columns of a table are taken for, by what they are called; the unit stands behind a double line."""
    listed = [
        Column(*[name.replace("__", " [") + "]" * ("__" in name)] * 2, name.partition("__")[2], own)
        for name, own in columns.items()
    ]
    return {
        one.signal: str(one.column.key) for one in guess_columns([Survey(RawFile(Path("a"), {}), True, listed, {})])
    }


def test_a_valves_own_sensor_is_no_second_command() -> None:
    found = guessed(t__s=T, u_cmd__V=np.sign(np.sin(T)), u_spool__V=np.sin(T), p1__bar=3 + np.sin(T))
    assert found["u"] == "u_cmd [V]"
    assert "u2" not in found


def test_what_is_set_in_volts_is_a_command_whatever_its_letter() -> None:
    found = guessed(t__s=T, Y1__V=np.sign(np.sin(3 * T)), B1__bar=3 + np.sin(T), B2__bar=7 + 1e-3 * np.sin(9 * T))
    assert (found["u"], found["p1"], found["p_supply"]) == ("Y1 [V]", "B1 [bar]", "B2 [bar]")


def test_a_supply_of_a_few_hundred_pascals_is_doubted(tmp_path: Path) -> None:
    rows = {"t [s]": T, "u [V]": np.sign(np.sin(3 * T)), "p_tank [Pa]": 300 + 99 * np.sin(T), "p_supply [Pa]": 701 + T}
    assert "no supply has so little; thousands?" in line(
        init.create(tmp_path / "p", [write(tmp_path / "a.csv", rows)]), "p_supply"
    )


def test_a_difference_of_two_chambers_is_not_that_over_a_valve(tmp_path: Path) -> None:
    rows = {"t [s]": T, "dp [bar]": 3 * np.sin(T), "ps [bar]": 7 + 0.01 * np.sin(9 * T), "x [mm]": 50 + np.cos(T)}
    (survey,) = [survey_file(RawFile(write(tmp_path / "a.csv", rows), {}))]
    assert not [one for one in survey.columns if one.computed]
    rows["dp [bar]"] = 3 + 2.9 * np.sin(T)
    survey = survey_file(RawFile(write(tmp_path / "b.csv", rows), {}))
    assert [one.key for one in survey.columns if one.computed] == ["`ps [bar]` - `dp [bar]`"]


def test_a_supply_that_a_bench_holds_still_is_its_supply() -> None:
    found = guessed(P1__bar=np.full(60, 7.0), P2__bar=np.linspace(6.8, 1.0, 60), Q__SLPM=np.linspace(0.0, 180.0, 60))
    assert (found["p_supply"], found["p1"]) == ("P1 [bar]", "P2 [bar]")


def test_what_has_two_values_is_no_sensor() -> None:
    columns = [
        Column("t", "t", "", T),
        Column("F", "F", "N", np.where(T > 1, 5.0, 0.0)),
        Column("x", "x", "", np.sin(T)),
    ]
    assert [one.signal for one in guess_columns([Survey(RawFile(Path("a"), {}), True, columns, {})])] == [
        "time",
        "",
        "x",
    ]


def test_numbers_without_a_unit_are_read_as_what_a_rig_has_and_the_guess_is_told(tmp_path: Path) -> None:
    raw = write(tmp_path / "a.csv", {"t": 1000 * T, "pA": 3e5 + T, "x": 40 * np.sin(T), "F": np.sin(3 * T)})
    answer = init.create(tmp_path / "rig", [raw])
    assert 'unit = "ms"' in line(answer, "time")
    assert 'unit = "Pa", reference = "absolute"' in line(answer, "p1")
    assert 'unit = "mm"' in line(answer, "x")
    assert "no unit is stated: −40 to 40 is taken for mm" in line(answer, "x")


GAUGE = {
    "less than any gas has": (np.sin(T) + 1, "gauge", "gauge: it reads down to"),
    "it rests at ambient pressure and moves": (
        1.01 + 4 * (1 - np.exp(-np.maximum(T - 0.5, 0))),
        "absolute",
        "it rests at 1.01",
    ),
    "never at ambient pressure": (5 + np.sin(T), "gauge", "CHECK gauge: it never stays at ambient pressure"),
    "steady at one bar": (1 + 0.01 * np.sin(T), "gauge", "CHECK gauge"),
}


@pytest.mark.parametrize("way", GAUGE)
def test_gauge_or_absolute_is_told_with_the_evidence(tmp_path: Path, way: str) -> None:
    values, reference, why = GAUGE[way]
    answer = init.create(tmp_path / "rig", [write(tmp_path / "a.csv", {"t [s]": T, "p1 [bar]": values})])
    assert f'reference = "{reference}"' in line(answer, "p1")
    assert why in line(answer, "p1")


def test_a_force_in_proportion_with_a_pressure_tells_gauge(tmp_path: Path) -> None:
    for bar in (1, 3, 5):
        columns = stroke(pressure=bar)
        write(tmp_path / f"run_{bar}.csv", {**columns, "F [N]": 50 * columns["p1 [bar]"] + np.sign(np.cos(T))})
    answer = init.create(tmp_path / "rig", [tmp_path])
    assert "gauge: the force is none at" in line(answer, "p1")
    assert "scale = -1.0" in line(answer, "force")  # it holds against p1
    assert "scale = -1.0" in line(answer, "x")  # and is larger where the piston moves against it


def test_what_holds_for_a_minority_of_files_is_written_into_their_own_recordings(tmp_path: Path) -> None:
    renamed = {"weg [mm]" if name == "pos [mm]" else name: values for name, values in stroke().items()}
    write(tmp_path / "a.csv", renamed)
    for n in (1, 2):
        write(tmp_path / f"step_{n}.csv", stroke())
    answer = init.create(tmp_path / "rig", [tmp_path])
    assert line(answer, "x").startswith('x = { column = "pos [mm]"')
    own = lines_of(answer)[lines_of(answer).index("[recordings.signals]") + 1]
    assert own.startswith('x = { column = "weg [mm]"')
    assert sum("[recordings.signals]" in one for one in lines_of(answer)) == 1


def test_files_without_a_column_that_their_experiment_uses_say_what_they_have(tmp_path: Path) -> None:
    """Or the column of the others would be refused as absent."""
    write(tmp_path / "a.csv", {name: values for name, values in stroke().items() if name != "F [N]"})
    write(tmp_path / "b.csv", stroke())
    answer = init.create(tmp_path / "rig", [tmp_path])
    assert line(answer, "take").startswith('take = ["time", "p1", "x"]')
    assert sum(one.startswith("take") for one in lines_of(answer)) == 1


def test_files_of_one_kind_are_one_entry_and_one_of_them_is_held_out(tmp_path: Path) -> None:
    for n in (1, 2, 9, 10):
        write(tmp_path / f"step_{n}.csv", stroke(size=0.0 if n in (2, 9) else 30.0))
    write(tmp_path / "other.csv", stroke())
    answer = init.create(tmp_path / "rig", [tmp_path / "step_*.csv", tmp_path / "other.csv"])
    first, second = answer.recordings
    assert (first.files, first.held_out) == (4, ["step_10.csv"])  # 2 and 9 stand still
    assert (second.files, second.held_out) == (1, [])
    text = "\n".join(lines_of(answer)).replace('"? cm^2"', '"5 cm^2"')
    Path(answer.pipeline).write_text(text, encoding="utf-8")
    config = load(answer.pipeline)
    out = tmp_path / "out"
    rows = ingest.run(Context(Path(answer.pipeline), config, out, tmp_path))["recordings"]
    assert {row["name"]: row["use"] for row in rows} == {
        **dict.fromkeys(("step_1", "step_2", "step_9", "other"), "train"), "step_10": "test"
    }  # fmt: skip


def test_a_file_to_hold_out_that_is_not_there_is_refused(tmp_path: Path) -> None:
    from pneucli.config import recording_sources

    write(tmp_path / "a_1.csv", stroke())
    (tmp_path / "p.toml").write_text(
        '[pipeline]\nname = "p"\n[signals]\ntime = { column = "t [s]" }\n[[recordings]]\nfile = "a_*.csv"\n'
        'experiment = "friction"\nuse = "train"\ntest = "a_2.csv"\n'
    )
    with pytest.raises(InputError, match=r'key test: no file "a_2.csv"(.|\n)*did you mean "a_1.csv"'):
        recording_sources(load(tmp_path / "p.toml"))


def test_what_the_recordings_need_of_the_rig_is_a_line_to_fill_in(tmp_path: Path) -> None:
    columns = {**stroke(), "u [V]": 5 + np.sin(T)}
    answer = init.create(tmp_path / "rig", [write(tmp_path / "a.csv", columns)])
    keys = [one.key for one in answer.fill_in]
    cylinder = ["piston_area_1", "piston_area_2", "stroke", "dead_volume_2"]  # no p2 is recorded
    assert keys == ["rig.supply_pressure", *(f"rig.cylinder.{key}" for key in cylinder)]
    for one in answer.fill_in:
        assert one.key.endswith(lines_of(answer)[one.line - 1].split(" =")[0])
    said = " ".join("\n".join(answer.lines("rig/pipeline.toml", verbose=False)).split())
    assert "fill in these 5: rig.supply_pressure (line 9)" in said
    assert said.endswith("then pneucli run rig/pipeline.toml")
    with pytest.raises(InputError, match=r'"\? bar" is to be filled in \[E023\]\n  wanted: a quantity such as'):
        load(answer.pipeline)


def test_a_null_in_the_middle_and_who_drives_chamber_2_are_seen(tmp_path: Path) -> None:
    x = 100 + 50 * np.sin(T)
    columns = {"t [s]": T, "u [V]": 5 + np.sin(T), "p1 [bar]": 3 + np.cos(T), "x [mm]": x, "p_S [bar]": 7 + 0 * T}
    closed = init.create(tmp_path / "a", [write(tmp_path / "a.csv", {**columns, "p2 [bar]": 400 / (250 - x)})])
    assert 'chamber_2 = "closed"' in line(closed, "chamber_2")
    assert line(closed, "null").startswith('null = "identify"')
    driven = init.create(tmp_path / "b", [write(tmp_path / "b.csv", {**columns, "p2 [bar]": 3 - np.cos(T)})])
    assert 'chamber_2 = "valve"' in line(driven, "chamber_2")
    assert 'arrangement = "5/3"' in line(driven, "arrangement")


def test_a_rotary_axis_asks_for_what_turns(tmp_path: Path) -> None:
    columns = {"t [s]": T, "angle [deg]": 30 * np.sin(T), "p1 [bar]": 3 + np.cos(T)}
    answer = init.create(tmp_path / "rig", [write(tmp_path / "a.csv", columns)])
    assert '"? cm^3/rad"' in line(answer, "piston_area_1")
    assert any(one.startswith('# moment_of_inertia = "? kg m^2"') for one in lines_of(answer))


def test_without_a_clock_the_rate_is_asked_for_or_found(tmp_path: Path) -> None:
    from scipy.io import savemat

    columns = {"p1": 3 + np.sin(T), "x": np.sin(T)}
    savemat(tmp_path / "a.mat", columns)
    savemat(tmp_path / "b.mat", {**columns, "fs": 500.0})
    asked = init.create(tmp_path / "a", [tmp_path / "a.mat"])
    assert "signals.time" in [one.key for one in asked.fill_in]
    found = init.create(tmp_path / "b", [tmp_path / "b.mat"])
    assert line(found, "time").startswith('time = { expression = "row / 500" }')


def test_init_ends_with_a_file_to_edit_where_no_column_is_recognised(tmp_path: Path) -> None:
    answer = init.create(tmp_path / "rig", [write(tmp_path / "a.csv", {"when": T, "gain": T % 1})])
    text = "\n".join(lines_of(answer))
    assert 'p1 = { column = "?"' in text
    assert '# not taken: column "gain"' in text
    assert "signals.p1" in [one.key for one in answer.fill_in]


def test_one_bad_file_stops_no_others_and_is_listed(tmp_path: Path) -> None:
    good = write(tmp_path / "a.csv", {"t [s]": T, "u [V]": T % 3, "p1 [bar]": 1.013 + T})
    bad = tmp_path / "b.csv"
    bad.write_text("nothing\nto\nread\n", encoding="utf-8")
    answer = init.create(tmp_path / "rig", [good, bad])
    assert [one.files for one in answer.recordings] == [1]
    assert answer.left_out[0].startswith("b.csv: ")
    assert "# left out: b.csv" in "\n".join(lines_of(answer))


def test_answers_become_areas_and_lengths(tmp_path: Path) -> None:
    raw = write(tmp_path / "a.csv", {"t [s]": T, "u [V]": T % 3, "p1 [bar]": 1.013 + T, "x [mm]": 50 * np.sin(T)})
    answer = init.create(tmp_path / "rig", [raw])
    asked = [name for name, _, _ in init.questions(answer.fill_in)]
    assert asked == ["rig.supply_pressure", "bore", "rod", "rig.cylinder.stroke"]
    path = Path(answer.pipeline)
    left = init.fill_in(path, {"rig.supply_pressure": "7 bar", "bore": "32 mm", "rod": "12 mm"})
    cylinder = tomllib.loads(path.read_text(encoding="utf-8"))["rig"]["cylinder"]
    assert parse_quantity(cylinder["piston_area_1"], "m^2") == pytest.approx(np.pi / 4 * 0.032**2, rel=1e-5)
    assert parse_quantity(cylinder["piston_area_2"], "m^2") == pytest.approx(
        np.pi / 4 * (0.032**2 - 0.012**2), rel=1e-5
    )
    assert "rig.cylinder.stroke" in [one.key for one in left]


@pytest.mark.parametrize(
    "answers", [{"bore": "32"}, {"bore": "12 mm", "rod": "32 mm"}, {"rig.supply_pressure": "7 mm"}]
)
def test_an_answer_that_is_none_is_refused(answers: dict[str, str], tmp_path: Path) -> None:
    raw = write(tmp_path / "a.csv", {"t [s]": T, "u [V]": T % 3, "p1 [bar]": 1.013 + T, "x [mm]": 50 * np.sin(T)})
    path = Path(init.create(tmp_path / "rig", [raw]).pipeline)
    before = path.read_text(encoding="utf-8")
    with pytest.raises(InputError):
        init.fill_in(path, answers)
    assert path.read_text(encoding="utf-8") == before


def test_how_a_text_is_written_may_be_said(tmp_path: Path) -> None:
    raw = tmp_path / "a.txt"
    raw.write_text("".join(f"{n}|{n % 7},5|{n % 3}\n" for n in range(50)), encoding="utf-8")
    answer = init.create(tmp_path / "rig", [raw], header=False, delimiter="|", decimal=",", skip_rows=3)
    text = "\n".join(lines_of(answer))
    for key in ('delimiter = "|"', 'decimal = ","', "skip_rows = 3", "header = false"):
        assert f"\n{key}\n" in text


def test_globs_that_the_shell_left_alone_and_folders_are_filled_in(tmp_path: Path) -> None:
    for n in (2, 10):
        write(tmp_path / f"a_{n}.csv", stroke())
    by_glob = init.create(tmp_path / "one", [tmp_path / "a_*.csv"])
    by_folder = init.create(tmp_path / "two", [tmp_path.joinpath(".")])
    assert by_glob.recordings[0].files == by_folder.recordings[0].files == 2
    with pytest.raises(InputError, match="no such file"):
        init.create(tmp_path / "three", [tmp_path / "b_*.csv"])


@pytest.mark.parametrize("same", [True, False])
def test_files_of_one_signal_each_are_one_recording(tmp_path: Path, same: bool) -> None:
    """As figures are digitised; where all columns are called alike, the files' names say what they are."""
    rng = np.random.default_rng(4)
    curves = {"pos": 100 + 30 * np.sin(T), "p1": 2 + np.sin(T), "force": np.cos(T)}
    for name, values in curves.items():
        some = np.sort(rng.choice(T.size, 200, replace=False))
        write(tmp_path / f"{name}.csv", {"t [s]": T[some], "value" if same else name: values[some]})
    (tmp_path / "notes.md").write_text("no numbers\n", encoding="utf-8")
    answer = init.create(tmp_path / "rig", [tmp_path])
    assert answer.left_out == ["notes.md: no table of numbers, but 'no numbers'"]
    path = Path(answer.pipeline)
    path.write_text(path.read_text(encoding="utf-8").replace('"? cm^2"', '"5 cm^2"'), encoding="utf-8")
    out = tmp_path / "out"
    (row,) = ingest.run(Context(path, load(path), out, tmp_path))["recordings"]
    assert row["rows_read"] == 600
    assert set(row["signals"]) == {"time", "x", "p1", "force"}
