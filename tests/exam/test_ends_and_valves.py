"""Ends, valves and other rigs: contact pushes only, gas and energy are kept, each arrangement moves the piston."""

import tomllib
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneucli.exam.cases import generate_case
from pneucli.exam.conditions import parse
from pneucli.exam.laboratory import Laboratory
from pneucli.exam.rig.excitations import SteadyRows, closed_loop, simulate_steady_rows, valve_step
from pneucli.exam.rig.gas import EXPONENT, GAS_CONSTANT, KAPPA, SPEED_OF_SOUND
from pneucli.exam.rig.kernel import end_stop_force
from pneucli.exam.rig.parameters import FIVE_THREE, TWO_VALVES, Parameters
from pneucli.exam.rig.sensors import Sensors, measure
from pneucli.exam.rig.simulation import Excitation, command_stamps, simulate_rig
from pneucli.notebook.run import open_pipeline_of
from tests.exam.written import columns, rows

pytestmark = pytest.mark.usefixtures("a_quarter")

RIG = Parameters(overlap=0.2, effective_area_2=1.6e-6, overlap_2=0.3, exponent_2=1.2)
FREE = Parameters(coulomb=0.0, viscous=0.0, stop_damping=0.0)


def thrown(par: Parameters, velocity: float, seconds: float = 0.1) -> dict[str, np.ndarray]:
    """The piston flies toward x = 0 between chambers at ambient pressure that are held there."""
    still = np.full((round(seconds * 1e3), 2), par.ambient)
    return simulate_rig(
        par, Excitation(np.zeros(len(still)), position=0.01, velocity=-velocity, imposed=still), 10_000.0
    )


def test_contact_pushes_away_from_either_end_and_never_pulls():
    par = Parameters()
    assert (
        end_stop_force(par, 0.1, 5.0) == end_stop_force(par, 0.0, -1.0) == end_stop_force(par, par.stroke, 1.0) == 0.0
    )
    assert end_stop_force(par, -1e-5, 0.0) == pytest.approx(par.stop_stiffness * 1e-5)
    assert end_stop_force(par, par.stroke + 1e-5, 0.0) == pytest.approx(-par.stop_stiffness * 1e-5)
    # leaving faster than the end comes after: the damper would pull
    assert end_stop_force(par, -1e-5, 1.0) == end_stop_force(par, par.stroke + 1e-5, -1.0) == 0.0


def test_an_end_without_damping_gives_the_whole_velocity_back():
    seen = thrown(FREE, 0.5)
    assert seen["v"][-1] == pytest.approx(0.5, rel=1e-3)
    assert -2e-3 < seen["x"].min() < -2e-4


def test_damping_takes_the_bounce():
    left = [thrown(FREE._replace(stop_damping=d), 0.5)["v"][-1] for d in (0.0, 500.0, 1500.0, 6e3)]
    assert all(0.0 <= after < before for before, after in pairwise(left))
    assert left[-1] < 0.1


def test_pressed_against_an_end_the_piston_rests_where_the_end_carries_the_force():
    par = Parameters()
    pressures = np.column_stack([np.full(400, 1.5e5), np.full(400, 4.5e5)])
    seen = simulate_rig(par, Excitation(np.zeros(400), position=0.002, imposed=pressures))
    carried = -par.stop_stiffness * seen["x"][-1]
    assert carried == pytest.approx(par.piston_area_1 * 3e5, abs=par.coulomb)
    assert seen["v"][-1] == 0.0


def test_energy_is_kept_by_adiabatic_chambers_a_free_piston_and_elastic_ends():
    par = FREE._replace(heat_conductance=0.0, piston_area_2=6e-4, dead_volume_1=60e-6)
    seen = simulate_rig(par, Excitation(np.zeros(600), position=0.1, pressure_1=6e5, pressure_2=1.1e5), 10_000.0)
    assert seen["x"].max() > par.stroke  # it meets an end
    volume_1 = par.dead_volume_1 + par.piston_area_1 * seen["x"]
    volume_2 = par.dead_volume_2 + par.piston_area_2 * (par.stroke - seen["x"])
    inner = (seen["p1"] * volume_1 + seen["p2"] * volume_2) / (KAPPA - 1)
    rod = par.ambient * (par.piston_area_1 - par.piston_area_2) * seen["x"]
    pressed = np.maximum(-seen["x"], 0.0) + np.maximum(seen["x"] - par.stroke, 0.0)
    total = inner + rod + 0.5 * par.mass * seen["v"] ** 2 + 0.5 * par.stop_stiffness * pressed**2
    assert np.ptp(total) < 2e-3 * np.max(0.5 * par.mass * seen["v"] ** 2)


