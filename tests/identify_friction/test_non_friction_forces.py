"""A to F are fitted and replayed beside the pipeline's other effects, and it is said which on friction they lack.

The recordings are runs of the exam's rig, whose equations are its own; what is set there is told to the model here.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pneucli.exam.rig.parameters import Parameters
from pneucli.identify.friction.identification import FrictionIdentification, identify_friction, unmodelled_effects
from pneucli.identify.friction.kinematics import NonFrictionForces, estimate_motion
from pneucli.physics.effects import catalogue
from pneucli.recording import Recording
from pneucli.simulate.model import Model
from tests.identify_friction.synthetic_recordings import BENCH, RIG, pressed, pulses, recorded

LOADED = BENCH._replace(constant_force=4.0, spring_stiffness=150.0, spring_rest=0.1)
LOADS = {"constant-force.force": 4.0, "spring-force.stiffness": 150.0, "spring-force.rest_position": 0.1}


def model(values: dict[str, float]) -> Model:
    """The bench's rig and the effects whose parameters are given."""
    known = catalogue()
    return Model(RIG, tuple(known[name] for name in dict.fromkeys(n.partition(".")[0] for n in values)), values)


def runs(par: Parameters) -> list[Recording]:
    return [recorded(par, pressed(par, pulses(2, peak)), seed) for seed, peak in enumerate((28.0, 34.0))]


@cache
def found_with() -> FrictionIdentification:
    return identify_friction(runs(LOADED), model(LOADS))


@cache
def found_without() -> FrictionIdentification:
    return identify_friction(runs(LOADED), model({}))


def times_noise(found: FrictionIdentification, name: str, channel: str) -> float:
    (pooled,) = [d for d in found.deviations if (d.model, d.recording, d.channel) == (name, "all", channel)]
    return pooled.rmsd / pooled.noise


def test_the_parameters_of_a_lie_in_their_intervals_with_a_spring_and_a_constant_force() -> None:
    assert found_with().removed_effects == ("constant-force", "spring-force")
    for name, truth in (("coulomb", LOADED.coulomb), ("viscous", LOADED.viscous), ("offset", 0.0)):
        assert found_with().parameters[name].low <= truth <= found_with().parameters[name].high, name


@pytest.mark.parametrize("name", "AB")
def test_its_replay_is_at_the_noise_with_the_other_effects(name: str) -> None:
    assert times_noise(found_with(), name, "a") < 1.3
    assert times_noise(found_with(), name, "v") < 2.0
    assert times_noise(found_without(), name, "v") > 3.0 * times_noise(found_with(), name, "v")


def test_without_them_a_constant_force_and_a_misfit_are_reported() -> None:
    assert found_with().warnings == ()
    warnings = {warning.code: warning.values for warning in found_without().warnings}
    assert "force-offset" in warnings
    assert warnings["misfit"]["unmodelled"] == ()


@pytest.mark.parametrize(
    ("values", "distortion"),
    [
        ({"pressure-offset.offset": 2e4}, lambda p, time: p + 2e4),
        ({"pressure-scale.scale": 1.05}, lambda p, time: RIG.ambient_pressure + 1.05 * (p - RIG.ambient_pressure)),
        ({"time-skew.delay": 0.006}, lambda p, time: np.interp(time - 0.006, time, p)),
    ],
    ids=["offset of p1", "scale", "skew"],
)
def test_faults_of_pressure_sensors_are_removed(values: dict[str, float], distortion) -> None:  # type: ignore[no-untyped-def]
    time = 1e-3 * np.arange(2000)
    p1, p2 = 3e5 + 5e4 * np.sin(2 * np.pi * time), 3e5 + 3e4 * np.cos(2 * np.pi * time)
    read = {"p1": distortion(p1, time), "p2": distortion(p2, time)}
    if "pressure-offset.offset" in values:
        read["p2"] = p2
    true = NonFrictionForces(model(values)).corrected_readings(time, read)
    inner = slice(20, -20)
    assert true["p1"][inner] == pytest.approx(p1[inner], rel=2e-4)
    assert true["p2"][inner] == pytest.approx(p2[inner], rel=2e-4)


