"""Fit the valve's law to whole charge and discharge curves: no gradient is ever taken of a noisy signal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz

from pneucli.errors import InputError
from pneucli.identify.valve.law import Law
from pneucli.identify.valve.stretches import Stretches
from pneucli.noise import NoiseModel
from pneucli.simulate.smooth import autocovariance

Array = NDArray[np.float64]

ROUNDS, STEPS = 9, 6  # of prior widths, and of Levenberg-Marquardt in each
ENOUGH = 0.05  # gain of a step, in units of chi-square, at which a round ends
SETTLED = 0.2  # change of the prior widths, as a logarithm, at which the rounds end
ORDER = 8  # of the noise's autoregression: colour, and most of a mains line
SUBSTEP = 2e-3  # s, below the time constant of the last approach to equilibrium
FIRST = {"shared": 0.05, "own": 0.005, "leak": 0.005}  # prior standard deviations to start from: base law first
WIDEST = {"shared": 0.5, "own": 0.3, "leak": 0.2}
NARROWEST = {"shared": 1e-3, "own": 1e-3, "leak": 5e-5}  # what a rig does not hold anyway


@dataclass(frozen=True)
class Fit:
    """Parameters, covariance (correlated residuals accounted for), simulated pressures ``(N, L)``, AR whitening."""

    theta: Array
    covariance: Array
    simulated: Array
    whitening: Array
    noise: float
    widths: dict[str, float]


def simulate(law: Law, theta: Array, start: Array, s: Stretches) -> Array:
    """Return p(t), shape ``(N, L)`` in Pa, of all stretches from ``start`` (Pa, shape ``(L,)``).

    Midpoint rule with u held over each sample: its error, (h / time constant)^2 / 6 of the gradient, is below 1e-4.
    """
    log_area, shape = law.factors(theta, s.u)
    p = np.empty_like(s.p)
    p[0] = start
    substeps = max(1, int(np.ceil(s.period.max() / SUBSTEP)))
    h = s.period / substeps

    for k in range(s.p.shape[0] - 1):

        def slope(q: Array, k: int = k) -> Array:
            return law.flow(log_area[k], shape[:, k], s.u[k], q, s.supply[k]) + law.leak(theta, q)

        q = p[k]
        for _ in range(substeps):
            q = q + h * slope(q + 0.5 * h * slope(q))
        p[k + 1] = q
    return p


def sensitivities(law: Law, theta: Array, p: Array, s: Stretches) -> tuple[Array, Array]:
    """Return dp/dtheta ``(N, L, size)`` and dp/dp(0) ``(N, L)`` along a simulated ``p``."""
    delta = 1e-6 * law.supply
    ahead, behind = (law.gradient(theta, s.u, p + d, s.supply) for d in (delta, -delta))
    stiffness = (ahead - behind) / (2 * delta)
    decay = np.exp(0.5 * s.period * (stiffness[1:] + stiffness[:-1]))
    force = 0.5 * s.period[:, None] * law.sensitivity(theta, s.u, p, s.supply)
    out = np.zeros_like(force)
    for k in range(p.shape[0] - 1):
        out[k + 1] = decay[k][:, None] * (out[k] + force[k]) + force[k + 1]
    return out, np.concatenate([np.ones((1, p.shape[1])), np.cumprod(decay, axis=0)])


def inverse(hessian: Array) -> Array:
    """Return the inverse of a Hessian (k, k); what no test shows, which makes it singular, gets none."""
    try:
        return np.asarray(np.linalg.inv(hessian), dtype=np.float64)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(hessian, hermitian=True), dtype=np.float64)


def whitener(covariance: Array) -> tuple[Array, float]:
    """Return the filter (1, -phi_1, ...) that whitens noise of these autocovariances, and its innovations' rms."""
    covariance = covariance * np.where(np.arange(covariance.size) == 0, 1 + 1e-6, 1.0)
    phi = solve_toeplitz(covariance[:-1], covariance[1:]) if covariance.size > 1 else np.zeros(0)
    return np.append(1.0, -phi), float(np.sqrt(max(covariance[0] - phi @ covariance[1:], 1e-300)))


