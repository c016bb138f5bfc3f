"""``[rig]`` of the pipeline file."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from pneucli.config.value_types import (
    Angle,
    Area,
    Force,
    GasConstant,
    GaugePressure,
    HeatCapacityRatio,
    Length,
    Mass,
    Pressure,
    Stiffness,
    Table,
    Temperature,
    Voltage,
    Volume,
)
from pneucli.gases import GASES, GasName
from pneucli.units import STANDARD_ATMOSPHERE


class VesselTable(Table):
    """``[rig.vessel]``: the fixed chamber of a valve test (m^3)."""

    volume: Volume | None = None


def _of_ports(name: Any) -> Any:
    """Return the arrangement of a valve of three ports, which serves one chamber; other names unchanged."""
    return "one-chamber" if name in ("3/2", "3/3") else name


class ValveTable(Table):
    """``[rig.valve]``: how the valves are connected, the command in V at which nothing flows, and their kind."""

    arrangement: Annotated[Literal["one-chamber", "5/3", "two"], BeforeValidator(_of_ports)] | None = None
    null: Voltage | Literal["identify"] = 0.0
    kind: Literal["proportional", "switching", "pressure"] = "proportional"


class SourceTable(Table):
    """``[rig.source]``: what fills the valve, or without a valve the chamber."""

    kind: Literal["regulator", "pump", "ejector"] = "regulator"


def _share_of_travel(travel: Any) -> float:
    """Return a travel that is stated in percent as a share of the stroke."""
    number, _, rest = str(travel).partition("%")
    try:
        share = float(number) / 100.0
    except ValueError:
        share = -1.0
    if rest.strip() or "%" not in str(travel) or not 0.0 <= share <= 1.0:
        raise ValueError(f'effective_area states the travel {travel!r}; wanted percent of the stroke, such as "40 %"')
    return share


Travel = Annotated[float, BeforeValidator(_share_of_travel, json_schema_input_type=str)]


class CylinderTable(Table):
    """``[rig.cylinder]`` in m^2, m, m^3 and kg; of a rotary axis m^3/rad, rad, m^3 and kg m^2."""

    piston_area_1: Area | None = None
    piston_area_2: Area | None = None
    effective_area: Annotated[list[tuple[Travel, Area]], Field(min_length=2)] | None = None
    stroke: Length | None = None
    dead_volume_1: Volume | None = None
    dead_volume_2: Volume | None = None
    moving_mass: Mass | None = None
    moment_of_inertia: Mass | None = None
    spring: Stiffness | None = None
    preload: Force | None = None
    bench_range: Annotated[list[GaugePressure], Field(min_length=2, max_length=2)] | None = None
    angle: Angle | None = None
    chamber_2: Literal["ambient"] | None = None

    @model_validator(mode="after")
    def _moves_one_way(self) -> CylinderTable:
        if self.moving_mass is not None and self.moment_of_inertia is not None:
            raise ValueError("an axis has a moving_mass or, if it turns, a moment_of_inertia; leave one of them out")
        return self

    @model_validator(mode="after")
    def _area_of_diaphragm(self) -> CylinderTable:
        if self.effective_area is None:
            return self
        if self.piston_area_1 is not None:
            raise ValueError("effective_area is that of piston_area_1, and both are stated; wanted one of them")
        shares, areas = np.array(sorted(self.effective_area)).T
        if shares[0] == shares[-1]:
            raise ValueError("effective_area states one travel alone; wanted areas from 0 % to 100 %")
        object.__setattr__(self, "piston_area_1", float(np.trapezoid(areas, shares) / (shares[-1] - shares[0])))
        return self


class RigTable(Table):
    """``[rig]``; pressures absolute in Pa, temperature in K.

    ``thermal``: how the gas in a chamber changes, or the exponent of it (1: isothermal).
    """

    gas_temperature: Temperature = 293.15
    ambient_pressure: Pressure = STANDARD_ATMOSPHERE
    supply_pressure: Pressure | None = None
    gas: GasName = "air"
    thermal: Annotated[float, Field(ge=1.0)] | Literal["adiabatic", "isothermal", "identify"] = "adiabatic"
    heat_capacity_ratio: HeatCapacityRatio | None = None
    gas_constant: GasConstant | None = None
    vessel: VesselTable = VesselTable()
    valve: ValveTable = ValveTable()
    cylinder: CylinderTable = CylinderTable()
    source: SourceTable = SourceTable()

    def stated(self) -> dict[str, Any]:
        """Return what is stated of gas, pressures and cylinder by name, SI; a gas by name has its constants."""
        plain = self.model_dump(exclude={"vessel", "cylinder", "valve", "source", "gas", "thermal"})
        of_effects = {"spring", "preload", "bench_range", "angle", "chamber_2", "effective_area"}  # or of others
        gas, cylinder = GASES[self.gas], self.cylinder.model_dump(exclude={"moment_of_inertia", *of_effects})
        if self.cylinder.moment_of_inertia is not None:
            cylinder["moving_mass"] = self.cylinder.moment_of_inertia
        plain["heat_capacity_ratio"] = self.heat_capacity_ratio or gas.heat_capacity_ratio
        plain["gas_constant"] = self.gas_constant or gas.gas_constant
        exponent = 1.0 if self.thermal == "isothermal" else self.thermal if isinstance(self.thermal, float) else None
        return {**plain, **cylinder, "polytropic_exponent": exponent, "exponent_free": self.thermal == "identify"}
