"""Derivatives of the readings of p1 and p2 by parameters of the valves' areas, over a recording."""

import numpy as np

from pneucli.simulate.kernel.ports import read_p1, read_p2, scalars, sensor_delay, sensor_lag, unread_p1, unread_p2
from pneucli.simulate.kernel.run import advance, middles
from pneucli.simulate.kernel.sensors import add_unread_change, first_order_lag, unread
from pneucli.simulate.layout import AMBIENT, IN_P1, IN_P2, P1, R1, R2


def read_sensitivities(time, restarts, before, out, base, th, on, derivatives):
    """Replace the derivatives of the pressures by those of their readings, in place.

    Args:
        time: Time stamps in s, shape (n,).
        restarts: Samples of the restarts.
        before: Derivatives of the pressures up to the restarts, shape (n, 2, columns); (0, 2, columns): they are 0.
        out: Output of the simulation, shape (n, 10).
        base: Base parameters.
        th: Parameters of effects.
        on: Switches of effects.
        derivatives: Derivatives of both pressures, shape (n, 2, columns).
    """
    lag, delay, columns = sensor_lag(th, on), sensor_delay(th, on), derivatives.shape[2]
    pressures = derivatives.copy() if delay > 0.0 else derivatives
    undelayed, last = np.zeros((2, columns)), np.zeros((2, columns))
    first = segment = 0
    for k in range(time.size):
        if segment < restarts.size and k == restarts[segment]:
            first, segment = k, segment + 1
        # with a lag, what is read at a restart does not depend on the model
        by_now, by_reading, by_before = 0.0 if lag > 0.0 else 1.0, 0.0, 0.0
        if lag > 0.0 and k > first:  # the sensor is linear
            step = time[k] - time[k - 1]
            by_now = first_order_lag(step, 1.0, lag, 0.0, 0.0)
            by_reading, by_before = first_order_lag(step, 0.0, lag, 1.0, 0.0), first_order_lag(step, 0.0, lag, 0.0, 1.0)
        m: int = k
        while delay > 0.0 and m > 0 and time[m] > time[k] - delay:
            m -= 1
        w = (time[k] - delay - time[m]) / (time[m + 1] - time[m]) if m < k else 0.0
        for chamber in range(2):
            p = out[k, P1 + chamber]
            if chamber == 0:
                slope = 0.5 * (read_p1(p + 1.0, base[AMBIENT], th, on) - read_p1(p - 1.0, base[AMBIENT], th, on))
            else:
                slope = 0.5 * (read_p2(p + 1.0, base[AMBIENT], th, on) - read_p2(p - 1.0, base[AMBIENT], th, on))
            for j in range(columns):
                now = pressures[k, chamber, j]
                if m < k:
                    now = pressures[m, chamber, j] if m >= first else past(before, m, chamber, j)
                    then = pressures[m + 1, chamber, j] if m + 1 >= first else past(before, m + 1, chamber, j)
                    now += w * (then - now)
                now *= slope
                reading = by_now * now + by_reading * last[chamber, j] + by_before * undelayed[chamber, j]
                undelayed[chamber, j], last[chamber, j] = now, reading
                derivatives[k, chamber, j] = reading


def past(before, k, chamber, j):
    """Return a derivative before a restart, 0 where there are none."""
    return before[k, chamber, j] if before.shape[0] > 0 else 0.0


def start_sensitivities(first_pass, restarts, base, th, on, pressures, shown, true):
    """Write the derivatives of the pressures at and before each restart, as of
    :func:`pneucli.simulate.kernel.sensors.add_unread_change`.

    Args:
        first_pass: Output of the first pass, shape (n, 10).
        restarts: Samples of the restarts.
        base: Base parameters.
        th: Parameters of effects.
        on: Switches of effects.
        pressures: Derivatives of its pressures, shape (n, 2, columns).
        shown: Those of its readings.
        true: Filled with the derivatives, shape (n, 2, columns).
    """
    before = 0
    for k in restarts:
        r1, r2 = first_pass[k, R1], first_pass[k, R2]
        slope_1 = 0.5 * (unread_p1(r1 + 1.0, base[AMBIENT], th, on) - unread_p1(r1 - 1.0, base[AMBIENT], th, on))
        slope_2 = 0.5 * (unread_p2(r2 + 1.0, base[AMBIENT], th, on) - unread_p2(r2 - 1.0, base[AMBIENT], th, on))
        for i in range(before, k + 1):
            for j in range(true.shape[2]):
                true[i, 0, j] = pressures[i, 0, j] - slope_1 * shown[k, 0, j]
                true[i, 1, j] = pressures[i, 1, j] - slope_2 * shown[k, 1, j]
        before = k + 1


def run_area_derivatives(
    time, inputs, restarts, base_values, th_values, on_values, flags, areas, areas_2, h_max, shapes, shapes_2, out,
    derivatives,
):  # fmt: skip
    """Simulate one recording, and differentiate the readings of p1 and p2 by parameters of the valves' areas.

    The motion is the measured one, and the supply pressure does not depend on the flow.

    Args:
        time: Time stamps in s, shape (n,).
        inputs: Smoothed readings, shape (n, 8).
        restarts: Samples of the restarts, shape (r,).
        base_values: Base parameters, shape (19,).
        th_values: Parameters of effects.
        on_values: Switches of effects, shape (effects + 1,).
        flags: Switches of the recording, shape (9,).
        areas: Areas in m^2 of chamber 1 over openings of -U_MAX..U_MAX.
        areas_2: The same of chamber 2.
        h_max: Longest step in s.
        shapes: Derivatives of ``areas``, shape (areas, columns).
        shapes_2: Derivatives of ``areas_2``.
        out: Filled with the output, shape (n, 10).
        derivatives: Filled with the derivatives of both readings, shape (n, 2, columns).

    References:
        R. P. Dickinson and R. J. Gelinas, J. Comput. Phys. 21 (1976) 123-143 (sensitivity equations).
    """
    base, th, on = scalars(base_values, th_values, on_values)
    columns = derivatives.shape[2]
    start, none = np.zeros((0, 2, columns)), np.zeros(2)
    true = inputs[:, IN_P1 : IN_P2 + 1].copy()
    unread(true, base, th, on)
    if sensor_lag(th, on) > 0.0 or sensor_delay(th, on) > 0.0:
        first_pass, pressures, earlier = np.zeros(out.shape), np.zeros(derivatives.shape), middles(restarts)
        advance(
            time, inputs, true, earlier, base_values, th_values, on_values, flags, areas, areas_2, h_max, none, none,
            first_pass, shapes, shapes_2, start, pressures,
        )  # fmt: skip
        shown = pressures.copy()
        read_sensitivities(time, earlier, start, first_pass, base, th, on, shown)
        start = np.zeros(derivatives.shape)
        start_sensitivities(first_pass, restarts, base, th, on, pressures, shown, start)
        add_unread_change(first_pass, restarts, base, th, on, true)
    advance(
        time, inputs, true, restarts, base_values, th_values, on_values, flags, areas, areas_2, h_max, none, none, out,
        shapes, shapes_2, start, derivatives,
    )  # fmt: skip
    read_sensitivities(time, restarts, start, out, base, th, on, derivatives)
