"""The plant as a step function with its state in arrays, for programs that have a clock of their own.

It calls the equations of :mod:`pneucli.simulate.kernel.step` as the loop over a recording does. Inputs are held over a
step. The export translates it to C (:mod:`pneucli.export.fmu`).
"""

import math

from pneucli.physics.gas import flow_constant
from pneucli.simulate.kernel.hose import hose_bores, hose_delays, hose_step, line_step, longest_step, volume_beyond_hose
from pneucli.simulate.kernel.ports import (
    bristle_stiffness,
    has_heat,
    mass,
    read_a,
    read_p1,
    read_p2,
    sensor_lag,
    volume_1,
    volume_2,
)
from pneucli.simulate.kernel.sensors import first_order_lag
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


def plant_start(start, inputs, flags, s, s1, s2, s_supply, ring, base, th, on):
    """Set the state at rest or in motion, with settled spools and sensors.

    Args:
        start: Position in m, velocity in m/s, pressures in Pa, openings of the valves in V, shape (6,).
        inputs: Commands in V, supply pressure in Pa, driving force in N, shape (4,).
        flags: Switches of the rig, as of a recording, shape (9,).
        s: State, shape (26,), filled.
        s1: States of effects at the command of chamber 1, filled.
        s2: States of effects at the command of chamber 2, filled.
        s_supply: States of effects at the supply, filled.
        ring: Ring buffer of the hoses, shape (k, 5), filled.
        base: Base parameters, shape (19,).
        th: Parameters of effects.
        on: Switches of effects.
    """
    for i in range(PLANT_STATES):
        s[i] = 0.0
    for i in range(s1.size):
        s1[i], s2[i] = start[START_U], start[START_U2]
    for i in range(s_supply.size):
        s_supply[i] = 0.0
    for i in range(ring.shape[0]):
        ring[i, 0] = -1e30
        for j in range(1, ring.shape[1]):
            ring[i, j] = 0.0
    s[AT_TAIL] = s[AT_TAIL_2] = ring.shape[0] - 1
    x, p1, p2 = start[START_X], start[START_P1], start[START_P2]
    if int(flags[CHAMBER_2]) == OPEN:
        p2 = base[AMBIENT]
    s[AT_X], s[AT_V], s[AT_P1], s[AT_P2], s[AT_END_1], s[AT_END_2] = x, start[START_V], p1, p2, p1, p2
    stiffness = bristle_stiffness(th, on)
    s[AT_Z] = starting_deflection(x, s[AT_V], p1, p2, inputs[PLANT_FORCE], stiffness, base, th, on)
    s[AT_T1] = s[AT_T2] = base[TEMP]
    dead_1, dead_2 = dead_volumes(int(flags[CHAMBER_2]), base, th, on)
    s[AT_M1] = p1 * (dead_1 + base[AREA_1] * x) / (base[GAS] * base[TEMP])
    s[AT_M2] = p2 * (dead_2 + base[AREA_2] * (base[STROKE] - x)) / (base[GAS] * base[TEMP])
    s[AT_R1] = s[AT_BEFORE_1] = read_p1(p1, base[AMBIENT], th, on)
    s[AT_R2] = s[AT_BEFORE_2] = read_p2(p2, base[AMBIENT], th, on)


