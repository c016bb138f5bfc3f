"""ISO 6358-1: sonic conductance, critical ratio and subsonic index per command, of the model's own valve.

C follows from the effective area and the choked flow function, b is the model's critical ratio and m = 0.5, since the
model's flow function is an ellipse. What a curve itself says of b and m is read from the measured map beside them: it
sets their interval where the model assumes them, and widens it where it contradicts what the model identified.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import cast

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.estimation.fit import Estimate, Fit
from pneucli.identify.estimation.least_squares import minimise
from pneucli.identify.valve.area_model import AreaModel
from pneucli.identify.valve.fit import Posterior
from pneucli.identify.valve.maps import Z95, Coverage, gradient_with_error
from pneucli.identify.valve.model_gradient import whitening_matrix
from pneucli.physics.gas import PSI_MAX, flow_constant
from pneucli.simulate.model import Model

Array = NDArray[np.float64]
Interval = tuple[float, float]

REFERENCE_DENSITY = 1.185  # kg/m^3, ISO 8778 (293.15 K, 100 kPa, 65 % humidity)
REFERENCE_TEMPERATURE = 293.15  # K
ELLIPSE_SUBSONIC_INDEX = 0.5  # m of an ellipse
PRESSURE_POINTS = 41  # of pressure, at which the map is read
MIN_RELATIVE_ERROR = 1e-3  # of the largest gradient: more than the map may be trusted for
TYPICAL_B_M = np.array([0.35, 0.5])  # b and m of industrial valves, with spreads, where a curve stays silent on them
TYPICAL_B_M_SPREAD = np.array([0.2, 0.1])
ELLIPSE_BOUNDS = (np.array([-np.inf, 0.02, 0.2]), np.array([np.inf, 0.9, 1.5]))
MAX_ERROR_RATIO = 0.5  # of the usual spread: what is less certain, the curve does not tell


@dataclass(frozen=True)
class Characteristic:
    """A characteristic and its 95 % interval; ``measured`` is what the curve itself shows (value, low, high)."""

    value: float
    low: float
    high: float
    measured: tuple[float, float, float] | None = None

    @property
    def is_contradicted(self) -> bool:
        """Whether the curve shows another value."""
        return self.measured is not None and not self.measured[1] <= self.value <= self.measured[2]


@dataclass(frozen=True)
class IsoConductance:
    """ISO 6358-1 characteristics of one flow path at command ``u`` (V).

    ``C`` in m^3/(s Pa) at the reference atmosphere, ``b`` and ``m`` dimensionless;
    q = C p_u rho_0 sqrt(T_0 / T) (1 - ((r - b) / (1 - b))^2)^m for r > b. Unless the model has heat transfer, a vessel
    cannot tell whether its gas kept the wall's temperature, and kappa C passed: the interval of C holds both, unless
    the rig's exponent is stated or identified.
    """

    u: float
    C: Characteristic
    b: Characteristic
    m: Characteristic


def iso_conductances(
    law: AreaModel, fit: Posterior, found: Fit, covers: Coverage, tested: Sequence[float]
) -> tuple[IsoConductance, ...]:
    """Return C, b, m of each command at which the model knows the valve's area."""
    rig, model = found.model.rig, found.model
    k = flow_constant(rig.gas_constant, REFERENCE_TEMPERATURE, rig.heat_capacity_ratio)
    unit = PSI_MAX * k / REFERENCE_DENSITY
    known = rig.exponent_free or rig.polytropic_exponent is not None
    known |= any("heat" in effect.ports for effect in model.effects)
    unknown_gas = 1.0 if known else rig.heat_capacity_ratio
    estimates = {e.name: e for e in found.estimates}
    b, ends = _critical_ratio(model, estimates)
    out = []
    for u, name in law.model_gradient.valve.area_names.items():
        if not (area := estimates.get(name)):
            continue
        c = Characteristic(unit * area.value, unit * area.ci95[0], unit * area.ci95[1] * unknown_gas)
        held = any(abs(u - t) <= 1e-3 * abs(u) for t in tested)
        seen = _measured_b_m(law, fit, covers, u, unknown_gas) if held else None
        shown = seen or (None, None)
        out.append(
            IsoConductance(
                u, c, _characteristic(b, ends, 0, shown[0]), _characteristic(ELLIPSE_SUBSONIC_INDEX, None, 1, shown[1])
            )
        )
    return tuple(out)


