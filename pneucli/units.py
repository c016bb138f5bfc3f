"""Units as laboratories write them -> SI floats.

``"m/s2"``, ``"m/s^2"``, ``"m s⁻²"``, ``"N*s/m"``, ``"J/(kg K)"``, ``"mm2"``, ``"°C"``, ``"barg"``, ``"bar(g)"``,
``"l/min"``, ``"Psi"``, ``"Volts"``, ``"cmH2O"``, ``"l_n/min"`` and ``"slpm"`` are all read. A product binds as tightly
as a quotient, from left to right.

Factors: SI brochure (9th edition, 2019); NIST SP 811 (2008) for units outside the SI, conventional water and mercury
columns included. Standard volumes: ISO 8778 (20 °C, 100 kPa, 65 % humidity), DIN 1343 and SEMI E12 (0 °C, 101.325 kPa,
dry), ISO 13443 (15 °C, 101.325 kPa, dry), ISO 1217 (20 °C, 100 kPa, dry).
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from functools import lru_cache

from pneucli.errors import InputError, UnitError, did_you_mean

STANDARD_ATMOSPHERE = 101_325.0  # Pa
STANDARD_GRAVITY = 9.806_65  # m/s^2

Dimension = tuple[int, int, int, int, int]  # exponents of m, kg, s, K, A


@dataclass(frozen=True)
class ReferenceState:
    """The state at which a volume of air stands for its mass: density in kg/m^3, and the state in words.

    ``others``: what the same spelling means elsewhere; empty where the spelling has one meaning.
    """

    density: float
    words: str
    others: str = ""


@dataclass(frozen=True)
class Unit:
    """``value in SI = factor * value + offset``, plus ambient pressure where ``gauge``.

    ``state``: the reference state of a mass that is stated as a volume of air, of which another gas has R_air / R as
    much.
    """

    factor: float
    dimension: Dimension
    offset: float = 0.0
    gauge: bool = False
    absolute: bool = False
    state: ReferenceState | None = None

    def __mul__(self, other: Unit) -> Unit:
        exponents = tuple(a + b for a, b in zip(self.dimension, other.dimension, strict=True))
        return Unit(self.factor * other.factor, exponents)  # type: ignore[arg-type]

    def __pow__(self, power: int) -> Unit:
        return Unit(self.factor**power, tuple(power * a for a in self.dimension))  # type: ignore[arg-type]


DIMENSIONLESS: Dimension = (0, 0, 0, 0, 0)
_PRESSURE: Dimension = (-1, 1, -2, 0, 0)
_LENGTH: Dimension = (1, 0, 0, 0, 0)
_ACCELERATION: Dimension = (1, 0, -2, 0, 0)
_TEMPERATURE: Dimension = (0, 0, 0, 1, 0)
_WATER = 1000.0 * STANDARD_GRAVITY  # Pa/m, of a conventional column of water

PREFIXED = {  # these take SI prefixes
    "m": Unit(1.0, _LENGTH),
    "g": Unit(1e-3, (0, 1, 0, 0, 0)),
    "s": Unit(1.0, (0, 0, 1, 0, 0)),
    "K": Unit(1.0, _TEMPERATURE),
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
    "sec": Unit(1.0, (0, 0, 1, 0, 0)),
    "mWC": Unit(_WATER, _PRESSURE),  # metres of water
}

PLAIN = {
    "1": Unit(1.0, DIMENSIONLESS),
    "-": Unit(1.0, DIMENSIONLESS),
    "%": Unit(1e-2, DIMENSIONLESS),
    "rad": Unit(1.0, DIMENSIONLESS),
    "mrad": Unit(1e-3, DIMENSIONLESS),
    "deg": Unit(math.pi / 180, DIMENSIONLESS),
    "°": Unit(math.pi / 180, DIMENSIONLESS),
    "rev": Unit(2 * math.pi, DIMENSIONLESS),
    "rpm": Unit(2 * math.pi / 60, (0, 0, -1, 0, 0)),
    "min": Unit(60.0, (0, 0, 1, 0, 0)),
    "h": Unit(3600.0, (0, 0, 1, 0, 0)),
    "d": Unit(86_400.0, (0, 0, 1, 0, 0)),
    "t": Unit(1e3, (0, 1, 0, 0, 0)),
    "cc": Unit(1e-6, (3, 0, 0, 0, 0)),
    "lpm": Unit(1e-3 / 60, (3, 0, -1, 0, 0)),
    "cfm": Unit(0.3048**3 / 60, (3, 0, -1, 0, 0)),
    "cfh": Unit(0.3048**3 / 3600, (3, 0, -1, 0, 0)),
    "in": Unit(0.0254, _LENGTH),
    "inch": Unit(0.0254, _LENGTH),
    "ft": Unit(0.3048, _LENGTH),
    "mil": Unit(2.54e-5, _LENGTH),
    "thou": Unit(2.54e-5, _LENGTH),
    "lb": Unit(0.453_592_37, (0, 1, 0, 0, 0)),
    "lbf": Unit(4.448_221_615_260_5, (1, 1, -2, 0, 0)),
    "kgf": Unit(9.806_65, (1, 1, -2, 0, 0)),
    "kp": Unit(9.806_65, (1, 1, -2, 0, 0)),
    "daN": Unit(10.0, (1, 1, -2, 0, 0)),
    "daPa": Unit(10.0, _PRESSURE),
    "psi": Unit(6894.757_293_168_361, _PRESSURE),
    "atm": Unit(STANDARD_ATMOSPHERE, _PRESSURE),
    "at": Unit(98_066.5, _PRESSURE),
    "Torr": Unit(STANDARD_ATMOSPHERE / 760, _PRESSURE),
    "torr": Unit(STANDARD_ATMOSPHERE / 760, _PRESSURE),
    "mmHg": Unit(133.322_387_415, _PRESSURE),
    "inHg": Unit(25.4 * 133.322_387_415, _PRESSURE),
    "inWC": Unit(0.0254 * _WATER, _PRESSURE),
    "ftWC": Unit(0.3048 * _WATER, _PRESSURE),
    "degC": Unit(1.0, _TEMPERATURE, 273.15),
    "°C": Unit(1.0, _TEMPERATURE, 273.15),
    "degK": Unit(1.0, _TEMPERATURE),
    "degF": Unit(5 / 9, _TEMPERATURE, 273.15 - 32 * 5 / 9),
    "°F": Unit(5 / 9, _TEMPERATURE, 273.15 - 32 * 5 / 9),
}

PREFIXES = {"n": 1e-9, "u": 1e-6, "µ": 1e-6, "m": 1e-3, "c": 1e-2, "d": 1e-1, "h": 1e2, "k": 1e3, "M": 1e6, "G": 1e9}

ANR = ReferenceState(1.185, "20 °C, 1 bar and 65 % humidity (ANR, ISO 8778)")
NORMAL = ReferenceState(1.2929, "0 °C and 1.01325 bar (DIN 1343)")
_AT_20 = ReferenceState(1.2041, "20 °C and 1.01325 bar", "0 °C and 1.01325 bar")
_SEMI = ReferenceState(1.2929, "0 °C and 1.01325 bar (SEMI E12)", "20 °C or 25 °C, which is 7 to 8 % less")
_GAS_TRADE = ReferenceState(1.2255, "15 °C and 1.01325 bar (ISO 13443)", "0 °C, which is 5 % more, or 20 °C")
_CUBIC_FEET = ReferenceState(1.189, "20 °C and 1 bar (ISO 1217)", "60 °F and 1 atm, which is 3 % more")

_VOLUME = r"(?:[mcd]?[lL]|I|[cd]?m(?:\^|\*\*)?3|cc|cf|ft(?:\^|\*\*)?3)"
# how a flow or amount of air is spelled, "volume" and "rest" of its unit, and the state that is meant; the first counts
STANDARD_VOLUMES = [
    (re.compile(pattern.replace("VOLUME", f"(?P<volume>{_VOLUME})")), state)
    for pattern, state in (
        (r"(?P<volume>.+?)[\s_]*\(?ANR\)?", ANR),
        (r"(?:[Nn]|[Nn]orm(?:al)?)[\s._-]*VOLUME(?P<rest>[\s/.].*)?", NORMAL),  # Nl/min, nl/min, norm l/min
        (r"VOLUME[\s_]*\(?[Nn]\)?(?P<rest>[\s/].*)", NORMAL),  # ln/min, l_n/min, m3(n)/h
        (r"(?P<volume>m)_?\(?[Nn]\)?(?:\^|\*\*)?3(?P<rest>/.*)", NORMAL),  # m_n^3/h
        (r"(?P<volume>.+?/.+?)(?:[\s_]*\(|[\s_]+)(?:[Nn]|[Nn]orm(?:al)?)\)?", NORMAL),  # l/min (n)
        (r"[Nn](?P<volume>[lLmcCfF]+)(?P<per>[pP]?[mMhHsS])", NORMAL),  # NLPM, nlm
        (r"(?:[Ss]|[Ss]td\.?|[Ss]tandard)[\s._-]*(?P<volume>m(?:\^|\*\*)?3)(?P<rest>[\s/].*)?", _GAS_TRADE),
        (r"(?:[Ss]|[Ss]td\.?|[Ss]tandard)[\s._-]*(?P<volume>cf|ft(?:\^|\*\*)?3)(?P<rest>[\s/].*)?", _CUBIC_FEET),
        (r"(?:[Ss]|[Ss]td\.?|[Ss]tandard)[\s._-]*VOLUME(?P<rest>[\s/].*)?", _SEMI),
        (r"(?P<volume>[lL])(?:_|\()?[sS]\)?(?P<rest>/.*)", _AT_20),
        (r"(?P<volume>.+?/.+?)(?:[\s_]*\(|[\s_]+)(?:[Ss]|[Ss]td\.?|[Ss]tandard)\)?", _SEMI),  # l/min (s)
        (r"[Ss](?P<volume>[cC][fF])(?P<per>[pP]?[mMhHsS])", _CUBIC_FEET),
        (r"[Ss](?P<volume>[cC][mM])(?P<per>[hHsS])", _GAS_TRADE),
        (r"[Ss](?P<volume>[lL]|[cC][cC])(?P<per>[pP]?[mMhHsS])", _SEMI),  # SLPM, sccm
    )
]
_VOLUMES = {"I": "l", "l": "l", "cc": "cm^3", "cf": "ft^3", "cm": "m^3", "lm": "l", "m": "m^3"}
_PER = {"m": "/min", "h": "/h", "s": "/s"}


def volume_of_air(text: str) -> tuple[str, ReferenceState] | None:
    """Return the volume, or its flow, and the state of air that a unit such as ``"Nl/min"`` means; None: it means none.

    Nanolitres are no flow of a rig: ``"nl/min"`` is normal litres.
    """
    for pattern, state in STANDARD_VOLUMES:
        if found := pattern.fullmatch(text):
            parts = found.groupdict("")
            volume = _VOLUMES.get(parts["volume"] if parts["volume"] == "I" else parts["volume"].lower())
            per = _PER[parts["per"][-1].lower()] if "per" in parts else parts.get("rest", "")
            if "per" not in parts or volume:
                return f"{volume or parts['volume']}{per}", state
    return None


# what a symbol means where another dimension than its own is wanted
SYMBOLS_BY_DIMENSION: dict[Dimension, dict[str, Unit]] = {
    _ACCELERATION: {f"{m}g": Unit(f * STANDARD_GRAVITY, _ACCELERATION) for m, f in (("", 1.0), ("m", 1e-3))},
    _TEMPERATURE: {"C": PLAIN["degC"], "F": PLAIN["degF"]},
}

# symbols that keep their meaning whatever their case: no two of them differ by case alone
_ANY_CASE = [
    "V",
    "mV",
    "kV",
    "A",
    "mA",
    "N",
    "kN",
    "mN",
    "daN",
    "m",
    "mm",
    "cm",
    "um",
    "s",
    "ms",
    "us",
    "ns",
    "min",
    "K",
    "degC",
    "degF",
    "degK",
    "kg",
    "g",
    "mg",
    "l",
    "ml",
    "Pa",
    "hPa",
    "kPa",
    "MPa",
    "daPa",
    "bar",
    "mbar",
    "psi",
    "atm",
    "Torr",
    "mmHg",
    "inHg",
    "inWC",
    "ftWC",
    "Hz",
    "kHz",
    "MHz",
    "rad",
    "mrad",
    "deg",
    "rev",
    "rpm",
    "Nm",
    "in",
    "inch",
    "ft",
    "lb",
    "lbf",
    "kgf",
    "cc",
    "lpm",
    "cfm",
    "cfh",
    "sec",
    "msec",
    "usec",
    "nsec",
    "Ohm",
    "kW",
]
_TOO_SHORT = {"n", "a", "m", "k", "g", "l"}  # one letter in the other case is a name more often than a unit
NAMES = {
    **{"volt": "V", "newton": "N", "second": "s", "minute": "min", "hour": "h", "hr": "h", "day": "d"},
    **{"foot": "ft", "feet": "ft", "inche": "in", "degree": "deg", "radian": "rad", "celsius": "degC"},
    **{"centigrade": "degC", "fahrenheit": "degF", "kelvin": "K", "pascal": "Pa", "meter": "m", "metre": "m"},
    **{"gram": "g", "ampere": "A", "amp": "A", "hertz": "Hz", "litre": "l", "liter": "l", "percent": "%", "pct": "%"},
    **{
        "revolution": "rev",
        "joule": "J",
        "watt": "W",
        "ohm": "Ohm",
        "pound": "lb",
        "lb": "lb",
        "newtonmeter": "Nm",
        "bar": "bar",
    },
    **dict.fromkeys(("sekunde", "sekunden", "segundo", "secondo", "secondi", "seconde", "sekund"), "s"),
    **{"millimeter": "mm", "micron": "um", "vdc": "V", "秒": "s", "毫秒": "ms"},
}
_PREFIX_NAMES = {
    **{
        "nano": "n",
        "micro": "u",
        "milli": "m",
        "mili": "m",
        "centi": "c",
        "deci": "d",
        "hecto": "h",
        "kilo": "k",
        "mega": "M",
    },
}
_COUNTS = re.compile(
    r"(?i)\s*(?:encoder|adc|raw|hex(?:adecimal)?)?[\s_]*"
    r"(?:counts?|cnts?|cts|incs?|increments?|pulses?|ticks?|digits?|lsbs?|impulses?|inkremente?|adc|raw|hex)\s*"
)
_SPELLINGS = (  # patterns of whole units, and how the table has them
    (re.compile(r"(?i)(?:deg(?:ree)?s?\.?|°)\s*([CFK])\b"), lambda m: f"deg{m[1].upper()}"),
    (
        re.compile(r"(?i)\b(mm|cm|m|in|inch(?:es)?|ft)\.?\s*(?:of\s+)?(?:H[2₂]O|WC|W\.C\.?|WG|WS|water)(?![A-Za-z])"),
        None,
    ),
    (re.compile(r"(?i)\bkgf?\s*/\s*(?:cm(?:\^|\*\*)?2|sq\.?\s*cm)"), lambda m: "at"),
    (re.compile(r"^[\"″”]$"), lambda m: "in"),
    (re.compile(r"(?i)\(s\)"), lambda m: "s"),
    (re.compile(r"(?i)\bU/min\b"), lambda m: "rpm"),
)


def by_spelling(symbol: str) -> str | None:
    """Return the symbol of the table that a spelling such as ``"Psi"``, ``"Volts"`` or ``"KPa"`` means, if one."""
    lower = symbol.lower()
    if lower in _BY_LOWER_CASE:
        return _BY_LOWER_CASE[lower]
    for name in (lower, lower.removesuffix("s")):
        if name in NAMES:
            return NAMES[name]
        for prefix, mark in _PREFIX_NAMES.items():
            if name.startswith(prefix) and NAMES.get(name[len(prefix) :]) in PREFIXED:
                return mark + NAMES[name[len(prefix) :]]
        if name in _BY_LOWER_CASE and len(name) > 2:
            return _BY_LOWER_CASE[name]
    return None


def normalize_spelling(text: str) -> str:
    """Return a unit with columns of water, degrees and plurals in brackets written as the table has them."""
    for pattern, replacement in _SPELLINGS:
        text = pattern.sub(replacement or _water_column, text)
    return text


def _water_column(match: re.Match[str]) -> str:
    length = match[1].lower().replace("inches", "in").replace("inch", "in")
    return f"{length}WC"


def is_count(text: str) -> bool:
    """Return whether a unit is counts of an encoder or a converter, which no table turns into a quantity."""
    return _COUNTS.fullmatch(text) is not None


_BY_LOWER_CASE = {symbol.lower(): symbol for symbol in _ANY_CASE if symbol.lower() not in _TOO_SHORT}


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
    "read_quantity",
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


def read_quantity(value: str | float, unit: str, where: str, code: str = "E024", *, difference: bool = False) -> float:
    """Return :func:`parse_quantity` of a value that stands at ``where``; raises InputError in place of UnitError."""
    try:
        return parse_quantity(value, unit, difference=difference)
    except UnitError as error:
        raise InputError(where, str(error), f'a quantity such as "1 {unit}"', code=code) from error


def _finite(number: float, value: object) -> float:
    if not math.isfinite(number):
        raise UnitError(f"{value!r} is not finite")
    if abs(number) > MAX_MAGNITUDE:
        raise UnitError(f"{value!r} is beyond what a rig may have; wanted up to {MAX_MAGNITUDE:g}")
    return number
