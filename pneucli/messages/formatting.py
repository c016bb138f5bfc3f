"""Numbers and units as people read them: bar and mm instead of Pa and m, and as many digits as mean something."""

import math
import re
import string
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from pneucli.figure import Figure
from pneucli.quantities import ROTARY_UNITS, SIGNALS, axis_unit

if TYPE_CHECKING:  # numpy takes a tenth of a second to import, and here only types need it
    from numpy.typing import NDArray

T = TypeVar("T", float, "NDArray[Any]")
_SHOWN = {
    "Pa": (1e-5, "bar"),
    "Pa/s": (1e-5, "bar/s"),
    "m": (1e3, "mm"),
    "rad": (180.0 / math.pi, "deg"),
    "m/s": (1e3, "mm/s"),
    "rad/s": (180.0 / math.pi, "deg/s"),
    "kg/s": (1e3, "g/s"),
    "kg/(s Pa)": (1e8, "g/(s·bar)"),
    "m^2/Pa": (1e11, "mm²/bar"),
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


RESOLUTIONS = {one.unit: one.resolution for one in SIGNALS.values()}
RESOLUTIONS["m^2"] = 1e-12  # a leak of 0.1 ml/min at 6 bar, of which no bubble shows
RESOLUTIONS |= {ROTARY_UNITS[unit]: size for unit, size in RESOLUTIONS.items() if unit in ROTARY_UNITS}
MAX_COMMON_POWER = 1e3  # end of an interval over its value, above which they are not written with one power of ten
MIN_RELATIVE_WIDTH = 1e-9  # of an interval over its ends: rounding errors of the arithmetic, no uncertainty
PLAIN_RANGE = (1e-4, 1e6)  # of numbers that are written without a power of ten
LARGEST_MISFIT = -1000.0  # %: y varies by less than a tenth of the error
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def format_quantity(value: float | None, unit: str, digits: int = 4, *, trimmed: bool = False) -> str:
    """Return value and unit as text, ``"5.2 bar"``; a dash where there is no value.

    What is below the resolution of every sensor of its unit is 0.

    >>> format_quantity(1.1e-10, "N"), format_quantity(101325.0, "Pa")
    ('0 N', '1.013 bar')
    """
    if value is None or not math.isfinite(value):
        return "–"
    shown, smallest = (float(in_display_unit(v, unit)) for v in (value, RESOLUTIONS.get(axis_unit(unit), 0.0)))
    return f"{format_number(shown, digits, smallest=smallest, trimmed=trimmed)} {unit_symbol(unit)}".rstrip()


def format_signal(value: float, signal: str, digits: int = 3) -> str:
    """Return a value (SI) of a signal or locator in the unit that people read it in, without trailing zeros."""
    return format_quantity(value, signal_unit(signal), digits, trimmed=True)


def format_number(value: float | None, digits: int = 4, *, smallest: float = 0.0, trimmed: bool = False) -> str:
    """Return a number with that many significant digits; powers of ten where it is very large or small.

    Args:
        value: The number; None and what is not finite become a dash.
        digits: Significant digits.
        smallest: Size below which a number is 0, and no digit is shown.
        trimmed: Whether trailing zeros are left out.

    >>> format_number(171.3, 2), format_number(-0.25, trimmed=True), format_number(2.5e7, 2)
    ('170', '−0.25', '2.5·10⁷')
    """
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0 or abs(value) < smallest:
        return "0"
    if smallest:
        digits = max(1, min(digits, 1 + math.floor(math.log10(abs(value))) - math.floor(math.log10(smallest))))
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    rounded = float(f"{mantissa}e{exponent}")
    if PLAIN_RANGE[0] <= abs(rounded) < PLAIN_RANGE[1]:
        text, scale = f"{rounded:.{max(0, digits - 1 - int(exponent))}f}", ""
    else:
        text, scale = mantissa, f"·10{str(int(exponent)).translate(_RAISED)}"
    if trimmed and "." in text:
        text = text.rstrip("0").rstrip(".")
    return f"{text}{scale}".replace("-", "−")


def format_interval(value: float | None, unit: str, ci95: Sequence[float | None]) -> str:
    """Return value, 95 % interval and unit with the digits that the interval supports: ``"0.399 ± 0.002 mm²"``.

    Half the interval's width has two digits, as the GUM (JCGM 100:2008, 7.2.6) advises; an interval that is not even
    about its value is given by its ends. One without width, or of a width that is arithmetic or below the resolution of
    every sensor of its unit, is not given at all. An open end, at a bound of the search, is None: the value is at
    least, or at most, the other end.

    >>> format_interval(0.05, "s", [0.046, None]), format_interval(-0.95, "1", [None, -0.8])
    ('at least 0.046 s', 'at most −0.80')
    >>> format_interval(2.01e4, "N/m", [1.0e-2, 1.94e9])
    '20100 (0.010 to 1.9·10⁹) N/m'
    >>> format_interval(7.0, "1/bar", [0.16, 28.0])
    '7.00 (0.16 to 28) 1/bar'
    >>> format_interval(-5.039031693674560e-3, "m", [-5.039031693674590e-3, -5.039031693674512e-3])
    '−5.039 mm'
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
    half, largest = 0.5 * (high - low), max(abs(low), abs(high))
    smallest = float(in_display_unit(RESOLUTIONS.get(axis_unit(unit), 0.0), unit))
    if half < max(smallest, MIN_RELATIVE_WIDTH * largest):
        return f"{format_number(value, smallest=smallest)} {unit_symbol(unit)}".rstrip()
    even = abs(high + low - 2 * value) < 0.2 * half
    place = _exponent(half) - 1  # of the second digit of half the width, as a power of ten
    reads_zero = not even and min(abs(low), abs(high)) < 0.5 * 10.0**place  # an end that is not
    if low * high > 0.0 and (reads_zero or largest > MAX_COMMON_POWER * abs(value)):
        ends = (format_number(v, digits, smallest=smallest) for v, digits in ((value, 3), (low, 2), (high, 2)))
        return "{} ({} to {})".format(*ends) + f" {unit_symbol(unit)}".rstrip()
    power = 0 if PLAIN_RANGE[0] <= largest < PLAIN_RANGE[1] else _exponent(largest)
    middle, low_text, high_text, width = (
        f"{round(v, -place) / 10**power:.{max(0, power - place)}f}".replace("-", "−") for v in (value, low, high, half)
    )
    text = f"{middle} ± {width}" if even else f"{middle} ({low_text} to {high_text})"
    scale = f"·10{str(power).translate(_RAISED)}" if power else ""
    return f"{f'({text}){scale}' if scale else text} {unit_symbol(unit)}".rstrip()


def _exponent(value: float) -> int:
    """Return the power of ten of a number as it is written with two digits: 0.00999... counts as 0.010."""
    return int(f"{value:.1e}".partition("e")[2])


def format_figure(one: Figure) -> str:
    """Return a figure with its interval, an open end of which is not finite, see :func:`format_interval`."""
    return format_interval(one.value, one.unit, [end if math.isfinite(end) else None for end in (one.low, one.high)])


def format_parameters(found: Mapping[str, Figure]) -> str:
    """Return an effect's parameters with their intervals: ``"drop = 0.399 ± 0.002"``, ``"delay at least 0.046 s"``."""
    shown = {name: format_figure(p) for name, p in found.items()}
    return ", ".join(f"{name} {'' if text.startswith('at ') else '= '}{text}" for name, text in shown.items())


def format_bounded(value: float | None, digits: int = 3) -> str:
    """Return a figure of the closed loop, infinity where it is without bound: None, or infinite; NaN is a dash."""
    return "∞" if value is None or math.isinf(value) else format_number(value, digits)


def format_noise_ratio(error: float | None) -> str:
    """Return an error over noise: three digits, below the noise floor two; none where there is no such recording."""
    return "none" if error is None or math.isnan(error) else format_number(error, 3 if error >= 0.995 else 2)


def format_plain(value: float | None, digits: int = 6) -> str:
    """Return a number without trailing zeros: one that was set, or one in a sentence.

    >>> format_plain(0.5), format_plain(101325.0, 3), format_plain(3.1416, 3)
    ('0.5', '101000', '3.14')
    """
    return format_number(value, digits, trimmed=True)


def at_command(u: float | None) -> str:
    """Return the command in a sentence."""
    return "at the one opening" if u is None else f"at {format_plain(u)} V"


class _Sentences(string.Formatter):
    """Fills in values as people read them, see :func:`fill_in`."""

    def format_field(self, value: Any, format_spec: str) -> str:
        if isinstance(value, float) and format_spec.endswith("g"):
            return format_plain(value, int(format_spec.strip(".g")))
        if format_spec.endswith("#"):
            return format_number(value, int(format_spec[:-1]))
        if asked := re.fullmatch(r"(\d+) (.+)", format_spec):
            return format_quantity(value, asked[2], int(asked[1]))
        if format_spec in self.WORDED:
            return self.WORDED[format_spec](value)
        return str(super().format_field(value, format_spec))

    WORDED: ClassVar[Mapping[str, Callable[[Any], str]]] = {
        "%": lambda share: format_percent(share or 0.0),
        "noise": format_noise_ratio,
        "command": at_command,
    }


def fill_in(template: str, **values: Any) -> str:
    """Return a sentence with its values.

    A field says how: ``3 Pa`` with three digits in the display unit of Pa, ``3#`` a number with three digits, ``.3g``
    without trailing zeros, ``%`` a share, ``noise`` an error over noise, ``command`` a command or the one opening.

    >>> fill_in("it errs by {ratio:.2g} times its {what}", ratio=171.3, what="noise")
    'it errs by 170 times its noise'
    >>> fill_in("{u:command} {p:3 Pa}, {share:%}", u=2.0, p=1.2e5, share=0.05)
    'at 2 V 1.20 bar, 5 %'
    """
    return _Sentences().format(template, **values)


def format_percent(share: float | None) -> str:
    """Return a share (0 to 1) in per cent; of None a dash.

    >>> format_percent(0.613), format_percent(0.002), format_percent(1e-7)
    ('61 %', '0.2 %', 'less than 0.1 %')
    """
    if share is None:
        return "–"
    if 0.0 < share < 0.001:
        return "less than 0.1 %"
    return f"{100 * share:.0f} %" if share >= 0.01 or share == 0.0 else f"{100 * share:.1f} %"


def format_fit(fit_percent: float | None) -> str:
    """Return a fit in per cent, 100 (1 - |y - model| / |y - mean y|); or what a senseless one means.

    >>> format_fit(98.76), format_fit(-3.5e11)
    ('98.8 %', 'none (hardly varies)')
    """
    if fit_percent is None or math.isnan(fit_percent):
        return "–"
    return "none (hardly varies)" if fit_percent < LARGEST_MISFIT else f"{format_number(fit_percent, 3)} %"


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
