"""The base model's parameters that a fit varies: declared as an effect's are, and sized by the rig as they are."""

from __future__ import annotations

from pneucli.physics.declaration import Parameter

_AREA = ("m^2", None, "0.01 bore areas", "100 bore areas", ("1 bore areas",))
_DEAD = ("m^3", None, "1e-3 chamber volumes", "10 chamber volumes", ("0.1 chamber volumes",))

BASE: dict[str, Parameter] = {
    "friction.coulomb": Parameter("coulomb", "N", None, 0.0, "10 supply forces", ("0.02 supply forces",)),
    "friction.viscous": Parameter(
        "viscous", "N s/m", None, 0.0, "1000 supply forces per top speed", ("0.02 supply forces per top speed",)
    ),
    "rig.moving_mass": Parameter(
        "moving_mass", "kg", None, "1e-6 driven masses", "100 driven masses", ("1e-5 driven masses",)
    ),
    "rig.piston_area_1": Parameter("piston_area_1", *_AREA),
    "rig.piston_area_2": Parameter("piston_area_2", *_AREA),
    "rig.dead_volume_1": Parameter("dead_volume_1", *_DEAD),
    "rig.dead_volume_2": Parameter("dead_volume_2", *_DEAD),
    "rig.vessel_volume": Parameter(
        "vessel_volume", "m^3", None, "1e-3 dead volumes", "1e3 dead volumes", ("1 dead volumes",)
    ),
    "rig.supply_pressure": Parameter(
        "supply_pressure", "Pa", None, "0.01 supply pressures", "10 supply pressures", ("1 supply pressures",)
    ),
    "rig.polytropic_exponent": Parameter("polytropic_exponent", "1", None, 1.0, 5.0 / 3.0, (1.2,)),
    "valve.effective_area": Parameter(
        "effective_area", "m^2", None, "1e-9 bore areas", "10 bore areas", ("1e-3 bore areas",)
    ),
    "valve.overlap": Parameter("overlap", "V", 0.0, 0.0, "1 full commands", ("0.01 full commands",)),
}
