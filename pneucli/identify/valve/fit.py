"""Fit the law to whole charge and discharge curves: no gradient is ever taken of a noisy signal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.estimation.least_squares import NormalEquations, minimise, normal_equations
from pneucli.identify.valve.area_model import AreaModel
from pneucli.identify.valve.noise_covariance import (
    AR_ORDER,
    autocovariances,
    averaged_noise_autocovariance,
    whitening_filter,
)
from pneucli.identify.valve.transients import Transients
from pneucli.noise import NoiseModel

Array = NDArray[np.float64]

JACOBIAN_MEMORY = 16 << 20  # bytes of derivatives that are held at once; what they are made of takes a few times that
EVIDENCE_ITERATIONS, SEARCH_ITERATIONS = 9, 6  # of prior widths, and of the search in each
TOLERANCE = 1e-6  # of the sum of squares, at which a search ends
WIDTH_TOLERANCE = 0.2  # change of the prior widths, as a logarithm, at which the rounds end
INITIAL_PRIOR_WIDTHS = {
    "shared": 0.05,
    "own": 0.005,
    "leak": 0.005,
}  # prior standard deviations to start from: the model first
MAX_PRIOR_WIDTHS = {"shared": 0.5, "own": 0.3, "leak": 0.2}
MIN_PRIOR_WIDTHS = {"shared": 1e-3, "own": 1e-3, "leak": 5e-5}  # what a rig does not hold anyway


@dataclass(frozen=True)
class Posterior:
    """Parameters, covariance (correlated residuals accounted for), and the pressures (Pa, ``(N, L)``) they give."""

    theta: Array
    covariance: Array
    simulated: Array


def simulate_transients(law: AreaModel, theta: Array, start: Array, s: Transients) -> Array:
    """Return p(t), shape ``(N, L)`` in Pa, of all stretches from ``start`` (Pa, shape ``(L,)``).

    Midpoint rule with u held over each sample: its error, (h / time constant)^2 / 6 of the gradient, is below 1e-4.
    No step leads beyond the pressure on the valve's other side, where the slope of the flow function has no end.
    """
    still, shape = (
        law.model_gradient.at_coordinates(law.model_coordinates(theta)),
        law.correction_coefficients(theta, s.u),
    )
    away = law.coordinate_shift(theta)[: s.memory_gradient.shape[-1] - 1]
    other, beside = law.opposite_pressure(s.u, s.supply), s.memory_gradient[..., 0] + s.memory_gradient[..., 1:] @ away
    p = np.empty_like(s.p)
    p[0] = start
    h = s.period / s.substeps
    for k in range(s.p.shape[0] - 1):

        def slope(q: Array, k: int = k) -> Array:
            here = s.u[k], q, s.supply[k]
            return np.asarray(law.corrected_gradient(theta, shape[:, k], still(*here), *here) + beside[k])

        q = p[k]
        for _ in range(s.substeps):
            middle = _limited_to_equilibrium(other[k], q, q + 0.5 * h * slope(q))
            q = _limited_to_equilibrium(other[k], q, q + h * slope(middle))
        p[k + 1] = q
    return p


def _limited_to_equilibrium(other: Array, before: Array, after: Array) -> Array:
    """Return pressures (L,) in Pa after a step, but at most those on the other side where the step would pass them."""
    return np.asarray(np.where((before - other) * (after - other) < 0.0, other, after))


def initial_pressure_sensitivity(law: AreaModel, theta: Array, p: Array, s: Transients) -> tuple[Array, Array]:
    """Return how an error decays over each sample ``(N - 1, L)``, and dp/dp(0) ``(N, L)`` along a simulated ``p``."""
    delta = 1e-6 * law.supply
    ahead, behind = (law.gradient(theta, s.u, p + d, s.supply) for d in (delta, -delta))
    stiffness = (ahead - behind) / (2 * delta)
    decay = np.exp(np.minimum(0.5 * s.period * (stiffness[1:] + stiffness[:-1]), 1.0))
    return decay, np.concatenate([np.ones((1, p.shape[1])), np.cumprod(decay, axis=0)])


def parameter_sensitivity(law: AreaModel, theta: Array, p: Array, decay: Array, s: Transients) -> Array:
    """Return dp/dtheta ``(N, L, size)`` along a simulated ``p``."""
    by_theta = law.sensitivity(theta, s.u, p, s.supply)
    by_theta[..., : s.memory_gradient.shape[-1] - 1] += s.memory_gradient[..., 1:]
    force = 0.5 * s.period[:, None] * by_theta
    out = np.zeros_like(force)
    for k in range(p.shape[0] - 1):
        out[k + 1] = decay[k][:, None] * (out[k] + force[k]) + force[k + 1]
    return out


@dataclass
class TransientBatch:
    """Whitened residuals of stretches that are taken together, their start pressures (Pa, ``(L,)``) eliminated."""

    area_model: AreaModel
    data: Transients
    whitening: Array
    noise: float
    start: Array

    def __post_init__(self) -> None:
        self._last: tuple[Array, tuple[Array, Array, Array]] | None = None  # theta and what came along it

    def whiten(self, signal: Array) -> Array:
        """Return ``signal`` (leading axes ``(N, L)``) filtered, in units of its innovations, zero where not seen."""
        lags, samples = self.whitening.size - 1, signal.shape[0]
        if samples <= lags:
            return np.zeros((0, *signal.shape[1:]))
        seen = np.lib.stride_tricks.sliding_window_view(self.data.valid, lags + 1, axis=0).all(axis=-1)
        filtered = sum(w * signal[lags - k : samples - k] for k, w in enumerate(self.whitening))
        scaled = np.where(seen, 1 / self.noise, 0.0)
        return np.asarray(filtered * scaled.reshape(*seen.shape, *[1] * (signal.ndim - 2)))

    def linearisation(self, theta: Array) -> tuple[Array, Array, Array]:
        """Return simulated pressures, the decay of errors, and what a start's error becomes, whitened, of norm 1."""
        if self._last is None or not np.array_equal(self._last[0], theta):
            self._last = theta.copy(), self._along(theta)
        return self._last[1]

    def _along(self, theta: Array) -> tuple[Array, Array, Array]:
        p = simulate_transients(self.area_model, theta, self.start, self.data)
        decay, ahead = initial_pressure_sensitivity(self.area_model, theta, p, self.data)
        white = self.whiten(ahead)
        return p, decay, white / np.sqrt(np.sum(white**2, axis=0) + 1e-12)

    def residuals(self, theta: Array) -> Array:
        """Return what no start pressure can take up of the whitened residuals."""
        p, _, starts = self.linearisation(theta)
        error = self.whiten(p - np.where(self.data.valid, self.data.p, 0.0))
        error -= starts * np.sum(starts * error, axis=0)
        return error.ravel()

    def jacobian(self, theta: Array) -> Array:
        """Return the derivatives of the residuals, 0 where they are beyond all numbers: nothing is known there."""
        p, decay, starts = self.linearisation(theta)
        by_theta = self.whiten(parameter_sensitivity(self.area_model, theta, p, decay, self.data))
        by_theta -= starts[..., None] * np.einsum("nl,nlp->lp", starts, by_theta)
        return np.nan_to_num(by_theta.reshape(-1, theta.size), copy=False, nan=0.0, posinf=0.0, neginf=0.0)

    def improved_initial_pressures(self, theta: Array) -> Array:
        """Return the start pressures (L,) in Pa that suit the data best, in the straight line's sense."""
        p = simulate_transients(self.area_model, theta, self.start, self.data)
        ahead = self.whiten(initial_pressure_sensitivity(self.area_model, theta, p, self.data)[1])
        error = self.whiten(p - np.where(self.data.valid, self.data.p, 0.0))
        return np.asarray(self.start - np.sum(ahead * error, axis=0) / (np.sum(ahead**2, axis=0) + 1e-12))


