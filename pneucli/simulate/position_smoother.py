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

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pneucli.noise import NoiseModel

Array = NDArray[np.float64]
Symmetric = tuple[float, float, float, float, float, float]  # xx, xv, xa, vv, va, aa

WINDOW_MEMORIES = 8.0  # times the smoother's memory to either side, over which the intensity is averaged
MIN_WINDOW = 2  # samples to either side
INITIAL_INTENSITY = 1e-2  # in units of noise and period: a memory of two samples
INTENSITY_RANGE = (1e-12, 1e4)  # memories of 100 samples, where a rest has no noise left, and of a fifth of one
UPDATE_EXPONENT = 0.8  # 1/2 climbs for certain, 1 is the fixed point of the score; in between it is faster than 1/2
PRIOR_COUNT = 1.0  # squared disturbances, as expected, that count beside those of a window
MAX_UPDATES = 20
MIN_GAIN = 0.01  # of the log likelihood a sample: below, the intensity begins to follow the noise
UNKNOWN = 1e10  # variance of the first state, in units of noise and period: nothing is known of it
MIN_VARIANCE_RATIO = 1e-12  # of the predicted variance: below are rounding errors

_compiled = njit(cache=True, nogil=True, error_model="numpy")


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
        _, covariance, gain, variance, _, _ = _filter(np.zeros(self.time.size), self._steps, self.intensity)
        nothing = np.zeros((self.time.size, 3))
        spread = _covariance(self._steps, self.intensity, covariance, gain, variance, nothing)[0]
        spread[:, 0] += (self.rounding / self.sigma) ** 2
        return np.asarray(np.sqrt(spread) * self._units)

    def draw_error(self, noise: Array) -> tuple[Array, Array, Array]:
        """Return one draw of the errors of position, velocity and acceleration, each (n,), SI.

        A path of the jerk's process is drawn, read with the sensor's ``noise`` (n,) in m, and smoothed; the noise
        seeds the path, so that one reading has one error.
        Source: J. Durbin and S. Koopman, Biometrika 89 (2002).
        """
        rng = np.random.default_rng(np.frombuffer(noise[:8].tobytes(), dtype=np.uint32))
        path = _jerk_path(self._steps, self.intensity, rng.standard_normal((self.time.size - 1, 3)))
        x, v, a = ((self._smoothed(path[:, 0] + noise / self.sigma) - path) * self._units).T
        return x.copy(), v.copy(), a.copy()

    def _smoothed(self, z: Array) -> Array:
        """Return the states (n, 3), from readings z (n,), all in units of noise and period."""
        predicted, covariance, gain, variance, innovation, _ = _filter(z, self._steps, self.intensity)
        return _corrected(predicted, covariance, _adjoint(self._steps, gain, variance, innovation))

    @cached_property
    def _steps(self) -> Array:
        return np.diff(self.time) / self.period

    @property
    def _units(self) -> Array:
        return np.asarray(self.sigma / self.period ** np.arange(3.0))


def fit_position_smoother(time: Array, x: Array, noise: NoiseModel) -> PositionSmoother:
    """Return the smoother of a position sensor's readings ``x`` (n,) in m at ``time`` (n,) in s, n >= 4.

    The intensity of the jerk starts equal everywhere; each update multiplies it by the power of the disturbances that
    the smoother finds near a sample over the power that it expects of them, in windows as long as its memory there.
    It ends where the likelihood gains little: further updates would follow the noise.
    """
    sigma = low_frequency_deviation(noise)
    smoother = PositionSmoother(time, sigma, np.full(time.size - 1, INITIAL_INTENSITY), noise.step / np.sqrt(12))
    z, steps, before = (x - x[0]) / sigma, smoother._steps, -np.inf
    for _ in range(MAX_UPDATES):
        _, covariance, gain, variance, innovation, likelihood = _filter(z, steps, smoother.intensity)
        if likelihood - before < MIN_GAIN * x.size:
            break
        before = likelihood
        adjoint = _adjoint(steps, gain, variance, innovation)
        _, power, expected = _covariance(steps, smoother.intensity, covariance, gain, variance, adjoint)
        smoother = replace(smoother, intensity=_updated(smoother.intensity, power, expected))
    return smoother


