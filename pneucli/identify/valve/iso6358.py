"""ISO 6358-1: sonic conductance, critical ratio and subsonic index for each command, of the model's own valve.

C follows from the effective area and the choked flow function; b is the model's critical ratio and m = 0.5, since the
flow function of the model is an ellipse. Where the model assumes b or m, its interval is what industrial valves have.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import cast

import numpy as np

from pneucli.figure import Figure
from pneucli.identify.estimation.fit import Estimate, Fit
from pneucli.physics.gas import PSI_MAX, flow_constant
from pneucli.physics.iso_flow import REFERENCE_DENSITY, REFERENCE_TEMPERATURE
from pneucli.quantities import Z95
from pneucli.simulate.model import Model, ValveForm

Interval = tuple[float, float]
ELLIPSE_SUBSONIC_INDEX = 0.5  # m of an ellipse
TYPICAL_B_M = np.array([0.35, 0.5])  # b and m of industrial valves: the prior where data do not determine them
TYPICAL_B_M_SPREAD = np.array([0.2, 0.1])  # standard deviations of that prior


@dataclass(frozen=True)
class IsoConductance:
    """ISO 6358-1 characteristics of one flow path at command ``u`` (V).

    ``C`` in m^3/(s Pa) at the reference atmosphere, ``b`` and ``m`` dimensionless;
    q = C p_u rho_0 sqrt(T_0 / T) (1 - ((r - b) / (1 - b))^2)^m for r > b. Without heat transfer in the model, a vessel
    cannot distinguish adiabatic gas with conductance C from isothermal gas with kappa C. The interval of C is that of
    the curves' scatter; :mod:`pneucli.identify.valve.charge_budget` adds the thermal state and the instruments.
    """

    u: float
    C: Figure
    b: Figure
    m: Figure


def iso_conductances(valve: ValveForm, fitted: Fit) -> tuple[IsoConductance, ...]:
    """Compute C, b and m at each command at which the model knows the valve's area.

    Args:
        valve: The paths of the model.
        fitted: The fit of the model.

    Returns:
        The characteristics, one entry a command.

    References:
        ISO 6358-1:2013, pneumatic fluid power, determination of flow-rate characteristics.

    """
    rig, estimates = fitted.model.rig, {e.name: e for e in fitted.estimates}
    choked_flux = flow_constant(rig.gas_constant, REFERENCE_TEMPERATURE, rig.heat_capacity_ratio)
    unit = PSI_MAX * choked_flux / REFERENCE_DENSITY
    b, interval = _critical_ratio(fitted.model, estimates)
    shape = _figure(b, interval, 0), _figure(ELLIPSE_SUBSONIC_INDEX, None, 1)
    areas = {u: estimates[name] for u, name in valve.area_names.items() if name in estimates}
    return tuple(
        IsoConductance(u, Figure(unit * area.value, unit * area.ci95[0], unit * area.ci95[1], "m^3/(s Pa)"), *shape)
        for u, area in areas.items()
    )


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


def _figure(value: float, interval: Interval | None, index: int) -> Figure:
    """Return b or m (index 0 or 1) with the model's interval, or else with that of typical valves and the value."""
    spread = Z95 * float(TYPICAL_B_M_SPREAD[index])
    typical = float(TYPICAL_B_M[index])
    low, high = interval or (min(value, max(typical - spread, 0.0)), max(value, typical + spread))
    return Figure(value, low, high, "1")