def plant_step(t, dt, h_max, inputs, flags, areas, areas_2, s, s1, s2, s_supply, ring, base, th, on):
    """Advance the plant.

    Args:
        t: Time at the begin of the step in s.
        dt: Step in s, divided into steps of at most ``h_max``.
        h_max: Longest step of the equations in s.
        inputs: Commands in V, supply pressure in Pa, driving force in N, held over the step, shape (4,).
        flags: Switches of the rig, as of a recording, shape (9,).
        areas: Areas in m^2 of chamber 1 over openings of -U_MAX..U_MAX.
        areas_2: The same of chamber 2.
        s: State, shape (26,), changed in place.
        s1: States of effects at the command of chamber 1, changed in place.
        s2: States of effects at the command of chamber 2, changed in place.
        s_supply: States of effects at the supply, changed in place.
        ring: Ring buffer of the hoses, shape (k, 5), changed in place.
        base: Base parameters, shape (19,).
        th: Parameters of effects.
        on: Switches of effects.

    References:
        Thesis 2.47-2.52 (state space), 3.1-3.7 (friction).
    """
    mechanics, stated, chamber_2 = flags[MECHANICS] > 0.0, flags[STATED_SUPPLY] > 0.0, int(flags[CHAMBER_2])
    hot = has_heat(on)
    k_gas = flow_constant(base[GAS], base[TEMP], base[GAMMA])
    m, stiffness = base[MASS] + mass(th, on), bristle_stiffness(th, on)
    u, u2 = inputs[PLANT_U] - base[NULL], inputs[PLANT_U2] - base[NULL]
    if chamber_2 == MIRRORED:
        u2 = -u
    x, v, z, rest, dv, q_supply = s[AT_X], s[AT_V], s[AT_Z], s[AT_REST], s[AT_DV], s[AT_Q]
    p1, p2, dp1, dp2, m1, m2 = s[AT_P1], s[AT_P2], s[AT_DP1], s[AT_DP2], s[AT_M1], s[AT_M2]
    T1, T2, k1, k2 = s[AT_T1], s[AT_T2], k_gas, k_gas
    steps: int = steps_between(0.0, dt, longest_hose_step(h_max, chamber_2, th, on))
    h = dt / steps
    for i in range(steps):
        p1_mid, p2_mid = p1 + 0.5 * h * dp1, p2 + 0.5 * h * dp2
        x_mid, v_mid = x, v
        if mechanics:
            x_old, v_old = x, v
            x, v, z, rest = piston_step(
                x, v, z, rest, dv, p1_mid, p2_mid, inputs[PLANT_FORCE], h, m, stiffness, base, th, on
            )
            dv = v - v_old
            x_mid, v_mid = 0.5 * (x_old + x), (x - x_old) / h
        if hot:
            k1, k2 = k_gas * math.sqrt(base[TEMP] / T1), k_gas * math.sqrt(base[TEMP] / T2)
        outlet_1, outlet_2 = outlet_pressures(p1_mid, p2_mid, chamber_2, s, th, on)
        q_in, q_out, more_in, more_out = valve_step(
            u, u2, outlet_1, outlet_2, inputs[PLANT_SUPPLY], stated, False, chamber_2, q_supply, h, k1, k2, k_gas,
            flags[U_MAX], areas, areas_2, s1, s2, s_supply, base, th, on,
        )  # fmt: skip
        q_supply = q_in + more_in
        if i == 0:
            s[AT_FLOW] = q_in - q_out
        q_in, q_out, more_in, more_out = hoses_step(
            t + (i + 0.5) * h, h, p1_mid, p2_mid, q_in, q_out, more_in, more_out, chamber_2, s, ring, base, th, on
        )
        p1, dp1, m1, T1, p2, dp2, m2, T2 = chambers_step(
            p1, p1_mid, m1, p2, p2_mid, dp2, m2, T2, h, x_mid, v_mid, q_in, q_out, more_in, more_out, k1, k2,
            chamber_2, base, th, on,
        )  # fmt: skip
    s[AT_X], s[AT_V], s[AT_Z], s[AT_REST], s[AT_DV], s[AT_Q] = x, v, z, rest, dv, q_supply
    s[AT_P1], s[AT_P2], s[AT_DP1], s[AT_DP2], s[AT_M1], s[AT_M2] = p1, p2, dp1, dp2, m1, m2
    s[AT_T1], s[AT_T2] = T1, T2
    advance_readings(dt, s, base, th, on)


