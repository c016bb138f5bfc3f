"""Tables of units: symbols with SI prefixes, symbols without, names in words, and the ways in which they are spelled.

Factors: SI brochure (9th edition, 2019); NIST SP 811 (2008) for units outside the SI, conventional water and mercury
columns included. Standard volumes: ISO 8778 (20 °C, 100 kPa, 65 % humidity), DIN 1343 and SEMI E12 (0 °C, 101.325 kPa,
dry), ISO 13443 (15 °C, 101.325 kPa, dry), ISO 1217 (20 °C, 100 kPa, dry).
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

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
