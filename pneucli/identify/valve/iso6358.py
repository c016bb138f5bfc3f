"""ISO 6358-1: sonic conductance, critical ratio and subsonic index for each command, of the model's own valve.

C follows from the effective area and the choked flow function; b is the model's critical ratio and m = 0.5, since the
flow function of the model is an ellipse. The measured gradients of a command show b and m too: they set the interval
where the model assumes them, and widen it where they contradict the model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import cast

import numpy as np

from pneucli.arrays import Array
from pneucli.figure import Figure
from pneucli.identify.estimation.fit import Estimate, Fit
from pneucli.identify.estimation.least_squares import minimise
from pneucli.identify.valve.lack_of_fit import LackOfFit
from pneucli.identify.valve.model_gradient import REPEATABILITY, ModelGradient
from pneucli.physics.gas import PSI_MAX, flow_constant
from pneucli.physics.iso_flow import REFERENCE_DENSITY, REFERENCE_TEMPERATURE
from pneucli.quantities import Z95
from pneucli.simulate.model import Model

Interval = tuple[float, float]
ELLIPSE_SUBSONIC_INDEX = 0.5  # m of an ellipse
SAME_COMMAND = 1e-3  # of a command: the distance to one that was held
MIN_SHARE_OF_CURVE = 0.25  # of the pressures from ambient to supply, that a curve must have seen
TYPICAL_B_M = np.array([0.35, 0.5])  # b and m of industrial valves: the prior where a curve does not determine them
TYPICAL_B_M_SPREAD = np.array([0.2, 0.1])  # standard deviations of that prior
ELLIPSE_BOUNDS = (np.array([-np.inf, 0.02, 0.2]), np.array([np.inf, 0.9, 1.5]))
MAX_ERROR_RATIO = 0.5  # of that prior: a larger standard error means that the curve does not determine b or m


@dataclass(frozen=True)
class Characteristic(Figure):
    """A characteristic; ``measured`` is that of the measured gradients: value, low, high.

    ``parts`` are the standard uncertainties of the latter: of its noise, and of the thermal state.
    """

    measured: tuple[float, float, float] | None = None
    parts: tuple[float, float] | None = None

    @property
    def is_contradicted(self) -> bool:
        """Whether the measured gradients exclude the value."""
        return self.measured is not None and not self.measured[1] <= self.value <= self.measured[2]


@dataclass(frozen=True)
class IsoConductance:
    """ISO 6358-1 characteristics of one flow path at command ``u`` (V).

    ``C`` in m^3/(s Pa) at the reference atmosphere, ``b`` and ``m`` dimensionless;
    q = C p_u rho_0 sqrt(T_0 / T) (1 - ((r - b) / (1 - b))^2)^m for r > b. Without heat transfer in the model, a vessel
    cannot distinguish adiabatic gas with conductance C from isothermal gas with kappa C. The interval of C is that of
    the curves' scatter; :mod:`pneucli.identify.valve.charge_budget` adds the thermal state and the instruments.
    """

    u: float
    C: Characteristic
    b: Characteristic
    m: Characteristic


def iso_conductances(gradient: ModelGradient, fitted: Fit, lack: LackOfFit | None) -> tuple[IsoConductance, ...]:
    """Compute C, b and m at each command at which the model knows the valve's area.

    Args:
        gradient: The gradient of the fitted model.
        fitted: The fit of the model.
        lack: The measured gradients of a vessel, None without one.

    Returns:
        The characteristics, one entry a command.

    References:
        ISO 6358-1:2013, pneumatic fluid power, determination of flow-rate characteristics.

    """
    rig, model = fitted.model.rig, fitted.model
    choked_flux = flow_constant(rig.gas_constant, REFERENCE_TEMPERATURE, rig.heat_capacity_ratio)
    unit = PSI_MAX * choked_flux / REFERENCE_DENSITY
    index_ratio = 1.0 if thermal_state_is_known(model) else rig.heat_capacity_ratio
    estimates = {e.name: e for e in fitted.estimates}
    b, interval = _critical_ratio(model, estimates)
    out = []
    for u, name in gradient.valve.area_names.items():
        if not (area := estimates.get(name)):
            continue
        c = Characteristic(unit * area.value, unit * area.ci95[0], unit * area.ci95[1])
        measured = None if lack is None else _measured_b_m(gradient, lack, u, index_ratio)
        b_and_m = measured or (None, None)
        out.append(
            IsoConductance(
                u,
                c,
                _characteristic(b, interval, 0, b_and_m[0]),
                _characteristic(ELLIPSE_SUBSONIC_INDEX, None, 1, b_and_m[1]),
            )
        )
    return tuple(out)


def thermal_state_is_known(model: Model) -> bool:
    """Return whether the model says how the gas exchanges heat: by its heat transfer, or by a polytropic exponent."""
    rig = model.rig
    stated = rig.exponent_free or rig.polytropic_exponent is not None
    return stated or any("heat" in effect.ports for effect in model.effects)


def _critical_ratio(model: Model, estimates: Mapping[str, Estimate]) -> tuple[float, Interval | None]:
    """Return the model's critical ratio, and its interval where an effect of the model has identified it."""
    b, interval = model.base_values()["valve.critical_ratio"], None
    for effect in model.effects:
        if port := effect.ports.get("critical_ratio"):
            intervals = [
                estimates[name].ci95 for p in effect.parameters if (name := f"{effect.name}.{p.name}") in estimates
            ]
            corner_values = [cast("float", port(b, *values)) for values in product(*intervals)] if intervals else []
            b = cast("float", port(b, *model.effect_parameters(effect)))
            interval = (min(corner_values), max(corner_values)) if corner_values else None
    return b, interval