def longest_hose_step(h_max, chamber_2: int, th, on):
    """Return the longest step in s that follows the plant and the oscillation of its hoses."""
    delay_1, delay_2 = hose_delays(th, on)
    bore_1, bore_2 = hose_bores(chamber_2, th, on)
    return longest_step(h_max, delay_1, delay_2, bore_1, bore_2)


def outlet_pressures(p1, p2, chamber_2: int, s, th, on):
    """Return the pressures in Pa at the outlets of the valves: of the chambers, or before hoses with a bore."""
    bore_1, bore_2 = hose_bores(chamber_2, th, on)
    return s[AT_END_1] if bore_1 > 0.0 else p1, s[AT_END_2] if bore_2 > 0.0 else p2


def hoses_step(t, h, p1, p2, q_in, q_out, more_in, more_out, chamber_2: int, s, ring, base, th, on):
    """Pass the flows of the valves through the hoses in a step.

    Args:
        t: Time in s.
        h: Step in s.
        p1: Pressure of chamber 1 in Pa.
        p2: Pressure of chamber 2 in Pa.
        q_in: Mass flow into the hose of chamber 1 in kg/s.
        q_out: Mass flow out of it in kg/s.
        more_in: The same of chamber 2.
        more_out: The same of chamber 2.
        chamber_2: What closes chamber 2.
        s: State, shape (26,), changed in place.
        ring: Ring buffer of the hoses, shape (k, 5), changed in place.
        base: Base parameters.
        th: Parameters of effects.
        on: Switches of effects.

    Returns:
        The four flows that arrive in the chambers in kg/s.
    """
    delay_1, delay_2 = hose_delays(th, on)
    bore_1, bore_2 = hose_bores(chamber_2, th, on)
    wave_1, wave_2 = 0.0 if bore_1 > 0.0 else delay_1, 0.0 if bore_2 > 0.0 else delay_2
    if max(wave_1, wave_2) > 0.0:
        head, tail, tail_2 = int(s[AT_HEAD]), int(s[AT_TAIL]), int(s[AT_TAIL_2])
        q_in, q_out, more_in, more_out, head, tail, tail_2 = line_step(
            t, q_in, q_out, more_in, more_out, wave_1, wave_2, ring, head, tail, tail_2
        )
        s[AT_HEAD], s[AT_TAIL], s[AT_TAIL_2] = head, tail, tail_2
    if bore_1 > 0.0:
        end, through, q_in, q_out = hose_step(s[AT_END_1], s[AT_THROUGH_1], p1, q_in - q_out, h, delay_1, bore_1, base)
        s[AT_END_1], s[AT_THROUGH_1] = end, through
    if bore_2 > 0.0:
        end, through, more_in, more_out = hose_step(
            s[AT_END_2], s[AT_THROUGH_2], p2, more_in - more_out, h, delay_2, bore_2, base
        )
        s[AT_END_2], s[AT_THROUGH_2] = end, through
    return q_in, q_out, more_in, more_out


def dead_volumes(chamber_2: int, base, th, on):
    """Return the dead volumes of both chambers in m^3, without the gas of a hose that is at its valve."""
    delay_1, delay_2 = hose_delays(th, on)
    bore_1, bore_2 = hose_bores(chamber_2, th, on)
    dead_1 = volume_beyond_hose(base[DEAD_1] + volume_1(th, on), delay_1, bore_1, base)
    return dead_1, volume_beyond_hose(base[DEAD_2] + volume_2(th, on), delay_2, bore_2, base)


