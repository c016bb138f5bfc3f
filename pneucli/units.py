"""Units as laboratories write them -> SI floats. A table: it needs no import and knows what a gauge pressure is.

``"m/s2"``, ``"m/s^2"``, ``"m s⁻²"``, ``"N*s/m"``, ``"J/(kg K)"``, ``"mm2"``, ``"°C"``, ``"barg"``, ``"bar(g)"`` and
``"l/min"`` are all read. A product binds as tightly as a quotient, from left to right. Factors: SI brochure (9th
edition, 2019), NIST SP 811 (2008) for units outside the SI.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from functools import lru_cache

from pneucli.errors import UnitError, did_you_mean

STANDARD_ATMOSPHERE = 101_325.0  # Pa
MAX_UNIT_LENGTH = 60  # characters of a unit
MAX_MAGNITUDE = 1e18  # of any number of a rig, in SI: its powers stay finite

Dimension = tuple[int, int, int, int, int]  # exponents of m, kg, s, K, A


@dataclass(frozen=True)
class Unit:
    """``value in SI = factor * value + offset``, plus ambient pressure where ``gauge``.

    ``of_air``: a mass stated as the volume of air, of which another gas has R_air / R as much.
    """

    factor: float
    dimension: Dimension
    offset: float = 0.0
    gauge: bool = False
    absolute: bool = False
    of_air: bool = False

    def __mul__(self, other: Unit) -> Unit:
        exponents = tuple(a + b for a, b in zip(self.dimension, other.dimension, strict=True))
        return Unit(self.factor * other.factor, exponents)  # type: ignore[arg-type]

    def __pow__(self, power: int) -> Unit:
        return Unit(self.factor**power, tuple(power * a for a in self.dimension))  # type: ignore[arg-type]


_ONE = (0, 0, 0, 0, 0)
_PRESSURE = (-1, 1, -2, 0, 0)

_PREFIXED = {  # these take SI prefixes
    "m": Unit(1.0, (1, 0, 0, 0, 0)),
    "g": Unit(1e-3, (0, 1, 0, 0, 0)),
    "s": Unit(1.0, (0, 0, 1, 0, 0)),
    "K": Unit(1.0, (0, 0, 0, 1, 0)),
    "A": Unit(1.0, (0, 0, 0, 0, 1)),
    "N": Unit(1.0, (1, 1, -2, 0, 0)),
    "Pa": Unit(1.0, _PRESSURE),
    "bar": Unit(1e5, _PRESSURE),
    "J": Unit(1.0, (2, 1, -2, 0, 0)),
    "W": Unit(1.0, (2, 1, -3, 0, 0)),
    "V": Unit(1.0, (2, 1, -3, 0, -1)),
    "Ohm": Unit(1.0, (2, 1, -3, 0, -2)),
    "Hz": Unit(1.0, (0, 0, -1, 0, 0)),
    "Nm": Unit(1.0, (2, 1, -2, 0, 0)),
    "l": Unit(1e-3, (3, 0, 0, 0, 0)),
    "L": Unit(1e-3, (3, 0, 0, 0, 0)),
}

_PLAIN = {
    "1": Unit(1.0, _ONE),
    "-": Unit(1.0, _ONE),
    "%": Unit(1e-2, _ONE),
    "rad": Unit(1.0, _ONE),
    "deg": Unit(math.pi / 180, _ONE),
    "°": Unit(math.pi / 180, _ONE),
    "rev": Unit(2 * math.pi, _ONE),
    "rpm": Unit(2 * math.pi / 60, (0, 0, -1, 0, 0)),
    "min": Unit(60.0, (0, 0, 1, 0, 0)),
    "h": Unit(3600.0, (0, 0, 1, 0, 0)),
    "sec": Unit(1.0, (0, 0, 1, 0, 0)),
    "d": Unit(86_400.0, (0, 0, 1, 0, 0)),
    "t": Unit(1e3, (0, 1, 0, 0, 0)),
    "cc": Unit(1e-6, (3, 0, 0, 0, 0)),
    "in": Unit(0.0254, (1, 0, 0, 0, 0)),
    "inch": Unit(0.0254, (1, 0, 0, 0, 0)),
    "ft": Unit(0.3048, (1, 0, 0, 0, 0)),
    "lb": Unit(0.453_592_37, (0, 1, 0, 0, 0)),
    "lbf": Unit(4.448_221_615_260_5, (1, 1, -2, 0, 0)),
    "kgf": Unit(9.806_65, (1, 1, -2, 0, 0)),
    "kp": Unit(9.806_65, (1, 1, -2, 0, 0)),
    "psi": Unit(6894.757_293_168_361, _PRESSURE),
    "atm": Unit(STANDARD_ATMOSPHERE, _PRESSURE),
    "at": Unit(98_066.5, _PRESSURE),
    "Torr": Unit(STANDARD_ATMOSPHERE / 760, _PRESSURE),
    "torr": Unit(STANDARD_ATMOSPHERE / 760, _PRESSURE),
    "mmHg": Unit(133.322_387_415, _PRESSURE),
    "degC": Unit(1.0, (0, 0, 0, 1, 0), 273.15),
    "°C": Unit(1.0, (0, 0, 0, 1, 0), 273.15),
    "degF": Unit(5 / 9, (0, 0, 0, 1, 0), 273.15 - 32 * 5 / 9),
    "°F": Unit(5 / 9, (0, 0, 0, 1, 0), 273.15 - 32 * 5 / 9),
}

STANDARD_GRAVITY = 9.806_65  # m/s^2
# kg/m^3 of air: ISO 8778 (20 °C, 100 kPa, 65 % humidity), DIN 1343 (0 °C, 101.325 kPa, dry)
_AIR = {"ANR": 1.185, "N": 1.2929}
_ACCELERATION = (1, 0, -2, 0, 0)
# what a symbol means where another dimension than its own is wanted
_SYMBOLS_BY_DIMENSION = {
    _ACCELERATION: {f"{m}g": Unit(f * STANDARD_GRAVITY, _ACCELERATION) for m, f in (("", 1.0), ("m", 1e-3))}
}

_PREFIXES = {"n": 1e-9, "u": 1e-6, "µ": 1e-6, "m": 1e-3, "c": 1e-2, "d": 1e-1, "h": 1e2, "k": 1e3, "M": 1e6, "G": 1e9}

_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻μ℃", "0123456789-µC")
_TOKEN = re.compile(r"\s*(?:([A-Za-zµ°%]+|-(?!\d)|1(?!\d))(?:(?:\^|\*\*)?\s*(-?\d+))?|([/*·()]))\s*")
_PRESSURE_KIND = re.compile(r"(?i)^(.*?(?:bar|pa|psi|atm))[\s_]*\(?(g|gauge|ü|rel|a|abs|absolute)\)?$")
_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*$", re.DOTALL)


@lru_cache(maxsize=512)
def parse_unit(text: str) -> Unit:
    """Read a unit; ``"barg"``, ``"bar(g)"``, ``"psig"`` are gauge, ``"bar(a)"`` is absolute.

    Raises :class:`UnitError` with the closest known unit where it cannot be read.
    """
    try:
        unit = _parse(text)
    except (OverflowError, ZeroDivisionError):  # of powers that no unit has
        unit = Unit(math.inf, _ONE)
    if not 0.0 < unit.factor < math.inf:
        raise UnitError(f'unit "{text}" is beyond all numbers')
    return unit


def _parse(text: str) -> Unit:
    if len(text) > MAX_UNIT_LENGTH:
        raise UnitError(f'"{text[:MAX_UNIT_LENGTH]}..." is no unit')
    spelled = text.strip().replace("℃", "°C").translate(_SUPERSCRIPTS)
    if of_air := _of_air(spelled):
        return of_air
    if kind := _PRESSURE_KIND.match(spelled):
        gauge = kind[2].lower() in ("g", "gauge", "ü", "rel")
        return replace(_product(kind[1]), gauge=gauge, absolute=not gauge)
    return _product(spelled)


def _of_air(text: str) -> Unit | None:
    """Read a flow or amount as a volume of air under standard conditions: "l/min ANR", "Nl/min"; None if it is none."""
    state = "ANR" if (anr := re.fullmatch(r"(.+?)[\s_]*\(?ANR\)?", text)) else "N"
    volume = anr[1] if anr else text[1:] if re.match(r"N[lL]\b|Nm(?:3|\^3)\b", text) else None
    if volume is None:
        return None
    unit = _product(volume)
    if unit.dimension[0] != 3:
        raise UnitError(f'"{volume}" is no volume, of which "{state}" would tell the state')
    return replace(unit * Unit(_AIR[state], (-3, 1, 0, 0, 0)), of_air=True)


def _product(text: str) -> Unit:
    tokens = _tokens(text)
    if len(tokens) == 1 and isinstance(tokens[0], Unit):
        return tokens[0]
    return _reduce(tokens, text, depth=0)


def _tokens(text: str) -> list[Unit | str]:
    tokens: list[Unit | str] = []
    at = 0
    while at < len(text):
        found = _TOKEN.match(text, at)
        if not found:
            raise UnitError(f'unit "{text}" cannot be read at "{text[at:]}"')
        symbol, power, operator = found.groups()
        unit = _symbol(symbol) if symbol else None
        tokens.append(operator if unit is None else unit ** int(power) if power else unit)
        at = found.end()
    return tokens


def _symbol(symbol: str) -> Unit:
    if symbol in _PLAIN:
        return _PLAIN[symbol]
    if symbol in _PREFIXED:
        return _PREFIXED[symbol]
    if symbol[0] in _PREFIXES and symbol[1:] in _PREFIXED:
        unit = _PREFIXED[symbol[1:]]
        return Unit(_PREFIXES[symbol[0]] * unit.factor, unit.dimension)
    prefixed = [p + u for p in ("", "m", "k") for u in _PREFIXED]
    raise UnitError(f'unit "{symbol}" is not known; {did_you_mean(symbol, [*_PLAIN, *prefixed])}')


def _reduce(tokens: list[Unit | str], text: str, depth: int) -> Unit:
    """Multiply from left to right; consumes ``tokens`` up to the closing bracket of this depth."""
    result, pending, empty = Unit(1.0, _ONE), "", True
    while tokens and tokens[0] != ")":
        token = tokens.pop(0)
        if token in ("/", "*", "·") and not pending and not empty:
            pending = str(token)
            continue
        if isinstance(token, str) and token != "(":
            raise UnitError(f'unit "{text}" has an operator too many')
        factor = _reduce(tokens, text, depth + 1) if isinstance(token, str) else token
        result, pending, empty = result * factor ** (-1 if pending == "/" else 1), "", False
    if empty or pending:
        raise UnitError(f'unit "{text}" is incomplete')
    if bool(tokens) != bool(depth):
        raise UnitError(f'unit "{text}" has a bracket without its partner')
    del tokens[:1]
    return result


def unit_suffix(unit: str) -> str:
    """Return a unit as it follows a number: nothing where there is none."""
    return "" if unit == "1" else f" {unit}"


def parse_unit_as(text: str, wanted: str) -> Unit:
    """Read a unit of what is measured in ``wanted``: ``"g"`` is gravity where an acceleration is wanted."""
    dimension = parse_unit(wanted).dimension
    return _SYMBOLS_BY_DIMENSION.get(dimension, {}).get(text.strip()) or parse_unit(text)


def same_dimension(unit: str, wanted: str) -> bool:
    """Whether a unit measures what ``wanted`` does."""
    return parse_unit_as(unit, wanted).dimension == parse_unit(wanted).dimension


def factor_and_offset(
    unit: str, ambient_pressure: float = STANDARD_ATMOSPHERE, wanted: str | None = None
) -> tuple[float, float]:
    """``SI = factor * value + offset``; the offset of a gauge unit holds ``ambient_pressure`` (Pa).

    ``wanted``: a unit of what is measured, see :func:`parse_unit_as`.
    """
    parsed = parse_unit_as(unit, wanted or unit)
    return parsed.factor, parsed.offset + (ambient_pressure if parsed.gauge else 0.0)


def parse_quantity(
    value: str | float, unit: str, *, ambient_pressure: float = STANDARD_ATMOSPHERE, difference: bool = False
) -> float:
    """Return ``value`` in SI: text with a unit of the dimension of ``unit``, or a bare number, which is SI already.

    ``difference``: the zero of the scale does not count (a noise of ``"0.1 degC"`` is 0.1 K, of ``"1 mbarg"`` 100 Pa).
    Raises :class:`UnitError`, a ``ValueError``.
    """
    wanted = f'a quantity such as "1 {unit}"'
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise UnitError(f"{value!r} is not {wanted}")
    if not isinstance(value, str):
        return _finite(float(value), value)
    parts = _QUANTITY.match(value) if len(value) <= 2 * MAX_UNIT_LENGTH else None
    if not parts:
        raise UnitError(f'"{value[: 2 * MAX_UNIT_LENGTH]}" is not {wanted}')
    if parts[2].startswith(","):
        raise UnitError(f'"{value}" has a decimal comma; write a point')
    number = _finite(float(parts[1]), value)
    if not parts[2]:
        return number
    if not same_dimension(parts[2], unit):
        raise UnitError(f'"{value}" has not the dimension of {unit}; wanted {wanted}')
    factor, offset = factor_and_offset(parts[2], ambient_pressure, unit)
    return _finite(factor * number + (0.0 if difference else offset), value)


def _finite(number: float, value: object) -> float:
    if not math.isfinite(number):
        raise UnitError(f"{value!r} is not finite")
    if abs(number) > MAX_MAGNITUDE:
        raise UnitError(f"{value!r} is beyond what a rig may have; wanted up to {MAX_MAGNITUDE:g}")
    return number
