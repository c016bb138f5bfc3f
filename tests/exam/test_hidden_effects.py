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


@pytest.mark.parametrize("effect", SCALED, ids=lambda e: e.name)
def test_a_third_of_the_size_is_a_third_of_the_way_from_null(effect):
    par = Parameters()
    full, third = (effect.apply(par, size, np.random.default_rng(3)) for size in (1.0, 1 / 3))
    for field, value in effect.null_values.items():
        null = par.coulomb if field == "static" else value
        there, here = getattr(full, field), getattr(third, field)
        if effect.inverse:
            assert here == pytest.approx(3 * there)
        else:
            assert here - null == pytest.approx((there - null) / 3)


def test_where_friction_falls_with_speed_hysteresis_may_lose_no_more_than_the_rise():
    hysteresis = next(e for e in CATALOGUE if e.name == "friction-hysteresis")
    par = Parameters(coulomb=12.0, static=20.0)
    drops = [hysteresis.apply(par, 1.0, np.random.default_rng(seed)).drop for seed in range(40)]
    assert 10 <= drops.count(0.0) <= 30
    assert all(drop == 0.0 or 0.3 < drop < 0.6 for drop in drops)
    plain = [hysteresis.apply(Parameters(), 1.0, np.random.default_rng(seed)).drop for seed in range(10)]
    assert min(plain) > 0.3


def test_half_of_the_rigs_with_hysteresis_lose_viscous_friction_as_well():
    hysteresis = next(e for e in CATALOGUE if e.name == "friction-hysteresis")
    drops = [hysteresis.apply(Parameters(), 1.0, np.random.default_rng(seed)).viscous_drop for seed in range(40)]
    assert 10 <= drops.count(0.0) <= 30
    assert all(drop == 0.0 or 0.3 <= drop <= 0.5 for drop in drops)
