"""Smoothed states from measured signals: local polynomials for pressures, least squares for the motion.

Local polynomials in windows that grow as long as their estimates agree within the noise (the intersection of
confidence intervals, Goldenshluger and Nemirovski 1997), so that a kink stays a kink and a rest is averaged long.
Position and acceleration are fused into position and velocity by least squares, which has no drift.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import factorized

from pneucli.noise import NoiseModel

Array = NDArray[np.float64]
HALF_WIDTHS = (0, 1, 2, 4, 8, 16, 32, 64, 128)
AGREEMENT = 1.0  # standard deviations; low, since a bias is worse than noise that is accounted for


def autocovariance(noise: NoiseModel, n: int) -> Array:
    """Return the covariance of a sensor's noise at lags 0..n-1 samples."""
    lags = np.arange(n)
    r = noise.coloured**2 * noise.pole**lags if noise.coloured else np.zeros(n)
    for frequency, amplitude in noise.lines:
        r = r + 0.5 * amplitude**2 * np.cos(2 * np.pi * frequency * noise.period * lags)
    r[0] += max(noise.white, 0.0) ** 2
    r[0] = max(r[0], noise.step**2 / 12)
    return np.asarray(r)


@dataclass(frozen=True)
class Window:
    """Polynomial fits in windows of 2 ``half`` + 1 samples, moved inward at the ends of a record.

    ``value`` and ``slope`` (per sample) have shape (2 half + 1, 2 half + 1): row i are the weights for the sample that
    stands i-th in its window.
    """

    half: int
    value: Array
    slope: Array

    def apply(self, weights: Array, y: Array) -> Array:
        """Return the fits to y, shape (n,), by ``value`` or ``slope``."""
        width, inner = weights.shape[0], y.size - self.half
        out = np.empty(y.size)
        out[: self.half] = weights[: self.half] @ y[:width]
        out[self.half : inner] = np.correlate(y, weights[self.half])
        out[inner:] = weights[self.half + 1 :] @ y[y.size - width :]
        return out


@lru_cache(maxsize=64)
def window(half: int, degree: int) -> Window:
    """Return the window of one half width (samples) and degree of its polynomial."""
    scale = max(half, 1)
    powers = np.vander(np.arange(-half, half + 1) / scale, degree + 1, increasing=True)
    fit = np.linalg.pinv(powers)
    tilt = np.column_stack([np.zeros(2 * half + 1), powers[:, :-1] * np.arange(1, degree + 1)]) / scale
    return Window(half, powers @ fit, tilt @ fit)


@lru_cache(maxsize=256)
def deviations(noise: NoiseModel, half: int, degree: int) -> Array:
    """Return the standard deviation of a window's values by the sample's place in it, shape (2 half + 1,)."""
    weights = window(half, degree).value
    lags = np.abs(np.subtract.outer(np.arange(2 * half + 1), np.arange(2 * half + 1)))
    variance = np.sum(weights @ autocovariance(noise, 2 * half + 1)[lags] * weights, axis=1)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


@dataclass(frozen=True)
class LocalFits:
    """Which window each sample of a record takes, for its value and for its slope; linear once that is chosen."""

    windows: tuple[Window, ...]
    for_value: NDArray[np.int64]
    for_slope: NDArray[np.int64]
    period: float

    def __call__(self, y: Array) -> Array:
        """Return the smoothed signal, shape (n,)."""
        out = np.empty(y.size)
        for w, mine in self._used(self.for_value):
            out[mine] = w.apply(w.value, y)[mine]
        return out

    def slope(self, y: Array) -> Array:
        """Return the derivative of the smoothed signal in 1/s, shape (n,)."""
        out = np.empty(y.size)
        for w, mine in self._used(self.for_slope):
            out[mine] = w.apply(w.slope, y)[mine] / self.period
        return out

    def _used(self, chosen: NDArray[np.int64]) -> Iterator[tuple[Window, NDArray[np.bool_]]]:
        for i in np.unique(chosen):
            yield self.windows[i], chosen == i


