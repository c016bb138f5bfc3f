"""What a model has learned reaches the controller: play, lag, delay, leaks, sensors, friction, by the ports."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.controller import layout as at
from pneucli.controller import observers, plant, valve_dynamics
from pneucli.design import effect_compensation
from pneucli.design.cascade_design import design_cascade
from pneucli.design.gains import ackermann_gains
from pneucli.physics.effects import catalogue
from tests.design import axis

MODEL, PLAIN = axis.model(), axis.controller()
SIZES = {
    "valve-lag": {"time_constant": 0.017}, "valve-hysteresis": {"half_width": 0.2}, "valve-deadband": {"width": 0.8},
    "line-delay": {"delay": 0.011}, "pressure-lag": {"time_constant": 0.012}, "time-skew": {"delay": 0.012},
    "pressure-scale": {"scale": 1.05}, "pressure-offset": {"offset": 1e4}, "chamber-leak": {"area": 3e-8},
    "piston-leak": {"area": 3e-8}, "valve-leak": {"area": 3e-8}, "dead-volume": {"volume_added": 1e-5},
    "extra-mass": {"mass": 1.0}, "constant-force": {"force": 10.0}, "critical-ratio": {"critical_ratio": 0.3},
    "pressure-friction": {"gain": 0.2}, "position-friction": {"from": 0.08, "to": 0.1, "gain": 1.5},
    "friction-hysteresis": {"drop": 0.4}, "friction-asymmetry": {"asymmetry": 0.2, "viscous_asymmetry": 0.1},
    "end-cushion": {"length": 0.06, "damping": 200.0}, "spring-force": {"stiffness": 200.0, "rest_position": 0.1},
}  # fmt: skip


def having(effect: str):
    values = {f"{effect}.{name}": value for name, value in SIZES[effect].items()}
    return replace(MODEL, effects=(*MODEL.effects, catalogue()[effect])).with_values(values)


def numbers(effect: str) -> np.ndarray:
    return design_cascade(having(effect), axis.REQUIREMENTS, axis.SEALED).vector()


@pytest.mark.parametrize("effect", SIZES)
def test_an_effect_of_mechanics_or_pneumatics_changes_the_controller(effect: str) -> None:
    assert not np.array_equal(numbers(effect), PLAIN.vector())


def test_play_lag_and_overlap_are_found_by_driving_the_command() -> None:
    assert effect_compensation.identify_spool(having("valve-hysteresis")).play_half_width == pytest.approx(
        0.2, rel=1e-6
    )
    assert effect_compensation.identify_spool(having("valve-lag")).lag == pytest.approx(0.017, rel=1e-3)
    found = effect_compensation.identify_spool(having("valve-deadband"))
    assert np.interp([0.3, 1.4], found.commands, found.openings) == pytest.approx([0.0, 1.0], abs=1e-9)
    assert (found.play_half_width, found.lag) == (0.0, pytest.approx(0.0, abs=1e-9))


@pytest.mark.parametrize("effect", ["valve-lag", "valve-hysteresis"])
def test_the_command_undoes_lag_and_play_as_far_as_it_is_asked_to(effect: str) -> None:
    c, s = numbers(effect), np.zeros(at.L_STATES)
    for wanted in (0.5, -0.3, 0.1, 0.8):
        before = s[at.S_SPOOL1]
        u = valve_dynamics.compensate_valve_dynamics(wanted, 0.0, at.S_PLAY1, at.S_SPOOL1, -10.0, 10.0, s, c)
        valve_dynamics.apply_valve_dynamics(u, at.S_PLAY1, at.S_SPOOL1, s, c)
        assert s[at.S_SPOOL1] - before == pytest.approx(c[at.C_SPOOL_LEAD] * (wanted - before), abs=1e-12)


def test_little_does_not_move_the_play() -> None:
    c, s = numbers("valve-hysteresis"), np.zeros(at.L_STATES)
    assert (
        valve_dynamics.compensate_valve_dynamics(
            0.9 * c[at.C_PLAY_DEADBAND], 0.123, at.S_PLAY1, at.S_SPOOL1, -10.0, 10.0, s, c
        )
        == 0.123
    )


@pytest.mark.parametrize("wait", [0.0, 1.0, 2.5])
def test_a_row_gives_back_what_was_put_in_so_many_samples_ago(wait: float) -> None:
    s = np.zeros(at.L_STATES)
    out = []
    for k in range(2 * at.DELAY_LINE_SAMPLES):
        valve_dynamics.delay_line_advance(s)
        out.append(valve_dynamics.delay_line_update(float(k), at.S_OPENING_LINE1, wait, s))
    assert out[10:] == pytest.approx([k - wait for k in range(10, 2 * at.DELAY_LINE_SAMPLES)])


def test_what_is_under_way_in_the_hose_is_looked_ahead_to() -> None:
    c, s = numbers("line-delay"), np.zeros(at.L_STATES)
    observers.initialise_state(0.1, 0.1, 3e5, 3e5, s, c)
    valve_dynamics.delay_line_fill(at.S_OPENING_LINE1, 1.0, s)  # filling, and nothing of it has arrived
    observers.predict_to_arrival(s, c)
    made = 0.011 * valve_dynamics.valve_gradient_1(1.0, 3e5, valve_dynamics.chamber_volume_1(0.1, c), s, c)
    assert s[at.S_PREDICTED_P1] - 3e5 == pytest.approx(made, rel=0.15)
    assert s[at.S_P1] == 3e5


def test_an_observer_behind_a_lagging_sensor_has_the_poles_that_are_asked_for() -> None:
    forward, poles = np.array([[0.9, 0.1, 1e-4], [0.0, 1.0, 1e-3], [0.0, 0.0, 1.0]]), (0.8, 0.8, 0.95)
    gains = np.array(ackermann_gains(forward, poles))
    left = (np.eye(3) - np.outer(gains, [1.0, 0.0, 0.0])) @ forward
    assert np.poly(left) == pytest.approx(np.poly(poles), rel=1e-6)


def test_dry_friction_knows_place_pressure_and_direction() -> None:
    s = np.zeros(at.L_STATES)
    assert plant.dry_friction_factor(0.09, 1.0, s, numbers("position-friction")) == pytest.approx(2.5)
    assert plant.dry_friction_factor(0.15, 1.0, s, numbers("position-friction")) == 1.0
    s[at.S_P1], s[at.S_P2] = MODEL.rig.ambient_pressure + 2e5, MODEL.rig.ambient_pressure + 1e5
    assert plant.dry_friction_factor(0.1, 1.0, s, numbers("pressure-friction")) == pytest.approx(1.6)
    asymmetric = numbers("friction-asymmetry")
    assert [plant.dry_friction_factor(0.1, way, s, asymmetric) for way in (1.0, -1.0)] == pytest.approx([1.2, 0.8])


def test_between_both_branches_of_friction_the_speed_stays() -> None:
    c, s = numbers("friction-hysteresis"), np.zeros(at.L_STATES)
    coulomb, v = c[at.C_COULOMB], 1.0
    between = 0.8 * coulomb + c[at.C_VISCOUS] * v
    assert plant.speed_after(0.1, v, between, 1e-3, s, c) == v
    assert plant.speed_after(0.1, v, between - 0.5 * coulomb, 1e-3, s, c) < v
    assert plant.speed_after(0.1, 0.0, 0.9 * coulomb, 1e-3, s, c) == 0.0


def test_hysteresis_without_a_drop_has_no_stribeck_rise_while_slowing() -> None:
    """Between Coulomb friction and 1.8 times as much the speed stays; with one branch the piston slows."""
    c, s = numbers("friction-hysteresis").copy(), np.zeros(at.L_STATES)
    coulomb, v = c[at.C_COULOMB], 0.005
    c[at.C_STRIBECK], s[at.S_BREAKAWAY_FORCE] = 0.01, 2.0 * coulomb
    between = 1.4 * coulomb + c[at.C_VISCOUS] * v
    c[at.C_DECELERATION_RATIO] = 1.0
    assert plant.speed_after(0.1, v, between, 1e-4, s, c) == v
    c[at.C_DECELERATION_RATIO] = -1.0
    assert plant.speed_after(0.1, v, between, 1e-4, s, c) < v


def test_springs_and_weights_push_and_a_cushion_brakes_toward_its_end() -> None:
    spring, cushion = numbers("spring-force"), numbers("end-cushion")
    assert plant.stroke_table(0.15, 4, spring) == pytest.approx(-200.0 * 0.05, rel=1e-6)
    assert plant.stroke_table(0.0, 4, spring) == pytest.approx(200.0 * 0.1, rel=1e-6)
    stroke, viscous = MODEL.rig.stroke, MODEL.base_values()["friction.viscous"]
    assert plant.damping(stroke, 1.0, cushion) == pytest.approx(viscous + 200.0, rel=1e-6)
    assert plant.damping(stroke, -1.0, cushion) == pytest.approx(viscous)
