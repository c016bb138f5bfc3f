"""The readings of the sensors of p1 and p2, and the pressures that follow from readings."""

import math

from pneucli.simulate.kernel.arrays import new_copy
from pneucli.simulate.kernel.ports import read_p1, read_p2, scalars, sensor_delay, sensor_lag, unread_p1, unread_p2
from pneucli.simulate.layout import *


def undo_lag(time, inputs, column, lag, true, chamber):
    """Correct a measured column for a first-order lag, in place: add ``lag`` times the slope.

    The slope is taken over half the lag on each side; over single samples it would mostly be noise.

    Args:
        time: Time stamps in s, shape (n,).
        inputs: Inputs in the kernel's layout, shape (n, 8).
        column: Column of the pressure.
        lag: Time constant in s.
        true: Corrected in place: pressures in Pa, shape (n, 2).
        chamber: 0 or 1.
    """
    half, i, j = 0.5 * lag + 1e-9, 0, 0
    for k in range(time.size):
        while i < k - 1 and time[k] - time[i] > half:
            i += 1
        while j < time.size - 1 and (j <= k or time[j + 1] - time[k] <= half):
            j += 1
        true[k, chamber] += lag * (inputs[j, column] - inputs[i, column]) / (time[j] - time[i])


def undo_delay(time, inputs, column, delay, true, chamber):
    """Move a measured column earlier in time, in place; its last value is held.

    The nearest sample is extrapolated along the slope over 4 samples on each side: the mean of two neighbours would
    have less noise than either, and a delay could gain by it.

    Args:
        time: Time stamps in s, shape (n,).
        inputs: Inputs in the kernel's layout, shape (n, 8).
        column: Column of the pressure.
        delay: Delay in s.
        true: Moved in place: pressures in Pa, shape (n, 2).
        chamber: 0 or 1.
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


def unread(readings, base, th, on):
    """Replace steady readings (n, 2) of p1 and p2 by the pressures that they stand for, in place."""
    for k in range(readings.shape[0]):
        readings[k, 0] = unread_p1(readings[k, 0], base[AMBIENT], th, on)
        readings[k, 1] = unread_p2(readings[k, 1], base[AMBIENT], th, on)


def true_pressures(time, inputs, lag, base, th, on):
    """Return the pressures (n, 2) in Pa whose readings are the measured (smoothed) ones; ``lag`` in s."""
    true, delay = new_copy(inputs[:, IN_P1 : IN_P2 + 1]), sensor_delay(th, on)
    for chamber in range(2):
        if lag > 0.0:
            undo_lag(time, inputs, IN_P1 + chamber, lag, true, chamber)
        if delay > 0.0:
            undo_delay(time, inputs, IN_P1 + chamber, delay, true, chamber)
    unread(true, base, th, on)
    return true


def add_unread_change(first_pass, restarts, base, th, on, true):
    """Add to the pressures ``true`` at each restart what the model's sensors do not show there yet, in place.

    ``first_pass`` (n, 10) is the output of a model that has forgotten its own start. Before a restart its pressures
    are taken, shifted to that restart's.
    """
    shown, before = new_copy(first_pass[:, R1 : R2 + 1]), 0
    unread(shown, base, th, on)
    for k in restarts:
        for chamber in range(2):
            shift = true[k, chamber] - shown[k, chamber]
            for j in range(before, k + 1):
                true[j, chamber] = first_pass[j, P1 + chamber] + shift
        before = k + 1


def past_pressure(time, before, simulated, first, k, t):
    """Return a pressure at an earlier time, linear between samples.

    Args:
        time: Time stamps in s, shape (n,).
        before: Pressures in Pa up to the restart, shape (n,).
        simulated: Pressures in Pa since the restart, shape (n,).
        first: Sample of the restart.
        k: Present sample.
        t: The earlier time in s.

    >>> past_pressure([0.0, 1.0, 2.0], [10.0, 20.0, 0.0], [0.0, 0.0, 40.0], first=2, k=2, t=1.5)
    30.0
    """
    j = k
    while j > 0 and time[j] > t:
        j -= 1
    a = simulated[j] if j >= first else before[j]
    if j == k:
        return a
    b = simulated[j + 1] if j + 1 >= first else before[j + 1]
    return a + (b - a) * (t - time[j]) / (time[j + 1] - time[j])


def first_order_lag(step, now, lag, reading, before):
    """Return the reading of a first-order sensor, exact for a linear change since the last sample.

    The bilinear (Tustin) rule would ring.

    Args:
        step: Time since the last sample in s.
        now: Input now.
        lag: Time constant in s, above 0.
        reading: Reading at the last sample.
        before: Input at the last sample.

    A ramp of slope 1 is followed with a delay of the lag once the start is forgotten:

    >>> round(first_order_lag(1.0, 5.0, 0.1, reading=3.9, before=4.0), 12)
    4.9
    """
    e = math.exp(-step / lag)
    g = (1.0 - e) * lag / step
    return e * reading + (g - e) * before + (1.0 - g) * now


def read_pressures(time, inputs, true, out, before, first, k, base, th, on):
    """Write the readings of p1 and p2 at sample k; ``before`` holds their last undelayed inputs."""
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
        out[k, R1] = first_order_lag(time[k] - time[k - 1], now_1, lag, out[k - 1, R1], before[0])
        out[k, R2] = first_order_lag(time[k] - time[k - 1], now_2, lag, out[k - 1, R2], before[1])
    else:
        out[k, R1], out[k, R2] = inputs[k, IN_P1], inputs[k, IN_P2]
    before[0], before[1] = now_1, now_2


def run_true_pressures(time, inputs, base_values, th_values, on_values):
    """Replace the readings of p1 and p2 by the pressures that they stand for, in place.

    Args:
        time: Time stamps in s, shape (n,).
        inputs: Inputs in the kernel's layout, shape (n, 8).
        base_values: Base parameters, shape (19,).
        th_values: Parameters of effects.
        on_values: Switches of effects.
    """
    base, th, on = scalars(base_values, th_values, on_values)
    true = true_pressures(time, inputs, sensor_lag(th, on), base, th, on)
    for k in range(time.size):
        inputs[k, IN_P1], inputs[k, IN_P2] = true[k, 0], true[k, 1]
