"""How recorders lay out their files: headers, stamps, runs, cells, roles: each is right, marked or refused in words."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.door import WAYS, WRONG, plain, verdict
from pneucli.errors import InputError
from pneucli.init.clock_columns import computed_clocks, paired_clocks, repeated_clocks
from pneucli.init.column_names import read_names, signal_scores
from pneucli.init.role_evidence import looks_set, supply_like
from pneucli.init.survey import long_table, runs_below_one_another, runs_beside_one_another, with_validity
from pneucli.init.survey_types import Column
from pneucli.init.units import pressure_reference
from pneucli.io.formats import is_text, open_raw
from pneucli.io.raw_file import Channel, ColumnRequest, RawFile
from pneucli.io.signal_reader import open_signals
from pneucli.io.text_layout import detect_encoding
from pneucli.stages import init

RNG = np.random.default_rng(68)
REFUSED = {"scaled": "refused", "scores": "refused", "unknown unit": "asked"}
REFUSED |= dict.fromkeys(("mA", "bar of volts", "counts", "hexadecimal", "bare hexadecimal"), "asked")  # their scale
REFUSED |= dict.fromkeys(("percent", "least and most"), "marked")
MARKED = {
    "mbar",
    "no unit",
    "kPa",
    "long with status",
    "json long",
    "unit that changes",
    "stamps by channel",
}  # gauge or absolute


@pytest.mark.parametrize("way", sorted(WAYS))
def test_each_way_of_writing_is_right_marked_or_refused_as_it_should_be(way: str, tmp_path: Path) -> None:
    sheet = plain(np.random.default_rng([68, sorted(WAYS).index(way)]))
    WAYS[way](sheet)
    found, why = verdict(sheet, tmp_path)
    assert found != WRONG, why
    allowed = {REFUSED.get(way, "right")} | ({"marked"} if way in MARKED else set())
    assert found in allowed, why


def written(folder: Path, text: str, name: str = "a.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def read(path: Path, column: int = 1) -> tuple[np.ndarray, Any]:
    reader = open_raw(RawFile(path, {}))
    return np.concatenate([own[0] for own in reader.batches([ColumnRequest(column)])]), reader


def guessed(path: Path) -> dict[str, str]:
    answer = init.create(path.parent / "rig", [path])
    return {one.signal: one.column for one in answer.columns if one.signal}


# ---- cells


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    st.sampled_from(["-", " -", "- ", "BURNOUT", "∞", "n/a", "Trigger", ""]),
    st.sampled_from([",", ";", "\t", ", "]),
    st.integers(0, 39),
)
def test_words_and_marks_among_numbers_are_missing_and_words_are_counted(
    tmp_path: Path, word: str, mark: str, at: int
) -> None:
    rows = [mark.join([f"{n / 100}", word if n == at else f"{n / 7:.4f}"]) for n in range(40)]
    values, reader = read(written(tmp_path, f"t{mark}p\n" + "\n".join(rows) + "\n"))
    assert np.flatnonzero(np.isnan(values)).tolist() == [at]
    np.testing.assert_allclose(np.delete(values, at), np.delete(np.round(np.arange(40) / 7, 4), at))
    counted = [one.message for one in reader.repairs if one.kind == "words"]
    assert counted == ([f'"p": "{word}" 1 times: no numbers; missing'] if word in ("BURNOUT", "∞", "Trigger") else [])


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.sampled_from(["bar", "mbar", "V", "°C", "mm/s", "l/min"]), st.sampled_from(["", " "]), st.sampled_from(",;"))
def test_a_unit_behind_each_number_is_the_unit_of_its_column(tmp_path: Path, unit: str, gap: str, mark: str) -> None:
    decimal = "," if mark == ";" else "."
    cells = [f"{n / 10:.1f}".replace(".", decimal) + gap + unit for n in range(40)]
    values, reader = read(written(tmp_path, f"t{mark}p\n" + "".join(f"{n}{mark}{c}\n" for n, c in enumerate(cells))))
    np.testing.assert_allclose(values, np.arange(40) / 10)
    assert reader.units[1] == unit


def test_cells_whose_unit_changes_are_read_in_the_first_and_other_kinds_are_refused(tmp_path: Path) -> None:
    rows = "".join(f"{n},{'999 mbar' if n % 2 else '1.5 bar'}\n" for n in range(40))
    values, reader = read(written(tmp_path, f"t,p\n{rows}"))
    np.testing.assert_allclose(values, np.where(np.arange(40) % 2, 0.999, 1.5))
    assert reader.units[1] == "bar"
    with pytest.raises(InputError, match=r'line 42, column "p"'):
        read(written(tmp_path, f"t,p\n{rows}40,7 mm\n"))


def test_a_number_that_is_none_is_still_refused_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'line 22, column "p": "1\.2\.3"'):
        read(written(tmp_path, "t,p\n" + "0,1.5\n" * 20 + "1,1.2.3\n" + "2,1.5\n" * 20))


# ---- clocks


@given(
    st.sampled_from([10.0, 100.0, 1e3, 1e6, 1e9]),
    st.integers(20, 400),
    st.floats(0.0, 0.9),
    st.sampled_from(["Millitm", "part", "ms"]),
)
def test_a_fraction_of_a_second_is_found_by_its_numbers(per: float, rate: int, start: float, name: str) -> None:
    """Whatever it is called; where it is too coarse for the rate it is no fraction that tells the rows apart."""
    time = start + np.arange(6 * rate) / rate
    fraction = np.floor((time % 1.0) * per + 1e-7)
    found = computed_clocks([Column("Time", "Time", "s", np.floor(time + 1e-9)), Column(name, name, "", fraction)])
    if per < 2 * rate:
        return
    assert [one.key for one in found] == [f"`Time` + {1 / per:g} * `{name}`"]
    np.testing.assert_allclose(found[0].values, time, atol=1.01 / per)


@given(st.integers(0, 2**32 - 1))
def test_readings_beside_whole_seconds_are_no_fraction_of_them(seed: int) -> None:
    rng = np.random.default_rng(seed)
    time = np.arange(600) / 100
    readings = [rng.integers(0, 1000, 600).astype(float), np.cumsum(rng.standard_normal(600)), np.arange(600.0)]
    columns = [Column(f"c{n}", f"c{n}", "", own) for n, own in enumerate(readings)]
    assert computed_clocks([Column("Time", "Time", "s", np.floor(time)), *columns]) == []


def test_clocks_of_one_time_are_no_signals_and_clocks_of_their_own_are_paired_by_name_or_order() -> None:
    t, late = np.arange(500) * 0.01, np.arange(500) * 0.0101 + 0.3 * np.sin(np.arange(500) / 90)
    same = [Column("TimeStamp a.u", "TimeStamp a.u", "", 1e4 * t), Column("a.u", "a.u", "", np.sin(t))]
    same += [Column("TimeStamp a.p", "TimeStamp a.p", "", 1e4 * t), Column("a.p", "a.p", "", np.cos(t))]
    assert repeated_clocks(same) == {2}
    assert [one.clock for one in paired_clocks(same)] == [None] * 4
    behind = [Column("p [bar]", "p [bar]", "bar", np.cos(t)), Column("p time", "p time", "", late)]
    behind = [Column("u [V]", "u [V]", "V", np.sin(t)), Column("u time", "u time", "", t), *behind]
    assert [one.clock for one in paired_clocks(behind)] == ["u time", None, "p time", None]


# ---- tables


LABELS = ("Rig.U", "Rig.P1", "Rig.PSupply")


def long_columns(status: list[str]) -> tuple[list[Column], dict[str, np.ndarray]]:
    stamps = np.repeat(np.arange(100) * 0.01, 3)
    labels = {"NodeId": np.array(list(LABELS) * 100, dtype=object), "Status": np.array(status * 100, dtype=object)}
    values = RNG.standard_normal(300)
    columns = [Column("Source", "SourceTimestamp", "s", stamps), Column("Server", "ServerTimestamp", "s", stamps + 0.1)]
    return [
        *columns,
        Column("Value", "Value", "", values),
        Column("Quality", "Quality", "", np.full(300, 192.0)),
    ], labels


@pytest.mark.parametrize("status", [["Good"] * 3, ["Good", "Good", "Bad"]])
def test_channels_of_a_long_table_are_found_beside_further_columns(status: list[str]) -> None:
    columns, labels = long_columns(status)
    found = long_table(columns, labels)
    assert [one.where for one in found] == [None, *(("NodeId", label) for label in LABELS)]
    assert found[0].key == "Source"
    np.testing.assert_array_equal(found[2].values, columns[2].values[1::3])


def test_a_wide_table_with_a_status_is_no_long_table() -> None:
    t = np.arange(300) * 0.01
    status = {"state": np.array(["run", "rest"] * 150, dtype=object)}
    assert long_table([Column("t", "time", "s", t), Column("p1", "p1", "bar", np.sin(t))], status) == []


def test_runs_are_told_by_a_number_or_by_names_and_not_by_other_columns() -> None:
    t, both = np.arange(200) * 0.01, np.tile(np.arange(100) * 0.01, 2)
    number = Column("run", "run", "", np.repeat([1.0, 2.0], 100))

    def text(column: Column) -> np.ndarray:
        return np.array([f"{value:.0f}" for value in column.values], dtype=object)

    found = runs_below_one_another([number, Column("t", "t", "s", both), Column("p", "p", "", np.sin(t))], {}, text)
    assert [run for run, _ in found] == ["1", "2"]
    assert [one.where for one in found[1][1]] == [None, ("run", "2")]
    cycles = Column("cycle", "cycle", "", np.repeat([1.0, 2.0], 100))  # of one recording that goes on
    assert runs_below_one_another([cycles, Column("t", "t", "s", t), Column("p", "p", "", np.sin(t))], {}, text) == []
    state = Column("valve open", "valve open", "", np.repeat([0.0, 1.0], 100))
    assert runs_below_one_another([state, Column("t", "t", "s", t), Column("p", "p", "", np.sin(t))], {}, text) == []


@pytest.mark.parametrize(
    ("names", "runs"),
    [
        ("t,u,p1 run1 [bar],p1 run2 [bar]", ["t,u,p1 run1 [bar]", "t,u,p1 run2 [bar]"]),
        ("Run 1/Time,Run 1/P1,Run 2/Time,Run 2/P1", ["Run 1/Time,Run 1/P1", "Run 2/Time,Run 2/P1"]),
        ("runs/1/t,runs/1/p1,runs/2/t,runs/2/p1", ["runs/1/t,runs/1/p1", "runs/2/t,runs/2/p1"]),
        ("data/1/t,data/1/u,data/1/p1,data/2/t,data/2/u,data/2/p1", ["data/1/t,data/1/u,data/1/p1"] * 2),
        ("t,p1,p2,run 1", []),
        ("Messung 1/Zeit,Messung 1/P1,Messung 2/Zeit,Messung 2/Weg", []),  # two devices
        ("signals/1/time,signals/1/values,signals/2/time,signals/2/values", []),  # a channel each
    ],
)
def test_runs_that_stand_beside_one_another_are_told_by_their_names(names: str, runs: list[str]) -> None:
    columns = [Column(name, name, "", np.arange(9.0)) for name in names.split(",")]
    found = [",".join(str(one.key) for one in own) for _, own in runs_beside_one_another(columns)]
    assert found == [runs[0], runs[1].replace("data/1", "data/2")] if runs else not found


# ---- roles


@pytest.mark.parametrize(
    ("name", "signal"),
    [
        ("chamber_bar_g", "p1"),
        ("v_mm_s", "v"),
        ("flow_l_min", "flow"),
        ("p1 run2 [bar]", "p1"),
        ("Plc.GVL.pSupply", "p_supply"),
        ("ns=2;s=Rig.P1", "p1"),
        ("tryck 2 [bar]", "p2"),
        ("ciśnienie zasilania [bar]", "p_supply"),
        ("压力1 [bar]", "p1"),
        ("давление питания", "p_supply"),
        ("Läge [mm]", "x"),
        ("u ValueY", "u"),
        ("dp [bar]", ""),
        ("dP [bar]", ""),
        ("Supply PSIA", "p_supply"),
        ("pressure_pa[2]", "p2"),
        ("delta_p [bar]", ""),
        ("p_s", "p_supply"),
        ("Flow l/min", "flow"),
        ("Q / l/min", "flow"),
        ("Q [l/min]", "flow"),
        ("v in mm/s", "v"),
        ("Q l/min ANR", "flow"),
        ("Piston speed mm/s", "v"),
        ("Pressure A", "p1"),
        ("Pressure B bar", "p2"),
        ("PLC_PRG.rPchamber", "p1"),
        ("Psup [bar]", "p_supply"),
        ("Setpoint value spool [V]", "u"),
        ("szelepfeszültség [V]", "u"),
        ("밸브 전압(V)", "u"),
        ("Valve 0-10V", "u"),
        ("Pressure (0-10 bar abs)", "p1"),
        ("Steuerspannung in V", "u"),
        ("ロッド側圧力[MPa]", "p2"),
        ("pos_10um", "x"),
        ("pressures/data/1", "p1"),
        ("joint_states/position/piston", "x"),
        ("u/y", "u"),
        ("p1/y_values/values", "p1"),
        ("tool/y", "x"),
    ],
)
def test_a_name_says_its_role(name: str, signal: str) -> None:
    ((_, (column, *_)), *_) = runs_beside_one_another(
        [Column(one, one, "", np.zeros(2)) for one in (name, name.replace("run2", "run1"))]
    ) or [("", [Column(name, name, "", np.zeros(2))])]
    scores = dict(signal_scores(read_names([column], True)[0]))
    assert max(scores, key=lambda one: scores[one], default="") == signal


@given(st.integers(0, 2**32 - 1))
def test_a_supply_stands_at_the_top_and_a_command_shows_no_noise(seed: int) -> None:
    rng = np.random.default_rng(seed)
    top = 7 + 0.004 * rng.standard_normal(400)
    below = 1 + rng.uniform(0.5, 5.5) * np.abs(np.sin(np.arange(400) / 40)) + 0.004 * rng.standard_normal(400)
    assert supply_like({0: below, 1: top}) == [1]
    assert supply_like({0: below, 1: below[::-1]}) == []
    assert looks_set(np.repeat(rng.integers(-5, 6, 20).astype(float), 20)) or seed % 10 == 0
    assert not looks_set(below)


def test_a_difference_of_pressures_is_no_pressure_but_tells_the_one_behind_the_valve(tmp_path: Path) -> None:
    rows = "".join(f"7.0,{6 - n / 10:.1f},{100 + n}\n" for n in range(40))
    found = guessed(written(tmp_path, f"p_upstream [bar(a)],dp [bar],flow [l/min ANR]\n{rows}"))
    text = (tmp_path / "rig" / "pipeline.toml").read_text(encoding="utf-8")
    assert found["p1"] == "p1 behind the valve"
    assert 'p1 = { expression = "`p_upstream [bar(a)]` - `dp [bar]`", unit = "bar(a)"' in text


def test_what_only_the_order_of_columns_decides_is_marked(tmp_path: Path) -> None:
    rows = "".join(f"{n / 100},{n % 9},{1 + n % 7},{2 + n % 5}\n" for n in range(200))
    answer = init.create(
        tmp_path / "rig", [written(tmp_path, f"t [s],u [V],p left upper [bar],p left lower [bar]\n{rows}")]
    )
    marks = {one.signal: one.why for one in answer.columns}
    assert 'CHECK "p left lower [bar]" may be p1 as well' in marks["p1"]


@pytest.mark.parametrize(("unit", "scale"), [("zorps", 1.0), ("", 1e8)])
def test_a_unit_that_cannot_be_is_asked_for(tmp_path: Path, unit: str, scale: float) -> None:
    rows = "".join(f"{n / 100},{n % 9},{scale * (3 + np.sin(n / 9)):.4f}\n" for n in range(200))
    answer = init.create(tmp_path / "rig", [written(tmp_path, f"t [s],u [V],p1{f' [{unit}]' if unit else ''}\n{rows}")])
    text = (tmp_path / "rig" / "pipeline.toml").read_text(encoding="utf-8")
    asked = [one.key for one in answer.fill_in]
    assert ("signals.p1" in asked) == (unit == "zorps" or 'unit = "?"' in text)
    assert 'unit = "?"' in text


@pytest.mark.parametrize(
    ("unit", "said"),
    [
        ("nl/min", "taken at 0 °C and 1.01325 bar (DIN 1343)"),
        ("l/min] (ANR", "taken at 20 °C, 1 bar and 65 % humidity"),
        ("l/min", "CHECK no reference state is stated: taken at 20 °C, 1 bar"),
        ("SLPM", "CHECK taken at 0 °C and 1.01325 bar (SEMI E12); others mean"),
    ],
)
def test_the_reference_state_of_a_flow_is_said(tmp_path: Path, unit: str, said: str) -> None:
    rows = "".join(f"7.0,{1 + n / 10:.1f},{100 + n}\n" for n in range(40))
    path = written(
        tmp_path, f"p_upstream [bar(a)],p_downstream [bar(a)],flow [{unit}{']' * ('(' not in unit) or ')'}\n{rows}"
    )
    answer = init.create(tmp_path / "rig", [path])
    assert said in next(one.why for one in answer.columns if one.signal == "flow")


@pytest.mark.parametrize(
    ("line", "unit", "scale", "said"),
    [
        (
            "# STP 25 C 14.696 PSIA",
            "SLPM",
            0.9157,
            "scaled to 25 °C and 14.696 psi, as the file says",
        ),  # 273.15 / 298.15
        (
            "Normbedingungen: 20 °C; 1000 mbar",
            "m^3/h",
            1.0029,
            "scaled to 20 °C and 1000 mbar, as the file says",
        ),  # dry, not ANR
        ("Reference: 273,15 K, 1,01325 bar", "l/min", 1.0906, "scaled to 273.15 K and 1.01325 bar, as the file says"),
        ("Standard test, supply 6 bar, 20 C", "l/min", 1.0, "CHECK no reference state is stated"),
        ("STP 25 C 14.696 PSIA", "kg/h", 1.0, ""),
    ],
)
def test_a_reference_state_above_the_table_counts(
    tmp_path: Path, line: str, unit: str, scale: float, said: str
) -> None:
    rows = "".join(f"7.0,{1 + n / 10:.1f},{100 + n}\n" for n in range(40))
    path = written(tmp_path, f"{line}\np_upstream [bar(a)],p_downstream [bar(a)],flow [{unit}]\n{rows}")
    answer = init.create(tmp_path / "rig", [path])
    flow = tomllib.loads((tmp_path / "rig" / "pipeline.toml").read_text(encoding="utf-8"))["signals"]["flow"]
    assert flow.get("scale", 1.0) == pytest.approx(scale, abs=1e-4)
    why = next(one.why for one in answer.columns if one.signal == "flow")
    assert said in why if said else not why


# ---- what no experiment can use


def test_a_friction_map_is_refused_with_what_to_export(tmp_path: Path) -> None:
    rows = "".join(f"{(n - 20) / 100},{20 * np.sign(n - 20.5) + n}\n" for n in range(40))
    with pytest.raises(InputError, match="a friction map") as caught:
        init.create(tmp_path / "rig", [written(tmp_path, f"velocity [m/s],friction force [N]\n{rows}")])
    assert "export the runs" in caught.value.mend


def test_numbers_that_fill_0_to_1_in_a_unit_or_rest_at_an_end_are_no_scaled_ones(tmp_path: Path) -> None:
    p = np.clip(np.sin(np.arange(400) / 40), 0.0, 1.0)
    p[0], p[60] = 0.0, 1.0
    for number, header in enumerate(("t [s],u [V],p1 [bar]", "t,u,p1")):
        rows = "".join(f"{n / 100},{n // 50 % 3},{value:.6f}\n" for n, value in enumerate(p))
        init.create(tmp_path / f"rig{number}", [written(tmp_path, f"{header}\n{rows}", f"{number}.csv")])


def test_what_cannot_be_identified_without_a_pressure_is_said(tmp_path: Path) -> None:
    """Command and position alone are an axis, whose volumes are asked for."""
    rows = "".join(f"{n / 100},{n // 50 % 3},{100 + 50 * np.sin(n / 30):.3f}\n" for n in range(400))
    answer = init.create(tmp_path / "rig", [written(tmp_path, f"t [s],u [V],x [mm]\n{rows}")])
    assert answer.cannot == [
        "a.csv: u, x and no pressure: friction and one gain of the valve show in ratio to supply pressure x piston "
        "area, neither a map of the valve nor a leak; record p1 for those"
    ]
    text = (tmp_path / "rig" / "pipeline.toml").read_text()
    assert 'experiment = "axis"' in text
    assert 'dead_volume_1 = "? cm^3"' in text
    assert "force =" not in text


@pytest.mark.parametrize("lowest", [0.6e5, 1.01e5, 1.9e5])
def test_a_vessel_that_is_vented_in_between_tells_absolute(lowest: float) -> None:
    swing = np.clip(np.sin(np.arange(2000) / 60), -0.6, 1.0)
    pascals = lowest + 3e5 * (swing + 0.6) + 300 * RNG.standard_normal(2000)
    reference, why, *_ = pressure_reference([pascals * 1e-5], "bar", "")
    assert (reference, "where it is lowest" in why) == (("absolute", True) if lowest == 1.01e5 else ("gauge", False))


@pytest.mark.parametrize("states", ["FALSE,TRUE", "off,on"])
def test_a_switched_command_in_words_is_read(tmp_path: Path, states: str) -> None:
    words = states.split(",")
    rows = "".join(f"{n / 100},{words[n // 50 % 2]},{3 + np.sin(n / 30):.4f}\n" for n in range(400))
    path = written(tmp_path, f"t [s],bValveOpen,p1 [bar]\n{rows}")
    assert guessed(path)["u"] == "bValveOpen"
    np.testing.assert_array_equal(read(path)[0], np.arange(400) // 50 % 2)


@pytest.mark.parametrize(
    ("name", "good", "bad", "read"),
    [
        ("p1_valid", "1", "0", True),
        ("p1 status", "GOOD", "BAD", True),
        ("p1.quality", "192", "64", True),
        ("P1 is OK", "true", "false", True),
        ("p1 status", "1", "0", False),  # which of them is good, nothing says
        ("p1 status", "1591", "51", False),  # the status word of a drive
        ("p1 status", "RUN", "STOP", False),
        ("pump status", "GOOD", "BAD", False),
        ("p1_valid", "1", "1", False),
    ],
)
def test_rows_that_a_column_of_its_own_calls_bad_are_missing(
    name: str, good: str, bad: str, read: bool, tmp_path: Path
) -> None:
    value = lambda n: 4.0 + 0.5 * np.sin(0.01 * n) + 0.001 * (n % 3)  # noqa: E731
    held = lambda n: value(500 if 500 <= n < 520 else n)  # noqa: E731
    rows = [f"{n / 1000:.3f},{(n // 300) % 2},{held(n):.4f},{bad if 500 <= n < 520 else good}" for n in range(2000)]
    path = written(tmp_path, "\n".join([f"t [s],u [V],p1 [bar abs],{name}", *rows]) + "\n")
    init.create(tmp_path / "rig", [path])
    text = (tmp_path / "rig" / "pipeline.toml").read_text(encoding="utf-8")
    where = f'where = {{ column = "{name}", equals = "{good}" }}'
    assert (where in text) == read
    assert ("where" in text) == read
    if read:
        channel = {"where": (name, good)}
        channels = {"time": Channel("t [s]"), "u": Channel("u [V]"), "p1": Channel("p1 [bar abs]", **channel)}
        reader = open_signals(RawFile(path, channels))
        p1 = np.concatenate([batch["p1"] for batch in reader.batches()])
        assert np.flatnonzero(np.isnan(p1)).tolist() == list(range(500, 520))
        assert not reader.repairs


def test_a_column_that_calls_rows_bad_belongs_to_the_only_one_of_its_name() -> None:
    bad = np.array(["GOOD"] * 90 + ["BAD"] * 10, dtype=object)
    columns = [Column(name, name, "", np.arange(100.0)) for name in ("供气压力", "控制电压", "p [bar]", "p (raw)")]
    found, used = with_validity(columns, {"供气压力 status": bad, "p status": bad}, lambda _: bad)
    assert [one.where for one in found] == [("供气压力 status", "GOOD"), None, None, None]
    assert used == {"供气压力 status"}


def test_a_small_table_above_is_none_of_the_rows_and_a_first_row_of_status_stays(tmp_path: Path) -> None:
    rows = [f"{n / 100:.2f},{n // 50 % 3},{3 + np.sin(n / 30):.4f}" for n in range(400)]
    above = "Point,Reference,Reading\n1,0,0.1\n2,5,5.1\n3,9,9.1\n"
    text = "\n".join(["t [s],u [V],p1 [bar]", *rows]) + "\n"
    assert guessed(written(tmp_path, f"{above}\n{text}"))["p1"] == "p1 [bar]"
    status = "\n".join(["t [s],u [V],p1 [bar]", *rows[:4], "0.04,STATUS,ok", *rows[4:]]) + "\n"
    init.create(tmp_path / "status", [written(tmp_path, status, "b.csv")])
    assert "# 100 Hz, up to 3.99 s" in (tmp_path / "status" / "pipeline.toml").read_text(encoding="utf-8")
    values, _ = read(tmp_path / "b.csv", 0)
    assert values[0] == 0.0


def test_a_comma_that_cuts_columns_and_numbers_is_refused_in_one_line(tmp_path: Path) -> None:
    rows = "".join(f"{n // 100},{n % 100:02d},{n // 50 % 3},0,3,{500 + n}\n" for n in range(200))
    with pytest.raises(InputError, match="the comma cuts columns and stands in numbers"):
        init.create(tmp_path / "rig", [written(tmp_path, f"t [s],u [V],p1 [bar]\n{rows}")])


@pytest.mark.parametrize("dead", [slice(900, 960), slice(1500, None)])
def test_a_channel_that_was_dead_for_a_while_tells_no_reference(dead: slice) -> None:
    pascals = 1.01e5 + 3e5 * (1 - np.cos(np.arange(2000) / 60)) + 300 * RNG.standard_normal(2000)
    pascals[dead] = 0.0
    assert pressure_reference([pascals * 1e-5], "bar", "")[0] == "absolute"


def test_what_counts_rows_and_a_clock_that_stands_again_are_no_signals(tmp_path: Path) -> None:
    rows = "".join(f"{n},{n / 100},{n // 50 % 3},{n / 100},{2 + np.sin(n / 30):.4f}\n" for n in range(400))
    found = guessed(written(tmp_path, f"Index @ 100 Hz,X_Value,u [V],X_Value,p1 [bar]\n{rows}"))
    assert found == {"time": "X_Value", "u": "u [V]", "p1": "p1 [bar]"}


def test_a_mark_behind_the_last_reading_is_no_reading(tmp_path: Path) -> None:
    rows = [f"{n / 100:.2f};{n % 7};{3 + np.sin(n / 30):.4f};;" for n in range(400)]
    path = written(tmp_path, "\n".join(["t [s];u [V];p1 [bar];;", *rows]) + "#0ED844528279D6A6#\n")
    assert guessed(path) == {"time": "t [s]", "u": "u [V]", "p1": "p1 [bar]"}
    assert read(path, 2)[0].size == 400


def test_a_pressure_that_passes_ambient_pressure_for_a_moment_is_not_taken_for_absolute() -> None:
    dip = np.exp(-(((np.arange(2000) - 700) / 10) ** 2))  # a piston that starts fast, and no vented chamber
    pascals = 1.02e5 + 2e5 * (1.0 - dip) + 300 * RNG.random(2000)
    reference, why, *_ = pressure_reference([pascals * 1e-5], "bar", "")
    assert (reference, why.partition(":")[0]) == ("gauge", "CHECK gauge")


def test_what_stands_beside_the_values_of_a_long_table_is_counted(tmp_path: Path) -> None:
    judged = [(n / 100, n % 7, 192) if n % 50 else (n / 100, 1e4, 0) for n in range(200)]
    rows = "".join(f"{t},{tag},{value},{quality}\n" for t, value, quality in judged for tag in ("u", "p1"))
    answer = init.create(tmp_path / "rig", [written(tmp_path, f"ts,tag,val,quality\n{rows}")])
    assert answer.left_out == ['a.csv: "quality": texts, "192" 392 times, "0" 8 times']
    assert {one.signal for one in answer.columns} == {"time", "u", "p1"}
    text = (tmp_path / "rig" / "pipeline.toml").read_text(encoding="utf-8")
    assert len(re.findall(r"# 0, 3, 6", text)) == 2, "rows that are called bad have 1e4"
    label = Channel("val", where=("tag", "p1"))
    signals = open_signals(RawFile(tmp_path / "a.csv", {"time": Channel("ts"), "p1": label}))
    read = np.concatenate([batch["p1"] for batch in signals.batches()])
    assert '"quality" calls 8 rows bad: left out' in [one.message for one in signals.repairs]
    assert read.size == 196
    assert read.max() == 6


def test_a_channel_of_json_is_taken_by_its_label(tmp_path: Path) -> None:
    lines = [f'{{"time": {n // 2 / 100}, "topic": "{"ab"[n % 2]}", "payload": "{n}"}}' for n in range(100)]
    path = written(tmp_path, "\n".join(lines), "a.jsonl")
    channels = {"time": Channel("time"), "p1": Channel("payload", where=("topic", "b"))}
    batch = next(open_signals(RawFile(path, channels)).batches())
    np.testing.assert_array_equal(batch["p1"], np.arange(1.0, 100.0, 2.0))


def test_lines_of_a_trigger_and_behind_the_rows_are_passed_over_and_said(tmp_path: Path) -> None:
    rows = [f"{n / 100},{n}\n" for n in range(60)]
    for rest in ("", "[Statistics]\nn 60\n"):
        text = "".join(["t,p1,state\n", *(f"{row[:-1]},1\n" for row in rows[:30]), "0.30,TRIGGER\n"])
        text += "".join(f"{row[:-1]},1\n" for row in rows[30:]) + rest
        values, reader = read(written(tmp_path, text))
        assert values.tolist() == [float(n) for n in range(60)]
        said = {one.kind: one.message for one in reader.repairs}
        assert said.pop("event") == 'lines that end in a word and hold no readings were passed over: "TRIGGER" 1 times'
        assert said == (
            {"trailer": '2 lines behind the rows, from "[Statistics]" on, were passed over'} if rest else {}
        )


def test_a_line_that_lacks_readings_among_the_rows_is_refused(tmp_path: Path) -> None:
    rows = [f"{n / 100},{n},1\n" for n in range(60)]
    with pytest.raises(InputError, match="line 33"):
        read(written(tmp_path, "".join(["t,p1,state\n", *rows[:30], "0.30,TRIGGER\n", "0.31,1\n", *rows[30:]])))


# ---- what strangers brought


@pytest.mark.parametrize(
    ("encoding", "header"),
    [
        ("gbk", "时间(秒),阀控制电压（V）,气源压力(MPa)"),
        ("cp932", "番号,日付 時間,電圧指令,圧力"),
        ("cp932", "ｽﾄﾛｰｸ,圧力"),
        ("euc_kr", "시간,제어전압,공급압력"),
        ("cp1251", "время;напряжение;давление"),
        ("cp1252", "Prüfstand für Größe [µm];Temp [°C];Kräfte – „Zylinder“"),
        ("cp1252", "Pression côté tige été"),
    ],
)
def test_an_old_code_page_is_recognised(encoding: str, header: str) -> None:
    found = detect_encoding(Path("a.csv"), f"{header}\n0,1,2\n".encode(encoding))
    assert f"{header}\n".encode(encoding).decode(found) == f"{header}\n"


@pytest.mark.parametrize(
    ("header", "first", "second"),
    [
        ("Time (s),Valve (V),Supply (psig),Chamber A (psia),Chamber B (psig)", "psia", "psig"),
        ("t [s],valve [V],Supply [Pa],pressure_pa[0],pressure_pa[1]", "[0]", "[1]"),
        ("t [s],valve [V],Supply [bar],Chamber A [bar],Chamber B [bar]", "A", "B"),
        ("t [s],/v/cmd/data,/p/supply/fluid_pressure,/p/head/fluid_pressure,/p/rod/fluid_pressure", "head", "rod"),
    ],
)
def test_letters_of_chambers_and_parts_of_paths_tell_the_roles(
    header: str, first: str, second: str, tmp_path: Path
) -> None:
    t = 0.01 * np.arange(400)
    values = np.column_stack([t, np.sin(t), 87 + 0 * t, 60 + 9 * np.sin(3 * t), 40 - 9 * np.sin(3 * t)])
    rows = "\n".join(",".join(f"{one:.4f}" for one in row) for row in values)
    found = guessed(written(tmp_path, f"{header}\n{rows}\n"))
    assert "upply" in found["p_supply"]
    assert first in found["p1"]
    assert second in found["p2"]
    assert "order of the columns" not in (tmp_path / "rig" / "pipeline.toml").read_text(encoding="utf-8")


AXIS = {"t [s]": "t", "u [V]": "u", "x [mm]": "x"}


@pytest.mark.parametrize(
    ("columns", "wanted"),
    [
        (AXIS | {"p1 [bar]": "s", "p2 [bar]": "b", "p4 [bar]": "a"}, {"p_supply": "p1 [bar]", "p1": "p4 [bar]"}),
        ({"t [s]": "t", "u [V]": "u", "p1 [bar]": "s", "p2 [bar]": "a"}, {"p_supply": "p1 [bar]", "p1": "p2 [bar]"}),
        (AXIS | {"p1 [bar]": "s", "p2 [bar]": "b"}, {"p1": "p1 [bar]", "p2": "p2 [bar]"}),
        (
            {"t [s]": "t", "u [V]": "u", "p_supply [bar]": "s", "p_amb [bar]": "o", "p_tank [bar]": "a"},
            {"p1": "p_tank [bar]"},
        ),
        (AXIS | {"p1_filt [bar]": "a", "p1_raw [bar]": "a", "p2 [bar]": "b"}, {"p1": "p1_raw [bar]", "p2": "p2 [bar]"}),
        (
            {"t [s]": "t", "OP [V]": "u", "SP [mm]": "r", "PV [mm]": "x", "PT1 [bar]": "a"},
            {"x": "PV [mm]", "x_ref": "SP [mm]"},
        ),
        (AXIS | {"encoder [counts]": "x", "p1 [bar]": "a"}, {"x": "x [mm]"}),
        (
            {"t": "t", "A1.u [V]": "u", "A1.p1": "a", "A1.x": "x", "A2.u [V]": "u", "A2.p1": "b", "A2.x": "x"},
            {"u": "A1.u [V]", "p1": "A1.p1", "x": "A1.x"},
        ),
    ],
    ids=["ports", "up and down", "chambers", "ambient", "filtered", "loop", "counts", "axes"],
)
def test_all_columns_together_tell_a_role(columns: dict[str, str], wanted: dict[str, str], tmp_path: Path) -> None:
    t = 0.01 * np.arange(500)
    values = {"t": t, "u": np.sin(t), "x": 50 + 9 * np.sin(2 * t), "r": np.where(np.sin(2 * t) > 0, 60.0, 40.0)}
    values |= {"s": 6 + 0.001 * np.cos(99 * t), "o": 1.01 + 0.001 * (np.arange(500) % 3)}
    values |= {"a": 3 + 2 * np.sin(3 * t), "b": 4 - 2 * np.sin(3 * t)}
    rows = "\n".join(
        ",".join(f"{one:.4f}" for one in row) for row in np.column_stack([values[v] for v in columns.values()])
    )
    found = guessed(written(tmp_path, f"{','.join(columns)}\n{rows}\n"))
    assert wanted.items() <= found.items()
    assert not [name for name in found.values() if name.startswith("A2.")]  # of another axis


@pytest.mark.parametrize(
    ("unit", "off", "said"),
    [
        ("MPa", 0.0, "absolute: so p1 comes up to it"),
        ("bar", 1.013, "p1 rises to 1 bar above p_supply"),
        ("bar", 0, ""),
    ],
)
def test_a_supply_bounds_the_chamber_that_it_fills(tmp_path: Path, unit: str, off: float, said: str) -> None:
    t = 0.01 * np.arange(500)
    p1 = 7.0 - 5.98 * np.exp(-np.maximum(t - 1, 0))
    rows = "\n".join(
        f"{a:.2f},{b:g},{(7 - off + 1e-4 * (n % 3)) / (10 if unit == 'MPa' else 1):.5f},{c:.4f}"
        for n, (a, b, c) in enumerate(zip(t, t > 1, p1, strict=True))
    )
    answer = init.create(
        tmp_path / "rig", [written(tmp_path, f"t [s],u [V],Supply pressure [{unit}],p1 [bar]\n{rows}\n")]
    )
    (supply,) = [one for one in answer.columns if one.signal == "p_supply"]
    assert said in supply.why
    assert ("rises" in said) == ("rises" in supply.why)


def test_the_only_pressure_at_a_piston_is_doubted_where_it_is_called_the_second(tmp_path: Path) -> None:
    rows = "\n".join(f"{0.01 * n:.2f},{n % 70},{3 + n % 50 / 20}" for n in range(300))
    answer = init.create(tmp_path / "rig", [written(tmp_path, f"t [s],x [mm],pB [bar]\n{rows}\n")])
    (one,) = [one for one in answer.columns if one.signal == "p1"]
    assert "CHECK taken for p1" in one.why


def test_a_travel_in_percent_is_a_share_of_the_stroke_and_that_of_a_spool_is_none(tmp_path: Path) -> None:
    t = 0.01 * np.arange(400)
    rows = "\n".join(f"{at:.2f},{50 + 20 * np.sin(at):.3f},{5 + np.sin(3 * at):.3f},{3 * np.cos(at):.3f}" for at in t)
    path = written(tmp_path, f"t [s],Travel [%],p1 [bar],Valve travel [mm]\n{rows}\n")
    answer = init.create(tmp_path / "rig", [path])
    (travel,) = [one for one in answer.columns if one.signal == "x"]
    assert (travel.column, travel.unit) == ("Travel [%]", "%")
    assert "CHECK" in travel.why


def test_a_topic_a_file_is_one_recording_of_all(tmp_path: Path) -> None:
    t = 0.01 * np.arange(400)
    signals = {
        "valve_cmd": 5 * np.sign(np.sin(3 * t)),
        "p_supply": 7e5 + 0 * t + np.cos(900 * t),
        "p1": 4e5 + 2e5 * np.sin(t),
    }
    for name, values in signals.items():
        rows = [f"{1773216902 * 10**9 + 10**7 * n},{n},{v:.3f},0.0" for n, v in enumerate(values)]
        written(tmp_path, "\n".join(["%time,field.header.seq,field.data,field.variance", *rows]), f"{name}.csv")
    answer = init.create(tmp_path / "rig", sorted(tmp_path.glob("*.csv")))
    assert {one.signal for one in answer.columns if one.signal} == {"time", "u", "p_supply", "p1"}
    assert (tmp_path / "rig" / "pipeline.toml").read_text(encoding="utf-8").count("[[recordings]]") == 1


def test_a_table_on_its_side_is_refused_in_one_line(tmp_path: Path) -> None:
    rows = [",".join([name, *(f"{0.01 * n:.2f}" for n in range(80))]) for name in ("t [s]", "u [V]", "p1 [bar]")]
    with pytest.raises(InputError, match="a channel in each line"):
        init.create(tmp_path / "rig", [written(tmp_path, "\n".join(rows) + "\n")])


@pytest.mark.parametrize(
    ("form", "clock"),
    [
        *(("influx", "time"), ("grafana", "timestamp"), ("listed", ""), ("by name", "time [ms]")),
        *(("pandas", "index"), ("pandas by row", "index"), ("numbered fields", "time"), ("hits", "time")),
        ("objects", "timestamp"),
    ],
)
def test_tables_and_channels_within_json_are_found(form: str, clock: str, tmp_path: Path) -> None:
    t, u, p = 1000.0 * np.arange(50), np.sign(np.sin(np.arange(50))), 2 + np.sin(0.1 * np.arange(50))
    names = {"valve_V": u.tolist(), "p1_bar": p.tolist()}
    forms: dict[str, Any] = {
        "influx": {"results": [{"statement_id": 0, "series": [
            {"columns": ["time", *names], "values": np.column_stack([t, u, p]).tolist()}]}]},
        "grafana": [{"target": name, "datapoints": np.column_stack([v, t]).tolist()} for name, v in names.items()],
        "listed": {"rate": 1.0, "channels": [{"id": 3, "name": name, "values": v} for name, v in names.items()]},
        "by name": {
            "time": {"unit": "ms", "data": t.tolist()},
            "signals": {name.split("_")[0]: {"unit": name.split("_")[1], "data": v} for name, v in names.items()},
        },
        "pandas": {name: dict(zip(map(str, t), v, strict=True)) for name, v in names.items()},
        "pandas by row": {str(a): {"valve_V": b, "p1_bar": c} for a, b, c in np.column_stack([t, u, p]).tolist()},
        "numbered fields": {"channel": {"name": "rig", "field1": "valve_V", "field2": "p1_bar"}, "feeds": [
            {"time": a, "field1": b, "field2": c} for a, b, c in np.column_stack([t, u, p]).tolist()]},
        "objects": {"timeseriesData": [
            {"externalId": name, "items": [{"timestamp": a, "value": b} for a, b in zip(t.tolist(), v, strict=True)]}
            for name, v in names.items()]},
        "hits": {"took": 12, "hits": {"total": {"value": 50}, "hits": [
            {"_index": "rig", "_source": {"time": a, "valve_V": b, "p1_bar": c}, "sort": [a]}
            for a, b, c in np.column_stack([t, u, p]).tolist()]}},
    }  # fmt: skip
    found = guessed(written(tmp_path, json.dumps(forms[form]), "a.json"))
    text = (tmp_path / "rig" / "pipeline.toml").read_text(encoding="utf-8")
    assert f'time = {{ column = "{clock}"' in text if clock else 'time = { expression = "row / 1"' in text
    columns = {"signals/valve [V]", "signals/p1 [bar]"} if form == "by name" else set(names)
    assert {found["u"], found["p1"]} == columns


def test_counts_behind_a_time_are_no_milliseconds(tmp_path: Path) -> None:
    rows = "".join(f"09:15:{n:02d},{100 + n},{200 + n}\n" for n in range(40))
    values, reader = read(written(tmp_path, "Time,a,b\n" + rows))
    assert tuple(reader.names) == ("Time", "a", "b")
    np.testing.assert_array_equal(values, 100.0 + np.arange(40))


@pytest.mark.parametrize(
    ("text", "refused"),
    [
        ("".join(f"- t: {n / 100}\n  p1: {n}\n" for n in range(9)), True),
        ("".join(f"---\nt: {n / 100}\np1: {n}\n" for n in range(9)), True),
        ("t: [0.0, 0.1, 0.2]\np1: [1.0, 1.1, 1.2]\n", True),
        ("---\nlogger: 3\nrig: bench\n---\nt,p1\n" + "0.1,2\n" * 9, False),  # CSV below keys
        ("units: [s, bar]\nt,p1\n" + "0.1,2\n" * 9, False),
    ],
)
def test_yaml_is_refused_by_name(text: str, refused: bool, tmp_path: Path) -> None:
    path = written(tmp_path, text)
    if refused:
        with pytest.raises(InputError, match="this is a YAML document"):
            is_text(path)
    else:
        assert is_text(path)


def test_a_block_s_own_head_is_no_row(tmp_path: Path) -> None:
    block = "Data Acquisition {0}\t\t\tTime:\t{0}\tSec\nStation: a\nTime\tP1\ns\tbar\n"
    rows = ["".join(f"{start + 0.01 * n:.2f}\t{n % 7}.5\n" for n in range(60)) for start in (10, 500)]
    path = written(tmp_path, "".join(block.format(n) + own + "\n" for n, own in enumerate(rows)))
    init.create(tmp_path / "rig", [path])
    assert (tmp_path / "rig" / "pipeline.toml").read_text(encoding="utf-8").count("part = ") == 2
    raw = RawFile(path, {}, skip_rows=2, delimiter="\t")
    reader = open_raw(raw)
    (values,) = next(iter(reader.batches([ColumnRequest(0)])))
    assert values.size == 120
    assert reader.locate(60) == f"{path}, line 70"


def stamped(values: dict[str, np.ndarray], start: int) -> str:
    """Return a table with stamps of a calendar, from a second on."""
    rows = zip(*values.values(), strict=True)
    body = "\n".join(
        f"2026-03-11 09:15:{start + n // 100:02}.{n % 100:02}0 CET,{','.join(f'{one:.4f}' for one in row)}"
        for n, row in enumerate(rows)
    )
    return f"Timestamp,{','.join(values)}\n{body}\n"


def test_a_file_of_the_supply_alone_belongs_to_the_recording_of_the_other_file(tmp_path: Path) -> None:
    t = 0.01 * np.arange(600)
    supply = {"Supply [bar(a)]": 7 + 0.001 * np.cos(99 * t)}
    tank = {"Valve [V]": np.sign(np.sin(2 * t)), "Tank [bar(a)]": 4 + np.sin(t)}
    files = [
        written(tmp_path, stamped(supply, 2), "supply.csv"),
        written(tmp_path, stamped({name: own[100:] for name, own in tank.items()}, 3), "tank.csv"),
    ]
    answer = init.create(tmp_path / "rig", files)
    found = {one.signal: one.column for one in answer.columns if one.signal not in ("", "time")}
    assert found == {"p_supply": "Supply [bar(a)]", "u": "Valve [V]", "p1": "Tank [bar(a)]"}
    text = (tmp_path / "rig" / "pipeline.toml").read_text(encoding="utf-8")
    assert (text.count("[[recordings]]"), text.count("[[recordings.more]]")) == (1, 1)


def test_a_supply_alone_is_doubted_as_a_chamber_and_runs_stay_apart(tmp_path: Path) -> None:
    t = 0.01 * np.arange(600)
    alone = written(tmp_path, stamped({"Supply [bar(a)]": 7 + 0.1 * np.cos(9 * t)}, 2), "supply.csv")
    (one,) = [one for one in init.create(tmp_path / "one", [alone]).columns if one.signal == "p1"]
    assert "CHECK taken for p1" in one.why
    axis = {"Valve [V]": np.sin(t), "p1 [bar]": 4 + np.sin(t), "x [mm]": 9 * np.sin(t)}
    tank = {"u [V]": np.sin(t), "Tank [bar]": 4 + np.sin(t)}
    files = [written(tmp_path, stamped(own, 2), f"{n}.csv") for n, own in enumerate((axis, tank))]
    init.create(tmp_path / "two", files)
    assert (tmp_path / "two" / "pipeline.toml").read_text(encoding="utf-8").count("[[recordings]]") == 2


@pytest.mark.parametrize(
    ("first", "step", "unit"),
    [
        (134_176_905_020_000_000, 100_000, "ns"),
        (639_087_000_000_000_000, 100_000, "ns"),
        (46_092_385_439.8, 0.115740741, "d"),
    ],
    ids=["FILETIME", ".NET", "WinCC"],
)
def test_a_counter_since_an_epoch_of_its_own_is_recognised(
    first: float, step: float, unit: str, tmp_path: Path
) -> None:
    rows = "\n".join(f"{first + step * n:.6f},{n % 50 / 10},{3 + n % 70 / 30}" for n in range(300))
    answer = init.create(tmp_path / "rig", [written(tmp_path, f"Time_ms,u [V],p1 [bar]\n{rows}\n")])
    (clock,) = [one for one in answer.columns if one.signal == "time"]
    assert clock.unit == unit
    assert "CHECK" in clock.why
    (line,) = re.findall(r"time = .*", (tmp_path / "rig" / "pipeline.toml").read_text(encoding="utf-8"))
    assert "# 100 Hz, up to 2.99 s" in line


def test_names_behind_a_percent_sign_are_names(tmp_path: Path) -> None:
    rows = "\n".join(f" {0.01 * n:.2f} {n % 50 / 10} {3 + n % 70 / 30:.3f}" for n in range(300))
    found = init.create(tmp_path / "rig", [written(tmp_path, f"% by octave\n% t u p1\n{rows}\n", "a.txt")]).columns
    assert {one.signal for one in found if one.signal} == {"time", "u", "p1"}


@pytest.mark.parametrize("head", ["s;V;bar\nZeit;Ventil;Druck", "Zeit (x1 s);Ventil (V);Druck (bar)"])
def test_a_line_of_units_above_the_names_and_a_factor_in_brackets_are_read_or_doubted(
    head: str, tmp_path: Path
) -> None:
    rows = "\n".join(f"{0.01 * n:.2f};{n % 50 / 10};{3 + n % 70 / 30:.3f}" for n in range(300))
    answer = init.create(tmp_path / "rig", [written(tmp_path, f"{head}\n{rows}\n")])
    found = {one.signal: one for one in answer.columns if one.signal}
    assert (found["u"].unit, found["p1"].unit) == ("V", "bar")
    assert "no unit is stated" not in found["p1"].why
    assert found["time"].unit == "s"


@pytest.mark.parametrize(("pause", "wrap", "runs"), [(30.0, np.inf, 3), (0.0, 86_400.0, 1)])
def test_a_column_that_changes_where_the_clock_pauses_numbers_the_runs(
    tmp_path: Path, pause: float, wrap: float, runs: int
) -> None:
    """And one that changes where a clock of 24 hours begins anew does not."""
    t = [(86_399.4 + 0.01 * n + pause * (n // 60)) % wrap for n in range(180)]
    rows = "".join(f"{n // 60},{at:.2f},{n % 7},{2.0 + n % 50 / 30:.4f}\n" for n, at in enumerate(t))
    init.create(tmp_path / "rig", [written(tmp_path, "cycle,t [s],u [V],p1 [bar]\n" + rows)])
    assert (tmp_path / "rig" / "pipeline.toml").read_text(encoding="utf-8").count("[[recordings]]") == runs


def test_a_column_of_units_in_a_long_table_is_that_of_each_channel(tmp_path: Path) -> None:
    rows = ((0.01 * n, name, unit, value) for n in range(60) for name, unit, value in
            (("valve", "mV", 1000 * (n % 7)), ("tank pressure", "psi", 20 + n)))  # fmt: skip
    text = "t [s],tag,unit,value\n" + "".join(f"{t:.2f},{name},{unit},{value}\n" for t, name, unit, value in rows)
    answer = init.create(tmp_path / "rig", [written(tmp_path, text)])
    assert {one.signal: one.unit for one in answer.columns if one.signal} == {"time": "s", "u": "mV", "p1": "psi"}


def test_a_travel_of_the_valve_is_its_command_where_no_other_is_recorded(tmp_path: Path) -> None:
    rows = "".join(f"{0.01 * n:.2f},{n % 7 / 10},{2 + n % 60 / 30:.4f}\n" for n in range(180))
    answer = init.create(tmp_path / "rig", [written(tmp_path, "t [s],spool position [mm],p1 [bar]\n" + rows)])
    (spool,) = [one for one in answer.columns if one.signal == "u"]
    assert (spool.column, "CHECK" in spool.why) == ("spool position [mm]", True)


def test_rows_of_arrays_in_json_are_runs(tmp_path: Path) -> None:
    t, p = (0.01 * np.arange(60)).tolist(), (2 + np.sin(0.1 * np.arange(60))).tolist()
    text = json.dumps([{"run": n, "t": t, "valve_V": (np.arange(60) % 7).tolist(), "p1_bar": p} for n in (1, 2)])
    init.create(tmp_path / "rig", [written(tmp_path, text, "a.json")])
    assert (tmp_path / "rig" / "pipeline.toml").read_text(encoding="utf-8").count("[[recordings]]") == 2
