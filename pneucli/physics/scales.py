"""Express the sizes of an effect in scales of the rig, so that no size is right for one rig only.

A quantity of a declaration is a number in its parameter's unit, or a number of a scale, such as "0.2 supply forces".
A scale follows from the quantities of the rig; where these are missing, the scale is NaN.
"""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

from pneucli.errors import UnitError, did_you_mean
from pneucli.physics.gas import PSI_MAX
from pneucli.units import parse_unit

NAN = math.nan
Quantity = float | str


@dataclass(frozen=True)
class RigQuantities:
    """The quantities of a rig that its scales need, SI; NaN where description, recordings and fit give none.

    Attributes:
        supply: Supply pressure, absolute.
        force: Largest driving force on the piston.
        volume: Volume of chamber 1 at half stroke, or of the vessel.
        dead_volume: Volume of chamber 1 at x = 0, or of the vessel.
        valve_area: Effective area at the largest command ``max_command``.
        x_min, x_max: Range of the position.
        horizon: Longest time in s from one restart of the model to the next; NaN where it never restarts.
    """

    supply: float = NAN
    ambient: float = NAN
    force: float = NAN
    bore_area: float = NAN
    volume: float = NAN
    dead_volume: float = NAN
    stroke: float = NAN
    x_min: float = NAN
    x_max: float = NAN
    max_speed: float = NAN
    mass: float = NAN
    coulomb: float = NAN
    valve_area: float = NAN
    max_command: float = NAN
    sampling_period: float = NAN
    horizon: float = NAN
    gas_temperature: float = NAN
    specific_energy: float = NAN  # J/kg, R T of the gas
    heat_capacity_ratio: float = NAN

    @property
    def conductance(self) -> float:
        """Mass flow through the open valve over the pressure upstream, in kg/(s Pa)."""
        return self.valve_area * PSI_MAX * math.sqrt(2.0 / self.specific_energy)

    @property
    def fill_time(self) -> float:
        """Time in s in which the flow through the open valve raises the chamber's pressure by the supply pressure."""
        return (
            self.volume / (self.heat_capacity_ratio * self.specific_energy * self.conductance)
            if self.valve_area > 0
            else NAN
        )

    @property
    def response_time(self) -> float:
        """The longer of the time to fill the chamber and the time to cross the range of x at top speed, in s."""
        crossing = (self.x_max - self.x_min) / self.max_speed if self.max_speed > 0 else NAN
        return max((t for t in (self.fill_time, crossing) if t > 0), default=NAN)


@dataclass(frozen=True)
class Scale:
    """A scale: its name (plural), its unit, its meaning in words, its size on a rig, and its zero there."""

    name: str
    unit: str
    meaning: str
    size: Callable[[RigQuantities], float]
    zero: Callable[[RigQuantities], float] = lambda _: 0.0


