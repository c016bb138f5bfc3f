"""The observers of pressures, motion and load: the model, with what it leaves over fed back (5.17-5.21, 7.9-7.11)."""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

from __future__ import annotations

import math

from pneucli.controller.layout import *
from pneucli.controller.plant import along, clamp, dry_share, sign, slid, usable
from pneucli.controller.valve_dynamics import (
    drift_1,
    drift_2,
    filled,
    gradient_1,
    gradient_2,
    opened,
    passed,
    remembered,
    shut_1,
    shut_2,
    space_1,
    space_2,
    turn,
)


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
    s[S_WIDE] = 1.0
    s[S_SOFT] = 1.0
    s[S_U1] = shut_1(c)
    s[S_U2] = shut_2(c) if c[C_TWO_VALVES] > 0.5 else 0.0
    settle(s, c)
    as_it_is(s)


def settle(s, c):
    """Let spools, hose and sensors stand where the commands and pressures are."""
    second = s[S_U2] if c[C_TWO_VALVES] > 0.5 else s[S_U1]
    s[S_PLAY1] = s[S_U1]
    s[S_SPOOL1] = s[S_U1]
    s[S_PLAY2] = second
    s[S_SPOOL2] = second
    s[S_SEEN1] = s[S_P1]
    s[S_SEEN2] = s[S_P2]
    filled(S_LINE1, s[S_U1], s)
    filled(S_LINE2, second, s)
    filled(S_PAST1, s[S_P1], s)
    filled(S_PAST2, s[S_P2], s)


def begin(x_ref, x, p1, p2, s, c):
    """Start from the first sample; return the reference, the last one where it is missing."""
    if not math.isfinite(x_ref):
        x_ref = s[S_X_REF] if s[S_STARTED] > 0.5 else x
    if s[S_STARTED] < 0.5:
        start(x_ref, x, p1, p2, s, c)
    return x_ref


def arrive(s, c):
    """Set what the valves make of the pressures over a sample in Pa/s: the last commands through spool and hose."""
    turn(s)
    u1 = passed(opened(s[S_U1], S_PLAY1, S_SPOOL1, s, c), S_LINE1, c[C_WAIT], s)
    u2 = u1
    if c[C_TWO_VALVES] > 0.5:
        u2 = passed(opened(s[S_U2], S_PLAY2, S_SPOOL2, s, c), S_LINE2, c[C_WAIT], s)
    s[S_RATE1] = gradient_1(u1, s[S_P1], space_1(s[S_X], c), s, c)
    s[S_RATE2] = gradient_2(u2, s[S_P2], space_2(s[S_X], c), s, c)


def observe_pressure(reading, rate, p: int, flow: int, seen: int, row: int, s, c):
    """Observe one pressure: ``rate`` in Pa/s is known; what the reading leaves over corrects it and the other flows.

    The reading is compared with what its sensor should show, late as it is, and corrects the whole row since.
    """
    s[p] += c[C_PERIOD] * (rate + s[flow])
    s[seen] += c[C_SENSE] * (s[p] - s[seen])
    expected = passed(s[seen], row, c[C_SENSE_WAIT], s)
    if usable(reading, 0.3 * c[C_AMBIENT], 2.0 * c[C_SUPPLY]):
        off = reading - expected
        s[p] += c[C_OBS_P] * off
        s[seen] += c[C_OBS_SEEN] * off
        s[flow] += clamp(c[C_OBS_FLOW] * off, -c[C_FLOW_STEP], c[C_FLOW_STEP])
        if c[C_SENSE_WAIT] > 0.0:
            for i in range(S_LINE2 - S_LINE1):
                s[row + i] += c[C_OBS_SEEN] * off


def observe_pressures(p1, p2, s, c):
    """Observe p1 and p2 from what their sensors read, in Pa: valve, leaks and motion are known (thesis 7.9-7.11)."""
    rate_1 = s[S_RATE1] + drift_1(s[S_X], s[S_V], s[S_P1], s[S_P2], c)
    rate_2 = s[S_RATE2] + drift_2(s[S_X], s[S_V], s[S_P1], s[S_P2], c)
    observe_pressure((p1 - c[C_ZERO_1]) / c[C_SCALE_1], rate_1, S_P1, S_FLOW1, S_SEEN1, S_PAST1, s, c)
    observe_pressure((p2 - c[C_ZERO_2]) / c[C_SCALE_2], rate_2, S_P2, S_FLOW2, S_SEEN2, S_PAST2, s, c)


def force_of(p1, p2, c):
    """Return the force of two pressures on the piston in N."""
    return c[C_AREA_1] * p1 - c[C_AREA_2] * p2 - (c[C_AREA_1] - c[C_AREA_2]) * c[C_AMBIENT]


def pressure_force(s, c):
    """Return the force of the observed pressures in N."""
    return force_of(s[S_P1], s[S_P2], c)


def pushing(x, p1, p2, s, c):
    """Return all that drives the piston at x (m) but friction, in N."""
    return force_of(p1, p2, c) + along(x, 4, c) + s[S_LOAD]


