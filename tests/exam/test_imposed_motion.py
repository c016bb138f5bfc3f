"""A machine that drives the piston: the force that it needs, by the balance of forces."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from pneucli.exam import cases
from pneucli.exam.cases import generate_case, plan_cases
from pneucli.exam.conditions import parse
from pneucli.exam.rig.imposed_motion import REVERSAL_TIME, MotionMachine, simulate_imposed_motion
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.sensors import Sensors, measure
from pneucli.notebook.run import open_pipeline_of
from tests.exam.written import rows

PAR = Parameters(coulomb=10.0, viscous=40.0, mass=2.0)
MACHINE = MotionMachine((0.04, 0.08), (0.01, 0.02), 4, PAR.ambient + 3e5)


def test_strokes_go_to_and_fro_at_their_speeds_in_turn() -> None:
    truth = simulate_imposed_motion(PAR, MACHINE, 1000.0)
    assert truth["x"].min() == pytest.approx(0.04, abs=2e-5)
    assert truth["x"].max() == pytest.approx(0.08, abs=2e-5)
    speeds = np.unique(np.round(truth["v"][np.abs(truth["a"]) < 1e-9], 6))
    assert set(speeds) >= {-0.02, 0.01}
    gained = np.cumsum(truth["a"])[:-1] / 1000.0
    assert gained == pytest.approx(truth["v"][1:] - truth["v"][0], abs=2e-3)
    assert truth["x"].size == pytest.approx(1000 * 2 * (4.0 + 2.0 + 2 * REVERSAL_TIME), abs=10)


def test_the_force_is_friction_less_the_push_of_the_pressure_while_the_speed_is_steady() -> None:
    truth = simulate_imposed_motion(PAR, MACHINE, 1000.0)
    steady = (np.abs(truth["a"]) < 1e-9) & (truth["v"] != 0.0)
    friction = 10.0 * np.sign(truth["v"]) + 40.0 * truth["v"]
    assert truth["force"][steady] == pytest.approx((friction - PAR.piston_area_1 * 3e5)[steady], abs=1e-9)
    turning = (np.abs(truth["a"]) > 0.05) & (truth["v"] != 0.0)
    inertia = truth["force"] - friction + PAR.piston_area_1 * 3e5
    assert inertia[turning] == pytest.approx(2.0 * truth["a"][turning], abs=1e-9)


def test_friction_that_grows_with_pressure_and_a_regulator_that_gives_way_show_in_the_force() -> None:
    grown = (
        simulate_imposed_motion(PAR._replace(pressure_gain=1e-6), MACHINE, 1000.0)["force"]
        - simulate_imposed_motion(PAR, MACHINE, 1000.0)["force"]
    )
    assert np.quantile(np.abs(grown), 0.5) == pytest.approx(10.0 * 1e-6 * 3e5, rel=1e-6)
    swung = simulate_imposed_motion(PAR, MotionMachine((0.04, 0.08), (0.01,), 2, PAR.ambient + 3e5, swing=0.01), 1000.0)
    assert swung["p1"].max() - PAR.ambient == pytest.approx(3.03e5, rel=1e-3)
    assert swung["p1"][np.argmax(swung["x"])] < swung["p1"][0]


def test_an_imposed_case_says_so_and_holds_out_a_pressure_between_the_others(tmp_path: Path) -> None:
    truth = generate_case(tmp_path / "case", "friction", ["pressure-friction"], "", 1.0, 5, parse("imposed"))
    pipeline = tomllib.loads((tmp_path / "case" / "pipeline.toml").read_text())
    assert [r["imposed"] for r in pipeline["recordings"]] == ["motion"] * 4
    assert [r["use"] for r in pipeline["recordings"]] == ["train"] * 3 + ["test"]
    assert set(pipeline["signals"]) == {"time", "p1", "x", "force"}
    levels = [np.median(rows(tmp_path / "case" / r["file"])[:, 1]) for r in pipeline["recordings"]]
    assert levels[1] < levels[3] < levels[2]
    assert truth["conditions"] == ["imposed"]


@pytest.mark.parametrize("seed", range(4))
def test_a_machine_crosses_the_friction_patch(tmp_path: Path, seed: int) -> None:
    truth = generate_case(tmp_path / "case", "friction", ["position-friction"], "", 1.0, seed, parse("imposed"))
    place = truth["hidden"]["position-friction"]
    for file in sorted((tmp_path / "case" / "raw").glob("*.csv")):
        text = file.read_text().splitlines()
        header = next(i for i, line in enumerate(text) if line.startswith("t [ms]"))
        column = text[header].split(",").index("Pos [mm]")
        x = 1e-3 * np.array([float(line.split(",")[column]) for line in text[header + 1 :] if line[0].isdigit()])
        assert x.min() < place["from"] < x.max()


def test_the_noise_of_a_force_that_jumps_with_the_direction_is_that_of_its_sensor(tmp_path: Path) -> None:
    """White noise shows in the differences from sample to sample, of which few hold a jump."""
    generate_case(tmp_path / "case", "friction", ["position-friction"], "", 1.0, 0, parse("imposed"))
    done = open_pipeline_of(tmp_path / "case" / "pipeline.toml", tmp_path / "out").update(["ingest"])
    recording = done["ingest"].answer["recordings"][0]
    text = (tmp_path / "case" / recording["file"]).read_text().splitlines()
    force = np.array([float(line.split(",")[3]) for line in text if line[0].isdigit()])
    white = 1.4826 * np.median(np.abs(np.diff(force))) / np.sqrt(2.0)
    assert recording["noise"]["force"]["rms"] == pytest.approx(white, rel=0.15)


def test_a_late_sensor_records_the_force_of_an_earlier_time() -> None:
    rng, quiet = np.random.default_rng, Sensors(pressure=0.0, acceleration=0.0)
    truth = simulate_imposed_motion(PAR, MACHINE, 1000.0)
    late, early = (measure(PAR._replace(force_skew=s), quiet, truth, rng(0))["force"] for s in (0.02, -0.02))
    assert late[100:] == pytest.approx(truth["force"][80:-20])
    assert early[:-100] == pytest.approx(truth["force"][20:-80])


def test_a_force_is_recorded_late_only_where_one_is_recorded_and_its_jumps_are_seen() -> None:
    allowed = {
        name
        for name in ("usual", "imposed", "imposed+messy", "constant-speed", "wide")
        if parse(name).allows("force-skew")
    }
    assert allowed == {"imposed", "imposed+messy"}
    hidden = {name for case in plan_cases(60, 0, parse("usual"), 3) for name in case.hidden}
    assert "force-skew" not in hidden
    assert "force-skew" in {name for case in plan_cases(60, 0, parse("imposed"), 3) for name in case.hidden}


def test_other_conditions_draw_what_they_would_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """An exam's cases under its other conditions stay those that an earlier program wrote."""
    names = ("usual", "both-sides", "5/3", "wide")
    with_it = [list(plan_cases(40, 5, parse(name), 7)) for name in names]
    monkeypatch.setattr(cases, "CATALOGUE", tuple(one for one in cases.CATALOGUE if not one.under))
    assert [list(plan_cases(40, 5, parse(name), 7)) for name in names] == with_it
