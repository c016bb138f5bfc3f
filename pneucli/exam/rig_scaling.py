"""Scale a rig: lengths, areas, pressures and commands change, times stay.

Every quantity is scaled by its dimension, hidden effects included, so that a rig of any size moves like the usual one.
Only the ambient pressure is not scaled: at 3 bar less of the flow is choked than at 50 bar.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.sensors import Sensors

# exponents of: lengths along the stroke, piston area, gauge pressures, absolute supply, commands
LENGTH, AREA, PRESSURE, VOLTAGE = (1, 0, 0, 0, 0), (0, 1, 0, 0, 0), (0, 0, 1, 0, 0), (0, 0, 0, 0, 1)
VOLUME = OPENING = (1, 1, 0, 0, 0)  # an opening fills the volume in the same time
FORCE, STIFFNESS, PER_LENGTH_SQUARED = (0, 1, 1, 0, 0), (-1, 1, 1, 0, 0), (-2, 1, 1, 0, 0)
MASS = DAMPING = STIFFNESS  # times stay
PER_LENGTH, OPENING_PER_PRESSURE = (-1, 0, 0, 0, 0), (1, 1, -1, 0, 0)
FLOW = HEAT_CONDUCTANCE = (1, 1, 0, 1, 0)
PER_PRESSURE, FLOW_PER_PRESSURE, PER_FLOW = (
    (0, 0, -1, 0, 0),
    (1, 1, -1, 1, 0),
    (-1, -1, 0, -1, 0),
)

DIMENSIONS = {
    "piston_area_1": AREA,
    "piston_area_2": AREA,
    "stroke": LENGTH,
    "dead_volume_1": VOLUME,
    "dead_volume_2": VOLUME,
    "mass": MASS,
    "coulomb": FORCE,
    "viscous": DAMPING,
    "effective_area": OPENING,
    "heat_conductance": HEAT_CONDUCTANCE,
    "leak_area": OPENING,
    "laminar_conductance": FLOW_PER_PRESSURE,
    "relief_growth": OPENING_PER_PRESSURE,
    "relief_pressure": PRESSURE,
    "piston_leak_area": OPENING,
    "leak_area_2": OPENING,
    "laminar_conductance_2": FLOW_PER_PRESSURE,
    "relief_growth_2": OPENING_PER_PRESSURE,
    "relief_pressure_2": PRESSURE,
    "dead_volume_added_2": VOLUME,
    "pressure_offset_2": PRESSURE,
    "regulated_span": PRESSURE,
    "regulated_band": PRESSURE,
    "pump_flow": FLOW,
    "pump_stall": PRESSURE,
    "dead_volume_added": VOLUME,
    "supply_volume": VOLUME,
    "hose_bore": LENGTH,
    "regulator_conductance": FLOW_PER_PRESSURE,
    "valve_leak_area": OPENING,
    "static": FORCE,
    "stribeck_velocity": LENGTH,
    "bristle_stiffness": STIFFNESS,
    "bristle_damping": DAMPING,
    "pressure_gain": PER_PRESSURE,
    "position_from": LENGTH,
    "position_to": LENGTH,
    "constant_force": FORCE,
    "spring_stiffness": STIFFNESS,
    "spring_rest": LENGTH,
    "extra_mass": MASS,
    "cushion_length": LENGTH,
    "cushion_damping": DAMPING,
    "pressure_offset": PRESSURE,
    "acceleration_bias": LENGTH,
    "pitch_force": FORCE,
    "pitch": LENGTH,
    "quadratic_drag": PER_LENGTH_SQUARED,
    "load_mass": MASS,
    "load_stiffness": STIFFNESS,
    "load_damping": DAMPING,
    "load_gap": LENGTH,
    "swinging_force": FORCE,
    "ripple": PRESSURE,
    "silencer": PER_FLOW,
    "pressure_curvature": PER_PRESSURE,
    "position_curvature": PER_LENGTH,
    "effective_area_2": OPENING,
    "stop_stiffness": STIFFNESS,
    "stop_damping": DAMPING,
    "overlap": VOLTAGE,
    "overlap_2": VOLTAGE,
    "valve_half_width": VOLTAGE,
    "spool_stiction": VOLTAGE,
    "command_range": VOLTAGE,
}
"""The exponents of every field of ``Parameters`` that is scaled."""


@dataclass(frozen=True)
class RigScaling:
    """Ratios of a rig to the usual one: lengths, piston areas, gauge pressures, absolute supply, commands."""

    length: float = 1.0
    area: float = 1.0
    pressure: float = 1.0
    supply: float = 1.0
    command: float = 1.0

    @classmethod
    def for_target(cls, par: Parameters, bore: float | None, supply: float | None, command: float = 10.0) -> RigScaling:
        """Return the ratios that scale ``par`` to a bore, a supply and a command.

        The stroke grows with the root of the bore, about as in catalogues of cylinders, in whole millimetres.

        Args:
            par: The usual rig.
            bore: The diameter of the piston in m; None keeps it.
            supply: The absolute supply pressure in Pa; None keeps it.
            command: The command in V from the null at which the valve is fully open.

        """
        area = 1.0 if bore is None else 0.25 * np.pi * bore**2 / par.piston_area_1
        length = round(par.stroke * area**0.25, 3) / par.stroke
        wanted = par.supply if supply is None else supply
        pressure = (wanted - par.ambient) / (par.supply - par.ambient)
        return cls(length, area, pressure, wanted / par.supply, command / par.command_range)

    def scale_rig(self, par: Parameters) -> Parameters:
        """Return the scaled rig."""
        ratios = (self.length, self.area, self.pressure, self.supply, self.command)
        factors = {
            field: float(np.prod([ratio**power for ratio, power in zip(ratios, powers, strict=True)]))
            for field, powers in DIMENSIONS.items()
        }
        changed = {field: getattr(par, field) * factor for field, factor in factors.items()}
        return par._replace(supply=par.supply * self.supply, **changed)

    def scale_sensors(self, sensors: Sensors) -> Sensors:
        """Return sensors with the same noise relative to their signals; encoders have decimal steps."""
        return replace(
            sensors,
            pressure=sensors.pressure * self.pressure,
            hum=sensors.hum * self.pressure,
            acceleration=sensors.acceleration * self.length,
            force=sensors.force * self.area * self.pressure,
            position_step=sensors.position_step * 10.0 ** np.floor(np.log10(self.length) + 1e-9),
        )
