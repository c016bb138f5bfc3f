"""Open-loop scenarios: the model under a command of one's own, held to closed solutions; what is wrongly asked for."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.noise import NoiseModel
from pneucli.recording import Recording, Rig
from pneucli.simulate.model import Model
from pneucli.simulate.open_loop import default_free_runs, free_run, run_scenario
from pneucli.simulate.preparation import prepare
from pneucli.simulate.valve_forms import ValveArea

AREA = 2e-7  # m^2 at 10 V and at -10 V, linear from the closed centre
VALVE = ValveArea((-10.0, -5.0, 5.0, 10.0), (AREA, AREA / 2, AREA / 2, AREA), 0.0, 0.0)
RIG = Rig(supply_pressure=7e5, vessel_volume=1e-4)
CYLINDER = Rig(
    supply_pressure=7e5,
    piston_area_1=8e-4,
    piston_area_2=8e-4,
    stroke=0.2,
    dead_volume_1=3e-5,
    dead_volume_2=3e-5,
    moving_mass=2.0,
)
MODEL = Model(RIG, (), {"rig.vessel_volume": 1e-4}, VALVE)
AXIS = Model(CYLINDER, (), {"friction.coulomb": 15.0, "friction.viscous": 40.0}, VALVE)
WHERE = "bench.toml, key scenarios.1"


def test_a_vessel_charged_through_a_choked_valve_rises_along_a_straight_line() -> None:
    # thesis 2.22 with 2.46 and Psi0 = 0.484 (2.37, 2.38): dp/dt = kappa R T / V * A p_S sqrt(2 / (R T)) Psi0
    gas = 287.0 * 293.15
    slope = 1.4 * gas / 1e-4 * AREA * 7e5 * np.sqrt(2 / gas) * 0.484
    run = run_scenario(MODEL, {"experiment": "valve", "values": ["10 V"], "dwell": "0.1 s"}, {}, WHERE)
    choked = (run.modelled["p1"] < 0.5 * 7e5) & (run.time > 0.005)
    found = np.polyfit(run.time[choked], run.modelled["p1"][choked], 1)[0]
    assert choked.sum() > 30
    assert found == pytest.approx(slope, rel=2e-3)  # Psi0 is given with three digits


def test_a_held_valve_changes_nothing() -> None:
    run = run_scenario(AXIS, {"values": ["0 V"], "x": "70 mm", "p1": "3 bar", "p2": "3 bar"}, {}, WHERE)
    assert np.ptp(run.modelled["x"]) == 0.0
    assert run.modelled["x"][0] == 0.07
    np.testing.assert_allclose(run.modelled["p1"], 3e5, rtol=1e-9)


def test_filling_chamber_1_drives_the_piston_out_and_compresses_the_closed_chamber() -> None:
    run = run_scenario(AXIS, {"values": ["5 V"], "dwell": "0.5 s"}, {}, WHERE)
    assert run.modelled["x"][-1] > run.modelled["x"][0] + 0.02
    volume = 3e-5 + 8e-4 * (0.2 - run.modelled["x"])
    # chamber 2 exchanges no gas: p V^kappa keeps (thesis 2.14)
    np.testing.assert_allclose(run.modelled["p2"] * volume**1.4, 101_325.0 * volume[0] ** 1.4, rtol=1e-3)


@pytest.mark.parametrize(
    ("table", "command"),
    [
        ({"values": ["1 V", "-2 V"], "dwell": "10 ms"}, np.repeat([1.0, -2.0], 10)),
        (
            {"command": "sine", "amplitude": "3 V", "offset": "1 V", "frequency": "5 Hz", "duration": "0.1 s"},
            1 + 3 * np.sin(2 * np.pi * 5 * np.arange(100) * 1e-3),
        ),
        ({"command": "ramp", "amplitude": "2 V", "duration": "0.1 s"}, np.linspace(-2, 2, 100)),
    ],
)
def test_the_command_is_the_one_asked_for(table: dict[str, object], command: np.ndarray) -> None:
    run = run_scenario(AXIS, table, {}, WHERE)
    np.testing.assert_allclose(run.commands["u"], command, atol=1e-12)


@pytest.mark.parametrize(
    ("table", "key", "mend"),
    [
        ({"amplitud": "1 V"}, "amplitud", 'did you mean "amplitude"?'),
        ({"command": "sin"}, "command", 'did you mean "sine"?'),
        ({"values": ["2 bar"]}, "values", "1 V"),
        ({"duration": "3 mm", "command": "ramp"}, "duration", "1 s"),
        ({}, "values", "2 V"),
        ({"recording": "axis_2"}, "recording", 'did you mean "axis_1"?'),
    ],
)
def test_what_cannot_be_read_is_named(table: dict[str, object], key: str, mend: str) -> None:
    with pytest.raises(InputError) as error:
        run_scenario(AXIS, table, {"axis_1": None}, WHERE)  # type: ignore[dict-item]
    assert error.value.where == f"{WHERE}.{key}"
    assert mend in str(error.value)


def recorded(name: str, use: str, model: Model = MODEL) -> Recording:
    """What the model itself does in a valve test, with the noise of a good sensor."""
    run = run_scenario(model, {"experiment": "valve", "values": ["8 V", "-8 V"], "dwell": "0.3 s"}, {}, WHERE)
    noise = 100 * np.random.default_rng(1).standard_normal(run.time.size)
    signals = {"u": run.commands["u"], "p1": run.modelled["p1"] + noise}
    models = {"u": NoiseModel(0.0), "p1": NoiseModel(100.0)}
    return Recording(name, "valve", use, run.time, signals, models)  # type: ignore[arg-type]


def test_a_free_run_of_the_right_model_stays_at_the_noise() -> None:
    run = free_run(MODEL, prepare(recorded("a", "test"), RIG, 0.05), "a")
    (p1,) = run.metrics()
    # the start is smoothed, and an error in it stays until the pressures saturate
    assert p1.rmsd == pytest.approx(100, rel=0.25)
    assert p1.fit_percent == pytest.approx(100 * (1 - p1.rmsd / run.measured["p1"].std()))


def test_a_free_run_shows_what_restarts_forget() -> None:
    smaller = replace(MODEL, valve=ValveArea(VALVE.commands, tuple(0.9 * a for a in VALVE.areas), 0.0, 0.0))
    run = free_run(smaller, prepare(recorded("a", "test"), RIG, 0.05), "a")
    assert (run.metrics()[0].rmsd or 0.0) > 1000


def test_test_recordings_run_by_default_and_imposed_motion_never() -> None:
    ready = [prepare(recorded(name, use), RIG, None) for name, use in (("a", "train"), ("b", "test"), ("c", "train"))]
    imposed = replace(ready[0], recording=replace(ready[0].recording, experiment="friction", imposed="motion"))
    assert [run.scenario for run in default_free_runs(MODEL, [*ready, imposed])] == ["b"]
    assert [run.scenario for run in default_free_runs(MODEL, [ready[0], ready[2]])] == ["a"]
