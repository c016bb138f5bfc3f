"""Near a resting reference: the force that frees a piston that sticks off it, and when it is left in peace."""

from __future__ import annotations

import math

from pneucli.controller.layout import *
from pneucli.controller.observers import net_force, pressure_force
from pneucli.controller.plant import clamp, dry_friction_factor, max_pressure_reference, sign, speed_after
from pneucli.controller.valve_dynamics import (
    chamber_volume_1,
    chamber_volume_2,
    gas_stiffness_1,
    gas_stiffness_2,
    valve_gradient_1,
    valve_gradient_2,
)

# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN


def sector_switching_term(error, rate, c):
    """Return the sector's switching term, -1 to 1: both lines' mean sign, continuous between them (5.13)."""
    s1 = rate + c[C_SECTOR_1] * error
    s2 = rate + c[C_SECTOR_2] * error
    total = math.fabs(s1) + math.fabs(s2)
    return (s1 + s2) / total if total > 0.0 else 0.0


def air_stiffness(s, c):
    """Return the stiffness in N/m of the enclosed gas when a command arrives."""
    x = s[S_PREDICTED_X]
    return c[C_GAMMA] * (gas_stiffness_1(x, c) * s[S_PREDICTED_P1] + gas_stiffness_2(x, c) * s[S_PREDICTED_P2])


def max_unloading_rate(direction, s, c):
    """Return by how much in N/s valves that open fully change the force of the pressures toward ``direction``.

    Not less than what moves the pressure level: near ambient or supply pressure there is no force left to take away.
    """
    nodes: int = int(c[C_TABLE_NODES])
    first: int = C_TABLE + nodes - 1 if direction > 0.0 else C_TABLE + 2 * nodes - 1
    second: int = first
    if c[C_TWO_VALVES] > 0.5:
        second = C_TABLE + 4 * nodes - 1 if direction > 0.0 else C_TABLE + 3 * nodes - 1
    rate_1 = valve_gradient_1(c[first], s[S_PREDICTED_P1], chamber_volume_1(s[S_PREDICTED_X], c), s, c)
    rate_2 = valve_gradient_2(c[second], s[S_PREDICTED_P2], chamber_volume_2(s[S_PREDICTED_X], c), s, c)
    return max(math.fabs(c[C_AREA_1] * rate_1 - c[C_AREA_2] * rate_2), c[C_AREA_1] * c[C_LEVEL_RATE])


def net_force_at_arrival(s, c):
    """Return all that drives the piston but friction when a command arrives, in N."""
    return net_force(s[S_PREDICTED_X], s[S_PREDICTED_P1], s[S_PREDICTED_P2], s, c)


def stopping_distance(s, c):
    """Return how far in m the piston goes on when what drives it is taken away as fast as can be.

    From when a command arrives: by the pressure loop, no faster than spool, valves and the gas that expands allow.
    """
    driving = net_force_at_arrival(s, c)
    most = max_unloading_rate(-driving, s, c)
    stiff = air_stiffness(s, c)
    h = 0.1 / c[C_P_KP] + 0.1 * math.fabs(driving) / most
    share = min(h * c[C_P_KP], 1.0)
    spool = h / (h + c[C_PERIOD] * (1.0 / c[C_SPOOL_SHARE] - 1.0))
    opened = 0.0
    v = s[S_PREDICTED_V]
    way = s[S_PREDICTED_X] - s[S_X]
    for i in range(40):  # noqa: B007 - structured text knows no name that begins with _
        opened += spool * (1.0 - opened)
        limit = h * opened * most
        taken = clamp(share * driving, -limit, limit)
        gone = (
            0.5 * h * (v + speed_after(s[S_PREDICTED_X], v, driving - 0.5 * taken, h, s, c))
        )  # by which the gas expands
        limit += stiff * math.fabs(gone)
        taken = clamp(share * driving, -limit, limit)
        faster = speed_after(s[S_PREDICTED_X], v, driving - 0.5 * taken, h, s, c)  # at the middle of the step
        way += 0.5 * h * (v + faster)
        v = faster
        driving -= taken
    return way


