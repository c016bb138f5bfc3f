"""The pressure level: where two valves drive the chambers, the mean of both pressures is free; stiffness goes by it.

The enclosed gas is a spring of ``gamma (A1^2 p1 / V1 + A2^2 p2 / V2)``, thesis (2.14). The level is a reference beside
that of the position: as designed, as a stiffness asks, or as set while it runs; it moves no faster than the valves can
follow.
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

from __future__ import annotations

from pneucli.controller.layout import *
from pneucli.controller.plant import clamp, is_plausible, max_pressure_reference
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
