"""The simulation kernel: the state space of the thesis (2.47-2.52) with set-valued friction, one recording a call.

This file is the text from which :mod:`pneucli.simulate.build` makes the compiled kernel: the functions between the
two marks are the ports (:data:`pneucli.physics.declaration.PORTS`) without any effect and are replaced by the
effects' own equations. It is also valid Python as it stands: the base model, slowly.

Scheme: the pressures take a midpoint step (one evaluation, extrapolated from the last one), the velocity a
trapezoidal step in which dry friction is a set: a piston that stops within a step stops exactly there, and holds
until the force exceeds what holds it. The command is held over a sample, measured inputs are interpolated.
"""
# ruff: noqa: F403, F405, D103
# mypy: ignore-errors

import math

import numpy as np

from pneucli.physics.gas import *
from pneucli.simulate.layout import *

# --- ports (replaced by the effects' equations) ---


def command(u, h, s, th, on):
    return u


def critical_ratio(b, th, on):
    return b


def leak_area(th, on):
    return 0.0


def leak_1_ambient(p1, p_amb, k, th, on):
    return 0.0


def leak_2_ambient(p2, p_amb, k, th, on):
    return 0.0


def leak_1_2(p1, p2, k, th, on):
    return 0.0


def volume_1(th, on):
    return 0.0


def volume_2(th, on):
    return 0.0


def heat(T, T_wall, th, on):
    return 0.0


def has_heat(on):
    return False


def supply(p, p_set, q, k_gas, h, s, th, on):
    return p


def flow_delay(th, on):
    return 0.0


def dry_rise(coulomb, v, th, on):
    return 0.0


def slowing(th, on):
    return 1.0


def has_slowing(on):
    return False


def dry_factor(direction, x, p1, p2, p_amb, th, on):
    return 1.0


def static_factor(rest_time, th, on):
    return 1.0


def viscous_factor(direction, th, on):
    return 1.0


def force(x, v, stroke, th, on):
    return 0.0


def mass(th, on):
    return 0.0


def bristle_stiffness(th, on):
    return 0.0


def bristle_damping(th, on):
    return 0.0


def read_p1(p, p_amb, th, on):
    return p


def read_p2(p, p_amb, th, on):
    return p


def unread_p1(p, p_amb, th, on):
    return p


def unread_p2(p, p_amb, th, on):
    return p


def read_a(a, th, on):
    return a


def sensor_lag(th, on):
    return 0.0


def sensor_delay(th, on):
    return 0.0


def scalars(base, th, on):
    return base, th, on


# --- end of ports ---


def area_of(u, u_max, areas):
    """Effective area in m^2 at opening u, from a table over -u_max..u_max (linear in between)."""
    last = areas.size - 1
    place = (u + u_max) * (last / (2.0 * u_max))
    if place <= 0.0:
        return areas[0]
    if place >= last:
        return areas[last]
    i = int(place)
    return areas[i] + (place - i) * (areas[i + 1] - areas[i])


def valve_flow(opening, p, p_s, p_amb, b, leak, k, k_gas, u_max, areas):
    """Flow in kg/s from supply to outlet and from outlet to exhaust (thesis 2.46); k_gas is the supply gas's."""
    area = area_of(opening, u_max, areas)
    fill = leak
    vent = leak
    if opening > 0.0:
        fill += area
    else:
        vent += area
    q_in = 0.0
    q_out = 0.0
    if fill > 0.0:
        q_in = fill * orifice_flow(p_s, p, b, k_gas, k)
    if vent > 0.0:
        q_out = vent * orifice_flow(p, p_amb, b, k, k_gas)
    return q_in, q_out


def pressure_rate(p, T, volume, growth, q_in, q_out, heat_flow, base):
    """dp/dt in Pa/s by the energy balance; at constant T and without heat the isentropic chamber (2.14, 2.22).

    The exponent is that of the gas, kappa, or less where heat that is not simulated flows: 1 is the isothermal chamber.
    """
    gamma = base[EXPONENT]
    enthalpy = base[GAS] * (base[TEMP] * q_in - T * q_out)
    return (gamma * (enthalpy - p * growth) + (gamma - 1.0) * heat_flow) / volume