def test_a_force_is_put_back_to_when_it_acted() -> None:
    time = 1e-3 * np.arange(2000)
    read = {"force": np.sin(2 * np.pi * (time - 0.006)), "p1": np.full(2000, 3e5)}
    true = NonFrictionForces(model({"force-skew.delay": 0.006})).corrected_readings(time, read)
    assert true["force"][:-10] == pytest.approx(np.sin(2 * np.pi * time)[:-10], abs=1e-4)
    assert np.array_equal(true["p1"], read["p1"])
    without = {"p1": read["p1"]}
    assert set(NonFrictionForces(model({"force-skew.delay": 0.006})).corrected_readings(time, without)) == {"p1"}


def test_a_mass_of_the_model_moves_with_the_rigs() -> None:
    heavy = BENCH._replace(extra_mass=0.5)
    found = identify_friction(runs(heavy), model({"extra-mass.mass": 0.5}))
    assert found.mass is not None
    assert found.mass.value == pytest.approx(2.5)
    assert times_noise(found, "A", "a") < 1.3


def test_a_force_that_depends_on_position_asks_for_it() -> None:
    blind = recorded(LOADED, pressed(LOADED, pulses(2, 28.0)), 1, ("p1", "p2", "a"))
    assert np.isfinite(estimate_motion(blind, model({"constant-force.force": 4.0})).drive).all()
    with pytest.raises(Exception, match="x was not recorded, and a force depends on it"):
        estimate_motion(blind, model(LOADS))


def shown(values: dict[str, float]) -> dict[str, tuple[str, ...]]:
    described = model(values)
    return dict(unmodelled_effects(described, [estimate_motion(runs(LOADED)[0], described)]))


STRIBECK = {"stribeck.static": 18.0, "stribeck.velocity": 0.015}
HYSTERESIS = {"friction-hysteresis.drop": 0.4}


@pytest.mark.parametrize(
    ("values", "without"),
    [
        (LOADS, ""),
        (STRIBECK, "DE"),  # they have its rise while speeding up only
        (STRIBECK | HYSTERESIS, "ABC"),
        ({"friction-asymmetry.asymmetry": 0.2, "friction-asymmetry.viscous_asymmetry": 0.1}, "ABDE"),
        ({"pressure-friction.gain": 0.1}, "ABCDEF"),
        ({"position-friction.from": 0.0, "position-friction.to": 0.1, "position-friction.gain": 0.3}, "ABCDEF"),
        ({"presliding.stiffness": 1e6, "presliding.damping": 100.0}, "ABCDEF"),
        ({"dwell-breakaway.gain": 0.3, "dwell-breakaway.time_constant": 1.0}, "ABCDEF"),
    ],
    ids=["loads", "stribeck", "hysteresis", "asymmetry", "pressure", "position", "presliding", "dwell"],
)
def test_effects_that_each_model_cannot_represent(values: dict[str, float], without: str) -> None:
    assert {name for name, effects in shown(values).items() if effects} == set(without)


def test_a_misfit_of_a_is_attributed_to_effects_that_it_cannot_represent() -> None:
    friction = BENCH._replace(viscous_asymmetry=0.5)
    values = {"friction-asymmetry.asymmetry": 0.0, "friction-asymmetry.viscous_asymmetry": 0.5}
    found = identify_friction(runs(friction), model(values))
    (misfit,) = [warning.values for warning in found.warnings if warning.code == "misfit"]
    assert misfit["unmodelled"] == ("friction-asymmetry",)
    assert misfit["better"] == ["C", "F"]


def test_a_weight_that_moved_along_in_one_recording_is_not_friction_nor_the_rigs_mass() -> None:
    light, heavy = runs(BENCH)[0], runs(BENCH._replace(extra_mass=2.0))[1]
    unknown = Model(replace(RIG, moving_mass=None))
    found = identify_friction([light, replace(heavy, added_mass=2.0)], unknown)
    assert found.mass is not None
    assert found.mass.low <= BENCH.mass <= found.mass.high
    for name, truth in (("coulomb", BENCH.coulomb), ("viscous", BENCH.viscous)):
        assert found.parameters[name].low <= truth <= found.parameters[name].high, name
    assert times_noise(found, "A", "a") < 1.3
    assert times_noise(identify_friction([light, heavy], unknown), "A", "a") > 3.0
