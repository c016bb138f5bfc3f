"""Sonic conductance, critical ratio and subsonic index per command (ISO 6358-1), with what a vessel cannot know."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from pneucli.identify.valve.fit import Fit
from pneucli.identify.valve.law import LAMINAR, Law
from pneucli.identify.valve.stretches import Stretches
from pneucli.recording import Rig

Array = NDArray[np.float64]

REFERENCE_DENSITY = 1.185  # kg/m^3, ISO 8778 (293.15 K, 100 kPa, 65 % humidity)
REFERENCE_TEMPERATURE = 293.15  # K
MEAN_SPAN = 0.01  # s over which samples are averaged before the fit
USUAL = np.array([0.35, 0.5])  # b and m of industrial valves, with spreads, where a curve stays silent on them
SPREAD = np.array([0.2, 0.1])
ANY = 5.0  # of log C: where nothing flows the data do not say, and the interval should
LOWEST, HIGHEST = (0.02, 0.2), (0.9, 1.5)


@dataclass(frozen=True)
class Estimate:
    """A value and its standard uncertainty: ``statistical`` (noise) and in all (with the gas's unknown state)."""

    value: float
    statistical: float
    uncertainty: float


@dataclass(frozen=True)
class IsoConductance:
    """ISO 6358-1 characteristics of one flow path at command ``u`` (V).

    ``C`` in m^3/(s Pa) at the reference atmosphere, ``b`` and ``m`` dimensionless;
    q = C p_u rho_0 sqrt(T_0 / T) (1 - ((r - b) / (1 - b))^2)^m for r > b. ``C`` holds for the base model's isentropic
    vessel; a vessel that keeps its gas at the wall's temperature passes kappa times that flow at the same gradient.
    """

    u: float
    C: Estimate
    b: Estimate
    m: Estimate


def iso_conductance(law: Law, fit: Fit, data: Stretches, rig: Rig) -> tuple[IsoConductance, ...]:
    """Return C, b, m of each command that was held long enough, from its longest stretch.

    What the vessel cannot know: the polytropic index n of dp/dt = n R T q / V lies anywhere from 1 to kappa. C takes
    the rms deviation of kappa / n for n uniform there; b and m the change that a drift of n from kappa to 1 over the
    stretch makes, divided by sqrt(3).
    """
    found = []
    for direction in law.directions:
        for node in direction.nodes:
            u = float(direction.sign * node)
            held = np.where(data.u[0] == u, data.valid.sum(axis=0), 0)
            k = int(np.argmax(held))
            if held[k] * data.period[k] >= 0.2:
                found.append(_one_command(_Path(law, fit, data, rig, k)))
    return tuple(found)


class _Path:
    """One stretch, averaged over short spans, and its simulation by the ISO law."""

    def __init__(self, law: Law, fit: Fit, data: Stretches, rig: Rig, k: int) -> None:
        span = max(1, round(MEAN_SPAN / data.period[k]))
        blocks = int(data.valid[:, k].sum()) // span
        residual = (data.p - fit.simulated)[: blocks * span, k].reshape(blocks, span)
        self.p = data.p[: blocks * span, k].reshape(blocks, span).mean(axis=1)
        self.noise = float(residual.mean(axis=1).std() + 1e-9) * _inflation(residual.mean(axis=1))
        self.h = span * float(data.period[k])
        self.u, self.supply, self.ambient = float(data.u[0, k]), float(np.mean(data.supply[:, k])), law.ambient
        self.kappa = rig.heat_capacity_ratio
        gas = self.kappa * rig.gas_constant * rig.gas_temperature / (rig.vessel_volume or 1.0)
        self.gain = float(gas * REFERENCE_DENSITY * np.sqrt(REFERENCE_TEMPERATURE / rig.gas_temperature))

    def simulate(self, c: float, b: float, m: float, start: float, drift: bool) -> Array:
        """Return the averaged pressures (Pa); with ``drift`` the polytropic index falls from kappa to 1."""
        p, out = start, np.empty(self.p.size)
        for k in range(self.p.size):
            out[k] = p
            index = 1 - drift * (1 - 1 / self.kappa) * k / self.p.size
            for _ in range(2):
                half = p + 0.25 * self.h * index * self._slope(c, b, m, p)
                p += 0.5 * self.h * index * self._slope(c, b, m, half)
        return out

    def _slope(self, c: float, b: float, m: float, p: float) -> float:
        other, sign = (self.supply, 1.0) if self.u > 0 else (self.ambient, -1.0)
        upstream, r = (other, p / other) if self.u > 0 else (p, other / p)
        s = max(0.0, min(r, 1 - LAMINAR) - b) / (1 - b)
        return float(sign * self.gain * c * upstream * (1 - s * s) ** m * min(1.0, (1 - r) / LAMINAR))

    def fit(self, drift: bool) -> tuple[Array, Array]:
        """Return log C, b, m, start pressure, and their covariance."""
        scale = abs(self.p[-1] - self.p[0]) / (self.gain * self.p.size * self.h * max(self.supply, 1.0))
        guess = np.array([np.log(max(scale, 1e-15) * 2), *USUAL, self.p[0]])

        def residuals(x: Array) -> Array:
            c, b, m, start = float(np.exp(x[0])), float(x[1]), float(x[2]), float(x[3])
            error = (self.simulate(c, b, m, start, drift) - self.p) / self.noise
            return np.concatenate([error, (x[1:3] - USUAL) / SPREAD, (x[:1] - guess[0]) / ANY])

        bounds = ([-40, *LOWEST, 0], [0, *HIGHEST, np.inf])
        found = least_squares(residuals, guess, bounds=bounds, x_scale=[0.1, 0.1, 0.1, 1e3], max_nfev=40)
        jacobian = np.asarray(found.jac, dtype=np.float64)
        return found.x, np.asarray(np.linalg.inv(jacobian.T @ jacobian), dtype=np.float64)


def _inflation(residual: Array) -> float:
    """Return the square root of the factor by which correlation thins out the samples (first lag, AR(1))."""
    lag = float(np.clip(np.corrcoef(residual[:-1], residual[1:])[0, 1], 0.0, 0.9))
    return float(np.sqrt((1 + lag) / (1 - lag)))


def _one_command(path: _Path) -> IsoConductance:
    x, covariance = path.fit(drift=False)
    drifted = path.fit(drift=True)[0]
    error = np.sqrt(np.diag(covariance))
    n = np.linspace(1, path.kappa, 101)
    unknown_gas = float(np.sqrt(np.mean((path.kappa / n - 1) ** 2)))
    c = float(np.exp(x[0]))
    shift = np.abs(drifted - x) / np.sqrt(3)
    b, m = (Estimate(float(x[k]), float(error[k]), float(np.hypot(error[k], shift[k]))) for k in (1, 2))
    return IsoConductance(path.u, Estimate(c, c * float(error[0]), c * float(np.hypot(error[0], unknown_gas))), b, m)