def low_frequency_deviation(noise: NoiseModel) -> float:
    """Return the standard deviation of white noise that is as strong as this one at low frequencies."""
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


@_compiled
def _jerk_covariance(q: float, t: float) -> Symmetric:
    """Return the covariance (xx, xv, xa, vv, va, aa) that white jerk of intensity q adds within t."""
    return q * t**5 / 20, q * t**4 / 8, q * t**3 / 6, q * t**3 / 3, q * t**2 / 2, q * t


@_compiled
def _propagated(p: Symmetric, q: float, t: float) -> Symmetric:
    """Return the covariance (xx, xv, xa, vv, va, aa) after a step t."""
    xx, xv, xa, vv, va, aa = p
    h = 0.5 * t * t
    c0, c1, c2 = xx + t * xv + h * xa, xv + t * vv + h * va, xa + t * va + h * aa
    d1, d2 = vv + t * va, va + t * aa
    jxx, jxv, jxa, jvv, jva, jaa = _jerk_covariance(q, t)
    return c0 + t * c1 + h * c2 + jxx, c1 + t * c2 + jxv, c2 + jxa, d1 + t * d2 + jvv, d2 + jva, aa + jaa


@_compiled
def _filter(z: Array, steps: Array, intensity: Array) -> tuple[Array, Array, Array, Array, Array, float]:
    """Run the Kalman filter over readings z (n,) with noise of variance 1.

    Returns the predicted states (n, 3), their covariance (n, 6), the gain (n, 3), the innovation's variance (n,), the
    innovation (n,) and the log likelihood.
    """
    n = z.size
    predicted, covariance, gain = np.empty((n, 3)), np.empty((n, 6)), np.empty((n, 3))
    variance, innovation, likelihood = np.empty(n), np.empty(n), 0.0
    x, v, a = z[0], 0.0, 0.0
    p = (UNKNOWN, 0.0, 0.0, UNKNOWN, 0.0, UNKNOWN)
    for k in range(n):
        if k > 0:
            t = steps[k - 1]
            x, v = x + t * v + 0.5 * t * t * a, v + t * a
            p = _propagated(p, intensity[k - 1], t)
        predicted[k, 0], predicted[k, 1], predicted[k, 2] = x, v, a
        for i in range(6):
            covariance[k, i] = p[i]
        xx, xv, xa, vv, va, aa = p
        s, e = xx + 1.0, z[k] - x
        gx, gv, ga = xx / s, xv / s, xa / s
        gain[k, 0], gain[k, 1], gain[k, 2], variance[k], innovation[k] = gx, gv, ga, s, e
        likelihood -= 0.5 * (math.log(s) + e * e / s)
        x, v, a = x + gx * e, v + gv * e, a + ga * e
        p = (gx, gv, ga, vv - gv * xv, va - gv * xa, aa - ga * xa)
    return predicted, covariance, gain, variance, innovation, likelihood


@_compiled
def _adjoint(steps: Array, gain: Array, variance: Array, innovation: Array) -> Array:
    """Return the smoother's adjoint state by sample (n, 3): all that the readings from there on correct."""
    n = innovation.size
    out = np.empty((n, 3))
    x = v = a = 0.0
    for k in range(n - 1, -1, -1):
        if k < n - 1:
            t = steps[k]
            v, a = v + t * x, a + t * v + 0.5 * t * t * x
        x -= gain[k, 0] * x + gain[k, 1] * v + gain[k, 2] * a + innovation[k] / variance[k]
        out[k, 0], out[k, 1], out[k, 2] = x, v, a
    return out


@_compiled
def _corrected(predicted: Array, covariance: Array, adjoint: Array) -> Array:
    """Return the smoothed states (n, 3)."""
    out = np.empty(predicted.shape)
    for k in range(predicted.shape[0]):
        xx, xv, xa, vv, va, aa = covariance[k]
        lx, lv, la = adjoint[k]
        out[k, 0] = predicted[k, 0] - (xx * lx + xv * lv + xa * la)
        out[k, 1] = predicted[k, 1] - (xv * lx + vv * lv + va * la)
        out[k, 2] = predicted[k, 2] - (xa * lx + va * lv + aa * la)
    return out