def stir(force, s, c):
    """Tell whether the piston stirs, and whether it is elastic: driven by a force in N that friction surely holds.

    A rigid one starts, and turns, only under more than dry friction. What goes on is no spring.
    """
    s[S_ANCHOR] += (s[S_X] - s[S_ANCHOR]) * min(c[C_PERIOD] / c[C_LINGER], 1.0)
    s[S_STIRS] = s[S_STIRS] + 1.0 if math.fabs(s[S_X] - s[S_ANCHOR]) > 0.25 * c[C_REACH] else 0.0
    if s[S_STIRS] < 0.5:
        s[S_STILL] += c[C_PERIOD]
    elif s[S_STIRS] > 1.5:
        s[S_STILL] = 0.0
    if s[S_WAY] * s[S_V] <= 0.0:
        if s[S_ELASTIC] > 0.5 and s[S_REST] > 0.05 and math.fabs(s[S_WAY]) > 2.0 * c[C_REACH]:
            s[S_SOFT] = max(0.7 * s[S_SOFT], 0.05)
        s[S_WAY] = 0.0
        s[S_PUSHED] = 0.0
    s[S_WAY] += c[C_PERIOD] * s[S_V]
    s[S_PUSHED] = max(s[S_PUSHED], force * sign(s[S_V]))
    held = s[S_PUSHED] < 0.5 * c[C_COULOMB] * dry_share(s[S_X], s[S_V], s, c)
    if held and s[S_REST] > 0.05 and math.fabs(s[S_WAY]) > 2.0 * c[C_REACH]:
        s[S_ELASTIC] = 1.0
    if math.fabs(s[S_WAY]) > c[C_STIFF] or (s[S_REST] > 0.05 and math.fabs(s[S_X_SHAPED] - s[S_X]) > c[C_STIFF]):
        s[S_ELASTIC] = 0.0
        s[S_SOFT] = 1.0


def tells(s):
    """Whether what is left over of the motion is a load: not while something elastic may carry a piston at rest."""
    if s[S_STIRS] < 0.5:
        return False
    return s[S_REST] < 0.05 or s[S_ELASTIC] < 0.5


def observe_motion(x, s, c):
    """Observe motion and load: the piston with set-valued friction, driven by what it leaves over (5.18-5.21).

    What is left over enters as the switching term, at most C_LOAD_STEP a sample around the filtered equivalent value
    of the last one. While the piston is not seen to stir, friction is whatever holds it, and nothing is left over.
    """
    h = c[C_PERIOD]
    force = pushing(s[S_X], s[S_P1], s[S_P2], s, c)
    stir(force, s, c)
    v = slid(s[S_X], s[S_V], force, h, s, c) if s[S_STIRS] > 0.5 else 0.0
    s[S_X] = clamp(s[S_X] + 0.5 * h * (s[S_V] + v), 0.0, c[C_STROKE])
    s[S_V] = v
    if usable(x, -0.05 * c[C_STROKE], 1.05 * c[C_STROKE]):
        off = x - s[S_X]
        s[S_X] += c[C_OBS_X] * off
        s[S_V] += c[C_OBS_V] * off
        if tells(s):
            s[S_LOAD] += clamp(c[C_OBS_LOAD] * off, -c[C_LOAD_STEP], c[C_LOAD_STEP])


def as_it_is(s):
    """Take motion and pressures as they are for when what is commanded now arrives."""
    s[S_AHEAD_X] = s[S_X]
    s[S_AHEAD_V] = s[S_V]
    s[S_AHEAD_P1] = s[S_P1]
    s[S_AHEAD_P2] = s[S_P2]


def look_ahead(s, c):
    """Predict motion and pressures to when what is commanded now arrives, from what is under way in the hose."""
    as_it_is(s)
    steps: int = int(c[C_WAIT] + 0.999999)
    if steps < 1:
        return
    h = c[C_PERIOD] * c[C_WAIT] / steps
    for i in range(steps):
        u1 = remembered(S_LINE1, steps - 1 - i, s)
        u2 = remembered(S_LINE2, steps - 1 - i, s) if c[C_TWO_VALVES] > 0.5 else u1
        ahead_by(u1, u2, h, s, c)


def ahead_by(u1, u2, h, s, c):
    """Bring the prediction forward by h (s) under openings in V."""
    x = s[S_AHEAD_X]
    v = s[S_AHEAD_V]
    p1 = s[S_AHEAD_P1]
    p2 = s[S_AHEAD_P2]
    s[S_AHEAD_P1] += h * (gradient_1(u1, p1, space_1(x, c), s, c) + drift_1(x, v, p1, p2, c) + s[S_FLOW1])
    s[S_AHEAD_P2] += h * (gradient_2(u2, p2, space_2(x, c), s, c) + drift_2(x, v, p1, p2, c) + s[S_FLOW2])
    s[S_AHEAD_V] = slid(x, v, pushing(x, p1, p2, s, c), h, s, c)
    s[S_AHEAD_X] = clamp(x + 0.5 * h * (v + s[S_AHEAD_V]), 0.0, c[C_STROKE])
