"""The quantities of a rig for its scales: from its description, from recordings, and from the model."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from pneucli.physics.declaration import BASE_PARAMETERS
from pneucli.physics.scales import NAN, RigQuantities
from pneucli.simulate.experiment import Experiment, SignalRanges
from pneucli.simulate.model import Model

# of a recording in which only a leak flows: the time in which a leak of relevant size empties the chamber
LEAK_EMPTYING_TIME_SHARE = 0.1


def rig_quantities(model: Model, experiments: Sequence[Experiment] = ()) -> RigQuantities:
    """Return the quantities from which the scales of a rig follow.

    Args:
        model: The model with its rig.
        experiments: Experiments on the rig.

    Returns:
        The quantities, SI; NaN where rig, recordings and model give none.
    """
    rig, ranges = model.rig, [e.signal_ranges for e in experiments]
    ambient, supply = rig.ambient_pressure, rig.supply_pressure or _max_positive(s.pressure for s in ranges)
    low, high = _position_range(ranges, rig.stroke)
    stroke = rig.stroke or high - low
    vessel = model.values.get("rig.vessel_volume", rig.vessel_volume or NAN)
    area = rig.piston_area_1 or vessel ** (2.0 / 3.0)
    dead = model.base_values()["rig.dead_volume_1"] if rig.has_cylinder else vessel
    volume = dead + 0.5 * area * stroke if rig.has_cylinder else vessel
    pressed = (supply - ambient) * rig.piston_area_1 if rig.piston_area_1 else NAN
    command = _max_positive(s.command for s in ranges)
    command = _max_positive(map(abs, model.valve.commands)) if math.isnan(command) else command
    facts = RigQuantities(
        supply=supply,
        ambient=ambient,
        force=_max_positive((pressed, *(s.force for s in ranges))),
        bore_area=area,
        volume=volume,
        dead_volume=dead,
        stroke=stroke,
        x_min=low,
        x_max=high,
        max_speed=_max_positive(s.speed for s in ranges),
        mass=model.values.get("rig.moving_mass", rig.moving_mass or NAN),
        coulomb=model.values.get("friction.coulomb", NAN),
        valve_area=_max_positive(model.valve(np.array([command, -command]))) if model.valve.commands else NAN,
        max_command=command,
        sampling_period=float(np.median([s.period for s in ranges])) if ranges else NAN,
        horizon=_max_positive(e.horizon for e in experiments if e.restarts.size > 1),
        gas_temperature=rig.gas_temperature,
        specific_energy=rig.gas_constant * rig.gas_temperature,
        heat_capacity_ratio=rig.heat_capacity_ratio,
    )
    return _complete(facts, experiments)


def _complete(facts: RigQuantities, experiments: Sequence[Experiment]) -> RigQuantities:
    """Add quantities that follow from others: a leak in place of a valve, the speed that a valve allows."""
    shut = [e.time[-1] - e.time[0] for e in experiments if e.recording.kind.valve]
    if math.isnan(facts.valve_area) and shut:
        unit = replace(facts, valve_area=1.0)
        facts = replace(facts, valve_area=unit.fill_time / (LEAK_EMPTYING_TIME_SHARE * max(shut)))
    if facts.coulomb == 0.0:  # a fit without dry friction: what is usual is the scale, so that its effects can start
        usual = BASE_PARAMETERS["friction.coulomb"].range_on(facts).typical
        facts = replace(facts, coulomb=usual[0] if usual else NAN)
    if math.isnan(facts.max_speed):
        facts = replace(facts, max_speed=facts.conductance * facts.specific_energy / facts.bore_area)
    return facts


def _max_positive(values: Iterable[float]) -> float:
    """Return the largest finite positive value, NaN where there is none."""
    return max((float(v) for v in values if math.isfinite(v) and v > 0.0), default=NAN)


def _position_range(ranges: Sequence[SignalRanges], stroke: float | None) -> tuple[float, float]:
    moved = [s for s in ranges if s.high > s.low]
    if moved:
        return min(s.low for s in moved), max(s.high for s in moved)
    return (0.0, stroke) if stroke else (NAN, NAN)
