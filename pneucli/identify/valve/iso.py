"""Sonic conductance, critical ratio and subsonic index per command (ISO 6358-1), with what a vessel cannot know."""
from __future__ import annotations
from dataclasses import dataclass
from pneucli.identify.valve.fit import Fit
from pneucli.identify.valve.law import Law
from pneucli.identify.valve.stretches import Stretches
from pneucli.recording import Rig

@dataclass(frozen=True)
class IsoConductance:
    u: float

def iso_conductance(law: Law, fit: Fit, data: Stretches, rig: Rig) -> tuple[IsoConductance, ...]:
    return ()