class TransientProblem:
    """All stretches, and what is known beforehand of theta.

    Stretches share only theta. They are taken some of like length at a time, so that derivatives of all are never held
    at once, nor short ones filled up to the longest.
    """

    def __init__(
        self,
        law: AreaModel,
        data: Transients,
        whitening: Array,
        noise: float,
        prior: Array,
        start: Array,
        memory: int = JACOBIAN_MEMORY,
    ) -> None:
        """``prior``: units of what is known beforehand (k, k); ``memory``: of derivatives held at once, in bytes."""
        self.law, self.prior = law, prior
        self._which = list(data.batches(memory // (8 * law.size)))
        self._parts = [TransientBatch(law, data.select(some), whitening, noise, start[some]) for some in self._which]

    def residuals(self, theta: Array) -> Array:
        """Return the residuals of all stretches, and the prior's."""
        return np.concatenate([*(part.residuals(theta) for part in self._parts), self._prior_residuals(theta)])

    def normal_equations(self, theta: Array) -> NormalEquations:
        """Return the normal equations."""
        gradient, curvature = normal_equations(self._prior_residuals(theta), self.prior)
        for part in self._parts:
            more = normal_equations(part.residuals(theta), part.jacobian(theta))
            gradient, curvature = gradient + more.gradient, curvature + more.curvature
        return NormalEquations(gradient, curvature)

    def improved_initial_pressures(self, theta: Array) -> Array:
        """Return the start pressures (L,) in Pa that suit the data best."""
        found = np.concatenate([part.improved_initial_pressures(theta) for part in self._parts])
        return found[np.argsort(np.concatenate(self._which))]

    def _prior_residuals(self, theta: Array) -> Array:
        return np.asarray(self.prior @ (theta - self.law.initial_theta()))


def fit_area_model(law: AreaModel, data: Transients, sensor: NoiseModel) -> Posterior:
    """Fit ``law`` to ``data`` from the model as it is and return the maximum of the posterior.

    Residuals are weighted as the noise of the pressure's ``sensor``; the covariance is that of the residuals as they
    are, so that coloured ones do not feign precision. (Weights from the residuals themselves would let the curves
    drift from the data: what a law cannot follow looks like noise that is slow.) Each round refits and sets each group
    of corrections to the prior width that the data support: MacKay's evidence update, Neural Computation 4 (1992) 415.
    Corrections that the data do not ask for shrink to nothing, and what no data determine falls back on the model
    with the width that the rest of the map shows. Every parameter has a prior, so no matrix is singular.
    """
    groups, widths = law.prior_groups(), dict(INITIAL_PRIOR_WIDTHS)
    order = min(AR_ORDER, int(data.lengths.max()) // 2)  # a filter as long as the stretches would see none of them
    whitening, noise = whitening_filter(
        averaged_noise_autocovariance(sensor, int(np.median(data.averaged_readings)), order + 1)
    )
    theta, start = law.initial_theta(), initial_pressures(data)
    for _ in range(EVIDENCE_ITERATIONS):
        problem = TransientProblem(law, data, whitening, noise, _prior_matrix(law, widths), start)
        found = minimise(
            problem.residuals,
            problem.normal_equations,
            theta,
            _bounds(law),
            max_iterations=SEARCH_ITERATIONS,
            tolerance=TOLERANCE,
        )
        theta, before = found.z, dict(widths)
        start = problem.improved_initial_pressures(theta)
        variance = np.diag(_inverse(found.jacobian))
        for name, members in groups.items():
            determined = members.size - np.sum(variance[members]) / widths[name] ** 2
            supported = float(np.sqrt(np.sum(theta[members] ** 2) / max(determined, 1e-2)))
            widths[name] = float(np.clip(supported, MIN_PRIOR_WIDTHS[name], MAX_PRIOR_WIDTHS[name]))
        if all(abs(np.log(widths[name] / before[name])) < WIDTH_TOLERANCE for name in widths):
            break
    simulated = simulate_transients(law, theta, start, data)
    whitening, noise = whitening_filter(autocovariances(simulated - data.p, data.valid))
    as_it_is = TransientProblem(law, data, whitening, noise, _prior_matrix(law, widths), start)
    return Posterior(theta, _inverse(as_it_is.normal_equations(theta)), simulated)


def initial_pressures(data: Transients) -> Array:
    """Return the first readings (L,) in Pa."""
    return np.asarray(np.nan_to_num(data.p[0], nan=float(np.nanmedian(data.p))))


def _prior_matrix(law: AreaModel, widths: dict[str, float]) -> Array:
    prior, moved = np.zeros((law.size, law.size)), len(law.model_gradient.free)
    prior[:moved, :moved] = law.model_gradient.prior_whitening
    for name, members in law.prior_groups().items():
        prior[members, members] = 1 / widths[name]
    return prior


def _inverse(equations: NormalEquations) -> Array:
    """Return the inverse of the curvature (k, k), which what is known beforehand keeps from being singular."""
    return np.asarray(np.linalg.pinv(equations.curvature, hermitian=True))


def _bounds(law: AreaModel) -> tuple[Array, Array]:
    lower, upper = np.full(law.size, -np.inf), np.full(law.size, np.inf)
    of_trend = slice(len(law.model_gradient.free))
    lower[of_trend], upper[of_trend] = law.model_gradient.bounds
    return lower, upper
