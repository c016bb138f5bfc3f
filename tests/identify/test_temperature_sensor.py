"""A sensor of the gas temperature, which may be slow. The exam's rig records it and shares no code with the model."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

from pneucli.exam.rig.excitations import valve_step
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.simulation import simulate_rig
from pneucli.identify.estimation import model_fit
from pneucli.identify.estimation.fit import Fit
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.residuals import residual_models
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.recording import Recording, Rig
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare

VESSEL = Parameters(piston_area_1=0.0, piston_area_2=0.0, dead_volume_1=160e-6, heat_conductance=0.3)
RIG = Rig(ambient_pressure=VESSEL.ambient, supply_pressure=VESSEL.supply, vessel_volume=160e-6)
NOISE = {"p1": 250.0, "temperature": 0.5}
SENSOR = "heat-transfer.sensor_time_constant"


def charge_and_discharge(command: float, time_constant: float, rng: np.random.Generator) -> Recording:
    """Pressure and gas temperature, read by a sensor of first order with this time constant."""
    move = valve_step(VESSEL, command)
    seen = simulate_rig(VESSEL, move)
    time, gas = 1e-3 * np.arange(seen["p1"].size), seen["temperature"]
    if time_constant:
        (b,), a, _ = cont2discrete(([1.0], [time_constant, 1.0]), 1e-3, method="foh")
        gas = gas[0] + lfilter(b, a, gas - gas[0])
    read = {
        name: s + NOISE[name] * rng.standard_normal(time.size) for name, s in (("p1", seen["p1"]), ("temperature", gas))
    }
    noise = {name: NoiseModel(rms) for name, rms in NOISE.items()}
    return Recording(f"{command} V", "valve", "train", time, {"u": move.command[: time.size], **read}, noise)


def fitted(time_constant: float) -> Fit:
    rng = np.random.default_rng(3)
    experiments = [prepare(charge_and_discharge(u, time_constant, rng), RIG, 0.5) for u in (2.0, 5.0, 9.0)]
    start = guess_base_model(experiments, RIG)
    return model_fit.fit_model(start, residual_models(experiments), [catalogue()["heat-transfer"]])


def test_the_time_constant_of_a_slow_sensor_is_found_beside_the_heat() -> None:
    found = fitted(0.4)
    sensor, heat = found[SENSOR], found["heat-transfer.conductance"]
    assert sensor.value == pytest.approx(0.4, rel=0.05)
    assert heat.value == pytest.approx(0.3, rel=0.05)


def test_a_fast_sensor_has_no_time_constant() -> None:
    found = fitted(0.0)
    assert SENSOR not in {e.name for e in found.estimates}
    assert found["heat-transfer.conductance"].value == pytest.approx(0.3, rel=0.05)


def test_without_a_recorded_temperature_no_time_constant_is_sought(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each fit of it would take as long as that of the heat."""
    rng, starts = np.random.default_rng(3), []
    tests = [charge_and_discharge(u, 0.4, rng) for u in (2.0, 9.0)]
    tests = [replace(one, signals={n: s for n, s in one.signals.items() if n != "temperature"}) for one in tests]
    experiments = [prepare(one, RIG, 0.5) for one in tests]
    real = model_fit.fit

    def noted(model: Model, *given: Any, **more: Any) -> Fit:
        starts.append(SENSOR in model.values)
        return real(model, *given, **more)

    monkeypatch.setattr(model_fit, "fit", noted)
    model_fit.fit_model(
        guess_base_model(experiments, RIG), residual_models(experiments), [catalogue()["heat-transfer"]]
    )
    assert starts
    assert not any(starts)
