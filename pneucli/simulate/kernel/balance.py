"""The residual of the force balance: measured friction minus the model's."""

import math

import numpy as np

from pneucli.simulate.kernel.friction import bristle_force, friction_levels
from pneucli.simulate.kernel.imposed import net_pressure_force
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
from pneucli.simulate.layout import AMBIENT, IN_FORCE, IN_V, IN_X, MASS, STROKE, VISCOUS


def mean_clipped_drive(drive, falling, rising, spread):
    """The drive between both branches, in the mean over its normal spread; and how likely it is between them."""
    if rising == falling or spread == 0.0:
        return min(max(drive, falling), rising), 0.0
    low, high = (drive - falling) / spread, (drive - rising) / spread
    below_low, below_high = 0.5 * math.erfc(-low / math.sqrt(2.0)), 0.5 * math.erfc(-high / math.sqrt(2.0))
    bends = math.exp(-0.5 * low * low) - math.exp(-0.5 * high * high)
    passed = low * below_low - high * below_high + bends / math.sqrt(2.0 * math.pi)
    return falling + spread * passed, max(below_low - below_high, 0.0)


def alternating_sign(k):
    """A sign that changes from sample to sample, for noise that is put back."""
    return 1.0 if k % 2 else -1.0


def apply_sensor_lag(time, inputs, true, readings, unsure, lag, noise, base, out, back):
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
        read, before = net_pressure_force(readings, k, base), needed
        needed = net_pressure_force(true, k, base) - out[k]
        if moving:
            reading = first_order_lag(time, needed, k, lag, reading, before)
        else:
            moving, begun, reading = True, time[k], read
        out[k] = read - reading
        forgetting = math.exp((begun - time[k]) / lag)
        back[k] += alternating_sign(k) * noise * math.sqrt(forgetting * (2.0 - forgetting))


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
        push = net_pressure_force(true, k, base) + inputs[k, IN_FORCE] + force(x, v, base[STROKE], th, on)
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
        branch, between = mean_clipped_drive(drive, falling, rising, spread)
        if v != 0.0:
            back[k] = rough[read]
        if stiffness > 0.0:
            z, held = bristle_force(z, x - inputs[max(k - 1, 0), IN_X], h, max(branch, 1e-9), stiffness, th, on)
            out[k] = friction - held - c * v
            continue
        if v == 0.0:
            over = abs(friction) - rising * static_factor(rest, th, on) - c * speed
            rest += h
            out[k] = direction * (over if leaving[k] * direction > 0.0 else max(over, 0.0))
            continue
        rest = 0.0
        gap[k] = between
        back[k] += alternating_sign(k) * noise[0] * math.sqrt(2.0 * between)
        out[k] = friction - c * v - direction * branch
    if lag > 0.0:
        apply_sensor_lag(time, inputs, true, readings, unsure, lag, noise[0], base, out, back)
    for k in range(time.size):
        out[k] = 0.0 if unsure[k] != 0 else out[k] * gain + back[k]
