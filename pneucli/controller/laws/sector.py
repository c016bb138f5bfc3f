"""Sliding sector, thesis (5.11) to (5.14), between lines from the vertices of the friction model (6.9) to (6.20).

``x1 = x - x_r``, ``x2 = v - v_r``, lines ``s_r = x2 + lambda_r x1``; ``lambda2 - lambda1 = a2 - a1`` and the width
``alpha = lambda2 / lambda1`` give ``lambda1 = (a2 - a1) / (alpha - 1)`` (6.18) to (6.20). Both lines have the same
equivalent force ``m (a1 - lambda1) x2`` (6.16); a moving reference adds mass and friction on its way.
``u_d = -M`` above both lines, ``+M`` below both, ``-M (s1 + s2) / (|s1| + |s2|)`` between them (5.13).

The load estimate (5.15) to (5.21), (7.5), (7.6) is subtracted, so that M need not hold a load.

Discrete time: the whole law is taken at the end of the sample (implicit Euler, Acary and Brogliato 2010), with dry
friction as a set. The rate y at that time solves ``(1 + lambda1 T) y + (T / m) (M phi(x1 + T y, y) + f) = x2`` with
``phi = (s1 + s2) / (|s1| + |s2|)`` and f the dry friction Sgn(y + v_r) less its feed-forward. The left side increases
with y and has one root, found by bisection. A piston that sticks has y = -v_r and gets all of M.
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

import math
from typing import Any

from pneucli.controller.cascade import friction_feedforward, set_pressure_references
from pneucli.controller.laws.base import ControlLaw, LawParameters
from pneucli.controller.laws.load_observer import observe_load
from pneucli.controller.laws.shared_blocks import NEXT_LAW_PARAMETER, feedforward_force, pressure_pi, read_sensors
from pneucli.controller.layout import *
from pneucli.controller.plant import dry_friction, sign
from pneucli.controller.reference import follow_reference

(
    C_SECTOR_FORCE,  # N: M
    C_LAMBDA_1,  # 1/s: slopes lambda1 and lambda2 of the lines, and the lower vertex a1
    C_LAMBDA_2,
    C_VERTEX_1,
) = range(NEXT_LAW_PARAMETER + 2, NEXT_LAW_PARAMETER + 6)


def sector_sign(x1, x2, c):
    """Return phi, -1 to 1: the sign of both lines outside the sector, continuous within it (5.13)."""
    s1 = x2 + c[C_LAMBDA_1] * x1
    s2 = x2 + c[C_LAMBDA_2] * x1
    total = math.fabs(s1) + math.fabs(s2)
    return (s1 + s2) / total if total > 0.0 else 0.0


def implicit_error_rate(x1, x2, s, c):
    """Return the rate of the error in m/s at the end of the sample, from error (m) and rate (m/s) before it."""
    h = c[C_PERIOD]
    damping = 1.0 + c[C_LAMBDA_1] * h
    switching = h * c[C_SECTOR_FORCE] / c[C_MASS]
    friction = h * dry_friction(math.fabs(s[S_V]), s, c) / c[C_MASS]
    ahead = h * friction_feedforward(s, c) / c[C_MASS]
    low = (x2 - switching - 2.0 * friction - math.fabs(ahead)) / damping
    high = (x2 + switching + 2.0 * friction + math.fabs(ahead)) / damping
    for _i in range(60):
        y = 0.5 * (low + high)
        residual = friction * sign(y + s[S_V_SHAPED]) - ahead
        if damping * y + switching * sector_sign(x1 + h * y, y, c) + residual > x2:
            high = y
        else:
            low = y
    return 0.5 * (low + high)


def sector_force(s, c):
    """Return the force in N: equivalent (6.16) and switching (5.13) at the end of the sample, and feed-forward."""
    x1 = s[S_X] - s[S_X_SHAPED]
    x2 = s[S_V] - s[S_V_SHAPED]
    y = implicit_error_rate(x1, x2, s, c)
    equivalent = c[C_MASS] * (c[C_VERTEX_1] - c[C_LAMBDA_1]) * y
    return equivalent - c[C_SECTOR_FORCE] * sector_sign(x1 + c[C_PERIOD] * y, y, c) + feedforward_force(s, c)


def sector_step(x_ref, x, p1, p2, s, c):
    """Advance the sliding sector by one sample; readings and commands as in cascade_step."""
    x_ref = read_sensors(x_ref, x, p1, p2, s, c)
    observe_load(s, c)
    if follow_reference(x_ref, s, c):
        set_pressure_references(sector_force(s, c) - s[S_LOAD], s, c)
    pressure_pi(s, c)


def sector_parameters(data: Any) -> LawParameters:
    """Return the parameters of sector and load observer: M in N, slopes and the smaller vertex in 1/s.

    Raises:
        InputError: The model has no dry friction.

    References:
        Thesis (5.11) to (5.14), (6.18) to (6.20), (7.5), (7.6).
    """
    sector = data.sector
    return {
        **data.shared_parameters(),
        **data.load_observer_parameters(friction=True),
        "C_SECTOR_FORCE": data.switching_force,
        "C_LAMBDA_1": sector.lambda_1,
        "C_LAMBDA_2": sector.lambda_2,
        "C_VERTEX_1": sector.a_1,
    }


LAW = ControlLaw(
    "sector",
    "sliding sector from the direct TP friction model",
    "5.11-5.14, 6.9-6.20",
    sector_step,
    sector_parameters,
    place=50,
    estimates_load=True,
)
