"""Velocity and acceleration from position, acceleration or both, without drift; each a linear map of the signals."""

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

MIN_REST_SAMPLES = 9  # samples at least, over which a rest is recognised
REST_NOISE_RATIO = 1.5  # times the sensor's noise, beyond which an accelerometer is not at rest
ZERO_VELOCITY_SIGMA = 5.0  # standard deviations of the integrated noise
JUMP_ERROR_RATIO = 0.3  # of a jump in acceleration times the period: uniform over the period, 1 / sqrt(12)


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


def integrate_between_rests(time: Array, a: Array, rest: Mask) -> Array:
    """Return the velocity (m/s) from acceleration (m/s^2), shape (n,), made zero at every sample of ``rest``.

    What has gathered between two rests is taken away as a straight line (zero-velocity update).
    """
    v = np.concatenate([[0.0], cumulative_trapezoid(a, time)])
    return np.asarray(v - np.interp(time, time[rest], v[rest]))


def rest_mask(time: Array, a: Array, noise: NoiseModel) -> Mask:
    """Return where an accelerometer says that the piston rests, shape (n,).

    Quiet stretches, but not those of steady sliding: the velocity gathered since the last rest must be zero within
    what the sensor's noise, the uncertainty of its bias and the sampling of jumps add up to. The first quiet stretch
    is a rest.
    """
    window = correlation_samples(a, noise)
    level = np.median(a[_is_quiet(a - np.median(a), noise, window)]) if a.size else 0.0
    quiet = _is_quiet(a - level, noise, window)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], quiet.astype(np.int8), [0]])))
    rest = np.zeros(a.size, dtype=bool)
    dt = float(np.median(np.diff(time)))
    known, total, last = 0, 0.0, 0
    for start, stop in edges.reshape(-1, 2):
        bias = total / known if known else float(np.mean(a[start:stop]))
        gathered = float(np.sum(a[last:start] - bias)) * dt
        steps = start - last
        missed = JUMP_ERROR_RATIO * float(np.linalg.norm(np.diff(a[last : start + 1])))
        spread = dt * np.hypot(noise.rms * np.sqrt(steps + steps**2 / max(known, window)), missed)
        if known == 0 or abs(gathered) <= ZERO_VELOCITY_SIGMA * spread:
            rest[start:stop] = True
            known, total, last = known + stop - start, total + float(np.sum(a[start:stop])), int(stop)
    return rest


def correlation_samples(a: Array, noise: NoiseModel) -> int:
    """Return over how many samples an acceleration stays what it is, at least ``MIN_REST_SAMPLES``.

    Half of the time after which its autocovariance has halved.
    """
    power = np.abs(np.fft.rfft(a - a.mean(), 2 * a.size)) ** 2
    covariance = np.fft.irfft(power)[: a.size] / a.size
    below = np.flatnonzero(covariance < 0.5 * (covariance[0] - noise.rms**2))
    return max(int(below[0]) // 2, MIN_REST_SAMPLES) if below.size else MIN_REST_SAMPLES


def _is_quiet(a: Array, noise: NoiseModel, window: int) -> Mask:
    """Return windows whose power is that of the noise alone; a window's outer quarters stay outside."""
    loud = uniform_filter1d(a**2, window, mode="reflect") > (REST_NOISE_RATIO * noise.rms) ** 2
    return np.asarray(~loud)
