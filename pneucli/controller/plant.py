"""What the controller knows of valve and piston, in the scalar code of :mod:`pneucli.controller.cascade`."""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

from __future__ import annotations

import math

from pneucli.controller.layout import *
from pneucli.physics.gas import flow_function


def clamp(value, low, high):
    """Return value within low and high."""
    return low if value < low else high if value > high else value


def sign(value):
    """Return -1, 0 or 1."""
    return 1.0 if value > 0.0 else -1.0 if value < 0.0 else 0.0


def is_plausible(reading, low, high):
    """Whether a reading can be one: finite and within low and high."""
    return math.isfinite(reading) and reading >= low and reading <= high


def stroke_table(x, table: int, c):
    """Return what a table along the stroke has at x in m, linear between its places."""
    last: int = int(c[C_STROKE_NODES]) - 1
    place = clamp(x / c[C_STROKE], 0.0, 1.0) * last
    i: int = min(int(place), last - 1)
    begin: int = C_TABLE + 4 * int(c[C_TABLE_NODES]) + table * (last + 1) + i
    return c[begin] + (place - i) * (c[begin + 1] - c[begin])


def dry_friction_factor(x, direction, s, c):
    """Return the factor on dry friction at x (m) toward ``direction``: along the stroke, and by the pressures."""
    pressed = c[C_DRY_P1] * (s[S_P1] - c[C_AMBIENT]) + c[C_DRY_P2] * (s[S_P2] - c[C_AMBIENT])
    return max(stroke_table(x, 0 if direction > 0.0 else 1, c) * (1.0 + pressed), 0.0)


def dry_friction(speed, s, c):
    """Return dry friction in N at a speed (thesis 3.6) before its factor, with the breakaway force last seen."""
    r = speed / c[C_STRIBECK]
    return c[C_COULOMB] + max(s[S_BREAKAWAY_FORCE] - c[C_COULOMB], 0.0) / (1.0 + r * r)


def damping(x, direction, c):
    """Return what brakes in proportion to the speed at x (m) toward ``direction``, in N s/m."""
    if direction > 0.0:
        return c[C_VISCOUS] + stroke_table(x, 2, c)
    return c[C_VISCOUS_BACK] + stroke_table(x, 3, c)


def speed_after(x, v, force, h, s, c):
    """Return the speed in m/s after h (s) under a force in N, friction as a set: on two branches, or at rest."""
    way = sign(v) if v != 0.0 else sign(force)
    factor = dry_friction_factor(x, way, s, c)
    rising = dry_friction(math.fabs(v), s, c) * factor
    falling = min(c[C_COULOMB] * c[C_DECELERATION_RATIO] * factor, rising) if c[C_DECELERATION_RATIO] < 1.0 else rising
    drive = way * force - damping(x, way, c) * math.fabs(v)
    left = drive - rising if drive > rising else drive - falling if drive < falling else 0.0
    faster = v + way * h * left / c[C_MASS]
    return faster if faster * way > 0.0 else 0.0


def pressure_force_at(p1, p2, c):
    """Return the force of two pressures on the piston in N."""
    return c[C_AREA_1] * p1 - c[C_AREA_2] * p2 - (c[C_AREA_1] - c[C_AREA_2]) * c[C_AMBIENT]


def pressure_force(s, c):
    """Return the force of the observed pressures in N."""
    return pressure_force_at(s[S_P1], s[S_P2], c)


def net_force(x, p1, p2, s, c):
    """Return all that drives the piston at x (m) but friction, in N."""
    return pressure_force_at(p1, p2, c) + stroke_table(x, 4, c) + s[S_LOAD]


def supply_pressure(s, c):
    """Return the supply pressure in Pa: the one that is measured, else the one designed for."""
    return s[S_SUPPLY] if s[S_SUPPLY] > 0.0 else c[C_SUPPLY]


def max_pressure_reference(s, c):
    """Return the highest pressure in Pa that may be asked for: as near to the supply as designed."""
    return c[C_P_HIGH] / c[C_SUPPLY] * supply_pressure(s, c)


def pressure_rate_per_area(filling, p, volume, s, c):
    """Return dp/dt in Pa/s that 1 m^2 of open valve makes in a chamber (2.46): to be filled, or vented."""
    scale = c[C_GAMMA_R_T] * c[C_K_GAS] / volume
    if filling:
        supply = supply_pressure(s, c)
        return scale * supply * flow_function(p / supply, c[C_CRITICAL_RATIO])
    return scale * p * flow_function(c[C_AMBIENT] / p, c[C_CRITICAL_RATIO])


def relative_area(u, begin: int, c):
    """Return the share of the largest area that a command in V opens, by the inverse table that begins there."""
    nodes: int = int(c[C_TABLE_NODES])
    way = sign(c[begin + nodes - 1] - c[begin])
    low: int = 0
    high: int = nodes - 1
    for halved in range(8):  # 2^8 > nodes  # noqa: B007 - structured text knows no name that begins with _
        middle: int = int(0.5 * (low + high))
        if (u - c[begin + middle]) * way >= 0.0:
            low = middle
        else:
            high = middle
    high = min(low + 1, nodes - 1)
    width = (c[begin + high] - c[begin + low]) * way
    part = clamp((u - c[begin + low]) * way / width, 0.0, 1.0) if width > 0.0 else 0.0
    place = (low + part) / (nodes - 1)
    return place * place


