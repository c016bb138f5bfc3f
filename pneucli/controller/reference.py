"""Reference of the controller: a position shaped to the limits of the axis, and the level of the pressures.

Where two valves drive the chambers, the mean of both pressures is free, and stiffness goes by it: the enclosed gas is a
spring of ``gamma (A1^2 p1 / V1 + A2^2 p2 / V2)``, thesis (2.14). This level is a second reference: as designed, as a
stiffness asks, or as set while it runs; it moves no faster than the valves can follow.
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

import math

from pneucli.controller.layout import *
from pneucli.controller.plant import clamp, is_plausible, max_pressure_reference, sign
from pneucli.controller.valve_dynamics import gas_stiffness_1, gas_stiffness_2


def set_level(p, s, c):
    """Set the mean of both pressures in Pa, 0: as designed; ignore an implausible one."""
    if is_plausible(p, 0.0, 3.0 * c[C_SUPPLY]):
        s[S_LEVEL_SET] = p


def requested_level(even, s, c):
    """Return the requested level in Pa for a force of ``even`` (Pa) times the sum of both areas.

    Then p1 is level (1 - unequal) + even and p2 is level (1 + unequal) - even, which the stiffness is solved for.
    """
    if s[S_LEVEL_SET] > 0.0:
        return s[S_LEVEL_SET]
    if c[C_AIR_STIFFNESS] <= 0.0:
        return c[C_P_MEAN]
    one = gas_stiffness_1(s[S_X], c)
    two = gas_stiffness_2(s[S_X], c)
    unequal = (c[C_AREA_1] - c[C_AREA_2]) / (c[C_AREA_1] + c[C_AREA_2])
    wanted = c[C_AIR_STIFFNESS] / c[C_GAMMA] - even * (one - two)
    return wanted / (one * (1.0 - unequal) + two * (1.0 + unequal))


def update_level(force, s, c):
    """Advance the pressure level by a sample at a pressure force (N) without ambient pressure; return it in Pa."""
    asked = clamp(requested_level(force / (c[C_AREA_1] + c[C_AREA_2]), s, c), c[C_P_LOW], max_pressure_reference(s, c))
    if s[S_LEVEL] <= 0.0:
        s[S_LEVEL] = clamp(0.5 * (s[S_P1] + s[S_P2]), c[C_P_LOW], max_pressure_reference(s, c))
    most = c[C_PERIOD] * c[C_LEVEL_RATE]
    s[S_LEVEL] += clamp(asked - s[S_LEVEL], -most, most)
    return s[S_LEVEL]


def reference_rate(x_ref, s, c):
    """Return the filtered rate of the reference in m/s; the filter ignores samples at which the rate jumps.

    Second order, both time constants are the shaping time; no lag at constant acceleration.
    """
    h = c[C_PERIOD]
    raw = (x_ref - s[S_X_REF]) / h
    if math.fabs(raw - s[S_RAW_RATE]) < 10.0 * c[C_A_MAX] * h:
        share = min(h / c[C_SHAPING_TIME], 1.0)
        off = raw - s[S_V_REF] - h * s[S_A_REF]
        s[S_V_REF] += h * s[S_A_REF] + share * (2.0 - share) * off
        s[S_A_REF] += share * share * off / h
    s[S_RAW_RATE] = raw
    s[S_X_REF] = x_ref
    return s[S_V_REF] + 0.5 * h * s[S_A_REF]


def shape_reference(x_ref, s, c):
    """Shape the reference to limits of closing speed and acceleration; within them it passes unchanged.

    Discrete time-optimal control (fhan, Han 2009) of distance and rate to the reference of the last sample, with the
    acceleration of the reference as feed-forward.
    """
    h = c[C_PERIOD]
    v_ref = reference_rate(x_ref, s, c)
    v_last = v_ref - h * s[S_A_REF]
    linear = c[C_A_MAX] * c[C_SHAPING_TIME] * c[C_SHAPING_TIME]
    lead = c[C_SHAPING_TIME] * (s[S_V_SHAPED] - v_last)
    total = s[S_X_SHAPED] - (x_ref - 0.5 * h * (v_last + v_ref)) + lead
    a = lead + total
    if math.fabs(total) >= linear:
        a = lead + 0.5 * sign(total) * (math.sqrt(linear * (linear + 8.0 * math.fabs(total))) - linear)
    v = s[S_V_SHAPED] + h * c[C_A_MAX] * clamp(s[S_A_REF] / c[C_A_MAX] - clamp(a / linear, -1.0, 1.0), -1.0, 1.0)
    v = clamp(v, v_ref - c[C_V_MAX], v_ref + c[C_V_MAX])
    s[S_A_SHAPED] = (v - s[S_V_SHAPED]) / h
    s[S_X_SHAPED] += 0.5 * h * (s[S_V_SHAPED] + v)
    s[S_V_SHAPED] = v
    at_rest = math.fabs(v) < c[C_V_FLOOR] and math.fabs(s[S_X_SHAPED] - x_ref) < 0.5 * c[C_HOLDING_BAND]
    s[S_REF_REST_TIME] = s[S_REF_REST_TIME] + h if at_rest and s[S_RAW_RATE] == 0.0 else 0.0


def set_pressure_reference(p_ref, s, c):
    """Set the pressure reference of chamber 1 in Pa; a second valve keeps the mean pressure."""
    s[S_X_REF] = p_ref
    s[S_P1_REF] = clamp(p_ref, c[C_P_LOW], max_pressure_reference(s, c))
    s[S_P2_REF] = requested_level(0.0, s, c) if c[C_TWO_VALVES] > 0.5 else s[S_P2]


def follow_reference(x_ref, s, c):
    """Process the reference, in m or Pa; return whether it is a position (else the pressure of chamber 1)."""
    if c[C_PRESSURE_MODE] > 0.5:
        set_pressure_reference(x_ref, s, c)
        return False
    shape_reference(x_ref, s, c)
    return True
