"""Direct identification of a valve from charge and discharge curves, and the lack of fit of the model to them."""

from __future__ import annotations

from pneucli.identify.valve.identification import identify_valve
from pneucli.identify.valve.iso6358 import IsoConductance
from pneucli.identify.valve.lack_of_fit import LackOfFit
from pneucli.identify.valve.maps import GradientMap, InverseMap
from pneucli.identify.valve.moving_piston import identify_valve_on_piston
from pneucli.identify.valve.result import Curve, ValveIdentification

__all__ = [
    "Curve",
    "GradientMap",
    "InverseMap",
    "IsoConductance",
    "LackOfFit",
    "ValveIdentification",
    "identify_valve",
    "identify_valve_on_piston",
]