def test_gas_that_leaks_past_the_moving_piston_is_neither_lost_nor_made():
    par = Parameters(heat_conductance=0.4, piston_leak_area=2e-7)
    seen = simulate_rig(par, Excitation(np.zeros(1500), position=0.1, pressure_1=5e5, pressure_2=2e5), 1000.0)
    volume_1 = par.dead_volume_1 + par.piston_area_1 * seen["x"]
    volume_2 = par.dead_volume_2 + par.piston_area_2 * (par.stroke - seen["x"])
    mass_1 = seen["p1"] * volume_1 / (GAS_CONSTANT * seen["temperature"])
    mass_2 = seen["p2"] * volume_2 / (GAS_CONSTANT * seen["temperature_2"])
    assert mass_1 + mass_2 == pytest.approx(np.full(1500, mass_1[0] + mass_2[0]), rel=1e-6)
    assert mass_1[0] - mass_1[-1] > 0.05 * mass_1[0]
    assert np.ptp(seen["x"]) > 0.01


def test_a_tank_loses_what_the_vessel_gains():
    """With constant temperature both pressures follow kappa R T q / V."""
    par = Parameters(piston_area_1=0.0, dead_volume_1=160e-6, supply_volume=1e-3, regulator_conductance=0.0)
    seen = simulate_rig(par, Excitation(np.full(800, 10.0), pressure_1=par.ambient))
    gained, lost = 160e-6 * np.diff(seen["p1"]), -1e-3 * np.diff(seen["p_supply"])
    assert gained == pytest.approx(lost, rel=1e-6)
    assert seen["p1"][-1] == pytest.approx(seen["p_supply"][-1], rel=1e-3)


@pytest.mark.parametrize(("volts", "first"), [(7.0, "p1"), (3.0, "p2")])
def test_the_spool_of_a_5_3_valve_fills_one_chamber_and_vents_the_other(volts, first):
    par = RIG._replace(arrangement=FIVE_THREE, command_null=5.0, command_range=5.0, coulomb=1e4)
    seen = simulate_rig(par, Excitation(np.full(300, volts - 5.0), position=0.1, pressure_1=3e5, pressure_2=3e5))
    other = "p2" if first == "p1" else "p1"
    assert np.all(seen["u"] == volts)
    assert seen[first][-1] > 3.5e5
    assert seen[other][-1] < 2.5e5


def test_at_its_null_the_5_3_valve_shuts_both_chambers():
    par = RIG._replace(arrangement=FIVE_THREE, command_null=5.0, command_range=5.0)
    seen = simulate_rig(par, Excitation(np.zeros(200), position=0.1, pressure_1=3e5, pressure_2=3e5))
    assert np.ptp(seen["p1"]) == np.ptp(seen["p2"]) == 0.0


def test_two_valves_follow_their_own_commands():
    par = RIG._replace(arrangement=TWO_VALVES, coulomb=1e4)
    seen = simulate_rig(
        par, Excitation(np.zeros(300), command_2=np.full(300, 4.0), position=0.1, pressure_1=3e5, pressure_2=3e5)
    )
    assert np.ptp(seen["p1"]) == 0.0
    assert seen["p2"][-1] > 3.5e5
    assert np.all(seen["u2"] == 4.0)


def test_a_switching_valve_is_open_or_shut():
    par = RIG._replace(switching=1.0, command_range=24.0, piston_area_1=0.0, dead_volume_1=160e-6)
    half, full = (simulate_rig(par, valve_step(par, volts))["p1"] for volts in (12.0, 24.0))
    assert np.array_equal(half, full)  # its amplifier knows no half


def test_a_switching_valve_opens_and_closes_late_by_its_own_times():
    par = RIG._replace(switching=1.0, command_range=24.0, piston_area_1=0.0, dead_volume_1=160e-6)
    slow = par._replace(opening_time=0.02, closing_time=0.03)
    pulse = np.repeat([0.0, 24.0, 0.0, 24.0, 0.0], [50, 30, 100, 15, 100])
    filled, late = (np.diff(simulate_rig(one, Excitation(pulse, pressure_1=2e5))["p1"]) > 0.0 for one in (par, slow))
    assert np.flatnonzero(filled[:150])[[0, -1]].tolist() == [50, 79]
    assert np.flatnonzero(late)[[0, -1]].tolist() == [70, 109]  # the second pulse is too short for its coil


