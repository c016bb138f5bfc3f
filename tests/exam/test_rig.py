"""The virtual rig against textbook results, and against the shared cases of another rig of the same kind."""

from __future__ import annotations

import json
import os
import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pneucli.exam.rig.kernel import GAS_CONSTANT, KAPPA, P1, PS, T1, flow, valve_flow
from pneucli.exam.rig.manoeuvres import stick_slip, valve_step
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.run import Manoeuvre, run
from pneucli.exam.rig.sensors import Sensors, measure

CASES = Path(os.environ.get("PNEUCLI_CASES", Path(__file__).parents[3] / "shared" / "cases"))
VESSEL = Parameters(piston_area_1=0.0, piston_area_2=0.0, dead_volume_1=160e-6)


def free(position: float = 0.1, velocity: float = 0.0, seconds: float = 1.0, **given: float) -> Manoeuvre:
    """Valve closed, chamber 2 open: nothing but what acts on the piston moves it."""
    return Manoeuvre(np.zeros(round(seconds * 1e3)), chamber_2_open=True, position=position, velocity=velocity, **given)


def imposed(par: Parameters, p1: np.ndarray, position: float = 0.1, velocity: float = 0.0) -> dict[str, np.ndarray]:
    pressures = np.column_stack([p1, np.full_like(p1, par.ambient)])
    return run(par, Manoeuvre(np.zeros(p1.size), position=position, velocity=velocity, imposed=pressures))


def test_a_choked_vessel_fills_at_the_rate_of_the_isentropic_chamber():
    par = VESSEL._replace(effective_area=1e-6, exponent=1.0)
    p = run(par, Manoeuvre(np.full(100, 10.0), pressure_1=par.ambient))["p1"]
    q = 1e-6 * par.supply * np.sqrt(2 / (GAS_CONSTANT * par.temperature)) * 0.484  # thesis 2.46
    assert np.diff(p) / 1e-3 == pytest.approx(KAPPA * GAS_CONSTANT * par.temperature * q / 160e-6, rel=1e-9)


def test_the_flow_function_is_continuous_at_the_critical_ratio_and_zero_without_a_difference():
    assert flow(1e-6, 5e5, 293.0, 0.528001 * 5e5, 0.528) == pytest.approx(flow(1e-6, 5e5, 293.0, 1e5, 0.528), rel=1e-6)
    assert flow(1e-6, 5e5, 293.0, 5e5, 0.528) == 0.0


def test_the_whole_curve_of_charge_and_discharge_agrees_with_scipy():
    par = VESSEL._replace(heat_conductance=0.5)
    move = valve_step(par, 5.0)
    seen = run(par, move)
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


def test_the_piston_sticks_exactly_below_coulomb_friction_and_breaks_away_above():
    par = Parameters(coulomb=20.0)
    held = imposed(par, np.full(500, par.ambient + 19.9 / par.piston_area_1))
    assert np.all(held["x"] == 0.1)
    assert imposed(par, np.full(500, par.ambient + 20.1 / par.piston_area_1))["x"][-1] > 0.1


def test_a_sliding_piston_stops_after_the_time_that_coulomb_friction_takes():
    par = Parameters(coulomb=20.0, viscous=0.0, mass=2.0)
    seen = imposed(par, np.full(300, par.ambient), velocity=1.0)
    assert seen["x"][-1] - 0.1 == pytest.approx(1.0**2 * 2.0 / (2 * 20.0), rel=1e-4)  # v^2 m / (2 F)
    assert np.flatnonzero(seen["v"] == 0.0)[0] == pytest.approx(100, abs=1)


def test_between_the_branches_of_the_hysteresis_the_velocity_is_kept():
    par = Parameters(coulomb=20.0, viscous=0.0, drop=0.5)
    seen = imposed(par, np.full(100, par.ambient + 15.0 / par.piston_area_1), velocity=0.2)
    assert np.all(seen["v"] == 0.2)


def test_stick_slip_starts_at_static_friction_and_never_creates_energy():
    par = Parameters(coulomb=12.0, static=20.0, stribeck_velocity=0.015)
    seen = run(par, stick_slip(par, 1e4))
    first = np.flatnonzero(seen["v"] > 0)[0]
    assert (seen["p1"][first - 1] - par.ambient) * par.piston_area_1 == pytest.approx(20.0, rel=0.01)
    work = np.trapezoid((seen["p1"] - par.ambient) * par.piston_area_1, seen["x"])
    assert 0.5 * par.mass * np.max(seen["v"]) ** 2 < work


