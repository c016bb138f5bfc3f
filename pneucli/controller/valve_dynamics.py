"""Play, spool and hose between command and chamber: forward for the observers, inverted for the command.

The play precedes the spool, a first-order lag; a delay line holds the openings that are on their way through the hose.
:mod:`pneucli.design.effect_compensation` identifies each from the response of the model.
Source of the gradients: thesis (2.14) for the motion, (2.22) and (2.46) for the flow; ``s`` is the state and ``c`` the
constants of :mod:`pneucli.controller.layout`.
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

import math

from pneucli.controller.layout import *
from pneucli.controller.plant import clamp, pressure_rate_per_area, relative_area
from pneucli.physics.gas import orifice_flow


def null_command_1(c):
    """Return the command in V at which the valve of chamber 1 is shut."""
    return 0.5 * (c[C_TABLE] + c[C_TABLE + int(c[C_TABLE_NODES])])


def null_command_2(c):
    """Return the command in V at which the valve of chamber 2 is shut; that of the one spool if it drives both."""
    begin: int = C_TABLE + 2 * int(c[C_TABLE_NODES])
    return 0.5 * (c[begin] + c[begin + int(c[C_TABLE_NODES])]) if c[C_TWO_VALVES] > 0.5 else null_command_1(c)


def apply_valve_dynamics(u, play: int, spool: int, s, c):
    """Advance play and spool by a sample under a command u (V); return the mean opening in V over the sample."""
    s[play] = clamp(s[play], u - c[C_PLAY], u + c[C_PLAY])
    before = s[spool]
    s[spool] += c[C_SPOOL_SHARE] * (s[play] - before)
    return before + c[C_SPOOL_MEAN_SHARE] * (s[play] - before)


def delay_line_advance(s):
    """Advance the common index of all delay lines, which are ring buffers."""
    s[S_LINE_INDEX] = s[S_LINE_INDEX] + 1.0 if s[S_LINE_INDEX] < S_OPENING_LINE2 - S_OPENING_LINE1 - 1.5 else 0.0


def delay_line_read(row: int, back: int, s):
    """Return the entry of a delay line ``back`` samples ago."""
    place: int = int(s[S_LINE_INDEX]) - back
    return s[row + place] if place >= 0 else s[row + place + S_OPENING_LINE2 - S_OPENING_LINE1]


def delay_line_update(value, row: int, wait, s):
    """Append a value to a delay line; return the value ``wait`` samples ago, linear between two entries."""
    place: int = int(s[S_LINE_INDEX])
    s[row + place] = value
    back: int = int(wait)
    last = delay_line_read(row, back, s)
    return last + (wait - back) * (delay_line_read(row, back + 1, s) - last)


def delay_line_fill(row: int, value, s):
    """Set all entries of the delay line at ``row`` to ``value``, in the unit of what it delays (V or Pa)."""
    for i in range(S_OPENING_LINE2 - S_OPENING_LINE1):
        s[row + i] = value


def valve_gradient_1(u, p, volume, s, c):
    """Return dp/dt in Pa/s of chamber 1 at p (Pa) in a volume (m^3) by an opening u (V) and the leaks of the valve."""
    fill = c[C_LEAK_VALVE]
    vent = c[C_LEAK_VALVE]
    if u > null_command_1(c):
        fill += c[C_AREA_FILL] * relative_area(u, C_TABLE, c)
    else:
        vent += c[C_AREA_VENT] * relative_area(u, C_TABLE + int(c[C_TABLE_NODES]), c)
    return fill * pressure_rate_per_area(True, p, volume, s, c) - vent * pressure_rate_per_area(False, p, volume, s, c)


def valve_gradient_2(u, p, volume, s, c):
    """Return dp/dt in Pa/s of chamber 2: by its own valve, by the one spool of a 5/3 valve, or zero.

    ``u`` is the opening in V of that valve or spool, ``p`` the pressure in Pa, ``volume`` the volume in m^3.
    """
    nodes: int = int(c[C_TABLE_NODES])
    fill = c[C_LEAK_VALVE]
    vent = c[C_LEAK_VALVE]
    if c[C_TWO_VALVES] < 0.5 and c[C_MIRRORED] < 0.5:
        return 0.0
    if c[C_MIRRORED] > 0.5:
        if u > null_command_1(c):
            vent += c[C_AREA_VENT_2] * relative_area(u, C_TABLE + 3 * nodes, c)
        else:
            fill += c[C_AREA_FILL_2] * relative_area(u, C_TABLE + 2 * nodes, c)
    elif u > null_command_2(c):
        fill += c[C_AREA_FILL_2] * relative_area(u, C_TABLE + 2 * nodes, c)
    else:
        vent += c[C_AREA_VENT_2] * relative_area(u, C_TABLE + 3 * nodes, c)
    return fill * pressure_rate_per_area(True, p, volume, s, c) - vent * pressure_rate_per_area(False, p, volume, s, c)


def leak_flow_1(p1, p2, c):
    """Return the leak flow in kg/s out of chamber 1, to ambient and to chamber 2."""
    out = c[C_LEAK_1] * orifice_flow(p1, c[C_AMBIENT], c[C_CRITICAL_RATIO], c[C_K_GAS], c[C_K_GAS])
    return out + c[C_LEAK_12] * orifice_flow(p1, p2, c[C_CRITICAL_RATIO], c[C_K_GAS], c[C_K_GAS])


def leak_flow_2(p1, p2, c):
    """Return the leak flow in kg/s out of chamber 2, to ambient and to chamber 1."""
    out = c[C_LEAK_2] * orifice_flow(p2, c[C_AMBIENT], c[C_CRITICAL_RATIO], c[C_K_GAS], c[C_K_GAS])
    return out - c[C_LEAK_12] * orifice_flow(p1, p2, c[C_CRITICAL_RATIO], c[C_K_GAS], c[C_K_GAS])


def chamber_volume_1(x, c):
    """Return the volume of chamber 1 in m^3 with the piston at x in m."""
    return c[C_DEAD_VOLUME_1] + c[C_AREA_1] * x


def chamber_volume_2(x, c):
    """Return the volume of chamber 2 in m^3 with the piston at x in m."""
    return c[C_DEAD_VOLUME_2] + c[C_AREA_2] * (c[C_STROKE] - x)


def gas_stiffness_1(x, c):
    """Return A^2 / V of chamber 1 in m; times gamma and pressure it is the stiffness of the enclosed gas in N/m."""
    return c[C_AREA_1] * c[C_AREA_1] / chamber_volume_1(x, c)


def gas_stiffness_2(x, c):
    """Return A^2 / V of chamber 2 in m; times gamma and pressure it is the stiffness of the enclosed gas in N/m."""
    return c[C_AREA_2] * c[C_AREA_2] / chamber_volume_2(x, c)


def drift_1(x, v, p1, p2, c):
    """Return dp1/dt in Pa/s by motion and leaks, without the valve, at x (m), v (m/s), p1 and p2 (Pa)."""
    volume = chamber_volume_1(x, c)
    return -(c[C_GAMMA_R_T] * leak_flow_1(p1, p2, c) + c[C_GAMMA] * p1 * c[C_AREA_1] * v) / volume


def drift_2(x, v, p1, p2, c):
    """Return dp2/dt in Pa/s by motion and leaks, without the valve, at x (m), v (m/s), p1 and p2 (Pa)."""
    volume = chamber_volume_2(x, c)
    return (c[C_GAMMA] * p2 * c[C_AREA_2] * v - c[C_GAMMA_R_T] * leak_flow_2(p1, p2, c)) / volume


def compensate_valve_dynamics(u, last, play: int, spool: int, low, high, s, c):
    """Return the command in V, limited to [low, high], that inverts spool and play for the opening u (V).

    A change within the dead band of the play keeps the ``last`` command, so that noise does not cross the play. While
    the piston is held there is no hurry, and the spool is not led.
    """
    target = u if s[S_HOLD] > 0.5 else s[spool] + c[C_SPOOL_LEAD] * (u - s[spool]) / c[C_SPOOL_SHARE]
    if math.fabs(target - s[play]) < c[C_PLAY_DEADBAND]:
        return last
    if target > s[play]:
        return clamp(target + c[C_PLAY], low, high)
    return clamp(target - c[C_PLAY], low, high)
