"""The flow paths of a valve that fill and vent one chamber, and its mass balance, thesis (2.14) and (2.22)."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pneucli.arrays import Array, Integers, read_only
from pneucli.caches import compiled
from pneucli.physics.gas import critical_ratio_of, flow_constant
from pneucli.physics.vectorised import orifice_flows
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


@dataclass(frozen=True)
class CommandConversion:
    """Conversion between a valve's command and the opening of a chamber's paths, both in V; positive openings fill."""

    null: float
    sign: float

    def from_opening(self, opening: Array) -> Array:
        """Return the command in V for an opening in V."""
        return np.asarray(self.null + self.sign * opening)

    def to_opening(self, command: Array | float) -> Array:
        """Return the opening in V for a command in V."""
        return np.asarray(self.sign * (np.asarray(command, dtype=np.float64) - self.null))


def command_conversion(rig: Rig, chamber: Chamber) -> CommandConversion:
    """Return the conversion between command and opening of a chamber's paths.

    Args:
        rig: The rig with the valve's null and arrangement.
        chamber: Which chamber; the paths of chamber 2 may belong to the other side of one spool.

    Returns:
        The conversion.

    """
    return CommandConversion(rig.valve_null, rig.command_sign(chamber))


@dataclass(frozen=True)
class FlowPathData:
    """The paths of one chamber, or of a vessel in its place, in one recording; arrays of shape (n,).

    ``opening`` is the command from the null in V, positive where it fills; ``flow`` is the mass flow into the chamber
    in kg/s by the balance of the smoothed pressure; ``mass_flux`` is the flow of the base model for each square metre,
    in kg/(s m^2), at the sign of the opening; ``volume`` (m^3) and ``volume_rate`` (m^3/s) are the chamber's.
    """

    experiment: Experiment
    opening: Array
    flow: Array
    mass_flux: Array
    volume: Array
    volume_rate: Array


def valve_driven(experiments: Sequence[Experiment]) -> list[Experiment]:
    """Select the experiments in which a command drives a valve.

    Args:
        experiments: The experiments.

    Returns:
        Those with a recorded command and a valve that is not shut off.

    """
    return [
        experiment
        for experiment in experiments
        if experiment.flags[at.PNEUMATICS] > 0 and "u" in experiment.raw and not experiment.recording.valve_shut
    ]


def flow_path_data(
    experiments: Sequence[Experiment], rig: Rig, chamber: Chamber, vessel_volume: float
) -> Iterator[FlowPathData]:
    """Yield the flow-path data of each driven experiment.

    Args:
        experiments: The experiments.
        rig: The rig with its volumes and areas.
        chamber: Which chamber.
        vessel_volume: Volume of the vessel in m^3, for a valve test.

    Yields:
        The data; none for an experiment that does not record the chamber.

    """
    for experiment in valve_driven(experiments):
        if opening_from_null(experiment, chamber) is not None:
            yield _flow_path_data(experiment, rig, chamber, vessel_volume)


def opening_from_null(experiment: Experiment, chamber: Chamber) -> Array | None:
    """Return the command from the null of a chamber's paths.

    Args:
        experiment: The experiment.
        chamber: Which chamber.

    Returns:
        The opening in V, shape (n,); None where the experiment does not record the chamber.

    """
    null = experiment.rig.valve_null
    if experiment.vessel:
        return np.asarray(experiment.inputs[:, at.IN_U] - null) if experiment.recording.chamber == chamber else None
    if chamber == 1:
        return np.asarray(experiment.inputs[:, at.IN_U] - null)
    if "p2" not in experiment.raw or experiment.flags[at.CHAMBER_2] not in (at.VALVE_2, at.MIRRORED):
        return None
    mirrored = experiment.flags[at.CHAMBER_2] == at.MIRRORED
    return np.asarray(null - experiment.inputs[:, at.IN_U] if mirrored else experiment.inputs[:, at.IN_U2] - null)


def as_valve_test(experiment: Experiment, chamber: Chamber) -> Experiment | None:
    """Present the paths of a chamber as a valve test: command from the null, positive where it fills, and one pressure.

    Args:
        experiment: The experiment; of a piston's chamber only command, pressure and supply are used.
        chamber: Which chamber.

    Returns:
        The valve test; None where the experiment does not record the chamber.

    """
    opening = opening_from_null(experiment, chamber)
    name, column = PRESSURE_SIGNALS[1 if experiment.vessel else chamber]
    if opening is None or name not in experiment.raw:
        return None
    inputs = experiment.inputs.copy()
    inputs[:, at.IN_U], inputs[:, at.IN_P1] = opening, inputs[:, column]
    signals = dict(experiment.recording.signals)
    if "u" in signals:
        signals["u"] = opening
    if name in signals:
        signals["p1"] = signals[name]
    recording = replace(experiment.recording, experiment="valve", chamber=chamber, signals=signals)
    return replace(experiment, recording=recording, rig=replace(experiment.rig, valve_null=0.0), inputs=inputs)


def _flow_path_data(experiment: Experiment, rig: Rig, chamber: Chamber, vessel_volume: float) -> FlowPathData:
    opening = opening_from_null(experiment, chamber)
    assert opening is not None
    p = experiment.inputs[:, PRESSURE_SIGNALS[1 if experiment.vessel else chamber][1]]
    gas = measured_gas(experiment, rig, chamber, vessel_volume)
    flux = mass_flux(rig, opening, experiment.inputs[:, at.IN_SUPPLY], p)
    return FlowPathData(experiment, opening, gas.flow, flux, gas.volume, gas.volume_rate)


def mass_flux(rig: Rig, opening: Array, supply: Array, p: Array) -> Array:
    """Compute the mass flow for each square metre of effective area into a chamber.

    Args:
        rig: The rig with its gas and ambient pressure.
        opening: Opening in V, shape (n,); its sign says whether the path fills or vents.
        supply: Absolute supply pressure in Pa, shape (n,).
        p: Absolute chamber pressure in Pa, shape (n,).

    Returns:
        The mass flux in kg/(s m^2), shape (n,), negative where the chamber is vented.

    References:
        Thesis, equations 2.42 and 2.43 (approximate flow function).

    Filling from 7 to 1 bar is choked: 0.484 p sqrt(2 / (R T)) = 1652 kg/(s m^2).

    >>> flux = mass_flux(Rig(), np.ones(1), np.array([7e5]), np.array([1e5]))
    >>> round(float(flux[0]))
    1652
    """
    choked_flux = flow_constant(rig.gas_constant, rig.gas_temperature, rig.heat_capacity_ratio)
    b = critical_ratio_of(rig.heat_capacity_ratio)
    upstream, downstream = np.where(opening > 0, supply, p), np.where(opening > 0, p, rig.ambient_pressure)
    return np.asarray(
        np.where(opening > 0, 1.0, -1.0) * orifice_flows(upstream, downstream, b, choked_flux, choked_flux)
    )