def friction_levels(direction, speed, x, p1, p2, base, th, on):
    """Dry friction in N while speeding up and while slowing; equal without hysteresis. Never below 1e-9 N: factors
    beyond what they are valid for must not make it push, and bristles need a level.
    """
    factor = dry_factor(direction, x, p1, p2, base[AMBIENT], th, on)
    rising = max((base[COULOMB] + dry_rise(base[COULOMB], speed, th, on)) * factor, 1e-9)
    if has_slowing(on):
        return rising, min(max(base[COULOMB] * slowing(th, on) * factor, 1e-9), rising)
    return rising, rising


def beyond(drive, rising, falling):
    """What of the driving force along the motion dry friction leaves: zero between the branches (Filippov)."""
    if drive > rising:
        return drive - rising
    if drive < falling:
        return drive - falling
    return 0.0


def soft_clip(drive, falling, rising, spread):
    """The drive between both branches, in the mean over its normal spread; and how likely it is between them."""
    if rising == falling or spread == 0.0:
        return min(max(drive, falling), rising), 0.0
    low, high = (drive - falling) / spread, (drive - rising) / spread
    below_low, below_high = 0.5 * math.erfc(-low / math.sqrt(2.0)), 0.5 * math.erfc(-high / math.sqrt(2.0))
    bends = math.exp(-0.5 * low * low) - math.exp(-0.5 * high * high)
    passed = low * below_low - high * below_high + bends / math.sqrt(2.0 * math.pi)
    return falling + spread * passed, max(below_low - below_high, 0.0)


def from_rest(x, push, h, rest, m, p1, p2, base, th, on):
    """Hold, or break away and move for h; returns x, v, time at rest."""
    direction = 1.0 if push > 0.0 else -1.0
    rising, _ = friction_levels(direction, 0.0, x, p1, p2, base, th, on)
    if abs(push) <= rising * static_factor(rest, th, on) or h <= 0.0:
        return x, 0.0, rest + h
    c = base[VISCOUS] * viscous_factor(direction, th, on)
    v = direction * (abs(push) - rising) / (m / h + 0.5 * c)
    return x + 0.5 * h * v, v, 0.0


def slide(x, v, v_guess, push, h, rest, m, p1, p2, base, th, on):
    """Move for h under the force push (all but friction, at midpoint); returns x, v, time at rest."""
    if v == 0.0:
        return from_rest(x, push, h, rest, m, p1, p2, base, th, on)
    direction = 1.0 if v > 0.0 else -1.0
    rising, falling = friction_levels(direction, abs(v_guess), x, p1, p2, base, th, on)
    c = base[VISCOUS] * viscous_factor(direction, th, on)
    v_new = v + direction * beyond(direction * (push - c * v), rising, falling) / (m / h + 0.5 * c)
    if v_new * direction > 0.0:
        return x + 0.5 * h * (v + v_new), v_new, 0.0
    stopped = h * v / (v - v_new)
    return from_rest(x + 0.5 * stopped * v, push, h - stopped, 0.0, m, p1, p2, base, th, on)


def mean_decay(y):
    """(1 - exp(-y)) / y for y >= 0: the mean of exp(-y s) over s = 0..1; by its series (to 5e-8) where y is small."""
    if y < 0.25:
        return 1.0 - y * (1 / 2 - y * (1 / 6 - y * (1 / 24 - y * (1 / 120 - y * (1 / 720)))))
    return (1.0 - math.exp(-y)) / y


