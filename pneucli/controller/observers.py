"""Observers of pressures, motion and load: the model with feedback of its innovation (5.17-5.21, 7.9-7.11)."""
# mypy: disable-error-code="no-untyped-def, no-untyped-call"
# ruff: noqa: F403, F405, ANN

import math

from pneucli.controller.layout import *
from pneucli.controller.plant import clamp, dry_friction_factor, is_plausible, net_force, sign, speed_after
from pneucli.controller.standstill import detect_motion, load_observable, reference_rests
from pneucli.controller.valve_dynamics import (
    apply_valve_dynamics,
    chamber_volume_1,
    chamber_volume_2,
    delay_line_advance,
    delay_line_fill,
    delay_line_read,
    delay_line_update,
    drift_1,
    drift_2,
    null_command_1,
    null_command_2,
    valve_gradient_1,
    valve_gradient_2,
)


def initialise_state(x_ref, x, p1, p2, s, c):
    """Initialise the state from the first readings x (m), p1, p2 (Pa) and the reference x_ref, at rest, undisturbed."""
    s[S_STARTED] = 1.0
    s[S_X] = x if is_plausible(x, -c[C_STROKE], 2.0 * c[C_STROKE]) else 0.5 * c[C_STROKE]
    s[S_P1] = p1 if is_plausible(p1, 0.3 * c[C_AMBIENT], 2.0 * c[C_SUPPLY]) else c[C_P_MEAN]
    s[S_P2] = p2 if is_plausible(p2, 0.3 * c[C_AMBIENT], 2.0 * c[C_SUPPLY]) else s[S_P1]
    s[S_X_REF] = x_ref
    s[S_X_SHAPED] = s[S_X]
    s[S_FORCE] = c[C_AREA_1] * s[S_P1] - c[C_AREA_2] * s[S_P2] - (c[C_AREA_1] - c[C_AREA_2]) * c[C_AMBIENT]
    s[S_P1_REF] = s[S_P1]
    s[S_P2_REF] = s[S_P2]
    s[S_ANCHOR] = s[S_X]
    s[S_BREAKAWAY_FORCE] = c[C_STATIC]
    s[S_DEADBAND_GAIN] = 1.0
    s[S_LOOP_GAIN] = 1.0
    s[S_U1] = null_command_1(c)
    s[S_U2] = null_command_2(c) if c[C_TWO_VALVES] > 0.5 else 0.0
    settle_valves_and_sensors(s, c)
    reset_prediction(s)


def settle_valves_and_sensors(s, c):
    """Set spools, delay lines and sensors to the steady state of the present commands and pressures."""
    second = s[S_U2] if c[C_TWO_VALVES] > 0.5 else s[S_U1]
    s[S_PLAY1] = s[S_U1]
    s[S_SPOOL1] = s[S_U1]
    s[S_PLAY2] = second
    s[S_SPOOL2] = second
    s[S_SENSOR_P1] = s[S_P1]
    s[S_SENSOR_P2] = s[S_P2]
    delay_line_fill(S_OPENING_LINE1, s[S_U1], s)
    delay_line_fill(S_OPENING_LINE2, second, s)
    delay_line_fill(S_PRESSURE_LINE1, s[S_P1], s)
    delay_line_fill(S_PRESSURE_LINE2, s[S_P2], s)


def initialise_at_first_sample(x_ref, x, p1, p2, s, c):
    """Initialise at the first sample, from x (m), p1, p2 (Pa); return the reference x_ref, the last one if missing."""
    if not math.isfinite(x_ref):
        x_ref = s[S_X_REF] if s[S_STARTED] > 0.5 else x
    if s[S_STARTED] < 0.5:
        initialise_state(x_ref, x, p1, p2, s, c)
    return x_ref


def advance_valve_gradients(s, c):
    """Set the gradients in Pa/s that the last commands make over a sample, through spool and hose."""
    delay_line_advance(s)
    u1 = delay_line_update(apply_valve_dynamics(s[S_U1], S_PLAY1, S_SPOOL1, s, c), S_OPENING_LINE1, c[C_FLOW_DELAY], s)
    u2 = u1
    if c[C_TWO_VALVES] > 0.5:
        u2 = delay_line_update(
            apply_valve_dynamics(s[S_U2], S_PLAY2, S_SPOOL2, s, c), S_OPENING_LINE2, c[C_FLOW_DELAY], s
        )
    s[S_RATE1] = valve_gradient_1(u1, s[S_P1], chamber_volume_1(s[S_X], c), s, c)
    s[S_RATE2] = valve_gradient_2(u2, s[S_P2], chamber_volume_2(s[S_X], c), s, c)


