"""One sample of the controller, in scalar code that numba compiles and :mod:`pneucli.export.c` writes as C.

Only scalars, the two arrays of :mod:`pneucli.design.layout` (``s`` state, ``c`` parameters and inverse tables),
``math`` and the functions here; a local that holds an integer is annotated where it is set.
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

from __future__ import annotations

import math

from pneucli.design.layout import *
from pneucli.design.plant import (
    both_ways,
    clamp,
    dry_friction,
    highest,
    reached,
    reached_2,
    sign,
    usable,
    valve_command,
    valve_command_2,
)


def start(x_ref, x, p1, p2, s, c):
    """Set the state from the first readings: all at rest, no disturbance known."""
    s[S_STARTED] = 1.0
    s[S_X] = x if usable(x, -c[C_STROKE], 2.0 * c[C_STROKE]) else 0.5 * c[C_STROKE]
    s[S_P1] = p1 if usable(p1, 0.3 * c[C_AMBIENT], 2.0 * c[C_SUPPLY]) else c[C_P_MEAN]
    s[S_P2] = p2 if usable(p2, 0.3 * c[C_AMBIENT], 2.0 * c[C_SUPPLY]) else s[S_P1]
    s[S_X_REF] = x_ref
    s[S_X_SHAPED] = s[S_X]
    s[S_FORCE] = c[C_AREA_1] * s[S_P1] - c[C_AREA_2] * s[S_P2] - (c[C_AREA_1] - c[C_AREA_2]) * c[C_AMBIENT]
    s[S_P1_REF] = s[S_P1]
    s[S_P2_REF] = s[S_P2]
    s[S_ANCHOR] = s[S_X]
    s[S_BREAK] = c[C_STATIC]


def begin(x_ref, x, p1, p2, s, c):
    """Start from the first sample; return the reference, the last one where it is missing."""
    if not math.isfinite(x_ref):
        x_ref = s[S_X_REF] if s[S_STARTED] > 0.5 else x
    if s[S_STARTED] < 0.5:
        start(x_ref, x, p1, p2, s, c)
    return x_ref


def reference_rate(x_ref, s, c):
    """Return the reference's filtered rate in m/s; a sample at which the rate itself jumps is passed over."""
    raw = (x_ref - s[S_X_REF]) / c[C_PERIOD]
    if math.fabs(raw - s[S_RAW]) < 10.0 * c[C_A_MAX] * c[C_PERIOD]:
        s[S_V_REF] += (raw - s[S_V_REF]) * min(c[C_PERIOD] / c[C_SHAPE], 1.0)
    s[S_RAW] = raw
    s[S_X_REF] = x_ref
    return s[S_V_REF]


def shape_reference(x_ref, s, c):
    """Follow the reference within limits of closing speed and acceleration, exactly where it keeps to them.

    Discrete time-optimal control (Han's fhan) of the distance to the reference and of its rate.
    """
    h = c[C_PERIOD]
    v_ref = reference_rate(x_ref, s, c)
    linear = c[C_A_MAX] * c[C_SHAPE] * c[C_SHAPE]
    lead = c[C_SHAPE] * (s[S_V_SHAPED] - v_ref)
    total = s[S_X_SHAPED] - x_ref + lead
    a = lead + total
    if math.fabs(total) >= linear:
        a = lead + 0.5 * sign(total) * (math.sqrt(linear * (linear + 8.0 * math.fabs(total))) - linear)
    v = s[S_V_SHAPED] - h * c[C_A_MAX] * clamp(a / linear, -1.0, 1.0)
    v = clamp(v, v_ref - c[C_V_MAX], v_ref + c[C_V_MAX])
    s[S_A_SHAPED] = (v - s[S_V_SHAPED]) / h
    s[S_X_SHAPED] += 0.5 * h * (s[S_V_SHAPED] + v)
    s[S_V_SHAPED] = v
    still = math.fabs(v) < c[C_V_FLOOR] and math.fabs(s[S_X_SHAPED] - x_ref) < 0.5 * c[C_REACH]
    s[S_REST] = s[S_REST] + h if still and s[S_RAW] == 0.0 else 0.0


