"""One step of the plant from scalars to scalars: the piston, the flows of the valves, the gas of both chambers.

The loop over a recording (:mod:`pneucli.simulate.kernel.run`) and the exported plant
(:mod:`pneucli.simulate.kernel.plant`) call these functions, so both have the same equations.
"""

import math

from pneucli.simulate.kernel.chamber import chamber_step, valve_flow
from pneucli.simulate.kernel.friction import acceleration, friction_levels, slide, slide_on_bristles
from pneucli.simulate.kernel.ports import (
    command,
    critical_ratio,
    demand,
    force,
    has_switched,
    leak_1_2,
    leak_1_ambient,
    leak_2_ambient,
    leak_area,
    supply,
    switched,
)
from pneucli.simulate.layout import *


def steps_between(t, t_next, h_max):
    """Return the number of equal steps from one sample to the next.

    Args:
        t: Time of the sample in s.
        t_next: Time of the next sample in s.
        h_max: Longest step in s.

    >>> steps_between(0.0, 1e-3, 2e-4), steps_between(0.0, 1e-3, 3e-4), steps_between(0.0, 1e-4, 3e-4)
    (5, 4, 1)
    """
    return max(math.ceil((t_next - t) / h_max - 1e-9), 1)


def pushing_force(x, v, p1, p2, driven, base, th, on):
    """Return all forces on the piston but friction in N; the arguments are those of :func:`piston_step`."""
    area_1, area_2 = base[AREA_1], base[AREA_2]
    return area_1 * p1 - area_2 * p2 - (area_1 - area_2) * base[AMBIENT] + driven + force(x, v, base[STROKE], th, on)


def piston_step(x, v, z, rest, dv, p1, p2, driven, h, m, stiffness, base, th, on):
    """Advance the piston by a step within the ends of its stroke.

    Args:
        x: Position in m.
        v: Velocity in m/s.
        z: Deflection of the bristles in m.
        rest: Time at rest so far in s.
        dv: Change of the velocity in the last step in m/s.
        p1: Pressure of chamber 1 at the midpoint in Pa.
        p2: Pressure of chamber 2 at the midpoint in Pa.
        driven: Driving force at the midpoint in N.
        h: Step in s.
        m: Moving mass in kg.
        stiffness: Stiffness of the bristles in N/m, 0: rigid.
        base: Base parameters.
        th: Parameters of effects.
        on: Switches of effects.

    Returns:
        Position in m, velocity in m/s, deflection in m, and the time at rest in s.
    """
    lower, upper = base[LOWER_END], base[UPPER_END]
    v_guess = v + 0.5 * dv if (v + 0.5 * dv) * v > 0.0 else v
    push = pushing_force(x + 0.5 * h * v, v_guess, p1, p2, driven, base, th, on)
    v_old, rest_old = v, rest
    if stiffness > 0.0:
        x, v, z = slide_on_bristles(x, v, z, dv, push, h, m, p1, p2, stiffness, base, th, on)
    else:
        x, v, rest = slide(x, v, v_guess, push, h, rest, m, p1, p2, base, th, on)
    if x < lower or x > upper:
        x, v = min(max(x, lower), upper), 0.0
        rest = rest_old + h if v_old == 0.0 else 0.0  # a piston that is pressed against a stop rests
    return x, v, z, rest


def starting_deflection(x, v, p1, p2, driven, stiffness, base, th, on):
    """Return the deflection in m of bristles that hold a piston at rest, or that slide steadily; 0 of a rigid contact.

    The arguments are those of :func:`piston_step`, at the instant.
    """
    if stiffness == 0.0:
        return 0.0
    push = pushing_force(x, v, p1, p2, driven, base, th, on)
    direction = 1.0 if v > 0.0 or (v == 0.0 and push > 0.0) else -1.0
    rising, _ = friction_levels(direction, abs(v), x, p1, p2, base, th, on)
    return direction * (min(abs(push), rising) if v == 0.0 else rising) / stiffness


def piston_acceleration(x, v, z, rest, dv, p1, p2, driven, m, stiffness, base, th, on):
    """Return dv/dt in m/s^2 at one instant; 0 where friction or an end of the stroke holds the piston.

    The arguments are those of :func:`piston_step`, at the instant.
    """
    push = pushing_force(x, v, p1, p2, driven, base, th, on)
    if v == 0.0 and ((x <= base[LOWER_END] and push < 0.0) or (x >= base[UPPER_END] and push > 0.0)):
        return 0.0  # the end carries it
    return acceleration(v, z, push, dv, rest, x, m, p1, p2, stiffness, base, th, on)


