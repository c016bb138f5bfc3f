"""Velocity and acceleration from position, acceleration or both, without drift; each a linear map of the signals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pneucli.simulate.motion_smoother import least_squares_motion
from pneucli.simulate.velocity_integration import JUMP_ERROR_RATIO

Array = NDArray[np.float64]
Smoother = Callable[[Array], Array]


def fuse_position_and_acceleration(
    time: Array, a: Array, x_noise: float, a_noise: float
) -> Callable[[Array, Array], tuple[Array, float]]:
    """Return the map from x (m) and a (m/s^2), shape (n,), to velocity (m/s) without drift and the bias of a.

    Least squares over position, velocity and one bias: x errs by its noise, and each step obeys the acceleration,
    linear in between, but for its noise and for what the sampling misses where it jumps (break-away and stop happen
    between two samples): ``a`` says where.
    """
    dt = np.diff(time)
    slack = dt * (a_noise + JUMP_ERROR_RATIO * np.abs(np.diff(a)))  # m/s a step
    path = least_squares_motion(dt, 1.0 / x_noise, 1.0 / slack, 2.0 / (slack * dt))
    return lambda x, a: path(x, a)[1:]