def slide_on_bristles(x, v, z, dv, push, h, m, p1, p2, stiffness, base, th, on):
    """Move for h with LuGre bristles of deflection z; returns x, v, z. Implicit in the velocity, exact in z."""
    direction = 1.0 if v > 0.0 or (v == 0.0 and push > 0.0) else -1.0
    speed = abs(v + 0.5 * dv)
    rising, falling = friction_levels(direction, speed, x, p1, p2, base, th, on)
    level = falling if dv * direction < 0.0 else rising
    sigma = bristle_damping(th, on)
    c = base[VISCOUS] * viscous_factor(direction, th, on)
    # z at midpoint is (z + h/2 v_mid) / (1 + h/2 rate); all is multiplied by the level, which spares two divisions
    rate = stiffness * speed / level
    whole, pull = level + 0.5 * h * stiffness * speed, stiffness * (level - sigma * speed)
    inertia = 2.0 * m / h
    v_mid = (whole * (inertia * v + push) - pull * z) / (whole * (inertia + sigma + c) + 0.5 * h * pull)
    return x + h * v_mid, 2.0 * v_mid - v, z + h * (v_mid - rate * z) * mean_decay(rate * h)


def acceleration(v, z, push, dv, rest, x, m, p1, p2, stiffness, base, th, on):
    """dv/dt in m/s^2 at one instant, with the same friction as the step."""
    direction = 1.0 if v > 0.0 or (v == 0.0 and push > 0.0) else -1.0
    rising, falling = friction_levels(direction, abs(v), x, p1, p2, base, th, on)
    c = base[VISCOUS] * viscous_factor(direction, th, on)
    if stiffness > 0.0:
        level = falling if dv * direction < 0.0 else rising
        flow = v - stiffness * abs(v) / level * z
        return (push - stiffness * z - bristle_damping(th, on) * flow - c * v) / m
    if v == 0.0 and abs(push) <= rising * static_factor(rest, th, on):
        return 0.0
    return direction * beyond(direction * (push - c * v), rising, falling) / m


def most_steps(time, h_max, span):
    """The largest number of steps of the kernel that begin within ``span`` s."""
    most = count = first = 0
    for k in range(time.size - 1):
        count += steps_between(time[k], time[k + 1], h_max)
        while time[first] < time[k] - span:
            count -= steps_between(time[first], time[first + 1], h_max)
            first += 1
        most = max(most, count)
    return most


def steps_between(t, t_next, h_max):
    """Number of equal steps from one sample to the next, each at most h_max long."""
    return max(math.ceil((t_next - t) / h_max - 1e-9), 1)


def delayed(ring, tail, t):
    """Flows into and out of either chamber at time t from a ring of (time, in, out, in 2, out 2), 0 before the first;
    returns the four and the new tail.

    The tail is the newest entry that is not after t; t must not go back, nor reach the newest of all.
    """
    size = ring.shape[0]
    nxt = tail + 1 if tail + 1 < size else 0
    while ring[nxt, 0] <= t:
        tail = nxt
        nxt = tail + 1 if tail + 1 < size else 0
    if ring[tail, 0] < -1e29:
        return 0.0, 0.0, 0.0, 0.0, tail
    old, new = ring[tail], ring[nxt]
    w = (t - old[0]) / (new[0] - old[0])
    q_in, q_out = old[1] + w * (new[1] - old[1]), old[2] + w * (new[2] - old[2])
    return q_in, q_out, old[3] + w * (new[3] - old[3]), old[4] + w * (new[4] - old[4]), tail


def chamber_step(p, p_mid, mass, h, volume, growth, q_in, q_out, hot, base, th, on):
    """Advance one chamber by h; returns p, dp/dt, gas mass, gas temperature (constant in the base model).

    Heat to the wall is implicit in the pressure (at the midpoint), so that it may settle within a step.
    """
    T, warm, drag, flow = base[TEMP], 0.0, 0.0, q_in - q_out
    if hot:
        slope = volume / (base[GAS] * max(mass + 0.5 * h * flow, 1e-9))  # of the temperature over the pressure
        T = p_mid * slope
        fading = 0.5 * slope * (heat(T - 1.0, base[WALL], th, on) - heat(T + 1.0, base[WALL], th, on))
        warm = heat(T, base[WALL], th, on) + fading * (p_mid - p)
        drag = 0.5 * h * (base[GAMMA] - 1.0) * fading / volume
    rate = pressure_rate(p_mid, T, volume, growth, q_in, q_out, warm, base) / (1.0 + drag)
    return max(p + h * rate, 1.0), rate, max(mass + h * flow, 1e-9), T