def chambers_step(
    p1, p1_mid, m1, p2, p2_mid, dp2, m2, T2, h, x, v, q_in, q_out, more_in, more_out, k1, k2, chamber_2: int,
    base, th, on,
):  # fmt: skip
    """Advance both chambers by a step.

    Args:
        p1: Pressure of chamber 1 in Pa.
        p1_mid: The same at the midpoint.
        m1: Mass of its gas in kg.
        p2: Pressure of chamber 2 in Pa.
        p2_mid: The same at the midpoint.
        dp2: Its gradient in the last step in Pa/s.
        m2: Mass of its gas in kg.
        T2: Temperature of its gas in K.
        h: Step in s.
        x: Position at the midpoint in m.
        v: Velocity at the midpoint in m/s.
        q_in: Mass flow into chamber 1 in kg/s.
        q_out: Mass flow out of it in kg/s.
        more_in: Mass flow into chamber 2 in kg/s.
        more_out: Mass flow out of it in kg/s.
        k1: Flow constant of the gas of chamber 1 in s/m.
        k2: Flow constant of the gas of chamber 2 in s/m.
        chamber_2: What closes chamber 2.
        base: Base parameters.
        th: Parameters of effects.
        on: Switches of effects.

    Returns:
        Pressure in Pa, its gradient in Pa/s, mass in kg and temperature in K, of chamber 1 and of chamber 2.
    """
    hot, area_1, area_2 = has_heat(on), base[AREA_1], base[AREA_2]
    dead_1, dead_2 = dead_volumes(chamber_2, base, th, on)
    volume = dead_1 + area_1 * x
    p1, dp1, m1, T1 = chamber_1_step(p1, p1_mid, p2_mid, m1, h, volume, area_1 * v, q_in, q_out, hot, k1, base, th, on)
    if chamber_2 != OPEN:
        volume = dead_2 + area_2 * (base[STROKE] - x)
        p2, dp2, m2, T2 = chamber_2_step(
            p2, p1_mid, p2_mid, m2, h, volume, -area_2 * v, more_in, more_out, hot, k1, k2, base, th, on
        )
    return p1, dp1, m1, T1, p2, dp2, m2, T2


def advance_readings(dt, s, base, th, on):
    """Advance the readings of p1 and p2 by a step of ``dt`` s; they follow the pressures with the sensors' lag."""
    lag = sensor_lag(th, on)
    now_1, now_2 = read_p1(s[AT_P1], base[AMBIENT], th, on), read_p2(s[AT_P2], base[AMBIENT], th, on)
    if lag > 0.0:
        s[AT_R1] = first_order_lag(dt, now_1, lag, s[AT_R1], s[AT_BEFORE_1])
        s[AT_R2] = first_order_lag(dt, now_2, lag, s[AT_R2], s[AT_BEFORE_2])
    else:
        s[AT_R1], s[AT_R2] = now_1, now_2
    s[AT_BEFORE_1], s[AT_BEFORE_2] = now_1, now_2


def plant_outputs(inputs, flags, s, base, th, on, outputs):
    """Write the outputs: x, v, a, readings of p1 and p2, temperature, flow, and the pressures in the chambers, SI.

    Args:
        inputs: As of :func:`plant_step`.
        flags: Switches of the rig.
        s: State, shape (26,).
        base: Base parameters.
        th: Parameters of effects.
        on: Switches of effects.
        outputs: Filled, shape (9,).
    """
    x, v, p1, p2 = s[AT_X], s[AT_V], s[AT_P1], s[AT_P2]
    outputs[0], outputs[1], outputs[2], outputs[3], outputs[4] = x, v, 0.0, s[AT_R1], s[AT_R2]
    outputs[5], outputs[6], outputs[7], outputs[8] = s[AT_T1], s[AT_FLOW], p1, p2
    if has_heat(on):
        dead_1, _ = dead_volumes(int(flags[CHAMBER_2]), base, th, on)
        outputs[5] = p1 * (dead_1 + base[AREA_1] * x) / (base[GAS] * s[AT_M1])
    if flags[MECHANICS] > 0.0:
        m, stiffness = base[MASS] + mass(th, on), bristle_stiffness(th, on)
        a = piston_acceleration(
            x, v, s[AT_Z], s[AT_REST], s[AT_DV], p1, p2, inputs[PLANT_FORCE], m, stiffness, base, th, on
        )
        outputs[2] = read_a(a, th, on)
