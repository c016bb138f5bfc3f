"""Leaks in the units of the trade: how fast a shut chamber loses its pressure, and what flow that is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.physics.gas import flow_constant
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.units import parse_unit

EDGE_RATIO = 0.02  # of a recording, whose median is the pressure at its start or end
REFERENCE_VOLUME = 1e-3  # m^3, for which a flow is told where the volume is not known
FLOW_UNIT = "l/min ANR"
LEAK_PORTS = ("leak_1_ambient", "leak_2_ambient", "leak_1_2")


@dataclass(frozen=True)
class PressureLoss:
    """What one shut chamber lost: pressures in Pa at both ends of ``seconds``, ``percent`` of the pressure above
    ambient at the start in each second, and the flow in l/min ANR if the gas kept the wall's temperature or took none
    of its heat; of a litre where the volume is not known.
    """

    recording: str
    start: float
    end: float
    seconds: float
    percent: float
    isothermal: float
    adiabatic: float
    volume_known: bool


@dataclass(frozen=True)
class LeakFlow:
    """The flow in l/min ANR of one of the model's leaks from a pressure (Pa) to ambient; of a litre where the vessel's
    volume is not known.
    """

    effect: str
    pressure: float
    flow: float
    volume_known: bool


def pressure_losses(experiments: Sequence[Experiment], rig: Rig) -> Iterator[PressureLoss]:
    """Yield what the shut chambers of valve tests lost; nothing for one that lost nothing."""
    for e in experiments:
        if not (e.vessel and e.recording.valve_shut):
            continue
        p, seconds = e.inputs[:, at.IN_P1], float(e.time[-1] - e.time[0])
        edge = max(int(EDGE_RATIO * p.size), 1)
        start, end = float(np.median(p[:edge])), float(np.median(p[-edge:]))
        lost = (start - end) / seconds
        mass = (rig.vessel_volume or REFERENCE_VOLUME) * lost / (rig.gas_constant * rig.gas_temperature)
        flow = normal_flow(mass, rig)
        above = start - rig.ambient_pressure
        if lost > 0.0 < above:
            share = 100.0 * lost / above
            adiabatic = flow / rig.heat_capacity_ratio
            known = rig.vessel_volume is not None
            yield PressureLoss(e.recording.name, start, end, seconds, share, flow, adiabatic, known)


def leak_flows(model: Model, experiments: Sequence[Experiment], *, volume_known: bool) -> Iterator[LeakFlow]:
    """Yield the flow of each of the model's leaks to ambient, at the supply's pressure or else the highest recorded."""
    rig, seen = model.rig, max((e.signal_ranges.pressure for e in experiments), default=0.0)
    pressure = rig.supply_pressure or seen
    k = flow_constant(rig.gas_constant, rig.gas_temperature, rig.heat_capacity_ratio)
    for effect in model.effects:
        port = next((name for name in LEAK_PORTS if name in effect.ports), None)
        if port is not None and pressure > rig.ambient_pressure:
            mass = effect.ports[port](pressure, rig.ambient_pressure, k, *model.effect_parameters(effect))
            yield LeakFlow(effect.name, pressure, normal_flow(float(mass), rig), volume_known)  # type: ignore[arg-type]


def normal_flow(mass_flow: float, rig: Rig) -> float:
    """Return a flow in kg/s in l/min ANR: the volume that as many moles of air have under standard conditions."""
    return mass_flow * rig.gas_constant / 287.0 / parse_unit(FLOW_UNIT).factor
