"""The gas of one chamber as a recording shows it: its volume, what flows into it, and what more flow would do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment, segment_lengths

Array = NDArray[np.float64]
Chamber = Literal[1, 2]

PRESSURE_SIGNALS = {1: ("p1", at.IN_P1), 2: ("p2", at.IN_P2)}
MIN_DECAY = 1e-4  # of an error of a start: what is left of it then is no scale for what came later


@dataclass(frozen=True)
class ChamberGas:
    """A chamber, or a vessel in its place; arrays of shape (n,).

    ``volume`` in m^3 and its ``volume_rate`` in m^3/s; ``flow`` the mass flow in kg/s into it by the balance of its
    pressure, ``swept_flow`` the part of it that the growing volume takes; ``stiffness`` in Pa/kg, by which gas that is
    added raises the pressure.
    """

    volume: Array
    volume_rate: Array
    flow: Array
    swept_flow: Array
    stiffness: Array


def measured_gas(e: Experiment, rig: Rig, chamber: Chamber, vessel_volume: float) -> ChamberGas:
    """Return what an experiment that reads the pressure of a chamber shows of its gas."""
    name, column = PRESSURE_SIGNALS[1 if e.vessel else chamber]
    p = e.inputs[:, column]
    slope = e.smoothers[name].slope(e.raw[name]) if name in e.smoothers else np.gradient(p, e.time)
    return gas_balance(rig, *_volume_and_rate(e, rig, chamber, vessel_volume), p, slope)


def modelled_gas(e: Experiment, rig: Rig, chamber: Chamber, vessel_volume: float, p: Array) -> ChamberGas:
    """Return the gas of a chamber whose pressure (n,) a model has, from each restart on."""
    slope, last = np.gradient(p, e.time), np.append(e.restarts[1:], e.time.size) - 1
    for edge, inner in ((e.restarts, np.minimum(e.restarts + 1, last)), (last, np.maximum(last - 1, e.restarts))):
        slope[edge] = slope[inner]
    return gas_balance(rig, *_volume_and_rate(e, rig, chamber, vessel_volume), p, slope)


def gas_balance(rig: Rig, volume: Array, growth: Array, p: Array, slope: Array) -> ChamberGas:
    """Return the gas by the balance of a chamber at p in Pa that rises with ``slope`` in Pa/s (thesis 2.28, 2.29)."""
    exponent = rig.polytropic_exponent or rig.heat_capacity_ratio
    specific = rig.gas_constant * rig.gas_temperature
    flow = (slope * volume + exponent * p * growth) / (exponent * specific)
    return ChamberGas(volume, growth, flow, p * growth / specific, exponent * specific / volume)


def pressure_deviation(e: Experiment, gas: ChamberGas, flow: Array, decay: Array) -> Array:
    """Return by how much the pressure (k, n) differs, in Pa, where some more ``flow`` (k, n), in kg/s, goes in.

    From each restart on, and to first order: ``decay`` (n,) is what an error of the start becomes, in any unit, since
    all gas that is added fades alike.
    """
    least = MIN_DECAY * float(np.max(np.abs(decay)))
    scale = np.where(np.abs(decay) > least, decay, least)
    total = np.cumsum(flow * (gas.stiffness * e.recording.period / scale), axis=-1)
    before = np.repeat(total[:, e.restarts], segment_lengths(e.restarts, e.time.size), axis=-1)
    return np.asarray((total - before) * scale)


def sensor_error_deviation(e: Experiment, error: Array, decay: Array) -> Array:
    """Return by how much a pressure that is read with an ``error`` (k, n), in Pa, differs from a simulated one.

    That one starts from the reading, too, and carries its error on; ``decay`` as in :func:`pressure_deviation`.
    """
    each = segment_lengths(e.restarts, e.time.size)
    first = decay[e.restarts]
    faded = decay / np.repeat(np.where(first == 0.0, 1.0, first), each)
    return np.asarray(error - np.repeat(error[:, e.restarts], each, axis=-1) * faded)


def _volume_and_rate(e: Experiment, rig: Rig, chamber: Chamber, vessel_volume: float) -> tuple[Array, Array]:
    """Return the volume in m^3 and its growth in m^3/s."""
    if e.vessel:
        return np.full(e.time.size, vessel_volume), np.zeros(e.time.size)
    area, x, v = rig.piston_areas[chamber - 1], e.inputs[:, at.IN_X], e.inputs[:, at.IN_V]
    if chamber == 1:
        return (rig.dead_volume_1 or 0.0) + area * x, area * v
    return (rig.dead_volume_2 or 0.0) + area * ((rig.stroke or 0.0) - x), -area * v
