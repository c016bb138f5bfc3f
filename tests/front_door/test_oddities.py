"""Ways of writing that single loggers have: each is read right, marked, or refused in one line that says the mend."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from pneucli.arrays import Array
from pneucli.config import load
from pneucli.errors import InputError
from pneucli.io.cleaning import Cleaner
from pneucli.io.raw_file import Channel, RawFile
from pneucli.io.signal_reader import open_signals
from pneucli.stages import init

from .judge import Outcome, judge
from .laboratory import COUNT, NOISE, RATE, command, position, pressure

T = np.arange(COUNT) / RATE
RNG = np.random.default_rng(47)
U = command(T)
P = (pressure(T) + NOISE["p1"] * RNG.standard_normal(COUNT)) / 1e5
X = 1e3 * (position(T) + NOISE["x"] * RNG.standard_normal(COUNT))
Cells = Array | Sequence[str]


def outcome(folder: Path, columns: dict[str, Cells], *, mark: str = ",", base: float = 0.0) -> Outcome:
    rows = zip(*columns.values(), strict=True)
    lines = [mark.join(value if isinstance(value, str) else f"{value:.8g}" for value in row) for row in rows]
    path = folder / "a.csv"
    path.write_text(mark.join(columns) + "\n" + "\n".join(lines) + "\n", encoding="utf-8")
    return judge(path, folder, base)


def sheet(**columns: Cells) -> dict[str, Cells]:
    """Return the usual columns, some of them replaced by name, or renamed where they are given first."""
    return {"Time [s]": T, "U [V]": U, "P1 [bar]": P, "Pos [mm]": X, **columns}


@pytest.mark.parametrize(
    ("unit", "one"), [("kg/cm^2", 98_066.5), ("kg/cm2", 98_066.5), ("kgf/cm²", 98_066.5), ("ata", 98_066.5)]
)
def test_technical_atmospheres_are_pressures(unit: str, one: float, tmp_path: Path) -> None:
    columns = {"Time [s]": T, "U [V]": U, f"P1 [{unit}]": P * 1e5 / one, "Pos [mm]": X}
    assert outcome(tmp_path, columns).verdict == "right"


@pytest.mark.parametrize(("unit", "per_mm"), [("mil", 1 / 0.0254), ("thou", 1 / 0.0254), ('"', 1 / 25.4)])
def test_inches_and_their_thousandths_are_lengths(unit: str, per_mm: float, tmp_path: Path) -> None:
    assert outcome(tmp_path, {"Time [s]": T, "U [V]": U, "P1 [bar]": P, f"Pos [{unit}]": X * per_mm}).verdict == "right"


@pytest.mark.parametrize("name", ["Temp [C]", "Temp [F]"])
def test_a_temperature_in_a_bare_letter_is_no_fault(name: str, tmp_path: Path) -> None:
    assert outcome(tmp_path, sheet(**{name: np.full(COUNT, 21.0) + T})).verdict == "right"


@pytest.mark.parametrize("unit", ["V", "mA"])
def test_a_sensor_that_is_logged_in_volts_asks_for_its_scale(unit: str, tmp_path: Path) -> None:
    found = outcome(tmp_path, {"Time [s]": T, "U [V]": U, f"P1 [{unit}]": P, "Pos [mm]": X})
    assert found.verdicts == {"u": "right", "p1": "marked", "x": "right"}
    assert f"CHECK the file says {unit}, of a sensor" in found.why
    assert "ambient pressure" not in found.why, "numbers whose scale is asked for tell no pressure"


@pytest.mark.parametrize("word", ["OL", "OVER", "ERR", "---", "********", "#VALUE!", "9.91E+37"])
def test_words_and_numbers_for_no_value_are_missing(word: str, tmp_path: Path) -> None:
    cells = [word if n % 400 in range(200, 207) else f"{p:.5f}" for n, p in enumerate(P)]
    assert outcome(tmp_path, sheet(**{"P1 [bar]": cells})).verdict == "right"


def test_quoted_numbers_with_decimal_commas_are_read(tmp_path: Path) -> None:
    columns = {
        f'"{name}"': [f'"{value:.6g}"'.replace(".", ",") for value in np.asarray(values)]
        for name, values in sheet().items()
    }
    assert outcome(tmp_path, columns).verdict == "right"


def test_points_between_thousands_and_decimal_commas_are_read(tmp_path: Path) -> None:
    pascals = [f"{1e5 * p:,.1f}".translate(str.maketrans(",.", ".,")) for p in P]
    columns = {"Zeit [s]": [f"{t:.3f}".replace(".", ",") for t in T], "u [V]": U, "p1 [Pa]": pascals}
    found = outcome(tmp_path, {**columns, "x [mm]": [f"{x:.4f}".replace(".", ",") for x in X]}, mark=";")
    assert found.verdict == "right"


@pytest.mark.parametrize(("name", "per_second"), [("micros", 1e6), ("millis", 1e3)])
def test_a_counter_that_is_called_by_its_unit_is_a_clock(name: str, per_second: float, tmp_path: Path) -> None:
    begin = 2**32 - 0.5 * per_second
    stamps = [f"{value:.0f}" for value in np.mod(np.round(per_second * T) + begin, 2**32)]
    found = outcome(tmp_path, {name: stamps, "U [V]": U, "P1 [bar]": P, "Pos [mm]": X}, base=begin / per_second)
    assert found.verdict == "right"


def test_minutes_and_seconds_go_on_over_the_hour(tmp_path: Path) -> None:
    stamps = [f"{int((t + 3599) // 60) % 60:02d}:{(t + 3599) % 60:06.3f}" for t in T]
    columns = {"Time": stamps, "U [V]": U, "P1 [bar]": P, "Pos [mm]": X}
    assert outcome(tmp_path, columns).verdict == "right"


def test_the_newest_row_first_is_said_and_read_from_the_last_one_up(tmp_path: Path) -> None:
    command = np.array([f"{u:g}" for u in U], dtype=object)
    command[1:][np.diff(U) == 0] = ""  # which holds: from the row below it, that is
    found = outcome(tmp_path, {n: np.asarray(own)[::-1] for n, own in (sheet() | {"U [V]": command}).items()})
    assert found.verdict == "right"
    text = (tmp_path / "p" / "pipeline.toml").read_text(encoding="utf-8")
    assert "the newest row stands first" in text


def test_a_clock_of_whole_seconds_is_spread_over_its_rows_and_said_to_be_uncertain(tmp_path: Path) -> None:
    whole = np.floor(4.0 * T + 0.37)
    raw = RawFile(tmp_path / "a.csv", {"time": Channel("t"), "p1": Channel("p")})
    raw.path.write_text("t,p\n" + "".join(f"{t:.0f},{1 + n / 7:.4f}\n" for n, t in enumerate(whole)), encoding="utf-8")
    opened = open_signals(raw)
    (batch,) = opened.batches()
    steps = np.diff(batch["time"])
    assert np.ptp(steps) < 0.02 * steps.mean()
    (told,) = [one.message for one in opened.repairs if one.kind == "spread"]
    assert "each may be off by as much" in told or "placed on its ticks" in told


def test_the_end_of_summer_time_without_offsets_is_refused_with_its_name(tmp_path: Path) -> None:
    stamps = [f"02:59:59.{int(1e3 * t):03d}" if t < 1 else f"02:00:00.{int(1e3 * t - 1000):03d}" for t in T]
    outcome(tmp_path, {"Zeit": [f"27.10.2024 {one}" for one in stamps], "U [V]": U, "P1 [bar]": P, "Pos [mm]": X})
    raw = RawFile(tmp_path / "a.csv", {"time": Channel("Zeit"), "p1": Channel("P1 [bar]", unit="bar", si="Pa")})
    reader = open_signals(raw)
    batch = next(reader.batches())
    with pytest.raises(InputError, match="the time goes back") as caught:
        Cleaner(reader.locate).push(batch)
    assert caught.value.mend.startswith("if summer time ends there")


def test_columns_of_fixed_width_keep_their_names(tmp_path: Path) -> None:
    rows = "".join(f"{t:11.4f}{u:10.3f}{p:10.5f}{x:10.4f}\n" for t, u, p, x in zip(T, U, P, X, strict=True))
    (tmp_path / "a.txt").write_text("   Time [s]     U [V]  P1 [bar]  Pos [mm]\n" + rows, encoding="utf-8")
    assert judge(tmp_path / "a.txt", tmp_path, 0.0).verdict == "right"


def test_a_table_of_labview_without_a_clock_begins_below_its_keys(tmp_path: Path) -> None:
    keys = ["LabVIEW Measurement\t", "X_Columns\tNo", "***End_of_Header***\t", "\t", "Channels\t3\t\t\t"]
    keys += ["Samples\t1600\t1600\t1600\t", "Delta_X\t0.001\t0.001\t0.001\t", "***End_of_Header***\t\t\t\t"]
    rows = [f"\t{u}\t{p:.5f}\t{x:.4f}\t" for u, p, x in zip(U, P, X, strict=True)]
    path = tmp_path / "a.lvm"
    path.write_text("\n".join([*keys, "X_Value\tU [V]\tP1 [bar]\tPos [mm]\tComment", *rows]), encoding="utf-8")
    assert judge(path, tmp_path, 0.0).verdict == "right"


@pytest.mark.parametrize(("multi", "comments"), [(False, True), (True, False), (True, True)])
def test_comments_of_labview_and_clocks_of_its_channels_are_heeded(multi: bool, comments: bool, tmp_path: Path) -> None:
    clocks, names = [T, T[::2], T] if multi else [T], ["U", "P1", "Pos"]
    channels = [U, P[::2], X] if multi else [U, P, X]
    columns = [c for pair in zip(clocks, channels, strict=True) for c in pair] if multi else [T, *channels]
    head = "\t".join([f"X_Value\t{name}" for name in names] if multi else ["X_Value", *names]) + "\tComment"
    apart = "\t\t" if multi else "\t"
    keys = ["LabVIEW Measurement\t", f"X_Columns\t{'Multi' if multi else 'One'}", "***End_of_Header***\t", "\t"]
    keys += [f"Channels\t3{apart * 3}", f"Y_Unit_Label\t{apart.join(['V', 'bar', 'mm'])}\t", "***End_of_Header***\t"]
    rows = ["\t".join(f"{c[n]:.5f}" if n < len(c) else "" for c in columns) for n in range(COUNT)]
    for line, text in {0: "valve 3, warm", 900: "the supply was shut"}.items():
        rows[line] += f"\t{text}" * comments
    path = tmp_path / "a.lvm"
    path.write_text("\n".join([*keys, head, *rows]) + "\n", encoding="utf-8")
    assert judge(path, tmp_path, 0.0).verdict == "right"


def test_a_column_without_a_name_and_without_a_number_is_no_fault(tmp_path: Path) -> None:
    rows = "".join(f"{n};{n % 7};;{n % 5}\n" for n in range(200))
    (tmp_path / "a.csv").write_text(rows, encoding="utf-8")
    answer = init.create(tmp_path / "p", [tmp_path / "a.csv"])
    assert [one.signal for one in answer.columns].count("time") == 1


def test_a_table_of_results_beside_recordings_is_left_out(tmp_path: Path) -> None:
    outcome(tmp_path, sheet())
    results = "Kp,Ki,Final_kPa,Overshoot_kPa\n" + "".join(
        f"{n},{n % 3},{30 + n % 4},{n % 5}\n" for n in range(8, 0, -1)
    )
    (tmp_path / "summary.csv").write_text(results, encoding="utf-8")
    answer = init.create(tmp_path / "q", [tmp_path / "a.csv", tmp_path / "summary.csv"])
    assert answer.left_out == ["summary.csv: no column rises like a clock"]


def test_each_part_of_a_file_has_its_own_columns_in_the_answer(tmp_path: Path) -> None:
    half = "t [s],u [V],p1 [bar]\n" + "".join(f"{n / 100},{n % 3},{1 + n % 7}\n" for n in range(100))
    (tmp_path / "a.csv").write_text(half + half, encoding="utf-8")
    answer = init.create(tmp_path / "p", [tmp_path / "a.csv"])
    assert [(one.part, one.column) for one in answer.columns if one.signal == "p1"] == [
        (1, "p1 [bar]"),
        (2, "p1 [bar]"),
    ]


def test_a_mark_may_be_larger_than_any_quantity(tmp_path: Path) -> None:
    assert outcome(tmp_path, sheet()).verdict == "right"
    pipeline = tmp_path / "p" / "pipeline.toml"
    text = pipeline.read_text(encoding="utf-8")
    pipeline.write_text(text.replace('unit = "mm"', 'unit = "mm", missing = [9.91e37]'), encoding="utf-8")
    load(pipeline)
    pipeline.write_text(text.replace('unit = "mm"', 'unit = "mm", missing = [inf]'), encoding="utf-8")
    with pytest.raises(InputError, match=r"missing\.1: inf"):
        load(pipeline)
