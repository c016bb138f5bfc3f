"""Limits of the shaped reference: what the valve can make the piston do.

The largest speed is 0.7 of the speed that the slower direction of the valve reaches, anywhere in the middle 60 % of the
stroke with pressures well within their range. The largest acceleration is that whose force this direction builds within
half the time constant of the position loop. Source: thesis (2.46-2.52) for what the valve can do; the shares are the
project's own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from pneucli.arrays import Array
from pneucli.design.bandwidths import Bandwidths
from pneucli.design.requirements import Requirements
from pneucli.physics.vectorised import flow_functions

RestoringForce = Callable[[Array], Array]

WORKING_PRESSURES = (1.3, 0.85)  # of ambient and supply pressure: between them the valve has flow to spare both ways
STOPPING_TIME_CONSTANTS = (
    6.0  # time constants of the pressure loop that the shaped reference takes at least from full speed to rest
)


def reference_limits(
    bandwidths: Bandwidths,
    axis: Mapping[str, float],
    requirements: Requirements,
    restoring_force: RestoringForce = np.zeros_like,
) -> dict[str, float]:
    """Return the limits of the shaped reference and its time constant, and the rates that follow from the valve.

    Args:
        bandwidths: Corner frequencies in rad/s.
        axis: Parameters of the axis by name (SI).
        requirements: ``max_speed`` in m/s and ``max_acceleration`` in m/s^2 have precedence over the rules.
        restoring_force: Force of the effects in N toward x = 0, at x in m.

    Returns:
        C_V_MAX (m/s), C_A_MAX (m/s^2), C_SHAPING_TIME and C_FRICTION_LEAD (s), C_LEVEL_RATE and C_FLOW_STEP_MAX (Pa/s).
    """
    speed, rate = reachable_speed_and_gradient(axis, restoring_force)
    force_rate = axis["C_AREA_1"] * rate
    highest = requirements.max_speed or 0.7 * speed
    rule = min(
        force_rate / (2.0 * bandwidths.position * axis["C_MASS"]),
        highest * bandwidths.pressure / STOPPING_TIME_CONSTANTS,
    )
    return {
        "C_V_MAX": highest,
        "C_A_MAX": requirements.max_acceleration or rule,
        "C_SHAPING_TIME": max(4.0 * requirements.period, 1.0 / bandwidths.pressure),
        "C_FRICTION_LEAD": 1.0 / bandwidths.pressure,
        "C_LEVEL_RATE": 0.2 * rate,
        "C_FLOW_STEP_MAX": 0.05 * rate,
    }


def reachable_speed_and_gradient(
    axis: Mapping[str, float], restoring_force: RestoringForce = np.zeros_like
) -> tuple[float, float]:
    """Return the speed and the pressure gradient that both directions of the valve reach.

    The minimum over the middle 60 % of the stroke, where the pressures in equilibrium with the air spring and the
    restoring force are well within their range.

    Args:
        axis: Parameters of the axis by name (SI).
        restoring_force: Force of the effects in N toward x = 0, at x in m.

    Returns:
        Speed in m/s and pressure gradient in Pa/s.

    References:
        Thesis (2.46) to (2.52): the flow that keeps the pressures while the piston moves.
    """
    area_1, area_2, stroke, gamma = axis["C_AREA_1"], axis["C_AREA_2"], axis["C_STROKE"], axis["C_GAMMA"]
    x = np.linspace(0.2, 0.8, 25) * stroke
    volume_1, volume_2 = axis["C_DEAD_VOLUME_1"] + area_1 * x, axis["C_DEAD_VOLUME_2"] + area_2 * (stroke - x)
    p2 = chamber_2_pressure(axis, x)
    balance = (area_2 * p2 + (area_1 - area_2) * axis["C_AMBIENT"] + restoring_force(x)) / area_1
    p1 = np.clip(balance, WORKING_PRESSURES[0] * axis["C_AMBIENT"], WORKING_PRESSURES[1] * axis["C_SUPPLY"])
    low, high = axis["C_AMBIENT"] / p1, p1 / axis["C_SUPPLY"]
    scale = axis["C_GAMMA_R_T"] * axis["C_K_GAS"] / volume_1
    fill = axis["C_AREA_FILL"] * scale * axis["C_SUPPLY"] * flow_functions(high, axis["C_CRITICAL_RATIO"])
    vent = axis["C_AREA_VENT"] * scale * p1 * flow_functions(low, axis["C_CRITICAL_RATIO"])
    if axis["C_MIRRORED"] > 0.5:  # the other chamber gives way at the same time
        share = axis["C_AREA_2"] / area_1 * axis["C_GAMMA_R_T"] * axis["C_K_GAS"] / volume_2
        ratio_2 = p2 / axis["C_SUPPLY"], axis["C_AMBIENT"] / p2
        fill = fill + share * axis["C_AREA_VENT_2"] * p2 * flow_functions(ratio_2[1], axis["C_CRITICAL_RATIO"])
        vent = vent + share * axis["C_AREA_FILL_2"] * axis["C_SUPPLY"] * flow_functions(
            ratio_2[0], axis["C_CRITICAL_RATIO"]
        )
    rate = np.minimum(fill, vent)
    per_speed = gamma * (p1 * area_1 / volume_1 + p2 * area_2**2 / (area_1 * volume_2))
    within = p1 == balance if np.any(p1 == balance) else np.ones(x.size, dtype=bool)
    return float(np.min((rate / per_speed)[within])), float(np.min(rate[within]))


def chamber_2_pressure(axis: Mapping[str, float], x: Array) -> Array:
    """Return the pressure in Pa of chamber 2: sealed at mid-stroke (isentropic), or held by its valve.

    Args:
        axis: Parameters of the axis by name (SI); C_P_MEAN is the pressure at mid-stroke.
        x: Position in m, shape (n,).

    Returns:
        Pressure in Pa, shape (n,).

    >>> axis = {"C_TWO_VALVES": 0.0, "C_MIRRORED": 0.0, "C_P_MEAN": 3e5, "C_GAMMA": 1.4, "C_STROKE": 0.2}
    >>> axis |= {"C_DEAD_VOLUME_2": 0.0, "C_AREA_2": 8e-4}
    >>> chamber_2_pressure(axis, np.array([0.1, 0.15])).round()  # half the volume: times 2^1.4
    array([300000., 791705.])
    """
    if axis["C_TWO_VALVES"] > 0.5 or axis["C_MIRRORED"] > 0.5:
        return np.full_like(x, axis["C_P_MEAN"])
    half = axis["C_DEAD_VOLUME_2"] + 0.5 * axis["C_AREA_2"] * axis["C_STROKE"]
    volume = axis["C_DEAD_VOLUME_2"] + axis["C_AREA_2"] * (axis["C_STROKE"] - x)
    return np.asarray(axis["C_P_MEAN"] * (half / volume) ** axis["C_GAMMA"])