@pytest.mark.parametrize("arrangement", [FIVE_THREE, TWO_VALVES])
def test_the_bench_of_chamber_2_has_the_edges_of_chamber_2(arrangement):
    par = RIG._replace(arrangement=arrangement, coulomb=1e4)
    bench = Laboratory("rig", par, Sensors(), vessel_volume=100e-6).valve_test_rig(2)
    tested = simulate_rig(bench, Excitation(np.full(100, 5.0), pressure_1=2e5))
    # the cylinder's own chamber 2, whose valve opens toward it
    second = np.full(100, 5.0)
    command = -second if arrangement == FIVE_THREE else 0 * second
    held = par._replace(dead_volume_2=100e-6 - par.piston_area_2 * 0.1)
    seen = simulate_rig(held, Excitation(command, command_2=second, position=0.1, pressure_1=2e5, pressure_2=2e5))
    assert tested["p1"] == pytest.approx(seen["p2"], rel=1e-6)
    assert np.all(tested["u"] == (-5.0 if arrangement == FIVE_THREE else 5.0))


@pytest.mark.parametrize("arrangement", [FIVE_THREE, TWO_VALVES])
def test_a_loop_around_both_chambers_follows_its_reference(arrangement):
    par = RIG._replace(arrangement=arrangement)
    reference = np.interp(np.arange(3000), [0, 500, 3000], [0.1, 0.14, 0.14])
    seen = simulate_rig(par, closed_loop(par, reference, 75.0, 3e5))
    assert seen["x"][-1] == pytest.approx(0.14, abs=8e-3)


def test_springs_and_weights_are_in_the_pipeline_file_and_balanced_at_the_start(tmp_path):
    for name, effect in (("return-spring", "spring-force"), ("hanging-load", "constant-force")):
        generate_case(tmp_path / name, "axis", [], "", 1.0, 4, parse(name))
        pipeline = tomllib.loads((tmp_path / name / "pipeline.toml").read_text())
        assert effect in pipeline["model"]["effects"]
        table = rows(tmp_path / name / "raw" / "axis_1.csv")
        assert np.ptp(table[:5, 5]) < 0.01  # mm: it does not fall
    assert not parse("return-spring").allows("spring-force")


@pytest.mark.parametrize(("name", "least"), [("ends", 0.2), ("5/3+ends", 0.2), ("return-spring+ends", 0.4)])
def test_the_piston_rests_at_its_ends_and_the_truth_has_the_share(tmp_path, name, least):
    truth = generate_case(tmp_path / "case", "axis", [], "", 1.0, 6, parse(name))
    assert least < max(truth["share_at_ends"].values()) < 0.95
    assert set(truth["share_at_ends"]) == {"axis_1", "axis_2", "axis_3", "axis_4"}


def test_a_stroke_that_is_not_exact_keeps_the_volume_at_the_other_end():
    volumes = []
    for stated in (None, 0.201):
        laboratory = Laboratory("rig", Parameters(), Sensors(), stated_stroke=stated)
        cylinder = tomllib.loads(laboratory.pipeline([], "raw"))["rig"]["cylinder"]
        stroke, area, dead = (float(cylinder[k].split()[0]) for k in ("stroke", "piston_area_2", "dead_volume_2"))
        assert stroke == pytest.approx(200.0 if stated is None else 201.0)
        volumes.append(dead + area * stroke / 10)  # cm^3
    assert volumes[0] == pytest.approx(volumes[1])


# --- rigs as others have them: what their pipeline files state, and what their recordings contain

PAR = Parameters()
VESSEL = Parameters(piston_area_1=0.0, piston_area_2=0.0, dead_volume_1=160e-6)


def case(folder: Path, kind: str, name: str, hidden: tuple[str, ...] = ()) -> tuple[dict[str, Any], dict[str, Any]]:
    truth = generate_case(folder, kind, hidden, "", 1.0, 5, parse(name))
    return truth, tomllib.loads((folder / "pipeline.toml").read_text())


# --- gas and valve


