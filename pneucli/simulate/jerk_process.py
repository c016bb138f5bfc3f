"""Kalman filter and smoother of position, velocity and acceleration whose jerk is white, compiled.

All in units of the sensor's noise and the sampling period; covariances as (xx, xv, xa, vv, va, aa).

References: G. Bierman, IEEE Trans. Autom. Control 18 (1973), the modified Bryson-Frazier smoother; S. Koopman and
N. Shephard, Biometrika 79 (1992), the score of a disturbance's variance.
"""

from __future__ import annotations

import math

import numpy as np

from pneucli.arrays import Array
from pneucli.caches import compiled

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