def _critical_ratio(model: Model, estimates: Mapping[str, Estimate]) -> tuple[float, Interval | None]:
    """Return the model's critical ratio, and its interval where an effect of the model has identified it."""
    b, ends = model.base_values()["valve.critical_ratio"], None
    for effect in model.effects:
        if port := effect.ports.get("critical_ratio"):
            own = [estimates[name].ci95 for p in effect.parameters if (name := f"{effect.name}.{p.name}") in estimates]
            reached = [cast("float", port(b, *values)) for values in product(*own)] if own else []
            b = cast("float", port(b, *model.effect_parameters(effect)))
            ends = (min(reached), max(reached)) if reached else None
    return b, ends


def _characteristic(
    value: float, known: Interval | None, which: int, seen: tuple[float, float, float] | None
) -> Characteristic:
    """Return a characteristic with the model's interval, or the curve's where the model has none of its own."""
    low, high = known or (value, value)
    figure = Characteristic(value, low, high, seen)
    if known is not None and not figure.is_contradicted:
        return figure
    usual = (
        float(TYPICAL_B_M[which] - Z95 * TYPICAL_B_M_SPREAD[which]),
        float(TYPICAL_B_M[which] + Z95 * TYPICAL_B_M_SPREAD[which]),
    )
    ends = usual if seen is None else seen[1:]
    return Characteristic(value, min(low, max(ends[0], 0.0)), max(high, ends[1]), seen)


def _measured_b_m(
    law: AreaModel, fit: Posterior, covers: Coverage, u: float, unknown_gas: float
) -> list[tuple[float, float, float] | None] | None:
    """Return b and m (value, low, high) that the measured map shows at a command; None where it does not tell them.

    The polytropic index n of dp/dt = n R T q / V lies anywhere from 1 to kappa unless the model knows its heat: to the
    statistics is added the change that a drift of the gradient by ``unknown_gas`` over the curve makes, over sqrt(3).
    """
    p = np.linspace(law.ambient, law.supply, PRESSURE_POINTS)
    p = p[covers(np.full(PRESSURE_POINTS, u), p)]
    supply, at = np.full(p.size, law.supply), np.full(p.size, u)
    if p.size < PRESSURE_POINTS // 4:
        return None
    value, _ = gradient_with_error(law, fit, at, p, supply)
    rows = law.sensitivity(fit.theta, at, p, supply)
    largest = float(np.abs(value).max())
    if not largest > 0.0:
        return None
    whiten = whitening_matrix(rows @ fit.covariance @ rows.T / largest**2, MIN_RELATIVE_ERROR)
    upstream, r = (law.supply, p / law.supply) if u > 0 else (p, law.ambient / p)
    shape = np.abs(value) / largest * law.supply / upstream
    steady = _fit_ellipse(shape, r, whiten)
    drift = np.linspace(1.0, 1.0 / unknown_gas, p.size)[:: 1 if u > 0 else -1]
    drifted = _fit_ellipse(shape / drift, r, whiten)
    noise = np.sqrt(np.diag(steady[1]))[1:]
    error = np.hypot(noise, np.abs(drifted[0] - steady[0])[1:] / np.sqrt(3))
    ends = [(float(v), float(v - Z95 * e), float(v + Z95 * e)) for v, e in zip(steady[0][1:], error, strict=True)]
    return [end if told else None for end, told in zip(ends, noise < MAX_ERROR_RATIO * TYPICAL_B_M_SPREAD, strict=True)]


def _fit_ellipse(shape: Array, r: Array, whiten: Array) -> tuple[Array, Array]:
    """Return log C, b, m that fit a flow over pressure ratios r (k,), and their covariance."""

    def residuals(x: Array) -> Array:
        s = np.maximum(np.minimum(r, 1.0 - 1e-6) - x[1], 0.0) / (1.0 - x[1])
        error = np.exp(x[0]) * (1.0 - s * s) ** x[2] - shape
        return np.concatenate([whiten @ error, (x[1:] - TYPICAL_B_M) / TYPICAL_B_M_SPREAD])

    def jacobian(x: Array) -> Array:
        return np.array([(residuals(x + d) - residuals(x - d)) / 2e-4 for d in 1e-4 * np.eye(3)]).T

    start = np.array([np.log(shape.max()), *TYPICAL_B_M])
    found = minimise(residuals, jacobian, start, ELLIPSE_BOUNDS, max_iterations=40, tolerance=1e-6)
    return found.z, np.asarray(np.linalg.pinv(found.jacobian.T @ found.jacobian, hermitian=True))
