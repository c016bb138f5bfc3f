"""Fits of friction laws to the equation of motion, robust, with intervals that allow for correlated residuals."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.estimation.blocks import group_scores
from pneucli.identify.estimation.least_squares import minimise
from pneucli.identify.friction.samples import IntervalEstimate, MovingSamples
from pneucli.physics.vectorised import stribeck_friction
from pneucli.quantities import Z95

Array = NDArray[np.float64]
Residual = Callable[[Array], Array]

HUBER_THRESHOLD = 1.345  # robust standard deviations: 95 % efficient for normal residuals
VELOCITY_GRID_POINTS = 24
MAX_ITERATIONS, TOLERANCE = 50, 1e-10
UNITS = {"coulomb": "N", "viscous": "N s/m", "static": "N", "velocity": "m/s", "offset": "N", "mass": "kg"}


@dataclass(frozen=True)
class FrictionFit:
    """A fitted law: values by name, their covariance in the names' order, and the residuals' robust deviation (N)."""

    names: tuple[str, ...]
    theta: Array
    covariance: Array
    deviation: float

    def __getitem__(self, name: str) -> float:
        return float(self.theta[self.names.index(name)]) if name in self.names else 0.0

    def values(self) -> dict[str, IntervalEstimate]:
        """Return every parameter with its interval; forces and masses are kept from leaving their range."""
        half = Z95 * np.sqrt(np.diag(self.covariance))
        out = {}
        for name, value, h in zip(self.names, self.theta, half, strict=True):
            low = value - h if name == "offset" else max(0.0, value - h)
            out[name] = IntervalEstimate(float(value), float(low), float(value + h), UNITS[name])
        return out


def velocity_friction(v: Array, p: Mapping[str, float] | FrictionFit) -> Array:
    """Return Stribeck friction (3.6) in N without the offset; without ``velocity``, Coulomb and viscous friction."""
    curved = p["velocity"] > 0
    return stribeck_friction(
        v, p["coulomb"], p["viscous"], p["static" if curved else "coulomb"], p["velocity"] if curved else np.inf
    )


def fit_coulomb(samples: MovingSamples, *, offset: bool, mass: bool = False) -> FrictionFit:
    """Fit drive = mass a + coulomb sign v + viscous v + offset (3.4); the mass only where it is asked for."""
    s = samples
    columns = {"coulomb": np.sign(s.v), "viscous": s.v}
    if offset:
        columns["offset"] = np.ones(len(s))
    if mass:
        columns["mass"] = s.a
    design = np.column_stack(list(columns.values())) / s.sigma[:, None]
    target = (s.drive if mass else s.friction) / s.sigma
    low = np.array([-np.inf if name == "offset" else 0.0 for name in columns])
    start = np.asarray(np.linalg.lstsq(design, target)[0], dtype=np.float64)
    return _refine(tuple(columns), lambda p: design @ p - target, start, low, s)


def fit_stribeck(samples: MovingSamples, *, offset: bool) -> FrictionFit:
    """Fit Stribeck friction (3.6); return Coulomb and viscous friction where a fall with velocity is not there.

    The fall is kept where twice the gain in likelihood, divided by the residuals' correlation (long-run over sample
    variance), exceeds twice the Schwarz penalty of its two parameters, and where static friction less Coulomb
    friction is more than three standard errors.
    """
    s = samples
    plain = fit_coulomb(s, offset=offset)
    names = ("coulomb", "viscous", "static", "velocity") + (("offset",) if offset else ())
    start = _stribeck_start(s, offset=offset)
    if start is None:
        return plain
    speed = np.abs(s.v)

    def residual(p: Array) -> Array:
        model = velocity_friction(s.v, dict(zip(names, p, strict=True)))
        return np.asarray((model + (p[4] if offset else 0.0) - s.friction) / s.sigma)

    low = np.array([0.0, 0.0, 0.0, 0.5 * speed.min(), -np.inf][: len(names)])
    curved = _refine(names, residual, start, low, s)
    gain = _huber_loss(scaled_residual(plain, s), curved.deviation) - _huber_loss(
        residual(curved.theta), curved.deviation
    )
    inflation = _correlation_inflation(residual(curved.theta), s.block)
    return curved if _has_stribeck_effect(curved) and 2 * gain / inflation > 4 * np.log(len(s)) else plain


def _has_stribeck_effect(fit: FrictionFit) -> bool:
    """Whether static friction lies above Coulomb friction by more than three standard errors."""
    contrast = np.array([{"static": 1.0, "coulomb": -1.0}.get(name, 0.0) for name in fit.names])
    return bool(contrast @ fit.theta > 3.0 * np.sqrt(contrast @ fit.covariance @ contrast))


def scaled_residual(fit: FrictionFit, s: MovingSamples) -> Array:
    """Return what a fit leaves of the friction force, in standard deviations, shape (n,)."""
    return np.asarray((velocity_friction(s.v, fit) + fit["offset"] - s.friction) / s.sigma)


def _stribeck_start(s: MovingSamples, *, offset: bool) -> Array | None:
    """Return the best of a search over the Stribeck velocity, the other parameters by linear least squares."""
    speed, target = np.abs(s.v), s.friction / s.sigma
    best: tuple[float, Array | None] = (np.inf, None)
    for velocity in np.geomspace(max(speed.min(), 1e-3 * speed.max()), 0.5 * speed.max(), VELOCITY_GRID_POINTS):
        shape = {"coulomb": 0.0, "viscous": 0.0, "static": 0.0, "velocity": velocity}
        laws = [velocity_friction(s.v, {**shape, name: 1.0}) for name in ("coulomb", "viscous", "static")]
        design = np.column_stack([*laws, *[np.ones(len(s))] * offset]) / s.sigma[:, None]
        found = np.linalg.lstsq(design, target)[0]
        cost = float(np.sum((design @ found - target) ** 2))
        if cost < best[0] and found[2] > found[0] > 0.0:
            best = (cost, np.array([*found[:3], velocity, *found[3:]]))
    return best[1]


def _refine(names: tuple[str, ...], residual: Residual, start: Array, low: Array, s: MovingSamples) -> FrictionFit:
    """Polish with Huber's loss; covariance by the sandwich over blocks (Liang and Zeger, Biometrika 73 (1986))."""
    theta, scale = start, _robust_scale(residual(start))
    for _ in range(2):  # the scale belongs to the fit that it scales
        theta = _minimise_huber_loss(residual, theta, low, HUBER_THRESHOLD * scale)
        scale = _robust_scale(residual(theta))
    r = residual(theta)
    jacobian = _jacobian(residual, theta)
    inside = np.abs(r) <= HUBER_THRESHOLD * scale
    clipped = np.clip(r, -HUBER_THRESHOLD * scale, HUBER_THRESHOLD * scale)
    _, block = np.unique(s.block, return_inverse=True)
    sums = group_scores(jacobian, clipped, block)
    bread = np.linalg.pinv((jacobian * inside[:, None]).T @ jacobian)
    few = len(sums) / max(len(sums) - theta.size, 1)
    return FrictionFit(names, theta, few * bread @ (sums.T @ sums) @ bread, float(scale))