def autocovariances(residual: Array, valid: NDArray[np.bool_]) -> Array:
    """Return the autocovariances of residuals ``(N, L)`` at lags from 0, as far as the samples allow."""
    order = min(ORDER, max(0, int(valid.sum(axis=0).max()) // 20))
    e = np.where(valid, residual, 0.0)
    covariance = np.array([np.sum(e[k:] * e[: e.shape[0] - k]) for k in range(order + 1)])
    pairs = np.array([np.sum(valid[k:] & valid[: e.shape[0] - k]) for k in range(order + 1)])
    known = np.maximum(pairs, 1)  # without a pair, as where every other sample is missing, the sum is 0 as well
    return np.asarray(covariance / known)


@dataclass(frozen=True)
class Round:
    """One round's problem: whitened residuals of all stretches, free start pressures, priors on the corrections."""

    law: Law
    data: Stretches
    whitening: Array
    noise: float
    prior: Array  # 1 / standard deviation per parameter, 0 where free

    def white(self, signal: Array) -> Array:
        """Return ``signal`` (leading axes ``(N, L)``) filtered, in units of its innovations, zero where not seen."""
        lags, samples = self.whitening.size - 1, signal.shape[0]
        seen = np.lib.stride_tricks.sliding_window_view(self.data.valid, lags + 1, axis=0).all(axis=-1)
        filtered = sum(w * signal[lags - k : samples - k] for k, w in enumerate(self.whitening))
        scaled = np.where(seen, 1 / self.noise, 0.0)
        return np.asarray(filtered * scaled.reshape(*seen.shape, *[1] * (signal.ndim - 2)))

    def cost(self, theta: Array, simulated: Array) -> float:
        """Return twice the negative logarithm of the posterior, up to a constant."""
        error = simulated - np.where(self.data.valid, self.data.p, 0.0)
        return float(np.sum(self.white(error) ** 2) + np.sum((self.prior * theta) ** 2))

    def normal_equations(self, theta: Array, simulated: Array) -> tuple[Array, Array, Array, Array]:
        """Return gradient and Hessian of theta with the start pressures eliminated, and what gives those back."""
        by_theta, by_start = sensitivities(self.law, theta, simulated, self.data)
        error = self.white(simulated - np.where(self.data.valid, self.data.p, 0.0))
        jacobian, starts = self.white(by_theta), self.white(by_start)
        own = np.sum(starts**2, axis=0) + 1e-12
        cross = np.einsum("nlp,nl->pl", jacobian, starts) / own
        start_gradient = np.sum(starts * error, axis=0) / own
        flat = jacobian.reshape(-1, theta.size)
        hessian = flat.T @ flat - (cross * own) @ cross.T + np.diag(self.prior**2)
        gradient = flat.T @ error.ravel() - cross @ (own * start_gradient) + self.prior**2 * theta
        return gradient, np.asarray(hessian), cross, start_gradient

    def solve(self, theta: Array, start: Array, bounds: tuple[Array, Array]) -> tuple[Array, Array, Array, Array]:
        """Return theta, start pressures, simulated pressures and Hessian after Levenberg-Marquardt steps."""
        simulated = simulate(self.law, theta, start, self.data)
        cost, damping = self.cost(theta, simulated), 1e-4
        for _ in range(STEPS):
            gradient, hessian, cross, start_gradient = self.normal_equations(theta, simulated)
            if not np.isfinite(hessian).all():
                found, mend = (
                    "no law of a valve fits them: it grows beyond all numbers",
                    "see what ingest finds implausible",
                )
                raise InputError("the valve tests", found, "supply, volume and pressures of one rig", mend)
            gain = 0.0
            while damping < 1e8 and gain <= 0.0:
                step = -inverse(hessian + damping * np.diag(np.diag(hessian))) @ gradient
                tried = np.clip(theta + step, *bounds)
                tried_start = start - start_gradient - cross.T @ (tried - theta)
                ahead = simulate(self.law, tried, tried_start, self.data)
                gain = cost - self.cost(tried, ahead)
                if gain <= 0.0 and -step @ (2 * gradient + hessian @ step) < ENOUGH:
                    break  # not even the model of the cost promises more
                damping *= 0.2 if gain > 0.0 else 10.0
            if gain > 0.0:
                theta, start, simulated, cost = tried, tried_start, ahead, cost - gain
            if gain < ENOUGH:
                break
            damping = max(damping, 1e-9)
        return theta, start, simulated, hessian


def fit_law(law: Law, data: Stretches, guess: Array, sensor: NoiseModel) -> Fit:
    """Fit ``law`` to ``data`` from ``guess`` and return the maximum of the posterior.

    Residuals are weighted as the noise of the pressure's ``sensor``; the covariance is that of the residuals as they
    are, so that coloured ones do not feign precision. (Weights from the residuals themselves would let the curves
    drift from the data: what a law cannot follow looks like noise that is slow.) Each round refits and sets each group
    of corrections to the prior width that the data support: MacKay's evidence update, Neural Computation 4 (1992) 415.
    Corrections that the data do not ask for shrink to nothing, and what no data determine falls back on the base law
    with the width that the rest of the map shows.
    """
    groups, widths = law.groups(), dict(FIRST)
    whitening, noise = whitener(autocovariance(sensor, ORDER + 1))
    theta, start = guess, np.nan_to_num(data.p[0], nan=float(np.nanmedian(data.p)))
    bounds = _bounds(law)
    for _ in range(ROUNDS):
        prior = np.zeros(law.size)
        for name, members in groups.items():
            prior[members] = 1 / widths[name]
        theta, start, simulated, hessian = Round(law, data, whitening, noise, prior).solve(theta, start, bounds)
        variance = np.diag(inverse(hessian))
        before = dict(widths)
        for name, members in groups.items():
            determined = members.size - np.sum(variance[members]) / widths[name] ** 2
            supported = float(np.sqrt(np.sum(theta[members] ** 2) / max(determined, 1e-2)))
            widths[name] = float(np.clip(supported, NARROWEST[name], WIDEST[name]))
        if all(abs(np.log(widths[name] / before[name])) < SETTLED for name in widths):
            break
    whitening, noise = whitener(autocovariances(simulated - data.p, data.valid))
    hessian = Round(law, data, whitening, noise, prior).normal_equations(theta, simulated)[1]
    return Fit(theta, inverse(hessian), simulated, whitening, noise, widths)


def _bounds(law: Law) -> tuple[Array, Array]:
    lower, upper = np.full(law.size, -np.inf), np.full(law.size, np.inf)
    for o, d in zip(law.offsets(), law.directions, strict=True):
        lower[o + 1 : o + 3] = 0.0, 0.2
        upper[o + 1 : o + 3] = 0.6 * d.nodes[-1], 5.0
    return lower, upper