def adapt_after_overshoot(error, s, c):
    """Put up with half of a jump over the reference that half the pace did not shorten, once the piston has landed."""
    if s[S_BRAKING_TIME] <= 0.0 or s[S_BRAKING_TIME] > c[C_PERIOD]:
        return
    jump = math.fabs(s[S_X] - s[S_BREAKAWAY_POSITION])
    if s[S_RAMP_GAIN] < 0.5 and jump > math.fabs(error) and jump > 0.7 * s[S_LAST_JUMP]:
        s[S_DEADBAND_GAIN] = clamp(
            0.5 * jump / c[C_HOLDING_BAND], s[S_DEADBAND_GAIN], min(1.5 * s[S_DEADBAND_GAIN], c[C_DEADBAND_GAIN_MAX])
        )
    s[S_LAST_JUMP] = jump


def is_force_saturated(error, s, c):
    """Whether more force toward the reference cannot be had: the pressures are as high, or low, as they may be."""
    two = c[C_TWO_VALVES] > 0.5
    if error > 0.0:
        return s[S_P1_REF] >= max_pressure_reference(s, c) and (not two or s[S_P2_REF] <= c[C_P_LOW])
    return s[S_P1_REF] <= c[C_P_LOW] and (not two or s[S_P2_REF] >= max_pressure_reference(s, c))


def breakaway_ramp(error, s, c):
    """Set the force in N beyond the load that shall free the piston where it sticks off the reference.

    Up to a little below what it took last it rises fast, then slowly; as soon as the piston stirs near the
    reference, the force is taken away and friction stops it. From the third time on that it lands on the other side,
    all goes at half the pace each time, and half as much again is put up with, so that what is
    not modelled does not keep up a limit cycle. Where half the pace did not shorten the jump, another one would bring
    the piston no nearer than half of it: that is put up with.
    """
    h = c[C_PERIOD]
    factor = max(dry_friction_factor(s[S_X], error, s, c), 0.1)
    if error * s[S_LAST_SIGN] < 0.0:
        s[S_RAMP_GAIN] = max(0.5 * s[S_RAMP_GAIN], 0.03)
        if s[S_RAMP_GAIN] < 1.0:
            s[S_DEADBAND_GAIN] = min(1.5 * s[S_DEADBAND_GAIN], c[C_DEADBAND_GAIN_MAX])
    s[S_LAST_SIGN] = sign(error)
    if s[S_MOVING_COUNT] > 0.5 and s[S_BRAKING_TIME] <= 0.0 and s[S_RELEASE_FORCE] * s[S_V] > 0.0:
        if s[S_MOVING_COUNT] == 1.0 and s[S_REST_TIME] > 0.5 * c[C_MOTION_WINDOW]:
            driving = net_force(s[S_X], s[S_P1], s[S_P2], s, c)
            s[S_BREAKAWAY_FORCE] = clamp(math.fabs(driving) / factor, 0.5 * c[C_STATIC], c[C_BREAKAWAY_MAX])
            s[S_BREAKAWAY_POSITION] = s[S_X]
        left = (error - stopping_distance(s, c)) * sign(s[S_RELEASE_FORCE])
        if left < 2.0 * c[C_HOLDING_BAND]:
            s[S_RELEASE_FORCE] = 0.0
            s[S_BRAKING_TIME] = c[C_MOTION_WINDOW]
        elif math.fabs(s[S_V]) < c[C_CLOSING_RATE] * math.fabs(error):  # it creeps: the error is integrated
            more = h * clamp(c[C_MASS] * c[C_KI] * error, -c[C_RAMP_RATE_MAX], c[C_RAMP_RATE_MAX])
            s[S_RELEASE_FORCE] = clamp(s[S_RELEASE_FORCE] + more, -c[C_RELEASE_FORCE_MAX], c[C_RELEASE_FORCE_MAX])
        return
    adapt_after_overshoot(error, s, c)
    s[S_BRAKING_TIME] -= h
    if s[S_BRAKING_TIME] <= 0.0 and not is_force_saturated(error, s, c):
        side = sector_switching_term(error, -s[S_V], c)
        pace = c[C_RAMP_RATE_MAX]
        if net_force_at_arrival(s, c) * sign(error) >= factor * max(0.92 * s[S_BREAKAWAY_FORCE], 0.7 * c[C_STATIC]):
            pace = min(c[C_RAMP_RATE_PER_ERROR] * math.fabs(error), c[C_RAMP_RATE_MAX])
        pace = max(pace * min(s[S_RAMP_GAIN], 1.0), c[C_RAMP_RATE_MIN])
        s[S_RELEASE_FORCE] = clamp(
            s[S_RELEASE_FORCE] + h * pace * side, -c[C_RELEASE_FORCE_MAX], c[C_RELEASE_FORCE_MAX]
        )


