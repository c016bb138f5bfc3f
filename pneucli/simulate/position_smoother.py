"""Position, velocity and acceleration from a position sensor alone, with their covariance.

The acceleration is a Wiener process (white jerk), the sensor's noise is white: the posterior mean is a quintic
smoothing spline with continuous velocity and acceleration, found by a Kalman filter and the modified Bryson-Frazier
smoother in O(n). The intensity of the jerk varies along the recording and is estimated from it: it rises where the
piston breaks away, stops or strikes an end, and falls where the piston rests.

The mean given the readings errs independently of itself (Berkson error), so a regression on it has no bias toward
zero, as one on differentiated readings has.

A piston moves more smoothly than such a process: its mean errs by little more than the noise that passes the smoother,
where the process' own covariance says five times as much power of the acceleration. What the smoother finds in its own
residual tells how rough the motion is.

References: G. Wahba, J. R. Stat. Soc. B 40 (1978); G. Bierman, IEEE Trans. Autom. Control 18 (1973);
S. Koopman and N. Shephard, Biometrika 79 (1992), for the score; H. Zhou et al., J. Comput. Graph. Stat. 28 (2019),
for the multiplicative update of a variance component.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pneucli.arrays import Array
from pneucli.caches import compiled
from pneucli.distributions import normal_tail
from pneucli.noise import NORMAL_MAD, NoiseModel
from pneucli.simulate.motion_smoother import MeasuredMotion, Motion

Symmetric = tuple[float, float, float, float, float, float]  # xx, xv, xa, vv, va, aa

UNKNOWN = 1e10  # variance of the first state: nothing is known of it
MIN_VARIANCE_RATIO = 1e-12  # of the predicted variance: below are rounding errors

_compiled = compiled(nogil=True, error_model="numpy")


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
def kalman_filter(z: Array, steps: Array, intensity: Array) -> tuple[Array, Array, Array, Array, Array, float]:
    """Run the Kalman filter over readings of the position with noise of variance 1.

    Args:
        z: Readings, shape (n,).
        steps: Time between two samples, shape (n - 1,).
        intensity: Intensity of the jerk between two samples, shape (n - 1,).

    Returns:
        Predicted states (n, 3), their covariance (n, 6), gain (n, 3), variance of the innovation (n,), innovation
        (n,) and log likelihood.

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
def adjoint_states(steps: Array, gain: Array, variance: Array, innovation: Array) -> Array:
    """Return the smoother's adjoint state by sample: what the readings from there on correct.

    Args:
        steps: Time between two samples, shape (n - 1,).
        gain: Gain of the filter, shape (n, 3).
        variance: Variance of its innovation, shape (n,).
        innovation: Its innovation, shape (n,).

    Returns:
        The adjoint states, shape (n, 3).

    """
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
def smoothed_states(predicted: Array, covariance: Array, adjoint: Array) -> Array:
    """Return the smoothed states.

    Args:
        predicted: States that the filter predicts, shape (n, 3).
        covariance: Their covariance, shape (n, 6).
        adjoint: Adjoint states, shape (n, 3).

    Returns:
        Position, velocity and acceleration by sample, shape (n, 3).

    """
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
def smoothed_variances(
    steps: Array, intensity: Array, covariance: Array, gain: Array, variance: Array, adjoint: Array
) -> tuple[Array, Array, Array]:
    """Return the variances of the smoothed states and the score of the intensity.

    Args:
        steps: Time between two samples, shape (n - 1,).
        intensity: Intensity of the jerk, shape (n - 1,).
        covariance: Covariance of the predicted states, shape (n, 6).
        gain: Gain of the filter, shape (n, 3).
        variance: Variance of its innovation, shape (n,).
        adjoint: Adjoint states, shape (n, 3).

    Returns:
        Variances of position, velocity and acceleration (n, 3); by step (n - 1,) the power that the smoothed
        disturbances have, and the power expected of them. Their difference is twice the derivative of the log
        likelihood by the logarithm of the intensity.

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
def jerk_path(steps: Array, intensity: Array, standard: Array) -> Array:
    """Return states that start at rest and that white jerk drives.

    Args:
        steps: Time between two samples, shape (n - 1,).
        intensity: Intensity of the jerk, shape (n - 1,).
        standard: Standard normal draws, shape (n - 1, 3).

    Returns:
        Position, velocity and acceleration by sample, shape (n, 3).

    """
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


WINDOW_MEMORIES = 8.0  # times the smoother's memory to either side, over which the intensity is averaged
MIN_WINDOW = 2  # samples to either side
INITIAL_INTENSITY = 1e-2  # in units of noise and period: a memory of two samples
INTENSITY_RANGE = (1e-12, 1e4)  # memories of 100 samples, where a rest has no noise left, and of a fifth of one
UPDATE_EXPONENT = 0.8  # 1/2 climbs for certain, 1 is the fixed point of the score; in between it is faster than 1/2
PRIOR_COUNT = 1.0  # squared disturbances, as expected, that count in addition to those of a window
MAX_UPDATES = 20
ROUNDING_UPDATES = 2  # each is a fit of its own, and the first ones bring most of the gain
MIN_PROBABILITY = 1e-12  # of an interval far from the path, where the position is at its nearer end
DEVIATION_FACTORS = (10.0**0.5, 10.0)  # of the stated deviation: the likelihood may have a valley between two of them
MIN_GAIN = 0.01  # of the log likelihood a sample: below, the intensity begins to follow the noise
ROUGHNESS_DRAWS = 4  # of noise and of the jerk's process, for what either leaves in a residual
ROUGHNESS_PRIOR_COUNT = 30.0  # samples of the whole recording's roughness that count in addition to those of a window


@dataclass(frozen=True)
class PositionSmoother(MeasuredMotion):
    """The linear map from readings of x, shape (n,), to position, velocity and acceleration.

    ``time`` in s, ``sigma`` the standard deviation of the sensor's noise in m, ``intensity`` (n - 1,) that of the
    jerk between two samples in units of the noise and the period: a diffusion in sigma^2 / period^5. ``rounding`` is
    the standard deviation in m of what quantisation adds: a rest has one and the same. ``correction`` (n,) in m
    belongs on the readings that it was fitted to before they are smoothed. ``roughness`` (n,) is the power of what the
    smoother misses of the motion, over that of the jerk's process.
    """

    sigma: float
    intensity: Array
    rounding: float = 0.0
    correction: Array | float = 0.0
    roughness: Array | float = 1.0

    @cached_property
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

    def noise_ratio(self, noise: NoiseModel) -> float:
        """Return how many times the sensor's ``noise`` the readings scatter about the smoothed path, at least 1."""
        return self.sigma / low_frequency_deviation(noise)

    def __call__(self, x: Array) -> tuple[Array, Array, Array]:
        """Return position (m), velocity (m/s) and acceleration (m/s^2), each (n,)."""
        x_smooth, v, a = (self._smoothed((x - x[0]) / self.sigma) * self._units).T
        return x_smooth + x[0], v.copy(), a.copy()

    def motion(self, readings: Mapping[str, Array]) -> Motion:
        """Return the motion that readings of x show, with v as it was measured, where it was."""
        x, v, a = self(readings["x"])
        return x, readings.get("v", v), a

    def corrected(self, readings: Mapping[str, Array]) -> Mapping[str, Array]:
        """Return the readings with x corrected for its rounding."""
        return {**readings, "x": readings["x"] + self.correction}

    def errors(self, noise: Mapping[str, Array]) -> Motion:
        """Return a draw of the errors, with what is missed of the motion."""
        x, v, a = self.draw_error(noise["x"])
        return x, noise.get("v", v), a

    @cached_property
    def _variances(self) -> Array:
        """Variances of the states (n, 3) given the readings, by the process, in units of noise and period."""
        _, covariance, gain, variance, _, _ = kalman_filter(np.zeros(self.time.size), self._steps, self.intensity)
        nothing = np.zeros((self.time.size, 3))
        return smoothed_variances(self._steps, self.intensity, covariance, gain, variance, nothing)[0]

    def draw_error(self, noise: Array) -> tuple[Array, Array, Array]:
        """Return one draw of the errors of position, velocity and acceleration, each (n,), SI.

        A path of the jerk's process is drawn and smoothed, and what is missed of it, as far as the motion is as rough,
        adds to the sensor's ``noise`` (n,) in m that passes the smoother; the noise seeds the path, so that one reading
        has one error.
        Source: J. Durbin and S. Koopman, Biometrika 89 (2002).
        """
        path = self._draw_path(np.random.default_rng(np.frombuffer(noise[:8].tobytes(), dtype=np.uint32)))
        missed = np.sqrt(self.roughness) * (self._smoothed(path[:, 0]) - path).T
        x, v, a = (self._smoothed(noise / self.sigma) * self._units).T + missed * self._units[:, None]
        return x, v, a

    def with_roughness(self, x: Array) -> PositionSmoother:
        """Return the smoother with the roughness of the motion in readings (n,), in m, that it was fitted to.

        The residual is smoothed once more: what then appears is the noise's part, which is known, and the motion's,
        over what it would be of the process: first in all of the recording, then near each sample, in windows as of the
        intensity.
        """
        rng, n = np.random.default_rng(0), self.time.size

        def found_again(z: Array) -> Array:
            return np.asarray(self._smoothed(z - self._smoothed(z)[:, 0])[:, 2] ** 2)

        found = found_again((x + self.correction - x[0]) / self.sigma)
        of_noise = np.mean([found_again(rng.standard_normal(n)) for _ in range(ROUGHNESS_DRAWS)], axis=0)
        of_path = np.mean([found_again(self._draw_path(rng)[:, 0]) for _ in range(ROUGHNESS_DRAWS)], axis=0)
        motion, expected = (found - of_noise) / self._variances[:, 2], of_path / self._variances[:, 2]
        prior, whole = ROUGHNESS_PRIOR_COUNT * float(expected.mean()), max(float(motion.sum() / expected.sum()), 0.0)
        intensity = np.append(self.intensity, self.intensity[-1])
        near, awaited = _near_each_sample(motion, intensity), _near_each_sample(expected, intensity)
        return replace(self, roughness=np.maximum((near + prior * whole) / (awaited + prior), 0.0))

    def _draw_path(self, rng: np.random.Generator) -> Array:
        """Return states (n, 3) of the jerk's process, in units of noise and period."""
        return jerk_path(self._steps, self.intensity, rng.standard_normal((self.time.size - 1, 3)))

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

    Each update multiplies the intensity of the jerk by the power of the disturbances that the smoother finds over the
    power that it expects of them: first equal everywhere, of the whole recording, then near each sample, in windows as
    long as its memory there. Either ends where the likelihood gains little: further updates would follow the noise.
    Begun with a short memory, the windows would take for motion what rounding makes at speeds of one step a sample.

    Where the sensor's noise is larger than stated, as behind a text with few digits, the path would follow it. Its
    deviation is therefore raised as long as this makes the readings likelier; it is never lowered, since ``noise`` also
    counts what is slower than a sample.

    Where rounding is most of the noise, a reading tells an interval. It is replaced by the mean that the position has
    in this interval around the smoothed path, and the smoother is fitted again: errors of rounding that vary slowly,
    where the motion is slow or by whole steps a sample, hardly pull the path any longer.

    Args:
        time: Time stamps in s, shape (n,), n >= 4; they need not be equidistant.
        x: Readings in m, shape (n,), without gaps.
        noise: Noise of the sensor; its deviation is above 0.

    Returns:
        The smoother, a linear map of readings at these stamps.

    References:
        H. Zhou et al., J. Comput. Graph. Stat. 28 (2019), the multiplicative update; A. Dempster, N. Laird and
        D. Rubin, J. R. Stat. Soc. B 39 (1977), section 4.2, for readings that tell an interval.

    """
    sigma = low_frequency_deviation(noise)
    even = PositionSmoother(time, sigma, np.full(time.size - 1, INITIAL_INTENSITY), noise.step / np.sqrt(12))
    even = _with_likely_deviation(even, x)
    smoother = _with_likely_intensity(even, x)
    for _ in range(ROUNDING_UPDATES if smoother.rounding > noise.white else 0):
        correction = _mean_in_interval(smoother(x + smoother.correction)[0] - x, 0.5 * noise.step, even.sigma)
        smoother = replace(_with_likely_intensity(even, x + correction), correction=correction)
    return smoother.with_roughness(x)


def _mean_in_interval(centre: Array, half: float, sigma: float) -> Array:
    """Return the mean of a normal distribution about ``centre`` (n,) within ``half`` to either side of 0."""
    low, high = (-half - centre) / sigma, (half - centre) / sigma
    density = np.exp(-0.5 * np.square([low, high])) / np.sqrt(2.0 * np.pi)
    probability = np.maximum(normal_tail(low) - normal_tail(high), MIN_PROBABILITY)
    return np.asarray(np.clip(centre + sigma * (density[0] - density[1]) / probability, -half, half))


def _with_likely_deviation(smoother: PositionSmoother, x: Array) -> PositionSmoother:
    """Return the smoother with an equal intensity, at that deviation, stated or larger, which readings (n,) favour.

    A memory shorter than that of the start means that the path follows every reading: because the motion is as fast,
    or because the noise is larger than stated, which two likelihoods tell. Otherwise the deviation is too small where
    the squared innovations of most readings exceed their variance: their median, since a few glitches exceed it by far.
    """
    found = _climbed(smoother, (x - x[0]) / smoother.sigma, _whole)
    likelihood, excess = _likelihood(found, x)
    while found.intensity[0] > INITIAL_INTENSITY:
        rivals = [replace(smoother, sigma=found.sigma * factor) for factor in DEVIATION_FACTORS]
        rivals = [_climbed(one, (x - x[0]) / one.sigma, _whole) for one in rivals]
        rival = max(rivals, key=lambda one: _likelihood(one, x)[0])
        if _likelihood(rival, x)[0] - likelihood < MIN_GAIN * x.size:
            break
        found, (likelihood, excess) = rival, _likelihood(rival, x)
    for _ in range(MAX_UPDATES):
        if excess <= 1.0 or 0.5 * (excess - 1.0 - np.log(excess)) < MIN_GAIN:
            break
        found = replace(found, sigma=found.sigma * np.sqrt(excess))
        found = _climbed(found, (x - x[0]) / found.sigma, _whole)
        _, excess = _likelihood(found, x)
    return found


def _likelihood(smoother: PositionSmoother, x: Array) -> tuple[float, float]:
    """Return the log likelihood of readings (n,), and the squared innovations over their variance: 1 where normal."""
    z = (x - x[0]) / smoother.sigma
    _, _, _, variance, innovation, likelihood = kalman_filter(z, smoother._steps, smoother.intensity)
    excess = NORMAL_MAD**2 * float(np.median(innovation**2 / variance))
    return likelihood - x.size * float(np.log(smoother.sigma)), excess


def _with_likely_intensity(smoother: PositionSmoother, x: Array) -> PositionSmoother:
    """Return the smoother with the intensity of readings (n,): equal everywhere, then near each sample."""
    z = (x - x[0]) / smoother.sigma
    return _climbed(_climbed(smoother, z, _whole), z, _near_each_sample)


def _climbed(smoother: PositionSmoother, z: Array, summed: Callable[[Array, Array], Array]) -> PositionSmoother:
    """Return the smoother with an intensity updated by sums over a sample's surroundings, until little is gained.

    ``z`` (n,) are the readings in units of the noise; ``summed`` adds up values (n - 1,) at an intensity (n - 1,).
    """
    steps, former, before = smoother._steps, smoother, -np.inf
    for _ in range(MAX_UPDATES):
        _, covariance, gain, variance, innovation, likelihood = kalman_filter(z, steps, smoother.intensity)
        if not likelihood > before:
            return former
        if likelihood - before < MIN_GAIN * z.size:
            break
        former, before = smoother, likelihood
        adjoint = adjoint_states(steps, gain, variance, innovation)
        _, power, expected = smoothed_variances(steps, smoother.intensity, covariance, gain, variance, adjoint)
        found, awaited = (PRIOR_COUNT + summed(y, smoother.intensity) for y in (power, expected))
        updated = smoother.intensity * (found / awaited) ** UPDATE_EXPONENT
        smoother = replace(smoother, intensity=np.clip(updated, *INTENSITY_RANGE))
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


def _whole(values: Array, intensity: Array) -> Array:
    """Return the sum of all values, (n - 1,), at each sample."""
    return np.full(intensity.size, values.sum())


def _near_each_sample(values: Array, intensity: Array) -> Array:
    """Return the sum of values (n,) in the window of each sample, at an intensity (n,)."""
    half = np.maximum(np.rint(WINDOW_MEMORIES * intensity ** (-1 / 6)), MIN_WINDOW).astype(np.int64)
    at, total = np.arange(intensity.size), np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray(total[np.minimum(at + half + 1, at.size)] - total[np.maximum(at - half, 0)])