def local_fits(y: Array, noise: NoiseModel, period: float) -> LocalFits:
    """Return the smoother of one signal of shape (n,); samples are taken as equidistant, NaN is not allowed.

    Constants, lines and parabolas are grown apart; each sample takes the surest, so that a rest is a rest.
    """
    n = y.size
    windows: list[Window] = []
    value, slope = _Plan(n), _Plan(n)
    for degree in (0, 1, 2):
        low, high = np.full(n, -np.inf), np.full(n, np.inf)
        growing = np.ones(n, dtype=bool)
        for half in (h for h in HALF_WIDTHS if 2 * h + 1 <= n and h >= degree):
            grown = window(half, degree)
            estimate, deviation = grown.apply(grown.value, y), _along(deviations(noise, half, degree), n)
            low = np.maximum(low, estimate - AGREEMENT * deviation)
            high = np.minimum(high, estimate + AGREEMENT * deviation)
            growing &= low <= high
            value.offer(len(windows), growing, deviation)
            if degree > 0:  # a constant has no slope to tell
                slope.offer(len(windows), growing | ~np.isfinite(slope.deviation), deviation)
            windows.append(grown)
    return LocalFits(tuple(windows), value.chosen, slope.chosen, period)


def _along(deviation: Array, n: int) -> Array:
    """Return what goes by the place in a window as what goes by the sample of a record of n."""
    half = deviation.size // 2
    return np.concatenate([deviation[:half], np.full(n - 2 * half, deviation[half]), deviation[half + 1 :]])


class _Plan:
    """Which window each sample takes: the one with the smallest deviation among those offered."""

    def __init__(self, n: int) -> None:
        self.chosen = np.zeros(n, dtype=np.int64)
        self.deviation = np.full(n, np.inf)

    def offer(self, index: int, accepted: NDArray[np.bool_], deviation: Array) -> None:
        better = accepted & (deviation < self.deviation)
        self.chosen[better], self.deviation[better] = index, deviation[better]


def kinematics(time: Array, x_noise: float, a_noise: float) -> Callable[[Array, Array], tuple[Array, Array, float]]:
    """Return the map from measured x and a, shape (n,), to smoothed x, v and the accelerometer's bias.

    Least squares over x_k, v_k and one constant bias: x is measured, and each step obeys the integrated acceleration,
    which errs by its noise and by what the sampling misses of a jerk.
    """
    n = time.size
    dt = np.diff(time)
    i = np.arange(n - 1)
    slack = np.sqrt(dt) * (3.0 * a_noise + 1e-3) * np.sqrt(np.median(dt))  # m/s a step
    wx, wv, wp = 1.0 / x_noise, 1.0 / slack, 1.0 / (slack * dt)
    rows = np.concatenate([np.arange(n), n + np.repeat(i, 3), 2 * n - 1 + np.repeat(i, 4)])
    columns = np.concatenate(
        [
            np.arange(n),
            np.column_stack([n + i, n + i + 1, np.full(n - 1, 2 * n)]).ravel(),
            np.column_stack([i, i + 1, n + i, np.full(n - 1, 2 * n)]).ravel(),
        ]
    )
    entries = np.concatenate(
        [
            np.full(n, wx),
            np.column_stack([-wv, wv, dt * wv]).ravel(),
            np.column_stack([-wp, wp, -dt * wp, 0.5 * dt**2 * wp]).ravel(),
        ]
    )
    design = sparse.csc_matrix((entries, (rows, columns)), shape=(3 * n - 2, 2 * n + 1))
    solve = factorized((design.T @ design).tocsc())

    def smooth(x: Array, a: Array) -> tuple[Array, Array, float]:
        mean, first = 0.5 * (a[1:] + a[:-1]), (2.0 * a[:-1] + a[1:]) / 6.0
        right = design.T @ np.concatenate([wx * x, wv * dt * mean, wp * dt**2 * first])
        solution = solve(right)
        return solution[:n], solution[n : 2 * n], float(solution[2 * n])

    return smooth