@_compiled
def _information_before(n: Symmetric, t: float) -> Symmetric:
    """Return the information (xx, xv, xa, vv, va, aa) on a state from that on the state a step t later."""
    xx, xv, xa, vv, va, aa = n
    h = 0.5 * t * t
    vx, ax = xv + t * xx, xa + t * xv + h * xx
    vv_half, av = vv + t * xv, va + t * vv + h * xv
    aa_half = aa + t * va + h * xa
    return xx, vx, ax, vv_half + t * vx, av + t * ax, aa_half + t * av + h * ax


@_compiled
def _with_reading(n: Symmetric, x: float, v: float, a: float, variance: float) -> Symmetric:
    """Return the information on a predicted state from that on the filtered one, which a reading gained (x, v, a)."""
    xx, xv, xa, vv, va, aa = n
    hx = xx - (xx * x + xv * v + xa * a)
    hv = xv - (xv * x + vv * v + va * a)
    ha = xa - (xa * x + va * v + aa * a)
    return hx - (x * hx + v * hv + a * ha) + 1.0 / variance, hv, ha, vv, va, aa


@_compiled
def _quadratic(m: Symmetric, x: float, v: float, a: float) -> float:
    """Return the quadratic form of a symmetric matrix (xx, xv, xa, vv, va, aa)."""
    xx, xv, xa, vv, va, aa = m
    return xx * x * x + vv * v * v + aa * a * a + 2.0 * (xv * x * v + xa * x * a + va * v * a)


@_compiled
def _product_trace(m: Symmetric, n: Symmetric) -> float:
    """Return the trace of the product of two symmetric matrices."""
    return m[0] * n[0] + m[3] * n[3] + m[5] * n[5] + 2.0 * (m[1] * n[1] + m[2] * n[2] + m[4] * n[4])


@_compiled
def _covariance(
    steps: Array, intensity: Array, covariance: Array, gain: Array, variance: Array, adjoint: Array
) -> tuple[Array, Array, Array]:
    """Return the smoothed variances of x, v, a (n, 3), and by step (n - 1,) the power that the smoothed disturbances
    have and the one expected of them: the two parts of the score of the intensity's logarithm.
    """
    n = variance.size
    out, power, expected = np.empty((n, 3)), np.zeros(n - 1), np.zeros(n - 1)
    info = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # that the readings from there on hold
    for k in range(n - 1, -1, -1):
        if k < n - 1:
            jerk = _jerk_covariance(intensity[k], steps[k])
            power[k] = _quadratic(jerk, adjoint[k + 1, 0], adjoint[k + 1, 1], adjoint[k + 1, 2])
            expected[k] = _product_trace(jerk, info)
            info = _information_before(info, steps[k])
        info = _with_reading(info, gain[k, 0], gain[k, 1], gain[k, 2], variance[k])
        xx, xv, xa, vv, va, aa = covariance[k]
        out[k, 0] = max(xx - _quadratic(info, xx, xv, xa), MIN_VARIANCE_RATIO * xx)
        out[k, 1] = max(vv - _quadratic(info, xv, vv, va), MIN_VARIANCE_RATIO * vv)
        out[k, 2] = max(aa - _quadratic(info, xa, va, aa), MIN_VARIANCE_RATIO * aa)
    return out, power, expected


@_compiled
def _jerk_path(steps: Array, intensity: Array, standard: Array) -> Array:
    """Return states (n, 3) that start at rest and that white jerk drives, from standard normal draws (n - 1, 3)."""
    path = np.zeros((steps.size + 1, 3))
    for k in range(steps.size):
        x, v, a = path[k]
        t, size = steps[k], math.sqrt(intensity[k] * steps[k])
        # the Cholesky factor of the jerk's covariance, from the acceleration down
        wa = size * standard[k, 0]
        wv = t * (0.5 * wa + size / math.sqrt(12.0) * standard[k, 1])
        wx = t * (0.5 * wv - t * wa / 12.0 + size * t / math.sqrt(720.0) * standard[k, 2])
        path[k + 1, 0] = x + t * v + 0.5 * t * t * a + wx
        path[k + 1, 1], path[k + 1, 2] = v + t * a + wv, a + wa
    return path
