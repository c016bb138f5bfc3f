"""Smooth one signal by local polynomials, each sample with a window of its own.

A window grows as long as its estimates agree within the noise (the intersection of confidence intervals). So a kink
stays a kink, and a standstill is averaged over a long window.

References:
    Goldenshluger and Nemirovski (1997), On spatially adaptive estimation of nonparametric regression, Mathematical
    Methods of Statistics 6(2), 135-170.

"""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.caches import compiled
from pneucli.noise import NoiseModel

Chosen = NDArray[np.int8]
Index = NDArray[np.int64]
WINDOW_HALF_WIDTHS = (0, 1, 2, 4, 8, 16, 32, 64, 128)
ICI_THRESHOLD = 1.0  # standard deviations; low, since the noise is accounted for and a bias is not


def autocovariance(noise: NoiseModel, n: int) -> Array:
    """Return the autocovariance of a sensor's noise.

    Args:
        noise: The noise.
        n: Number of lags.

    Returns:
        Autocovariance at lags of 0 to n - 1 samples, in the squared unit of the signal, shape (n,).

    >>> autocovariance(NoiseModel(white=2.0), 3)
    array([4., 0., 0.])
    """
    lags = np.arange(n)
    r = noise.coloured**2 * noise.pole**lags if noise.coloured else np.zeros(n)
    for frequency, amplitude in noise.lines:
        r = r + 0.5 * amplitude**2 * np.cos(2 * np.pi * frequency * noise.period * lags)
    r[0] += max(noise.white, 0.0) ** 2
    r[0] = max(r[0], noise.step**2 / 12)
    return np.asarray(r)


@dataclass(frozen=True)
class PolynomialWindow:
    """Polynomial fits in windows of 2 ``half`` + 1 samples, moved inward at the ends of a record.

    Attributes:
        half: Half width in samples.
        value: Weights for the value; row i is for the i-th sample of the window, shape (2 half + 1, 2 half + 1).
        slope: Weights for the slope per sample, of the same shape.
    """

    half: int
    value: Array
    slope: Array


@lru_cache(maxsize=64)
def polynomial_window(half: int, degree: int) -> PolynomialWindow:
    """Return a window of one half width and degree.

    Args:
        half: Half width in samples.
        degree: Degree of the polynomial.

    Returns:
        The window.

    >>> polynomial_window(1, 1).slope[1].round(6) + 0.0
    array([-0.5,  0. ,  0.5])
    """
    scale = max(half, 1)
    powers = np.vander(np.arange(-half, half + 1) / scale, degree + 1, increasing=True)
    fit = np.linalg.pinv(powers)
    tilt = np.column_stack([np.zeros(2 * half + 1), powers[:, :-1] * np.arange(1, degree + 1)]) / scale
    return PolynomialWindow(half, powers @ fit, tilt @ fit)


@lru_cache(maxsize=256)
def window_deviations(noise: NoiseModel, half: int, degree: int) -> Array:
    """Return the standard deviations of the values of a window.

    Args:
        noise: Noise of the sensor.
        half: Half width in samples.
        degree: Degree of the polynomial.

    Returns:
        Standard deviation by the place of the sample in the window, shape (2 half + 1,).

    >>> window_deviations(NoiseModel(white=3.0), 4, 0)[0].round(6)
    np.float64(1.0)
    """
    weights = polynomial_window(half, degree).value
    lags = np.abs(np.subtract.outer(np.arange(2 * half + 1), np.arange(2 * half + 1)))
    variance = np.sum(weights @ autocovariance(noise, 2 * half + 1)[lags] * weights, axis=1)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


class WindowBank(NamedTuple):
    """All windows that fit into a record, by degree and growing width, in the layout of compiled code.

    Attributes:
        degree: Degree of each window.
        half: Half width of each window in samples.
        first: Place of its first weight in ``value`` and ``slope``.
        row: Place of its first row among all rows.
        value: Weights for values, row by row.
        slope: Weights for slopes, row by row.
    """

    degree: Index
    half: Index
    first: Index
    row: Index
    value: Array
    slope: Array


@lru_cache(maxsize=16)
def window_bank(longest: int) -> WindowBank:
    """Return the windows of limited width.

    Args:
        longest: Largest width in samples.

    Returns:
        The windows.

    >>> window_bank(3).half
    array([0, 1, 1])
    """
    kinds = [(d, h) for d in (0, 1, 2) for h in WINDOW_HALF_WIDTHS if 2 * h + 1 <= longest and h >= d]
    degree, half = np.array(kinds, dtype=np.int64).T
    width = 2 * half + 1
    windows = [polynomial_window(h, d) for d, h in kinds]
    return WindowBank(
        degree,
        half,
        np.cumsum(width**2) - width**2,
        np.cumsum(width) - width,
        np.concatenate([w.value.ravel() for w in windows]),
        np.concatenate([w.slope.ravel() for w in windows]),
    )


