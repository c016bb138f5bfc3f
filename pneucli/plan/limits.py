"""The limits of a rig, and which of them a simulated manoeuvre exceeds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pneucli.plan.bench import SPEED_FACTOR, USUAL_SPEED, Bench
from pneucli.plan.manoeuvre import Outcome
from pneucli.recording import Rig

END_MARGIN_SHARE = 0.05  # of the stroke, at each end
PRESSURE_FACTOR = 1.15  # times the supply pressure: a moving piston compresses gas beyond it
FORCE_FACTOR = 1.1  # times the force of the supply pressure on the larger area
MAX_FREQUENCY = 5.0  # Hz, of a motion
SOFT_START = 0.7  # s, from rest to the first position
POSITION_RESERVE = 0.03  # of the allowed stroke, at each end, that a simulated manoeuvre leaves
SPEED_RESERVE = 0.1  # of the highest speed
FORCE_RESERVE = 0.05  # of the largest force
PRESSURE_RESERVE = 0.02  # of the highest pressure
DENSITY_ANR = 1.185  # kg/m^3, of air at 100 kPa and 20 degC (ISO 8778)


@dataclass(frozen=True)
class Limits:
    """The limits of a rig, SI.

    Attributes:
        position: Lowest and highest position that a manoeuvre may reach.
        max_speed: Highest speed.
        max_pressure: Highest absolute pressure of a chamber.
        max_force: Largest net force of the pressures on the piston.
        max_command: Largest command in V from the null command; None: as recorded.
        max_frequency: Highest frequency of a motion in Hz.
        soft_start: Time in s from rest to the first position.
        max_air: Most air in kg of one manoeuvre; infinite: not limited.
    """

    position: tuple[float, float] = (-np.inf, np.inf)
    max_speed: float = np.inf
    max_pressure: float = np.inf
    max_force: float = np.inf
    max_command: float | None = None
    max_frequency: float = MAX_FREQUENCY
    soft_start: float = SOFT_START
    max_air: float = np.inf

    def with_reserve(self) -> Limits:
        """Return limits that a simulation must keep so that the rig keeps these: the models are not the rig.

        >>> Limits(position=(0.0, 1.0), max_speed=1.0).with_reserve().position
        (0.03, 0.97)
        """
        low, high = self.position
        inset = POSITION_RESERVE * (high - low) if np.isfinite(high - low) else 0.0
        return replace(
            self,
            position=(low + inset, high - inset),
            max_speed=(1.0 - SPEED_RESERVE) * self.max_speed,
            max_force=(1.0 - FORCE_RESERVE) * self.max_force,
            max_pressure=(1.0 - PRESSURE_RESERVE) * self.max_pressure,
        )

    def command_range(self, bench: Bench) -> float:
        """Return the largest command in V from the null command that a bench may get."""
        return bench.command_range if self.max_command is None else min(self.max_command, bench.command_range)


@dataclass(frozen=True)
class Violation:
    """A limit that a manoeuvre exceeds: the quantity, its most extreme value, the limit, the unit (SI)."""

    quantity: str
    value: float
    limit: float
    unit: str


def limits_of(rig: Rig, benches: Iterable[Bench], stated: Mapping[str, Any] | None = None) -> Limits:
    """Return the limits of a rig: as stated in ``[plan]``, else from the rig and its recordings.

    Args:
        rig: The rig.
        benches: Its benches.
        stated: Values by key of ``[plan]``, SI; None or absent: default.

    Returns:
        The limits.
    """
    given = {key: value for key, value in (stated or {}).items() if value is not None}
    stroke = rig.stroke or np.inf
    margin = given.get("end_margin", END_MARGIN_SHARE * stroke if np.isfinite(stroke) else 0.0)
    recorded = max((bench.speed for bench in benches), default=0.0)
    supply = rig.supply_pressure or np.inf
    force = (supply - rig.ambient_pressure) * max(rig.piston_areas)
    return Limits(
        position=(margin, stroke - margin) if rig.has_cylinder and np.isfinite(stroke) else (-np.inf, np.inf),
        max_speed=given.get("max_speed", SPEED_FACTOR * recorded or USUAL_SPEED),
        max_pressure=given.get("max_pressure", PRESSURE_FACTOR * supply),
        max_force=given.get("max_force", FORCE_FACTOR * force if force > 0.0 else np.inf),
        max_command=given.get("max_command"),
        max_frequency=given.get("max_frequency", MAX_FREQUENCY),
        soft_start=given.get("soft_start", SOFT_START),
        max_air=DENSITY_ANR * given["max_air"] if "max_air" in given else np.inf,
    )


def violations(outcome: Outcome, limits: Limits, rig: Rig) -> list[Violation]:
    """Return the limits that a simulated manoeuvre exceeds.

    Args:
        outcome: The simulated manoeuvre.
        limits: The limits.
        rig: The rig.

    Returns:
        The violations; a state that is not finite violates every limit.
    """
    found = []
    checked = [("p1", outcome.p1)] + ([] if outcome.p2 is None else [("p2", outcome.p2)])
    for name, pressure in checked:
        found += _above(name, pressure, limits.max_pressure, "Pa")
        found += _below(name, pressure, outcome.lowest_pressure, "Pa")
    if outcome.x is not None:
        found += _below("x", outcome.x, limits.position[0], "m")
        found += _above("x", outcome.x, limits.position[1], "m")
    if outcome.v is not None:
        found += _above("v", np.abs(outcome.v), limits.max_speed, "m/s")
    if outcome.p2 is not None and rig.has_cylinder:
        area_1, area_2 = rig.piston_areas
        ambient = rig.ambient_pressure
        net = area_1 * (outcome.p1 - ambient) - area_2 * (outcome.p2 - ambient)
        found += _above("force", np.abs(net), limits.max_force, "N")
    found += _above("air", np.array([outcome.air]), limits.max_air, "kg")
    return found


def _above(quantity: str, values: np.ndarray, limit: float, unit: str) -> list[Violation]:
    largest = float(np.max(values))
    return [] if largest <= limit else [Violation(quantity, largest, limit, unit)]  # NaN violates


def _below(quantity: str, values: np.ndarray, limit: float, unit: str) -> list[Violation]:
    least = float(np.min(values))
    return [] if least >= limit else [Violation(quantity, least, limit, unit)]
