"""Position, velocity and acceleration from a position sensor alone, with their covariance.

The acceleration is a Wiener process (white jerk), the sensor's noise is white: the posterior mean is a quintic
smoothing spline with continuous velocity and acceleration, found by a Kalman filter and the modified Bryson-Frazier
smoother in O(n). The intensity of the jerk varies along the recording and is estimated from it: it rises where the
piston breaks away, stops or strikes an end, and falls where the piston rests.

The mean given the readings errs independently of itself (Berkson error), so a regression on it has no bias toward
zero, as one on differentiated readings has.

References: G. Wahba, J. R. Stat. Soc. B 40 (1978); G. Bierman, IEEE Trans. Autom. Control 18 (1973);
S. Koopman and N. Shephard, Biometrika 79 (1992), for the score; H. Zhou et al., J. Comput. Graph. Stat. 28 (2019),
for the multiplicative update of a variance component.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pneucli.noise import NoiseModel
from pneucli.simulate.jerk_process import (
    adjoint_states,
    jerk_path,
    kalman_filter,
    smoothed_states,
    smoothed_variances,
)

Array = NDArray[np.float64]

WINDOW_MEMORIES = 8.0  # times the smoother's memory to either side, over which the intensity is averaged
MIN_WINDOW = 2  # samples to either side
INITIAL_INTENSITY = 1e-2  # in units of noise and period: a memory of two samples
INTENSITY_RANGE = (1e-12, 1e4)  # memories of 100 samples, where a rest has no noise left, and of a fifth of one
UPDATE_EXPONENT = 0.8  # 1/2 climbs for certain, 1 is the fixed point of the score; in between it is faster than 1/2
PRIOR_COUNT = 1.0  # squared disturbances, as expected, that count in addition to those of a window
MAX_UPDATES = 20
MIN_GAIN = 0.01  # of the log likelihood a sample: below, the intensity begins to follow the noise


@dataclass(frozen=True)
class PositionSmoother:
    """The linear map from readings of x, shape (n,), to position, velocity and acceleration.

    ``time`` in s, ``sigma`` the standard deviation of the sensor's noise in m, ``intensity`` (n - 1,) that of the
    jerk between two samples in units of the noise and the period: a diffusion in sigma^2 / period^5. ``rounding`` is
    the standard deviation in m of what quantisation adds: a rest has one and the same.
    """

    time: Array
    sigma: float
    intensity: Array
    rounding: float = 0.0

    @property
    def period(self) -> float:
        """Median sampling period in s."""
        return float(np.median(np.diff(self.time)))

    @property
    def memories(self) -> Array:
        """The time constant of the smoother in s after each sample, shape (n - 1,): gain 1 / (1 + (omega memory)^6)."""
        return np.asarray(self.intensity ** (-1 / 6) * self.period)

    @property
    def memory(self) -> float:
        """The time constant in s in its lower quartile: where the piston moves, not where it rests."""
        return float(np.quantile(self.memories, 0.25))

    def __call__(self, x: Array) -> tuple[Array, Array, Array]:
        """Return position (m), velocity (m/s) and acceleration (m/s^2), each (n,)."""
        x_smooth, v, a = (self._smoothed((x - x[0]) / self.sigma) * self._units).T
        return x_smooth + x[0], v.copy(), a.copy()

    @cached_property
    def deviations(self) -> Array:
        """Standard deviations of position, velocity and acceleration by sample, shape (n, 3), SI."""
        _, covariance, gain, variance, _, _ = kalman_filter(np.zeros(self.time.size), self._steps, self.intensity)
        nothing = np.zeros((self.time.size, 3))
        spread = smoothed_variances(self._steps, self.intensity, covariance, gain, variance, nothing)[0]
        spread[:, 0] += (self.rounding / self.sigma) ** 2
        return np.asarray(np.sqrt(spread) * self._units)

    def draw_error(self, noise: Array) -> tuple[Array, Array, Array]:
        """Return one draw of the errors of position, velocity and acceleration, each (n,), SI.

        A path of the jerk's process is drawn, read with the sensor's ``noise`` (n,) in m, and smoothed; the noise
        seeds the path, so that one reading has one error.
        Source: J. Durbin and S. Koopman, Biometrika 89 (2002).
        """
        rng = np.random.default_rng(np.frombuffer(noise[:8].tobytes(), dtype=np.uint32))
        path = jerk_path(self._steps, self.intensity, rng.standard_normal((self.time.size - 1, 3)))
        x, v, a = ((self._smoothed(path[:, 0] + noise / self.sigma) - path) * self._units).T
        return x.copy(), v.copy(), a.copy()

    def _smoothed(self, z: Array) -> Array:
        """Return the states (n, 3), from readings z (n,), all in units of noise and period."""
        predicted, covariance, gain, variance, innovation, _ = kalman_filter(z, self._steps, self.intensity)
        return smoothed_states(predicted, covariance, adjoint_states(self._steps, gain, variance, innovation))

    @cached_property
    def _steps(self) -> Array:
        return np.diff(self.time) / self.period

    @property
    def _units(self) -> Array:
        return np.asarray(self.sigma / self.period ** np.arange(3.0))


def fit_position_smoother(time: Array, x: Array, noise: NoiseModel) -> PositionSmoother:
    """Fit the smoother of one recording of a position sensor.

    The intensity of the jerk starts equal everywhere; each update multiplies it by the power of the disturbances that
    the smoother finds near a sample over the power that it expects of them, in windows as long as its memory there.
    It ends where the likelihood gains little: further updates would follow the noise.

    Args:
        time: Time stamps in s, shape (n,), n >= 4; they need not be equidistant.
        x: Readings in m, shape (n,), without gaps.
        noise: Noise of the sensor; its deviation is above 0.

    Returns:
        The smoother, a linear map of readings at these stamps.

    References:
        H. Zhou et al., J. Comput. Graph. Stat. 28 (2019), the multiplicative update.

    """
    sigma = low_frequency_deviation(noise)
    smoother = PositionSmoother(time, sigma, np.full(time.size - 1, INITIAL_INTENSITY), noise.step / np.sqrt(12))
    z, steps, before = (x - x[0]) / sigma, smoother._steps, -np.inf
    for _ in range(MAX_UPDATES):
        _, covariance, gain, variance, innovation, likelihood = kalman_filter(z, steps, smoother.intensity)
        if likelihood - before < MIN_GAIN * x.size:
            break
        before = likelihood
        adjoint = adjoint_states(steps, gain, variance, innovation)
        _, power, expected = smoothed_variances(steps, smoother.intensity, covariance, gain, variance, adjoint)
        smoother = replace(smoother, intensity=_updated(smoother.intensity, power, expected))
    return smoother


def low_frequency_deviation(noise: NoiseModel) -> float:
    """Return the standard deviation of white noise that is as strong as this one at low frequencies.

    Args:
        noise: White, coloured and rounding noise of a sensor.

    Returns:
        The deviation in the signal's unit, never below the noise's own.

    >>> float(low_frequency_deviation(NoiseModel(0.0, coloured=1.0, pole=0.6)))
    2.0

    """
    colour = noise.coloured**2 * (1 + noise.pole) / (1 - noise.pole)
    return float(max(np.sqrt(noise.white**2 + colour), noise.rms))


def _updated(intensity: Array, power: Array, expected: Array) -> Array:
    """Return the intensity after one update of its windows, each (n - 1,)."""
    half = np.maximum(np.rint(WINDOW_MEMORIES * intensity ** (-1 / 6)), MIN_WINDOW).astype(np.int64)
    at = np.arange(intensity.size)
    first, last = np.maximum(at - half, 0), np.minimum(at + half + 1, intensity.size)
    found, awaited = (np.concatenate([[0.0], np.cumsum(y)]) for y in (power, expected))
    ratio = (found[last] - found[first] + PRIOR_COUNT) / (awaited[last] - awaited[first] + PRIOR_COUNT)
    return np.asarray(np.clip(intensity * ratio**UPDATE_EXPONENT, *INTENSITY_RANGE))
