"""The enclosed gas as a spring: how stiff it is, which pressure level makes it so, and which arrangement can set that.

``k = gamma (A1^2 p1 / V1 + A2^2 p2 / V2)``, isentropic. Two valves set both pressures, hence the level. One 5/3 spool
fills one chamber as it vents the other: their mean follows from leaks and overlap alone, too slowly to be a reference.
A chamber without a valve has what was sealed in, or what is around.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneucli.controller.layout import OPEN_CHAMBER_VOLUME
from pneucli.design.requirements import Requirements

Array = NDArray[np.float64]
Values = Mapping[str, float]

STROKE_FRACTIONS = np.linspace(0.2, 0.8, 25)  # of the stroke


class UnmetRequirement(NamedTuple):
    """What is asked of the spring and cannot be had: limit and what there is in ``unit``, and why."""

    name: str
    limit: float
    found: float
    unit: str
    cause: str


def stiffness_per_pressure(c: Values, x: Array) -> tuple[Array, Array]:
    """Return the stiffness in N/m that 1 Pa in either chamber makes at x (m)."""
    one = c["C_AREA_1"] ** 2 / (c["C_DEAD_VOLUME_1"] + c["C_AREA_1"] * x)
    two = c["C_AREA_2"] ** 2 / (c["C_DEAD_VOLUME_2"] + c["C_AREA_2"] * (c["C_STROKE"] - x))
    return c["C_GAMMA"] * one, c["C_GAMMA"] * two


def level_for_stiffness(c: Values, stiffness: float, x: Array) -> Array:
    """Return the mean pressure in Pa that makes the gas so stiff (N/m) at x (m) while no force is asked for."""
    one, two = stiffness_per_pressure(c, x)
    sum_, unequal = c["C_AREA_1"] + c["C_AREA_2"], c["C_AREA_1"] - c["C_AREA_2"]
    even = unequal * c["C_AMBIENT"] / sum_
    share = unequal / sum_
    return np.asarray((stiffness - even * (one - two)) / (one * (1.0 - share) + two * (1.0 + share)))


def level_settings(requirements: Requirements, c: Values) -> dict[str, float]:
    """Return mean pressure and stiffness as stated, by the layout's names; nothing where two valves cannot set them."""
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


def unmet_requirements(requirements: Requirements, c: Values, min_stiffness: float) -> list[UnmetRequirement]:
    """Return what is asked of level and stiffness and cannot be had; ``min_stiffness``: stiffness (N/m) of the enclosed gas."""
    found = []
    if requirements.pressure_level is not None and abs(requirements.pressure_level - c["C_P_MEAN"]) > 1.0:
        found.append(UnmetRequirement("pressure_level", requirements.pressure_level, c["C_P_MEAN"], "Pa", _cause(c)))
    if requirements.air_stiffness is not None:
        have = min_stiffness if c["C_TWO_VALVES"] < 0.5 else float(np.min(_settable_stiffness(c)))
        if have < (1.0 - 1e-6) * requirements.air_stiffness:
            found.append(UnmetRequirement("air_stiffness", requirements.air_stiffness, have, "N/m", _cause(c)))
    return found


def _settable_stiffness(c: Values) -> Array:
    """Return the stiffness in N/m over the stroke that two valves make of the level, within what supply allows."""
    x = STROKE_FRACTIONS * c["C_STROKE"]
    one, two = stiffness_per_pressure(c, x)
    level = np.clip(level_for_stiffness(c, c["C_AIR_STIFFNESS"], x), c["C_P_LOW"], c["C_P_HIGH"])
    sum_, unequal = c["C_AREA_1"] + c["C_AREA_2"], c["C_AREA_1"] - c["C_AREA_2"]
    even = unequal * (c["C_AMBIENT"] - level) / sum_
    return np.asarray(one * (level + even) + two * (level - even))


def _cause(c: Values) -> str:
    if c["C_TWO_VALVES"] > 0.5:
        return "supply and surroundings bound the pressures"
    if c["C_MIRRORED"] > 0.5:
        return (
            "one 5/3 valve fills a chamber as it vents the other: the mean pressure follows from leaks and overlap, "
            "too slowly to be set; two valves set it"
        )
    sealed = "is open" if c["C_DEAD_VOLUME_2"] >= OPEN_CHAMBER_VOLUME else "holds what was sealed in"
    return f"chamber 2 {sealed}, so one valve sets the force alone; two valves set both pressures"
