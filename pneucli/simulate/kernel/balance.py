"""The force that a given motion needs, and the residual of the force balance: measured friction minus the model's."""

import math

import numpy as np

from pneucli.simulate.kernel.friction import bristle_force, friction_levels
from pneucli.simulate.kernel.ports import (
    bristle_stiffness,
    force,
    mass,
    read_a,
    read_p1,
    scalars,
    sensor_delay,
    sensor_lag,
    static_factor,
    viscous_factor,
)
from pneucli.simulate.kernel.sensors import first_order_lag, true_pressures
from pneucli.simulate.layout import *


def net_pressure_force(pressures, k, base):
    """Return the net force in N of the pressures above ambient on the piston at sample k.

    Args:
        pressures: Pressures of both chambers in Pa, shape (n, 2).
        k: Index of the sample.
        base: Base parameters by :mod:`pneucli.simulate.layout`: areas in m^2, ambient pressure in Pa.

    References:
        Thesis (2.47); with a rod, ambient pressure acts on the difference of the areas.

    >>> import numpy as np
    >>> base = np.zeros(19)
    >>> base[AMBIENT], base[AREA_1], base[AREA_2] = 1e5, 8e-4, 6e-4
    >>> print(round(net_pressure_force(np.array([[6e5, 2e5]]), 0, base), 9))  # 8e-4 x 5e5 - 6e-4 x 1e5
    340.0
    """
    return base[AREA_1] * (pressures[k, 0] - base[AMBIENT]) - base[AREA_2] * (pressures[k, 1] - base[AMBIENT])


