"""The controller takes what it knows of the effects from the ports where they enter, a user's own included."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.design.effect_compensation import has_restoring_force, moving_mass, restoring_force
from pneucli.physics.declaration import Effect, Parameter
from pneucli.physics.effects import catalogue
from pneucli.simulate.model import Model
from pneucli.stages.control_laws import valve_warnings
from tests.simulate.synthetic_experiments import model, typical_values


def with_(name: str, **values: float) -> Model:
    added = replace(model(), effects=(catalogue()[name],))
    return added.with_values({f"{name}.{key}": value for key, value in values.items()})


def payload(mass: float) -> float:
    return mass


OWN = Effect(
    name="my-payload",
    title="A payload",
    part="cylinder",
    parameters=(Parameter("mass", "kg", 0.0, 0.0, 100.0, (1.0,)),),
    ports={"mass": payload},
    equation="",
    looks_like="",
    shows_over="a",
    twins=(),
    separate="",
    source="",
)


def test_a_mass_counts_whatever_the_effect_is_called():
    own = replace(model(), effects=(OWN,)).with_values({"my-payload.mass": 3.0})
    bare = model().base_values()["rig.moving_mass"]
    assert moving_mass(own) == pytest.approx(bare + 3.0)
    assert moving_mass(with_("extra-mass", mass=3.0)) == moving_mass(own)


def test_springs_and_weights_pull_toward_the_start_of_the_stroke() -> None:
    spring = with_("spring-force", stiffness=1000.0, rest_position=-0.05)
    assert restoring_force(spring, np.array([0.0, 0.1])) == pytest.approx([50.0, 150.0])
    assert has_restoring_force(spring)
    assert has_restoring_force(with_("constant-force", force=20.0))
    assert not has_restoring_force(model())
    assert not has_restoring_force(
        with_("spring-force", stiffness=1000.0, rest_position=0.01)
    )  # pushes outward at the start


def test_a_design_for_a_valve_that_opens_or_shuts_says_that_it_has_no_pulses() -> None:
    timed = model(["switching-time"], {"switching-time.open": 0.021, "switching-time.close": 0.031})
    (told,) = valve_warnings(timed)
    assert "pulses, which are not designed" in told
    assert "dead times of up to 0.031 s, 0.010 s of it unpredicted" in told
    assert valve_warnings(model()) == []


@pytest.mark.parametrize("name", ["pressure-control", "pump-flow"])
def test_a_design_for_a_command_that_sets_no_area_says_that_its_loops_do_not_hold(name: str) -> None:
    (told,) = valve_warnings(model([name], typical_values([catalogue()[name]])))
    assert told.startswith("the laws ask the valve for an area, which its command does not set")
    assert name in told
