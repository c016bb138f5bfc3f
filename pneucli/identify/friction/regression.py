"""Robust fits of friction models to the equation of motion, with intervals that allow for correlated residuals.

Source: P. J. Huber, Ann. Math. Stat. 35 (1964) 73-101; docs/friction-identification.md.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array, Integers
from pneucli.figure import Figure
from pneucli.identify.estimation.blocks import group_scores
from pneucli.identify.estimation.least_squares import minimise
from pneucli.identify.friction.samples import MovingSamples
from pneucli.identify.guesses.direct_friction import search_stribeck
from pneucli.noise import NORMAL_MAD
from pneucli.physics.vectorised import stribeck_friction
from pneucli.quantities import Z95

Residual = Callable[[Array], Array]
HUBER_THRESHOLD = 1.345  # robust standard deviations: 95 % efficient for normal residuals
MAX_ITERATIONS, TOLERANCE = 50, 1e-10
UNITS = {"coulomb": "N", "viscous": "N s/m", "static": "N", "velocity": "m/s", "offset": "N", "mass": "kg"}


@dataclass(frozen=True)
class FrictionFit:
    """A fitted friction model: values by name, their covariance in that order, and the residuals' robust deviation."""

    names: tuple[str, ...]
    theta: Array
    covariance: Array
    deviation: float

    def __getitem__(self, name: str) -> float:
        return float(self.theta[self.names.index(name)]) if name in self.names else 0.0

    def values(self) -> dict[str, Figure]:
        """Return each parameter with its 95 % interval; the interval of a force or mass is cut at zero."""
        half_width = Z95 * np.sqrt(np.diag(self.covariance))
        out = {}
        for name, value, h in zip(self.names, self.theta, half_width, strict=True):
            lower = value - h if name == "offset" else max(0.0, value - h)
            out[name] = Figure(float(value), float(lower), float(value + h), UNITS[name])
        return out


def velocity_friction(v: Array, p: Mapping[str, float] | FrictionFit) -> Array:
    """Evaluate Stribeck friction without the offset; without a Stribeck velocity, Coulomb and viscous friction.

    Args:
        v: Velocity in m/s.
        p: ``coulomb``, ``viscous``, ``static``, ``velocity`` in N, N s/m, N, m/s.

    Returns:
        The friction in N, of the shape of ``v``.

    References:
        Thesis, equation 3.6.

    >>> values = {"coulomb": 10.0, "viscous": 20.0, "static": 10.0, "velocity": 0.0}
    >>> velocity_friction(np.array([-0.1]), values).tolist()
    [-12.0]

    """
    has_peak = p["velocity"] > 0
    return stribeck_friction(
        v, p["coulomb"], p["viscous"], p["static" if has_peak else "coulomb"], p["velocity"] if has_peak else np.inf
    )


def fit_coulomb(samples: MovingSamples, *, offset: bool, mass: bool = False) -> FrictionFit:
    """Fit drive = mass a + coulomb sign v + viscous v + offset.

    Args:
        samples: The moving samples.
        offset: Whether a constant force is fitted too.
        mass: Whether the moving mass is fitted too.

    Returns:
        The fit.

    References:
        Thesis, equation 3.4.

    """
    s = samples
    columns = {"coulomb": np.sign(s.v), "viscous": s.v}
    if offset:
        columns["offset"] = np.ones(len(s))
    if mass:
        columns["mass"] = s.a
    design = np.column_stack(list(columns.values())) / s.sigma[:, None]
    target = (s.drive if mass else s.friction) / s.sigma
    lower = np.array([-np.inf if name == "offset" else 0.0 for name in columns])
    start = np.asarray(np.linalg.lstsq(design, target)[0], dtype=np.float64)
    return _refine(tuple(columns), lambda p: design @ p - target, start, lower, s)


def fit_stribeck(samples: MovingSamples, *, offset: bool) -> FrictionFit:
    """Fit Stribeck friction, or Coulomb and viscous friction where friction does not fall with velocity.

    The Stribeck effect is kept where twice the gain in likelihood, divided by the residuals' correlation (long-run over
    sample variance), exceeds twice the Schwarz penalty of its two parameters, and where static friction exceeds Coulomb
    friction by more than three standard errors.

    Args:
        samples: The moving samples.
        offset: Whether a constant force is fitted too.

    Returns:
        The fit.

    References:
        Thesis, equation 3.6.
        Schwarz, G., Ann. Statist. 6 (1978) 461.

    """
    s = samples
    coulomb_fit = fit_coulomb(s, offset=offset)
    names = ("coulomb", "viscous", "static", "velocity") + (("offset",) if offset else ())
    start = search_stribeck(s.v, s.friction, s.sigma, offset=offset)
    if start is None:
        return coulomb_fit
    speed = np.abs(s.v)

    def residual(p: Array) -> Array:
        model = velocity_friction(s.v, dict(zip(names, p, strict=True)))
        return np.asarray((model + (p[4] if offset else 0.0) - s.friction) / s.sigma)

    lower = np.array([0.0, 0.0, 0.0, 0.5 * speed.min(), -np.inf][: len(names)])
    stribeck = _refine(names, residual, start, lower, s)
    remaining = residual(stribeck.theta)
    gain = _huber_loss(scaled_residual(coulomb_fit, s), stribeck.deviation) - _huber_loss(remaining, stribeck.deviation)
    inflation = _correlation_inflation(remaining, s.block)
    return stribeck if _has_stribeck_effect(stribeck) and 2 * gain / inflation > 4 * np.log(len(s)) else coulomb_fit


