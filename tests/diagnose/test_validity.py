"""Whether an estimate is valid: where it ended, and whether readings at ambient pressure refute a sensor's fault."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.diagnose.constraints import refuted_by_reading, rests_at_ambient
from pneucli.noise.estimate import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.simulate.experiment import Experiment
from tests.simulate.synthetic_experiments import RIG, make_experiment, model

AMBIENT = RIG.ambient_pressure
NOISE = 300.0  # Pa
TIME = 1e-3 * np.arange(2000)
VENTED = np.where(TIME < 1.5, 4e5, AMBIENT)  # for half a second
NEVER = np.full(TIME.size, 4e5)
OFFSET = catalogue()["pressure-offset"]


def read(level: np.ndarray, seed: int = 1) -> np.ndarray:
    return np.asarray(level + NOISE * np.random.default_rng(seed).standard_normal(level.size))


def recorded(noise: float = NOISE, **pressures: np.ndarray) -> Experiment:
    e = make_experiment("axis", TIME, {"x": 0.1, **pressures})
    return replace(e, noise={name: NoiseModel(noise) for name in pressures})


def residual_models(**pressures: np.ndarray) -> Any:
    return [SimpleNamespace(experiment=recorded(**pressures))]


def refuted(offset: float, seen: Any) -> bool:
    return refuted_by_reading(model(["pressure-offset"], {"pressure-offset.offset": offset}), OFFSET, seen)


@pytest.mark.parametrize("offset", [9500.0, -9500.0, 3100.0])
def test_an_offset_is_refuted_where_the_vented_chamber_reads_ambient_pressure(offset: float) -> None:
    assert refuted(offset, residual_models(p1=read(VENTED)))


@pytest.mark.parametrize("offset", [2900.0, -2900.0])
def test_an_offset_within_the_weather_is_not_refuted(offset: float) -> None:
    """Three times 1 % of ambient pressure is 3040 Pa."""
    assert not refuted(offset, residual_models(p1=read(VENTED)))


def test_an_offset_that_shows_at_rest_is_not_refuted() -> None:
    """The vented chamber reads 9500 Pa too little."""
    assert not refuted(-9500.0, residual_models(p1=read(VENTED - 9500.0)))


def test_without_a_vented_chamber_nothing_is_refuted() -> None:
    assert not refuted(-9500.0, residual_models(p1=read(NEVER)))
    assert not refuted(-9500.0, residual_models())


def test_one_recording_that_knows_is_enough_and_each_sensor_speaks_for_itself() -> None:
    assert refuted(-9500.0, [*residual_models(p1=read(NEVER)), *residual_models(p1=read(VENTED))])
    assert not refuted(-9500.0, residual_models(p1=read(NEVER), p2=read(VENTED)))


def test_a_fault_of_p2s_sensor_is_held_against_p2() -> None:
    """No effect of the catalogue offsets p2 alone; one of both has both ports."""
    of_p2 = replace(OFFSET, ports={"read_p2": OFFSET.ports["read_p1"]})
    faulty = replace(model(["pressure-offset"], {"pressure-offset.offset": 9500.0}), effects=(of_p2,))
    assert refuted_by_reading(faulty, of_p2, residual_models(p1=read(NEVER), p2=read(VENTED)))
    assert not refuted_by_reading(faulty, of_p2, residual_models(p1=read(VENTED), p2=read(NEVER)))


def test_a_gauge_scale_reads_ambient_pressure_correctly() -> None:
    scaled = model(["pressure-scale"], {"pressure-scale.scale": 1.2})
    assert not refuted_by_reading(scaled, catalogue()["pressure-scale"], residual_models(p1=read(VENTED)))


def test_only_pressure_sensor_faults_can_be_refuted() -> None:
    assert not refuted_by_reading(model(["extra-mass"]), catalogue()["extra-mass"], residual_models(p1=read(VENTED)))


# --- where a chamber rests


@pytest.mark.parametrize(
    ("level", "rests"),
    [
        (VENTED, True),
        (VENTED + 900.0, True),  # weather
        (VENTED + 1300.0, False),
        (VENTED - 1300.0, False),  # no vented chamber is below ambient pressure: the sensor is off
        (np.where(TIME < 1.85, 4e5, AMBIENT), False),  # 0.15 s are no rest
        (np.where(TIME < 1.75, 4e5, AMBIENT), True),  # 0.25 s
        (np.where(TIME < 0.05, AMBIENT - 5000.0, VENTED), False),  # it was below that for longer than noise is
    ],
)
def test_a_chamber_is_vented_where_its_lowest_level_is_ambient_pressure(level: np.ndarray, rests: bool) -> None:
    assert rests_at_ambient(recorded(noise=30.0, p1=level + 30.0 * (np.arange(TIME.size) % 2)), "p1") == rests


def test_a_rest_is_as_wide_as_the_sensors_noise() -> None:
    """A rest of 0.25 s with noise of 600 Pa: a third of it is more than 1 % above its lowest readings."""
    rough = np.where(TIME < 1.75, 4e5, AMBIENT) + 600.0 + 600.0 * np.random.default_rng(2).standard_normal(TIME.size)
    assert rests_at_ambient(recorded(noise=600.0, p1=rough), "p1")


def test_samples_that_were_not_read_are_no_level() -> None:
    holes = np.where(TIME < 0.2, np.nan, VENTED)
    assert rests_at_ambient(recorded(p1=holes), "p1")
    assert not rests_at_ambient(recorded(p1=np.full(TIME.size, np.nan)), "p1")
    assert not rests_at_ambient(recorded(p1=VENTED), "p2")