def enter_hold(s, c):
    """Leave the piston where it sticks: its force is half loosened, unless it is elastic and would move with it."""
    s[S_HOLD] = 1.0
    s[S_FORCE] = pressure_force(s, c)
    if s[S_ELASTIC] < 0.5:
        s[S_FORCE] -= 0.5 * net_force(s[S_X], s[S_P1], s[S_P2], s, c)
        s[S_RELEASE_FORCE] = 0.0
    s[S_FORCE_RAMP] = 0.0


def update_hold(x_ref, s, c):
    """Whether the piston is left where it sticks, near a resting reference; its force is then half loosened."""
    resting = s[S_REF_REST_TIME] > 0.05 and math.fabs(s[S_V]) < c[C_V_FLOOR]
    off = math.fabs(x_ref - s[S_X])
    reach = c[C_HOLDING_BAND] * s[S_DEADBAND_GAIN]
    if s[S_HOLD] < 0.5 and resting and off < reach:
        enter_hold(s, c)
    elif not resting or off > 1.8 * reach:
        s[S_HOLD] = 0.0
    elif s[S_REST_TIME] > 10.0 * c[C_MOTION_WINDOW]:  # it rests indeed: what sets it off next is something new
        s[S_RAMP_GAIN] = 4.0
    return s[S_HOLD] > 0.5


def pressure_loop_lags(s, c):
    """Whether the pressures are still behind what is asked of them: then no more force is put on."""
    return c[C_AREA_1] * math.fabs(s[S_P1_REF] - s[S_P1]) > c[C_STATIC]


def drive_elastic_piston(error, s, c):
    """Set the force in N beyond the load that brings an elastic piston to its reference.

    It is driven by the error that the piston will have where it stops by itself; each time that it lands on the other
    side a wider error is put up with, so that no limit cycle can go on.
    """
    left = error - s[S_V] / c[C_CLOSING_RATE]
    if error * s[S_LAST_SIGN] < 0.0:
        s[S_DEADBAND_GAIN] = min(1.5 * s[S_DEADBAND_GAIN], c[C_DEADBAND_GAIN_MAX])
        s[S_FORCE_RAMP] = 0.0
    s[S_LAST_SIGN] = sign(error)
    rate = c[C_MASS] * c[C_KI] * math.fabs(left)
    if pressure_loop_lags(s, c):
        rate = 0.0
    elif s[S_MOVING_COUNT] < 0.5:
        rate = max(rate, c[C_RAMP_GROWTH_RATE] * s[S_FORCE_RAMP])
        rate = max(rate, 2.0 * c[C_STATIC])
        s[S_FORCE_RAMP] = min(s[S_FORCE_RAMP] + c[C_PERIOD] * rate, c[C_RELEASE_FORCE_MAX])
    elif left * s[S_V] < 0.0 and s[S_FORCE_RAMP] > 0.0:
        rate = max(rate, c[C_UNLOADING_RATE] * s[S_FORCE_RAMP])
        s[S_FORCE_RAMP] = max(s[S_FORCE_RAMP] - c[C_PERIOD] * rate, 0.0)
    else:
        s[S_FORCE_RAMP] = 0.0
    s[S_RELEASE_FORCE] = clamp(
        s[S_RELEASE_FORCE] + c[C_PERIOD] * rate * sign(left), -c[C_RELEASE_FORCE_MAX], c[C_RELEASE_FORCE_MAX]
    )


def braking_force(error, s, c):
    """Return the force in N that stops a piston near its reference: in proportion to its speed beyond closing in."""
    beyond = s[S_V] - c[C_CLOSING_RATE] * error
    if beyond * s[S_V] <= 0.0:
        return 0.0
    most = 2.0 * c[C_COULOMB] * dry_friction_factor(s[S_X], s[S_V], s, c)
    return -clamp(c[C_BRAKE_DAMPING] * beyond, -most, most)
