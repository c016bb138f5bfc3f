"""Motion without a position sensor: a measured velocity, or one integrated from acceleration between rests (6.6).

An accelerometer tells rest from motion; at every rest the velocity is zero, so that no drift gathers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import uniform_filter1d

from pneucli.errors import InputError
from pneucli.noise import NoiseModel
from pneucli.recording import Recording
from pneucli.simulate.local_polynomials import LocalPolynomialSmoother

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MIN_REST_SAMPLES = 9  # samples at least, over which a rest is recognised
REST_NOISE_RATIO = 1.5  # times the sensor's noise, beyond which an accelerometer is not at rest
ZERO_VELOCITY_SIGMA = 5.0  # standard deviations of the integrated noise
JUMP_ERROR_RATIO = 0.3  # of a jump in acceleration times the period: uniform over the period, 1 / sqrt(12)


@dataclass(frozen=True)
class IntegratedMotion:
    """The map from a measured v or a to position and velocity, each (n,); position counts from ``start`` (m).

    ``rest`` (n,) is where the accelerometer says that the piston rests; None where the velocity is measured, which
    ``smoother`` then smooths.
    """

    time: Array
    start: float
    rest: Mask | None = None
    smoother: LocalPolynomialSmoother | None = None

    @property
    def memory(self) -> float:
        """The time in s over which it spreads a stop."""
        return self.smoother.memory if self.smoother else 0.0

    def __call__(self, signals: Mapping[str, Array]) -> tuple[Array, Array]:
        """Return x and v of readings, or what draws of their noise become but for ``start``."""
        if self.rest is None:
            v = self.smoother(signals["v"]) if self.smoother else signals["v"]
        else:
            v = integrate_between_rests(self.time, signals["a"], self.rest)
            v[self.rest] = 0.0
        return self.start + cumulative_trapezoid(v, self.time, initial=0), v


def integrated_motion(
    recording: Recording,
    raw: Mapping[str, Array],
    noise: Mapping[str, NoiseModel],
    smoothers: Mapping[str, LocalPolynomialSmoother],
) -> IntegratedMotion | None:
    """Return how motion follows from v or a where x was not measured; None where x was, or neither of them.

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
        raise InputError(f"recording {recording.name}", "never at rest", wanted)
    return IntegratedMotion(recording.time, start, rest)


def without_constant_position(signals: Mapping[str, Array], noise: Mapping[str, NoiseModel]) -> dict[str, Array]:
    """Return the signals without an x that never changes while v or a shows motion: x is then a place, no motion."""
    held = "x" in signals and np.ptp(signals["x"]) == 0.0
    moving = any(n in signals and np.std(signals[n]) > REST_NOISE_RATIO * noise[n].rms for n in ("v", "a"))
    return {n: y for n, y in signals.items() if not (n == "x" and held and moving)}


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
    at_median = a[_is_quiet(a - np.median(a), noise, window)] if a.size else a
    if not at_median.size:
        return np.zeros(a.size, dtype=bool)
    level = np.median(at_median)
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
