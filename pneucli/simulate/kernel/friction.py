"""Set-valued dry friction, LuGre bristles, and the step of the piston."""

import math

from pneucli.simulate.kernel.ports import (
    bristle_damping,
    dry_factor,
    dry_rise,
    has_slowing,
    slowing,
    slowing_viscous,
    static_factor,
    viscous_factor,
)
from pneucli.simulate.layout import *


def friction_levels(direction, speed, x, p1, p2, base, th, on):
    """Return dry friction while speeding up and while slowing; both are equal without hysteresis.

    It is at least 1e-9 N: factors outside their range of validity must not make friction push, and bristles need a
    level. Viscous friction that is less while slowing counts in the second level.

    Args:
        direction: 1 toward +x, -1 toward -x.
        speed: Speed in m/s, not negative.
        x: Position in m.
        p1: Pressure of chamber 1 in Pa.
        p2: Pressure of chamber 2 in Pa.
        base: Base parameters by :mod:`pneucli.simulate.layout`.
        th: Parameters of effects.
        on: Switches of effects.

    Returns:
        Both levels in N.

    References:
        Thesis (3.1), (3.6) and (6.21).
    """
    factor = dry_factor(direction, x, p1, p2, base[AMBIENT], th, on)
    rising = max((base[COULOMB] + dry_rise(base[COULOMB], speed, th, on)) * factor, 1e-9)
    if has_slowing(on):
        lost = (1.0 - slowing_viscous(th, on)) * base[VISCOUS] * viscous_factor(direction, th, on) * speed
        return rising, min(max(base[COULOMB] * slowing(th, on) * factor, 1e-9) - lost, rising)
    return rising, rising


def net_driving_force(drive, rising, falling):
    """Return the driving force along the motion less dry friction in N; 0 between the branches (Filippov).

    Args:
        drive: Driving force less viscous friction, along the motion, in N.
        rising: Dry friction while speeding up in N.
        falling: Dry friction while slowing in N, at most ``rising``.

    >>> net_driving_force(25.0, 20.0, 12.0), net_driving_force(15.0, 20.0, 12.0), net_driving_force(2.0, 20.0, 12.0)
    (5.0, 0.0, -10.0)
    """
    if drive > rising:
        return drive - rising
    if drive < falling:
        return drive - falling
    return 0.0


def hold_or_break_away(x, push, h, rest, m, p1, p2, base, th, on):
    """Stick, or break away and move for a step; implicit in viscous friction.

    Args:
        x: Position in m.
        push: All forces but friction in N.
        h: Step in s.
        rest: Time at rest so far in s.
        m: Moving mass in kg.
        p1: Pressure of chamber 1 in Pa.
        p2: Pressure of chamber 2 in Pa.
        base: Base parameters.
        th: Parameters of effects.
        on: Switches of effects.

    Returns:
        Position in m, velocity in m/s, and the time at rest in s.
    """
    direction = 1.0 if push > 0.0 else -1.0
    rising, _ = friction_levels(direction, 0.0, x, p1, p2, base, th, on)
    if abs(push) <= rising * static_factor(rest, th, on) or h <= 0.0:
        return x, 0.0, rest + h
    c = base[VISCOUS] * viscous_factor(direction, th, on)
    v = direction * (abs(push) - rising) / (m / h + 0.5 * c)
    return x + 0.5 * h * v, v, 0.0


