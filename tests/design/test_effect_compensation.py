"""The controller takes what it knows of the effects from the ports where they enter, a user's own included."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.design.effect_compensation import (
    breakaway_friction,
    critical_ratio,
    dead_times,
    dead_volumes,
    deceleration_friction_ratio,
    dwell_strengthening,
    flow_delay,
    has_restoring_force,
    identify_spool,
    moving_mass,
    restoring_force,
    sensor_delay,
    sensor_lag,
)
from pneucli.physics.declaration import Effect, Parameter
from pneucli.physics.effects import catalogue
from pneucli.simulate.model import Model
from pneucli.simulate.rig_quantities import rig_quantities
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


def test_break_away_grows_with_the_time_at_rest_by_its_gain_at_first_over_its_time_constant():
    found = dwell_strengthening(with_("dwell-breakaway", gain=0.5, time_constant=2.0))
    assert found.max_factor == pytest.approx(1.5, rel=0.01)
    assert found.initial_rate == pytest.approx(0.25, rel=0.01)
    bare = dwell_strengthening(model())
    assert (bare.max_factor, bare.initial_rate) == (1.0, 0.0)


def test_volumes_are_added_to_their_chamber():
    bare, found = dead_volumes(model()), dead_volumes(with_("dead-volume", volume_added=1e-5))
    assert found == (pytest.approx(bare[0] + 1e-5), bare[1])


def test_the_critical_ratio_is_that_of_the_effect():
    assert critical_ratio(model()) == 0.528
    assert critical_ratio(with_("critical-ratio", critical_ratio=0.3)) == 0.3


def test_break_away_and_half_speed_are_static_friction_and_stribeck_velocity():
    coulomb = model().base_values()["friction.coulomb"]
    static, fallen = breakaway_friction(with_("stribeck", static=coulomb + 7.0, velocity=0.013))
    assert static == pytest.approx(coulomb + 7.0)
    assert fallen == pytest.approx(0.013, rel=1e-6)
    slow = breakaway_friction(with_("stribeck", static=coulomb + 0.2, velocity=5e-5))[1]
    assert slow == pytest.approx(5e-5, rel=1e-8)


def test_without_a_rise_break_away_is_coulomb_friction_and_falls_by_the_typical_speed():
    rig = rig_quantities(model())
    typical = catalogue()["stribeck"].parameters[1].range_on(rig).typical
    coulomb = model().base_values()["friction.coulomb"]
    found = (coulomb, pytest.approx(typical[1], rel=1e-6))
    assert breakaway_friction(model()) == found
    assert breakaway_friction(with_("stribeck", static=coulomb, velocity=0.5)) == found  # no rise, though declared
    smooth = replace(model(), values={**model().values, "friction.coulomb": 0.0})
    assert breakaway_friction(smooth) == (0.0, found[1])


@pytest.mark.parametrize(
    ("effect", "values", "late"),
    [
        ("valve-lag", {"time_constant": 0.017}, (0.017, 0.0, 0.0, 0.0)),
        ("line-delay", {"delay": 0.004}, (0.0, 0.004, 0.0, 0.0)),
        ("pressure-lag", {"time_constant": 0.006}, (0.0, 0.0, 0.006, 0.0)),
        ("time-skew", {"delay": 0.003}, (0.0, 0.0, 0.0, 0.003)),
        ("valve-hysteresis", {"half_width": 0.3}, (0.0, 0.0, 0.0, 0.0)),
    ],
)
def test_what_is_late_between_command_and_reading(effect, values, late):
    """2 %: the answer of the valve is summed in steps of 1 ms."""
    known = with_(effect, **values)
    found = (identify_spool(known).lag, flow_delay(known), sensor_lag(known), sensor_delay(known))
    assert found == pytest.approx(late, rel=0.02, abs=1e-5)


def test_springs_and_weights_pull_toward_the_start_of_the_stroke() -> None:
    spring = with_("spring-force", stiffness=1000.0, rest_position=-0.05)
    assert restoring_force(spring, np.array([0.0, 0.1])) == pytest.approx([50.0, 150.0])
    assert has_restoring_force(spring)
    assert has_restoring_force(with_("constant-force", force=20.0))
    assert not has_restoring_force(model())
    assert not has_restoring_force(
        with_("spring-force", stiffness=1000.0, rest_position=0.01)
    )  # pushes outward at the start


def test_hysteresis_is_there_at_any_drop():
    """Without a drop dry friction while slowing is Coulomb's: a ratio of 1, which one branch alone does not have."""
    assert deceleration_friction_ratio(model()) == -1.0
    assert deceleration_friction_ratio(with_("friction-hysteresis", drop=0.0)) == 1.0
    assert deceleration_friction_ratio(with_("friction-hysteresis", drop=0.3)) == pytest.approx(0.7)


def test_the_dead_times_of_a_switching_valve_are_those_of_its_edges() -> None:
    """21.4 ms to open and 30.8 ms to close: between two steps, too."""
    assert dead_times(with_("switching-time", open=0.0214, close=0.0308)) == pytest.approx((0.0214, 0.0308))
    assert dead_times(with_("switching-time", open=0.0308, close=0.0214)) == pytest.approx((0.0214, 0.0308))
    assert dead_times(model()) == (0.0, 0.0)


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
