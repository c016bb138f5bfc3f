"""The base model's parameters that a fit varies: declared as an effect's are, and sized by the rig as they are."""

from __future__ import annotations

from pneucli.physics.declaration import Parameter

BASE: dict[str, Parameter] = {
    "friction.coulomb": Parameter("coulomb", "N", None, 0.0, "10 supply forces", ("0.02 supply forces",)),
    "friction.viscous": Parameter(
        "viscous", "N s/m", None, 0.0, "1000 supply forces per top speed", ("0.02 supply forces per top speed",)
    ),
    "rig.moving_mass": Parameter(
        "moving_mass", "kg", None, "1e-6 driven masses", "100 driven masses", ("1e-5 driven masses",)
    ),
    "valve.effective_area": Parameter(
        "effective_area", "m^2", None, "1e-9 bore areas", "10 bore areas", ("1e-3 bore areas",)
    ),
    "valve.overlap": Parameter("overlap", "V", 0.0, 0.0, "1 full commands", ("0.01 full commands",)),
}
