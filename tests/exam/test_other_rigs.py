"""Rigs as others have them: what their pipeline files state, and what their recordings contain."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneucli.exam.cases import generate_case
from pneucli.exam.conditions import parse
from pneucli.exam.rig.excitations import SteadyRows, simulate_steady_rows
from pneucli.exam.rig.gas import EXPONENT, GAS_CONSTANT, SPEED_OF_SOUND
from pneucli.exam.rig.parameters import FIVE_THREE, Parameters
from pneucli.exam.rig.sensors import Sensors, measure
from pneucli.exam.rig.simulation import Excitation, command_stamps, simulate_rig
from pneucli.notebook.run import open_pipeline_of
from tests.exam.written import columns

pytestmark = pytest.mark.usefixtures("a_quarter")

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