def undo_lag(time, inputs, column, lag, true, chamber):
    """Turn what a first-order sensor reads into what it saw: ``lag`` times the slope is added.

    The slope is taken over half the lag to each side: over single samples it would mostly be noise.
    """
    half, i, j = 0.5 * lag + 1e-9, 0, 0
    for k in range(time.size):
        while i < k - 1 and time[k] - time[i] > half:
            i += 1
        while j < time.size - 1 and (j <= k or time[j + 1] - time[k] <= half):
            j += 1
        true[k, chamber] += lag * (inputs[j, column] - inputs[i, column]) / (time[j] - time[i])


def advance(time, inputs, column, delay, true, chamber):
    """Move a measured column earlier in time by ``delay``; its last value is held.

    From the nearest sample along the readings' slope over 4 samples to each side: the mean of two neighbours would
    have less noise than either, and a delay could gain by it.
    """
    last, j = time.size - 1, 0
    for k in range(time.size):
        while j < last and 0.5 * (time[j] + time[j + 1]) <= time[k] + delay:
            j += 1
        true[k, chamber] = true[j, chamber]  # j >= k: it has not been overwritten
        if j < last:
            before, after = max(j - 4, 0), min(j + 4, last)
            slope = (inputs[after, column] - inputs[before, column]) / (time[after] - time[before])
            true[k, chamber] += (time[k] + delay - time[j]) * slope


def true_pressures(time, inputs, lag, base, th, on):
    """Return the pressures (n, 2) of which the measured (smoothed) ones are what the sensors read; ``lag`` in s."""
    true, delay = inputs[:, IN_P1 : IN_P2 + 1].copy(), sensor_delay(th, on)
    for chamber in range(2):
        if lag > 0.0:
            undo_lag(time, inputs, IN_P1 + chamber, lag, true, chamber)
        if delay > 0.0:
            advance(time, inputs, IN_P1 + chamber, delay, true, chamber)
    for k in range(time.size):
        true[k, 0] = unread_p1(true[k, 0], base[AMBIENT], th, on)
        true[k, 1] = unread_p2(true[k, 1], base[AMBIENT], th, on)
    return true


def past_pressure(time, measured, simulated, first, k, t):
    """Pressure at an earlier time t: simulated since the restart at sample first, measured before it."""
    j = k
    while j > 0 and time[j] > t:
        j -= 1
    a = simulated[j] if j >= first else measured[j]
    if j == k:
        return a
    b = simulated[j + 1] if j + 1 >= first else measured[j + 1]
    return a + (b - a) * (t - time[j]) / (time[j + 1] - time[j])


def lagged(time, now, k, lag, reading, before):
    """What a first-order sensor reads at sample k, exact for a linear change since the last (Tustin would ring)."""
    step = time[k] - time[k - 1]
    e = math.exp(-step / lag)
    g = (1.0 - e) * lag / step
    return e * reading + (g - e) * before + (1.0 - g) * now


def read_pressures(time, inputs, true, out, before, first, k, base, th, on):
    """Write what the sensors of p1 and p2 read at sample k; ``before`` keeps their last undelayed inputs."""
    lag, delay = sensor_lag(th, on), sensor_delay(th, on)
    now_1, now_2 = out[k, P1], out[k, P2]
    if delay > 0.0:
        now_1 = past_pressure(time, true[:, 0], out[:, P1], first, k, time[k] - delay)
        now_2 = past_pressure(time, true[:, 1], out[:, P2], first, k, time[k] - delay)
    now_1, now_2 = read_p1(now_1, base[AMBIENT], th, on), read_p2(now_2, base[AMBIENT], th, on)
    if lag <= 0.0:
        out[k, R1], out[k, R2] = now_1, now_2
        return
    if k > first:
        out[k, R1] = lagged(time, now_1, k, lag, out[k - 1, R1], before[0])
        out[k, R2] = lagged(time, now_2, k, lag, out[k - 1, R2], before[1])
    else:
        out[k, R1], out[k, R2] = inputs[k, IN_P1], inputs[k, IN_P2]
    before[0], before[1] = now_1, now_2


