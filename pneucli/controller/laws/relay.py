"""Sliding mode on one line: relay (5.6) with equivalent control (5.9, 5.10).

Surface ``s = x2 + lambda x1`` (5.2) of the error ``x1 = x_r - x`` and its rate, lambda by pole placement or by LQ from
stated weights. ``F = F_eq + M sign(s)``, where ``ds/dt = 0`` gives ``F_eq = m (a_r + lambda x2) + F_fr(v)``; with
``equivalent_control = false`` the relay is alone. M is ``switching_gain`` times breakaway friction
and a usual load.

Discrete time, which the thesis leaves open: the sign is that at the end of the sample (implicit Euler, Acary and
Brogliato 2010), ``s+ = s - T w / m, w in M Sgn(s+)``, which is solved by ``w = min(max(m s / T, -M), M)``: on the
surface the relay gives what a sample needs and no more, so that sampling alone makes it chatter no longer. What the
lag of the pressure loop makes of it remains.
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

from __future__ import annotations

import math

from pneucli.controller.cascade import set_pressure_references
from pneucli.controller.laws.base import ControlLaw
from pneucli.controller.laws.shared_blocks import NEXT_LAW_PARAMETER, pressure_pi, read_sensors
from pneucli.controller.layout import *
from pneucli.controller.plant import clamp, dry_friction
from pneucli.controller.reference import follow_reference

(
    C_RELAY_FORCE,  # N: M
    C_RELAY_SLOPE,  # 1/s: lambda
    C_RELAY_EQUIVALENT,  # 1: with equivalent control, 0: the relay alone
) = range(NEXT_LAW_PARAMETER, NEXT_LAW_PARAMETER + 3)


def relay_force(s, c):
    """Return the force in N (5.10), the sign implicit."""
    rate = s[S_V_SHAPED] - s[S_V]
    line = rate + c[C_RELAY_SLOPE] * (s[S_X_SHAPED] - s[S_X])
    friction = dry_friction(math.fabs(s[S_V]), s, c) * clamp(s[S_V] / c[C_V_FLOOR], -1.0, 1.0)
    friction += c[C_VISCOUS] * s[S_V]
    equivalent = c[C_MASS] * (s[S_A_SHAPED] + c[C_RELAY_SLOPE] * rate) + friction
    return c[C_RELAY_EQUIVALENT] * equivalent + clamp(
        c[C_MASS] * line / c[C_PERIOD], -c[C_RELAY_FORCE], c[C_RELAY_FORCE]
    )


def relay_step(x_ref, x, p1, p2, s, c):
    """Advance the relay by one sample; readings and commands as in step."""
    x_ref = read_sensors(x_ref, x, p1, p2, s, c)
    if follow_reference(x_ref, s, c):
        set_pressure_references(relay_force(s, c), s, c)
    pressure_pi(s, c)


LAW = ControlLaw("relay", "relay with equivalent control on one line", "5.2, 5.6, 5.9, 5.10", relay_step)
