"""Leaks as people state them, against numbers worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.identify.leak_rate import leak_flows, normal_flow, pressure_losses
from pneucli.recording import Rig
from tests.simulate.synthetic_experiments import make_experiment, model, time_grid

RIG = Rig(ambient_pressure=1e5, gas_temperature=293.15, vessel_volume=2e-3)
TIME = time_grid(100.0)[::100]
FALLING = np.linspace(6e5, 5e5, TIME.size)


def test_a_shut_vessel_gives_its_leak_for_isothermal_and_adiabatic_gas() -> None:
    """2 l losing 1 bar in 100 s: 2e-3 x 1000 Pa/s / (287 x 293.15) kg/s, over 1.185 kg/m^3."""
    shut = make_experiment("valve", TIME, {"p1": FALLING}, valve_shut=True, rig=RIG)
    (found,) = pressure_losses([shut], RIG)
    isothermal = 2e-3 * (found.start - found.end) / found.seconds / (287.0 * 293.15) / 1.185 * 60e3
    assert isothermal == pytest.approx(1.2, rel=0.05)
    assert found.isothermal == pytest.approx(isothermal)
    assert found.adiabatic == pytest.approx(isothermal / 1.4)
    assert found.percent == pytest.approx(100 * (found.start - found.end) / found.seconds / (found.start - 1e5))
    assert found.volume_known


def test_an_unknown_volume_counts_as_a_litre() -> None:
    bare = replace(RIG, vessel_volume=None)
    shut = make_experiment("valve", TIME, {"p1": FALLING}, valve_shut=True, rig=RIG)
    (known,), (unknown,) = pressure_losses([shut], RIG), pressure_losses([shut], bare)
    assert unknown.isothermal == pytest.approx(0.5 * known.isothermal)
    assert not unknown.volume_known


def test_a_valve_that_is_open_or_a_pressure_that_rises_is_no_leak() -> None:
    rising = make_experiment("valve", TIME, {"p1": FALLING[::-1]}, valve_shut=True, rig=RIG)
    opened = make_experiment("valve", TIME, {"p1": FALLING, "u": 1.0}, rig=RIG)
    assert list(pressure_losses([rising, opened], RIG)) == []


def test_a_leak_of_the_model_is_a_flow_from_the_supply() -> None:
    rig = replace(RIG, supply_pressure=7e5)
    leaking = model(["chamber-leak", "stribeck"], {"chamber-leak.area": 1e-8}, rig=rig)
    (found,) = leak_flows(leaking, [], volume_known=True)
    mass = 1e-8 * 7e5 * 0.484 * np.sqrt(2 / (287.0 * 293.15))
    assert (found.effect, found.pressure, found.flow) == ("chamber-leak", 7e5, pytest.approx(mass / 1.185 * 60e3))


def test_a_volume_of_another_gas_is_that_of_as_many_moles() -> None:
    assert normal_flow(1.0, replace(RIG, gas_constant=2077.1)) == pytest.approx(normal_flow(1.0, RIG) * 2077.1 / 287.0)