def control(k, x_ref, x, p1, p2, cs, cp):
    """The controller in the loop, called at each sample; here proportional with a limit (benchmarks, tests)."""
    return min(max(cp[0] * (x_ref - x), -cp[1]), cp[1]), 0.0


def run(time, inputs, restarts, base_values, th_values, on_values, flags, areas, areas_2, h_max, cs, cp, out):
    """Simulate one recording; every array is laid out as in :mod:`pneucli.simulate.layout`.

    time (n,), inputs (n, 8) of smoothed readings, restarts (r,) sample indices at which x, v, p1, p2 are set to what
    they say of the truth, base (19,) and th parameters, on (effects + 1,) switches, flags (9,), areas and areas_2
    (any,) of the paths of both chambers over openings of -U_MAX..U_MAX, out (n, 10) is filled. States without a sensor
    go on over a restart.
    """
    n = time.size
    base, th, on = scalars(base_values, th_values, on_values)
    mechanics, pneumatics, chamber_2 = flags[MECHANICS] > 0.0, flags[PNEUMATICS] > 0.0, int(flags[CHAMBER_2])
    shut, loop, u_max, p_amb = flags[VALVE_SHUT] > 0.0, flags[LOOP] > 0.0, flags[U_MAX], base[AMBIENT]
    gamma_rt = base[GAMMA] * base[GAS] * base[TEMP]
    k_gas = flow_constant(base[GAS], base[TEMP], base[GAMMA])
    hot = has_heat(on)
    true = true_pressures(time, inputs, sensor_lag(th, on), base, th, on)

    b, leak = critical_ratio(base[CRITICAL], th, on), leak_area(th, on)
    area_1, area_2, stroke = base[AREA_1], base[AREA_2], base[STROKE]
    dead_1, dead_2 = base[DEAD_1] + volume_1(th, on), base[DEAD_2] + volume_2(th, on)
    m = base[MASS] + mass(th, on)
    stiffness = bristle_stiffness(th, on)
    bias = (area_1 - area_2) * p_amb
    null, lower, upper = base[NULL], base[LOWER_END], base[UPPER_END]

    delay = flow_delay(th, on)
    ring = np.full((most_steps(time, h_max, delay + h_max) + 2 if delay > 0.0 else 1, 5), -1e30)
    head, tail = 0, ring.shape[0] - 1
    s1, s2 = np.full(on_values.size, flags[INITIAL_U]), np.full(on_values.size, flags[INITIAL_U2])
    s_supply, before = np.zeros(on_values.size), np.zeros(2)

    x = v = z = rest = dv = dp1 = dp2 = q_supply = 0.0
    p1 = p2 = p_amb
    m1 = m2 = 1.0
    T1 = T2 = base[TEMP]
    k1 = k2 = k_gas
    first = segment = 0
    for k in range(n):
        last = k == n - 1
        nxt = k if last else k + 1
        dt = h_max if last else time[nxt] - time[k]
        fresh = segment < restarts.size and k == restarts[segment]
        if fresh:
            segment += 1
            first = k
        if fresh or not mechanics:
            x, v = inputs[k, IN_X], inputs[k, IN_V]
        if fresh or not pneumatics:
            p1, p2 = true[k, 0], true[k, 1]
        if chamber_2 == OPEN and pneumatics:
            p2 = p_amb
        if fresh:
            dp1 = dp2 = dv = 0.0
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
            push = area_1 * p1 - area_2 * p2 - bias + inputs[k, IN_FORCE] + force(x, v, stroke, th, on)
            a = acceleration(v, z, push, dv, rest, x, m, p1, p2, stiffness, base, th, on)
            if v == 0.0 and ((x <= lower and push < 0.0) or (x >= upper and push > 0.0)):
                a = 0.0  # the end carries it
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
                v_guess = v + 0.5 * dv if (v + 0.5 * dv) * v > 0.0 else v
                push = area_1 * p1_mid - area_2 * p2_mid - bias + driven
                push += force(x + 0.5 * h * v, v_guess, stroke, th, on)
                x_old, v_old, rest_old = x, v, rest
                if stiffness > 0.0:
                    x, v, z = slide_on_bristles(x, v, z, dv, push, h, m, p1_mid, p2_mid, stiffness, base, th, on)
                else:
                    x, v, rest = slide(x, v, v_guess, push, h, rest, m, p1_mid, p2_mid, base, th, on)
                if x < lower or x > upper:
                    x, v = min(max(x, lower), upper), 0.0
                    rest = rest_old + h if v_old == 0.0 else 0.0  # a piston that is pressed against a stop rests
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
            if flags[STATED_SUPPLY] > 0.0:
                p_line = base[SUPPLY]
            p_line = supply(p_line, base[SUPPLY], q_supply, gamma_rt, h, s_supply, th, on)
            q_in = q_out = more_in = more_out = 0.0
            if not shut:
                opening = command(u, h, s1, th, on)
                q_in, q_out = valve_flow(opening, p1_mid, p_line, p_amb, b, leak, k1, k_gas, u_max, areas)
            if chamber_2 not in (OPEN, CLOSED):
                opening = command(u2, h, s2, th, on)
                more_in, more_out = valve_flow(opening, p2_mid, p_line, p_amb, b, leak, k2, k_gas, u_max, areas_2)
            q_supply = q_in + more_in
            if i == 0:
                out[k, FLOW] = q_in - q_out
            if delay > 0.0:
                t = time[k] + (i + 0.5) * h
                # without back-flow: delayed, it would oscillate as no hose does
                ring[head, 0], ring[head, 1], ring[head, 2] = t, max(q_in, 0.0), max(q_out, 0.0)
                ring[head, 3], ring[head, 4] = max(more_in, 0.0), max(more_out, 0.0)
                q_in, q_out, more_in, more_out, tail = delayed(ring, tail, t - delay)
                head = head + 1 if head + 1 < ring.shape[0] else 0
            across = leak_1_2(p1_mid, p2_mid, k1, th, on)
            q_out += across + leak_1_ambient(p1_mid, p_amb, k1, th, on)
            p1, dp1, m1, T1 = chamber_step(
                p1, p1_mid, m1, h, dead_1 + area_1 * x_mid, area_1 * v_mid, q_in, q_out, hot, base, th, on
            )
            if chamber_2 == OPEN:
                continue
            q_in, q_out = across + more_in, leak_2_ambient(p2_mid, p_amb, k2, th, on) + more_out
            volume_2_mid = dead_2 + area_2 * (stroke - x_mid)
            p2, dp2, m2, T2 = chamber_step(
                p2, p2_mid, m2, h, volume_2_mid, -area_2 * v_mid, q_in, q_out, hot, base, th, on
            )