def observe_pressure(reading, rate, p: int, flow: int, seen: int, row: int, s, c):
    """Observe one pressure with the known gradient ``rate`` (Pa/s); the innovation corrects pressure and flow.

    The innovation is the reading less the expected reading of the lagging, delayed sensor; it corrects the whole
    delay line.
    """
    s[p] += c[C_PERIOD] * (rate + s[flow])
    s[seen] += c[C_SENSOR_SHARE] * (s[p] - s[seen])
    expected = delay_line_update(s[seen], row, c[C_SENSOR_DELAY], s)
    if is_plausible(reading, 0.3 * c[C_AMBIENT], 2.0 * c[C_SUPPLY]):
        off = reading - expected
        s[p] += c[C_OBS_P] * off
        s[seen] += c[C_OBS_SENSOR] * off
        s[flow] += clamp(c[C_OBS_FLOW] * off, -c[C_FLOW_STEP_MAX], c[C_FLOW_STEP_MAX])
        if c[C_SENSOR_DELAY] > 0.0:
            for i in range(S_OPENING_LINE2 - S_OPENING_LINE1):
                s[row + i] += c[C_OBS_SENSOR] * off


def observe_pressures(p1, p2, s, c):
    """Observe p1 and p2 (Pa) from their readings, with known valve flow, leaks and motion (thesis 7.9-7.11)."""
    rate_1 = s[S_RATE1] + drift_1(s[S_X], s[S_V], s[S_P1], s[S_P2], c)
    rate_2 = s[S_RATE2] + drift_2(s[S_X], s[S_V], s[S_P1], s[S_P2], c)
    observe_pressure((p1 - c[C_OFFSET_1]) / c[C_SCALE_1], rate_1, S_P1, S_FLOW1, S_SENSOR_P1, S_PRESSURE_LINE1, s, c)
    observe_pressure((p2 - c[C_OFFSET_2]) / c[C_SCALE_2], rate_2, S_P2, S_FLOW2, S_SENSOR_P2, S_PRESSURE_LINE2, s, c)


def observe_motion(x, s, c):
    """Observe motion and load: a piston with set-valued friction, corrected by its innovation (5.18-5.21).

    The load changes by at most C_LOAD_STEP_MAX a sample (M_k of 5.21). At a resting reference, while no motion is
    detected, friction balances any force and the load estimate stays. Where the reference moves, a piston that sticks
    under more than the friction of the model has more: the load takes it, as the integral of a PID would. Of an
    innovation after samples without a reading motion and load get the share of one sample, the position all.
    """
    h = c[C_PERIOD]
    force = net_force(s[S_X], s[S_P1], s[S_P2], s, c)
    detect_motion(force, s, c)
    driven = s[S_MOVING_COUNT] > 0.5 or not reference_rests(s)
    v = speed_after(s[S_X], s[S_V], force, h, s, c) if driven else 0.0
    s[S_V_SEEN] = 0.5 * (s[S_V] + v)
    s[S_X] = clamp(s[S_X] + 0.5 * h * (s[S_V] + v), 0.0, c[C_STROKE])
    s[S_V] = v
    if is_plausible(x, -0.05 * c[C_STROKE], 1.05 * c[C_STROKE]):
        fresh = 1.0 / (1.0 + s[S_UNSEEN])
        away = (1.0 - fresh) * (x - s[S_X])
        s[S_UNSEEN] = 0.0
        s[S_ANCHOR] += away
        s[S_X] += away
        off = x - s[S_X]
        s[S_X] += c[C_OBS_X] * off
        s[S_V_SEEN] += c[C_OBS_X] * off / h
        s[S_V] += c[C_OBS_V] * off
        if load_observable(s):
            s[S_LOAD] += clamp(c[C_OBS_LOAD] * off, -c[C_LOAD_STEP_MAX], c[C_LOAD_STEP_MAX])
    else:
        s[S_UNSEEN] += 1.0
    learn_friction(s, c)


