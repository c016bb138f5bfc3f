"""Friction over velocity from recordings of a cylinder: measured curves, models A to F, and how well each drives."""

from __future__ import annotations

from pneucli.identify.friction.curve import FrictionCurve
from pneucli.identify.friction.identification import FrictionIdentification, identify_friction
from pneucli.identify.friction.imposed import KineticFriction
from pneucli.identify.friction.models import Domain, FrictionModel, ModelBranch, grid_convergence
from pneucli.identify.friction.motion import Motion, motion_of
from pneucli.identify.friction.stickslip import Averaged, Cut
from pneucli.identify.friction.tables import Deviation
from pneucli.identify.friction.values import Value

__all__ = [
    "Averaged",
    "Cut",
    "Deviation",
    "Domain",
    "FrictionCurve",
    "FrictionIdentification",
    "FrictionModel",
    "KineticFriction",
    "ModelBranch",
    "Motion",
    "Value",
    "grid_convergence",
    "identify_friction",
    "motion_of",
]
