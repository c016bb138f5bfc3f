"""The enclosed gas as a spring: stiffness, the pressure level that sets it, and arrangements that can set it.

``k = gamma (A1^2 p1 / V1 + A2^2 p2 / V2)``, isentropic, thesis (2.14). Two valves set both pressures, hence
the level. One 5/3 spool fills one chamber and vents the other: their mean follows from leaks and overlap alone, too
slowly for a reference. A chamber without a valve keeps its sealed gas, or is at ambient pressure.
"""

from collections.abc import Mapping

import numpy as np

from pneucli.arrays import Array
from pneucli.controller.layout import OPEN_CHAMBER_VOLUME
from pneucli.design.requirements import Requirements
from pneucli.messages.design import MissedRequirement, cause_text

Values = Mapping[str, float]

STROKE_FRACTIONS = np.linspace(0.2, 0.8, 25)  # of the stroke


def stiffness_per_pressure(c: Values, x: Array) -> tuple[Array, Array]:
    """Return the isentropic stiffness of both gas volumes per Pa of their pressures.

    Args:
        c: Parameters of a controller by name (SI).
        x: Position in m.

    Returns:
        ``gamma A^2 / V`` in N/(m Pa) of chamber 1 and of chamber 2, each of the shape of ``x``.

    >>> chamber = {"C_GAMMA": 1.4, "C_STROKE": 0.2} | {f"C_AREA_{i}": 8e-4 for i in (1, 2)}
    >>> chamber |= {f"C_DEAD_VOLUME_{i}": 4e-5 for i in (1, 2)}
    >>> one, two = stiffness_per_pressure(chamber, np.array(0.1))  # 1.4 x 6.4e-7 m^4 / 1.2e-4 m^3
    >>> round(float(one), 7), round(float(two), 7)
    (0.0074667, 0.0074667)
    """
    one = c["C_AREA_1"] ** 2 / (c["C_DEAD_VOLUME_1"] + c["C_AREA_1"] * x)
    two = c["C_AREA_2"] ** 2 / (c["C_DEAD_VOLUME_2"] + c["C_AREA_2"] * (c["C_STROKE"] - x))
    return c["C_GAMMA"] * one, c["C_GAMMA"] * two


def max_motion_gradient(c: Values) -> float:
    """Return the largest pressure gradient in Pa/s that the piston's motion makes, the a32 term of thesis (2.47).

    The bound of a pressure observer that treats the motion as a disturbance (thesis 7.3): at the highest pressure
    reference, the largest speed of the reference, and anywhere along the stroke. One valve moves both chambers: then
    the bound is that of the force over the first area, ``k v / A1`` with the stiffness k of the gas.

    Args:
        c: Parameters of a controller by name (SI).

    >>> chamber = {"C_GAMMA": 1.4, "C_STROKE": 0.2, "C_P_HIGH": 7e5, "C_V_MAX": 0.3, "C_TWO_VALVES": 1.0}
    >>> chamber |= {f"C_AREA_{i}": 8e-4 for i in (1, 2)} | {f"C_DEAD_VOLUME_{i}": 4e-5 for i in (1, 2)}
    >>> round(max_motion_gradient(chamber))  # 1.4 x 7e5 Pa x 8e-4 m^2 x 0.3 m/s / 4e-5 m^3
    5880000

    """
    x = np.linspace(0.0, c["C_STROKE"], 101)
    one, two = stiffness_per_pressure(c, x)
    area_1, area_2 = c["C_AREA_1"], c["C_AREA_2"]
    rate = np.maximum(one / area_1, two / area_2) if c["C_TWO_VALVES"] > 0.5 else (one + two) / area_1
    return float(np.max(rate)) * c["C_P_HIGH"] * c["C_V_MAX"]


