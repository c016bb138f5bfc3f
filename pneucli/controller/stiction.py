"""Near a resting reference: the force that frees a piston that sticks off it, and when it is left in peace."""

from __future__ import annotations

import math

from pneucli.controller.layout import *
from pneucli.controller.observers import pressure_force, pushing
from pneucli.controller.plant import clamp, dry_share, highest, sign, slid
from pneucli.controller.valve_dynamics import gradient_1, gradient_2, space_1, space_2, spring_1, spring_2

# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN


def switching(error, rate, c):
    """Return the sector's switching term, -1 to 1: both lines' mean sign, continuous between them (5.13)."""
    s1 = rate + c[C_SECTOR_1] * error
    s2 = rate + c[C_SECTOR_2] * error
    total = math.fabs(s1) + math.fabs(s2)
    return (s1 + s2) / total if total > 0.0 else 0.0


def air_spring(s, c):
    """Return the stiffness in N/m of the enclosed gas when a command arrives."""
    x = s[S_AHEAD_X]
    return c[C_GAMMA] * (spring_1(x, c) * s[S_AHEAD_P1] + spring_2(x, c) * s[S_AHEAD_P2])


def relief(way, s, c):
    """Return by how much in N/s valves that open fully change the force of the pressures toward ``way``.

    Not less than what moves the pressure level: near ambient or supply pressure there is no force left to take away.
    """
    nodes: int = int(c[C_NODES])
    first: int = C_TABLE + nodes - 1 if way > 0.0 else C_TABLE + 2 * nodes - 1
    second: int = first
    if c[C_TWO_VALVES] > 0.5:
        second = C_TABLE + 4 * nodes - 1 if way > 0.0 else C_TABLE + 3 * nodes - 1
    rate_1 = gradient_1(c[first], s[S_AHEAD_P1], space_1(s[S_AHEAD_X], c), s, c)
    rate_2 = gradient_2(c[second], s[S_AHEAD_P2], space_2(s[S_AHEAD_X], c), s, c)
    return max(math.fabs(c[C_AREA_1] * rate_1 - c[C_AREA_2] * rate_2), c[C_AREA_1] * c[C_LEVEL_RATE])


def coming(s, c):
    """Return all that drives the piston but friction when a command arrives, in N."""
    return pushing(s[S_AHEAD_X], s[S_AHEAD_P1], s[S_AHEAD_P2], s, c)


def coasts(s, c):
    """Return how far in m the piston goes on when what drives it is taken away as fast as can be.

    From when a command arrives: by the pressure loop, no faster than spool, valves and the gas that expands allow.
    """
    driving = coming(s, c)
    most = relief(-driving, s, c)
    stiff = air_spring(s, c)
    h = 0.1 / c[C_P_KP] + 0.1 * math.fabs(driving) / most
    share = min(h * c[C_P_KP], 1.0)
    spool = h / (h + c[C_PERIOD] * (1.0 / c[C_SPOOL] - 1.0))
    opened = 0.0
    v = s[S_AHEAD_V]
    way = s[S_AHEAD_X] - s[S_X]
    for i in range(40):  # noqa: B007 - structured text knows no name that begins with _
        opened += spool * (1.0 - opened)
        limit = h * opened * most
        taken = clamp(share * driving, -limit, limit)
        gone = 0.5 * h * (v + slid(s[S_AHEAD_X], v, driving - 0.5 * taken, h, s, c))  # by which the gas expands
        limit += stiff * math.fabs(gone)
        taken = clamp(share * driving, -limit, limit)
        faster = slid(s[S_AHEAD_X], v, driving - 0.5 * taken, h, s, c)  # at the middle of the step
        way += 0.5 * h * (v + faster)
        v = faster
        driving -= taken
    return way


def landed(error, s, c):
    """Put up with half of a jump over the reference that half the pace did not shorten, once the piston has landed."""
    if s[S_BRAKE] <= 0.0 or s[S_BRAKE] > c[C_PERIOD]:
        return
    jump = math.fabs(s[S_X] - s[S_FREED])
    if s[S_EAGER] < 0.5 and jump > math.fabs(error) and jump > 0.7 * s[S_JUMP]:
        s[S_WIDE] = clamp(0.5 * jump / c[C_REACH], s[S_WIDE], min(1.5 * s[S_WIDE], c[C_WIDEST]))
    s[S_JUMP] = jump


def at_its_end(error, s, c):
    """Whether more force toward the reference cannot be had: the pressures are as high, or low, as they may be."""
    two = c[C_TWO_VALVES] > 0.5
    if error > 0.0:
        return s[S_P1_REF] >= highest(s, c) and (not two or s[S_P2_REF] <= c[C_P_LOW])
    return s[S_P1_REF] <= c[C_P_LOW] and (not two or s[S_P2_REF] >= highest(s, c))


