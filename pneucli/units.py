"""Units as laboratories write them -> SI floats.

``"m/s2"``, ``"m/s^2"``, ``"m s⁻²"``, ``"N*s/m"``, ``"J/(kg K)"``, ``"mm2"``, ``"°C"``, ``"barg"``, ``"bar(g)"``,
``"l/min"``, ``"Psi"``, ``"Volts"``, ``"cmH2O"``, ``"l_n/min"`` and ``"slpm"`` are all read. A product binds as tightly
as a quotient, from left to right. The tables stand in :mod:`pneucli.unit_table`.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import lru_cache

from pneucli.errors import UnitError, did_you_mean
from pneucli.unit_table import (
    DIMENSIONLESS,
    NAMES,
    PLAIN,
    PREFIXED,
    PREFIXES,
    STANDARD_ATMOSPHERE,
    STANDARD_GRAVITY,
    SYMBOLS_BY_DIMENSION,
    Dimension,
    Unit,
    by_spelling,
    is_count,
    normalize_spelling,
    volume_of_air,
)

__all__ = [
    "STANDARD_ATMOSPHERE",
    "STANDARD_GRAVITY",
    "Dimension",
    "Unit",
    "factor_and_offset",
    "is_count",
    "is_unit",
    "parse_quantity",
    "parse_scaled_unit",
    "parse_unit",
    "parse_unit_as",
    "same_dimension",
]

MAX_UNIT_LENGTH = 60  # characters of a unit
MAX_MAGNITUDE = 1e18  # of any number of a rig, in SI: its powers stay finite

_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻μ℃", "0123456789-µC")
_TOKEN = re.compile(r"\s*(?:([A-Za-zµ°%]+|-(?!\d)|1(?!\d))(?:(?:\^|\*\*)?\s*(-?\d+))?|([/*·()]))\s*")
_PRESSURE_KIND = re.compile(
    r"(?i)^(.*?(?:bar|pa|psi|atm|at))[\s_]*\(?(g|gauge|gage|ü|rel|rel\.|relativ|relative|a|abs|abs\.|absolut|absolute)\)?$"
)
_ABSOLUTE = ("a", "abs", "abs.", "absolut", "absolute")
_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*$", re.DOTALL)
_ANGLE = re.compile(r"(?i)rad|deg|°|rev|rpm|u/min")
_NUMBER = r"(10(?:\^|\*\*)-?\d+|\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)"
_FACTOR_FIRST = re.compile(rf"\s*(1\s*/)?\s*{_NUMBER}\s*[*x×·]?\s*([^\d\s*x×·/].*?)\s*")
_FACTOR_LAST = re.compile(rf"\s*(.*?[^\d\s^])\s*([*x×·/÷])\s*{_NUMBER}\s*")


@lru_cache(maxsize=512)
def parse_unit(text: str) -> Unit:
    """Read a unit; ``"barg"``, ``"bar(g)"``, ``"psig"`` are gauge, ``"bar(a)"`` is absolute.

    Raises :class:`UnitError` with the closest known unit where it cannot be read.
    """
    try:
        unit = _parse(text)
    except (OverflowError, ZeroDivisionError):  # of powers that no unit has
        unit = Unit(math.inf, DIMENSIONLESS)
    if not 0.0 < unit.factor < math.inf:
        raise UnitError(f'unit "{text}" is beyond all numbers')
    return unit


def _parse(text: str) -> Unit:
    if len(text) > MAX_UNIT_LENGTH:
        raise UnitError(f'"{text[:MAX_UNIT_LENGTH]}..." is no unit')
    if is_count(text):
        raise UnitError(f'"{text}" are counts and no unit; state what one count is: scale, and the unit')
    spelled = normalize_spelling(text.strip().replace("℃", "°C").translate(_SUPERSCRIPTS))
    if of_air := _of_air(spelled):
        return of_air
    if kind := _PRESSURE_KIND.match(spelled):
        absolute = kind[2].lower() in _ABSOLUTE
        return replace(_product(kind[1].rstrip(" _-")), gauge=not absolute, absolute=absolute)
    return _product(spelled)


def _of_air(text: str) -> Unit | None:
    """Read a flow or amount as a volume of air in a reference state: "l/min ANR", "Nl/min"; None if it is none."""
    found = volume_of_air(text)
    if found is None:
        return None
    volume, state = found
    unit = _product(volume)
    if unit.dimension[0] != 3:
        raise UnitError(f'"{volume}" is no volume, whose reference state would be {state.words}')
    return replace(unit * Unit(state.density, (-3, 1, 0, 0, 0)), state=state)


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
    unit = _table_symbol(symbol)
    if unit is None and (spelled := by_spelling(symbol)) is not None:
        unit = _table_symbol(spelled)
    if unit is not None:
        return unit
    prefixed = [p + u for p in ("", "m", "k") for u in PREFIXED]
    raise UnitError(f'unit "{symbol}" is not known; {did_you_mean(symbol, [*PLAIN, *prefixed, *NAMES])}')


def _table_symbol(symbol: str) -> Unit | None:
    """Return the unit of a symbol as the tables have it, with or without a prefix."""
    if symbol in PLAIN:
        return PLAIN[symbol]
    if symbol in PREFIXED:
        return PREFIXED[symbol]
    if symbol[0] in PREFIXES and symbol[1:] in PREFIXED:
        unit = PREFIXED[symbol[1:]]
        return Unit(PREFIXES[symbol[0]] * unit.factor, unit.dimension)
    return None


def _reduce(tokens: list[Unit | str], text: str, depth: int) -> Unit:
    """Multiply from left to right; consumes ``tokens`` up to the closing bracket of this depth."""
    result, pending, empty = Unit(1.0, DIMENSIONLESS), "", True
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


def is_unit(text: str) -> bool:
    """Return whether a field says a unit, other than none."""
    bare = text.strip("[](){}<> ")
    try:
        return bool(parse_scaled_unit(bare)) and bare != "1"
    except UnitError:
        return False


def parse_unit_as(text: str, wanted: str) -> Unit:
    """Read a unit of what is measured in ``wanted``: ``"g"`` is gravity where an acceleration is wanted.

    Where Hz are wanted, an angle counts in turns: a corner of ``"6.28 rad/s"`` or ``"60 rpm"`` is 1 Hz.
    """
    dimension = parse_unit(wanted).dimension
    unit = SYMBOLS_BY_DIMENSION.get(dimension, {}).get(text.strip().strip("[]")) or parse_unit(text)
    turns = wanted == "Hz" and _ANGLE.search(text)
    return replace(unit, factor=unit.factor / (2.0 * math.pi)) if turns else unit


def parse_scaled_unit(text: str) -> tuple[str, float, bool]:
    """Read a unit that a header writes with a factor, such as ``"0.1 mm"``, ``"1/10 bar"`` or ``"bar x 100"``.

    Returns:
        The unit, what one of the column's numbers is in it, and whether the text alone says so: after a factor behind
        the unit the numbers may be larger or smaller than the unit's by it, and smaller units are taken.

    Raises:
        UnitError: if it is no unit, with or without a factor.

    """
    if first := _FACTOR_FIRST.fullmatch(text):
        number = _factor(first[2])
        unit, scale, certain = first[3], 1.0 / number if first[1] else number, True
    elif last := _FACTOR_LAST.fullmatch(text):
        unit, scale, certain = last[1], 1.0 / _factor(last[3]), False
    else:
        unit, scale, certain = text.strip(), 1.0, True
    parse_unit(unit)
    return unit, scale, certain


def _factor(text: str) -> float:
    base, _, power = text.replace("**", "^").partition("^")
    number = float(base.replace(",", ".")) ** (int(power) if power else 1)
    if not 1e-12 < number < 1e12:
        raise UnitError(f'"{text}" is no factor of a unit')
    return number


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
        if parse_unit(unit).dimension != DIMENSIONLESS or parse_unit(unit).factor != 1.0:
            raise UnitError(f'"{value}" has no unit; wanted {wanted}, or a bare number, which is SI')
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
