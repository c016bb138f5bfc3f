"""The observers of pressures, motion and load: the model, with what it leaves over fed back (5.17-5.21, 7.9-7.11)."""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

from __future__ import annotations

import math

from pneucli.design.layout import *
from pneucli.design.plant import clamp, dry_friction, usable


def start(x_ref, x, p1, p2, s, c):
    """Set the state from the first readings: all at rest, no disturbance known."""
    s[S_STARTED] = 1.0
    s[S_X] = x if usable(x, -c[C_STROKE], 2.0 * c[C_STROKE]) else 0.5 * c[C_STROKE]
    s[S_P1] = p1 if usable(p1, 0.3 * c[C_AMBIENT], 2.0 * c[C_SUPPLY]) else c[C_P_MEAN]
    s[S_P2] = p2 if usable(p2, 0.3 * c[C_AMBIENT], 2.0 * c[C_SUPPLY]) else s[S_P1]
    s[S_X_REF] = x_ref
    s[S_X_SHAPED] = s[S_X]
    s[S_FORCE] = c[C_AREA_1] * s[S_P1] - c[C_AREA_2] * s[S_P2] - (c[C_AREA_1] - c[C_AREA_2]) * c[C_AMBIENT]
    s[S_P1_REF] = s[S_P1]
    s[S_P2_REF] = s[S_P2]
    s[S_ANCHOR] = s[S_X]
    s[S_BREAK] = c[C_STATIC]


def begin(x_ref, x, p1, p2, s, c):
    """Start from the first sample; return the reference, the last one where it is missing."""
    if not math.isfinite(x_ref):
        x_ref = s[S_X_REF] if s[S_STARTED] > 0.5 else x
    if s[S_STARTED] < 0.5:
        start(x_ref, x, p1, p2, s, c)
    return x_ref


def observe_pressures(p1, p2, s, c):
    """Observe p1 and p2: the valve's map and an integrator, driven by what it leaves over (thesis 7.9-7.11)."""
    h = c[C_PERIOD]
    volume_1 = c[C_DEAD_1] + c[C_AREA_1] * s[S_X]
    volume_2 = c[C_DEAD_2] + c[C_AREA_2] * (c[C_STROKE] - s[S_X])
    s[S_P1] += h * (s[S_RATE1] + s[S_FLOW1] - c[C_GAMMA] * s[S_P1] * c[C_AREA_1] * s[S_V] / volume_1)
    s[S_P2] += h * (s[S_RATE2] + s[S_FLOW2] + c[C_GAMMA] * s[S_P2] * c[C_AREA_2] * s[S_V] / volume_2)
    if usable(p1, 0.3 * c[C_AMBIENT], 2.0 * c[C_SUPPLY]):
        off = p1 - s[S_P1]
        s[S_P1] += c[C_OBS_P] * off
        s[S_FLOW1] += clamp(c[C_OBS_FLOW] * off, -c[C_FLOW_STEP], c[C_FLOW_STEP])
    if usable(p2, 0.3 * c[C_AMBIENT], 2.0 * c[C_SUPPLY]):
        off = p2 - s[S_P2]
        s[S_P2] += c[C_OBS_P] * off
        s[S_FLOW2] += clamp(c[C_OBS_FLOW] * off, -c[C_FLOW_STEP], c[C_FLOW_STEP])


def pressure_force(s, c):
    """Return the force of the observed pressures in N."""
    return c[C_AREA_1] * s[S_P1] - c[C_AREA_2] * s[S_P2] - (c[C_AREA_1] - c[C_AREA_2]) * c[C_AMBIENT]


def observe_motion(x, s, c):
    """Observe motion and load: the piston with set-valued friction, driven by what it leaves over (5.18-5.21).

    What is left over enters as the switching term, at most C_LOAD_STEP a sample around the filtered equivalent value
    of the last one. While the piston is not seen to stir, friction is whatever holds it, and nothing is left over.
    """
    h = c[C_PERIOD]
    s[S_ANCHOR] += (s[S_X] - s[S_ANCHOR]) * min(h / c[C_LINGER], 1.0)
    s[S_STIRS] = s[S_STIRS] + 1.0 if math.fabs(s[S_X] - s[S_ANCHOR]) > 0.25 * c[C_REACH] else 0.0
    force = pressure_force(s, c) + s[S_LOAD]
    free = s[S_V] + h * (force - c[C_VISCOUS] * s[S_V]) / c[C_MASS]
    brake = h * dry_friction(math.fabs(s[S_V]), s, c) / c[C_MASS]
    v = free - clamp(free, -brake, brake)
    if v * s[S_V] < 0.0 or s[S_STIRS] < 0.5:
        v = 0.0
    s[S_X] = clamp(s[S_X] + 0.5 * h * (s[S_V] + v), 0.0, c[C_STROKE])
    s[S_V] = v
    if usable(x, -0.05 * c[C_STROKE], 1.05 * c[C_STROKE]):
        off = x - s[S_X]
        s[S_X] += c[C_OBS_X] * off
        s[S_V] += c[C_OBS_V] * off
        if s[S_STIRS] > 0.5:
            s[S_LOAD] += clamp(c[C_OBS_LOAD] * off, -c[C_LOAD_STEP], c[C_LOAD_STEP])
