"""The turbulence of a leak: found where the decay shows it, and left out where the flow is laminar."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.identify.estimation.fit import Fit, fit
from pneucli.identify.estimation.model_fit import fit_with_effect
from pneucli.identify.estimation.parameters import base_parameters
from pneucli.identify.residuals import ChamberPressures
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from tests.simulate.synthetic_experiments import RIG, make_experiment, model

AMBIENT, R, T, KAPPA = 101_300.0, 287.0, 293.15, 1.4
VESSEL = replace(RIG, vessel_volume=1e-3, axis_recorded=False)
NOISE = 200.0  # Pa


def decay(linear: float, quadratic: float) -> tuple[np.ndarray, np.ndarray]:
    """A litre that empties from 8 bar, in Euler steps of 1 ms: p^2 - p_amb^2 = linear q + quadratic q^2."""
    pressure = [8e5]
    for _ in range(30_000):
        difference = pressure[-1] ** 2 - AMBIENT**2
        roots = np.roots([quadratic, linear, -difference]) if quadratic else np.array([difference / linear])
        pressure.append(pressure[-1] - 1e-3 * KAPPA * R * T / 1e-3 * float(np.max(roots.real)))
    return 0.01 * np.arange(3000), np.array(pressure[:30_000:10])


def fitted(linear: float, quadratic: float) -> Fit:
    time, clean = decay(linear, quadratic)
    read = clean + NOISE * np.random.default_rng(5).normal(size=time.size)
    made = make_experiment("valve", time, {"p1": read}, rig=VESSEL, valve_shut=True)
    made.inputs[:] = make_experiment("valve", time, {"p1": clean}, rig=VESSEL, valve_shut=True).inputs
    view = ChamberPressures(replace(made, noise={"p1": NoiseModel(NOISE)}))
    first = model(values={"rig.vessel_volume": 1e-3}, rig=VESSEL)
    base = fit(first, [view], base_parameters(first, [view.experiment]))
    return fit_with_effect(base, [view], catalogue()["laminar-leak"])


@pytest.mark.parametrize("turbulence", [0.02, 0.3])
def test_the_turbulence_of_a_leak_is_found(turbulence: float) -> None:
    linear = 2.0 * AMBIENT / 3e-9
    found = fitted(linear, turbulence * (linear / AMBIENT) ** 2)
    assert found["laminar-leak.conductance"].value == pytest.approx(3e-9, rel=0.02)
    assert found["laminar-leak.turbulence"].value == pytest.approx(turbulence, rel=0.05)
    assert found.residual.std() < 1.1


def test_a_laminar_leak_has_none() -> None:
    found = fitted(2.0 * AMBIENT / 3e-9, 0.0)
    assert found["laminar-leak.conductance"].value == pytest.approx(3e-9, rel=0.02)
    assert "laminar-leak.turbulence" not in found.model.values
