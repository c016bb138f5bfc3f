"""Simulate one recording: the loop over samples and steps."""

import math

from pneucli.physics.gas import flow_constant
from pneucli.simulate.kernel.arrays import fixed, new_array, new_copy
from pneucli.simulate.kernel.hose import (
    hose_bores,
    hose_delays,
    hose_step,
    line_step,
    longest_step,
    volume_beyond_hose,
    write_flows,
)
from pneucli.simulate.kernel.ports import (
    bristle_stiffness,
    has_heat,
    mass,
    read_a,
    scalars,
    sensor_delay,
    sensor_lag,
    volume_1,
    volume_2,
)
from pneucli.simulate.kernel.sensors import add_unread_change, read_pressures, true_pressures, unread
from pneucli.simulate.kernel.step import (
    chamber_1_step,
    chamber_2_step,
    piston_acceleration,
    piston_step,
    starting_deflection,
    steps_between,
    valve_step,
)
from pneucli.simulate.layout import *


def control(k, x_ref, x, p1, p2, cs, cp):
    """Return both commands in V, called at each sample; proportional with a limit (tests, benchmarks)."""
    return min(max(cp[0] * (x_ref - x), -cp[1]), cp[1]), 0.0


def max_steps_within(time, h_max, span):
    """Return the largest number of steps that begin within ``span`` s."""
    most = count = first = 0
    for k in range(time.size - 1):
        count += steps_between(time[k], time[k + 1], h_max)
        while time[first] < time[k] - span:
            count -= steps_between(time[first], time[first + 1], h_max)
            first += 1
        most = max(most, count)
    return most


def middles(restarts):
    """Return the first restart, and the sample halfway from each restart to the next.

    Args:
        restarts: Samples of the restarts, an array of integers.

    >>> import numpy as np
    >>> middles(np.array([0, 100, 200])).tolist()
    [0, 50, 150]
    """
    halfway = restarts.copy()
    for i in range(1, restarts.size):
        halfway[i] = (restarts[i - 1] + restarts[i]) // 2
    return halfway


def run(
    time, inputs, restarts, base_values, th_values, on_values, flags, areas, areas_2, h_max, h_given, cs, cp, out
):  # fmt: skip
    """Simulate one recording.

    Arrays have the layout of :mod:`pneucli.simulate.layout`. States without a sensor continue over a restart.

    No model takes a pressure from a reading after its restart. Where sensors lag or come late, the pressure at a
    restart is what the sensor reads there plus the change that it does not show yet. That change is the model's own: a
    first pass, with the measured motion and the steps that suffice for it, restarts halfway between the restarts and
    predicts it.

    Args:
        time: Time stamps in s, shape (n,).
        inputs: Smoothed readings, shape (n, 8).
        restarts: Samples at which x, v, p1, p2 are set to the pressures and motion of the readings, shape (r,).
        base_values: Base parameters, shape (19,).
        th_values: Parameters of effects.
        on_values: Switches of effects, shape (effects + 1,).
        flags: Switches of the recording, shape (9,).
        areas: Areas in m^2 of chamber 1 over openings of -U_MAX..U_MAX.
        areas_2: The same of chamber 2.
        h_max: Longest step in s.
        h_given: The same with the measured motion.
        cs: State of the controller.
        cp: Parameters of the controller.
        out: Filled with the output, shape (n, 10).

    References:
        Thesis 2.47-2.52.
    """
    base, th, on = scalars(base_values, th_values, on_values)
    lag, delay = sensor_lag(th, on), sensor_delay(th, on)
    predicts_pressures = flags[PNEUMATICS] > 0.0 and flags[LOOP] == 0.0
    if (lag > 0.0 or delay > 0.0) and predicts_pressures:
        true = new_copy(inputs[:, IN_P1 : IN_P2 + 1])
        unread(true, base, th, on)
        imposed = flags.copy()
        imposed[MECHANICS] = 0.0
        advance(
            time, inputs, true, middles(restarts), base_values, th_values, on_values, imposed, areas, areas_2, h_given,
            cs, cp, out,  # which the second pass overwrites
        )  # fmt: skip
        add_unread_change(out, restarts, base, th, on, true)
    else:  # no later reading is needed, or all readings are inputs
        true = true_pressures(time, inputs, lag, base, th, on)
    advance(time, inputs, true, restarts, base_values, th_values, on_values, flags, areas, areas_2, h_max, cs, cp, out)