@dataclass(frozen=True)
class LocalPolynomialSmoother:
    """The window of each sample of a record, for its value and for its slope; linear once windows are chosen.

    Attributes:
        bank: The windows.
        for_value: Window of each sample for its value, shape (n,).
        for_slope: Window of each sample for its slope, shape (n,).
        period: Sampling period in s.
    """

    bank: WindowBank
    for_value: Chosen
    for_slope: Chosen
    period: float

    @property
    def memory(self) -> float:
        """Half width in s of the median window for slopes."""
        return float(np.median(self.bank.half[self.for_slope])) * self.period

    def __call__(self, y: Array) -> Array:
        """Return the smoothed signal, shape (n,)."""
        return np.asarray(_fits(y, self.for_value, self.bank.half, self.bank.first, self.bank.value))

    def slope(self, y: Array) -> Array:
        """Return the derivative of the smoothed signal in 1/s, shape (n,)."""
        return np.asarray(_fits(y, self.for_slope, self.bank.half, self.bank.first, self.bank.slope) / self.period)


def choose_windows(y: Array, noise: NoiseModel, period: float) -> LocalPolynomialSmoother:
    """Choose the windows of one signal.

    Windows of constants, lines and parabolas grow separately; each sample takes the one with the smallest variance.

    Args:
        y: Signal without NaN, taken as equidistant, shape (n,).
        noise: Noise of the sensor.
        period: Sampling period in s.

    Returns:
        The smoother.

    >>> smoother = choose_windows(np.arange(100.0), NoiseModel(white=1.0), 0.1)
    >>> smoother.slope(np.arange(100.0)).round(6)[:3]
    array([10., 10., 10.])
    """
    windows = window_bank(min(y.size, 2 * WINDOW_HALF_WIDTHS[-1] + 1))
    kinds = zip(windows.half.tolist(), windows.degree.tolist(), strict=True)
    deviation = np.concatenate([window_deviations(noise, half, degree) for half, degree in kinds])
    for_value, for_slope = np.zeros((2, y.size), dtype=np.int8)
    _choose_windows(np.ascontiguousarray(y), windows, deviation, ICI_THRESHOLD, for_value, for_slope)
    return LocalPolynomialSmoother(windows, for_value, for_slope, period)


_compiled = compiled(nogil=True, fastmath={"reassoc", "contract"})  # sums in any order; NaN and inf propagate


@_compiled
def _fit(y: Array, k: int, half: int, weights: Array) -> tuple[float, int]:
    """Return the fit at sample k by the window of these ``weights``, and the place of the sample in the window."""
    width = 2 * half + 1
    begin = min(max(k - half, 0), y.size - width)
    mine, around, total = weights[(k - begin) * width :], y[begin:], 0.0
    for i in range(width):
        total += mine[i] * around[i]
    return total, k - begin


@_compiled
def _fits(y: Array, chosen: Chosen, half: Index, first: Index, weights: Array) -> Array:
    """Return the fits by each sample's chosen window, shape (n,)."""
    out = np.empty(y.size)
    for k in range(y.size):
        out[k] = _fit(y, k, half[chosen[k]], weights[first[chosen[k]] :])[0]
    return out


@_compiled
def _choose_windows(
    y: Array, bank: WindowBank, deviation: Array, agreement: float, for_value: Chosen, for_slope: Chosen
) -> None:
    """Write the window of each sample: of those that agree with all narrower ones, the one with the smallest variance.

    A constant has no slope; the narrowest window with a slope is taken where none agrees.
    """
    for k in range(y.size):
        min_sigma_value = min_sigma_slope = low = np.inf
        high, growing, degree = -np.inf, False, -1
        for w in range(bank.half.size):
            if bank.degree[w] != degree:
                low, high, growing, degree = -np.inf, np.inf, True, bank.degree[w]
            sloped = degree > 0 and min_sigma_slope == np.inf
            if not growing and not sloped:
                continue
            estimate, place = _fit(y, k, bank.half[w], bank.value[bank.first[w] :])
            sigma = deviation[bank.row[w] + place]
            low, high = max(low, estimate - agreement * sigma), min(high, estimate + agreement * sigma)
            growing = growing and low <= high
            if growing and sigma < min_sigma_value:
                for_value[k], min_sigma_value = w, sigma
            if degree > 0 and (growing or min_sigma_slope == np.inf) and sigma < min_sigma_slope:
                for_slope[k], min_sigma_slope = w, sigma
