"""Friction over velocity from recordings of a cylinder: measured curves, models A to F, and their simulation errors."""

from __future__ import annotations

from pneucli.identify.friction.friction_model import FrictionModel, ModelBranch, VelocityDomain
from pneucli.identify.friction.identification import FrictionIdentification, identify_friction
from pneucli.identify.friction.imposed_motion import KineticFriction
from pneucli.identify.friction.kinematics import Motion, estimate_motion
from pneucli.identify.friction.model_error import Deviation
from pneucli.identify.friction.models_a_to_f import grid_convergence
from pneucli.identify.friction.samples import FrictionCurve
from pneucli.identify.friction.stick_slip import AveragedFriction, StickSlip

__all__ = [
    "AveragedFriction",
    "Deviation",
    "FrictionCurve",
    "FrictionIdentification",
    "FrictionModel",
    "KineticFriction",
    "ModelBranch",
    "Motion",
    "StickSlip",
    "VelocityDomain",
    "estimate_motion",
    "grid_convergence",
    "identify_friction",
]
