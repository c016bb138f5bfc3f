"""Numbers and units as people read them: bar and mm instead of Pa and m, and as many digits as mean something."""

from __future__ import annotations

import math
from typing import Any, TypeVar

from numpy.typing import NDArray

from pneucli.quantities import SIGNALS

T = TypeVar("T", float, NDArray[Any])

_SHOWN = {
    "Pa": (1e-5, "bar"),
    "Pa/s": (1e-5, "bar/s"),
    "m": (1e3, "mm"),
    "m/s": (1e3, "mm/s"),
    "m^2": (1e6, "mm²"),
    "m^3": (1e6, "cm³"),
}
_PRETTY = {"m/s^2": "m/s²", "N s/m": "N·s/m", "1": "", "m^3/(s Pa)": "m³/(s·Pa)"}


def shown_unit(unit: str) -> str:
    """Return the unit in which a quantity of an SI ``unit`` is shown; empty where it has no dimension."""
    return _SHOWN[unit][1] if unit in _SHOWN else _PRETTY.get(unit, unit)


def shown(values: T, unit: str) -> T:
    """Return SI values in the unit of :func:`shown_unit`."""
    return values * _SHOWN[unit][0] if unit in _SHOWN else values


def quantity(value: float | None, unit: str, digits: int = 4) -> str:
    """Return value and unit as text, ``"5.2 bar"``; a dash where there is no value."""
    if value is None or not math.isfinite(value):
        return "–"
    return f"{number(float(shown(value, unit)), digits)} {shown_unit(unit)}".rstrip()


def number(value: float | None, digits: int = 4) -> str:
    """Return a number with that many significant digits; powers of ten where it is very large or small."""
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    if not -4 <= int(exponent) < 6:
        return f"{mantissa}·10{str(int(exponent)).translate(_RAISED)}".replace("-", "−")
    return f"{value:.{max(0, digits - 1 - int(exponent))}f}".replace("-", "−")


_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def short(value: float) -> str:
    """Return a number that was set, not measured, without trailing zeros."""
    return f"{value:g}".replace("-", "−")


def percent(share: float) -> str:
    """Return a share (0 to 1) in per cent."""
    return f"{100 * share:.0f} %" if share >= 0.01 else f"{100 * share:.1g} %"


def axis(name: str) -> str:
    """Return the title of an axis for a signal or locator: ``"pressure of chamber 1 in bar"``."""
    if name in SIGNALS:
        unit = shown_unit(SIGNALS[name].unit)
        return f"{SIGNALS[name].title} in {unit}" if unit else SIGNALS[name].title
    return {"direction": "direction of motion", "p_ratio": "pressure ratio"}.get(name, name)


def signal_unit(name: str) -> str:
    """Return the SI unit of a signal or locator."""
    return SIGNALS[name].unit if name in SIGNALS else "1"
