"""Sample of the cascade controller, in scalar code that numba compiles and :mod:`pneucli.export.c_source` translates.

Only scalars, the two arrays of :mod:`pneucli.controller.layout` (``s`` state, ``c`` parameters and inverse tables),
``math`` and the functions of this package; a local that holds an integer is annotated where it is assigned.
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

import math

from pneucli.controller.layout import *
from pneucli.controller.observers import (
    advance_valve_gradients,
    initialise_at_first_sample,
    observe_motion,
    observe_pressures,
    predict_to_arrival,
)
from pneucli.controller.plant import (
    clamp,
    damping,
    drive_mirrored_valve,
    dry_friction,
    dry_friction_factor,
    is_held_for_good,
    limit_gradient_1,
    limit_gradient_2,
    max_pressure_reference,
    sign,
    stroke_table,
    valve_command,
    valve_command_2,
)
from pneucli.controller.reference import follow_reference, update_level
from pneucli.controller.standstill import (
    braking_force,
    breakaway_ramp,
    drive_elastic_piston,
    reference_rests,
    update_hold,
)
from pneucli.controller.valve_dynamics import (
    chamber_volume_1,
    chamber_volume_2,
    compensate_valve_dynamics,
    drift_1,
    drift_2,
    null_command_1,
    null_command_2,
    valve_gradient_1,
    valve_gradient_2,
)


def friction_feedforward(s, c):
    """Return the feed-forward of dry friction in N along the reference; its sign is continuous below the least speed.

    The speed is that of the reference at the time when the force arrives, the lag of the pressure loop ahead. It is
    limited to within a factor of two of the speed of the piston: above half of it after break-away, where friction
    falls, and below twice of it for a piston that lags behind and must still break away. Friction: thesis (3.6).
    """
    v = s[S_V_SHAPED] + c[C_FRICTION_LEAD] * s[S_A_SHAPED]
    speed = max(math.fabs(v), 0.5 * math.fabs(s[S_V]))
    if (s[S_X_SHAPED] - s[S_X]) * v > 0.0:
        speed = min(speed, 2.0 * math.fabs(s[S_V]))
    level = dry_friction(speed, s, c)
    if s[S_A_SHAPED] * v < 0.0 and c[C_DECELERATION_RATIO] >= 0.0:
        level = min(level, c[C_COULOMB] * c[C_DECELERATION_RATIO])
    floor = min(c[C_V_FLOOR], 0.01 * c[C_V_MAX])  # the reference has no quantisation
    return (
        level
        * dry_friction_factor(s[S_PREDICTED_X] + c[C_FRICTION_LEAD] * s[S_PREDICTED_V], v, s, c)
        * clamp(v / floor, -1.0, 1.0)
    )


def position_control(x_ref, s, c):
    """Return the requested pressure force in N: PID, feed-forward, less the load; the release force at rest."""
    delay = c[C_FLOW_DELAY] * c[C_PERIOD]
    error = s[S_X_SHAPED] + delay * (s[S_V_SHAPED] + 0.5 * delay * s[S_A_SHAPED]) - s[S_PREDICTED_X]
    rate = s[S_V_SHAPED] + delay * s[S_A_SHAPED] - s[S_PREDICTED_V]
    if c[C_HOLD] > 0.5 and update_hold(x_ref, s, c):
        return s[S_FORCE]
    ahead = c[C_FEEDFORWARD]
    force = c[C_MASS] * (ahead * s[S_A_SHAPED] + s[S_LOOP_GAIN] * (c[C_KD] * rate + c[C_KP] * error))
    force += ahead * damping(s[S_X], s[S_V_SHAPED], c) * (s[S_V_SHAPED] + c[C_FRICTION_LEAD] * s[S_A_SHAPED])
    if c[C_SWITCHING] > 0.5 and reference_rests(s):
        if s[S_ELASTIC] > 0.5:
            drive_elastic_piston(s[S_X_SHAPED] - s[S_X], s, c)
            force += s[S_LOOP_GAIN] * braking_force(s[S_X_SHAPED] - s[S_X], s, c)
        else:
            breakaway_ramp(s[S_X_SHAPED] - s[S_X], s, c)
    else:
        s[S_RELEASE_FORCE] = 0.0
        s[S_FORCE_RAMP] = 0.0
        s[S_LAST_SIGN] = 0.0
        s[S_DEADBAND_GAIN] = 1.0
        s[S_LOOP_GAIN] = 1.0
        s[S_RAMP_GAIN] = 4.0
        s[S_BRAKING_TIME] = 0.0
        s[S_LAST_JUMP] = 0.0
    force = force + ahead * friction_feedforward(s, c) + s[S_RELEASE_FORCE]
    if c[C_DISTURBANCE_OBSERVERS] > 0.5:
        return force - s[S_LOAD] - stroke_table(s[S_PREDICTED_X], 4, c)
    s[S_INTEGRAL] += c[C_PERIOD] * c[C_MASS] * c[C_KI] * error
    return force + s[S_INTEGRAL]


def set_pressure_references(force, s, c):
    """Set the pressure references in Pa for a force (N), within supply and ambient; back-calculate the integral."""
    bias = (c[C_AREA_1] - c[C_AREA_2]) * c[C_AMBIENT]
    if c[C_TWO_VALVES] > 0.5:
        level = update_level(force + bias, s, c)
        both = (force + bias - (c[C_AREA_1] - c[C_AREA_2]) * level) / (c[C_AREA_1] + c[C_AREA_2])
        s[S_P2_REF] = clamp(level - both, c[C_P_LOW], max_pressure_reference(s, c))
        wanted = (force + bias + c[C_AREA_2] * s[S_P2_REF]) / c[C_AREA_1]
    else:
        s[S_P2_REF] = s[S_P2]
        wanted = (force + bias + c[C_AREA_2] * s[S_P2]) / c[C_AREA_1]
    s[S_P1_REF] = clamp(wanted, c[C_P_LOW], max_pressure_reference(s, c))
    lost = c[C_AREA_1] * (s[S_P1_REF] - wanted)
    s[S_FORCE] = force + lost
    # anti-windup by back-calculation
    if lost * s[S_INTEGRAL] < 0.0:
        s[S_INTEGRAL] += sign(lost) * min(math.fabs(lost), math.fabs(s[S_INTEGRAL]))


def pressure_gain(s, c):
    """Return the gain of the pressure loops in 1/s: held for good, damped by half with 50 ms of lag."""
    return min(c[C_P_KP], 20.0) if is_held_for_good(s, c) else c[C_P_KP]


def valve_stays_shut(error, s, c):
    """Whether a valve stays shut: the piston is held and the pressure error is within its band."""
    return s[S_HOLD] > 0.5 and math.fabs(error) < c[C_PRESSURE_BAND]


def undriven_gradient(s, c):
    """Return the rate in Pa/s of the pressure force over the first area with shut valves, at arrival of the command."""
    x = s[S_PREDICTED_X]
    v = s[S_PREDICTED_V]
    p1 = s[S_PREDICTED_P1]
    p2 = s[S_PREDICTED_P2]
    rate = valve_gradient_1(null_command_1(c), p1, chamber_volume_1(x, c), s, c) + drift_1(x, v, p1, p2, c)
    rate = c[C_FEEDFORWARD] * rate + c[C_DISTURBANCE_OBSERVERS] * s[S_FLOW1]
    if c[C_TWO_VALVES] < 0.5:
        second = valve_gradient_2(null_command_1(c), p2, chamber_volume_2(x, c), s, c) + drift_2(x, v, p1, p2, c)
        rate -= c[C_AREA_2] / c[C_AREA_1] * (c[C_FEEDFORWARD] * second + c[C_DISTURBANCE_OBSERVERS] * s[S_FLOW2])
    return rate


def control_chamber_1(s, c):
    """Set the command of the valve of chamber 1: P with compensation of motion, leaks and flow estimate, or PI."""
    error = s[S_P1_REF] - s[S_PREDICTED_P1]
    if c[C_TWO_VALVES] < 0.5:
        error += c[C_AREA_2] / c[C_AREA_1] * (s[S_PREDICTED_P2] - s[S_P2])
    wanted = pressure_gain(s, c) * error - undriven_gradient(s, c)
    if c[C_DISTURBANCE_OBSERVERS] < 0.5:
        wanted += s[S_INTEGRAL1]
    if valve_stays_shut(error, s, c):
        wanted = 0.0
    last = s[S_U1]
    if c[C_MIRRORED] > 0.5:
        made = drive_mirrored_valve(wanted, s[S_PREDICTED_X], s[S_PREDICTED_P1], s[S_PREDICTED_P2], s, c)
    else:
        volume = chamber_volume_1(s[S_PREDICTED_X], c)
        made = limit_gradient_1(wanted, s[S_PREDICTED_P1], volume, s, c)
        s[S_RATE1] = made
        s[S_U1] = valve_command(wanted, s[S_PREDICTED_P1], volume, s, c)
    if made == wanted:
        s[S_INTEGRAL1] += c[C_PERIOD] * c[C_P_KI] * error
    end: int = C_TABLE + int(c[C_TABLE_NODES]) - 1
    s[S_U1] = compensate_valve_dynamics(s[S_U1], last, S_PLAY1, S_SPOOL1, c[end + int(c[C_TABLE_NODES])], c[end], s, c)


def control_chamber_2(s, c):
    """Set the command of the valve of chamber 2, likewise, if there is one."""
    if c[C_TWO_VALVES] < 0.5:
        return
    x = s[S_PREDICTED_X]
    p2 = s[S_PREDICTED_P2]
    volume = chamber_volume_2(x, c)
    error = s[S_P2_REF] - p2
    alone = valve_gradient_2(null_command_2(c), p2, volume, s, c) + drift_2(
        x, s[S_PREDICTED_V], s[S_PREDICTED_P1], p2, c
    )
    wanted = pressure_gain(s, c) * error - c[C_FEEDFORWARD] * alone - c[C_DISTURBANCE_OBSERVERS] * s[S_FLOW2]
    if c[C_DISTURBANCE_OBSERVERS] < 0.5:
        wanted += s[S_INTEGRAL2]
    if valve_stays_shut(error, s, c):
        wanted = 0.0
    s[S_RATE2] = limit_gradient_2(wanted, p2, volume, s, c)
    if s[S_RATE2] == wanted:
        s[S_INTEGRAL2] += c[C_PERIOD] * c[C_P_KI] * error
    end: int = C_TABLE + 3 * int(c[C_TABLE_NODES]) - 1
    u = valve_command_2(wanted, p2, volume, s, c)
    s[S_U2] = compensate_valve_dynamics(u, s[S_U2], S_PLAY2, S_SPOOL2, c[end + int(c[C_TABLE_NODES])], c[end], s, c)


def cascade_step(x_ref, x, p1, p2, s, c):
    """Advance the controller by one sample: readings in, commands in s[S_U1] and s[S_U2].

    ``x_ref`` is the reference and ``x`` the read position in m; ``p1`` and ``p2`` are the read pressures, absolute in
    Pa. The observers bridge implausible readings.
    """
    x_ref = initialise_at_first_sample(x_ref, x, p1, p2, s, c)
    advance_valve_gradients(s, c)
    observe_pressures(p1, p2, s, c)
    observe_motion(x, s, c)
    predict_to_arrival(s, c)
    if follow_reference(x_ref, s, c):
        set_pressure_references(position_control(x_ref, s, c), s, c)
    control_chamber_1(s, c)
    control_chamber_2(s, c)