def test_gas_between_walls_is_neither_isothermal_nor_adiabatic() -> None:
    """After a fast charge the pressure falls by the cooling of the gas, less than from adiabatic to isothermal."""
    charge = Excitation(np.repeat([10.0, 0.0], [150, 2000]), pressure_1=PAR.ambient)
    walls, adiabatic = (
        simulate_rig(VESSEL._replace(effective_area=2e-6, **given), charge)
        for given in ({"wall_coefficient": 40.0}, {"heat_conductance": 0.0})
    )
    assert PAR.temperature + 5.0 < walls["temperature"][149] < adiabatic["temperature"][149] - 1.0
    assert walls["p1"][-1] / walls["p1"][150] == pytest.approx(
        walls["temperature"][-1] / walls["temperature"][150], rel=1e-4
    )
    assert walls["temperature"][-1] < walls["temperature"][150] - 10.0


# --- either side


def test_the_sensor_of_a_side_errs_alone() -> None:
    quiet = Sensors(pressure=0.0, acceleration=0.0, position_step=0.0)
    truth = {name: np.zeros(20) for name in ("u", "u2", "x", "a")}
    truth |= dict.fromkeys(("p1", "p2", "p_supply"), np.full(20, PAR.ambient + 2e5))
    par = PAR._replace(pressure_scale_1=1.1, pressure_scale_2=0.9, pressure_offset_2=1e3)
    seen = measure(par, quiet, truth, np.random.default_rng(1))
    assert (seen["p1"][0], seen["p2"][0]) == pytest.approx((2.2e5, 1.81e5))


@pytest.mark.parametrize("side", [1, 2])
def test_the_hose_of_a_side_delays_its_flow_alone(side: int) -> None:
    par = PAR._replace(arrangement=FIVE_THREE, effective_area_2=2e-6, coulomb=1e4)
    step = Excitation(np.full(60, 5.0), position=0.1, pressure_1=3e5, pressure_2=3e5)
    usual, late = (simulate_rig(one, step) for one in (par, par._replace(**{f"line_delay_{side}": 0.01})))
    mine, other = f"p{side}", f"p{3 - side}"
    assert late[other] == pytest.approx(usual[other])
    assert np.all(late[mine][:11] == 3e5)
    assert late[mine][12] - 3e5 == pytest.approx(usual[mine][2] - 3e5, rel=5e-3)


# --- commands on a clock of their own


