"""The reading of a slow sensor of the gas temperature, such as a thermocouple."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.caches import compiled
from pneucli.simulate.kernel.sensors import first_order_lag

SAME_STEP = 1e-9  # of a step: the rounding of stamps


def temperature_reading(time: Array, temperature: Array, time_constant: float, starts: NDArray[np.int64]) -> Array:
    """Return the reading of a first-order sensor, which starts at the gas temperature, after each gap anew.

    The reading is linear in the temperature: of a derivative of the temperature it is that derivative of the reading.

    Args:
        time: Time stamps in s, shape (n,).
        temperature: Gas temperature in K, or derivatives of it by m parameters; shape (n,) or (n, m).
        time_constant: Time constant in s, above 0.
        starts: Samples at which it starts: the first one, and those after gaps.

    Returns:
        Reading in K, of the shape of ``temperature``.

    >>> time = np.arange(0.0, 5.0, 0.01)
    >>> ramp = 293.0 + 10.0 * time
    >>> late = ramp - temperature_reading(time, ramp, 0.3, np.array([0]))
    >>> round(float(late[-1]), 3)  # of a ramp of 10 K/s, once the start is forgotten
    3.0
    """
    columns = np.ascontiguousarray(temperature, dtype=np.float64).reshape(time.size, -1)
    reading = columns.copy()
    _follow(time, columns, starts, time_constant, reading)
    return reading.reshape(temperature.shape)


_lag: Callable[..., float] = compiled(nogil=True)(first_order_lag)


@compiled(nogil=True)
def _follow(time: Array, columns: Array, starts: NDArray[np.int64], time_constant: float, reading: Array) -> None:
    """Follow the columns; an exponential costs more than a step, and most steps of a recording are alike."""
    known, kept, earlier, now = 0.0, 0.0, 0.0, 0.0
    for s in range(starts.size):
        end = starts[s + 1] if s + 1 < starts.size else time.size
        for i in range(starts[s] + 1, end):
            step = time[i] - time[i - 1]
            if not abs(step - known) <= SAME_STEP * step:
                known, kept = step, _lag(step, 0.0, time_constant, 1.0, 0.0)
                earlier, now = _lag(step, 0.0, time_constant, 0.0, 1.0), _lag(step, 1.0, time_constant, 0.0, 0.0)
            for j in range(columns.shape[1]):
                reading[i, j] = kept * reading[i - 1, j] + earlier * columns[i - 1, j] + now * columns[i, j]
