"""The paths of a valve that fill and vent one chamber, as one recording shows them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.physics.gas import CRITICAL_RATIO, orifice_flow
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment

Array = NDArray[np.float64]

PRESSURES = {1: ("p1", at.IN_P1), 2: ("p2", at.IN_P2)}


@dataclass(frozen=True)
class Paths:
    """A recording of the paths of one chamber, or of a vessel in its place; arrays of shape (n,).

    ``opening`` is the command in V from the null one, positive where it fills; ``flow`` the mass flow in kg/s into the
    chamber by the base model's balance of the smoothed pressure, ``per_area`` that of the base model in kg/(s m^2) at
    the sign of the opening.
    """

    experiment: Experiment
    opening: Array
    flow: Array
    per_area: Array


def driven(experiments: Sequence[Experiment]) -> list[Experiment]:
    """Return the experiments in which a valve is commanded."""
    return [e for e in experiments if e.flags[at.PNEUMATICS] > 0 and "u" in e.raw and not e.recording.valve_shut]


def paths(experiments: Sequence[Experiment], rig: Rig, chamber: int, vessel_volume: float) -> Iterator[Paths]:
    """Yield what each driven experiment shows of the paths of chamber 1 or 2."""
    for e in driven(experiments):
        if opening_of(e, chamber) is not None:
            yield _paths(e, rig, chamber, vessel_volume)


def opening_of(e: Experiment, chamber: int) -> Array | None:
    """Return the command in V from the null one of the paths of a chamber; None where they are not seen."""
    null = e.rig.valve_null
    if e.vessel:
        return np.asarray(e.inputs[:, at.IN_U] - null) if e.recording.chamber == chamber else None
    if chamber == 1:
        return np.asarray(e.inputs[:, at.IN_U] - null)
    if "p2" not in e.raw or e.flags[at.CHAMBER_2] not in (at.VALVE_2, at.MIRRORED):
        return None
    mirrored = e.flags[at.CHAMBER_2] == at.MIRRORED
    return np.asarray(null - e.inputs[:, at.IN_U] if mirrored else e.inputs[:, at.IN_U2] - null)


def _paths(e: Experiment, rig: Rig, chamber: int, vessel_volume: float) -> Paths:
    opening = opening_of(e, chamber)
    assert opening is not None
    name, column = PRESSURES[1 if e.vessel else chamber]
    p, kappa = e.inputs[:, column], rig.heat_capacity_ratio
    slope = e.smoothers[name].slope(e.raw[name]) if name in e.smoothers else np.gradient(p, e.time)
    volume, growth = _volume(e, rig, chamber, vessel_volume)
    gas = rig.gas_constant * rig.gas_temperature
    flow = (slope * volume + kappa * p * growth) / (kappa * gas)
    k = np.sqrt(2.0 / gas)
    supply, ambient = e.inputs[:, at.IN_SUPPLY], rig.ambient_pressure
    unit = (
        orifice_flow(s, q, CRITICAL_RATIO, k, k) if c > 0 else -orifice_flow(q, ambient, CRITICAL_RATIO, k, k)
        for c, q, s in zip(opening, p, supply, strict=True)
    )
    return Paths(e, opening, flow, np.fromiter(unit, np.float64, opening.size))


def _volume(e: Experiment, rig: Rig, chamber: int, vessel_volume: float) -> tuple[Array | float, Array | float]:
    """Return the volume in m^3 and its growth in m^3/s."""
    if e.vessel:
        return vessel_volume, 0.0
    area, x, v = rig.areas[chamber - 1], e.inputs[:, at.IN_X], e.inputs[:, at.IN_V]
    if chamber == 1:
        return (rig.dead_volume_1 or 0.0) + area * x, area * v
    return (rig.dead_volume_2 or 0.0) + area * ((rig.stroke or 0.0) - x), -area * v