def level_for_stiffness(c: Values, stiffness: float, x: Array) -> Array:
    """Return the mean pressure at which the enclosed gas has a given stiffness, without a force on the piston.

    With unequal areas the pressures of both chambers differ then, so that ambient pressure on the rod is balanced.

    Args:
        c: Parameters of a controller by name (SI).
        stiffness: Wanted stiffness in N/m.
        x: Position in m.

    Returns:
        The mean of both pressures in Pa, of the shape of ``x``; it may lie outside what the supply can give.

    >>> chamber = {"C_GAMMA": 1.4, "C_STROKE": 0.2, "C_AMBIENT": 1e5} | {f"C_AREA_{i}": 8e-4 for i in (1, 2)}
    >>> chamber |= {f"C_DEAD_VOLUME_{i}": 4e-5 for i in (1, 2)}
    >>> round(float(level_for_stiffness(chamber, 8960.0, np.array(0.1))))  # 8960 N/m / (2 x 7.4667e-3 N/(m Pa))
    600000
    """
    one, two = stiffness_per_pressure(c, x)
    sum_, unequal = c["C_AREA_1"] + c["C_AREA_2"], c["C_AREA_1"] - c["C_AREA_2"]
    even = unequal * c["C_AMBIENT"] / sum_
    share = unequal / sum_
    return np.asarray((stiffness - even * (one - two)) / (one * (1.0 - share) + two * (1.0 + share)))


def level_settings(requirements: Requirements, c: Values) -> dict[str, float]:
    """Return stated mean pressure and stiffness by the names of the layout.

    Args:
        requirements: ``pressure_level`` in Pa or ``air_stiffness`` in N/m; the stiffness has precedence.
        c: Parameters of a controller by name (SI).

    Returns:
        C_P_MEAN in Pa, within the range of the references, and C_AIR_STIFFNESS in N/m where one is stated; empty
        without two valves.
    """
    if c["C_TWO_VALVES"] < 0.5:
        return {}
    found: dict[str, float] = {}
    if requirements.pressure_level is not None:
        found["C_P_MEAN"] = requirements.pressure_level
    if requirements.air_stiffness is not None:
        middle = np.array(0.5 * c["C_STROKE"])
        found = {
            "C_P_MEAN": float(level_for_stiffness(c, requirements.air_stiffness, middle)),
            "C_AIR_STIFFNESS": requirements.air_stiffness,
        }
    mean = found.get("C_P_MEAN", c["C_P_MEAN"])
    return found | {"C_P_MEAN": float(np.clip(mean, c["C_P_LOW"], c["C_P_HIGH"]))}


def unmet_requirements(requirements: Requirements, c: Values, min_stiffness: float) -> list[MissedRequirement]:
    """Return the unmet requirements on level and stiffness.

    Args:
        requirements: ``pressure_level`` in Pa and ``air_stiffness`` in N/m.
        c: Parameters of the designed controller by name (SI).
        min_stiffness: Smallest stiffness of the enclosed gas along the stroke in N/m, where its level cannot be set.
    """
    at, found = ("the model", "the enclosed gas", 0.0, cause_text(_cause(c), {})), []
    if requirements.pressure_level is not None and abs(requirements.pressure_level - c["C_P_MEAN"]) > 1.0:
        found.append(MissedRequirement("pressure_level", requirements.pressure_level, c["C_P_MEAN"], "Pa", *at))
    if requirements.air_stiffness is not None:
        have = min_stiffness if c["C_TWO_VALVES"] < 0.5 else float(np.min(_settable_stiffness(c)))
        if have < (1.0 - 1e-6) * requirements.air_stiffness:
            found.append(MissedRequirement("air_stiffness", requirements.air_stiffness, have, "N/m", *at))
    return found


def _settable_stiffness(c: Values) -> Array:
    """Return the stiffness in N/m over the stroke that two valves reach within the supply pressure."""
    x = STROKE_FRACTIONS * c["C_STROKE"]
    one, two = stiffness_per_pressure(c, x)
    level = np.clip(level_for_stiffness(c, c["C_AIR_STIFFNESS"], x), c["C_P_LOW"], c["C_P_HIGH"])
    sum_, unequal = c["C_AREA_1"] + c["C_AREA_2"], c["C_AREA_1"] - c["C_AREA_2"]
    even = unequal * (c["C_AMBIENT"] - level) / sum_
    return np.asarray(one * (level + even) + two * (level - even))


def _cause(c: Values) -> str:
    if c["C_TWO_VALVES"] > 0.5:
        return "pressure-bounds"
    if c["C_MIRRORED"] > 0.5:
        return "one-spool"
    return "open-chamber-2" if c["C_DEAD_VOLUME_2"] >= OPEN_CHAMBER_VOLUME else "sealed-chamber-2"
