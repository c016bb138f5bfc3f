"""Model of piston, valve map and forces in the controller, in the scalar code of :mod:`pneucli.controller.cascade`.

Source: thesis (2.43) and (2.46) for the flow, (2.47-2.52) for chambers and piston, (3.6) and (3.7) for friction on two
branches, 7.4 for the inverse valve map. ``s`` is the state and ``c`` the constants of :mod:`pneucli.controller.layout`.
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

import math

from pneucli.controller.layout import *
from pneucli.physics.gas import flow_function


def clamp(value, low, high):
    """Return ``value`` limited to [``low``, ``high``], all in one unit."""
    return low if value < low else high if value > high else value


def sign(value):
    """Return the sign of ``value``, whatever its unit: -1, 0 or 1."""
    return 1.0 if value > 0.0 else -1.0 if value < 0.0 else 0.0


def is_plausible(reading, low, high):
    """Whether ``reading`` is finite and within [``low``, ``high``], all in one unit."""
    return math.isfinite(reading) and reading >= low and reading <= high


def stroke_table(x, table: int, c):
    """Return the entry of a table along the stroke at x (m), linear between its nodes."""
    last: int = int(c[C_STROKE_NODES]) - 1
    place = clamp(x / c[C_STROKE], 0.0, 1.0) * last
    i: int = min(int(place), last - 1)
    begin: int = C_TABLE + 4 * int(c[C_TABLE_NODES]) + table * (last + 1) + i
    return c[begin] + (place - i) * (c[begin + 1] - c[begin])


def dry_friction_factor(x, direction, s, c):
    """Return the factor on dry friction at x (m) toward ``direction``: position, pressures, what was learnt."""
    pressed = c[C_DRY_P1] * (s[S_P1] - c[C_AMBIENT]) + c[C_DRY_P2] * (s[S_P2] - c[C_AMBIENT])
    return max(stroke_table(x, 0 if direction > 0.0 else 1, c) * (1.0 + pressed), 0.0) * (1.0 + s[S_ADDED_FRICTION])


def dry_friction(speed, s, c):
    """Return dry friction in N at a speed (m/s) by thesis (3.6), with the last break-away force, before its factor."""
    r = speed / c[C_STRIBECK]
    return c[C_COULOMB] + max(s[S_BREAKAWAY_FORCE] - c[C_COULOMB], 0.0) / (1.0 + r * r)


def damping(x, direction, c):
    """Return the viscous damping in N s/m at x (m) toward ``direction``."""
    if direction > 0.0:
        return c[C_VISCOUS] + stroke_table(x, 2, c)
    return c[C_VISCOUS_BACK] + stroke_table(x, 3, c)


def speed_after(x, v, force, h, s, c):
    """Return the speed in m/s after ``h`` (s) under ``force`` (N), with set-valued friction: two branches, or sticking.

    ``x`` is the position in m and ``v`` the speed in m/s at the start of the step.
    """
    way = sign(v) if v != 0.0 else sign(force)
    factor = dry_friction_factor(x, way, s, c)
    rising = dry_friction(math.fabs(v), s, c) * factor
    falling = rising
    if c[C_DECELERATION_RATIO] >= 0.0:
        falling = min(c[C_COULOMB] * c[C_DECELERATION_RATIO] * factor, rising)
    drive = way * force - damping(x, way, c) * math.fabs(v)
    left = drive - rising if drive > rising else drive - falling if drive < falling else 0.0
    faster = v + way * h * left / c[C_MASS]
    return faster if faster * way > 0.0 else 0.0


def is_held_for_good(s, c):
    """Whether the piston is held and has long been at rest."""
    return s[S_HOLD] > 0.5 and s[S_REST_TIME] > 10.0 * c[C_MOTION_WINDOW]


def pressure_force_at(p1, p2, c):
    """Return the force of two pressures on the piston in N."""
    return c[C_AREA_1] * p1 - c[C_AREA_2] * p2 - (c[C_AREA_1] - c[C_AREA_2]) * c[C_AMBIENT]


def pressure_force(s, c):
    """Return the force of the observed pressures in N."""
    return pressure_force_at(s[S_P1], s[S_P2], c)


def net_force(x, p1, p2, s, c):
    """Return the net force in N without friction at x (m): p1, p2 (Pa), forces of the stroke, estimated load."""
    return pressure_force_at(p1, p2, c) + stroke_table(x, 4, c) + s[S_LOAD]


def supply_pressure(s, c):
    """Return the measured supply pressure in Pa, or that of the design without a measurement."""
    return s[S_SUPPLY] if s[S_SUPPLY] > 0.0 else c[C_SUPPLY]


def max_pressure_reference(s, c):
    """Return the largest pressure reference in Pa at the present supply pressure."""
    return c[C_P_HIGH] / c[C_SUPPLY] * supply_pressure(s, c)


def pressure_rate_per_area(filling, p, volume, s, c):
    """Return dp/dt in Pa/s per m^2 of effective area, thesis (2.46), while ``filling`` or venting.

    ``p`` is the pressure of the chamber in Pa, ``volume`` its volume in m^3. Not below 0: the sense of the flow is the
    caller's.
    """
    scale = c[C_GAMMA_R_T] * c[C_K_GAS] / volume
    if filling:
        supply = supply_pressure(s, c)
        return scale * supply * flow_function(p / supply, c[C_CRITICAL_RATIO])
    return scale * p * flow_function(c[C_AMBIENT] / p, c[C_CRITICAL_RATIO])


def relative_area(u, begin: int, c):
    """Return the effective area at a command ``u`` (V) over the largest, from the inverse table at ``begin``."""
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
    """Return the command in V for an effective area (m^2), from the inverse table at ``table``."""
    nodes: int = int(c[C_TABLE_NODES])
    place = math.sqrt(area / most) * (nodes - 1)
    i: int = min(int(place), nodes - 2)
    return c[table + i] + (place - i) * (c[table + i + 1] - c[table + i])


def linear_command(wanted, slope, most, begin: int, c):
    """Return the command in V proportional to ``wanted``, fully open at ``slope`` x ``most``: no inverse map."""
    nodes: int = int(c[C_TABLE_NODES])
    null = 0.5 * (c[C_TABLE] + c[C_TABLE + nodes])
    return null + min(math.fabs(wanted) / (slope * most), 1.0) * (c[begin + nodes - 1] - null)


def inverse_valve_map(gradient, p, volume, fill, vent, table: int, s, c):
    """Return the command in V for a gradient in Pa/s at p (Pa), by the inverse tables from ``table`` on."""
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
    """Return the command in V for ``gradient`` (Pa/s) in chamber 1, limited to the identified range.

    ``p`` is the pressure in Pa, ``volume`` the volume of the chamber in m^3.
    """
    return inverse_valve_map(gradient, p, volume, c[C_AREA_FILL], c[C_AREA_VENT], C_TABLE, s, c)


def valve_command_2(gradient, p, volume, s, c):
    """Return the command in V for ``gradient`` (Pa/s) in chamber 2, limited to the identified range.

    ``p`` is the pressure in Pa, ``volume`` the volume of the chamber in m^3.
    """
    begin: int = C_TABLE + 2 * int(c[C_TABLE_NODES])
    return inverse_valve_map(gradient, p, volume, c[C_AREA_FILL_2], c[C_AREA_VENT_2], begin, s, c)


def limit_gradient_1(gradient, p, volume, s, c):
    """Return ``gradient`` (Pa/s) limited to what the valve of chamber 1 makes at ``p`` (Pa) in ``volume`` (m^3)."""
    if gradient > 0.0:
        return min(gradient, c[C_AREA_FILL] * pressure_rate_per_area(True, p, volume, s, c))
    return max(gradient, -c[C_AREA_VENT] * pressure_rate_per_area(False, p, volume, s, c))


def limit_gradient_2(gradient, p, volume, s, c):
    """Return ``gradient`` (Pa/s) limited to what the valve of chamber 2 makes at ``p`` (Pa) in ``volume`` (m^3)."""
    if gradient > 0.0:
        return min(gradient, c[C_AREA_FILL_2] * pressure_rate_per_area(True, p, volume, s, c))
    return max(gradient, -c[C_AREA_VENT_2] * pressure_rate_per_area(False, p, volume, s, c))


def mirrored_command(target, low, high, slope_1, slope_2, table_1: int, table_2: int, c):
    """Return the command in V between ``low`` and ``high`` at which both paths of a 5/3 valve make ``target`` (Pa/s).

    ``slope_1`` and ``slope_2`` are the rates at the largest area of each path; both paths open monotonically.
    """
    for halved in range(40):  # 2^-40 of the command's range  # noqa: B007 - structured text: no names that begin with _
        middle = 0.5 * (low + high)
        if slope_1 * relative_area(middle, table_1, c) + slope_2 * relative_area(middle, table_2, c) < target:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def drive_mirrored_valve(wanted, x, p1, p2, s, c):
    """Set the command of a 5/3 valve, which fills one chamber and vents the other; return the rate that it reaches.

    ``wanted`` and the result are the rate of the pressure force over the first area in Pa/s, with the piston at ``x``
    (m) and the pressures ``p1`` and ``p2`` (Pa). Each chamber has its own inverse table; the command solves the sum of
    both rates.
    """
    nodes: int = int(c[C_TABLE_NODES])
    ratio = c[C_AREA_2] / c[C_AREA_1]
    s[S_RATE1] = 0.0
    s[S_RATE2] = 0.0
    s[S_U1] = 0.5 * (c[C_TABLE] + c[C_TABLE + nodes])
    if wanted == 0.0:
        return 0.0
    filling = wanted > 0.0
    direction = 1.0 if filling else -1.0
    table_1: int = C_TABLE if filling else C_TABLE + nodes
    table_2: int = C_TABLE + 3 * nodes if filling else C_TABLE + 2 * nodes
    volume_1 = c[C_DEAD_VOLUME_1] + c[C_AREA_1] * x
    volume_2 = c[C_DEAD_VOLUME_2] + c[C_AREA_2] * (c[C_STROKE] - x)
    area_1 = c[C_AREA_FILL] if filling else c[C_AREA_VENT]
    area_2 = c[C_AREA_VENT_2] if filling else c[C_AREA_FILL_2]
    max_1 = area_1 * pressure_rate_per_area(filling, p1, volume_1, s, c)
    max_2 = area_2 * pressure_rate_per_area(not filling, p2, volume_2, s, c)
    reached = min(math.fabs(wanted), max_1 + ratio * max_2)
    low = direction * min(direction * c[table_1], direction * c[table_2])
    high = direction * max(direction * c[table_1 + nodes - 1], direction * c[table_2 + nodes - 1])
    u = mirrored_command(reached, low, high, max_1, ratio * max_2, table_1, table_2, c)
    s[S_RATE1] = direction * max_1 * relative_area(u, table_1, c)
    s[S_RATE2] = -direction * max_2 * relative_area(u, table_2, c)
    s[S_U1] = u
    if c[C_INVERSE_MAP] < 0.5:
        mean_1 = pressure_rate_per_area(filling, c[C_P_MEAN], volume_1, s, c)
        mean_2 = pressure_rate_per_area(not filling, c[C_P_MEAN], volume_2, s, c)
        s[S_U1] = linear_command(wanted, area_1 * mean_1 + ratio * area_2 * mean_2, 1.0, table_1, c)
    return direction * reached