def observe_pressures(p1, p2, s, c):
    """Observe p1 and p2: the valve's map and an integrator, driven by what it leaves over (thesis 7.9-7.11)."""
    h = c[C_PERIOD]
    volume_1 = c[C_DEAD_1] + c[C_AREA_1] * s[S_X]
    volume_2 = c[C_DEAD_2] + c[C_AREA_2] * (c[C_STROKE] - s[S_X])
    s[S_P1] += h * (s[S_RATE1] + s[S_FLOW1] - c[C_GAMMA] * s[S_P1] * c[C_AREA_1] * s[S_V] / volume_1)
    s[S_P2] += h * (s[S_RATE2] + s[S_FLOW2] + c[C_GAMMA] * s[S_P2] * c[C_AREA_2] * s[S_V] / volume_2)
    if usable(p1, 0.3 * c[C_AMBIENT], 2.0 * c[C_SUPPLY]):
        off = p1 - s[S_P1]
        s[S_P1] += c[C_OBS_P] * off
        s[S_FLOW1] += clamp(c[C_OBS_FLOW] * off, -c[C_FLOW_STEP], c[C_FLOW_STEP])
    if usable(p2, 0.3 * c[C_AMBIENT], 2.0 * c[C_SUPPLY]):
        off = p2 - s[S_P2]
        s[S_P2] += c[C_OBS_P] * off
        s[S_FLOW2] += clamp(c[C_OBS_FLOW] * off, -c[C_FLOW_STEP], c[C_FLOW_STEP])


def pressure_force(s, c):
    """Return the force of the observed pressures in N."""
    return c[C_AREA_1] * s[S_P1] - c[C_AREA_2] * s[S_P2] - (c[C_AREA_1] - c[C_AREA_2]) * c[C_AMBIENT]


def observe_motion(x, s, c):
    """Observe motion and load: the piston with set-valued friction, driven by what it leaves over (5.18-5.21).

    What is left over enters as the switching term, at most C_LOAD_STEP a sample around the filtered equivalent value
    of the last one. While the piston is not seen to stir, friction is whatever holds it, and nothing is left over.
    """
    h = c[C_PERIOD]
    s[S_ANCHOR] += (s[S_X] - s[S_ANCHOR]) * min(h / c[C_LINGER], 1.0)
    s[S_STIRS] = s[S_STIRS] + 1.0 if math.fabs(s[S_X] - s[S_ANCHOR]) > 0.25 * c[C_REACH] else 0.0
    force = pressure_force(s, c) + s[S_LOAD]
    free = s[S_V] + h * (force - c[C_VISCOUS] * s[S_V]) / c[C_MASS]
    brake = h * dry_friction(math.fabs(s[S_V]), s, c) / c[C_MASS]
    v = free - clamp(free, -brake, brake)
    if v * s[S_V] < 0.0 or s[S_STIRS] < 0.5:
        v = 0.0
    s[S_X] = clamp(s[S_X] + 0.5 * h * (s[S_V] + v), 0.0, c[C_STROKE])
    s[S_V] = v
    if usable(x, -0.05 * c[C_STROKE], 1.05 * c[C_STROKE]):
        off = x - s[S_X]
        s[S_X] += c[C_OBS_X] * off
        s[S_V] += c[C_OBS_V] * off
        if s[S_STIRS] > 0.5:
            s[S_LOAD] += clamp(c[C_OBS_LOAD] * off, -c[C_LOAD_STEP], c[C_LOAD_STEP])


def switching(error, rate, c):
    """Return the sector's switching term, -1 to 1: both lines' mean sign, continuous between them (5.13)."""
    s1 = rate + c[C_SECTOR_1] * error
    s2 = rate + c[C_SECTOR_2] * error
    total = math.fabs(s1) + math.fabs(s2)
    return (s1 + s2) / total if total > 0.0 else 0.0


