"""The autocovariance of the pressure's noise, and the filter that whitens it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz

from pneucli.noise import NoiseModel
from pneucli.simulate.local_polynomials import autocovariance

Array = NDArray[np.float64]

AR_ORDER = 8  # of the noise's autoregression: colour, and most of a mains line


def whitening_filter(covariance: Array) -> tuple[Array, float]:
    """Return the filter (1, -phi_1, ...) that whitens noise of these autocovariances, and its innovations' rms."""
    covariance = covariance * np.where(np.arange(covariance.size) == 0, 1 + 1e-6, 1.0)
    phi = solve_toeplitz(covariance[:-1], covariance[1:]) if covariance.size > 1 else np.zeros(0)
    return np.append(1.0, -phi), float(np.sqrt(max(covariance[0] - phi @ covariance[1:], 1e-300)))


def averaged_noise_autocovariance(sensor: NoiseModel, readings: int, lags: int) -> Array:
    """Return the autocovariances (lags,) of a sensor's noise, ``readings`` readings averaged in one."""
    single = autocovariance(sensor, lags * readings)
    apart = np.arange(1 - readings, readings)
    weights = (readings - np.abs(apart)) / readings**2
    return np.array([weights @ single[np.abs(k * readings + apart)] for k in range(lags)])


def autocovariances(residual: Array, valid: NDArray[np.bool_]) -> Array:
    """Return the autocovariances of residuals ``(N, L)`` at lags from 0, as far as the samples allow."""
    order = min(AR_ORDER, max(0, int(valid.sum(axis=0).max()) // 20))
    e = np.where(valid, residual, 0.0)
    covariance = np.array([np.sum(e[k:] * e[: e.shape[0] - k]) for k in range(order + 1)])
    pairs = np.array([np.sum(valid[k:] & valid[: e.shape[0] - k]) for k in range(order + 1)])
    known = np.maximum(pairs, 1)  # without a pair, as where every other sample is missing, the sum is 0 as well
    return np.asarray(covariance / known)