def slide(x, v, v_guess, push, h, rest, m, p1, p2, base, th, on):
    """Move for a step by the midpoint rule, implicit in viscous friction; a piston that would reverse stops first.

    Args:
        x: Position in m.
        v: Velocity in m/s.
        v_guess: Velocity at the midpoint in m/s, for the dry friction of the step.
        push: All forces but friction at the midpoint in N.
        h: Step in s.
        rest: Time at rest so far in s.
        m: Moving mass in kg.
        p1: Pressure of chamber 1 in Pa.
        p2: Pressure of chamber 2 in Pa.
        base: Base parameters.
        th: Parameters of effects.
        on: Switches of effects.

    Returns:
        Position in m, velocity in m/s, and the time at rest in s.

    References:
        Thesis (2.47): the equation of motion.
    """
    if v == 0.0:
        return hold_or_break_away(x, push, h, rest, m, p1, p2, base, th, on)
    direction = 1.0 if v > 0.0 else -1.0
    rising, falling = friction_levels(direction, abs(v_guess), x, p1, p2, base, th, on)
    c = base[VISCOUS] * viscous_factor(direction, th, on)
    v_new = v + direction * net_driving_force(direction * (push - c * v), rising, falling) / (m / h + 0.5 * c)
    if v_new * direction > 0.0:
        return x + 0.5 * h * (v + v_new), v_new, 0.0
    stopped = h * v / (v - v_new)
    return hold_or_break_away(x + 0.5 * stopped * v, push, h - stopped, 0.0, m, p1, p2, base, th, on)


def mean_decay(y):
    """Return (1 - exp(-y)) / y for y >= 0, the mean of exp(-y s) over s = 0..1; below 0.25 by its series, to 5e-8.

    >>> mean_decay(0.0), round(mean_decay(1.0), 6)
    (1.0, 0.632121)
    """
    if y < 0.25:
        return 1.0 - y * (1 / 2 - y * (1 / 6 - y * (1 / 24 - y * (1 / 120 - y * (1 / 720)))))
    return (1.0 - math.exp(-y)) / y


def slide_on_bristles(x, v, z, dv, push, h, m, p1, p2, stiffness, base, th, on):
    """Move for h with LuGre bristles of deflection z; return x, v, z. Implicit in the velocity, exact in z.

    References:
        C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, IEEE Trans. Autom. Control 40 (1995) 419-425.
    """
    direction = 1.0 if v > 0.0 or (v == 0.0 and push > 0.0) else -1.0
    speed = abs(v + 0.5 * dv)
    rising, falling = friction_levels(direction, speed, x, p1, p2, base, th, on)
    level = max(falling, 1e-9) if dv * direction < 0.0 else rising
    sigma = bristle_damping(th, on)
    c = base[VISCOUS] * viscous_factor(direction, th, on)
    # z at midpoint is (z + h/2 v_mid) / (1 + h/2 rate); all is multiplied by the level, which spares two divisions
    rate = stiffness * speed / level
    whole, pull = level + 0.5 * h * stiffness * speed, stiffness * (level - sigma * speed)
    inertia = 2.0 * m / h
    v_mid = (whole * (inertia * v + push) - pull * z) / (whole * (inertia + sigma + c) + 0.5 * h * pull)
    return x + h * v_mid, 2.0 * v_mid - v, z + h * (v_mid - rate * z) * mean_decay(rate * h)


def bristle_force(z, dx, h, level, stiffness, th, on):
    """Return the deflection after a displacement dx within h, and the bristles' force in N, exact in z."""
    rate = stiffness * abs(dx) / level
    change = (dx - rate * z) * mean_decay(rate)
    speed = change / h if h > 0.0 else 0.0
    return z + change, stiffness * (z + change) + bristle_damping(th, on) * speed


def acceleration(v, z, push, dv, rest, x, m, p1, p2, stiffness, base, th, on):
    """Return dv/dt in m/s^2 at one instant, with the friction of the step."""
    direction = 1.0 if v > 0.0 or (v == 0.0 and push > 0.0) else -1.0
    rising, falling = friction_levels(direction, abs(v), x, p1, p2, base, th, on)
    c = base[VISCOUS] * viscous_factor(direction, th, on)
    if stiffness > 0.0:
        level = max(falling, 1e-9) if dv * direction < 0.0 else rising
        flow = v - stiffness * abs(v) / level * z
        return (push - stiffness * z - bristle_damping(th, on) * flow - c * v) / m
    if v == 0.0 and abs(push) <= rising * static_factor(rest, th, on):
        return 0.0
    return direction * net_driving_force(direction * (push - c * v), rising, falling) / m
