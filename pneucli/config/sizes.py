"""Quantities of the pipeline file, which become SI floats while they are checked, and the tables that hold them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo

from pneucli.config.values import size
from pneucli.quantities import PISTON_AREA, ROTARY
from pneucli.units import STANDARD_ATMOSPHERE, parse_quantity


@dataclass(frozen=True, slots=True)
class InUnit(BeforeValidator):
    """The reader of a quantity, with the SI unit that it reads into."""

    unit: str = ""


def _in(unit: str, rotary: str | None = None) -> InUnit:
    """Read text with a unit; gauge values stand on the file's own ambient pressure, ``rotary`` is the unit there."""

    def parse(value: Any, info: ValidationInfo) -> float | None:
        context = info.context or {}
        wanted = (rotary or ROTARY.get(unit, unit)) if context.get("rotary") else unit
        if isinstance(value, str) and "?" in value:
            raise ValueError(f'"{value}" is to be filled in; wanted a quantity such as "1 {wanted}"')
        ambient = context.get("ambient_pressure", STANDARD_ATMOSPHERE)
        return size(parse_quantity(value, wanted, ambient_pressure=ambient))

    return InUnit(parse, json_schema_input_type=float | str, unit=unit)


Pressure: TypeAlias = Annotated[float, _in("Pa"), Field(gt=0)]
Temperature: TypeAlias = Annotated[float, _in("K"), Field(gt=0)]
Area: TypeAlias = Annotated[float, _in(*PISTON_AREA), Field(gt=0)]
Volume: TypeAlias = Annotated[float, _in("m^3"), Field(gt=0)]
Length: TypeAlias = Annotated[float, _in("m"), Field(gt=0)]
Mass: TypeAlias = Annotated[float, _in("kg"), Field(gt=0)]
GasConstant: TypeAlias = Annotated[float, _in("J/(kg K)"), Field(gt=0)]
HeatCapacityRatio: TypeAlias = Annotated[float, _in("1"), Field(gt=1)]
Duration: TypeAlias = Annotated[float, _in("s"), Field(gt=0)]
Frequency: TypeAlias = Annotated[float, _in("1/s"), Field(gt=0)]
MassFlow: TypeAlias = Annotated[float, _in("kg/s")]
Instant: TypeAlias = Annotated[float, _in("s")]
Voltage: TypeAlias = Annotated[float, _in("V")]
Position: TypeAlias = Annotated[float, _in("m")]
Velocity: TypeAlias = Annotated[float, _in("m/s")]
Steepness: TypeAlias = Annotated[float, _in("s/m"), Field(gt=0)]
Acceleration: TypeAlias = Annotated[float, _in("m/s^2")]
Force: TypeAlias = Annotated[float, _in("N")]


class Table(BaseModel):
    """A table whose keys are all known."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=False)
