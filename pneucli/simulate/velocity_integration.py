"""Motion without a position sensor: a measured velocity, or one integrated from acceleration between rests (6.6).

An accelerometer tells rest from motion; at every rest the velocity is zero, so that no drift gathers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.errors import InputError
from pneucli.noise import NoiseModel
from pneucli.recording import Recording
from pneucli.simulate.local_polynomials import LocalPolynomialSmoother
from pneucli.simulate.motion_smoother import MeasuredMotion, Motion

MIN_REST_SAMPLES = 9  # over which a rest is recognised
REST_NOISE_RATIO = 1.5  # times the sensor's noise, beyond which the piston is not at rest
ZERO_VELOCITY_SIGMA = 5.0  # standard deviations of the integrated noise, within which the velocity counts as zero
JUMP_ERROR_RATIO = 0.3  # of a jump in acceleration times the period: a uniform instant has 1 / sqrt(12)


@dataclass(frozen=True)
class IntegratedMotion(MeasuredMotion):
    """The map from a measured v or a to position and velocity, each (n,); position counts from ``start`` (m).

    ``rest`` (n,) is where the accelerometer says that the piston rests; None where the velocity is measured, which
    ``smoother`` then smooths.
    """

    differentiates: ClassVar[bool] = False
    start: float
    rest: Mask | None = None
    smoother: LocalPolynomialSmoother | None = None

    @property
    def memory(self) -> float:
        """The time in s over which it spreads a stop."""
        return self.smoother.memory if self.smoother else 0.0

    def motion(self, readings: Mapping[str, Array]) -> Motion:
        """Return the motion of readings, or what draws of their noise become but for ``start``."""
        if self.rest is None:
            v = self.smoother(readings["v"]) if self.smoother else readings["v"]
        else:
            v = integrate_between_rests(self.time, readings["a"], self.rest)
            v[self.rest] = 0.0
        a = readings["a"] if "a" in readings else np.gradient(v, self.time)
        return self.start + _cumulative_integral(v, self.time), v, a


def _cumulative_integral(values: Array, time: Array) -> Array:
    """Return the integral (n,) from the first sample on, by trapezoids."""
    return np.concatenate([[0.0], np.cumsum(np.diff(time) * (values[1:] + values[:-1]) / 2.0)])


def integrated_motion(
    recording: Recording,
    raw: Mapping[str, Array],
    noise: Mapping[str, NoiseModel],
    smoothers: Mapping[str, LocalPolynomialSmoother],
) -> IntegratedMotion | None:
    """Return how motion follows from v or a where x was not measured; None where x was, or neither of them.

    Args:
        recording: The recording, whose stated x (m) is where the motion starts.
        raw: Readings by signal (SI), each (n,).
        noise: Noise of each sensor.
        smoothers: Smoother of each signal.

    Raises:
        InputError: The acceleration never rests, so that its integral would drift.

    """
    if not recording.kind.motion_signals or "x" in raw or not {"v", "a"} & raw.keys():
        return None
    stated = recording["x"] if "x" in recording else np.zeros(1)
    start = float(stated[np.isfinite(stated)][0])
    if "v" in raw:
        return IntegratedMotion(recording.time, start, None, smoothers.get("v"))
    rest = rest_mask(recording.time, raw["a"], noise["a"])
    if not rest.any():
        wanted = "x, v, or rests between which the acceleration is integrated"
        raise InputError(f"recording {recording.name}", "never at rest", wanted, code="E062")
    return IntegratedMotion(recording.time, start, rest)


def without_constant_position(signals: Mapping[str, Array], noise: Mapping[str, NoiseModel]) -> dict[str, Array]:
    """Return the signals without an x that never changes while v or a shows motion: x is then a place, no motion.

    Args:
        signals: Readings by signal (SI), each (n,).
        noise: Noise of each sensor.
    """
    held = "x" in signals and np.ptp(signals["x"]) == 0.0
    moving = any(n in signals and np.std(signals[n]) > REST_NOISE_RATIO * noise[n].rms for n in ("v", "a"))
    return {n: y for n, y in signals.items() if not (n == "x" and held and moving)}


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
    v = _cumulative_integral(a, time)
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
    near_median = a[_is_quiet(a - np.median(a), noise, window)] if a.size else a
    if not near_median.size:
        return np.zeros(a.size, dtype=bool)
    bias_guess = np.median(near_median)
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
    from scipy.ndimage import uniform_filter1d  # noqa: PLC0415 - slow to import, and few recordings have an accelerometer

    exceeds_noise = uniform_filter1d(a**2, window, mode="reflect") > (REST_NOISE_RATIO * noise.rms) ** 2
    return np.asarray(~exceeds_noise)