def scale_friction(factor, s, c):
    """Scale dry friction by a factor to the model's; return by how much in N the load of the present way changes."""
    last = dry_friction_factor(s[S_X], s[S_WAY], s, c)
    s[S_ADDED_FRICTION] = factor - 1.0
    known = s[S_WAY] * c[C_COULOMB] * (dry_friction_factor(s[S_X], s[S_WAY], s, c) - last)
    s[S_LOAD] += known
    return known


def learn_friction(s, c):
    """Learn dry friction where the reference reverses: half of what the load differs by on both ways is friction.

    The load of a way is its mean while the piston slides beyond what seals give way, for a motion window at least. A
    load that acts on one way alone is taken for friction and load, which together fit both ways, but no rest: where
    the reference rests, in which a load may come or go, the load takes back what the ways gave to friction.
    """
    way = sign(s[S_V_SHAPED])
    if reference_rests(s):
        s[S_WAY_TIME] = -c[C_MOTION_WINDOW]
        s[S_OTHER_TIME] = 0.0
        if s[S_ADDED_FRICTION] != 0.0:
            scale_friction(1.0, s, c)
    if way * s[S_WAY] < 0.0:
        least = min(s[S_WAY_TIME], s[S_OTHER_TIME])
        if least > c[C_MOTION_WINDOW] and c[C_COULOMB] > 0.0:
            sliding = c[C_COULOMB] * max(dry_friction_factor(s[S_X], s[S_WAY], s, c), 1.0)
            more = 0.5 * s[S_WAY] * (s[S_OTHER_LOAD] - s[S_WAY_LOAD]) / sliding
            s[S_WAY_LOAD] += scale_friction(clamp((1.0 + s[S_ADDED_FRICTION]) * (1.0 + more), 0.5, 2.0), s, c)
        s[S_OTHER_LOAD] = s[S_WAY_LOAD]
        s[S_OTHER_TIME] = s[S_WAY_TIME]
        s[S_WAY_TIME] = -c[C_MOTION_WINDOW]
    if way != 0.0:
        s[S_WAY] = way
    if math.fabs(s[S_EXCURSION]) > c[C_PRESLIDING_DISTANCE] and s[S_V] * way > c[C_V_FLOOR]:
        s[S_WAY_TIME] += c[C_PERIOD]
        if s[S_WAY_TIME] > 0.0:
            s[S_WAY_LOAD] += (s[S_LOAD] - s[S_WAY_LOAD]) * min(c[C_PERIOD] / s[S_WAY_TIME], 1.0)


def reset_prediction(s):
    """Set the prediction to the present motion and pressures."""
    s[S_PREDICTED_X] = s[S_X]
    s[S_PREDICTED_V] = s[S_V]
    s[S_PREDICTED_P1] = s[S_P1]
    s[S_PREDICTED_P2] = s[S_P2]


def predict_to_arrival(s, c):
    """Predict motion and pressures to the arrival of the present command, from the openings in the delay line."""
    reset_prediction(s)
    steps: int = int(c[C_FLOW_DELAY] + 0.999999)
    if steps < 1:
        return
    h = c[C_PERIOD] * c[C_FLOW_DELAY] / steps
    for i in range(steps):
        u1 = delay_line_read(S_OPENING_LINE1, steps - 1 - i, s)
        u2 = delay_line_read(S_OPENING_LINE2, steps - 1 - i, s) if c[C_TWO_VALVES] > 0.5 else u1
        advance_prediction(u1, u2, h, s, c)


def advance_prediction(u1, u2, h, s, c):
    """Advance the prediction by h (s) under openings in V."""
    x = s[S_PREDICTED_X]
    v = s[S_PREDICTED_V]
    p1 = s[S_PREDICTED_P1]
    p2 = s[S_PREDICTED_P2]
    s[S_PREDICTED_P1] += h * (
        valve_gradient_1(u1, p1, chamber_volume_1(x, c), s, c) + drift_1(x, v, p1, p2, c) + s[S_FLOW1]
    )
    s[S_PREDICTED_P2] += h * (
        valve_gradient_2(u2, p2, chamber_volume_2(x, c), s, c) + drift_2(x, v, p1, p2, c) + s[S_FLOW2]
    )
    s[S_PREDICTED_V] = speed_after(x, v, net_force(x, p1, p2, s, c), h, s, c)
    s[S_PREDICTED_X] = clamp(x + 0.5 * h * (v + s[S_PREDICTED_V]), 0.0, c[C_STROKE])