SCALES = {
    scale.name: scale
    for scale in (
        Scale("supply forces", "N",
              "the larger of supply pressure above ambient x piston area 1 and the largest driving force",
              lambda f: f.force),
        Scale("supply forces per stroke", "N/m", "that over the stroke", lambda f: f.force / f.stroke),
        Scale("supply forces per top speed", "N s/m", "that over the highest speed", lambda f: f.force / f.max_speed),
        Scale("supply forces per mass", "m/s^2", "that over the moving mass", lambda f: f.force / f.mass),
        Scale("driven masses", "kg", "what the supply force brings to the highest speed within the range of x",
              lambda f: 2.0 * f.force * (f.x_max - f.x_min) / f.max_speed**2),
        Scale("Coulomb forces", "N", "the base model's dry friction", lambda f: f.coulomb),
        Scale("Coulomb forces per millimetre", "N/m", "that over 1 mm: seals are alike on large and small rigs",
              lambda f: f.coulomb / 1e-3),
        Scale("moving masses", "kg", "the rig's, or as fitted", lambda f: f.mass),
        Scale("strokes", "m", "of the cylinder, else the range of x", lambda f: f.stroke),
        Scale("ranges of x", "m", "from the lowest to the highest position, counted from the lowest",
              lambda f: f.x_max - f.x_min, lambda f: f.x_min),
        Scale("top speeds", "m/s", "the highest speed seen, else what the open valve allows", lambda f: f.max_speed),
        Scale("supply pressures", "Pa", "above ambient", lambda f: abs(f.supply - f.ambient)),
        Scale("supply pressures per full command", "Pa/V", "above ambient, over the largest command",
              lambda f: abs(f.supply - f.ambient) / f.max_command),
        Scale("per supply pressure", "1/Pa", "above ambient", lambda f: 1.0 / abs(f.supply - f.ambient)),
        Scale("chamber volumes", "m^3", "chamber 1 at half stroke, or the vessel", lambda f: f.volume),
        Scale("dead volumes", "m^3", "chamber 1 at x = 0, or the vessel", lambda f: f.dead_volume),
        Scale("bore areas", "m^2", "piston area 1, or the face of a cube of the vessel's volume",
              lambda f: f.bore_area),
        Scale("valve areas", "m^2", "the effective area at the largest command", lambda f: f.valve_area),
        Scale("valve bores", "m", "the diameter of a round opening of that area",
              lambda f: math.sqrt(4.0 / math.pi * f.valve_area)),
        Scale("valve areas per supply pressure", "m^2/Pa", "that over the supply pressure above ambient",
              lambda f: f.valve_area / abs(f.supply - f.ambient)),
        Scale("valve conductances", "kg/(s Pa)", "flow at the largest command over the pressure before the valve",
              lambda f: f.conductance),
        Scale("full commands", "V", "the largest command", lambda f: f.max_command),
        Scale("response times", "s", "the longer of filling the chamber through the open valve and crossing the range "
              "of x at top speed", lambda f: f.response_time),
        Scale("horizons", "s", "the longest time between two restarts of the model, or without any the response time",
              lambda f: f.horizon if f.horizon > 0.0 else f.response_time),
        Scale("sampling periods", "s", "between samples", lambda f: f.sampling_period),
        Scale("gas conductances", "W/K", "heat capacity of the full chamber's gas over the time to fill it",
              lambda f: f.supply * f.volume / (f.gas_temperature * (f.heat_capacity_ratio - 1.0) * f.fill_time)),
    )
}  # fmt: skip


_SCALED_QUANTITY = re.compile(r"([+-]?\d*\.?\d+(?:[eE][+-]?\d+)?)\s+(\S.*)")


@lru_cache(maxsize=1024)
def parse_scaled(text: str, unit: str) -> tuple[float, Scale, float]:
    """Parse a quantity that is counted in a scale of the rig.

    Args:
        text: A number and the name of a scale, such as "0.2 supply forces".
        unit: Unit of the parameter.

    Returns:
        The number, the scale, and the scale's unit over ``unit``.

    Raises:
        UnitError: The text has another form, or the scale is unknown or of another dimension.

    References:
        docs/effects.md, sizes: what is counted in what a rig has.

    >>> number, scale, factor = parse_scaled("0.2 supply pressures", "bar")
    >>> number, scale.name, factor
    (0.2, 'supply pressures', 1e-05)
    """
    parts = _SCALED_QUANTITY.fullmatch(text.strip())
    if not parts or parts[2] not in SCALES:
        raise UnitError(f'"{text}" is no number of a scale; {did_you_mean(parts[2] if parts else text, SCALES)}')
    scale = SCALES[parts[2]]
    scale_unit, parameter_unit = parse_unit(scale.unit), parse_unit(unit)
    if scale_unit.dimension != parameter_unit.dimension:
        raise UnitError(f'"{text}" is in {scale.unit}; wanted a scale or a number in {unit}')
    return float(parts[1]), scale, scale_unit.factor / parameter_unit.factor


def value_of(quantity: Quantity, unit: str, facts: RigQuantities) -> float:
    """Return the value of a quantity on a rig.

    Args:
        quantity: A number in ``unit``, or a number of a scale such as "0.2 supply forces".
        unit: Unit of the parameter.
        facts: The quantities of the rig.

    Returns:
        The value in ``unit``; NaN where the rig's quantities do not determine the scale.

    Raises:
        UnitError: The quantity cannot be parsed.

    References:
        docs/effects.md, sizes: what is counted in what a rig has.

    >>> value_of("0.2 supply forces", "N", RigQuantities(force=500.0))
    100.0
    >>> value_of("0.2 supply forces", "N", RigQuantities())
    nan
    """
    if not isinstance(quantity, str):
        return float(quantity)
    number, scale, factor = parse_scaled(quantity, unit)
    return (scale.zero(facts) + number * _scale_size(scale, facts)) * factor


def _scale_size(scale: Scale, facts: RigQuantities) -> float:
    try:
        size = scale.size(facts)
    except (ZeroDivisionError, OverflowError):
        return NAN
    return size if math.isfinite(size) and size > 0.0 else NAN
