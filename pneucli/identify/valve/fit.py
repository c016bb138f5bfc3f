"""Fit the area model to whole charge and discharge curves, without differentiating a noisy signal.

Source: docs/valve-identification.md; widths of priors after D. J. C. MacKay, Neural Computation 4 (1992) 415-447;
whitening by the Yule-Walker equations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_toeplitz

from pneucli.arrays import Array, Mask
from pneucli.caches import compiled
from pneucli.identify.estimation.least_squares import NormalEquations, minimise, normal_equations
from pneucli.identify.valve.area_model import AreaModel
from pneucli.identify.valve.transients import Transients
from pneucli.noise import NoiseModel
from pneucli.simulate.local_polynomials import autocovariance


def simulate_transients(area_model: AreaModel, theta: Array, start: Array, transients: Transients) -> Array:
    """Simulate the pressure of all transients.

    The midpoint rule holds u over each sample: its error, (h / time constant)^2 / 6 of the gradient, stays below 1e-4.
    No step crosses the pressure on the other side of the valve, where the slope of the flow function is infinite.

    Args:
        area_model: The area model.
        theta: Its parameters.
        start: Initial pressures in Pa, shape ``(L,)``.
        transients: The transients with commands and supply pressures.

    Returns:
        The pressures in Pa, shape ``(N, L)``.

    """
    quasi_static = area_model.model_gradient.at_coordinates(area_model.model_coordinates(theta))
    coefficients = area_model.correction_coefficients(theta, transients.u)
    shift = area_model.coordinate_shift(theta)[: transients.memory_gradient.shape[-1] - 1]
    memory = transients.memory_gradient[..., 0] + transients.memory_gradient[..., 1:] @ shift
    opposite = area_model.opposite_pressure(transients.u, transients.supply)
    correct = area_model.correction_of_gradient(theta)
    p = np.empty_like(transients.p)
    p[0] = start
    h = transients.period / transients.substeps
    for k in range(transients.p.shape[0] - 1):
        u, supply, beyond, q = transients.u[k], transients.supply[k], opposite[k], p[k]
        for _ in range(transients.substeps):
            midpoint = q
            for step in (0.5 * h, h):
                slope = correct(quasi_static(u, midpoint, supply), coefficients[k], beyond, midpoint)
                midpoint = _step_to_equilibrium(beyond, q, step, slope, memory[k])
            q = midpoint
        p[k + 1] = q
    return p


@compiled(nogil=True, error_model="numpy")
def _step_to_equilibrium(opposite: Array, p: Array, h: Array, slope: Array, memory: Array) -> Array:
    """Return pressures (L,) in Pa after a step, limited to the pressure on the other side of the valve."""
    out = np.empty(p.size)
    for i in range(p.size):
        after = p[i] + h[i] * (slope[i] + memory[i])
        out[i] = opposite[i] if (p[i] - opposite[i]) * (after - opposite[i]) < 0.0 else after
    return out


def initial_pressure_sensitivity(
    area_model: AreaModel, theta: Array, p: Array, transients: Transients
) -> tuple[Array, Array]:
    """Compute the sensitivity of a simulated pressure to its initial value.

    Args:
        area_model: The area model.
        theta: Its parameters.
        p: Simulated pressures in Pa, shape ``(N, L)``.
        transients: The transients.

    Returns:
        The decay of an error over each sample, shape ``(N - 1, L)``, and dp/dp(0), shape ``(N, L)``.

    """
    delta = 1e-6 * area_model.supply
    above, below = (area_model.gradient(theta, transients.u, p + d, transients.supply) for d in (delta, -delta))
    stiffness = (above - below) / (2 * delta)
    decay = np.exp(np.minimum(0.5 * transients.period * (stiffness[1:] + stiffness[:-1]), 1.0))
    return decay, np.concatenate([np.ones((1, p.shape[1])), np.cumprod(decay, axis=0)])


def parameter_sensitivity(area_model: AreaModel, theta: Array, p: Array, decay: Array, transients: Transients) -> Array:
    """Compute the sensitivity of a simulated pressure to the parameters.

    Args:
        area_model: The area model.
        theta: Its parameters.
        p: Simulated pressures in Pa, shape ``(N, L)``.
        decay: Decay of an error over each sample, shape ``(N - 1, L)``.
        transients: The transients.

    Returns:
        dp/dtheta, shape ``(N, L, size)``.

    """
    by_theta = area_model.sensitivity(theta, transients.u, p, transients.supply)
    by_theta[..., : transients.memory_gradient.shape[-1] - 1] += transients.memory_gradient[..., 1:]
    force = 0.5 * transients.period[:, None] * by_theta
    out = np.zeros_like(force)
    for k in range(p.shape[0] - 1):
        out[k + 1] = decay[k][:, None] * (out[k] + force[k]) + force[k + 1]
    return out


def initial_pressures(data: Transients) -> Array:
    """Return the first readings of the transients.

    Args:
        data: The transients.

    Returns:
        The pressures in Pa, shape ``(L,)``; the median of all readings where the first is missing.

    """
    return np.asarray(np.nan_to_num(data.p[0], nan=float(np.nanmedian(data.p))))


AR_ORDER = 8  # order of the noise's autoregression: coloured noise, and most of mains hum
JACOBIAN_MEMORY = 16 << 20  # bytes of derivatives held at once; computing them takes a few times as much
EVIDENCE_ITERATIONS, SEARCH_ITERATIONS = 9, 6  # updates of the prior widths, and iterations of the search in each
TOLERANCE = 1e-6  # relative decrease of the sum of squares at which a search ends
WIDTH_TOLERANCE = 0.2  # change of the logarithm of the prior widths at which the updates end
INITIAL_PRIOR_WIDTHS = {
    "shared": 0.05,
    "own": 0.005,
    "leak": 0.005,
}  # prior standard deviations of the first update, narrow so that the model fits first
MAX_PRIOR_WIDTHS = {"shared": 0.5, "own": 0.3, "leak": 0.2}
MIN_PRIOR_WIDTHS = {"shared": 1e-3, "own": 1e-3, "leak": 5e-5}  # below the repeatability of a rig


@dataclass(frozen=True)
class Posterior:
    """Parameters, their covariance under correlated residuals, and the fitted pressures (Pa, ``(N, L)``)."""

    theta: Array
    covariance: Array
    simulated: Array


@dataclass
class TransientBatch:
    """Whitened residuals of some transients, with the initial pressures (Pa, ``(L,)``) eliminated."""

    area_model: AreaModel
    data: Transients
    whitening: Array
    noise: float
    start: Array

    def __post_init__(self) -> None:
        self._last: tuple[Array, tuple[Array, Array, Array]] | None = None  # theta and what came along it

    def whiten(self, signal: Array) -> Array:
        """Filter ``signal`` (leading axes ``(N, L)``) to white noise of unit variance; 0 where samples are missing."""
        lags, samples = self.whitening.size - 1, signal.shape[0]
        if samples <= lags:
            return np.zeros((0, *signal.shape[1:]))
        seen = np.lib.stride_tricks.sliding_window_view(self.data.valid, lags + 1, axis=0).all(axis=-1)
        filtered = sum(w * signal[lags - k : samples - k] for k, w in enumerate(self.whitening))
        scaled = np.where(seen, 1 / self.noise, 0.0)
        return np.asarray(filtered * scaled.reshape(*seen.shape, *[1] * (signal.ndim - 2)))

    def linearisation(self, theta: Array) -> tuple[Array, Array, Array]:
        """Return simulated pressures, the decay of errors, and the whitened effect of an initial error, of norm 1."""
        if self._last is None or not np.array_equal(self._last[0], theta):
            self._last = theta.copy(), self._along(theta)
        return self._last[1]

    def _along(self, theta: Array) -> tuple[Array, Array, Array]:
        p = simulate_transients(self.area_model, theta, self.start, self.data)
        decay, sensitivity_to_start = initial_pressure_sensitivity(self.area_model, theta, p, self.data)
        white = self.whiten(sensitivity_to_start)
        size = np.maximum(np.max(np.abs(white), axis=0, initial=0.0), 1.0)  # squares of a diverging effect overflow
        return p, decay, white / size / np.sqrt(np.sum((white / size) ** 2, axis=0) + (1e-6 / size) ** 2)

    def residuals(self, theta: Array) -> Array:
        """Return the whitened residuals, with the component along the initial pressures removed."""
        p, _, starts = self.linearisation(theta)
        error = self.whiten(p - np.where(self.data.valid, self.data.p, 0.0))
        error -= starts * np.sum(starts * error, axis=0)
        return error.ravel()

    def jacobian(self, theta: Array) -> Array:
        """Return the derivatives of the residuals; 0 where they overflow, since an overflow identifies nothing."""
        p, decay, starts = self.linearisation(theta)
        by_theta = self.whiten(parameter_sensitivity(self.area_model, theta, p, decay, self.data))
        by_theta -= starts[..., None] * np.einsum("nl,nlp->lp", starts, by_theta)
        return np.nan_to_num(by_theta.reshape(-1, theta.size), copy=False, nan=0.0, posinf=0.0, neginf=0.0)

    def improved_initial_pressures(self, theta: Array) -> Array:
        """Return the initial pressures (L,) in Pa after one Gauss-Newton step."""
        p = simulate_transients(self.area_model, theta, self.start, self.data)
        sensitivity_to_start = self.whiten(initial_pressure_sensitivity(self.area_model, theta, p, self.data)[1])
        error = self.whiten(p - np.where(self.data.valid, self.data.p, 0.0))
        return np.asarray(
            self.start
            - np.sum(sensitivity_to_start * error, axis=0) / (np.sum(sensitivity_to_start**2, axis=0) + 1e-12)
        )


class TransientProblem:
    """All transients, and the prior of theta.

    Transients share only theta. Batches of similar length are evaluated one after the other, which bounds the memory of
    the derivatives and avoids padding short transients to the longest.
    """

    def __init__(
        self,
        area_model: AreaModel,
        data: Transients,
        whitening: Array,
        noise: float,
        prior: Array,
        start: Array,
        memory: int = JACOBIAN_MEMORY,
    ) -> None:
        """Split the transients into batches.

        Args:
            area_model: The area model.
            data: The transients.
            whitening: Whitening filter of the noise.
            noise: Rms of its innovations in Pa.
            prior: Square root of the prior's precision, shape (k, k).
            start: Initial pressures in Pa, shape ``(L,)``.
            memory: Bytes of derivatives held at once.

        """
        self.area_model, self.prior = area_model, prior
        self._which = list(data.batches(memory // (8 * area_model.size)))
        self._parts = [
            TransientBatch(area_model, data.select(some), whitening, noise, start[some]) for some in self._which
        ]

    def residuals(self, theta: Array) -> Array:
        """Return the residuals of all transients, and the prior's."""
        return np.concatenate([*(part.residuals(theta) for part in self._parts), self._prior_residuals(theta)])

    def normal_equations(self, theta: Array) -> NormalEquations:
        """Return the normal equations at theta."""
        gradient, curvature = normal_equations(self._prior_residuals(theta), self.prior)
        for part in self._parts:
            part_equations = normal_equations(part.residuals(theta), part.jacobian(theta))
            gradient, curvature = gradient + part_equations.gradient, curvature + part_equations.curvature
        return NormalEquations(gradient, curvature)

    def improved_initial_pressures(self, theta: Array) -> Array:
        """Return the initial pressures (L,) in Pa after one Gauss-Newton step."""
        pressures = np.concatenate([part.improved_initial_pressures(theta) for part in self._parts])
        return pressures[np.argsort(np.concatenate(self._which))]

    def _prior_residuals(self, theta: Array) -> Array:
        return np.asarray(self.prior @ (theta - self.area_model.initial_theta()))


