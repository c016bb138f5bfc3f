"""Every effect that an exam may hide changes what is recorded, in proportion to its size, and vanishes at size zero."""

from functools import cache

import numpy as np
import pytest

from pneucli.exam.hidden_effects import CATALOGUE, UNCATALOGUED
from pneucli.exam.rig.excitations import closed_loop, two_sine_reference, valve_staircase
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.sensors import Sensors, measure
from pneucli.exam.rig.simulation import simulate_rig

# no heat-transfer: it is not nested; the model without it has a constant temperature instead
SCALED = [effect for effect in CATALOGUE + UNCATALOGUED if effect.null_values]
QUIET = Sensors(pressure=0.0, acceleration=0.0, position_step=0.0)


@cache  # without an effect it is the same for most of them
def recorded(par: Parameters, kind: str) -> dict[str, np.ndarray]:
    if kind == "valve":
        par = par._replace(piston_area_1=0.0, piston_area_2=0.0, dead_volume_1=160e-6)
        return measure(par, QUIET, simulate_rig(par, valve_staircase(par, 0.5, 2.0)), np.random.default_rng(0))
    reference = two_sine_reference(np.random.default_rng(1), 2000)
    return measure(par, QUIET, simulate_rig(par, closed_loop(par, reference, 150.0, 1.8e5)), np.random.default_rng(0))


def change(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> float:
    """Largest change, in units of the noise of ordinary sensors (400 Pa, 0.05 m/s^2, 10 um)."""
    pressure = max(np.max(np.abs(one[p] - other[p])) / 400.0 for p in ("p1", "p2"))
    return max(pressure, np.max(np.abs(one["a"] - other["a"])) / 0.05, np.max(np.abs(one["x"] - other["x"])) / 1e-5)


@pytest.mark.parametrize("effect", SCALED, ids=lambda e: e.name)
def test_an_effect_is_visible_at_full_size_and_not_at_almost_none(effect):
    par = Parameters(overlap=0.0 if effect.name == "valve-deadband" else 0.2, switching=effect.name == "switching-time")
    for kind in set(effect.kinds) - {"friction"}:
        without = recorded(par, kind)
        assert change(recorded(effect.apply(par, 1.0, np.random.default_rng(2)), kind), without) > 5.0
        if not effect.inverse:
            tiny = change(recorded(effect.apply(par, 1e-9, np.random.default_rng(2)), kind), without)
            assert tiny < 0.5, kind
