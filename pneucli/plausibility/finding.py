"""What a check of plausibility found, as programs and people read it."""

from __future__ import annotations

from dataclasses import dataclass

from pneucli.quantities import display_unit
from pneucli.units import parse_unit


@dataclass(frozen=True)
class Finding:
    """``found`` is the evidence with its numbers, ``mend`` the edit of the pipeline file that would mend it."""

    check: str
    signal: str
    recording: str
    found: str
    mend: str


def shown(value: float, signal: str, digits: int = 3) -> str:
    """Return a value (SI) of a signal in the unit that people read it in, such as ``"1.01 bar"``."""
    unit = display_unit(signal)
    return f"{plain(value / parse_unit(unit).factor, digits)} {unit}"


def plain(value: float, digits: int = 3) -> str:
    """Return a number as people write it: to a thousandth at most, and without an exponent up to a million."""
    rounded = float(f"{value:.{digits}g}")
    if abs(rounded) < 1e-3:
        return f"{abs(rounded):.3f}"
    return f"{rounded:.0f}" if 10.0**digits <= abs(rounded) < 1e6 else f"{rounded:.{digits}g}"
