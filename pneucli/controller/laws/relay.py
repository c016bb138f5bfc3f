"""Sliding mode on one line: relay (5.6) with equivalent control (5.9), (5.10) of the thesis.

Surface ``s = x2 + lambda x1`` (5.2) of the error ``x1 = x_r - x`` and its rate x2; lambda by pole placement or by LQ.
``F = F_eq + M sign(s)``, where ``ds/dt = 0`` gives ``F_eq = m (a_r + lambda x2) + F_friction(v)``. With
``equivalent_control = false`` the relay acts alone. M is ``switching_gain`` times break-away friction and nominal load.

``relay = "switching"``: the sign of the reading, as the thesis writes it; it chatters between -M and M.
``relay = "implicit"``: the sign at the end of the sample (implicit Euler, Acary and Brogliato 2010),
``s+ = s - T w / m, w in M Sgn(s+)``, solved by ``w = min(max(m s / T, -M), M)``: on the surface the relay gives the
force that one sample needs, and sampling alone makes it chatter no longer.
"""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

import math
from typing import Any

from pneucli.controller.cascade import set_pressure_references
from pneucli.controller.laws.base import ControlLaw, LawParameters
from pneucli.controller.laws.shared_blocks import NEXT_LAW_PARAMETER, pressure_pi, read_sensors
from pneucli.controller.layout import *
from pneucli.controller.plant import clamp, dry_friction, sign
from pneucli.controller.reference import follow_reference

(
    C_RELAY_FORCE,  # N: M
    C_RELAY_SLOPE,  # 1/s: lambda
    C_RELAY_EQUIVALENT,  # 1: with equivalent control, 0: the relay alone
    C_RELAY_IMPLICIT,  # 1: sign at the end of the sample, 0: sign of the reading
) = range(NEXT_LAW_PARAMETER, NEXT_LAW_PARAMETER + 4)


def relay_force(s, c):
    """Return the force in N (5.10)."""
    rate = s[S_V_SHAPED] - s[S_V]
    surface = rate + c[C_RELAY_SLOPE] * (s[S_X_SHAPED] - s[S_X])
    friction = dry_friction(math.fabs(s[S_V]), s, c) * clamp(s[S_V] / c[C_V_FLOOR], -1.0, 1.0)
    friction += c[C_VISCOUS] * s[S_V]
    equivalent = c[C_MASS] * (s[S_A_SHAPED] + c[C_RELAY_SLOPE] * rate) + friction
    switching = c[C_RELAY_FORCE] * sign(surface)
    if c[C_RELAY_IMPLICIT] > 0.5:
        switching = clamp(c[C_MASS] * surface / c[C_PERIOD], -c[C_RELAY_FORCE], c[C_RELAY_FORCE])
    return c[C_RELAY_EQUIVALENT] * equivalent + switching


def relay_step(x_ref, x, p1, p2, s, c):
    """Advance the relay by one sample; readings and commands as in cascade_step."""
    x_ref = read_sensors(x_ref, x, p1, p2, s, c)
    if follow_reference(x_ref, s, c):
        set_pressure_references(relay_force(s, c), s, c)
    pressure_pi(s, c)


def relay_parameters(data: Any) -> LawParameters:
    """Return amplitude (N), slope (1/s) and switches of the relay.

    References:
        Thesis (5.6): relay; (5.9): equivalent control; (5.10): both.
    """
    return {
        **data.shared_parameters(),
        "C_RELAY_FORCE": data.switching_force,
        "C_RELAY_SLOPE": data.surface_slope,
        "C_RELAY_EQUIVALENT": float(data.requirements.equivalent_control),
        "C_RELAY_IMPLICIT": float(data.requirements.relay == "implicit"),
    }


LAW = ControlLaw(
    "relay",
    "relay with equivalent control on one line",
    "5.2, 5.6, 5.9, 5.10",
    relay_step,
    relay_parameters,
    place=40,
    variants={"implicit": {"relay": "implicit"}, "switching": {"relay": "switching"}},
)
