"""Near a resting reference, a piston whose seals are elastic: it moves with the force from the first newton on.

While it sticks, the force grows in proportion to what it has already grown by, so that where it starts to move is not
passed by far. Once it moves, the error is integrated; near the reference the force is left as it is.
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

from __future__ import annotations

import math

from pneucli.design.layout import *
from pneucli.design.plant import clamp, dry_share, sign


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
