"""The limit of the plant that causes a violated requirement: valve, gas spring or position sensor."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from pneucli.closed_loop.simulation import Scenario
from pneucli.controller.parameters import Controller, nominal_load
from pneucli.design.air_spring import stiffness_per_pressure
from pneucli.design.reference_limits import chamber_2_pressure, reachable_speed_and_gradient
from pneucli.design.requirements import Requirements
from pneucli.physics.gas import PSI_MAX


def limiting_cause(
    demand: str, limit: float, controller: Controller, requirements: Requirements, scenarios: Sequence[Scenario]
) -> tuple[str, dict[str, float]]:
    """Return the limit of the plant that causes a violation.

    Args:
        demand: Name of the violated criterion.
        limit: Its limit in SI units.
        controller: The controller with the parameters of the axis.
        requirements: Resolution and noise of the position sensor in m.
        scenarios: The scenarios that were run.

    Returns:
        Code and quantities (SI) of the limit; ("", {}) where no limit of the plant explains the violation.
    """
    c = controller.values
    if demand == "settling_time":
        distance, shortest = _longest_step(scenarios), min_travel_time(c, _longest_step(scenarios))
        if limit < shortest:
            return "travel-time", {"distance": distance, "time": shortest}
    if demand == "tracking_error":
        asked, speed = max(_fastest(s, c["C_PERIOD"]) for s in scenarios), reachable_speed_and_gradient(c)[0]
        if asked > speed:
            return "speed", {"asked": asked, "reachable": speed}
    if demand == "stiffness" and limit > (most := max_load_stiffness(c)):
        return "stiffness", {"reachable": most}
    if demand in ("tolerance", "no limit cycle"):
        resolvable = max(requirements.quantum_x, 2.0 * requirements.noise_x)
        if limit < resolvable:
            return "resolution", {"resolvable": resolvable}
    return "", {}


def min_travel_time(c: Mapping[str, float], distance: float) -> float:
    """Return the least time in s of a distance in m, at the largest speed of the valve."""
    return distance / reachable_speed_and_gradient(c)[0]


def max_load_stiffness(c: Mapping[str, float]) -> float:
    """Return the largest load stiffness in N/m that any controller reaches under a step of the nominal load.

    The load F above friction acts against a force that the valve builds at its full rate R from the first instant:
    ``m dv/dt = F - R t`` comes to rest after ``2 F^3 / (3 m R^2)``. The stiffness of the enclosed gas adds to it.
    """
    push, rate = nominal_load(c), max_force_rate(c)
    left = push - c["C_STATIC"]
    if left <= 0.0:
        return math.inf
    return 1.5 * push / left * c["C_MASS"] * (rate / left) ** 2 + min_air_stiffness(c)


def max_force_rate(c: Mapping[str, float]) -> float:
    """Return the largest rate of force in N/s of the open valve at mid-stroke, choked both ways."""
    choked, half = c["C_GAMMA_R_T"] * c["C_K_GAS"] * c["C_SUPPLY"] * PSI_MAX, 0.5 * c["C_STROKE"]
    one = c["C_AREA_1"] / (c["C_DEAD_VOLUME_1"] + c["C_AREA_1"] * half) * max(c["C_AREA_FILL"], c["C_AREA_VENT"])
    two = c["C_AREA_2"] / (c["C_DEAD_VOLUME_2"] + c["C_AREA_2"] * half) * max(c["C_AREA_FILL_2"], c["C_AREA_VENT_2"])
    driven = c["C_TWO_VALVES"] > 0.5 or c["C_MIRRORED"] > 0.5
    return choked * (one + two * driven)


def min_air_stiffness(c: Mapping[str, float]) -> float:
    """Return the least stiffness in N/m of the enclosed gas over the middle 60 % of the stroke (isentropic)."""
    x = np.linspace(0.2, 0.8, 25) * c["C_STROKE"]
    p2 = chamber_2_pressure(c, x)
    p1 = (c["C_AREA_2"] * p2 + (c["C_AREA_1"] - c["C_AREA_2"]) * c["C_AMBIENT"]) / c["C_AREA_1"]
    one, two = stiffness_per_pressure(c, x)
    return float(np.min(p1 * one + p2 * two))


def _longest_step(scenarios: Sequence[Scenario]) -> float:
    return max(float(np.max(np.abs(np.diff(s.reference)), initial=0.0)) for s in scenarios)


def _fastest(scenario: Scenario, period: float) -> float:
    """Return the largest speed in m/s of a reference without jumps; 0 for one with jumps."""
    rate = np.abs(np.diff(scenario.reference)) / period
    smooth = np.max(np.abs(np.diff(rate)), initial=0.0) < 0.5 * np.max(rate, initial=0.0)
    return float(np.max(rate, initial=0.0)) if smooth else 0.0