def test_a_slow_controller_holds_its_command_and_its_log_has_every_one() -> None:
    ramp = Excitation(np.linspace(0.0, 5.0, 50), cycle=7)
    truth = simulate_rig(VESSEL, ramp)
    stamps, samples = command_stamps(ramp, 1000.0)
    assert stamps == pytest.approx(0.007 * np.arange(8))
    assert truth["u"][samples] == pytest.approx(ramp.command[::7])
    held = truth["u"][samples][np.arange(50) // 7]
    assert np.array_equal(truth["u"], held)
    assert command_stamps(Excitation(np.zeros(50), cycle=7), 4000.0)[0] == pytest.approx(stamps)


def test_held_commands_are_read_with_their_own_stamps(tmp_path: Path) -> None:
    _, said = case(tmp_path / "case", "valve", "held-commands")
    assert said["signals"]["u"] == {
        "column": "U_valve [V]", "unit": "V", "time": {"column": "t_cmd [ms]", "unit": "ms"}, "hold": True,
    }  # fmt: skip
    raw = columns(tmp_path / "case" / "raw" / "stairs_1.csv")
    stamps = raw["t_cmd_[ms]"][np.isfinite(raw["t_cmd_[ms]"])]
    assert np.unique(np.round(np.diff(stamps), 6)).tolist() in [[5.0], [10.0], [20.0]]
    run = open_pipeline_of(tmp_path / "case" / "pipeline.toml", tmp_path / "out")
    run.update(["ingest"])
    import pyarrow.parquet as pq

    read = pq.read_table(tmp_path / "out" / "ingest" / "signals.parquet").to_pandas()
    u = read[read["recording"] == "stairs_1"]["u"].to_numpy()
    held = raw["U_valve_[V]"][np.searchsorted(stamps, raw["t_[ms]"], side="right") - 1]
    assert u == pytest.approx(held)


# --- sources whose command sets no area


def test_a_regulator_gives_what_is_asked_less_a_droop_and_a_pump_what_its_speed_delivers() -> None:
    loop = PAR._replace(command_null=5.0, command_range=5.0, regulated_span=5e5, regulated_band=0.4e5, overlap=0.1)
    rows = SteadyRows(np.array([-2.5, 0.0, 2.5]), np.array([1e-8, 3e-7]))
    seen = simulate_steady_rows(loop, rows)
    asked = np.repeat([1.25e5, 2.5e5, 3.75e5], 2)
    droop = asked - (seen["p1"] - loop.ambient)
    assert seen["u"] == pytest.approx(np.repeat([2.5, 5.0, 7.5], 2))
    assert np.all((droop > 0.0) & (droop < 0.4e5))
    assert np.all(droop[1::2] > droop[::2])
    pump = PAR._replace(pump_flow=1e-3, pump_clearance=1.0 / 4e5)
    seen = simulate_steady_rows(pump, SteadyRows(np.array([5.0]), np.array([1e-8, 3e-7])))
    assert seen["flow"] == pytest.approx(0.5e-3 * (1.0 - (seen["p1"] - pump.ambient) / 4e5))
    assert np.all(seen["p_supply"] == pump.ambient)


def test_an_ejector_evacuates_the_vessel_and_ambient_air_fills_it(tmp_path: Path) -> None:
    """Its suction is proportional to the pressure above its end vacuum, before a vessel of 10 l."""
    truth, said = case(tmp_path / "case", "valve", "ejector")
    assert said["rig"]["source"]["kind"] == "ejector"
    assert float(said["rig"]["supply_pressure"].split()[0]) < 0.4
    assert not truth["unexplained_is_right"]
    par = VESSEL._replace(supply=0.3e5, supply_volume=1e-2, regulator_conductance=2e-8)
    seen = simulate_rig(par, Excitation(np.repeat([10.0, -10.0], 1500), pressure_1=par.ambient))
    assert seen["p1"].min() < 0.35e5
    assert seen["p1"][-1] == pytest.approx(par.ambient, rel=1e-3)
    assert seen["p_supply"][0] == par.supply
    removed = (par.ambient - seen["p1"][1499]) * par.dead_volume_1  # at constant temperature, per kappa R T
    settled = par.supply + removed / 1e-2  # before the ejector has removed any of it
    assert par.supply < seen["p_supply"][1499] < settled


# --- one speed for each recording


def test_a_machine_at_constant_speed_logs_one_point_of_the_friction_curve(tmp_path: Path) -> None:
    _, said = case(tmp_path / "case", "friction", "constant-speed")
    assert [r["imposed"] for r in said["recordings"]] == ["motion"] * 24
    assert sum(r["use"] == "test" for r in said["recordings"]) == 4
    speeds = []
    for recording in said["recordings"]:
        raw = columns(tmp_path / "case" / recording["file"])
        slope = np.polyfit(raw["t_[ms]"], raw["Pos_[mm]"], 1)[0]
        assert np.std(raw["Pos_[mm]"] - np.poly1d(np.polyfit(raw["t_[ms]"], raw["Pos_[mm]"], 1))(raw["t_[ms]"])) < 2e-3
        assert (slope > 0.0) == ("out" in recording["name"])
        assert raw["t_[ms]"].size >= 90
        speeds.append(abs(slope))
    assert max(speeds) / min(speeds) == pytest.approx(100.0, rel=0.02)


# --- hoses


def charged(**hose: float) -> np.ndarray:
    """The pressure of a vessel of 0.5 l that a valve fills from 20 ms on."""
    rig = VESSEL._replace(effective_area=2e-6, dead_volume_1=5e-4, **hose)
    return simulate_rig(rig, Excitation(np.repeat([0.0, 10.0], [20, 130]), pressure_1=PAR.ambient))["p1"]


def test_a_hose_lets_nothing_through_before_a_wave_has_passed_and_then_as_much_as_the_valve() -> None:
    plain, behind = charged(), charged(line_delay=0.01, hose_bore=6e-3)
    start = 20 + round(10.0 * SPEED_OF_SOUND / np.sqrt(EXPONENT * GAS_CONSTANT * PAR.temperature))
    assert np.ptp(behind[: start - 3]) < 0.02 * np.ptp(behind[: start + 10])
    assert behind[-1] - behind[-40] == pytest.approx(plain[-1] - plain[-40], rel=0.05)


def test_a_stated_volume_contains_the_hose() -> None:
    """Charged and shut, vessel and hose come to the pressure of the whole volume."""
    charge = Excitation(np.repeat([10.0, 0.0], [100, 900]), pressure_1=PAR.ambient)
    rig = VESSEL._replace(effective_area=1e-6, dead_volume_1=5e-4)
    plain, behind = (simulate_rig(one, charge)["p1"] for one in (rig, rig._replace(line_delay=0.005, hose_bore=6e-3)))
    assert behind[-1] == pytest.approx(plain[-1], rel=0.02)
