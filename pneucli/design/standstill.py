"""Parameters of hold and release at standstill, as multiples of the break-away force."""

from __future__ import annotations

from collections.abc import Mapping

from pneucli.design import effect_compensation
from pneucli.design.bandwidths import Bandwidths
from pneucli.design.requirements import Requirements

SEAL_STIFFNESS = 12.0  # supply forces over the stroke: stiffness of a soft seal before the piston slides
CLOSING_RATE = 10.0  # 1/s: closing speed per error near a resting reference
DWELL_RATE_FACTOR = 5.0  # rate of the release force over the rate at which a rest raises break-away
FAST_RAMP_RATIO = 10.0  # time constants of the pressure loop in which the release force rises by a break-away force
SLOW_RAMP_RATIO = 400.0  # the same near break-away: the rise within the lag of the loop accelerates the freed piston
MAX_DEADBAND_GAIN = 10.0  # largest dead band over the holding band


def presliding_distance(values: Mapping[str, float], stiffness: float) -> float:
    """Return the largest elastic excursion of the seals in m: 1.5 times Coulomb friction over their stiffness.

    Args:
        values: Parameters of the axis by name (SI).
        stiffness: Presliding stiffness in N/m; 0 where it is not known, then 12 supply forces over the stroke.

    >>> axis = {"C_COULOMB": 20.0, "C_AREA_1": 8e-4, "C_SUPPLY": 7e5, "C_AMBIENT": 1e5, "C_STROKE": 0.2}
    >>> presliding_distance(axis, stiffness=6e4)
    0.0005
    """
    supply_force = values["C_AREA_1"] * (values["C_SUPPLY"] - values["C_AMBIENT"])
    return 1.5 * values["C_COULOMB"] / (stiffness or SEAL_STIFFNESS * supply_force / values["C_STROKE"])


def stiction_parameters(
    bandwidths: Bandwidths,
    values: Mapping[str, float],
    requirements: Requirements,
    stiffness: float,
    dwell: effect_compensation.DwellStrengthening,
) -> dict[str, float]:
    """Return the parameters of hold and release (:mod:`pneucli.controller.standstill`).

    Forces and their rates are multiples of the break-away force.

    Args:
        bandwidths: Corner frequencies in rad/s.
        values: Parameters of the axis and of the loops by name (SI).
        requirements: ``tolerance``, by default 10 um, two quanta or four sigma of the position sensor.
        stiffness: Presliding stiffness in N/m, 0 without a value.
        dwell: Growth of break-away with the time at rest.

    """
    static = values["C_STATIC"]
    tolerance = requirements.tolerance or max(10e-6, 2.0 * requirements.quantum_x, 4.0 * requirements.noise_x)
    band = 0.5 * tolerance
    slope = min(0.2 / requirements.period, bandwidths.pressure / 5.0)
    slow = bandwidths.pressure / SLOW_RAMP_RATIO * static  # N/s
    return {
        "C_HOLDING_BAND": band,
        "C_V_FLOOR": max(2.0 * requirements.quantum_x / requirements.period, 0.01 * values["C_V_MAX"]),
        "C_MOTION_WINDOW": 6.0 / bandwidths.pressure,
        "C_SECTOR_1": slope / requirements.sector_ratio,
        "C_SECTOR_2": slope,
        "C_RAMP_RATE_PER_ERROR": slow / (5.0 * band),
        "C_RAMP_RATE_MIN": max(slow, DWELL_RATE_FACTOR * dwell.initial_rate * static),
        "C_RAMP_RATE_MAX": bandwidths.pressure / FAST_RAMP_RATIO * static,
        "C_BREAKAWAY_MAX": static if dwell.initial_rate > 0.0 else 2.0 * static,
        "C_PRESSURE_BAND": 0.1 * static / values["C_AREA_1"],
        "C_LOAD_STEP_MAX": max(0.25 * static, 0.01 * values["C_AREA_1"] * values["C_SUPPLY"]),
        "C_PRESLIDING_DISTANCE": presliding_distance(values, stiffness),
        "C_RAMP_GROWTH_RATE": bandwidths.pressure / 6.0,
        "C_RELEASE_FORCE_MAX": 3.0 * static * dwell.max_factor
        + values["C_AREA_1"] * (values["C_SUPPLY"] - values["C_AMBIENT"]),
        "C_UNLOADING_RATE": bandwidths.pressure / 5.0,
        "C_CLOSING_RATE": CLOSING_RATE,
        "C_BRAKE_DAMPING": values["C_MASS"] * values["C_KD"],
        "C_DEADBAND_GAIN_MAX": MAX_DEADBAND_GAIN,
    }