def _characteristic(
    value: float, model_interval: Interval | None, index: int, curve: tuple[float, ...] | None
) -> Characteristic:
    """Return a characteristic with the model's interval, or with that of measured gradients where the model has none.

    ``curve`` are value, low and high of the measured gradients, and where known the two parts of its uncertainty.
    """
    low, high = model_interval or (value, value)
    measured = None if curve is None else (curve[0], curve[1], curve[2])
    parts = None if curve is None or len(curve) < 5 else (curve[3], curve[4])
    characteristic = Characteristic(value, low, high, measured=measured, parts=parts)
    if model_interval is not None and not characteristic.is_contradicted:
        return characteristic
    typical = (
        float(TYPICAL_B_M[index] - Z95 * TYPICAL_B_M_SPREAD[index]),
        float(TYPICAL_B_M[index] + Z95 * TYPICAL_B_M_SPREAD[index]),
    )
    interval = typical if measured is None else measured[1:]
    return replace(characteristic, low=min(low, max(interval[0], 0.0)), high=max(high, interval[1]))


def _measured_b_m(
    gradient: ModelGradient, lack: LackOfFit, u: float, index_ratio: float
) -> list[tuple[float, ...] | None] | None:
    """Return b and m of the measured gradients at a command; None where they do not determine them.

    Each is value, low, high, and the standard uncertainties of noise and thermal state.

    The polytropic index n of dp/dt = n R T q / V lies between 1 and kappa unless the model includes heat transfer. The
    standard error therefore includes the change of b and m by a drift of the gradient by ``index_ratio`` over the
    curve, as a uniform distribution (divided by sqrt(3)).
    """
    row = int(np.argmin(np.abs(lack.u[:, 0] - u)))
    seen = lack.covered[row]
    if abs(lack.u[row, 0] - u) > SAME_COMMAND * abs(u) or np.mean(seen) < MIN_SHARE_OF_CURVE:
        return None
    p, value = lack.p[row, seen], lack.measured[row, seen]
    scale = float(np.abs(value).max())
    if not scale > 0.0:
        return None
    error = np.hypot(lack.half_interval[row, seen] / Z95, REPEATABILITY * scale) / scale
    upstream, r = (gradient.supply, p / gradient.supply) if u > 0 else (p, gradient.ambient / p)
    per_pressure = gradient.supply / upstream
    shape, weight = np.abs(value) / scale * per_pressure, 1.0 / error
    steady = _fit_ellipse(shape, r, weight)
    drift = np.linspace(1.0, 1.0 / index_ratio, p.size)[:: 1 if u > 0 else -1]
    drifted = _fit_ellipse(shape / drift, r, weight)
    noise = np.sqrt(np.diag(steady[1]))[1:]
    thermal = np.abs(drifted[0] - steady[0])[1:] / np.sqrt(3)
    interval = []
    for value_, n, h in zip(steady[0][1:].tolist(), noise.tolist(), thermal.tolist(), strict=True):
        half = Z95 * float(np.hypot(n, h))
        interval.append((value_, value_ - half, value_ + half, n, h))
    return [
        end if is_determined else None
        for end, is_determined in zip(interval, noise < MAX_ERROR_RATIO * TYPICAL_B_M_SPREAD, strict=True)
    ]


def _fit_ellipse(shape: Array, r: Array, weight: Array) -> tuple[Array, Array]:
    """Return log C, b, m of an elliptic flow function over pressure ratios r (k,), and their covariance; all (k,)."""

    def residuals(x: Array) -> Array:
        s = np.maximum(np.minimum(r, 1.0 - 1e-6) - x[1], 0.0) / (1.0 - x[1])
        error = np.exp(x[0]) * (1.0 - s * s) ** x[2] - shape
        return np.concatenate([weight * error, (x[1:] - TYPICAL_B_M) / TYPICAL_B_M_SPREAD])

    def jacobian(x: Array) -> Array:
        return np.array([(residuals(x + d) - residuals(x - d)) / 2e-4 for d in 1e-4 * np.eye(3)]).T

    start = np.array([np.log(shape.max()), *TYPICAL_B_M])
    fitted = minimise(residuals, jacobian, start, ELLIPSE_BOUNDS, max_iterations=40, tolerance=1e-6)
    return fitted.z, np.asarray(np.linalg.pinv(fitted.jacobian.T @ fitted.jacobian, hermitian=True))
