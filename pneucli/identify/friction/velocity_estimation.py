"""Velocity and acceleration from position, acceleration or both, without drift."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import uniform_filter1d

from pneucli.noise import NoiseModel
from pneucli.simulate.motion_smoother import least_squares_motion

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Smoother = Callable[[Array], Array]

MIN_REST_SAMPLES = 9  # over which a rest is recognised
REST_NOISE_RATIO = 1.5  # times the sensor's noise, beyond which the piston is not at rest
ZERO_VELOCITY_SIGMA = 5.0  # standard deviations of the integrated noise, within which the velocity counts as zero
JUMP_ERROR_RATIO = 0.3  # of a jump in acceleration times the period: a uniform instant has 1 / sqrt(12)


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
    acceleration_tolerance = dt * (a_noise + JUMP_ERROR_RATIO * np.abs(np.diff(a)))  # m/s a step
    smoother = least_squares_motion(
        dt, 1.0 / x_noise, 1.0 / acceleration_tolerance, 2.0 / (acceleration_tolerance * dt)
    )
    return lambda x, a: smoother(x, a)[1:]


def integrate_between_rests(time: Array, a: Array, rest: Mask) -> Array:
    """Integrate an acceleration to a velocity that is zero at every rest (zero-velocity update).

    The drift between two rests is removed as a straight line.

    Args:
        time: Stamps in s, shape (n,).
        a: Acceleration in m/s^2, shape (n,).
        rest: Where the piston rests, shape (n,).

    Returns:
        The velocity in m/s, shape (n,).

    """
    v = np.concatenate([[0.0], cumulative_trapezoid(a, time)])
    return np.asarray(v - np.interp(time, time[rest], v[rest]))


def rest_mask(time: Array, a: Array, noise: NoiseModel) -> Mask:
    """Detect rests from an accelerometer.

    Rests are quiet spans except those of steady sliding: the velocity gained since the last rest must be zero within
    the tolerance of the sensor's noise, of the bias, and of the sampling of jumps. The first quiet span is a rest.

    Args:
        time: Stamps in s, shape (n,).
        a: Acceleration in m/s^2, shape (n,).
        noise: Noise of the accelerometer.

    Returns:
        The mask, shape (n,).

    """
    window = correlation_samples(a, noise)
    bias_guess = np.median(a[_is_quiet(a - np.median(a), noise, window)]) if a.size else 0.0
    is_quiet = _is_quiet(a - bias_guess, noise, window)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], is_quiet.astype(np.int8), [0]])))
    rest = np.zeros(a.size, dtype=bool)
    dt = float(np.median(np.diff(time)))
    rest_samples, rest_sum, last_rest_end = 0, 0.0, 0
    for start, stop in edges.reshape(-1, 2):
        bias = rest_sum / rest_samples if rest_samples else float(np.mean(a[start:stop]))
        gained_velocity = float(np.sum(a[last_rest_end:start] - bias)) * dt
        steps = start - last_rest_end
        jump_error = JUMP_ERROR_RATIO * float(np.linalg.norm(np.diff(a[last_rest_end : start + 1])))
        tolerance = dt * np.hypot(noise.rms * np.sqrt(steps + steps**2 / max(rest_samples, window)), jump_error)
        if rest_samples == 0 or abs(gained_velocity) <= ZERO_VELOCITY_SIGMA * tolerance:
            rest[start:stop] = True
            rest_samples, rest_sum, last_rest_end = (
                rest_samples + stop - start,
                rest_sum + float(np.sum(a[start:stop])),
                int(stop),
            )
    return rest


def correlation_samples(a: Array, noise: NoiseModel) -> int:
    """Estimate over how many samples an acceleration is correlated.

    That is half of the time in which its autocovariance halves.

    Args:
        a: Acceleration in m/s^2, shape (n,).
        noise: Noise of the accelerometer.

    Returns:
        The number of samples, at least ``MIN_REST_SAMPLES``.

    """
    power = np.abs(np.fft.rfft(a - a.mean(), 2 * a.size)) ** 2
    covariance = np.fft.irfft(power)[: a.size] / a.size
    halved = np.flatnonzero(covariance < 0.5 * (covariance[0] - noise.rms**2))
    return max(int(halved[0]) // 2, MIN_REST_SAMPLES) if halved.size else MIN_REST_SAMPLES


def _is_quiet(a: Array, noise: NoiseModel, window: int) -> Mask:
    """Mask samples whose windowed power is that of the noise alone."""
    exceeds_noise = uniform_filter1d(a**2, window, mode="reflect") > (REST_NOISE_RATIO * noise.rms) ** 2
    return np.asarray(~exceeds_noise)
