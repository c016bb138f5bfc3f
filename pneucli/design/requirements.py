"""What is asked of the controller: the table ``[design]`` of a pipeline file, with a default for everything."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal

from pneucli.errors import InputError, UnitError, did_you_mean
from pneucli.units import parse_quantity

UNITS = {
    "period": "s",
    "tolerance": "m",
    "pressure_bandwidth": "1/s",
    "position_bandwidth": "1/s",
    "damping": "1",
    "sector_ratio": "1",
    "max_speed": "m/s",
    "max_acceleration": "m/s^2",
    "noise_x": "m",
    "quantum_x": "m",
    "noise_p": "Pa",
    "delay": "s",
}
PERIODS = (1e-5, 1.0)  # s, of a controller


@dataclass(frozen=True)
class Requirements:
    """Requirements in SI; ``None`` is derived from the model by the rules of :mod:`pneucli.design.cascade`.

    ``tolerance``: error at rest that is good enough. Bandwidths are corner frequencies in Hz; ``damping`` is that of
    the position loop's oscillating pair. ``sector_ratio``: slope of the sector's steeper line over the flatter one's.
    ``noise_x``, ``quantum_x``, ``noise_p``: what the sensors add (1 sigma) and how they round; ``delay``: from reading
    to valve. ``chamber_2``: ``closed`` (air spring), ``open`` (to ambient) or ``valve`` (driven).
    """

    period: float = 1e-3
    tolerance: float | None = None
    pressure_bandwidth: float | None = None
    position_bandwidth: float | None = None
    damping: float = 1.0
    sector_ratio: float = 2.0
    max_speed: float | None = None
    max_acceleration: float | None = None
    noise_x: float = 0.0
    quantum_x: float = 0.0
    noise_p: float = 0.0
    delay: float = 0.0
    chamber_2: Literal["closed", "open", "valve"] = "closed"


def requirements_from(table: Mapping[str, Any], where: str, **known: Any) -> Requirements:
    """Return the requirements of a ``[design]`` table over ``known`` ones (what the recordings tell).

    Raises InputError for a key or value that it cannot read; ``where`` names file and table.
    """
    values: dict[str, Any] = dict(known)
    for key, value in table.items():
        if key == "chamber_2":
            if value not in ("closed", "open", "valve"):
                raise InputError(f"{where}.{key}", f"{value!r}", '"closed", "open" or "valve"')
            values[key] = value
            continue
        if key not in UNITS:
            raise InputError(
                f"{where}.{key}", "unknown key", mend=did_you_mean(key, [f.name for f in fields(Requirements)])
            )
        values[key] = _positive(value, key, where)
    return Requirements(**values)


def _positive(value: Any, key: str, where: str) -> float:
    try:
        number = parse_quantity(value, UNITS[key])
    except UnitError as error:
        raise InputError(f"{where}.{key}", str(error), f'a quantity such as "1 {UNITS[key]}"') from error
    if not number > 0.0 and key not in ("noise_x", "quantum_x", "noise_p", "delay"):
        raise InputError(f"{where}.{key}", f"{number:g}", "above 0")
    if key == "sector_ratio" and number <= 1.0:
        raise InputError(f"{where}.{key}", f"{number:g}", "above 1: the slope of one line over the other's")
    if key == "period" and not PERIODS[0] <= round(number, 9) <= PERIODS[1]:
        raise InputError(f"{where}.{key}", f"{number:g} s", f"from {PERIODS[0]:g} s to {PERIODS[1]:g} s")
    return number
