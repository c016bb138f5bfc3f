"""The autocovariance of the pressure's noise, and the filter that whitens it.

References:
    Brockwell, P. J. and Davis, R. A., Time Series: Theory and Methods, section 8.1 (Yule-Walker equations).

"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz

from pneucli.noise import NoiseModel
from pneucli.simulate.local_polynomials import autocovariance

Array = NDArray[np.float64]

AR_ORDER = 8  # order of the noise's autoregression: coloured noise, and most of mains hum


def whitening_filter(covariance: Array) -> tuple[Array, float]:
    """Compute the filter that whitens noise of a given autocovariance (Yule-Walker equations).

    Args:
        covariance: Autocovariances at lags 0, 1, ..., shape (m,).

    Returns:
        The filter (1, -phi_1, ...), shape (m,), and the rms of its innovations.

    >>> coefficients, rms = whitening_filter(4.0 * 0.5 ** np.arange(3))
    >>> coefficients.round(3).tolist(), round(rms, 2)
    ([1.0, -0.5, -0.0], 1.73)

    """
    covariance = covariance * np.where(np.arange(covariance.size) == 0, 1 + 1e-6, 1.0)
    phi = solve_toeplitz(covariance[:-1], covariance[1:]) if covariance.size > 1 else np.zeros(0)
    return np.append(1.0, -phi), float(np.sqrt(max(covariance[0] - phi @ covariance[1:], 1e-300)))


def averaged_noise_autocovariance(sensor: NoiseModel, readings: int, lags: int) -> Array:
    """Compute the autocovariance of averages of consecutive readings.

    Args:
        sensor: Noise of a single reading.
        readings: Number of readings in one average.
        lags: Number of lags.

    Returns:
        The autocovariances of the averages, shape (lags,).

    White noise of 2 Pa keeps a quarter of its variance in means of four readings:

    >>> averaged_noise_autocovariance(NoiseModel(2.0), readings=4, lags=2).tolist()
    [1.0, 0.0]
    """
    single = autocovariance(sensor, lags * readings)
    lags_of_pairs = np.arange(1 - readings, readings)
    weights = (readings - np.abs(lags_of_pairs)) / readings**2
    return np.array([weights @ single[np.abs(k * readings + lags_of_pairs)] for k in range(lags)])


def autocovariances(residual: Array, valid: NDArray[np.bool_]) -> Array:
    """Estimate the autocovariance of residuals with missing samples.

    Args:
        residual: Residuals, shape ``(N, L)``.
        valid: Where they exist, shape ``(N, L)``.

    Returns:
        The autocovariances at lags from 0 up to ``AR_ORDER``, fewer for short residuals.

    >>> signs = np.tile([1.0, -1.0], 30)[:, None]  # lag 1 has the opposite sign
    >>> autocovariances(signs, np.ones(signs.shape, dtype=bool)).round(3).tolist()
    [1.0, -1.0, 1.0, -1.0]
    """
    order = min(AR_ORDER, max(0, int(valid.sum(axis=0).max()) // 20))
    residuals = np.where(valid, residual, 0.0)
    covariance = np.array([np.sum(residuals[k:] * residuals[: residuals.shape[0] - k]) for k in range(order + 1)])
    pairs = np.array([np.sum(valid[k:] & valid[: residuals.shape[0] - k]) for k in range(order + 1)])
    counts = np.maximum(pairs, 1)  # without a pair, as with every other sample missing, the sum is 0 as well
    return np.asarray(covariance / counts)