def loosen(error, s, c):
    """Set the force in N beyond the load that shall free the piston where it sticks off the reference.

    Up to a little below what it took last it rises fast, then slowly; as soon as the piston stirs near the
    reference, the force is taken away and friction stops it. From the third time on that it lands on the other side,
    all goes at half the pace each time, and half as much again is put up with, so that what is
    not modelled does not keep up a limit cycle. Where half the pace did not shorten the jump, another one would bring
    the piston no nearer than half of it: that is put up with.
    """
    h = c[C_PERIOD]
    factor = max(dry_share(s[S_X], error, s, c), 0.1)
    if error * s[S_SIDE] < 0.0:
        s[S_EAGER] = max(0.5 * s[S_EAGER], 0.03)
        if s[S_EAGER] < 1.0:
            s[S_WIDE] = min(1.5 * s[S_WIDE], c[C_WIDEST])
    s[S_SIDE] = sign(error)
    if s[S_STIRS] > 0.5 and s[S_BRAKE] <= 0.0 and s[S_STICK] * s[S_V] > 0.0:
        if s[S_STIRS] == 1.0 and s[S_STILL] > 0.5 * c[C_LINGER]:
            driving = pushing(s[S_X], s[S_P1], s[S_P2], s, c)
            s[S_BREAK] = clamp(math.fabs(driving) / factor, 0.5 * c[C_STATIC], c[C_BREAK_MOST])
            s[S_FREED] = s[S_X]
        left = (error - coasts(s, c)) * sign(s[S_STICK])
        if left < 2.0 * c[C_REACH]:
            s[S_STICK] = 0.0
            s[S_BRAKE] = c[C_LINGER]
        elif math.fabs(s[S_V]) < c[C_CLOSING] * math.fabs(error):  # it creeps: the error is integrated
            more = h * clamp(c[C_MASS] * c[C_KI] * error, -c[C_SECTOR_FAST], c[C_SECTOR_FAST])
            s[S_STICK] = clamp(s[S_STICK] + more, -c[C_STICK_MOST], c[C_STICK_MOST])
        return
    landed(error, s, c)
    s[S_BRAKE] -= h
    if s[S_BRAKE] <= 0.0 and not at_its_end(error, s, c):
        side = switching(error, -s[S_V], c)
        pace = c[C_SECTOR_FAST]
        if coming(s, c) * sign(error) >= factor * max(0.92 * s[S_BREAK], 0.7 * c[C_STATIC]):
            pace = min(c[C_SECTOR_RATE] * math.fabs(error), c[C_SECTOR_FAST])
        pace = max(pace * min(s[S_EAGER], 1.0), c[C_SECTOR_SLOW])
        s[S_STICK] = clamp(s[S_STICK] + h * pace * side, -c[C_STICK_MOST], c[C_STICK_MOST])


def settle_down(s, c):
    """Leave the piston where it sticks: its force is half loosened, unless it is elastic and would move with it."""
    s[S_HOLD] = 1.0
    s[S_FORCE] = pressure_force(s, c)
    if s[S_ELASTIC] < 0.5:
        s[S_FORCE] -= 0.5 * pushing(s[S_X], s[S_P1], s[S_P2], s, c)
        s[S_STICK] = 0.0
    s[S_TRIED] = 0.0


def hold(x_ref, s, c):
    """Whether the piston is left where it sticks, near a resting reference; its force is then half loosened."""
    resting = s[S_REST] > 0.05 and math.fabs(s[S_V]) < c[C_V_FLOOR]
    off = math.fabs(x_ref - s[S_X])
    reach = c[C_REACH] * s[S_WIDE]
    if s[S_HOLD] < 0.5 and resting and off < reach:
        settle_down(s, c)
    elif not resting or off > 1.8 * reach:
        s[S_HOLD] = 0.0
    elif s[S_STILL] > 10.0 * c[C_LINGER]:  # it rests indeed: what sets it off next is something new
        s[S_EAGER] = 4.0
    return s[S_HOLD] > 0.5


def behind(s, c):
    """Whether the pressures are still behind what is asked of them: then no more force is put on."""
    return c[C_AREA_1] * math.fabs(s[S_P1_REF] - s[S_P1]) > c[C_STATIC]


def carry(error, s, c):
    """Set the force in N beyond the load that brings an elastic piston to its reference.

    It is driven by the error that the piston will have where it stops by itself; each time that it lands on the other
    side a wider error is put up with, so that no limit cycle can go on.
    """
    left = error - s[S_V] / c[C_CLOSING]
    if error * s[S_SIDE] < 0.0:
        s[S_WIDE] = min(1.5 * s[S_WIDE], c[C_WIDEST])
        s[S_TRIED] = 0.0
    s[S_SIDE] = sign(error)
    rate = c[C_MASS] * c[C_KI] * math.fabs(left)
    if behind(s, c):
        rate = 0.0
    elif s[S_STIRS] < 0.5:
        rate = max(rate, c[C_GROWTH] * s[S_TRIED])
        rate = max(rate, 2.0 * c[C_STATIC])
        s[S_TRIED] = min(s[S_TRIED] + c[C_PERIOD] * rate, c[C_STICK_MOST])
    elif left * s[S_V] < 0.0 and s[S_TRIED] > 0.0:
        rate = max(rate, c[C_UNLOADING] * s[S_TRIED])
        s[S_TRIED] = max(s[S_TRIED] - c[C_PERIOD] * rate, 0.0)
    else:
        s[S_TRIED] = 0.0
    s[S_STICK] = clamp(s[S_STICK] + c[C_PERIOD] * rate * sign(left), -c[C_STICK_MOST], c[C_STICK_MOST])


def braking(error, s, c):
    """Return the force in N that stops a piston near its reference: in proportion to its speed beyond closing in."""
    beyond = s[S_V] - c[C_CLOSING] * error
    if beyond * s[S_V] <= 0.0:
        return 0.0
    most = 2.0 * c[C_COULOMB] * dry_share(s[S_X], s[S_V], s, c)
    return -clamp(c[C_BRAKE] * beyond, -most, most)
