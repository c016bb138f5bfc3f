"""Leak rates in the units of the trade: the pressure decay of a shut chamber, and the equivalent flow."""

from collections.abc import Iterator, Sequence

import numpy as np

from pneucli.messages.identify import LeakFlow, PressureLoss
from pneucli.physics.gas import flow_constant
from pneucli.physics.ports import LEAK_PORTS
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.units import parse_unit

EDGE_RATIO = 0.02  # of a recording: the median over it is the pressure at the start or end
REFERENCE_VOLUME = 1e-3  # m^3, assumed where the volume is unknown
FLOW_UNIT = "l/min ANR"


def pressure_losses(experiments: Sequence[Experiment], rig: Rig) -> Iterator[PressureLoss]:
    """Yield the pressure decay of the valve tests with a shut valve.

    Args:
        experiments: The experiments.
        rig: The rig with the vessel's volume.

    Yields:
        One loss for each recording whose pressure falls.

    """
    for experiment in experiments:
        if not (experiment.vessel and experiment.recording.valve_shut):
            continue
        p, seconds = experiment.inputs[:, at.IN_P1], float(experiment.time[-1] - experiment.time[0])
        edge = max(int(EDGE_RATIO * p.size), 1)
        start, end = float(np.median(p[:edge])), float(np.median(p[-edge:]))
        loss_rate = (start - end) / seconds
        mass_flow = (rig.vessel_volume or REFERENCE_VOLUME) * loss_rate / (rig.gas_constant * rig.gas_temperature)
        flow = normal_flow(mass_flow, rig)
        gauge_pressure = start - rig.ambient_pressure
        if loss_rate > 0.0 < gauge_pressure:
            percent = 100.0 * loss_rate / gauge_pressure
            adiabatic = flow / rig.heat_capacity_ratio
            volume_known = rig.vessel_volume is not None
            yield PressureLoss(experiment.recording.name, start, end, seconds, percent, flow, adiabatic, volume_known)


def leak_flows(model: Model, experiments: Sequence[Experiment], *, volume_known: bool) -> Iterator[LeakFlow]:
    """Yield the flow of each of the model's leaks to ambient.

    The upstream pressure is the supply's, or else the highest that was recorded.

    Args:
        model: The identified model.
        experiments: The experiments.
        volume_known: Whether the vessel's volume is known.

    Yields:
        One flow for each leak.

    """
    rig, highest_pressure = (
        model.rig,
        max((experiment.signal_ranges.pressure for experiment in experiments), default=0.0),
    )
    pressure = rig.supply_pressure or highest_pressure
    choked_flux = flow_constant(rig.gas_constant, rig.gas_temperature, rig.heat_capacity_ratio)
    for effect in model.effects:
        port = next((name for name in LEAK_PORTS if name in effect.ports), None)
        if port is not None and pressure > rig.ambient_pressure:
            mass_flow = effect.ports[port](
                pressure, rig.ambient_pressure, choked_flux, *model.effect_parameters(effect)
            )
            yield LeakFlow(effect.name, pressure, normal_flow(float(mass_flow), rig), volume_known)  # type: ignore[arg-type]


def normal_flow(mass_flow: float, rig: Rig) -> float:
    """Convert a mass flow to a volume flow of air under standard conditions (ANR, ISO 8778).

    Args:
        mass_flow: Mass flow in kg/s.
        rig: The rig; another gas than air counts by its number of moles.

    Returns:
        The flow in l/min ANR.

    References:
        ISO 8778: 100 kPa, 20 degC, 65 % relative humidity.

    >>> round(normal_flow(1.185 / 60e3, Rig()), 3)  # 1.185 kg/m^3
    1.0
    """
    return mass_flow * rig.gas_constant / 287.0 / parse_unit(FLOW_UNIT).factor
