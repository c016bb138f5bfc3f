"""Numbers and units as people read them: bar and mm instead of Pa and m, and as many digits as mean something."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from pneucli.quantities import SIGNALS, axis_unit

if TYPE_CHECKING:  # numpy takes a tenth of a second to import, and here only types need it
    from numpy.typing import NDArray

T = TypeVar("T", float, "NDArray[Any]")

_SHOWN = {
    "Pa": (1e-5, "bar"),
    "Pa/s": (1e-5, "bar/s"),
    "m": (1e3, "mm"),
    "rad": (180.0 / math.pi, "°"),
    "m/s": (1e3, "mm/s"),
    "m^2": (1e6, "mm²"),
    "m^3": (1e6, "cm³"),
}
PRESSURE_DIFFERENCE = "p1 - p2"
_PRETTY = {"m/s^2": "m/s²", "N s/m": "N·s/m", "1": "", "m^3/(s Pa)": "m³/(s·Pa)"}
_PRETTY |= {"rad/s^2": "rad/s²", "N m": "N·m", "N m s/rad": "N·m·s/rad", "kg m^2": "kg·m²", "m^3/rad": "m³/rad"}


def unit_symbol(unit: str) -> str:
    """Return the unit in which a quantity of an SI ``unit`` is shown; empty where it has no dimension."""
    unit = axis_unit(unit)
    return _SHOWN[unit][1] if unit in _SHOWN else _PRETTY.get(unit, unit)


def in_display_unit(values: T, unit: str) -> T:
    """Return SI values in the unit of :func:`unit_symbol`."""
    unit = axis_unit(unit)
    return values * _SHOWN[unit][0] if unit in _SHOWN else values


def format_quantity(value: float | None, unit: str, digits: int = 4) -> str:
    """Return value and unit as text, ``"5.2 bar"``; a dash where there is no value."""
    if value is None or not math.isfinite(value):
        return "–"
    return f"{format_number(float(in_display_unit(value, unit)), digits)} {unit_symbol(unit)}".rstrip()


def format_number(value: float | None, digits: int = 4) -> str:
    """Return a number with that many significant digits; powers of ten where it is very large or small."""
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    if not -4 <= int(exponent) < 6:
        return f"{mantissa}·10{str(int(exponent)).translate(_RAISED)}".replace("-", "−")
    return f"{value:.{max(0, digits - 1 - int(exponent))}f}".replace("-", "−")


MAX_COMMON_POWER = 1e3  # end of an interval over its value, above which they are not written with one power of ten
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def format_interval(value: float | None, unit: str, ci95: Sequence[float | None]) -> str:
    """Return value, 95 % interval and unit with the digits that the interval supports: ``"0.399 ± 0.002 mm²"``.

    Half the interval's width has two digits, as the GUM (JCGM 100:2008, 7.2.6) advises; an interval that is not even
    about its value is given by its ends, one without width not at all. An open end, at a bound of the search, is None:
    the value is at least, or at most, the other end.

    >>> format_interval(0.05, "s", [0.046, None]), format_interval(-0.95, "1", [None, -0.8])
    ('at least 0.046 s', 'at most −0.80')
    >>> format_interval(2.01e4, "N/m", [1.0e-2, 1.94e9])
    '20100 (0.010 to 1.9·10⁹) N/m'
    """
    low, high = ci95
    if (low is None) != (high is None):
        return (
            f"at least {format_quantity(low, unit, 2)}" if high is None else f"at most {format_quantity(high, unit, 2)}"
        )
    if (
        value is None
        or low is None
        or high is None
        or not high > low
        or not math.isfinite(in_display_unit(high - low, unit))
    ):
        return format_quantity(value, unit)
    value, low, high = (float(in_display_unit(v, unit)) for v in (value, low, high))
    half = 0.5 * (high - low)
    even = abs(high + low - 2 * value) < 0.2 * half
    largest = max(abs(low), abs(high))
    if not even and largest > MAX_COMMON_POWER * abs(value):
        ends = (format_number(v, digits) for v, digits in ((value, 3), (low, 2), (high, 2)))
        return "{} ({} to {})".format(*ends) + f" {unit_symbol(unit)}".rstrip()
    power = _exponent(largest) if not 1e-4 <= largest < 1e6 else 0
    places = max(0, 1 - _exponent(half) + power)
    middle, low_text, high_text, width = (
        f"{v / 10**power:.{places}f}".replace("-", "−") for v in (value, low, high, half)
    )
    text = f"{middle} ± {width}" if even else f"{middle} ({low_text} to {high_text})"
    scale = f"·10{str(power).translate(_RAISED)}" if power else ""
    return f"{f'({text}){scale}' if scale else text} {unit_symbol(unit)}".rstrip()


def _exponent(value: float) -> int:
    """Return the power of ten of a number as it is written with two digits: 0.00999... counts as 0.010."""
    return int(f"{value:.1e}".partition("e")[2])


def format_parameters(found: Mapping[str, Mapping[str, Any]]) -> str:
    """Return an effect's parameters with their intervals: ``"drop = 0.399 ± 0.002"``, ``"delay at least 0.046 s"``."""
    shown = {name: format_interval(p["value"], p["unit"], p["ci95"]) for name, p in found.items()}
    return ", ".join(f"{name} {'' if text.startswith('at ') else '= '}{text}" for name, text in shown.items())


def format_noise_ratio(error: float | None) -> str:
    """Return an error over noise: three digits, below the noise floor two; none where there is no such recording."""
    return "none" if error is None else format_number(error, 3 if error >= 0.995 else 2)


def format_setting(value: float) -> str:
    """Return a number that was set, not measured, without trailing zeros."""
    return f"{value:g}".replace("-", "−")


def format_percent(share: float) -> str:
    """Return a share (0 to 1) in per cent."""
    return f"{100 * share:.0f} %" if share >= 0.01 else f"{100 * share:.1g} %"


def join_names(names: Sequence[str]) -> str:
    """Return names as a list in a sentence: ``"x, v and a"``."""
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def axis_title(name: str) -> str:
    """Return the title of an axis for a signal or locator: ``"pressure of chamber 1 in bar"``."""
    if name in SIGNALS:
        unit = unit_symbol(SIGNALS[name].unit)
        return f"{SIGNALS[name].title} in {unit}" if unit else SIGNALS[name].title
    if name == PRESSURE_DIFFERENCE:
        return f"difference of the pressures, p1 − p2, in {unit_symbol('Pa')}"
    return {"direction": "direction of motion", "p_ratio": "pressure ratio"}.get(name, name)


def signal_unit(name: str) -> str:
    """Return the SI unit of a signal or locator."""
    return "Pa" if name == PRESSURE_DIFFERENCE else SIGNALS[name].unit if name in SIGNALS else "1"
