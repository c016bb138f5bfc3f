"""The balance of forces: what motion and pressures leave over, at rest and in motion, and how sure that is."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pneucli.identify.residuals import ForceBalance
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.recording import Recording
from pneucli.simulate.outputs import accelerometer_offset
from pneucli.simulate.preparation import prepare
from tests.simulate.synthetic_experiments import RIG, make_experiment, model, time_grid

TIME = time_grid(1.0)
AREA_1, AREA_2 = RIG.piston_areas


def pushed(force: float, v: float = 0.0, **more: Any) -> ForceBalance:
    """A piston under a constant net force of the pressures, at rest or sliding steadily."""
    p2 = 2e5
    p1 = RIG.ambient_pressure + (force + AREA_2 * (p2 - RIG.ambient_pressure)) / AREA_1
    signals = {"p1": p1, "p2": p2, "x": 0.1 + v * TIME, "v": v, **more}
    return ForceBalance(with_noise(make_experiment("friction", TIME, signals)))


def with_noise(e: Any) -> Any:
    """The experiment with a sensor of position that is nearly perfect."""
    e.noise["x"] = NoiseModel(1e-9)
    return e


INSIDE = slice(20, -20)


@pytest.mark.parametrize(
    ("v", "force", "left"), [(0.1, 30.0, 30.0 - 14.0 - 4.5), (-0.1, -30.0, -30.0 + 14.0 + 4.5), (0.2, 14.0, -9.0)]
)
def test_in_motion_the_residual_is_the_force_beyond_friction(v: float, force: float, left: float) -> None:
    """Coulomb friction of 14 N and 45 N s/m."""
    found = pushed(force, v).residual(model())["force"]
    assert found[INSIDE] == pytest.approx(np.full(961, left), abs=0.05)


@pytest.mark.parametrize(("force", "left"), [(10.0, 0.0), (-13.0, 0.0), (20.0, 6.0), (-20.0, -6.0)])
def test_at_rest_the_residual_is_the_force_beyond_static_friction(force: float, left: float) -> None:
    found = pushed(force).residual(model())["force"]
    assert found[INSIDE] == pytest.approx(np.full(961, left), abs=0.2)


@pytest.mark.parametrize(("force", "left"), [(10.0, 0.0), (-13.0, 0.0), (20.0, 6.0)])
def test_bristles_at_rest_take_the_deflection_that_the_force_tells(force: float, left: float) -> None:
    """Not the position: a micrometre of its noise is as much as 1 N here. A rigid contact says the same at rest."""
    read = 0.1 + 1e-6 * np.random.default_rng(0).standard_normal(TIME.size)
    elastic = model(["presliding"], {"presliding.stiffness": 1e6, "presliding.damping": 0.0})
    found = pushed(force, x=read).residual(elastic)["force"]
    assert found[INSIDE] == pytest.approx(np.full(961, left), abs=0.2)


def test_bristles_slide_off_from_the_deflection_at_rest() -> None:
    """From 10 N at rest to 14 N while sliding 1 mm/s: of the missing 4 N exp(-s / 14 um) remain."""
    slides = TIME > 0.5
    distance = 1e-3 * np.maximum(TIME - 0.5, 0.0)
    force = np.where(slides, 14.0 + 45.0 * 1e-3, 10.0)
    p1 = RIG.ambient_pressure + force / AREA_1
    signals = {"p1": p1, "p2": RIG.ambient_pressure, "x": 0.1 + distance, "v": np.where(slides, 1e-3, 0.0)}
    view = ForceBalance(with_noise(make_experiment("friction", TIME, signals)))
    elastic = model(["presliding"], {"presliding.stiffness": 1e6, "presliding.damping": 0.0})
    found, expected = view.residual(elastic)["force"], 4.0 * np.exp(-distance / 14e-6)
    sure = slides & (found != 0.0)
    assert np.count_nonzero(sure & (expected > 0.4)) > 10
    assert found[sure] == pytest.approx(expected[sure], abs=0.1)


def test_acceleration_is_a_force_of_the_mass() -> None:
    """3 m/s^2 of 2.2 kg while sliding, read by an accelerometer, or differentiated from the velocity."""
    v = 0.1 + 3.0 * TIME
    force = 14.0 + 45.0 * v + 2.2 * 3.0
    p1 = RIG.ambient_pressure + force / AREA_1
    signals = {"p1": p1, "p2": RIG.ambient_pressure, "x": 0.05 + 0.1 * TIME + 1.5 * TIME**2, "v": v}
    for more in ({}, {"a": 3.0}):
        e = with_noise(make_experiment("friction", TIME, {**signals, **more}))
        e.noise.update({"a": NoiseModel(0.0)})
        assert ForceBalance(e).residual(model())["force"][INSIDE] == pytest.approx(np.zeros(961), abs=0.05)


def test_without_an_accelerometer_position_gives_the_acceleration_and_its_error() -> None:
    time = 1e-3 * np.arange(2000)
    read = 0.01 * np.sin(10.0 * time) + 2e-6 * np.random.default_rng(0).standard_normal(time.size)
    noise = {"x": NoiseModel(2e-6), "p1": NoiseModel(100.0)}
    signals = {"x": read, "p1": 2e5 + 0.0 * time, "p2": 2e5 + 0.0 * time}
    view = ForceBalance(prepare(Recording("moved", "friction", "train", time, signals, noise, "closed"), RIG, None))
    a, true = view._acceleration_and_removed_force[0], -np.sin(10.0 * time)
    assert a[50:-50] == pytest.approx(true[50:-50], abs=0.2)
    drawn = [inputs_and_loads[1][0] - a for inputs_and_loads in view._noise_realisations(4, 0)]
    assert 1.0 < np.std(np.array(drawn)[:, 50:-50]) / np.std((a - true)[50:-50]) < 2.0


def resting(noise: float = 0.05, **values: float) -> ForceBalance:
    e = with_noise(make_experiment("friction", TIME, {"p1": 2e5, "p2": 2e5, "x": 0.1, "v": 0.0, "a": 0.3}))
    e.noise["a"] = NoiseModel(noise)
    return ForceBalance(e)


def test_an_accelerometer_at_rest_is_held_against_its_own_reading() -> None:
    biased = model(["acceleration-bias"], {"acceleration-bias.bias": 0.1})
    view = resting()
    assert view.channels == ("force", "a")
    assert view.residual(model())["a"][INSIDE] == pytest.approx(np.full(961, 0.3))
    assert view.residual(biased)["a"][INSIDE] == pytest.approx(np.full(961, 0.2))
    assert not view.residual(model())["a"][:1].any()  # at the edges the piston may be moving
    assert (accelerometer_offset(model(), view.experiment), accelerometer_offset(biased, view.experiment)) == (0.0, 0.1)
    assert resting(0.0).channels == ("force",)


def test_an_accelerometer_in_motion_is_not() -> None:
    view = pushed(20.0, 0.1, a=0.3)
    view.experiment.noise["a"] = NoiseModel(0.05)
    assert not view.residual(model())["a"].any()


def test_drawn_noise_propagates_like_the_sensors_noise() -> None:
    """A balance of unsmoothed pressures in motion: the noise of both, once; the accelerometer always its own."""
    view = pushed(30.0, 0.1)
    view.experiment.noise.update({"p1": NoiseModel(300.0), "p2": NoiseModel(400.0)})
    view = ForceBalance(replace(view.experiment))
    found = view.monte_carlo_rms(model(), {}, 2, 11)
    assert found["force"] == pytest.approx(1.0, abs=0.1)
    still = resting()
    still.experiment.noise.update({"p1": NoiseModel(300.0)})
    at_rest = still.monte_carlo_rms(model(), {}, 1, 11)
    assert at_rest["a"] == 1.0
    assert at_rest["force"] < 0.01  # friction holds the piston, and takes the noise too


@pytest.mark.parametrize(("effect", "channels"), [("acceleration-bias", ("a",)), ("constant-force", ())])
def test_the_accelerometer_at_rest_reads_nothing_but_its_own_fault(effect: str, channels: tuple[str, ...]) -> None:
    """Only where it was recorded; whatever pushes the piston, at rest it reads zero."""
    e = with_noise(make_experiment("friction", TIME, {"p1": 3e5, "p2": 3e5, "x": 0.1, "a": 0.0}))
    e.noise["a"] = NoiseModel(0.1)
    assert ForceBalance(e).exclusive_channels(catalogue()[effect]) == channels
    silent = with_noise(make_experiment("friction", TIME, {"p1": 3e5, "p2": 3e5, "x": 0.1}))
    assert ForceBalance(silent).exclusive_channels(catalogue()[effect]) == ()