def fit_area_model(area_model: AreaModel, data: Transients, sensor: NoiseModel) -> Posterior:
    """Fit the area model to transients; return the maximum of the posterior.

    Residuals are weighted by the noise of the pressure sensor; the covariance uses the residuals themselves, so that
    coloured residuals do not feign precision. (Weights from the residuals would let the curves drift from the data:
    model error looks like slow noise.) Each update refits and sets each group of corrections to the prior width that
    the data support. Corrections that the data do not need shrink to nothing; without data the map follows the model,
    with the width that the rest of the map shows. Every parameter has a prior, so no matrix is singular.

    Args:
        area_model: The area model; the search starts without corrections.
        data: The transients.
        sensor: Noise of the pressure sensor.

    Returns:
        Parameters, covariance and fitted pressures.

    References:
        MacKay, D. J. C., Neural Computation 4 (1992) 415 (evidence update of prior widths).

    """
    groups, widths = area_model.prior_groups(), dict(INITIAL_PRIOR_WIDTHS)
    order = min(AR_ORDER, int(data.lengths.max()) // 2)  # a filter as long as the stretches would see none of them
    whitening, noise = whitening_filter(
        averaged_noise_autocovariance(sensor, int(np.median(data.averaged_readings)), order + 1)
    )
    theta, start = area_model.initial_theta(), initial_pressures(data)
    for _ in range(EVIDENCE_ITERATIONS):
        problem = TransientProblem(area_model, data, whitening, noise, _prior_matrix(area_model, widths), start)
        solution = minimise(
            problem.residuals,
            problem.normal_equations,
            theta,
            _bounds(area_model),
            max_iterations=SEARCH_ITERATIONS,
            tolerance=TOLERANCE,
        )
        theta, previous = solution.z, dict(widths)
        start = problem.improved_initial_pressures(theta)
        variance = np.diag(_inverse(solution.jacobian))
        for name, members in groups.items():
            determined_count = members.size - np.sum(variance[members]) / widths[name] ** 2
            width = float(np.sqrt(np.sum(theta[members] ** 2) / max(determined_count, 1e-2)))
            widths[name] = float(np.clip(width, MIN_PRIOR_WIDTHS[name], MAX_PRIOR_WIDTHS[name]))
        if all(abs(np.log(widths[name] / previous[name])) < WIDTH_TOLERANCE for name in widths):
            break
    simulated = simulate_transients(area_model, theta, start, data)
    whitening, noise = whitening_filter(autocovariances(simulated - data.p, data.valid))
    final_problem = TransientProblem(area_model, data, whitening, noise, _prior_matrix(area_model, widths), start)
    return Posterior(theta, _inverse(final_problem.normal_equations(theta)), simulated)


def _prior_matrix(area_model: AreaModel, widths: dict[str, float]) -> Array:
    prior, model_size = np.zeros((area_model.size, area_model.size)), len(area_model.model_gradient.free)
    prior[:model_size, :model_size] = area_model.model_gradient.prior_whitening
    for name, members in area_model.prior_groups().items():
        prior[members, members] = 1 / widths[name]
    return prior


def _inverse(equations: NormalEquations) -> Array:
    """Return the inverse of the curvature (k, k), which the prior keeps from being singular."""
    return np.asarray(np.linalg.pinv(equations.curvature, hermitian=True))


def _bounds(area_model: AreaModel) -> tuple[Array, Array]:
    lower, upper = np.full(area_model.size, -np.inf), np.full(area_model.size, np.inf)
    of_model = slice(len(area_model.model_gradient.free))
    lower[of_model], upper[of_model] = area_model.model_gradient.bounds
    return lower, upper


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


def autocovariances(residual: Array, valid: Mask) -> Array:
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
