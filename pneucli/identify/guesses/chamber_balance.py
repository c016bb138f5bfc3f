"""The mass balance of one chamber, thesis (2.14) and (2.22): its volume, its flow, and the pressure of added flow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pneucli.arrays import Array, Integers, read_only
from pneucli.caches import compiled
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment, segment_lengths

Chamber = Literal[1, 2]

PRESSURE_SIGNALS = {1: ("p1", at.IN_P1), 2: ("p2", at.IN_P2)}
MIN_DECAY = 1e-4  # of an initial error: a smaller rest is no scale for gas that is added later


@dataclass(frozen=True)
class ChamberGas:
    """The gas of a chamber, or of a vessel in its place; arrays of shape (n,).

    ``volume`` in m^3 and its ``volume_rate`` in m^3/s; ``flow`` is the mass flow into the chamber in kg/s by the
    balance of its pressure, ``swept_flow`` the part of it that fills the growing volume; ``stiffness`` in Pa/kg is the
    rise of the pressure for each kilogram of added gas.
    """

    volume: Array
    volume_rate: Array
    flow: Array
    swept_flow: Array
    stiffness: Array


def measured_gas(experiment: Experiment, rig: Rig, chamber: Chamber, vessel_volume: float) -> ChamberGas:
    """Compute the gas of a chamber from its measured pressure and motion.

    Args:
        experiment: An experiment that records the pressure of the chamber.
        rig: The rig with its volumes and areas.
        chamber: Which chamber.
        vessel_volume: Volume of the vessel in m^3, for a valve test.

    Returns:
        The gas, from the smoothed pressure.

    """
    name, column = PRESSURE_SIGNALS[1 if experiment.vessel else chamber]
    p = experiment.inputs[:, column]
    pressure_rate = (
        experiment.smoothers[name].slope(experiment.raw[name])
        if name in experiment.smoothers
        else np.gradient(p, experiment.time)
    )
    return _gas_balance(rig, *_volume_and_rate(experiment, rig, chamber, vessel_volume), p, pressure_rate)


def modelled_gas(experiment: Experiment, rig: Rig, chamber: Chamber, vessel_volume: float, p: Array) -> ChamberGas:
    """Compute the gas of a chamber from a simulated pressure and the measured motion.

    Args:
        experiment: The experiment that was simulated.
        rig: The rig with its volumes and areas.
        chamber: Which chamber.
        vessel_volume: Volume of the vessel in m^3, for a valve test.
        p: Simulated pressure in Pa, shape (n,); it starts again at each restart.

    Returns:
        The gas.

    """
    pressure_rate, segment_ends = (
        np.gradient(p, experiment.time),
        np.append(experiment.restarts[1:], experiment.time.size) - 1,
    )
    for edge, neighbour in (
        (experiment.restarts, np.minimum(experiment.restarts + 1, segment_ends)),
        (segment_ends, np.maximum(segment_ends - 1, experiment.restarts)),
    ):
        pressure_rate[edge] = pressure_rate[neighbour]
    return _gas_balance(rig, *_volume_and_rate(experiment, rig, chamber, vessel_volume), p, pressure_rate)


def _gas_balance(rig: Rig, volume: Array, volume_rate: Array, p: Array, pressure_rate: Array) -> ChamberGas:
    """Compute the flow into a chamber from the polytropic balance of its pressure.

    >>> one = np.ones(1)
    >>> gas = _gas_balance(Rig(), 1e-3 * one, 0.0 * one, 1e5 * one, 1e5 * one)
    >>> round(float(gas.flow[0]), 6)
    0.000849
    """
    exponent = rig.polytropic_exponent or rig.heat_capacity_ratio
    specific = rig.gas_constant * rig.gas_temperature
    flow = (pressure_rate * volume + exponent * p * volume_rate) / (exponent * specific)
    return ChamberGas(volume, volume_rate, flow, p * volume_rate / specific, exponent * specific / volume)


def pressure_deviation(experiment: Experiment, gas: ChamberGas, flow: Array, decay: Array) -> Array:
    """Compute the pressure that additional flow causes, to first order, from each restart on.

    Args:
        experiment: The experiment with its restarts.
        gas: The gas of the chamber.
        flow: Additional mass flow in kg/s, shape (k, n).
        decay: Decay of an initial error over time, shape (n,), in any unit; added gas decays alike.

    Returns:
        The deviation in Pa, shape (k, n).

    """
    floor, out = MIN_DECAY * float(np.max(np.abs(decay))), np.empty(flow.shape)
    scale = np.where(np.abs(decay) > floor, decay, floor)
    gain = gas.stiffness * experiment.recording.period / scale
    _write_pressure_deviation(read_only(flow), gain, scale, experiment.restarts, out)
    return out


@compiled(nogil=True, error_model="numpy")
def _write_pressure_deviation(flow: Array, gain: Array, scale: Array, restarts: Integers, out: Array) -> None:
    """Write the deviation (k, n), in one pass."""
    for row in range(out.shape[0]):
        for s in range(restarts.size):
            first, last = restarts[s], restarts[s + 1] if s + 1 < restarts.size else scale.size
            total = out[row, first] = 0.0
            for i in range(first + 1, last):
                total += flow[row, i] * gain[i]
                out[row, i] = total * scale[i]


def sensor_error_deviation(experiment: Experiment, error: Array, decay: Array) -> Array:
    """Compute the deviation of a pressure reading with an error from a simulation that starts from that reading.

    Args:
        experiment: The experiment with its restarts.
        error: Error of the reading in Pa, shape (k, n).
        decay: Decay of an initial error over time, shape (n,), in any unit.

    Returns:
        The deviation in Pa, shape (k, n).

    """
    lengths = segment_lengths(experiment.restarts, experiment.time.size)
    first = decay[experiment.restarts]
    relative_decay = decay / np.repeat(np.where(first == 0.0, 1.0, first), lengths)
    return np.asarray(error - np.repeat(error[:, experiment.restarts], lengths, axis=-1) * relative_decay)


def _volume_and_rate(experiment: Experiment, rig: Rig, chamber: Chamber, vessel_volume: float) -> tuple[Array, Array]:
    """Return the volume in m^3 and its rate in m^3/s."""
    if experiment.vessel:
        return np.full(experiment.time.size, vessel_volume), np.zeros(experiment.time.size)
    area, x, v = rig.piston_areas[chamber - 1], experiment.inputs[:, at.IN_X], experiment.inputs[:, at.IN_V]
    if chamber == 1:
        return (rig.dead_volume_1 or 0.0) + area * x, area * v
    return (rig.dead_volume_2 or 0.0) + area * ((rig.stroke or 0.0) - x), -area * v
