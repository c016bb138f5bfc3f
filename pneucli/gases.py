"""Gases that a rig may be filled with, by name."""

from dataclasses import dataclass
from typing import Literal

GasName = Literal["air", "nitrogen", "helium", "argon"]


@dataclass(frozen=True)
class Gas:
    """Ratio of heat capacities, and gas constant in J/(kg K), at 300 K (VDI Heat Atlas; air as in the thesis)."""

    heat_capacity_ratio: float
    gas_constant: float


GASES: dict[GasName, Gas] = {
    "air": Gas(1.4, 287.0),
    "nitrogen": Gas(1.4, 296.8),
    "helium": Gas(5.0 / 3.0, 2077.1),
    "argon": Gas(5.0 / 3.0, 208.13),
}
AIR = GASES["air"]
