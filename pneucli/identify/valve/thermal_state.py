"""How far the thermal state of the gas may move C of a charge or discharge test.

The model's chamber is adiabatic at constant temperature (thesis 2.22). A real vessel exchanges heat with its wall, its
gas warms while it is charged, and is still warm in a discharge that follows at once. Both move the C that fits the
curve. The range follows from the balances of mass and energy of the vessel.

References:
    ISO 6358-2:2013 (charge and discharge tests).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.physics.iso_flow import REFERENCE_DENSITY, REFERENCE_TEMPERATURE

Array = NDArray[np.float64]
MAX_HEAT_TRANSFER = 100.0  # W/(m^2 K): four times the most of free convection of gases (25), for a jet that stirs
CRITICAL_RATIO = 0.528  # of the curve whose shape is compared; another one moves the range by less than 0.01
SHARE_OF_CURVE = 0.9  # of the change of pressure that is compared
POINTS = 60


@dataclass(frozen=True)
class Vessel:
    """A vessel at a valve: pressures in Pa, temperature in K, gas constant in J/(kg K), volume in m^3."""

    volume: float
    supply: float
    ambient: float
    temperature: float
    kappa: float
    gas_constant: float

    @property
    def wall(self) -> float:
        """Wall of a cube of the volume in m^2."""
        return 6.0 * math.cbrt(self.volume) ** 2

    @property
    def charged_temperature(self) -> float:
        """Temperature in K at the end of a charge from ambient pressure without heat to the wall.

        It is the balance of energy over the charge: kappa T_0 / (1 + (kappa - 1) p_ambient / p_supply).
        """
        return self.kappa * self.temperature / (1.0 + (self.kappa - 1.0) * self.ambient / self.supply)


def thermal_range(vessel: Vessel, conductance: float, *, fills: bool) -> tuple[float, float]:
    """Return by what C may have to be multiplied for heat between gas and wall.

    Args:
        vessel: The vessel.
        conductance: C in m^3/(s Pa) as the adiabatic model finds it.
        fills: Whether the path fills the vessel.

    Returns:
        Least and largest factor: over walls without heat and with the most heat, and in a discharge over gas at the
        supply's temperature and gas that a charge has warmed just before.

    A valve of 0.36 l/(s bar) charges 160 cm^3 to 7 bar nearly without heat; one of 0.004 l/(s bar) nearly isothermally:

    >>> vessel = Vessel(160e-6, 7e5, 1e5, 293.15, 1.4, 287.0)
    >>> [round(factor, 2) for factor in thermal_range(vessel, 3.6e-9, fills=True)]
    [1.0, 1.11]
    >>> [round(factor, 2) for factor in thermal_range(vessel, 4e-11, fills=True)]
    [1.0, 1.39]
    >>> [round(factor, 2) for factor in thermal_range(vessel, 3.6e-9, fills=False)]
    [0.93, 1.21]
    """
    states = [(0.0, vessel.temperature), (MAX_HEAT_TRANSFER, vessel.temperature)]
    if not fills:  # gas that a charge has warmed keeps that temperature only where the wall takes no heat
        states.append((0.0, vessel.charged_temperature))
    factors = [conductance_factor(vessel, conductance, *state, fills=fills) for state in states]
    return min(factors), max(factors)


def conductance_factor(vessel: Vessel, conductance: float, heat_transfer: float, start: float, *, fills: bool) -> float:
    """Return the true C over the one with which the adiabatic model fits the curve best.

    Args:
        vessel: The vessel.
        conductance: True C in m^3/(s Pa).
        heat_transfer: Coefficient of the wall in W/(m^2 K).
        start: Temperature of the gas at the start in K.
        fills: Whether the path fills the vessel.
    """
    from scipy.integrate import solve_ivp  # noqa: PLC0415 - slow to import, and few valve tests show heat
    from scipy.optimize import minimize_scalar  # noqa: PLC0415 - slow to import, and few valve tests show heat

    begin, end = (vessel.ambient, vessel.supply) if fills else (vessel.supply, vessel.ambient)
    unit = vessel.volume / (conductance * REFERENCE_DENSITY * vessel.gas_constant * vessel.temperature)  # s
    target = begin + SHARE_OF_CURVE * (end - begin)

    def arrived(_: float, state: Array) -> float:
        return float(state[0] - target)

    arrived.terminal = True  # type: ignore[attr-defined]
    rates = _rates(vessel, conductance, heat_transfer, fills=fills)
    true = solve_ivp(rates, (0.0, 100.0 * unit), [begin, start], "LSODA", events=arrived, dense_output=True, rtol=1e-6)
    time = np.linspace(0.0, true.t[-1], POINTS)
    assert true.sol is not None  # as dense_output asks for
    measured = true.sol(time)[0]
    model = solve_ivp(
        _rates(vessel, conductance, None, fills=fills), (0.0, 2.0 * time[-1]), [begin, vessel.temperature], "LSODA",
        t_eval=np.linspace(0.0, 2.0 * time[-1], 10 * POINTS), rtol=1e-6,
    )  # fmt: skip

    def misfit(scale: float) -> float:  # the model's pressure is a function of C t
        return float(np.sum((np.interp(scale * time, model.t, model.y[0]) - measured) ** 2))

    return 1.0 / float(minimize_scalar(misfit, bounds=(0.5, 1.5), method="bounded").x)


def _rates(
    vessel: Vessel, conductance: float, heat_transfer: float | None, *, fills: bool
) -> Callable[[float, Array], Array]:
    """Return d(p, T)/dt of the vessel; without a coefficient of heat transfer those of the adiabatic model."""
    kappa, gas, inlet = vessel.kappa, vessel.gas_constant, vessel.temperature
    unit = conductance * REFERENCE_DENSITY * math.sqrt(REFERENCE_TEMPERATURE)

    def rates(_: float, state: Array) -> Array:
        p, T = float(state[0]), float(state[1])
        if fills:
            flow, carried = unit / math.sqrt(inlet) * vessel.supply * _subsonic(p / vessel.supply), inlet
        else:
            flow, carried = -unit / math.sqrt(T) * p * _subsonic(vessel.ambient / p), T
        if heat_transfer is None:
            return np.array([kappa * gas * carried * flow / vessel.volume, 0.0])
        c_v = gas / (kappa - 1.0)
        power = kappa * c_v * carried * flow + heat_transfer * vessel.wall * (inlet - T)
        mass = p * vessel.volume / (gas * T)
        return np.array([(kappa - 1.0) * power / vessel.volume, (power - c_v * T * flow) / (mass * c_v)])

    return rates


def _subsonic(ratio: float) -> float:
    """Return the flow over its choked value."""
    return math.sqrt(max(1.0 - (max(min(ratio, 1.0) - CRITICAL_RATIO, 0.0) / (1.0 - CRITICAL_RATIO)) ** 2, 0.0))
