"""Smoothed states from measured signals, as linear maps: what smooths a signal also says what noise it lets through.

Local polynomials in windows that grow as long as their estimates agree within the noise (the intersection of
confidence intervals, Goldenshluger and Nemirovski 1997), so that a kink stays a kink and a rest is averaged long.
Position and acceleration are fused into position and velocity by least squares, which has no drift.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import factorized

from pneucli.noise import NoiseModel

Array = NDArray[np.float64]
HALF_WIDTHS = (1, 2, 4, 8, 16, 32, 64, 128)
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
class LinearSmoother:
    """Value and slope per sample as sparse matrices (n, n) applied to one signal."""

    value: sparse.csr_matrix
    slope: sparse.csr_matrix

    def __call__(self, y: Array) -> Array:
        """Return the smoothed signal."""
        return np.asarray(self.value @ y)


@dataclass(frozen=True)
class _Window:
    """All local fits of one width and degree: where each sample's window begins, and its weights (n, width)."""

    start: NDArray[np.int64]
    value: Array
    slope: Array

    def estimate(self, y: Array) -> Array:
        return np.einsum("ij,ij->i", self.value, y[self.start[:, None] + np.arange(self.value.shape[1])])

    def deviation(self, noise: NoiseModel) -> Array:
        """Standard deviation of the estimates; all inner samples have the same weights."""
        n, width = self.value.shape
        lags = np.abs(np.subtract.outer(np.arange(width), np.arange(width)))
        covariance = autocovariance(noise, width)[lags]
        ends = np.flatnonzero(self.start != np.arange(n) - width // 2)
        rows = np.append(ends, n // 2)
        variance = np.einsum("ij,jk,ik->i", self.value[rows], covariance, self.value[rows])
        out = np.full(n, variance[-1])
        out[ends] = variance[:-1]
        return np.asarray(np.sqrt(np.maximum(out, 0.0)))


def _window(n: int, half: int, degree: int, period: float) -> _Window:
    """Return the fits in windows of 2 half + 1 samples, moved inward at the ends of the record."""
    width = min(2 * half + 1, n)
    start = np.clip(np.arange(n) - half, 0, n - width)
    scale = max(half, 1)
    powers = np.vander((np.arange(width) - (width - 1) / 2) / scale, degree + 1, increasing=True)
    fit = np.linalg.pinv(powers)
    at = (np.arange(n) - start - (width - 1) / 2) / scale
    rows, inverse = np.unique(at, return_inverse=True)
    value = np.vander(rows, degree + 1, increasing=True) @ fit
    tilt = np.column_stack([i * rows ** max(i - 1, 0) for i in range(degree + 1)]) @ fit / (scale * period)
    return _Window(start, value[inverse], tilt[inverse])


def local_fits(y: Array, noise: NoiseModel, period: float) -> LinearSmoother:
    """Return the smoother of one signal of shape (n,); samples are taken as equidistant, NaN is not allowed.

    Constants, lines and parabolas are grown apart; each sample takes the surest, so that a rest is a rest.
    """
    n = y.size
    windows, plan, dull = [], _Plan(n), _Plan(n)
    for degree in (0, 1, 2):
        low, high = np.full(n, -np.inf), np.full(n, np.inf)
        growing = np.ones(n, dtype=bool)
        for half in (h for h in (0, *HALF_WIDTHS) if 2 * h + 1 <= n and h >= degree):
            window = _window(n, half, degree, period)
            estimate, deviation = window.estimate(y), window.deviation(noise)
            low = np.maximum(low, estimate - AGREEMENT * deviation)
            high = np.minimum(high, estimate + AGREEMENT * deviation)
            growing &= low <= high
            plan.offer(len(windows), growing, deviation)
            if degree > 0:  # a constant has no slope to tell
                dull.offer(len(windows), growing | ~np.isfinite(dull.deviation), deviation)
            windows.append(window)
    value = _assemble(windows, plan.chosen, [w.value for w in windows])
    return LinearSmoother(value, _assemble(windows, dull.chosen, [w.slope for w in windows]))


class _Plan:
    """Which window each sample takes: the one with the smallest deviation among those offered."""

    def __init__(self, n: int) -> None:
        self.chosen = np.zeros(n, dtype=np.int64)
        self.deviation = np.full(n, np.inf)

    def offer(self, window: int, accepted: NDArray[np.bool_], deviation: Array) -> None:
        better = accepted & (deviation < self.deviation)
        self.chosen[better], self.deviation[better] = window, deviation[better]


def _assemble(windows: list[_Window], chosen: NDArray[np.int64], weights: list[Array]) -> sparse.csr_matrix:
    rows, columns, entries = [], [], []
    for i, (window, weight) in enumerate(zip(windows, weights, strict=True)):
        mine = np.flatnonzero(chosen == i)
        width = weight.shape[1]
        rows.append(np.repeat(mine, width))
        columns.append((window.start[mine, None] + np.arange(width)).ravel())
        entries.append(weight[mine].ravel())
    place = (np.concatenate(rows), np.concatenate(columns))
    return sparse.csr_matrix((np.concatenate(entries), place), shape=(chosen.size, chosen.size))


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