def test_presliding_is_a_spring_before_it_slides():
    par = Parameters(coulomb=20.0, bristle_stiffness=5e4, bristle_damping=100.0)
    seen = imposed(par, np.full(2000, par.ambient + 5.0 / par.piston_area_1))
    level = 20.0
    # dz/dt = v - stiffness |v| z / level, v >= 0: x = -(level/stiffness) ln(1 - F/level) at rest, if approached slowly
    assert 5.0 / 5e4 < seen["x"][-1] - 0.1 < 4 * -(level / 5e4) * np.log(1 - 5.0 / level)


def test_a_piston_leak_ends_at_equal_pressures():
    par = Parameters(piston_leak_area=2e-7, coulomb=500.0)
    seen = run(par, Manoeuvre(np.zeros(4000), position=0.1, pressure_1=4e5, pressure_2=2e5))
    assert seen["p1"][-1] == pytest.approx(seen["p2"][-1], rel=1e-3)


def test_a_line_delay_shifts_the_whole_curve_while_the_flow_is_choked():
    at_once = run(VESSEL, valve_step(VESSEL, 3.0))["p1"]
    later = run(VESSEL._replace(line_delay=0.01), valve_step(VESSEL, 3.0))["p1"]
    assert later[160:400] == pytest.approx(at_once[150:390], rel=1e-9)


def test_sensors_do_what_their_parameters_say():
    par = Parameters(
        pressure_offset=5e3, pressure_scale=1.1, pressure_lag=0.02, pressure_skew=0.005, acceleration_bias=0.3
    )
    ramp = par.ambient + 1e5 * np.arange(1000) * 1e-3
    truth = {name: np.zeros(1000) for name in ("u", "x", "a")} | dict.fromkeys(("p1", "p2", "p_supply"), ramp)
    seen = measure(par, Sensors(pressure=0.0, acceleration=0.0), truth, np.random.default_rng(1))
    # a lag and a delay both shift a ramp, by 20 ms and 5 ms
    assert seen["p1"][500:] == pytest.approx(1.1e5 * (np.arange(500, 1000) * 1e-3 - 0.025) + 5e3, abs=1.0)
    assert seen["p2"][500:] == pytest.approx(1.1e5 * (np.arange(500, 1000) * 1e-3 - 0.025), abs=1.0)
    assert np.all(seen["a"] == 0.3)


@pytest.mark.parametrize("pole", [0.0, 0.5, 0.8])
def test_pressure_noise_has_its_level_and_colour(pole):
    n = 40_000
    truth = {name: np.zeros(n) for name in ("u", "x", "a")} | {
        p: np.full(n, 101_300.0) for p in ("p1", "p2", "p_supply")
    }
    noise = measure(Parameters(), Sensors(pressure=400.0, pole=pole), truth, np.random.default_rng(2))["p1"]
    assert np.std(noise) == pytest.approx(400.0, rel=0.05)
    assert np.corrcoef(noise[1:], noise[:-1])[0, 1] == pytest.approx(pole, abs=0.02)


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
        table = np.genfromtxt(CASES / case / recording["file"], delimiter=",", skip_header=3)
        model = run(par, Manoeuvre(table[:, 1], pressure_1=par.ambient))["p1"] - par.ambient
        # white noise of that level, plus hum (the shared cases: up to 0.5 of it) where the supply's sensor shows it
        floor = np.std(table[:, 2] * 1e5)
        assert np.sqrt(np.mean((table[:, 3] * 1e5 - model) ** 2)) / floor == pytest.approx(1.0, abs=0.12)


def test_a_piston_without_cushions_loses_its_velocity_at_the_stop_that_it_hits():
    """From 3 m/s the air spring of chamber 1 then pushes it back slowly."""
    seen = run(Parameters(), free(position=0.01, velocity=-3.0, seconds=0.03, pressure_1=101_300.0))
    assert 0.0 <= seen["x"].min() < 1e-5
    assert np.abs(seen["v"][5:]).max() < 0.5
