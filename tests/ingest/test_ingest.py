"""The stage from pipeline file to artifacts, on files of its own, on the real recordings and on the cases."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.signal import lfilter

from pneucli import messages
from pneucli.config import load
from pneucli.errors import InputError
from pneucli.io.artifacts import read_metadata, read_table
from pneucli.io.recordings import load_recordings
from pneucli.pipeline.graph import Context
from pneucli.recording import Recording
from pneucli.stages import ingest

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("PNEUCLI_DATA", ROOT.parent / "shared" / "real"))
CASES = Path(os.environ.get("PNEUCLI_CASES", ROOT.parent / "shared" / "cases"))
REAL = sorted(path for path in (ROOT / "pipelines").glob("*.toml") if "PNEUCLI_DATA" in path.read_text())

needs_real = pytest.mark.skipif(not DATA.is_dir(), reason="the real recordings are not here (PNEUCLI_DATA)")
needs_cases = pytest.mark.skipif(not CASES.is_dir(), reason="the cases are not here (PNEUCLI_CASES)")

PIPELINE = """
[pipeline]
name = "two"
[rig]
ambient_pressure = "1.0 bar"
[signals]
time = { column = "t", unit = "ms" }
p1 = { column = "P", unit = "bar", reference = "gauge", noise = "4 mbar" }
x = { column = "X", unit = "mm" }
[[recordings]]
name = "charge"
file = "charge.csv"
experiment = "valve"
use = "train"
u = "3 V"
from = "10 ms"
to = "80 ms"
[[recordings]]
name = "stroke"
file = "stroke.csv"
experiment = "friction"
use = "test"
chamber_2 = "open"
"""


def ingested(path: Path, out: Path) -> tuple[dict[str, Any], list[Recording]]:
    answer = ingest.run(Context(path, load(path), out, out.parent))
    return answer, load_recordings(out)


@pytest.fixture
def two(tmp_path: Path) -> Path:
    rng = np.random.default_rng(0)
    rows = [f"{t},{6.5 + 0.004 * rng.standard_normal():.5f}" for t in range(100)]
    (tmp_path / "charge.csv").write_text("t,P\n" + "\n".join(rows) + "\n")
    (tmp_path / "stroke.csv").write_text(
        "t,P,X\n" + "\n".join(f"{row},{n * n * 1e-3:.4f}" for n, row in enumerate(rows)) + "\n"
    )
    (tmp_path / "two.toml").write_text(PIPELINE)
    return tmp_path / "two.toml"


def refusal(two: Path) -> InputError:
    with pytest.raises(InputError) as refused:
        ingested(two, two.parent / "out")
    return refused.value


def test_a_column_that_no_recording_has_is_refused(two: Path) -> None:
    two.write_text(PIPELINE.replace("[[recordings]]", 'x_ref = { column = "PP" }\n[[recordings]]', 1))
    refused = refusal(two)
    assert refused.where == f"{two}, line 10, key signals.x_ref.column"
    assert refused.found == f'{two.parent / "charge.csv"} and 1 more: no column "PP"'
    assert refused.mend.startswith("another signal takes each column of the file; ")


def test_a_column_is_refused_where_only_the_recording_that_uses_it_lacks_it(two: Path) -> None:
    """A valve test does not need x; of two strokes, one has it under another name."""
    two.write_text(PIPELINE + PIPELINE[PIPELINE.rindex("[[recordings]]") :].replace("stroke", "back"))
    (two.parent / "back.csv").write_text((two.parent / "stroke.csv").read_text().replace("t,P,X", "t,P,X mm"))
    refused = refusal(two)
    assert refused.found == f'{two.parent / "back.csv"}: no column "X"'
    assert refused.wanted == 'one of "t", "P", "X mm"'


def test_an_optional_signal_may_be_absent(two: Path) -> None:
    signal = 'x_ref = { column = "XX", optional = true }'
    two.write_text(PIPELINE.replace("[[recordings]]", f"{signal}\n[[recordings]]", 1))
    answer, _ = ingested(two, two.parent / "out")
    assert "[signals] x_ref: absent from 2 of 2 recordings; optional" in answer["left_out"]


def test_a_signal_that_no_recording_takes_may_be_absent(two: Path) -> None:
    text = PIPELINE.replace("[[recordings]]", 'v = { column = "V" }\n[[recordings]]', 1)
    text = text.replace('experiment = "valve"', 'experiment = "valve"\ntake = ["p1"]')
    two.write_text(text.replace('experiment = "friction"', 'experiment = "friction"\ntake = ["p1", "x"]'))
    answer, _ = ingested(two, two.parent / "out")
    assert answer["left_out"][-1] == "[signals] v: no recording takes it"


def test_an_absent_column_that_an_experiment_does_not_use_is_said(two: Path) -> None:
    answer, _ = ingested(two, two.parent / "out")
    assert "[signals] x: absent from 1 of 2 recordings; not needed for valve" in answer["left_out"]


@pytest.mark.parametrize("named_as_on_the_axis", [True, False])
def test_a_valve_test_of_chamber_2_has_one_command_and_one_pressure(two: Path, named_as_on_the_axis: bool) -> None:
    """Of the vessel, however the file names them; the noise of the sensor goes with its column."""
    more = (
        '\nu2 = { column = "U2", unit = "V", optional = true }'
        '\np2 = { column = "P2", unit = "bar", noise = "9 mbar", optional = true }\n[[recordings]]'
    )
    text = PIPELINE.replace("\n[[recordings]]", more, 1).replace('u = "3 V"\n', "chamber = 2\n")
    u = 'u = { column = "U", unit = "V", optional = true }'
    text = text.replace("[signals]", f'[rig.valve]\narrangement = "two"\n[signals]\n{u}')
    two.write_text(text)
    table = (two.parent / "charge.csv").read_text().replace("\n", ",3\n").replace("t,P,3", "t,P,U")
    (two.parent / "charge.csv").write_text(table.replace("t,P,U", "t,P2,U2") if named_as_on_the_axis else table)
    _, (charge, _) = ingested(two, two.parent / "ingest")
    assert set(charge.signals) == {"u", "p1"}
    assert np.all(charge["u"] == 3.0)
    assert charge.noise["p1"].rms == pytest.approx(900.0 if named_as_on_the_axis else 400.0)


def test_artifacts_hold_si_units_and_what_made_them(two: Path, tmp_path: Path) -> None:
    answer, (charge, stroke) = ingested(two, tmp_path / "ingest")
    assert (charge.time[0], charge.time[-1], charge.time.size) == (0.01, 0.08, 71)
    assert charge["p1"].mean() == pytest.approx(7.5e5, rel=1e-3)
    assert set(charge.signals) == {"u", "p1"}
    assert np.all(charge["u"] == 3.0)
    assert charge.noise["p1"].rms == pytest.approx(400.0)
    assert charge.noise["u"].rms == 0.0
    assert stroke.chamber_2 == "open"
    assert set(stroke.signals) == {"p1", "x"}
    schema = pq.read_schema(tmp_path / "ingest" / "signals.parquet")
    assert schema.names == ["recording", "time", "u", "p1", "x"]
    assert {name: schema.field(name).metadata[b"unit"] for name in ("time", "p1", "x")} == {
        "time": b"s",
        "p1": b"Pa",
        "x": b"m",
    }
    about = read_metadata(tmp_path / "ingest" / "signals.parquet")
    assert about["schema"] == "pneucli/ingest/signals/1"
    assert sorted(about["inputs"].values()) == sorted({row["sha256"] for row in answer["recordings"]})
    assert about["parameters"]["pipeline"]["rig"]["ambient_pressure"] == "1.0 bar"
    for name in ("recordings", "noise", "repairs"):
        assert read_metadata(tmp_path / "ingest" / f"{name}.parquet")["schema"] == f"pneucli/ingest/{name}/1"


def test_repairs_are_listed_with_counts(two: Path, tmp_path: Path) -> None:
    text = (tmp_path / "charge.csv").read_text()
    (tmp_path / "charge.csv").write_text(text.replace("\n50,", "\n49,").replace("\n60,6", "\n60,99"))
    answer, (charge, _) = ingested(two, tmp_path / "ingest")
    found = {(one["signal"], one["kind"]): one["count"] for one in answer["repairs"] if one["recording"] == "charge"}
    assert found == {("time", "duplicate"): 1, ("p1", "spike"): 1}
    assert np.isnan(charge["p1"]).sum() == 1
    table = read_table(tmp_path / "ingest" / "repairs.parquet")
    assert list(zip(table["signal"], table["kind"], strict=True)) == list(found)
    assert "1 spikes" in messages.render("ingest", answer, "p.toml")


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('column = "P"', 'column = "Q"', r'(?s)key signals.p1.column.*no column "Q".*"t", "P"'),
        ('u = "3 V"\n', "", "u is not described"),
        ('from = "10 ms"\nto = "80 ms"', 'from = "1 s"', "0 usable rows"),
        ('column = "t"', 'column = "T"', r'no column "T"'),
        ("[rig]", '[rig]\nsuply_pressure = "1 bar"', 'did you mean "supply_pressure"'),
    ],
)
def test_what_the_stage_cannot_use_is_refused(two: Path, tmp_path: Path, old: str, new: str, says: str) -> None:
    assert old in PIPELINE
    two.write_text(PIPELINE.replace(old, new))
    with pytest.raises(InputError, match=says):
        ingested(two, tmp_path / "ingest")
    assert not list((tmp_path / "ingest").glob("*.parquet"))


DRIVEN = PIPELINE.replace('experiment = "friction"', 'experiment = "axis"\nu = "1 V"').replace('"open"', '"valve"')


@pytest.mark.parametrize(("kind", "held"), [("valve", False), ("friction", True)])
def test_a_driven_rig_without_a_pressure_is_told_what_is_possible(
    two: Path, tmp_path: Path, kind: str, held: bool
) -> None:
    """A constant pressure is one that a regulator holds; behind a valve it would be no experiment."""
    left_out = ("p1 =", "x =") if kind == "valve" else ("p1 =",)
    text = "".join(line for line in PIPELINE.splitlines(keepends=True) if not line.startswith(left_out))
    first, other = text.split("[[recordings]]")[1:]
    two.write_text(text.partition("[[recordings]]")[0] + "[[recordings]]" + (first if kind == "valve" else other))
    with pytest.raises(InputError, match="p1 is not described") as raised:
        ingested(two, tmp_path / "ingest")
    assert ("state a constant" in raised.value.mend) == held
    assert raised.value.mend.startswith("record p1: a command alone tells nothing of the valve") != held


@pytest.mark.parametrize("stated", ["", '[rig.valve]\narrangement = "two"\n'])
def test_of_two_valves_both_commands_are_needed(two: Path, tmp_path: Path, stated: str) -> None:
    two.write_text(DRIVEN.replace("[signals]", stated + "[signals]"))
    with pytest.raises(InputError, match=r'(?s)u2 is not described.*constant, u2 = .*arrangement = "5/3"'):
        ingested(two, tmp_path / "ingest")


@pytest.mark.parametrize(
    ("old", "new"), [("[signals]", '[rig.valve]\narrangement = "5/3"\n[signals]'), ("1 V", '1 V"\nu2 = "0 V')]
)
def test_one_spool_has_one_command_and_a_second_one_may_be_constant(
    two: Path, tmp_path: Path, old: str, new: str
) -> None:
    two.write_text(DRIVEN.replace(old, new))
    assert {*ingested(two, tmp_path / "ingest")[1][1].signals} - {"u2"} == {"u", "p1", "x"}


def test_recordings_whose_command_jumps_all_the_time_do_not_say_what_a_sensors_noise_is(tmp_path: Path) -> None:
    """Behind a valve that opens all the time the pressure is nowhere quiet: the one recording of a step tells."""
    rng, time = np.random.default_rng(0), np.arange(4000)
    names = ("step", "pulses_1", "pulses_2", "pulses_3")
    for name in names:
        toggles = rng.random(4000) < 0.03 if name != "step" else time == 2000
        u = 24 * (np.cumsum(toggles) % 2)
        p = lfilter([0.02], [1.0, -0.98], u / 8.0) + 4e-3 * lfilter([0.6], [1.0, -0.8], rng.standard_normal(4000))
        rows = "\n".join(f"{t},{a},{b:.5f}" for t, a, b in zip(time, u, p, strict=True))
        (tmp_path / f"{name}.csv").write_text(f"t,u,P\n{rows}\n")
    text = '[pipeline]\nname = "s"\n[signals]\ntime = { column = "t", unit = "ms" }\nu = { column = "u", unit = "V" }\n'
    text += 'p1 = { column = "P", unit = "bar", reference = "gauge" }\n'
    for name in names:
        text += f'[[recordings]]\nname = "{name}"\nfile = "{name}.csv"\nexperiment = "valve"\nuse = "train"\n'
    (tmp_path / "s.toml").write_text(text)
    (noise,) = {one.noise["p1"].rms for one in ingested(tmp_path / "s.toml", tmp_path / "ingest")[1]}
    assert noise == pytest.approx(400.0, rel=0.2)  # of the pulses alone it would come out as 160


@pytest.mark.parametrize("column", ['"P"', "2"])
def test_one_column_for_two_signals_is_refused_however_it_is_named(two: Path, tmp_path: Path, column: str) -> None:
    two.write_text(PIPELINE.replace('column = "X"', f"column = {column}"))
    with pytest.raises(InputError, match='p1 and x are both column "P"') as error:
        ingested(two, tmp_path / "ingest")
    assert "charge.csv" in str(error.value)


def test_two_rows_of_a_long_table_may_share_a_column(tmp_path: Path) -> None:
    rows = "".join(f"{t},{name},{t % 3}\n" for t in range(50) for name in ("p", "x"))
    (tmp_path / "long.csv").write_text("t,what,value\n" + rows)
    text = PIPELINE.replace('"P"', '"value", where = { column = "what", equals = "p" }')
    text = text.replace('"X"', '"value", where = { column = "what", equals = "x" }').replace("charge.csv", "long.csv")
    (tmp_path / "two.toml").write_text(text.replace("stroke.csv", "long.csv"))
    assert {"p1", "x"} <= set(ingested(tmp_path / "two.toml", tmp_path / "ingest")[1][1].signals)


def test_every_row_has_a_column_for_what_became_of_it(two: Path, tmp_path: Path) -> None:
    answer, _ = ingested(two, tmp_path / "ingest")
    table = read_table(tmp_path / "ingest" / "recordings.parquet")
    counts = [name for name, values in table.items() if name != "chamber" and np.asarray(values).dtype == np.int64]
    assert counts[:2] == ["rows_read", "samples"]
    for k, row in enumerate(answer["recordings"]):
        assert table["rows_read"][k] == 100 == sum(int(table[name][k]) for name in counts[1:])
        assert {name: row[name] for name in counts} == {name: int(table[name][k]) for name in counts}
    assert answer["recordings"][0]["outside"] == 29
    assert "charge: of 100 rows 71 became samples: 29 rows lie outside from and to" in answer["left_out"]


def test_a_signal_without_any_value_is_refused_where_it_is_needed_and_else_left_out(two: Path, tmp_path: Path) -> None:
    rows = "\n".join(f"{t},6.5,{t * t}" for t in range(100))
    (tmp_path / "stroke.csv").write_text("t,P,X\n" + rows.replace(",6.5,", ",,") + "\n")
    with pytest.raises(InputError, match=r"stroke\.csv, signal p1: no value in any of 100 rows"):
        ingested(two, tmp_path / "ingest")
    two.write_text(PIPELINE + 'force = "3 N"\n')
    answer, (_, stroke) = ingested(two, tmp_path / "ingest")
    assert "p1" not in stroke
    assert answer["recordings"][1]["signals"] == ["time", "x", "force"]
    assert ("p1", "empty", 100) in {(one["signal"], one["kind"], one["count"]) for one in answer["repairs"]}


@pytest.mark.parametrize("unit", ["ns", "d"])
def test_a_sampling_period_that_no_logger_has_is_refused(two: Path, tmp_path: Path, unit: str) -> None:
    scaled = PIPELINE.replace('from = "10 ms"\nto = "80 ms"', "").replace('unit = "ms"', f'unit = "{unit}"')
    two.write_text(scaled.replace("unit =", "scale = 1e-2, unit =" if unit == "ns" else "scale = 1e3, unit =", 1))
    with pytest.raises(InputError, match="a sampling period of"):
        ingested(two, tmp_path / "ingest")


@needs_real
@pytest.mark.real
@pytest.mark.parametrize("path", REAL, ids=lambda path: path.stem)
def test_every_real_recording_loads(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PNEUCLI_DATA", str(DATA))
    answer, recordings = ingested(path, tmp_path / "ingest")
    assert len(recordings) == len(answer["recordings"])
    for one in recordings:
        assert np.all(np.diff(one.time) > 0)
        assert not [
            r for r in answer["repairs"] if r["kind"] in ("spike", "frozen", "saturated", "backward", "duplicate")
        ]
        assert all(np.isfinite(values).any() for values in one.signals.values())


@pytest.fixture
def real(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], list[Recording]]:
    if not DATA.is_dir():
        pytest.skip("the real recordings are not here (PNEUCLI_DATA)")
    monkeypatch.setenv("PNEUCLI_DATA", str(DATA))
    monkeypatch.setattr(ingest, "MIN_NOISE_SAMPLES", 10**9)  # noise is another matter, and takes longer
    return lambda name: ingested(ROOT / "pipelines" / f"{name}.toml", tmp_path / "ingest")[1]


@pytest.mark.real
@pytest.mark.parametrize(
    ("name", "friction"),  # README of the recordings: half the difference of retract and extend medians, N
    [("o-ring", [3.98, 5.50, 7.16, 7.98]), ("pk", [2.64, 3.58, 5.19, 6.60]), ("x-ring257", [4.56, 6.50, 8.63, 15.53])],
)
def test_seal_friction_is_what_its_authors_data_give(
    real: Callable[[str], list[Recording]], name: str, friction: list[float]
) -> None:
    rig = load(ROOT / "pipelines" / f"zillen-{name}.toml").to_rig()
    assert rig.piston_area_1 is not None
    measured = []
    for one in real(f"zillen-{name}"):
        net = one["force"] + (one["p1"] - rig.ambient_pressure) * rig.piston_area_1
        speed = np.gradient(one["x"], one.time)
        forth, back = np.median(net[speed > 4e-3]), np.median(net[speed < -4e-3])
        measured.append(abs(forth - back) / 2)
    assert measured == pytest.approx(friction, rel=0.1)


@pytest.mark.real
@pytest.mark.parametrize(
    ("name", "start", "end"), [("aluminium", 7.315, 7.284), ("prusa", 7.645, 7.548), ("ultimaker-020", 7.671, 0.03)]
)
def test_decay_ends_where_its_readme_says(
    real: Callable[[str], list[Recording]], name: str, start: float, end: float
) -> None:
    (one,) = real(f"zillen-decay-{name}")
    gauge = (one["p1"] - 101_300) / 1e5
    assert one.valve_shut
    assert one.time[-1] == pytest.approx(145, abs=7)  # "10 Hz, about 145 s"
    assert one.period == pytest.approx(0.1, rel=0.02)
    assert (np.median(gauge[:10]), np.median(gauge[-10:])) == (
        pytest.approx(start, abs=6e-3),
        pytest.approx(end, abs=6e-3),
    )


@pytest.mark.real
def test_emps_and_hyddown_have_the_published_sizes(real: Callable[[str], list[Recording]]) -> None:
    assert [one.time.size for one in real("emps")] == [24_841, 24_841]
    (vessel,) = real("hyddown")
    assert np.isfinite(vessel["p1"]).sum() == 15
    assert np.isfinite(vessel["temperature"]).sum() == 14


@needs_cases
@pytest.mark.real
@pytest.mark.parametrize("path", sorted(CASES.glob("case-*/pipeline.toml")), ids=lambda path: path.parent.name)
def test_cases_pass_unaltered(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ingest, "MIN_NOISE_SAMPLES", 10**9)  # noise is another matter, and takes longer
    answer, recordings = ingested(path, tmp_path / "ingest")
    assert answer["repairs"] == []
    for one, row in zip(recordings, answer["recordings"], strict=True):
        raw = np.loadtxt(row["file"], delimiter=",", skiprows=3)
        np.testing.assert_allclose(one.time, raw[:, 0] * 1e-3, rtol=1e-15)
        assert one.time.size == len(raw)


def test_an_accelerometers_noise_is_found_between_break_away_and_stop(tmp_path: Path) -> None:
    """A piston that sticks and slips some four times a second: noise of 0.05 m/s^2, jumps of 6 m/s^2."""
    time, rng = 1e-3 * np.arange(8000), np.random.default_rng(0)
    leaving = np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 0.3, 40))])
    since = time - leaving[np.searchsorted(leaving, time, side="right") - 1]
    slip = np.where(since < 0.08, 6.0 * np.cos(np.pi * since / 0.08), 0.0)
    reading = slip + rng.normal(scale=0.05, size=time.size)
    rows = [f"{t:.3f},{a:.5f}" for t, a in zip(1e3 * time, reading, strict=True)]
    (tmp_path / "stroke.csv").write_text("t,A\n" + "\n".join(rows) + "\n")
    (tmp_path / "slip.toml").write_text(
        '[pipeline]\nname = "slip"\n[signals]\ntime = { column = "t", unit = "ms" }\n'
        'a = { column = "A", unit = "m/s^2" }\n'
        '[[recordings]]\nname = "stroke"\nfile = "stroke.csv"\nexperiment = "friction"\nuse = "train"\n'
        'p1 = "3 bar"\np2 = "3 bar"\nx = "100 mm"\n'
    )
    _, (stroke,) = ingested(tmp_path / "slip.toml", tmp_path / "out")
    assert stroke.noise["a"].rms == pytest.approx(0.05, rel=0.1)