def run_gradient(u, p, p_supply, base_values, th_values, on_values, u_max, areas, out):
    """Write the gradient of chamber 1 in Pa/s as its sensor reads it, shape (n,), at held commands and a fixed volume.

    u (n,) in V, readings p (n,) and p_supply (n,) in Pa, the gas at its usual temperature. Nothing that has a memory
    takes part: the spool has settled, a play is centred, no heat has been exchanged, what flows arrives at once.
    """
    base, th, on = scalars(base_values, th_values, on_values)
    p_amb, volume = base[AMBIENT], base[DEAD_1] + volume_1(th, on)
    k_gas = flow_constant(base[GAS], base[TEMP], base[GAMMA])
    b, leak = critical_ratio(base[CRITICAL], th, on), leak_area(th, on)
    spool = np.zeros(on_values.size)
    for i in range(u.size):
        spool[:] = u[i]
        true = unread_p1(p[i], p_amb, th, on)
        opening = command(u[i], 1.0, spool, th, on)
        q_in, q_out = valve_flow(opening, true, p_supply[i], p_amb, b, leak, k_gas, k_gas, u_max, areas)
        q_out += leak_1_ambient(true, p_amb, k_gas, th, on)
        sensed = 0.5 * (read_p1(true + 1.0, p_amb, th, on) - read_p1(true - 1.0, p_amb, th, on))
        out[i] = sensed * pressure_rate(true, base[TEMP], volume, 0.0, q_in, q_out, 0.0, base)


