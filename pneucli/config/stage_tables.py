"""``[model]`` of the pipeline file."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BeforeValidator, Field, ValidationInfo, model_validator

from pneucli.config.value_types import (
    Duration,
    Force,
    Frequency,
    Name,
    Position,
    Pressure,
    Steepness,
    Table,
    Velocity,
    Voltage,
    Volume,
)
from pneucli.quantities import ROTARY_UNITS, SIGNALS
from pneucli.units import parse_quantity


class ParameterTable(Table):
    """One entry of ``[model.parameters]``: what is known beforehand, as text with a unit, or in SI."""

    fixed: str | float | None = None
    start: str | float | None = None
    min: str | float | None = None
    max: str | float | None = None
    sigma: str | float | None = None

    @model_validator(mode="after")
    def _says_something(self) -> ParameterTable:
        others = [key for key in ("start", "min", "max", "sigma") if getattr(self, key) is not None]
        if self.fixed is None and not others:
            raise ValueError("nothing is said of it; wanted fixed, or start, min, max and sigma")
        if self.fixed is not None and others:
            raise ValueError(f"what is fixed has no {others[0]}; leave one of them out")
        return self


class ModelTable(Table):
    """``[model]``: effects on top of the base model, the valve's form, what is known of parameters beforehand, and
    Python files with effects of one's own.
    """

    effects: list[str] = Field(default_factory=list)
    valve: Literal["map", "linear"] = "map"
    parameters: dict[str, ParameterTable] = Field(default_factory=dict)
    plugins: list[Name] = Field(default_factory=list)


Channel = Literal["p1", "p2", "x", "v", "a", "force", "temperature", "flow"]


class FrictionTable(Table):
    """``[identify.friction]``: of the friction models; what is absent follows from the recordings."""

    velocity_range: Annotated[Velocity, Field(gt=0)] | None = None
    nodes: Annotated[int, Field(ge=10, le=100_000)] | None = None
    eta: Steepness | None = None


class IdentifyTable(Table):
    """``[identify]``."""

    friction: FrictionTable = FrictionTable()
    weights: dict[Channel, Annotated[float, Field(ge=0, le=1e6)]] = Field(default_factory=dict)


def _parse_tolerances(value: Any, info: ValidationInfo) -> Any:
    """Read each tolerance as a difference in its channel's unit: ``"50 mbar"`` is 5000 Pa, ``"1 degC"`` is 1 K."""
    if not isinstance(value, dict):
        return value
    rotary = (info.context or {}).get("rotary")
    units = {name: SIGNALS[name].unit for name in value if name in SIGNALS}
    units = {name: ROTARY_UNITS.get(unit, unit) if rotary else unit for name, unit in units.items()}
    return {k: parse_quantity(v, units[k], difference=True) if k in units else v for k, v in value.items()}


Tolerances: TypeAlias = Annotated[
    dict[Channel, Annotated[float, Field(gt=0)]],
    BeforeValidator(_parse_tolerances, json_schema_input_type=dict[Channel, float | str]),
]


class CompareTable(Table):
    """``[compare]``: restart interval in s, corner of the low-pass in Hz, largest rms error by channel."""

    horizon: Duration | None = None  # from the time scales of the recordings
    low_pass: Frequency | None = None
    tolerance: Tolerances = Field(default_factory=dict)


class PlanTable(Table):
    """``[plan]``: the limits of the rig that a planned experiment keeps, SI; what is absent follows from the rig."""

    end_margin: Annotated[Position, Field(ge=0)] | None = None
    max_speed: Annotated[Velocity, Field(gt=0)] | None = None
    max_pressure: Pressure | None = None
    max_force: Annotated[Force, Field(gt=0)] | None = None
    max_command: Annotated[Voltage, Field(gt=0)] | None = None
    max_frequency: Frequency | None = None
    soft_start: Duration | None = None
    max_air: Volume | None = None


class CheckTable(Table):
    """One entry of ``[checks]``: limits of a value in a JSON answer."""

    max: float | None = None
    min: float | None = None
    equals: bool | int | float | str | list[Any] | None = None

    @model_validator(mode="after")
    def _limits_something(self) -> CheckTable:
        if self.max is None and self.min is None and self.equals is None:
            raise ValueError("the check limits nothing; wanted max, min or equals")
        return self
