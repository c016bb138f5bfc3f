"""The rig's ends and valves: contact pushes only, gas and energy are kept, every arrangement moves the piston."""

import tomllib
from itertools import pairwise

import numpy as np
import pytest

from pneucli.exam.cases import generate_case
from pneucli.exam.conditions import parse
from pneucli.exam.laboratory import Laboratory
from pneucli.exam.rig.excitations import closed_loop, valve_step
from pneucli.exam.rig.gas import GAS_CONSTANT, KAPPA
from pneucli.exam.rig.kernel import end_stop_force
from pneucli.exam.rig.parameters import FIVE_THREE, TWO_VALVES, Parameters
from pneucli.exam.rig.sensors import Sensors
from pneucli.exam.rig.simulation import Excitation, simulate_rig
from tests.exam.written import rows

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


@pytest.mark.usefixtures("a_quarter")
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
