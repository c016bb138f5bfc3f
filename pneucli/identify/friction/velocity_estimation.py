"""Velocity and acceleration from position and acceleration together, without drift.

From a position alone, see :mod:`pneucli.simulate.position_smoother`; from an acceleration alone,
:mod:`pneucli.simulate.velocity_integration`.
"""

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
    """Build the map from position and acceleration to a velocity without drift, and the accelerometer's bias.

    Least squares over position, velocity and one bias: x differs by its noise, and the velocity follows the
    acceleration, linear between samples, except for its noise and for jumps between two samples (break-away and stop),
    which ``a`` locates.

    Args:
        time: Stamps in s, shape (n,).
        a: Acceleration in m/s^2, shape (n,).
        x_noise: Standard deviation of x in m.
        a_noise: Standard deviation of a in m/s^2.

    Returns:
        The map from x and a, each (n,), to velocity in m/s and bias in m/s^2.

    """
    dt = np.diff(time)
    tolerance = dt * (a_noise + JUMP_ERROR_RATIO * np.abs(np.diff(a)))  # m/s a step
    weights = 1.0 / x_noise, 1.0 / tolerance, 2.0 / (tolerance * dt)
    return lambda x, a: least_squares_motion(dt, *weights, x, a)[1:]