def _minimise_huber_loss(residual: Residual, start: Array, low: Array, knee: float) -> Array:
    """Return the parameters of least loss: residuals beyond the ``knee`` count by the root of their loss."""

    def tempered(p: Array) -> Array:
        r = residual(p)
        return np.sign(r) * np.sqrt(np.where(np.abs(r) <= knee, r**2, knee * (2.0 * np.abs(r) - knee)))

    def slopes(p: Array) -> Array:
        r = residual(p)
        beyond = np.maximum(np.abs(r), knee)
        return np.asarray(np.sqrt(knee / (2.0 * beyond - knee))[:, None] * _jacobian(residual, p))

    bounds = (low, np.full(low.size, np.inf))
    return minimise(tempered, slopes, start, bounds, max_iterations=MAX_ITERATIONS, tolerance=TOLERANCE).z


def _jacobian(residual: Residual, theta: Array) -> Array:
    """Return the derivatives by central differences; but for the Stribeck velocity the laws are linear."""
    steps = 1e-5 * np.where(theta == 0.0, 1.0, np.abs(theta))
    columns = [
        (residual(theta + d) - residual(theta - d)) / (2 * h) for h, d in zip(steps, np.diag(steps), strict=True)
    ]
    return np.column_stack(columns)


def _robust_scale(r: Array) -> float:
    return max(1.4826 * float(np.median(np.abs(r))), 1e-9)


def _huber_loss(r: Array, scale: float) -> float:
    """Return Huber's loss of residuals in units of ``scale``: minus the log likelihood, but for a constant."""
    z = np.abs(r) / scale
    return float(np.sum(np.where(z <= HUBER_THRESHOLD, 0.5 * z**2, HUBER_THRESHOLD * z - 0.5 * HUBER_THRESHOLD**2)))


def _correlation_inflation(r: Array, block: NDArray[np.int64]) -> float:
    """Return the residuals' long-run variance over their variance, at least 1."""
    clipped = np.clip(r, -3 * _robust_scale(r), 3 * _robust_scale(r))
    _, index, count = np.unique(block, return_inverse=True, return_counts=True)
    sums = np.bincount(index, weights=clipped - clipped.mean())
    return max(1.0, float(np.mean(sums**2) / (np.mean(count) * np.var(clipped))))
