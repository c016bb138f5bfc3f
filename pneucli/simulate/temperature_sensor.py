"""The reading of a slow sensor of the gas temperature, such as a thermocouple."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pneucli.caches import compiled
from pneucli.simulate.kernel.sensors import first_order_lag

Array = NDArray[np.float64]


def temperature_reading(time: Array, temperature: Array, time_constant: float, starts: NDArray[np.int64]) -> Array:
    """Return the reading of a first-order sensor, which starts at the gas temperature, after each gap anew.

    Args:
        time: Time stamps in s, shape (n,).
        temperature: Gas temperature in K, shape (n,).
        time_constant: Time constant in s, above 0.
        starts: Samples at which it starts: the first one, and those after gaps.

    Returns:
        Reading in K, shape (n,).

    >>> time = np.arange(0.0, 5.0, 0.01)
    >>> ramp = 293.0 + 10.0 * time
    >>> late = ramp - temperature_reading(time, ramp, 0.3, np.array([0]))
    >>> round(float(late[-1]), 3)  # of a ramp of 10 K/s, once the start is forgotten
    3.0
    """
    reading = temperature.copy()
    _follow(time, temperature, starts, time_constant, reading)
    return reading


_lag: Callable[..., float] = compiled(nogil=True)(first_order_lag)


@compiled(nogil=True)
def _follow(time: Array, temperature: Array, starts: NDArray[np.int64], time_constant: float, reading: Array) -> None:
    for s in range(starts.size):
        end = starts[s + 1] if s + 1 < starts.size else time.size
        for i in range(starts[s] + 1, end):
            reading[i] = _lag(time[i] - time[i - 1], temperature[i], time_constant, reading[i - 1], temperature[i - 1])
