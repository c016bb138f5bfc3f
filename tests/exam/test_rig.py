"""The virtual rig against textbook results, and against the shared cases of another rig of the same kind."""

import json
import os
import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pneucli.exam import cases
from pneucli.exam.cases import generate_case, plan_cases
from pneucli.exam.conditions import parse
from pneucli.exam.hidden_effects import CATALOGUE, UNCATALOGUED
from pneucli.exam.rig.excitations import (
    REVERSAL_TIME,
    MotionMachine,
    closed_loop,
    simulate_imposed_motion,
    stick_slip,
    two_sine_reference,
    valve_step,
)
from pneucli.exam.rig.gas import GAS_CONSTANT, KAPPA, hose_volume
from pneucli.exam.rig.kernel import P1, PS, T1, valve_flow
from pneucli.exam.rig.parameters import TWO_VALVES, Parameters
from pneucli.exam.rig.sensors import Sensors, measure
from pneucli.exam.rig.simulation import Excitation, simulate_rig
from pneucli.exam.rig_scaling import DIMENSIONS, RigScaling
from pneucli.notebook.run import open_pipeline_of
from tests.exam.written import rows

CASES = Path(os.environ.get("PNEUCLI_CASES", Path(__file__).parents[3] / "shared" / "cases"))
VESSEL = Parameters(piston_area_1=0.0, piston_area_2=0.0, dead_volume_1=160e-6)


def test_the_whole_curve_of_charge_and_discharge_agrees_with_scipy():
    par = VESSEL._replace(heat_conductance=0.5)
    move = valve_step(par, 5.0)
    seen = simulate_rig(par, move)
    area = par.effective_area * 0.5**par.exponent

    def slope(t: float, y: np.ndarray) -> list[float]:
        s = np.zeros(10)
        s[P1], s[T1], s[PS] = y[0], y[1], par.supply
        u = move.command[min(int(t * 1e3 + 1e-9), move.command.size - 1)]
        q_in, q_out = valve_flow(par, np.sign(u) * area, t, s)
        volume, gas = par.dead_volume_1, GAS_CONSTANT * y[1]
        # written from the balance of internal energy m c_v T, not as the rig's pressure equation is
        mass = y[0] * volume / gas
        c_v = GAS_CONSTANT / (KAPPA - 1)
        energy = KAPPA * c_v * (q_in * par.temperature - q_out * y[1]) + 0.5 * (par.temperature - y[1])
        dT = (energy / c_v - (q_in - q_out) * y[1]) / mass
        return [((q_in - q_out) * gas + mass * GAS_CONSTANT * dT) / volume, dT]

    y0, edges = [par.ambient, par.temperature], [0.0, 0.15, 1.3, 1.45, 2.6]
    for begin, end in pairwise(edges):
        grid = np.arange(round(begin * 1e3), round(end * 1e3)) * 1e-3
        there = solve_ivp(
            slope, (begin, end - 1e-9), y0, t_eval=[*grid, end - 1e-9], rtol=1e-9, atol=1e-6, max_step=0.01
        )
        window = slice(round(begin * 1e3), round(end * 1e3))
        # 5 Pa: a fiftieth of the least sensor noise in use
        assert seen["p1"][window] == pytest.approx(there.y[0][:-1], abs=5.0)
        assert seen["temperature"][window] == pytest.approx(there.y[1][:-1], abs=0.01)
        y0 = list(there.y[:, -1])


def test_stick_slip_starts_at_static_friction_and_never_creates_energy():
    par = Parameters(coulomb=12.0, static=20.0, stribeck_velocity=0.015)
    seen = simulate_rig(par, stick_slip(par, 1e4))
    first = np.flatnonzero(seen["v"] > 0)[0]
    assert (seen["p1"][first - 1] - par.ambient) * par.piston_area_1 == pytest.approx(20.0, rel=0.01)
    work = np.trapezoid((seen["p1"] - par.ambient) * par.piston_area_1, seen["x"])
    assert 0.5 * par.mass * np.max(seen["v"]) ** 2 < work


def test_sensors_do_what_their_parameters_say():
    par = Parameters(
        pressure_offset=5e3, pressure_scale=1.1, pressure_lag=0.02, pressure_skew=0.005, acceleration_bias=0.3
    )
    ramp = par.ambient + 1e5 * np.arange(1000) * 1e-3
    truth = {name: np.zeros(1000) for name in ("u", "u2", "x", "a")} | dict.fromkeys(("p1", "p2", "p_supply"), ramp)
    seen = measure(par, Sensors(pressure=0.0, acceleration=0.0), truth, np.random.default_rng(1))
    # a lag and a delay both shift a ramp, by 20 ms and 5 ms
    assert seen["p1"][500:] == pytest.approx(1.1e5 * (np.arange(500, 1000) * 1e-3 - 0.025) + 5e3, abs=1.0)
    assert seen["p2"][500:] == pytest.approx(1.1e5 * (np.arange(500, 1000) * 1e-3 - 0.025), abs=1.0)
    assert np.all(seen["a"] == 0.3)


