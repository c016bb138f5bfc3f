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
HOSE_BORE = (0.5, 0.5, 0, 0, 0)  # the volume of a hose, whose delay stays, is a part of the dead volume
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
    name: exponents
    for exponents, names in (
        (AREA, "piston_area_1 piston_area_2"),
        (
            LENGTH,
            "stroke stribeck_velocity position_from position_to spring_rest cushion_length "
            "acceleration_bias pitch load_gap",
        ),
        (HOSE_BORE, "hose_bore"),
        (VOLUME, "dead_volume_1 dead_volume_2 dead_volume_added_2 dead_volume_added supply_volume"),
        (MASS, "mass extra_mass load_mass"),
        (FORCE, "coulomb static constant_force pitch_force swinging_force"),
        (DAMPING, "viscous bristle_damping cushion_damping load_damping stop_damping"),
        (OPENING, "effective_area leak_area piston_leak_area leak_area_2 valve_leak_area effective_area_2"),
        (HEAT_CONDUCTANCE, "heat_conductance"),
        (FLOW_PER_PRESSURE, "laminar_conductance laminar_conductance_2 regulator_conductance pump_slip"),
        (OPENING_PER_PRESSURE, "relief_growth relief_growth_2"),
        (
            PRESSURE,
            "relief_pressure relief_pressure_2 pressure_offset_2 regulated_span regulated_band pressure_offset ripple",
        ),
        (FLOW, "pump_flow"),
        (STIFFNESS, "bristle_stiffness spring_stiffness load_stiffness stop_stiffness"),
        (PER_PRESSURE, "pressure_gain pressure_curvature pump_clearance"),
        (PER_LENGTH_SQUARED, "quadratic_drag"),
        (PER_FLOW, "silencer"),
        (PER_LENGTH, "position_curvature"),
        (VOLTAGE, "overlap overlap_2 valve_half_width spool_stiction command_range"),
    )
    for name in names.split()
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
