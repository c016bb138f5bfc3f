"""Smooth the motion: from position and acceleration, from position alone, or without a position sensor.

Position and acceleration are fused by least squares with banded normal equations, which has no drift. Without a
position the velocity is measured, or integrated from the acceleration (6.6): an accelerometer tells rest from motion,
and at every rest the velocity is zero, so that no drift gathers.

Source: G. H. Golub, C. F. Van Loan, Matrix Computations, 2013.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded

from pneucli.arrays import Array, Mask
from pneucli.errors import InputError
from pneucli.noise import NoiseModel
from pneucli.recording import Recording
from pneucli.simulate import layout as at
from pneucli.simulate.local_polynomials import LocalPolynomialSmoother

# times an accelerometer's noise, by which its integral errs: it misses what happens between two samples
ACCELERATION_ERROR_FACTOR = 3.0
LATENESS_WINDOW_FACTOR = 5.0  # times the smoother's memory
MAX_LATENESS_RESIDUAL_RATIO = 0.5  # of the squared difference


Motion = tuple[Array, Array, Array]  # position in m, velocity in m/s, acceleration in m/s^2, each (n,)


@dataclass(frozen=True)
class MeasuredMotion:
    """The map from readings by signal to the motion; as it is here, what was not measured follows by differences.

    The map is linear, so draws of the sensors' noise pass through it, too.

    Attributes:
        time: Time stamps in s, shape (n,).
    """

    differentiates: ClassVar[bool] = True  # nothing but the position tells the velocity
    time: Array

    @property
    def memory(self) -> float:
        """The time in s over which it spreads a stop."""
        return 0.0

    def motion(self, readings: Mapping[str, Array]) -> Motion:
        """Return the motion that readings, each (n,), show."""
        x, v = readings["x"], readings.get("v")
        v = np.gradient(x, self.time) if v is None else v
        return x, v, readings["a"] if "a" in readings else np.gradient(v, self.time)

    def corrected(self, readings: Mapping[str, Array]) -> Mapping[str, Array]:
        """Return the readings, each (n,), that it was made for as it takes them: corrected for their rounding."""
        return readings

    def errors(self, noise: Mapping[str, Array]) -> Motion:
        """Return the errors of the motion from draws of the sensors' noise, each (n,).

        Where only a position sensor measures the motion, the part of the motion that its smoother misses is an error
        too.
        """
        return self.motion(noise)


@dataclass(frozen=True)
class MotionSmoother(MeasuredMotion):
    """The map from position and acceleration to smoothed position, velocity and the accelerometer's bias.

    Each step obeys the integrated acceleration, which errs by its noise and by the jerk between two samples.

    Attributes:
        x_noise: Standard deviation of the position's noise in m.
        a_noise: Standard deviation of the acceleration's noise in m/s^2.
    """

    differentiates: ClassVar[bool] = False
    x_noise: float
    a_noise: float

    @property
    def memory(self) -> float:
        """Time constant of the stationary smoother in s, at which x and a have equal weight."""
        return float(np.sqrt(self.x_noise / (ACCELERATION_ERROR_FACTOR * self.a_noise)))

    def motion(self, readings: Mapping[str, Array]) -> Motion:
        """Return the motion that readings of x and a show."""
        x, v, _ = self(readings["x"], readings["a"])
        return x, v, readings["a"]

    def __call__(self, x: Array, a: Array) -> tuple[Array, Array, float]:
        """Return x, v, both (n,), and the bias of a."""
        dt = np.diff(self.time)
        slack = np.sqrt(dt) * ACCELERATION_ERROR_FACTOR * self.a_noise * np.sqrt(np.median(dt))  # m/s a step
        return least_squares_motion(dt, 1.0 / self.x_noise, 1.0 / slack, 1.0 / (slack * dt), x, a)


def missed_speed(time: Array, a: Array) -> Array:
    """Return the standard deviation of the speed in m/s that readings miss between two samples, (n - 1,).

    The acceleration may jump at any instant between them. A jump is its change less what the changes before and after
    it let expect.

    Args:
        time: Time stamps in s, shape (n,).
        a: Acceleration in m/s^2, shape (n,).

    >>> missed_speed(np.arange(6.0), np.array([0.0, 0.0, 12.0, 12.0, 12.0, 12.0])).round(2)
    array([3.46, 3.46, 1.73, 0.  , 0.  ])
    """
    change = np.diff(a)
    if change.size < 2:
        return np.zeros(change.size)
    around = 0.5 * (np.append(change[1], change[:-1]) + np.append(change[1:], change[-2]))
    return np.asarray(np.abs(change - around) * np.diff(time) / np.sqrt(12.0))


def estimate_acceleration_delay(x: Array, a: Array, period: float, memory: float) -> int:
    """Estimate by how many samples an accelerometer reads later than the position, as behind a filter of its own.

    The curvatures of both are compared through one parabola, in windows some times as long as the memory of the
    smoother. Only a shift with a far smaller difference counts; half a sample remains.

    Args:
        x: Position in m, shape (n,).
        a: Acceleration in m/s^2, shape (n,).
        period: Sampling period in s.
        memory: Memory of the smoother in s.

    Returns:
        Delay in samples.
    """
    half = max(round(LATENESS_WINDOW_FACTOR * memory / period), 3)
    if 6 * half > x.size:
        return 0
    path = np.concatenate([[0.0], np.cumsum(np.cumsum(a))[:-1]]) * period**2
    weights = 2.0 * np.linalg.pinv(np.vander(np.arange(-half, half + 1) * period, 3, increasing=True))[2]
    x_curvature, a_curvature = (np.convolve(y, weights, mode="same") for y in (x, path))  # of local parabolas
    residuals = [
        float(np.var(x_curvature[half : -2 * half] - a_curvature[half + k : k - 2 * half or None])) for k in range(half)
    ]
    best = int(np.argmin(residuals))
    return best if residuals[best] < MAX_LATENESS_RESIDUAL_RATIO * residuals[0] else 0


def least_squares_motion(dt: Array, wx: float, wv: Array, wp: Array, x: Array, a: Array) -> tuple[Array, Array, float]:
    """Return the least squares estimate of motion from position and acceleration.

    The position is measured with the weight ``wx``. Each step obeys the acceleration, linear in between, the velocity
    with the weight ``wv`` and the position with ``wp``. The normal equations have five diagonals; the bias borders
    them. Their factor is not kept for other signals: it takes more memory than all signals together.

    Args:
        dt: Steps in s, shape (n - 1,).
        wx: Inverse standard deviation of the position in 1/m.
        wv: Inverse standard deviation of the velocity's change in s/m, shape (n - 1,).
        wp: Inverse standard deviation of the position's change in 1/m, shape (n - 1,).
        x: Position in m, shape (n,).
        a: Acceleration in m/s^2, shape (n,).

    Returns:
        x in m, v in m/s, each (n,), and the constant bias of a in m/s^2.

    >>> time = np.linspace(0.0, 1.0, 11)
    >>> weights = 1e3, np.full(10, 10.0), np.full(10, 1e2)
    >>> x, v, bias = least_squares_motion(np.diff(time), *weights, time**2, np.full(11, 2.5))
    >>> v[[0, -1]].round(6) + 0.0, round(bias, 6)
    (array([0., 2.]), 0.5)
    """
    n, place, speed = dt.size + 1, wp**2, wv**2
    bands = np.zeros((3, 2 * n), order="F")  # above the diagonal by two and by one, and the diagonal itself
    bands[0, 2::2], bands[0, 3::2] = -place, -speed
    bands[1, 1:-1:2], bands[1, 2::2] = dt * place, -dt * place
    bands[2, ::2] = wx**2
    for first, last in ((0, -2), (2, None)):
        bands[2, first:last:2] += place
        bands[2, first + 1 : last : 2] += speed
    bands[2, 1:-1:2] += dt**2 * place
    border = np.zeros(2 * n)
    for first, last, sign in ((0, -2, -1.0), (2, None, 1.0)):
        border[first:last:2] += sign * 0.5 * dt**2 * place
        border[first + 1 : last : 2] += sign * dt * speed
    border[1:-1:2] -= 0.5 * dt**3 * place
    corner = float(np.sum(dt**2 * speed) + np.sum(0.25 * dt**4 * place))
    factor = cholesky_banded(bands, overwrite_ab=True, check_finite=False), False
    border_solution = cho_solve_banded(factor, border, check_finite=False)
    stiffness = corner - float(border @ border_solution)

    push, jump = place * dt**2 * (2.0 * a[:-1] + a[1:]) / 6.0, speed * dt * 0.5 * (a[1:] + a[:-1])
    right = np.zeros(2 * n)
    right[::2] = wx**2 * x
    for first, last, sign in ((0, -2, -1.0), (2, None, 1.0)):
        right[first:last:2] += sign * push
        right[first + 1 : last : 2] += sign * jump
    right[1:-1:2] -= dt * push
    free = cho_solve_banded(factor, right, overwrite_b=True, check_finite=False)
    bias = (float(np.sum(dt * jump) + np.sum(0.5 * dt**2 * push)) - float(border @ free)) / stiffness
    free -= bias * border_solution
    return free[::2].copy(), free[1::2].copy(), bias


def smooth_inputs(
    raw: Mapping[str, Array],
    smoothers: Mapping[str, LocalPolynomialSmoother],
    motion: Motion | None,
    time: Array,
) -> Array:
    """Smooth the inputs of the kernel.

    Args:
        raw: Signals, or draws of their noise, each (n,).
        smoothers: Smoother of each signal.
        motion: The motion that they show, or its errors; None where none is known.
        time: Time stamps in s, shape (n,).

    Returns:
        Inputs in the kernel's layout, shape (n, 8).
    """
    inputs = np.zeros((time.size, len(at.INPUTS)))
    for column, name in enumerate(at.INPUTS):
        if name in raw and not (motion and column in (at.IN_X, at.IN_V)):
            inputs[:, column] = smoothers[name](raw[name]) if name in smoothers else raw[name]
    if motion is not None:
        inputs[:, at.IN_X], inputs[:, at.IN_V], _ = motion
    return inputs


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