@pytest.mark.parametrize("pole", [0.0, 0.5, 0.8])
def test_pressure_noise_has_its_level_and_colour(pole):
    n = 40_000
    truth = {name: np.zeros(n) for name in ("u", "u2", "x", "a")} | {
        p: np.full(n, 101_300.0) for p in ("p1", "p2", "p_supply")
    }
    noise = measure(Parameters(), Sensors(pressure=400.0, pole=pole), truth, np.random.default_rng(2))["p1"]
    assert np.std(noise) == pytest.approx(400.0, rel=0.05)
    assert np.corrcoef(noise[1:], noise[:-1])[0, 1] == pytest.approx(pole, abs=0.02)


def quiet(n: int = 20_000) -> dict[str, np.ndarray]:
    """A rig at which nothing happens."""
    signals = {name: np.zeros(n) for name in ("u", "u2", "x", "a")}
    return signals | {p: np.full(n, 3e5) for p in ("p1", "p2", "p_supply")}


def test_a_drifting_zero_wanders_slowly_and_by_a_few_times_the_noise():
    seen = measure(Parameters(), Sensors(pressure=400.0, drift=4.0), quiet(), np.random.default_rng(3))
    for name in ("p1", "p2", "p_supply"):
        course = seen[name].reshape(20, -1).mean(axis=1) - seen[name][:1000].mean()
        assert 400.0 < np.max(np.abs(course)) < 4000.0
        assert np.max(np.abs(np.diff(course))) < 1200.0


def test_outliers_are_few_and_far_out():
    still = measure(Parameters(), Sensors(), quiet(), np.random.default_rng(3))
    seen = measure(Parameters(), Sensors(outliers=1e-3), quiet(), np.random.default_rng(3))
    wrong = np.abs(seen["p1"] - still["p1"])
    assert 5 < np.count_nonzero(wrong) < 50
    assert np.min(wrong[wrong > 0.0]) > 20 * 400.0


USUAL = RigScaling()
SILENT = Sensors(pressure=0.0, acceleration=0.0, position_step=0.0)


def moved(par: Parameters, similar: RigScaling = USUAL, rate: float = 1000.0) -> dict[str, np.ndarray]:
    """Back and forth, then against an end."""
    reference = np.r_[two_sine_reference(np.random.default_rng(1), 700, par.stroke), np.full(800, -0.3 * par.stroke)]
    gain = 150.0 * similar.command / similar.length
    second = 0.1 * par.command_range * np.sin(np.arange(1500) / 100)
    return simulate_rig(par, closed_loop(par, reference, gain, 1.8e5 * similar.pressure, command_2=second), rate)


def shown(par: Parameters, similar: RigScaling = USUAL) -> dict[str, np.ndarray]:
    """What sensors without noise show of that motion, in the usual rig's sizes."""
    seen = measure(par, SILENT, moved(par, similar), np.random.default_rng(1))
    return {"p1": seen["p1"] / similar.pressure, "x": seen["x"] / similar.length, "a": seen["a"] / similar.length}


def everything_hidden(*but: str) -> Parameters:
    par = Parameters(overlap=0.2, arrangement=TWO_VALVES, effective_area_2=1.5e-6, overlap_2=0.3)
    for effect in CATALOGUE + UNCATALOGUED:
        if effect.name not in ("valve-deadband", *but):
            par = effect.apply(par, 0.5, np.random.default_rng(7))
    return par


@pytest.mark.parametrize("rate", [200.0, 500.0, 5000.0, 10_000.0])
def test_another_rate_records_the_same_motion(rate):
    usual, sensors = moved(Parameters()), Sensors(rate=rate)
    other = moved(Parameters(), rate=sensors.sensor_rate)
    thinned = {name: signal[:: max(1, round(rate / 1e3))] for name, signal in other.items()}
    for name in ("u", "p1", "x", "v"):
        assert np.array_equal(thinned[name], usual[name]), name
    seen = measure(Parameters(), sensors, other, np.random.default_rng(1))
    assert seen["time"] == pytest.approx(np.arange(1.5 * rate) / rate)
    assert np.array_equal(seen["u"], other["u"][:: sensors.decimation])


def test_the_loop_has_its_own_clock():
    usual = moved(Parameters())["u"]
    assert np.all(np.diff(usual[5:200]) != 0.0)
    quick = moved(Parameters(), rate=10_000.0)["u"].reshape(-1, 10)
    assert np.all(quick == quick[:, :1])


def test_a_rate_that_does_not_divide_the_loops_changes_the_motion_little():
    odd = moved(Parameters(), rate=Sensors(rate=330.0).sensor_rate)
    time = np.arange(odd["x"].size) / Sensors(rate=330.0).sensor_rate
    usual = np.interp(time, np.arange(1500) * 1e-3, moved(Parameters())["x"])
    assert odd["x"] == pytest.approx(usual, abs=1e-3)