def bristles(z, dx, h, level, stiffness, th, on):
    """Deflection after a displacement dx within h, and the force of the LuGre model's bristles, exact in z."""
    rate = stiffness * abs(dx) / level
    change = (dx - rate * z) * mean_decay(rate)
    speed = change / h if h > 0.0 else 0.0
    return z + change, stiffness * (z + change) + bristle_damping(th, on) * speed


def run_imposed(time, inputs, a, v_still, driven, base_values, th_values, on_values, out):
    """Write the driving force in N that the model needs for a given motion, shape (n,): the net force of the pressures,
    or what is left to a measured one beside them, where it is ``driven`` by one.

    Within ``v_still`` dry friction goes through zero in a straight line: what it is at rest, motion does not tell.
    """
    base, th, on = scalars(base_values, th_values, on_values)
    m, stiffness, z = base[MASS] + mass(th, on), bristle_stiffness(th, on), 0.0
    true = true_pressures(time, inputs, sensor_lag(th, on), base, th, on)
    for k in range(time.size):
        x, v, p1, p2 = inputs[k, IN_X], inputs[k, IN_V], true[k, 0], true[k, 1]
        direction = 1.0 if v >= 0.0 else -1.0
        rising, falling = friction_levels(direction, abs(v), x, p1, p2, base, th, on)
        level = falling if a[k] * direction < 0.0 else rising
        c = base[VISCOUS] * viscous_factor(direction, th, on)
        friction = level * min(max(v / v_still, -1.0), 1.0) + c * v
        if stiffness > 0.0:
            dx, h = x - inputs[max(k - 1, 0), IN_X], time[k] - time[max(k - 1, 0)]
            z, friction = bristles(z, dx, h, level, stiffness, th, on)
            friction += c * v
        known = pressures_force(true, k, base) if driven else 0.0
        out[k] = m * a[k] + friction - force(x, v, base[STROKE], th, on) - known


def pressures_force(pressures, k, base):
    """Force in N of the pressures on the piston at sample k, over that of the ambient pressure."""
    return base[AREA_1] * (pressures[k, 0] - base[AMBIENT]) - base[AREA_2] * (pressures[k, 1] - base[AMBIENT])


def changing(k):
    """A sign that changes from sample to sample, for noise that is put back."""
    return 1.0 if k % 2 else -1.0


def read_late(time, inputs, true, readings, unsure, lag, noise, base, out, back):
    """Turn what is left over while the piston moves into what sensors with a lag would read of it, in place.

    The force that the model needs, as its sensors would read it, against the force that they read: to undo the lag in
    the readings would leave its noise and lose what smoothing took out of their slope, so that a lag came out too
    small. Each stretch of motion starts with nothing left over; the noise that this takes away is put back.
    """
    reading = needed = begun = 0.0
    moving = False
    for k in range(time.size):
        if inputs[k, IN_V] == 0.0 or unsure[k] != 0:
            moving = False
            continue
        read, before = pressures_force(readings, k, base), needed
        needed = pressures_force(true, k, base) - out[k]
        if moving:
            reading = lagged(time, needed, k, lag, reading, before)
        else:
            moving, begun, reading = True, time[k], read
        out[k] = read - reading
        forgetting = math.exp((begun - time[k]) / lag)
        back[k] += changing(k) * noise * math.sqrt(forgetting * (2.0 - forgetting))


