"""Friction over velocity from recordings of a cylinder: measured curves, models A to F, and how well each drives."""

from __future__ import annotations

from pneucli.identify.friction.binned_curve import FrictionCurve
from pneucli.identify.friction.identification import FrictionIdentification, identify_friction
from pneucli.identify.friction.imposed_motion import KineticFriction
from pneucli.identify.friction.kinematics import Motion, motion_of
from pneucli.identify.friction.model_error import Deviation
from pneucli.identify.friction.models_a_to_f import Domain, FrictionModel, ModelBranch, grid_convergence
from pneucli.identify.friction.samples import Value
from pneucli.identify.friction.stick_slip import Averaged, Cut

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
