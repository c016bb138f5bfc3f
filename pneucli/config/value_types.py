"""Single values of the pipeline file that are no quantities: factors, marks, encodings, names."""

import math
import re
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo

from pneucli.quantities import PISTON_AREA_UNITS, ROTARY_UNITS
from pneucli.units import STANDARD_ATMOSPHERE, parse_quantity

# what may have a tolerance, and the parameter of which it is prior knowledge: limits "+- a" are a standard deviation of
# a / sqrt(3) (JCGM 100:2008, 4.3.7)
TOLERANCED = {
    **{name: f"rig.{name}" for name in ("piston_area_1", "piston_area_2", "dead_volume_1", "dead_volume_2")},
    "moving_mass": "rig.moving_mass",
    "moment_of_inertia": "rig.moving_mass",
    "volume": "rig.vessel_volume",
    "spring": "spring",
}
MIN_MAGNITUDE = 1e-30  # of any number of a rig that is not 0, in SI: quotients stay finite


def require_dividable(number: float) -> float:
    """Return ``number``; raises ValueError where it is too small to divide by and not 0."""
    if 0.0 < abs(number) < MIN_MAGNITUDE:
        raise ValueError(f"{number} is next to nothing; wanted 0, or a size of at least {MIN_MAGNITUDE:g}")
    return number


def _check_scale(scale: float) -> float:
    if require_dividable(scale) == 0.0:
        raise ValueError(f"{scale} makes nothing of the column; wanted a factor other than 0")
    return scale


def _check_delimiter(text: str) -> str:
    known = text == "\t" or (len(text) == 1 and text.isascii() and text.isprintable() and not _occurs_in_numbers(text))
    if not (known or not text.strip(" ") or text in (r"\s+", "whitespace")):
        raise ValueError(f"{text!r} cannot stand between columns; wanted one character, such as a tab, ; or ,")
    return text


def _check_thousands(text: str) -> str:
    if text.isalnum() or text in "+-":
        raise ValueError(f"{text!r} cannot stand between thousands; wanted a character such as . or ,")
    return text


def _occurs_in_numbers(character: str) -> bool:
    return character.isalnum() or character in '+-."#'


def _check_encoding(name: str) -> str:
    """Check that the name is that of an encoding of text; the standard library has others, such as hex and zlib."""
    plain = "x" * 100 + ";1.5,-2e3\t\n"
    try:
        known = plain.encode(name).endswith(tuple(map(plain.encode, ("ascii", "utf-16le", "utf-16be", "utf-32le"))))
    except (LookupError, ValueError):
        known = False
    if not known:
        raise ValueError(f'"{name}" is no encoding of text; wanted one such as "utf-8", "cp1252" or "utf-16"')
    return name


Scale: TypeAlias = Annotated[float, AfterValidator(_check_scale)]
DecimalMark: TypeAlias = Literal[".", ","]
Delimiter: TypeAlias = Annotated[str, Field(min_length=1), AfterValidator(_check_delimiter)]
Thousands: TypeAlias = Annotated[str, Field(min_length=1, max_length=1), AfterValidator(_check_thousands)]
Encoding: TypeAlias = Annotated[str, AfterValidator(_check_encoding)]
Column: TypeAlias = Annotated[int, Field(strict=True, ge=1)] | Annotated[str, Field(strict=True, min_length=1)]
Name: TypeAlias = Annotated[str, Field(pattern=r"\S")]


@dataclass(frozen=True, slots=True)
class QuantityReader(BeforeValidator):
    """The reader of a quantity, with the SI unit that it reads into."""

    unit: str = ""