def loosen(error, s, c):
    """Set the force in N beyond the load that shall free the piston where it sticks off the reference.

    Up to a little below what it took last it rises fast, then slowly; as soon as the piston stirs near the
    reference, the force is taken away and friction stops it. From the third time on that it lands on the other side,
    all goes at half the pace each time, so that what is not modelled does not keep up a limit cycle.
    """
    h = c[C_PERIOD]
    if error * s[S_SIDE] < 0.0:
        s[S_EAGER] = max(0.5 * s[S_EAGER], 0.03)
    s[S_SIDE] = sign(error)
    if s[S_STIRS] > 0.5 and s[S_BRAKE] <= 0.0 and s[S_STICK] * s[S_V] > 0.0:
        if s[S_STIRS] == 1.0:
            s[S_BREAK] = clamp(math.fabs(pressure_force(s, c) + s[S_LOAD]), 0.5 * c[C_STATIC], 2.0 * c[C_STATIC])
        if math.fabs(error) < 2.0 * c[C_REACH] or error * s[S_STICK] < 0.0:
            s[S_STICK] = 0.0
            s[S_BRAKE] = c[C_LINGER]
        return
    s[S_BRAKE] -= h
    if s[S_BRAKE] <= 0.0:
        side = switching(error, -s[S_V], c)
        pace = c[C_SECTOR_FAST]
        if (pressure_force(s, c) + s[S_LOAD]) * sign(error) >= max(0.92 * s[S_BREAK], 0.7 * c[C_STATIC]):
            pace = min(c[C_SECTOR_RATE] * math.fabs(error), c[C_SECTOR_FAST])
        pace = max(pace * min(s[S_EAGER], 1.0), c[C_SECTOR_SLOW])
        s[S_STICK] = clamp(s[S_STICK] + h * pace * side, -3.0 * c[C_STATIC], 3.0 * c[C_STATIC])


def hold(x_ref, s, c):
    """Whether the piston is left where it sticks, near a resting reference; its force is then half loosened."""
    resting = s[S_REST] > 0.05 and math.fabs(s[S_V]) < c[C_V_FLOOR]
    off = math.fabs(x_ref - s[S_X])
    if s[S_HOLD] < 0.5 and resting and off < c[C_REACH]:
        s[S_HOLD] = 1.0
        s[S_EAGER] = 4.0
        s[S_FORCE] = 0.5 * (pressure_force(s, c) - s[S_LOAD])
        s[S_STICK] = 0.0
    elif not resting or off > 2.0 * c[C_REACH]:
        s[S_HOLD] = 0.0
    return s[S_HOLD] > 0.5


def dry_ahead(s, c):
    """Return the dry friction in N on the shaped reference's way; its direction fades below the least speed."""
    return dry_friction(math.fabs(s[S_V_SHAPED]), s, c) * clamp(s[S_V_SHAPED] / c[C_V_FLOOR], -1.0, 1.0)


def position_law(x_ref, s, c):
    """Return the force in N that the pressures shall make: PID, friction ahead, minus the load, the sector at rest."""
    error = s[S_X_SHAPED] - s[S_X]
    rate = s[S_V_SHAPED] - s[S_V]
    if c[C_HOLD] > 0.5 and hold(x_ref, s, c):
        return s[S_FORCE]
    ahead = c[C_AHEAD]
    force = c[C_MASS] * (ahead * s[S_A_SHAPED] + c[C_KD] * rate + c[C_KP] * error)
    force += ahead * c[C_VISCOUS] * s[S_V_SHAPED]
    if c[C_SWITCHING] > 0.5 and s[S_REST] > 0.05:
        loosen(error, s, c)
    else:
        s[S_STICK] = 0.0
        s[S_EAGER] = 4.0
    force = force + ahead * dry_ahead(s, c) + s[S_STICK]
    if c[C_ESTIMATES] > 0.5:
        return force - s[S_LOAD]
    s[S_INTEGRAL] += c[C_PERIOD] * c[C_MASS] * c[C_KI] * error
    return force + s[S_INTEGRAL]


def pressure_references(force, s, c):
    """Set the pressure references in Pa from the force, within what supply and ambient allow; keep what is left."""
    bias = (c[C_AREA_1] - c[C_AREA_2]) * c[C_AMBIENT]
    if c[C_TWO_VALVES] > 0.5:
        both = (force + bias - (c[C_AREA_1] - c[C_AREA_2]) * c[C_P_MEAN]) / (c[C_AREA_1] + c[C_AREA_2])
        s[S_P2_REF] = clamp(c[C_P_MEAN] - both, c[C_P_LOW], highest(s, c))
        wanted = (force + bias + c[C_AREA_2] * s[S_P2_REF]) / c[C_AREA_1]
    else:
        s[S_P2_REF] = s[S_P2]
        wanted = (force + bias + c[C_AREA_2] * s[S_P2]) / c[C_AREA_1]
    s[S_P1_REF] = clamp(wanted, c[C_P_LOW], highest(s, c))
    lost = c[C_AREA_1] * (s[S_P1_REF] - wanted)
    s[S_FORCE] = force + lost
    # anti-windup: what was not reachable is taken back from the integral
    if lost * s[S_INTEGRAL] < 0.0:
        s[S_INTEGRAL] += sign(lost) * min(math.fabs(lost), math.fabs(s[S_INTEGRAL]))