def _has_stribeck_effect(fit: FrictionFit) -> bool:
    """Return whether static friction exceeds Coulomb friction by more than three standard errors."""
    contrast = np.array([{"static": 1.0, "coulomb": -1.0}.get(name, 0.0) for name in fit.names])
    return bool(contrast @ fit.theta > 3.0 * np.sqrt(contrast @ fit.covariance @ contrast))


def scaled_residual(fit: FrictionFit, s: MovingSamples) -> Array:
    """Return the residual of a friction fit in standard deviations.

    Args:
        fit: The fit.
        s: The moving samples.

    Returns:
        The residual, shape (n,).

    """
    return np.asarray((velocity_friction(s.v, fit) + fit["offset"] - s.friction) / s.sigma)


def _refine(names: tuple[str, ...], residual: Residual, start: Array, lower: Array, s: MovingSamples) -> FrictionFit:
    """Minimise Huber's loss; the covariance is a sandwich over blocks (Liang and Zeger, Biometrika 73 (1986) 13)."""
    theta, scale = start, _robust_scale(residual(start))
    for _ in range(2):  # the second pass uses the scale of the first fit
        theta = _minimise_huber_loss(residual, theta, lower, HUBER_THRESHOLD * scale)
        scale = _robust_scale(residual(theta))
    r = residual(theta)
    jacobian = _jacobian(residual, theta)
    inside = np.abs(r) <= HUBER_THRESHOLD * scale
    clipped = np.clip(r, -HUBER_THRESHOLD * scale, HUBER_THRESHOLD * scale)
    _, block = np.unique(s.block, return_inverse=True)
    sums = group_scores(jacobian, clipped, block)
    inverse_hessian = np.linalg.pinv((jacobian * inside[:, None]).T @ jacobian)
    small_sample_factor = len(sums) / max(len(sums) - theta.size, 1)
    return FrictionFit(
        names, theta, small_sample_factor * inverse_hessian @ (sums.T @ sums) @ inverse_hessian, float(scale)
    )


def _minimise_huber_loss(residual: Residual, start: Array, lower: Array, knee: float) -> Array:
    """Return the minimiser of Huber's loss: a residual beyond the ``knee`` enters as the root of its loss."""

    def root_loss(p: Array) -> Array:
        r = residual(p)
        return np.sign(r) * np.sqrt(np.where(np.abs(r) <= knee, r**2, knee * (2.0 * np.abs(r) - knee)))

    def root_loss_jacobian(p: Array) -> Array:
        r = residual(p)
        magnitude = np.maximum(np.abs(r), knee)
        return np.asarray(np.sqrt(knee / (2.0 * magnitude - knee))[:, None] * _jacobian(residual, p))

    bounds = (lower, np.full(lower.size, np.inf))
    return minimise(root_loss, root_loss_jacobian, start, bounds, max_iterations=MAX_ITERATIONS, tolerance=TOLERANCE).z


def _jacobian(residual: Residual, theta: Array) -> Array:
    """Return the derivatives by central differences; the model is linear except in the Stribeck velocity."""
    steps = 1e-5 * np.where(theta == 0.0, 1.0, np.abs(theta))
    columns = [
        (residual(theta + d) - residual(theta - d)) / (2 * h) for h, d in zip(steps, np.diag(steps), strict=True)
    ]
    return np.column_stack(columns)


def _robust_scale(r: Array) -> float:
    return max(NORMAL_MAD * float(np.median(np.abs(r))), 1e-9)


def _huber_loss(r: Array, scale: float) -> float:
    """Return Huber's loss of residuals in units of ``scale``: the negative log likelihood up to a constant."""
    z = np.abs(r) / scale
    return float(np.sum(np.where(z <= HUBER_THRESHOLD, 0.5 * z**2, HUBER_THRESHOLD * z - 0.5 * HUBER_THRESHOLD**2)))


def _correlation_inflation(r: Array, block: Integers) -> float:
    """Return the residuals' long-run variance over their variance, at least 1."""
    clipped = np.clip(r, -3 * _robust_scale(r), 3 * _robust_scale(r))
    _, index, count = np.unique(block, return_inverse=True, return_counts=True)
    sums = np.bincount(index, weights=clipped - clipped.mean())
    return max(1.0, float(np.mean(sums**2) / (np.mean(count) * np.var(clipped))))