def _quantity_in(unit: str, rotary: str | None = None, *, gauge: bool = False) -> QuantityReader:
    """Read text with a unit; gauge values stand on the file's own ambient pressure, ``rotary`` is the unit there.

    ``gauge``: a pressure over ambient, however its unit is written.
    """

    def parse(value: Any, info: ValidationInfo) -> float | None:
        context = info.context or {}
        wanted = (rotary or ROTARY_UNITS.get(unit, unit)) if context.get("rotary") else unit
        if isinstance(value, str) and "?" in value:
            raise ValueError(f'"{value}" is to be filled in; wanted a quantity such as "{value.replace("?", "1")}"')
        ambient = context.get("ambient_pressure", STANDARD_ATMOSPHERE)
        value, tolerance = _split_tolerance(value)
        number = require_dividable(parse_quantity(value, wanted, ambient_pressure=ambient, difference=gauge))
        if tolerance:
            if info.field_name not in TOLERANCED:
                raise ValueError(f"a tolerance says nothing here; wanted one of {', '.join(TOLERANCED)} to have it")
            deviation = _tolerance(tolerance, number, wanted) / math.sqrt(3.0)
            context.get("tolerances", {})[TOLERANCED[info.field_name]] = deviation
        return number

    return QuantityReader(parse, json_schema_input_type=float | str, unit=unit)


def _split_tolerance(value: Any) -> tuple[Any, str]:
    """Return a quantity and its tolerance, which is empty where none is stated.

    >>> _split_tolerance("38 cm^3 +- 5 %")
    ('38 cm^3', '5 %')
    """
    if not isinstance(value, str):
        return value, ""
    number, *tolerance = re.split(r"\s*(?:\+/?-|±)\s*", value, maxsplit=1)
    return (number, tolerance[0]) if tolerance else (value, "")


def _tolerance(text: str, number: float, unit: str) -> float:
    """Return a tolerance in the unit of its quantity; a percentage is of the quantity."""
    share = re.fullmatch(r"([0-9.]+)\s*%", text.strip())
    found = abs(number) * float(share[1]) / 100.0 if share else parse_quantity(text, unit, difference=True)
    if not found > 0.0:
        raise ValueError(f'the tolerance "{text}" is not above 0; wanted one such as "5 %" or "1 {unit}"')
    return found


Pressure: TypeAlias = Annotated[float, _quantity_in("Pa"), Field(gt=0)]
Temperature: TypeAlias = Annotated[float, _quantity_in("K"), Field(gt=0)]
Area: TypeAlias = Annotated[float, _quantity_in(*PISTON_AREA_UNITS), Field(gt=0)]
Volume: TypeAlias = Annotated[float, _quantity_in("m^3"), Field(gt=0)]
Length: TypeAlias = Annotated[float, _quantity_in("m"), Field(gt=0)]
Mass: TypeAlias = Annotated[float, _quantity_in("kg"), Field(gt=0)]
GasConstant: TypeAlias = Annotated[float, _quantity_in("J/(kg K)"), Field(gt=0)]
HeatCapacityRatio: TypeAlias = Annotated[float, _quantity_in("1"), Field(gt=1)]
Duration: TypeAlias = Annotated[float, _quantity_in("s"), Field(gt=0)]
Frequency: TypeAlias = Annotated[float, _quantity_in("Hz"), Field(gt=0)]
MassFlow: TypeAlias = Annotated[float, _quantity_in("kg/s")]
Instant: TypeAlias = Annotated[float, _quantity_in("s")]
Voltage: TypeAlias = Annotated[float, _quantity_in("V")]
Position: TypeAlias = Annotated[float, _quantity_in("m")]
Velocity: TypeAlias = Annotated[float, _quantity_in("m/s")]
Steepness: TypeAlias = Annotated[float, _quantity_in("s/m"), Field(gt=0)]
Acceleration: TypeAlias = Annotated[float, _quantity_in("m/s^2")]
Force: TypeAlias = Annotated[float, _quantity_in("N")]
Stiffness: TypeAlias = Annotated[float, _quantity_in("N/m"), Field(gt=0)]
GaugePressure: TypeAlias = Annotated[float, _quantity_in("Pa", gauge=True)]
Angle: TypeAlias = Annotated[float, _quantity_in("rad", "rad")]


class Table(BaseModel):
    """A table whose keys are all known."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=False, defer_build=True)
