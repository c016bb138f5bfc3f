"""Direct identification of a proportional valve from charge and discharge curves."""

from __future__ import annotations

from pneucli.identify.valve.identification import (
    CommandArea,
    Curve,
    Value,
    ValveIdentification,
    identify_valve,
)
from pneucli.identify.valve.iso import IsoConductance
from pneucli.identify.valve.maps import GradientMap, InverseMap

__all__ = [
    "CommandArea",
    "Curve",
    "GradientMap",
    "InverseMap",
    "IsoConductance",
    "Value",
    "ValveIdentification",
    "identify_valve",
]