def advance(time, inputs, true, restarts, base_values, th_values, on_values, flags, areas, areas_2, h_max, cs, cp, out):
    """Simulate one recording as :func:`run` does, with pressures ``true`` (n, 2) at and before each restart.

    Where no pneumatics are simulated, ``true`` is imposed.
    """
    n = time.size
    base, th, on = scalars(base_values, th_values, on_values)
    mechanics, pneumatics, chamber_2 = flags[MECHANICS] > 0.0, flags[PNEUMATICS] > 0.0, int(flags[CHAMBER_2])
    shut, loop, u_max, p_amb = flags[VALVE_SHUT] > 0.0, flags[LOOP] > 0.0, flags[U_MAX], base[AMBIENT]
    stated = flags[STATED_SUPPLY] > 0.0
    k_gas = flow_constant(base[GAS], base[TEMP], base[GAMMA])
    hot = has_heat(on)

    area_1, area_2, stroke = base[AREA_1], base[AREA_2], base[STROKE]
    dead_1, dead_2 = base[DEAD_1] + volume_1(th, on), base[DEAD_2] + volume_2(th, on)
    m = base[MASS] + mass(th, on)
    stiffness = bristle_stiffness(th, on)
    null = base[NULL]

    delay_1, delay_2 = hose_delays(th, on)
    bore_1, bore_2 = hose_bores(chamber_2, th, on)
    dead_1 = volume_beyond_hose(dead_1, delay_1, bore_1, base)
    dead_2 = volume_beyond_hose(dead_2, delay_2, bore_2, base)
    h_max = fixed(longest_step(h_max, delay_1, delay_2, bore_1, bore_2))
    wave_1, wave_2 = 0.0 if bore_1 > 0.0 else delay_1, 0.0 if bore_2 > 0.0 else delay_2
    delay = fixed(max(wave_1, wave_2))
    ring = new_array((max_steps_within(time, h_max, delay + h_max) + 2 if delay > 0.0 else 1, 5))
    for i in range(ring.shape[0]):
        ring[i, 0] = -1e30
    head, tail, tail_2 = 0, ring.shape[0] - 1, ring.shape[0] - 1
    flowed_before = flags[INITIAL_U] != 0.0 or flags[INITIAL_U2] != 0.0
    s1, s2, s_supply = new_array((2 * on_values.size,)), new_array((2 * on_values.size,)), new_array((on_values.size,))
    for i in range(s1.shape[0]):
        s1[i], s2[i] = flags[INITIAL_U], flags[INITIAL_U2]
    before = new_array((2,))

    x = v = z = rest = dv = dp1 = dp2 = q_supply = 0.0
    p1 = p2 = end_1 = end_2 = p_amb  # of the chambers, and of their hoses at the valve
    through_1 = through_2 = 0.0  # mass flows through hoses with a bore
    m1 = m2 = 1.0
    T1 = T2 = base[TEMP]
    k1 = k2 = k_gas
    first = segment = 0
    still = 0.0
    for k in range(n):
        last = k == n - 1
        still = still + time[k] - time[max(k - 1, 0)] if inputs[k, IN_V] == 0.0 else 0.0
        nxt = k if last else k + 1
        dt = h_max if last else time[nxt] - time[k]
        fresh = segment < restarts.size and k == restarts[segment]
        if fresh:
            segment += 1
            first = k
        if fresh or not mechanics:
            x, v = inputs[k, IN_X], inputs[k, IN_V]
        if fresh or not pneumatics:
            end_1, end_2 = end_1 + true[k, 0] - p1, end_2 + true[k, 1] - p2
            p1, p2 = true[k, 0], true[k, 1]
        if chamber_2 == OPEN and pneumatics:
            p2 = p_amb
        if fresh:
            dp1 = dp2 = dv = 0.0
            rest = still
            if mechanics:
                z = starting_deflection(x, v, p1, p2, inputs[k, IN_FORCE], stiffness, base, th, on)
            m1 = p1 * (dead_1 + area_1 * x) / (base[GAS] * T1)
            m2 = p2 * (dead_2 + area_2 * (stroke - x)) / (base[GAS] * T2)
        out[k, X], out[k, V], out[k, P1], out[k, P2], out[k, GAS_T] = x, v, p1, p2, T1
        if hot and pneumatics:
            out[k, GAS_T] = p1 * (dead_1 + area_1 * x) / (base[GAS] * m1)
        read_pressures(time, inputs, true, out, before, first, k, base, th, on)
        u, u2 = inputs[k, IN_U], inputs[k, IN_U2]
        if loop:
            u, u2 = control(k, inputs[k, IN_U], x, out[k, R1], out[k, R2], cs, cp)
        out[k, U] = u
        u -= null
        u2 = -u if chamber_2 == MIRRORED else u2 - null
        if mechanics:
            a = piston_acceleration(x, v, z, rest, dv, p1, p2, inputs[k, IN_FORCE], m, stiffness, base, th, on)
            out[k, A] = read_a(a, th, on)
        if last:
            out[k, FLOW] = out[max(k - 1, 0), FLOW]
            break
        steps = steps_between(time[k], time[nxt], h_max)
        h = dt / steps
        for i in range(steps):
            w = (i + 0.5) / steps
            p1_mid, p2_mid = p1 + 0.5 * h * dp1, p2 + 0.5 * h * dp2
            if not pneumatics:
                p1_mid = true[k, 0] + w * (true[nxt, 0] - true[k, 0])
                p2_mid = true[k, 1] + w * (true[nxt, 1] - true[k, 1])
            x_mid, v_mid = x, v
            if mechanics:
                driven = inputs[k, IN_FORCE] + w * (inputs[nxt, IN_FORCE] - inputs[k, IN_FORCE])
                x_old, v_old = x, v
                x, v, z, rest = piston_step(x, v, z, rest, dv, p1_mid, p2_mid, driven, h, m, stiffness, base, th, on)
                dv = v - v_old
                x_mid, v_mid = 0.5 * (x_old + x), (x - x_old) / h
            else:
                x_mid = inputs[k, IN_X] + w * (inputs[nxt, IN_X] - inputs[k, IN_X])
                v_mid = inputs[k, IN_V] + w * (inputs[nxt, IN_V] - inputs[k, IN_V])
            if not pneumatics:
                continue

            if hot:
                k1, k2 = k_gas * math.sqrt(base[TEMP] / T1), k_gas * math.sqrt(base[TEMP] / T2)
            p_line = inputs[k, IN_SUPPLY] + w * (inputs[nxt, IN_SUPPLY] - inputs[k, IN_SUPPLY])
            outlet_1, outlet_2 = end_1 if bore_1 > 0.0 else p1_mid, end_2 if bore_2 > 0.0 else p2_mid
            q_in, q_out, more_in, more_out = valve_step(
                u, u2, outlet_1, outlet_2, p_line, stated, shut, chamber_2, q_supply, h, k1, k2, k_gas, u_max,
                areas, areas_2, s1, s2, s_supply, base, th, on,
            )  # fmt: skip
            q_supply = q_in + more_in
            if i == 0:
                out[k, FLOW] = q_in - q_out
            if delay > 0.0:
                if flowed_before and k == 0 and i == 0:
                    write_flows(q_in, q_out, more_in, more_out, ring, tail)
                q_in, q_out, more_in, more_out, head, tail, tail_2 = line_step(
                    time[k] + (i + 0.5) * h, q_in, q_out, more_in, more_out, wave_1, wave_2, ring, head, tail, tail_2
                )
            if bore_1 > 0.0:
                end_1, through_1, q_in, q_out = hose_step(
                    end_1, through_1, p1_mid, q_in - q_out, h, delay_1, bore_1, base
                )
            if bore_2 > 0.0:
                end_2, through_2, more_in, more_out = hose_step(
                    end_2, through_2, p2_mid, more_in - more_out, h, delay_2, bore_2, base
                )
            p1, dp1, m1, T1 = chamber_1_step(
                p1, p1_mid, p2_mid, m1, h, dead_1 + area_1 * x_mid, area_1 * v_mid, q_in, q_out, hot, k1, base, th, on
            )
            if chamber_2 == OPEN:
                continue
            volume_2_mid = dead_2 + area_2 * (stroke - x_mid)
            p2, dp2, m2, T2 = chamber_2_step(
                p2, p1_mid, p2_mid, m2, h, volume_2_mid, -area_2 * v_mid, more_in, more_out, hot, k1, k2, base, th, on
            )