def run_balance(time, inputs, a, rough, leaving, unsure, contact, noise, base_values, th_values, on_values, out, gap):
    """Write what the balance of forces leaves over in N, shape (n,): measured friction minus the model's.

    inputs (n, 8) with smoothed p1, p2 and the motion (v = 0 where at rest), a (n,) its reading, rough (n,) the
    force in N of the noise taken out of the pressures, leaving (n,) the velocity in m/s of a piston that breaks away at
    this sample, else 0, unsure (n,) where the direction of motion is not known: 0 is written there, contact (n,) the
    side on which an end may carry the piston. At rest only a force that is more than the model can hold counts, of the
    smoothed pressures, so that noise does not pass for it, and none that an end may carry.
    Between the branches of friction the drive itself is the friction, smoothing noise and all. That noise is known,
    noise (2,) in N and N/s; what taking it out gains is put back, with a changing sign (Stein's unbiased estimate of
    risk, 1981). gap (n,) gets the chance that the drive is between the branches, where the model states bounds and no
    force.
    """
    base, th, on = scalars(base_values, th_values, on_values)
    m, stiffness, z, rest = base[MASS] + mass(th, on), bristle_stiffness(th, on), 0.0, 0.0
    p_amb, lag = base[AMBIENT], sensor_lag(th, on)
    # the residual counts in the readings' units, and noise keeps its size: else a gain or a mass could make it less
    gain = 1e-5 * (read_p1(p_amb + 1e5, p_amb, th, on) - read_p1(p_amb, p_amb, th, on))
    spread = math.hypot(noise[0], lag * noise[1]) / gain
    bias = read_a(0.0, th, on)
    back = np.zeros(time.size)
    readings, true = true_pressures(time, inputs, 0.0, base, th, on), true_pressures(time, inputs, lag, base, th, on)
    late, read = sensor_delay(th, on), 0
    for k in range(time.size):
        x, v, p1, p2 = inputs[k, IN_X], inputs[k, IN_V], true[k, 0], true[k, 1]
        h = time[k] - time[max(k - 1, 0)]
        while read < time.size - 1 and 0.5 * (time[read] + time[read + 1]) <= time[k] + late:
            read += 1  # the sample at which the sensor read what was there at k, as in advance()
        push = pressures_force(true, k, base) + inputs[k, IN_FORCE] + force(x, v, base[STROKE], th, on)
        resting = v == 0.0 and leaving[k] == 0.0
        friction = push if resting else push - m * (a[k] - bias)
        direction = 1.0 if v > 0.0 or (v == 0.0 and friction > 0.0) else -1.0
        speed = abs(v + leaving[k])
        if v == 0.0 and contact[k] * friction > 0.0:  # also where it seems to leave: the end gives way
            rest += h
            continue
        rising, falling = friction_levels(direction, speed, x, p1, p2, base, th, on)
        c = base[VISCOUS] * viscous_factor(direction, th, on)
        # what drives the piston tells the branch: beyond both it speeds up or slows, between them it goes on (Filippov)
        drive = direction * push - c * abs(v)
        branch, between = soft_clip(drive, falling, rising, spread)
        if v != 0.0:
            back[k] = rough[read]
        if stiffness > 0.0:
            z, held = bristles(z, x - inputs[max(k - 1, 0), IN_X], h, branch, stiffness, th, on)
            out[k] = friction - held - c * v
            continue
        if v == 0.0:
            over = abs(friction) - rising * static_factor(rest, th, on) - c * speed
            rest += h
            out[k] = direction * (over if leaving[k] * direction > 0.0 else max(over, 0.0))
            continue
        rest = 0.0
        gap[k] = between
        back[k] += changing(k) * noise[0] * math.sqrt(2.0 * between)
        out[k] = friction - c * v - direction * branch
    if lag > 0.0:
        read_late(time, inputs, true, readings, unsure, lag, noise[0], base, out, back)
    for k in range(time.size):
        out[k] = 0.0 if unsure[k] != 0 else out[k] * gain + back[k]
