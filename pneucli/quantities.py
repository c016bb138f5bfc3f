"""The nomenclature: every signal's name, symbol, SI unit and title, in one place.

Pressures are absolute. ``x = 0`` where chamber 1 is smallest; ``u > 0`` fills chamber 1; a ``force`` is positive
toward +x.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """One signal: its key in files and code, symbol, SI unit, the unit people read it in, and its title."""

    name: str
    symbol: str
    unit: str
    display_unit: str
    title: str


_ALL = (
    Quantity("time", "t", "s", "s", "time"),
    Quantity("u", "u", "V", "V", "valve command"),
    Quantity("u2", "u2", "V", "V", "command of the second valve"),
    Quantity("p_supply", "p_S", "Pa", "bar", "supply pressure"),
    Quantity("p1", "p1", "Pa", "bar", "pressure of chamber 1"),
    Quantity("p2", "p2", "Pa", "bar", "pressure of chamber 2"),
    Quantity("x", "x", "m", "mm", "piston position"),
    Quantity("v", "v", "m/s", "mm/s", "piston velocity"),
    Quantity("a", "a", "m/s^2", "m/s^2", "piston acceleration"),
    Quantity("force", "F", "N", "N", "driving force"),
    Quantity("temperature", "T", "K", "K", "gas temperature"),
    Quantity("x_ref", "x_ref", "m", "mm", "position reference"),
    Quantity("p_ref", "p_ref", "Pa", "bar", "pressure reference"),
)

SIGNALS: dict[str, Quantity] = {q.name: q for q in _ALL}

# the channels that `compare` reports, in the order in which people read them
CHANNELS = ("p1", "p2", "x", "v", "a", "force", "temperature")

# where a residual may concentrate (interface, section 3)
LOCATORS = ("time", "u", "p1", "p2", "x", "v", "a", "direction", "p_ratio")
