"""Fit the valve's law to whole charge and discharge curves: no gradient is ever taken of a noisy signal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.optimize import least_squares
from scipy.signal import lfilter

from pneucli.identify.valve.law import Law
from pneucli.identify.valve.stretches import Stretches

Array = NDArray[np.float64]

ROUNDS = 7
ORDER = 8  # of the residuals' autoregression: colour, and most of a mains line
SUBSTEP = 2e-3  # s, below the time constant of the last approach to equilibrium
WIDEST = {"shared": 0.3, "own": 0.1, "leak": 0.1}  # prior standard deviations to start from
NARROWEST = {"shared": 1e-3, "own": 1e-3, "leak": 1e-4}  # what a rig does not hold anyway


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
    """Return p(t), shape ``(N, L)`` in Pa, of all stretches from ``start`` (Pa, shape ``(L,)``); RK4, u held."""
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
            a = slope(q)
            b = slope(q + 0.5 * h * a)
            c = slope(q + 0.5 * h * b)
            q = q + h / 6 * (a + 2 * b + 2 * c + slope(q + h * c))
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


def autoregression(residual: Array, valid: NDArray[np.bool_]) -> tuple[Array, float]:
    """Return the whitening filter (1, -phi_1, ...) of residuals ``(N, L)`` and the innovations' standard deviation."""
    order = min(ORDER, max(0, int(valid.sum(axis=0).max()) // 20))
    e = np.where(valid, residual, 0.0)
    covariance = np.array([np.sum(e[k:] * e[: e.shape[0] - k]) for k in range(order + 1)])
    pairs = np.array([np.sum(valid[k:] & valid[: e.shape[0] - k]) for k in range(order + 1)])
    covariance = covariance / pairs
    covariance[0] *= 1 + 1e-6
    phi = solve_toeplitz(covariance[:-1], covariance[1:]) if order else np.zeros(0)
    return np.append(1.0, -phi), float(np.sqrt(max(covariance[0] - phi @ covariance[1:], 1e-300)))


@dataclass
class Problem:
    """The least-squares problem of one round: whitened residuals of all stretches and the corrections' priors."""

    law: Law
    data: Stretches
    whitening: Array
    noise: float
    prior: Array  # 1 / standard deviation per parameter, 0 where free

    def __post_init__(self) -> None:
        lags = self.whitening.size - 1
        seen = self.data.valid.copy()
        for k in range(1, lags + 1):
            seen[k:] &= self.data.valid[:-k]
        seen[:lags] = False
        self.rows = seen

    def white(self, signal: Array) -> Array:
        """Return ``signal`` (leading axes ``(N, L)``) filtered and scaled to unit variance, seen rows only."""
        filtered = lfilter(self.whitening, [1.0], signal, axis=0)
        return np.asarray(filtered[self.rows] / self.noise)

    def residuals(self, x: Array) -> Array:
        """Return the whitened residuals and the priors for ``x`` = theta and the start pressures."""
        theta, start = x[: self.law.size], x[self.law.size :]
        error = simulate(self.law, theta, start, self.data) - np.where(self.data.valid, self.data.p, 0.0)
        return np.concatenate([self.white(error), self.prior * theta])

    def jacobian(self, x: Array) -> Array:
        """Return the derivative of :meth:`residuals`."""
        theta, start = x[: self.law.size], x[self.law.size :]
        p = simulate(self.law, theta, start, self.data)
        by_theta, by_start = sensitivities(self.law, theta, p, self.data)
        starts = self.white(by_start[:, :, None] * np.eye(start.size))
        priors = np.hstack([np.diag(self.prior), np.zeros((theta.size, start.size))])
        return np.vstack([np.hstack([self.white(by_theta), starts]), priors])


def fit_law(law: Law, data: Stretches, guess: Array) -> Fit:
    """Fit ``law`` to ``data`` from ``guess`` and return the maximum of the posterior.

    Every round refits, whitens the residuals by an autoregression of their own (so that coloured noise does not feign
    precision), and sets each group of corrections to the prior width that the data support: MacKay's evidence update,
    Neural Computation 4 (1992) 415. Corrections that the data do not ask for shrink to nothing, and what no data
    determine falls back on the base law with the width that the rest of the map shows.
    """
    groups, widths = law.groups(), dict(WIDEST)
    whitening, noise = np.ones(1), _differences(data)
    x = np.concatenate([guess, data.p[0]])
    lower, upper = _bounds(law, x)
    for _ in range(ROUNDS):
        prior = np.zeros(law.size)
        for name, members in groups.items():
            prior[members] = 1 / widths[name]
        problem = Problem(law, data, whitening, noise, prior)
        found = least_squares(
            problem.residuals, x, problem.jacobian, (lower, upper), x_scale="jac", max_nfev=8, xtol=1e-6, ftol=1e-6
        )
        x = np.clip(found.x, lower + 1e-9, upper)
        covariance = np.linalg.pinv(found.jac.T @ found.jac, hermitian=True)[: law.size, : law.size]
        for name, members in groups.items():
            determined = members.size - np.sum(np.diag(covariance)[members]) / widths[name] ** 2
            widths[name] = float(np.sqrt(np.sum(x[members] ** 2) / max(determined, 1e-2)))
            widths[name] = float(np.clip(widths[name], NARROWEST[name], WIDEST[name]))
        simulated = simulate(law, x[: law.size], x[law.size :], data)
        whitening, noise = autoregression(simulated - data.p, data.valid)
    return Fit(x[: law.size], covariance, simulated, whitening, noise, widths)


def _differences(data: Stretches) -> float:
    second = np.diff(data.p, 2, axis=0)[data.valid[2:]]
    return max(float(np.sqrt(np.mean(second**2) / 6)), 1e-6)


def _bounds(law: Law, x: Array) -> tuple[Array, Array]:
    lower, upper = np.full(x.size, -np.inf), np.full(x.size, np.inf)
    for o, d in zip(law.offsets(), law.directions, strict=True):
        lower[o + 1], upper[o + 1] = 0.0, 0.6 * d.nodes[-1]
        lower[o + 2], upper[o + 2] = 0.2, 5.0
    return lower, upper