def command_for_area(area, most, table: int, c):
    """Return the command in V for an effective area, from the inverse table that begins at ``table``."""
    nodes: int = int(c[C_TABLE_NODES])
    place = math.sqrt(area / most) * (nodes - 1)
    i: int = min(int(place), nodes - 2)
    return c[table + i] + (place - i) * (c[table + i + 1] - c[table + i])


def linear_command(wanted, slope, most, begin: int, c):
    """Return the command in V in proportion to ``wanted``, all of it at ``slope`` x ``most``: what no map inverts."""
    nodes: int = int(c[C_TABLE_NODES])
    null = 0.5 * (c[C_TABLE] + c[C_TABLE + nodes])
    return null + min(math.fabs(wanted) / (slope * most), 1.0) * (c[begin + nodes - 1] - null)


def inverse_valve_map(gradient, p, volume, fill, vent, table: int, s, c):
    """Return the command in V that makes dp/dt in Pa/s at p, by the inverse tables from ``table`` on."""
    nodes: int = int(c[C_TABLE_NODES])
    if gradient == 0.0:
        return 0.5 * (c[table] + c[table + nodes])
    filling = gradient > 0.0
    most = fill if filling else vent
    begin: int = table if filling else table + nodes
    if c[C_INVERSE_MAP] < 0.5:
        return linear_command(gradient, pressure_rate_per_area(filling, c[C_P_MEAN], volume, s, c), most, begin, c)
    slope = pressure_rate_per_area(filling, p, volume, s, c)
    reachable = slope * most > math.fabs(gradient)
    return command_for_area(math.fabs(gradient) / slope if reachable else most, most, begin, c)


def valve_command(gradient, p, volume, s, c):
    """Return the command in V that makes dp/dt in Pa/s in chamber 1: the inverse of its map, clipped at its ends."""
    return inverse_valve_map(gradient, p, volume, c[C_AREA_FILL], c[C_AREA_VENT], C_TABLE, s, c)


def valve_command_2(gradient, p, volume, s, c):
    """Return the same for the valve of chamber 2."""
    begin: int = C_TABLE + 2 * int(c[C_TABLE_NODES])
    return inverse_valve_map(gradient, p, volume, c[C_AREA_FILL_2], c[C_AREA_VENT_2], begin, s, c)


def limit_gradient_1(gradient, p, volume, s, c):
    """Return dp/dt in Pa/s that the valve makes in chamber 1 where ``gradient`` is asked for: cut where it must be."""
    if gradient > 0.0:
        return min(gradient, c[C_AREA_FILL] * pressure_rate_per_area(True, p, volume, s, c))
    return max(gradient, -c[C_AREA_VENT] * pressure_rate_per_area(False, p, volume, s, c))


def limit_gradient_2(gradient, p, volume, s, c):
    """Return the same for chamber 2."""
    if gradient > 0.0:
        return min(gradient, c[C_AREA_FILL_2] * pressure_rate_per_area(True, p, volume, s, c))
    return max(gradient, -c[C_AREA_VENT_2] * pressure_rate_per_area(False, p, volume, s, c))


def drive_mirrored_valve(wanted, x, p1, p2, s, c):
    """Set the one command of a 5/3 valve: what fills one chamber vents the other; return what of ``wanted`` it makes.

    ``wanted`` is the rate of the force over the first area in Pa/s with the piston at x (m) and both pressures (Pa).
    The paths of chamber 2 are taken to open in proportion to those of chamber 1.
    """
    share = c[C_AREA_2] / c[C_AREA_1]
    if wanted == 0.0:
        s[S_RATE1] = 0.0
        s[S_RATE2] = 0.0
        s[S_U1] = 0.5 * (c[C_TABLE] + c[C_TABLE + int(c[C_TABLE_NODES])])
        return 0.0
    filling = wanted > 0.0
    way = 1.0 if filling else -1.0
    most = c[C_AREA_FILL] if filling else c[C_AREA_VENT]
    ratio = (c[C_AREA_VENT_2] if filling else c[C_AREA_FILL_2]) / most
    volume_1 = c[C_DEAD_VOLUME_1] + c[C_AREA_1] * x
    volume_2 = c[C_DEAD_VOLUME_2] + c[C_AREA_2] * (c[C_STROKE] - x)
    slope_1 = pressure_rate_per_area(filling, p1, volume_1, s, c)
    slope_2 = ratio * pressure_rate_per_area(not filling, p2, volume_2, s, c)
    slope = slope_1 + share * slope_2
    enough = slope * most > math.fabs(wanted)
    area = math.fabs(wanted) / slope if enough else most
    s[S_RATE1] = way * area * slope_1
    s[S_RATE2] = -way * area * slope_2
    begin: int = C_TABLE if filling else C_TABLE + int(c[C_TABLE_NODES])
    s[S_U1] = command_for_area(area, most, begin, c)
    if c[C_INVERSE_MAP] < 0.5:
        usual = pressure_rate_per_area(filling, c[C_P_MEAN], volume_1, s, c) + share * ratio * pressure_rate_per_area(
            not filling, c[C_P_MEAN], volume_2, s, c
        )
        s[S_U1] = linear_command(wanted, usual, most, begin, c)
    return wanted if enough else way * area * slope
