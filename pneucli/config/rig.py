"""``[rig]`` of the pipeline file."""

from __future__ import annotations

from typing import Literal

from pneucli.config.sizes import (
    Area,
    GasConstant,
    HeatCapacityRatio,
    Length,
    Mass,
    Pressure,
    Table,
    Temperature,
    Voltage,
    Volume,
)
from pneucli.units import STANDARD_ATMOSPHERE


class VesselTable(Table):
    """``[rig.vessel]``: the fixed chamber of a valve test (m^3)."""

    volume: Volume | None = None


class ValveTable(Table):
    """``[rig.valve]``: how the valves are connected, the command in V at which nothing flows, and their kind."""

    arrangement: Literal["one-chamber", "5/3", "two"] | None = None
    null: Voltage | Literal["identify"] = 0.0
    kind: Literal["proportional", "switching"] = "proportional"


class CylinderTable(Table):
    """``[rig.cylinder]`` in m^2, m, m^3 and kg."""

    piston_area_1: Area | None = None
    piston_area_2: Area | None = None
    stroke: Length | None = None
    dead_volume_1: Volume | None = None
    dead_volume_2: Volume | None = None
    moving_mass: Mass | None = None


class RigTable(Table):
    """``[rig]``; pressures absolute in Pa, temperature in K."""

    gas_temperature: Temperature = 293.15
    ambient_pressure: Pressure = STANDARD_ATMOSPHERE
    supply_pressure: Pressure | None = None
    heat_capacity_ratio: HeatCapacityRatio = 1.4
    gas_constant: GasConstant = 287.0
    vessel: VesselTable = VesselTable()
    valve: ValveTable = ValveTable()
    cylinder: CylinderTable = CylinderTable()
