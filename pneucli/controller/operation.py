"""Operation on a machine, around the sample of a law: enable, hold, bumpless start, measured supply.

In the scalar code of :mod:`pneucli.controller.cascade`: the simulation runs it around every law, the exports write it.
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

import math

from pneucli.controller.commissioning import stop_commissioning
from pneucli.controller.layout import *
from pneucli.controller.observers import initialise_state, settle_valves_and_sensors
from pneucli.controller.plant import clamp, is_plausible, pressure_force, stroke_table
from pneucli.controller.valve_dynamics import (
    chamber_volume_1,
    chamber_volume_2,
    drift_1,
    drift_2,
    null_command_1,
    null_command_2,
    valve_gradient_1,
    valve_gradient_2,
)


def set_supply(p, s, c):
    """Set the measured supply pressure in Pa; ignore an implausible one."""
    if is_plausible(p, 1.1 * c[C_AMBIENT], 3.0 * c[C_SUPPLY]):
        s[S_SUPPLY] = p


def enable(on, s):
    """Enable the controller, or disable it and shut the valves; on enabling, the next readings reset the state.

    ``on`` is 1 or 0, without a unit. Disabling ends a commissioning.
    """
    if on < 0.5:
        stop_commissioning(s)
    if on > 0.5 and s[S_DISABLED] > 0.5:
        s[S_RESET_PHASE] = 2.0
    s[S_DISABLED] = 0.0 if on > 0.5 else 1.0


def pause(on, s):
    """Request a hold at the shortest stopping distance of the reference (``on`` is 1, no unit), or release it."""
    if on < 0.5:
        s[S_HOLD_REQUEST] = 0.0
    elif s[S_HOLD_REQUEST] < 0.5:
        s[S_HOLD_REQUEST] = 1.0


def holding_force(x, s, c):
    """Return the force in N that balances the pressures on a resting piston, less the force of an end stop."""
    force = pressure_force(s, c)
    if x <= 0.005 * c[C_STROKE]:
        return -max(force, 0.0)
    if x >= 0.995 * c[C_STROKE]:
        return -min(force, 0.0)
    return -force


def track_commands(u1, u2, s, c):
    """Set the last commands to u1, u2 (V), and the gradients that they make without delay."""
    s[S_U1] = u1
    s[S_U2] = u2 if c[C_TWO_VALVES] > 0.5 else 0.0
    s[S_RATE1] = valve_gradient_1(u1, s[S_P1], chamber_volume_1(s[S_X], c), s, c)
    s[S_RATE2] = valve_gradient_2(u2 if c[C_TWO_VALVES] > 0.5 else u1, s[S_P2], chamber_volume_2(s[S_X], c), s, c)


def assume_equilibrium(s, c):
    """Initialise estimates and integrals such that piston and pressures are in equilibrium."""
    s[S_INTEGRAL] = -holding_force(s[S_X], s, c)
    s[S_LOAD] = -s[S_INTEGRAL] - stroke_table(s[S_X], 4, c)
    s[S_FLOW1] = -s[S_RATE1] - drift_1(s[S_X], 0.0, s[S_P1], s[S_P2], c)
    s[S_INTEGRAL1] = s[S_RATE1]
    s[S_FLOW2] = -s[S_RATE2] - drift_2(s[S_X], 0.0, s[S_P1], s[S_P2], c)
    s[S_INTEGRAL2] = s[S_RATE2]


def clear_state(s):
    """Clear the state except supply, pressure level, commissioning, and the requests to disable and to hold."""
    off = s[S_DISABLED]
    paused = s[S_HOLD_REQUEST]
    supply = s[S_SUPPLY]
    level = s[S_LEVEL_SET]
    for i in range(L_STATES):
        if i < S_COMMISSIONING or i > S_SWING_PERIOD:
            s[i] = 0.0
    s[S_DISABLED] = off
    s[S_HOLD_REQUEST] = min(paused, 1.0)
    s[S_SUPPLY] = supply
    s[S_LEVEL_SET] = level


def reset(x, p1, p2, u1, u2, s, c):
    """Take over an axis at rest at x (m), p1, p2 (Pa) under the commands u1, u2 (V), without a bump.

    Forces and flows are assumed in equilibrium: the imbalances initialise the estimates of load and flow, or the
    integrals. The difference of the first command of the law from u1, u2 is added as an offset that decays.
    """
    clear_state(s)
    initialise_state(x, x, p1, p2, s, c)
    track_commands(u1, u2, s, c)
    settle_valves_and_sensors(s, c)
    assume_equilibrium(s, c)
    s[S_REF_REST_TIME] = 1.0
    s[S_RESET_PHASE] = 1.0
    s[S_BUMPLESS_OFFSET1] = u1
    s[S_BUMPLESS_OFFSET2] = u2


def active_reference(x_ref, x, p1, p2, s, c):
    """Return the reference of the law: that of the caller, or the position of a hold.

    ``x_ref`` is the reference and ``x`` the read position in m, ``p1`` and ``p2`` are the read pressures in Pa. An axis
    that was disabled is reset first. A start within the tolerance, twice the holding band, holds at once
    (docs/closed-loop.md).
    """
    if s[S_RESET_PHASE] > 1.5:
        reset(x, p1, p2, null_command_1(c), null_command_2(c), s, c)
    if s[S_RESET_PHASE] > 0.5 and math.fabs(x_ref - s[S_X]) < 2.0 * c[C_HOLDING_BAND]:
        s[S_HOLD] = 1.0
        s[S_X_SHAPED] = x_ref
        s[S_X_REF] = x_ref
    if s[S_HOLD_REQUEST] > 0.5 and s[S_HOLD_REQUEST] < 1.5:
        s[S_HOLD_REFERENCE] = stopping_position(x, s, c)
        if math.isfinite(s[S_HOLD_REFERENCE]):
            s[S_HOLD_REQUEST] = 2.0
    return s[S_HOLD_REFERENCE] if s[S_HOLD_REQUEST] > 0.5 else x_ref


def stopping_position(x, s, c):
    """Return the position in m at which the shaped reference stops from now on, or the present pressure reference."""
    if c[C_PRESSURE_MODE] > 0.5:
        return s[S_P1_REF]
    if s[S_STARTED] < 0.5:
        return x
    distance = 0.5 * s[S_V_SHAPED] * math.fabs(s[S_V_SHAPED]) / c[C_A_MAX]
    return clamp(s[S_X_SHAPED] + distance, 0.0, c[C_STROKE])


def bumpless_command(u, offset: int, table: int, s, c):
    """Return a command in V with the offset of the bumpless start, limited to the range of the valve."""
    if s[S_RESET_PHASE] > 0.5:
        s[offset] -= u
    nodes: int = int(c[C_TABLE_NODES])
    return clamp(u + s[offset], c[table + 2 * nodes - 1], c[table + nodes - 1])


def fade_bumpless_offset(s, c):
    """Let the offsets of the bumpless start decay, at a quarter of the corner of the pressure loop."""
    s[S_RESET_PHASE] = 0.0
    s[S_BUMPLESS_OFFSET1] -= min(0.25 * c[C_PERIOD] * c[C_P_KP], 1.0) * s[S_BUMPLESS_OFFSET1]
    s[S_BUMPLESS_OFFSET2] -= min(0.25 * c[C_PERIOD] * c[C_P_KP], 1.0) * s[S_BUMPLESS_OFFSET2]


def close_valves(s, c):
    """Set the commands of a disabled axis: valves shut."""
    s[S_STARTED] = 0.0
    s[S_U1] = null_command_1(c)
    s[S_U2] = null_command_2(c) if c[C_TWO_VALVES] > 0.5 else 0.0


def finish_commands(s, c):
    """Set the output commands: those of the law with the offsets of the bumpless start."""
    if s[S_RESET_PHASE] > 0.5 or s[S_BUMPLESS_OFFSET1] != 0.0 or s[S_BUMPLESS_OFFSET2] != 0.0:
        s[S_U1] = bumpless_command(s[S_U1], S_BUMPLESS_OFFSET1, C_TABLE, s, c)
        if c[C_TWO_VALVES] > 0.5:
            s[S_U2] = bumpless_command(s[S_U2], S_BUMPLESS_OFFSET2, C_TABLE + 2 * int(c[C_TABLE_NODES]), s, c)
        fade_bumpless_offset(s, c)
