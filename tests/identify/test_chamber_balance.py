"""The gas of one chamber: its balance, and what more flow does to the pressure, against the simulation."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.identify.guesses.flow_paths import measured_gas, modelled_gas, pressure_deviation, sensor_error_deviation
from pneucli.identify.residuals import ChamberPressures
from pneucli.identify.residuals.chambers import play_operator
from pneucli.physics.gas import CRITICAL_RATIO, flow_constant
from pneucli.physics.vectorised import orifice_flows
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.run import run, simulate
from tests.simulate.synthetic_experiments import RIG, held_commands, make_experiment, model, time_grid

TIME = time_grid(1.0)
RESTARTS = (0, 400, 700)
BARE = model()
LEAK = 1e-8  # m^2, of an orifice to ambient


def moved(restarts: tuple[int, ...] = RESTARTS) -> Experiment:
    """A piston that is moved while its chambers are filled and vented, its pressures read."""
    x, v = 0.1 + 0.05 * np.sin(5.0 * TIME), 0.25 * np.cos(5.0 * TIME)
    u = held_commands(TIME, (3.0, -4.0, 2.0, -1.0), 0.25)
    signals = {"u": u, "u2": -u, "x": x, "v": v, "p1": 3e5, "p2": 3e5}
    e = make_experiment("axis", TIME, signals, chamber_2="valve", restarts=restarts)
    given = e.flags.copy()
    given[at.MECHANICS] = 0.0
    return replace(e, flags=given)


def followed(e: Experiment, names: tuple[str, ...] = (), values: dict[str, float] | None = None) -> np.ndarray:
    """What a model makes of it."""
    return run(model(names, values), e)


def test_the_balance_gives_the_flow_of_the_valve() -> None:
    """Within 1 % of its largest, but at the samples where the command jumps, which a difference smears."""
    e = moved()
    out = followed(e)
    gas = modelled_gas(e, RIG, 1, 1.0, out[:, at.P1])
    jumps = np.abs(np.subtract.outer(np.arange(TIME.size), np.flatnonzero(np.diff(e.raw["u"])))).min(axis=1) < 3
    largest = float(np.max(np.abs(out[:, at.FLOW])))
    assert gas.flow[~jumps] == pytest.approx(out[~jumps, at.FLOW], abs=0.01 * largest)


def test_swept_gas_and_volume_are_those_of_the_motion() -> None:
    e = moved()
    for chamber, area, dead, sign in (
        (1, RIG.piston_area_1, RIG.dead_volume_1, 1.0),
        (2, RIG.piston_area_2, RIG.dead_volume_2, -1.0),
    ):
        gas = measured_gas(e, RIG, chamber, 1.0)  # type: ignore[arg-type]
        reach = e.raw["x"] if chamber == 1 else RIG.stroke - e.raw["x"]  # type: ignore[operator]
        assert gas.volume == pytest.approx(dead + area * reach)
        assert gas.swept_flow == pytest.approx(
            3e5 * sign * area * e.raw["v"] / (RIG.gas_constant * RIG.gas_temperature)
        )


def test_what_a_leak_takes_is_what_the_simulation_makes_of_it() -> None:
    """To first order: 5 % of the largest of some kPa between restarts, each of them less than 3 % of the pressure."""
    e = moved()
    bare, leaking = (followed(e, n, {"chamber-leak.area": LEAK})[:, at.P1] for n in ((), ("chamber-leak",)))
    nudged = e.inputs.copy()
    nudged[:, [at.IN_P1, at.IN_P2]] += 50.0
    fading = simulate(BARE, e, nudged)["p1"] - simulate(BARE, e)["p1"]
    k = flow_constant(RIG.gas_constant, RIG.gas_temperature, RIG.heat_capacity_ratio)
    flow = -LEAK * orifice_flows(leaking, np.full(TIME.size, RIG.ambient_pressure), CRITICAL_RATIO, k, k)
    found = pressure_deviation(e, modelled_gas(e, RIG, 1, 1.0, bare), flow[None], fading)[0]
    most = float(np.max(np.abs(leaking - bare)))
    assert 1e3 < most < 0.03 * 3e5
    assert found == pytest.approx(leaking - bare, abs=0.05 * most)


def test_each_segment_starts_anew() -> None:
    e = moved()
    gas = modelled_gas(e, RIG, 1, 1.0, followed(e)[:, at.P1])
    found = pressure_deviation(e, gas, np.full((2, TIME.size), 1e-5), np.ones(TIME.size))
    assert np.all(found[:, list(RESTARTS)] == 0.0)
    assert np.all(found[:, [399, 699, 1000]] > 0.0)


def test_a_flow_acts_on_its_own_chamber() -> None:
    """Ways of the flow into chamber 2 are those of its own gas and command."""
    e = moved()
    view = ChamberPressures(e)
    view.__dict__.update(noise={"p1": 100.0, "p2": 100.0}, channels=("p1", "p2"))
    first, second = (view.discrepancy_terms(BARE, name) for name in ("p1", "p2"))
    names = [way.name for way in first]
    assert names[:3] == ["flow", "share of the flow", "share of the swept volume"]
    swept = {name: ways[2].unit_signal for name, ways in (("p1", first), ("p2", second))}
    assert np.all(np.sign(swept["p1"]) == -np.sign(swept["p2"]))
    assert [way.argument for way in first] == [*[None] * 3, *["u"] * (len(first) - 4), "p1"]
    assert [way.argument for way in second][-1] == "p2"
    assert np.all(first[0].to_residual(np.full((1, TIME.size), 1e-5))[0, [399, 699, 1000]] > 0.0)


def test_a_wrong_reading_also_makes_a_wrong_initial_state() -> None:
    """Readings wrong by up to 60 Pa: measured less simulated, which starts from them, within 2 % of that."""
    e = moved()
    wrong = 60.0 * np.sin(7.0 * TIME)
    read = e.inputs.copy()
    read[:, at.IN_P1] += wrong
    left = wrong - (simulate(BARE, e, read)["p1"] - simulate(BARE, e)["p1"])
    nudged = e.inputs.copy()
    nudged[:, at.IN_P1] += 50.0
    fading = simulate(BARE, e, nudged)["p1"] - simulate(BARE, e)["p1"]
    assert sensor_error_deviation(e, wrong[None], fading)[0] == pytest.approx(left, abs=1.2)
    view = ChamberPressures(e)
    view.__dict__.update(noise={"p1": 100.0, "p2": 100.0}, channels=("p1", "p2"), whiten_initial_state=False)
    way = view.discrepancy_terms(BARE, "p1")[-1]
    assert (way.name, way.unit) == ("error of its sensor", "Pa")
    assert way.to_residual(wrong[None])[0] == pytest.approx(
        sensor_error_deviation(e, wrong[None], np.ones(TIME.size))[0] / 100.0
    )


def test_a_sensor_error_is_a_function_of_the_modelled_reading() -> None:
    """Of what was measured all that the model lacks is a part, and an error of the whole reading would explain that."""
    time = time_grid(2.0)
    held = 3e5 + 2e4 * np.sin(time)  # a shut chamber whose pressure nothing in the model moves
    view = ChamberPressures(make_experiment("valve", time, {"p1": held}, valve_shut=True))
    view.__dict__.update(noise={"p1": 100.0}, channels=("p1",), whiten_initial_state=False)
    shut = model(values={"rig.vessel_volume": 1e-3})
    way = view.discrepancy_terms(shut, "p1")[-1]
    assert way.modelled == pytest.approx(simulate(shut, view.experiment)["p1"])
    assert np.ptp(way.to_residual(way.modelled[None])) < 0.01 * np.ptp(way.to_residual(held[None]))


def test_a_vessel_has_no_swept_volume() -> None:
    """Its ways are those of a chamber all the same: one law goes over recordings of both."""
    u = held_commands(TIME, (3.0, -4.0), 0.5)
    vessel, axis = ChamberPressures(make_experiment("valve", TIME, {"u": u, "p1": 3e5})), ChamberPressures(moved())
    for view in (vessel, axis):
        view.__dict__.update(noise={"p1": 100.0}, channels=("p1",))
    ways = [view.discrepancy_terms(model(values={"rig.vessel_volume": 1e-3}), "p1") for view in (vessel, axis)]
    assert [(way.name, way.unit, way.argument) for way in ways[0]] == [
        (way.name, way.unit, way.argument) for way in ways[1]
    ]
    assert not np.any(ways[0][2].unit_signal)
    assert np.any(ways[1][2].unit_signal)


def test_a_play_drags_behind() -> None:
    """From -1 to 1: 1 where it fills more than before or vents less, and what turns within the play is in between."""
    opening = np.array([2.0, 3.0, 2.5, 2.0, 1.0, -2.0, -1.5])  # a range of 5
    assert play_operator(opening, 0.1) == pytest.approx([0.0, 1.0, 0.0, -1.0, -1.0, 1.0, 0.0])


def test_a_command_that_stays_drags_nothing() -> None:
    assert not np.any(play_operator(np.full(5, 3.0), 0.1))