def run_imposed(time, inputs, a, v_still, driven, base_values, th_values, on_values, out):
    """Write the driving force that a model needs for a given motion.

    Within ``v_still`` dry friction is proportional to the velocity: there the motion does not determine its sign.

    Args:
        time: Time stamps in s, shape (n,).
        inputs: Inputs in the kernel's layout, shape (n, 8).
        a: Acceleration in m/s^2, shape (n,).
        v_still: Speed in m/s below which the direction is uncertain.
        driven: Whether a driving force was measured; the force of the pressures is then subtracted.
        base_values: Base parameters, shape (19,).
        th_values: Parameters of effects.
        on_values: Switches of effects.
        out: Filled with the force in N, shape (n,).
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
            z, friction = bristle_force(z, dx, h, max(level, 1e-9), stiffness, th, on)
            friction += c * v
        known = net_pressure_force(true, k, base) if driven else 0.0
        out[k] = m * a[k] + friction - force(x, v, base[STROKE], th, on) - known


def mean_clipped_drive(drive, falling, rising, spread):
    """Return the drive clipped to the branches of friction, and the probability that it lies between them.

    Both are means over the normal spread of the drive.

    Args:
        drive: Force that drives the piston along its motion in N.
        falling: Dry friction while slowing in N.
        rising: Dry friction while speeding up in N.
        spread: Standard deviation of the drive in N.

    >>> mean_clipped_drive(15.0, 12.0, 20.0, 0.0)  # without noise the drive itself
    (15.0, 0.0)
    >>> clipped, between = mean_clipped_drive(16.0, 12.0, 20.0, 2.0)  # 2 sigma from both branches
    >>> clipped, round(between, 4)
    (16.0, 0.9545)
    """
    if rising == falling or spread == 0.0:
        return min(max(drive, falling), rising), 0.0
    low, high = (drive - falling) / spread, (drive - rising) / spread
    below_low, below_high = 0.5 * math.erfc(-low / math.sqrt(2.0)), 0.5 * math.erfc(-high / math.sqrt(2.0))
    bends = math.exp(-0.5 * low * low) - math.exp(-0.5 * high * high)
    passed = low * below_low - high * below_high + bends / math.sqrt(2.0 * math.pi)
    return falling + spread * passed, max(below_low - below_high, 0.0)


def alternating_sign(k):
    """Return a sign that alternates from sample to sample, for noise that is added again."""
    return 1.0 if k % 2 else -1.0


def apply_sensor_lag(time, inputs, true, readings, unsure, lag, noise, base, out, back):
    """Convert the residual while the piston moves into that of sensors with a lag, in place.

    The force that the model needs, as its sensors would read it, is compared with the force that they read. Correcting
    the readings for the lag would keep their noise and lose the slope that smoothing removed, so the lag would be
    estimated too small. Each segment of motion starts with residual 0; the noise removed by this is added again.
    """
    reading = needed = begun = 0.0
    moving = False
    for k in range(time.size):
        if inputs[k, IN_V] == 0.0 or unsure[k] != 0:
            moving = False
            continue
        read, before = net_pressure_force(readings, k, base), needed
        needed = net_pressure_force(true, k, base) - out[k]
        if moving:
            reading = first_order_lag(time[k] - time[k - 1], needed, lag, reading, before)
        else:
            moving, begun, reading = True, time[k], read
        out[k] = read - reading
        forgetting = math.exp((begun - time[k]) / lag)
        back[k] += alternating_sign(k) * noise * math.sqrt(forgetting * (2.0 - forgetting))


def run_balance(
    time, inputs, a, rough, leaving, unsure, contact, noise, base_values, th_values, on_values, out, gap, width
):
    """Write the residual of the force balance: measured friction minus that of the model.

    At rest only a force beyond the model's holding friction counts, of the smoothed pressures, so that noise does not
    count as such a force. Nothing counts on an end, which may carry any force, also one that pushes the piston off it:
    a spring that the model lacks may hold it there. Between the branches of friction the drive itself is the
    friction, including smoothing noise. That noise is known; what subtracting it gains is added again with an
    alternating sign.

    Args:
        time: Time stamps in s, shape (n,).
        inputs: Smoothed p1, p2 and motion (v = 0 at rest), shape (n, 8).
        a: Reading of the acceleration in m/s^2, shape (n,).
        rough: Force in N of the noise removed from the pressures, shape (n,).
        leaving: Velocity in m/s of a piston that breaks away at this sample, else 0, shape (n,).
        unsure: Samples with an uncertain direction, where 0 is written, shape (n,).
        contact: Side on which an end may carry the piston, shape (n,).
        noise: Noise of the force in N and N/s, shape (2,).
        base_values: Base parameters, shape (19,).
        th_values: Parameters of effects.
        on_values: Switches of effects.
        out: Filled with the residual in N, shape (n,).
        gap: Filled with the probability that the drive lies between the branches, where the model predicts an interval
            of forces, shape (n,).
        width: Filled with the width in N of that interval, shape (n,).

    References:
        C. Stein, Ann. Stat. 9 (1981) 1135-1151 (unbiased estimate of risk).
    """
    base, th, on = scalars(base_values, th_values, on_values)
    m, stiffness, z, rest = base[MASS] + mass(th, on), bristle_stiffness(th, on), 0.0, 0.0
    p_amb, lag = base[AMBIENT], sensor_lag(th, on)
    # the residual counts in the readings' units, and noise keeps its size: else a gain or a mass could make it less
    gain = 1e-5 * (read_p1(p_amb + 1e5, p_amb, th, on) - read_p1(p_amb, p_amb, th, on))
    spread = math.hypot(noise[0], lag * noise[1]) / gain
    bias = read_a(0.0, th, on)
    back = np.zeros(time.size)
    true = true_pressures(time, inputs, lag, base, th, on)
    late, read = sensor_delay(th, on), 0
    for k in range(time.size):
        x, v, p1, p2 = inputs[k, IN_X], inputs[k, IN_V], true[k, 0], true[k, 1]
        h = time[k] - time[max(k - 1, 0)]
        while read < time.size - 1 and 0.5 * (time[read] + time[read + 1]) <= time[k] + late:
            read += 1  # the sample at which the sensor read what was there at k, as in advance()
        push = net_pressure_force(true, k, base) + inputs[k, IN_FORCE] + force(x, v, base[STROKE], th, on)
        resting = v == 0.0 and leaving[k] == 0.0
        friction = push if resting else push - m * (a[k] - bias)
        direction = 1.0 if v > 0.0 or (v == 0.0 and friction > 0.0) else -1.0
        speed = abs(v + leaving[k])
        if v == 0.0 and contact[k] != 0.0:  # also where it leaves: the end gives way
            rest += h
            continue
        rising, falling = friction_levels(direction, speed, x, p1, p2, base, th, on)
        c = base[VISCOUS] * viscous_factor(direction, th, on)
        # what drives the piston tells the branch: beyond both it speeds up or slows, between them it goes on (Filippov)
        drive = direction * push - c * abs(v)
        branch, between = mean_clipped_drive(drive, falling, rising, spread)
        if v != 0.0:
            back[k] = rough[read]
        if stiffness > 0.0 and not resting:
            z, held = bristle_force(z, x - inputs[max(k - 1, 0), IN_X], h, max(branch, 1e-9), stiffness, th, on)
            out[k] = friction - held - c * v
            rest = 0.0
            continue
        if v == 0.0:
            held = rising * static_factor(rest, th, on)
            over = abs(friction) - held - c * speed
            rest += h
            out[k] = direction * (over if leaving[k] * direction > 0.0 else max(over, 0.0))
            if stiffness > 0.0:  # the force tells the deflection far better than the position
                z = min(max(friction, -held), held) / stiffness
            continue
        rest = 0.0
        gap[k], width[k] = between, gain * (rising - falling)
        back[k] += alternating_sign(k) * noise[0] * math.sqrt(2.0 * between)
        out[k] = friction - c * v - direction * branch
    if lag > 0.0:
        readings = true_pressures(time, inputs, 0.0, base, th, on)
        apply_sensor_lag(time, inputs, true, readings, unsure, lag, noise[0], base, out, back)
    for k in range(time.size):
        out[k] = 0.0 if unsure[k] != 0 else out[k] * gain + back[k]