def pressure_wanted(p_ref, s, c):
    """Set the pressure of chamber 1 in Pa that is asked for itself; a second valve keeps the mean pressure."""
    s[S_X_REF] = p_ref
    s[S_P1_REF] = clamp(p_ref, c[C_P_LOW], highest(s, c))
    s[S_P2_REF] = c[C_P_MEAN] if c[C_TWO_VALVES] > 0.5 else s[S_P2]


def follow_reference(x_ref, s, c):
    """Take the reference in; whether it is a position, else it is the pressure of chamber 1."""
    if c[C_PRESSURE] > 0.5:
        pressure_wanted(x_ref, s, c)
        return False
    shape_reference(x_ref, s, c)
    return True


def quiet(error, s, c):
    """Whether a valve stays shut: the piston is held, and its pressure is near enough."""
    return s[S_HOLD] > 0.5 and math.fabs(error) < c[C_P_BAND]


def chamber_1(s, c):
    """Set the command of the valve at chamber 1: the piston's motion ahead and minus the other flows, or a PI alone."""
    volume = c[C_DEAD_1] + c[C_AREA_1] * s[S_X]
    error = s[S_P1_REF] - s[S_P1]
    wanted = c[C_P_KP] * error
    wanted += c[C_AHEAD] * c[C_GAMMA] * s[S_P1] * c[C_AREA_1] * s[S_V] / volume - c[C_ESTIMATES] * s[S_FLOW1]
    if c[C_TWO_VALVES] < 0.5:
        volume_2 = c[C_DEAD_2] + c[C_AREA_2] * (c[C_STROKE] - s[S_X])
        wanted += c[C_AHEAD] * c[C_AREA_2] / c[C_AREA_1] * c[C_GAMMA] * s[S_P2] * c[C_AREA_2] * s[S_V] / volume_2
    if c[C_MIRRORED] > 0.5:
        wanted += c[C_ESTIMATES] * c[C_AREA_2] / c[C_AREA_1] * s[S_FLOW2]
    if c[C_ESTIMATES] < 0.5:
        wanted += s[S_INTEGRAL1]
    if quiet(error, s, c):
        wanted = 0.0
    if c[C_MIRRORED] > 0.5:
        made = both_ways(wanted, s, c)
    else:
        made = reached(wanted, s[S_P1], volume, s, c)
        s[S_RATE1] = made
        s[S_U1] = valve_command(wanted, s[S_P1], volume, s, c)
    if made == wanted:
        s[S_INTEGRAL1] += c[C_PERIOD] * c[C_P_KI] * error


def chamber_2(s, c):
    """Set the command of the valve at chamber 2, likewise, where there is one."""
    if c[C_TWO_VALVES] < 0.5:
        return
    volume = c[C_DEAD_2] + c[C_AREA_2] * (c[C_STROKE] - s[S_X])
    error = s[S_P2_REF] - s[S_P2]
    wanted = c[C_P_KP] * error
    wanted -= c[C_AHEAD] * c[C_GAMMA] * s[S_P2] * c[C_AREA_2] * s[S_V] / volume + c[C_ESTIMATES] * s[S_FLOW2]
    if c[C_ESTIMATES] < 0.5:
        wanted += s[S_INTEGRAL2]
    if quiet(error, s, c):
        wanted = 0.0
    s[S_RATE2] = reached_2(wanted, s[S_P2], volume, s, c)
    if s[S_RATE2] == wanted:
        s[S_INTEGRAL2] += c[C_PERIOD] * c[C_P_KI] * error
    s[S_U2] = valve_command_2(wanted, s[S_P2], volume, s, c)


def step(x_ref, x, p1, p2, s, c):
    """Advance the controller by one sample: readings in, commands in s[S_U1] and s[S_U2].

    Positions in m, pressures absolute in Pa. A reading that cannot be one is bridged by what the observers expect.
    """
    x_ref = begin(x_ref, x, p1, p2, s, c)
    observe_pressures(p1, p2, s, c)
    observe_motion(x, s, c)
    if follow_reference(x_ref, s, c):
        pressure_references(position_law(x_ref, s, c), s, c)
    chamber_1(s, c)
    chamber_2(s, c)
