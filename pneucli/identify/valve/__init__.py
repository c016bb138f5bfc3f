"""Direct observation of a proportional valve by charge and discharge curves, and what the model lacks of it."""

from __future__ import annotations

from pneucli.identify.valve.identification import Curve, ValveIdentification, identify_valve
from pneucli.identify.valve.iso import IsoConductance
from pneucli.identify.valve.lack import LackOfFit
from pneucli.identify.valve.maps import GradientMap, InverseMap
from pneucli.identify.valve.moving import identify_moving

__all__ = [
    "Curve",
    "GradientMap",
    "InverseMap",
    "IsoConductance",
    "LackOfFit",
    "ValveIdentification",
    "identify_moving",
    "identify_valve",
]
