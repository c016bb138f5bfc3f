"""Velocity without drift and friction force, from every set of sensors, against the true signals of the exam's rig."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneucli.errors import InputError
from pneucli.identify.friction.kinematics import estimate_motion
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.recording import Rig
from pneucli.simulate.model import Model
from pneucli.simulate.motion_smoother import integrate_between_rests, rest_mask
from tests.identify_friction.synthetic_recordings import BENCH, RIG, pressed, pulses, recorded

STICKY = BENCH._replace(static=18.0, stribeck_velocity=0.015, acceleration_bias=0.3)


@cache
def moved() -> dict[str, np.ndarray]:
    return pressed(STICKY, pulses(3, 30.0))


@pytest.mark.parametrize("sensors", [("x", "a"), ("x",), ("a",)], ids=["x and a", "x", "a"])
def test_velocity_has_no_drift_whatever_measures_the_motion(sensors: tuple[str, ...]) -> None:
    kinematics = estimate_motion(recorded(STICKY, moved(), 1, ("p1", "p2", *sensors)), Model(RIG))
    error = kinematics.v - moved()["v"]
    fastest = np.abs(moved()["v"]).max()
    # 0.3 m/s^2 of bias, integrated over these 2.6 s, would be 0.78 m/s; the sensors promise sigma_v, and position
    # alone cannot follow the jumps of the acceleration, where the period times half a jump of 10 m/s^2 is 5 mm/s
    assert np.sqrt(np.mean(error**2)) < (1e-3 * fastest if sensors == ("x",) else 2 * kinematics.sigma_v)
    assert abs(np.mean(error[-200:])) < 1e-3 * fastest


@pytest.mark.parametrize("sensors", [("x", "a"), ("a",)], ids=["x and a", "a"])
def test_the_error_of_the_friction_force_agrees_with_its_sigma(sensors: tuple[str, ...]) -> None:
    kinematics = estimate_motion(recorded(STICKY, moved(), 2, ("p1", "p2", *sensors)), Model(RIG))
    truth = STICKY.piston_area_1 * (moved()["p1"] - moved()["p2"]) - 2.0 * moved()["a"]
    error = (kinematics.friction(2.0) - truth)[kinematics.moving]
    # 200 Pa on each of two pressures over 8 cm^2, 0.05 m/s^2 on 2 kg
    expected = np.sqrt(2 * (200 * 8e-4) ** 2 + (2 * 0.05) ** 2)
    assert kinematics.sigma_friction(2.0) == pytest.approx(expected, rel=0.02)  # from one draw of the noise
    assert np.std(error) == pytest.approx(expected, rel=0.1)
    assert abs(np.mean(error)) < 5 * expected / np.sqrt(error.size)


def test_a_resting_piston_is_not_taken_for_a_moving_one() -> None:
    kinematics = estimate_motion(recorded(STICKY, moved(), 3), Model(RIG))
    rest = moved()["v"] == 0.0
    clear = np.abs(moved()["v"]) > 3 * kinematics.rest_speed
    assert not np.any(kinematics.moving & rest)
    assert np.mean(kinematics.moving[clear]) > 0.98


def test_branches_are_those_of_the_true_acceleration() -> None:
    kinematics = estimate_motion(recorded(STICKY, moved(), 4), Model(RIG))
    true_branch = np.sign(moved()["v"] * moved()["a"])
    judged = kinematics.branch != 0
    assert np.mean(judged[kinematics.moving]) > 0.8
    assert np.mean((kinematics.branch == true_branch)[judged]) > 0.97


def test_a_slide_lasts_as_long_whenever_the_clock_began() -> None:
    r = recorded(STICKY, moved(), 4)
    late = replace(r, time=r.time + 100.0)
    assert estimate_motion(late, Model(RIG)).block_length == pytest.approx(estimate_motion(r, Model(RIG)).block_length)
    still = recorded(BENCH, pressed(BENCH, np.zeros(500)), 3)
    assert estimate_motion(replace(still, time=still.time + 100.0), Model(RIG)).block_length == pytest.approx(0.0499)


def test_a_measured_force_does_as_well_as_the_pressures() -> None:
    by_pressure = estimate_motion(recorded(STICKY, moved(), 5), Model(RIG))
    r = by_pressure.recording
    force = RIG.piston_area_1 * (r["p1"] - r["p2"])
    noise = {**{k: r.noise[k] for k in ("x", "a")}, "force": NoiseModel(white=0.23)}
    by_force = estimate_motion(replace(r, signals={"x": r["x"], "a": r["a"], "force": force}, noise=noise), Model(RIG))
    assert by_force.friction(2.0) == pytest.approx(by_pressure.friction(2.0), abs=1e-9)


def test_ambient_pressure_acts_on_the_rod() -> None:
    rig = replace(RIG, piston_area_2=5e-4)
    r = recorded(BENCH, pressed(BENCH, np.zeros(300)), 6)
    still = {**r.signals, "p1": np.full(300, 2e5), "p2": np.full(300, 3e5), "a": np.zeros(300)}
    drive = estimate_motion(replace(r, signals=still), Model(rig)).drive
    assert drive == pytest.approx(8e-4 * 2e5 - 5e-4 * 3e5 - 3e-4 * 101_300.0)


def test_samples_that_were_not_measured_are_left_out() -> None:
    r = recorded(STICKY, moved(), 7)
    p1 = r["p1"].copy()
    p1[300:340] = np.nan
    kinematics = estimate_motion(replace(r, signals={**r.signals, "p1": p1}), Model(RIG))
    assert not kinematics.valid[300:340].any()
    assert not kinematics.moving[300:340].any()
    assert np.all(np.isfinite(kinematics.drive))


@pytest.mark.parametrize(
    ("signals", "rig", "says"),
    [
        (("p1", "p2"), RIG, ("neither x, v nor a", "position, velocity or acceleration", "")),
        (
            ("p1", "p2", "x", "a"),
            replace(RIG, piston_area_1=None, piston_area_2=None),
            ("no rig.cylinder.piston_area_1", "what drives the piston", "add rig.cylinder.piston_area_1"),
        ),
        (("p1", "x", "a"), RIG, ("chamber 2 is {}, p2 was not recorded", "p2", "record or state p2")),
        (("x", "a"), RIG, ("no p1, p2 or force", "what drives the piston", "add p1, p2 or force")),
    ],
)
@pytest.mark.parametrize("chamber_2", ["closed", "valve"])
def test_what_is_missing_is_named(
    signals: tuple[str, ...], rig: Rig, says: tuple[str, str, str], chamber_2: str
) -> None:
    """An air spring is not ambient pressure; an open chamber is."""
    r = recorded(STICKY, moved(), 8)
    with pytest.raises(InputError) as error:
        estimate_motion(replace(r, signals={k: r[k] for k in signals}, chamber_2=chamber_2), Model(rig))
    told = error.value
    assert (told.where, told.found.replace(chamber_2, "{}"), told.wanted, told.mend) == ("recording run_8", *says)
    if "p2 was" in told.found:
        alone = estimate_motion(replace(r, signals={k: r[k] for k in signals}, chamber_2="open"), Model(rig))
        assert alone.drive == pytest.approx(RIG.piston_area_1 * (r["p1"] - RIG.ambient_pressure))


def test_a_force_that_depends_on_position_needs_the_position() -> None:
    r = recorded(STICKY, moved(), 8)
    values = {"spring-force.stiffness": 100.0, "spring-force.rest_position": 0.1}
    sprung = Model(RIG, (catalogue()["spring-force"],), values)
    with pytest.raises(InputError) as error:
        estimate_motion(replace(r, signals={k: r[k] for k in ("p1", "p2", "a")}), sprung)
    told = error.value
    assert told.found == "x was not recorded, and a force depends on it (spring-force)"
    assert (told.where, told.wanted) == ("recording run_8", "x")


@settings(max_examples=30, deadline=None)
@given(bias=st.floats(-2, 2), seed=st.integers(0, 1000))
def test_zero_velocity_updates_take_any_constant_bias_away(bias: float, seed: int) -> None:
    time = 1e-3 * np.arange(600)
    a = np.where((time > 0.2) & (time <= 0.4), 4 * np.sin(2 * np.pi * (time - 0.2) / 0.2), 0.0)
    rest = (time < 0.19) | (time > 0.41)
    v = integrate_between_rests(time, a + bias, rest)
    exact = np.where((time > 0.2) & (time <= 0.4), 4 * 0.1 / np.pi * (1 - np.cos(10 * np.pi * (time - 0.2))), 0.0)
    assert v == pytest.approx(exact, abs=2e-3)
    assert v[rest] == pytest.approx(np.zeros(rest.sum()), abs=1e-12)
    noise = 0.05 * np.random.default_rng(seed).standard_normal((3, time.size))
    found = np.array([rest_mask(time, a + bias + one, NoiseModel(white=0.05)) for one in noise])
    # a window of 21 samples is 1.5 times too loud once in a thousand, and what it leaves is too short for a rest
    assert np.median(found[:, :180].mean(axis=1)) > 1.0 - 21 / 180
    assert not found[:, 230:370].any()


def test_steady_sliding_is_not_a_rest_though_the_accelerometer_reads_nothing() -> None:
    time = 1e-3 * np.arange(1000)
    a = np.zeros(1000)
    a[200:250], a[700:750] = 2.0, -2.0  # slides at 0.1 m/s in between
    found = rest_mask(time, a + 0.02 * np.random.default_rng(0).standard_normal(1000), NoiseModel(white=0.02))
    assert found[20:180].all()
    assert found[780:].all()
    assert not found[280:670].any()