def side_of(opening):
    """Return 1.0 where a valve fills, -1.0 where it vents, else 0.0."""
    if opening > 0.0:
        return 1.0
    return -1.0 if opening < 0.0 else 0.0


def valve_step(
    u, u2, p1, p2, p_line, stated, shut, chamber_2: int, q_supply, h, k1, k2, k_gas, u_max, areas, areas_2,
    s1, s2, s_supply, base, th, on,
):  # fmt: skip
    """Advance spools and supply by a step.

    Args:
        u: Command of chamber 1 from the null command in V.
        u2: Command of chamber 2 in V.
        p1: Pressure of chamber 1 at the midpoint in Pa.
        p2: Pressure of chamber 2 at the midpoint in Pa.
        p_line: Measured supply pressure in Pa.
        stated: Whether the supply pressure is the rig's instead.
        shut: Whether the valve of chamber 1 is shut.
        chamber_2: What closes chamber 2.
        q_supply: Mass flow out of the supply in the last step in kg/s.
        h: Step in s.
        k1: Flow constant of the gas of chamber 1 in s/m.
        k2: Flow constant of the gas of chamber 2 in s/m.
        k_gas: Flow constant of the supply's gas in s/m.
        u_max: Largest opening in V.
        areas: Areas in m^2 of chamber 1 over openings of -u_max..u_max.
        areas_2: The same of chamber 2.
        s1: States of effects at the command of chamber 1, changed in place.
        s2: States of effects at the command of chamber 2, changed in place.
        s_supply: States of effects at the supply, changed in place.
        base: Base parameters.
        th: Parameters of effects.
        on: Switches of effects.

    Returns:
        Mass flows in kg/s: into and out of chamber 1, into and out of chamber 2.
    """
    b, leak = critical_ratio(base[CRITICAL], th, on), leak_area(th, on)
    if stated:
        p_line = base[SUPPLY]
    p_line = supply(p_line, base[SUPPLY], q_supply, base[GAMMA] * base[GAS] * base[TEMP], h, s_supply, th, on)
    q_in = q_out = more_in = more_out = 0.0
    place, share, share_2 = 0.0, 1.0, 1.0
    if not shut:
        opening = command(demand(u, p1, base[AMBIENT], th, on), h, s1, th, on)
        if has_switched(on):
            place = switched(side_of(opening), h, s1, th, on)
            opening, share = side_of(place) * u_max, abs(place)
        q_in, q_out = valve_flow(opening, p1, p_line, base[AMBIENT], b, leak, k1, k_gas, u_max, areas, th, on, share)
    if chamber_2 not in (OPEN, CLOSED):
        opening_2 = command(demand(u2, p2, base[AMBIENT], th, on), h, s2, th, on)
        if has_switched(on):
            place = -place if chamber_2 == MIRRORED else switched(side_of(opening_2), h, s2, th, on)
            opening_2, share_2 = side_of(place) * u_max, abs(place)
        more_in, more_out = valve_flow(
            opening_2, p2, p_line, base[AMBIENT], b, leak, k2, k_gas, u_max, areas_2, th, on, share_2
        )
    return q_in, q_out, more_in, more_out


def chamber_1_step(
    p1, p1_mid, p2_mid, m1, h, volume, growth, q_in, q_out, hot, k1, base, th, on
):  # fmt: skip
    """Advance chamber 1 with its leaks; see :func:`pneucli.simulate.kernel.chamber.chamber_step`."""
    q_out += leak_1_2(p1_mid, p2_mid, k1, th, on) + leak_1_ambient(p1_mid, base[AMBIENT], k1, th, on)
    return chamber_step(p1, p1_mid, m1, h, volume, growth, q_in, q_out, hot, base, th, on)


def chamber_2_step(
    p2, p1_mid, p2_mid, m2, h, volume, growth, q_in, q_out, hot, k1, k2, base, th, on
):  # fmt: skip
    """Advance chamber 2 with its leaks; see :func:`pneucli.simulate.kernel.chamber.chamber_step`."""
    q_in += leak_1_2(p1_mid, p2_mid, k1, th, on)
    q_out += leak_2_ambient(p2_mid, base[AMBIENT], k2, th, on)
    return chamber_step(p2, p2_mid, m2, h, volume, growth, q_in, q_out, hot, base, th, on)