def test_sensors_are_simulated_finely_before_the_logger_decimates():
    sensors = Sensors(pressure=0.0, rate=100.0)
    par = Parameters(pressure_lag=0.02)
    step = par.ambient + 1e5 * (np.arange(1000) >= 305)
    truth = {name: np.zeros(1000) for name in ("u", "u2", "x", "a")} | dict.fromkeys(("p1", "p2", "p_supply"), step)
    seen = measure(par, sensors, truth, np.random.default_rng(1))["p2"]
    assert seen[31:40] == pytest.approx(1e5 * (1 - np.exp(-(10 * np.arange(31, 40) - 304.5) / 20)), rel=1e-3)


@pytest.mark.parametrize("but", ["valve-lag", "spool sticks and jumps"])
@pytest.mark.parametrize("bore", [6e-3, 200e-3])
def test_a_rig_of_another_bore_moves_as_the_usual_one_does(bore, but):
    """With all that can be hidden at once: a quantity whose dimension is wrong or forgotten would show.

    But for one: a loop over a late spool that sticks makes a moment of a rounded command.
    """
    par = everything_hidden(but)
    similar = RigScaling.for_target(par, bore, None, 5.0)
    assert np.pi / 4 * bore**2 == pytest.approx(similar.scale_rig(par).piston_area_1)
    for name, other in shown(similar.scale_rig(par), similar).items():
        usual = shown(par)[name]
        # commands are rounded: an impact may come a moment later
        assert np.mean(np.abs(other - usual)) < 5e-5 * np.ptp(usual), name


def test_a_rig_of_another_pressure_moves_so_in_thicker_air():
    par = everything_hidden("heat-transfer")
    similar = RigScaling(pressure=5.0, supply=5.0)
    there = similar.scale_rig(par)._replace(ambient=5.0 * par.ambient, supply=5.0 * par.supply)
    for name, other in shown(there, similar).items():
        usual = shown(par)[name]
        # commands are rounded: an impact may come a moment later
        assert np.mean(np.abs(other - usual)) < 5e-5 * np.ptp(usual), name


@pytest.mark.parametrize("bore", [0.006, 0.2])
def test_a_hose_of_a_small_rig_leaves_as_large_a_part_of_the_dead_volume(bore):
    """A hose that held more than the dead volume would leave a chamber of less than nothing."""
    par = Parameters(line_delay=0.009, hose_bore=0.0035)
    par = par._replace(dead_volume_1=par.dead_volume_1 + hose_volume(par, 0))
    other = RigScaling.for_target(par, bore, None).scale_rig(par)
    shares = [hose_volume(one, 0) / one.dead_volume_1 for one in (par, other)]
    assert shares[0] == pytest.approx(shares[1])


def test_the_supply_pressure_is_that_of_the_condition():
    assert RigScaling.for_target(Parameters(), None, 50e5).scale_rig(Parameters()).supply == pytest.approx(50e5)
    assert set(DIMENSIONS) < set(Parameters._fields)


TRANSLATED = {
    "heat-transfer": {"conductance": "heat_conductance"},
    "critical-ratio": {"critical_ratio": "critical_ratio"},
    "valve-lag": {"time_constant": "valve_lag"},
    "line-delay": {"delay": "line_delay"},
    "chamber-leak": {"area": "leak_area"},
}


@pytest.mark.skipif(not CASES.is_dir(), reason="the shared cases are not here")
@pytest.mark.parametrize("case", ["case-01", "case-02", "case-03", "case-04", "case-11", "case-12", "case-15"])
def test_with_the_true_parameters_the_shared_valve_cases_come_out_at_the_sensor_noise(case):
    truth = json.loads((CASES / case / "truth.json").read_text())
    pipeline = tomllib.loads((CASES / case / "pipeline.toml").read_text())
    base, rig = truth["base"], pipeline["rig"]
    par = VESSEL._replace(
        supply=float(rig["supply_pressure"].split()[0]) * 1e5,
        dead_volume_1=float(rig["vessel"]["volume"].split()[0]) * 1e-6,
        effective_area=base["effective_area_at_10V"],
        overlap=base["overlap_V"],
        exponent=base["area_exponent"],
        **{TRANSLATED[e][k]: v for e, values in truth["hidden"].items() for k, v in values.items()},
    )
    for recording in (r for r in pipeline["recordings"] if r["experiment"] == "valve"):
        table = rows(CASES / case / recording["file"])
        model = simulate_rig(par, Excitation(table[:, 1], pressure_1=par.ambient))["p1"] - par.ambient
        # white noise of that level, plus hum (the shared cases: up to 0.5 of it) where the supply's sensor shows it
        floor = np.std(table[:, 2] * 1e5)
        assert np.sqrt(np.mean((table[:, 3] * 1e5 - model) ** 2)) / floor == pytest.approx(1.0, abs=0.12)


# --- a machine that drives the piston: the force that it needs, by the balance of forces


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
