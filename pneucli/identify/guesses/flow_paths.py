"""The paths of a valve that fill and vent one chamber, as one recording shows them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.guesses.chamber_balance import PRESSURE_SIGNALS, Chamber, measured_gas
from pneucli.physics.gas import critical_ratio_of, flow_constant
from pneucli.physics.vectorised import orifice_flows
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CommandConversion:
    """What goes to the valve, in V, for an opening of one chamber's paths, which is positive where they fill."""

    null: float
    sign: float

    def from_opening(self, opening: Array) -> Array:
        """Return the command for an opening."""
        return np.asarray(self.null + self.sign * opening)

    def to_opening(self, command: Array | float) -> Array:
        """Return the opening that a command makes."""
        return np.asarray(self.sign * (np.asarray(command, dtype=np.float64) - self.null))


def command_conversion(rig: Rig, chamber: Chamber) -> CommandConversion:
    """Return how the paths of a chamber are commanded: those of chamber 2 may be one spool's other way."""
    return CommandConversion(rig.valve_null, rig.command_sign(chamber))


@dataclass(frozen=True)
class FlowPathData:
    """A recording of the paths of one chamber, or of a vessel in its place; arrays of shape (n,).

    ``opening`` is the command in V from the null one, positive where it fills; ``flow`` the mass flow in kg/s into the
    chamber by the base model's balance of the smoothed pressure, ``mass_flux`` that of the base model in kg/(s m^2) at
    the sign of the opening; ``volume`` (m^3) and ``volume_rate`` (m^3/s) are the chamber's.
    """

    experiment: Experiment
    opening: Array
    flow: Array
    mass_flux: Array
    volume: Array
    volume_rate: Array


def valve_driven(experiments: Sequence[Experiment]) -> list[Experiment]:
    """Return the experiments in which a valve is commanded."""
    return [e for e in experiments if e.flags[at.PNEUMATICS] > 0 and "u" in e.raw and not e.recording.valve_shut]


def flow_path_data(
    experiments: Sequence[Experiment], rig: Rig, chamber: Chamber, vessel_volume: float
) -> Iterator[FlowPathData]:
    """Yield what each driven experiment shows of the paths of chamber 1 or 2."""
    for e in valve_driven(experiments):
        if opening_from_null(e, chamber) is not None:
            yield _flow_path_data(e, rig, chamber, vessel_volume)


def opening_from_null(e: Experiment, chamber: Chamber) -> Array | None:
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


def as_valve_test(e: Experiment, chamber: Chamber) -> Experiment | None:
    """Return the paths of a chamber as a valve test shows them, or would: from the null, positive where they fill.

    Of a piston's chamber only command, pressure and supply are taken over; None where the paths are not seen.
    """
    opening = opening_from_null(e, chamber)
    if opening is None:
        return None
    name, column = PRESSURE_SIGNALS[1 if e.vessel else chamber]
    inputs = e.inputs.copy()
    inputs[:, at.IN_U], inputs[:, at.IN_P1] = opening, inputs[:, column]
    signals = dict(e.recording.signals)
    if "u" in signals:
        signals["u"] = opening
    if name in signals:
        signals["p1"] = signals[name]
    recording = replace(e.recording, experiment="valve", chamber=chamber, signals=signals)
    return replace(e, recording=recording, rig=replace(e.rig, valve_null=0.0), inputs=inputs)


def _flow_path_data(e: Experiment, rig: Rig, chamber: Chamber, vessel_volume: float) -> FlowPathData:
    opening = opening_from_null(e, chamber)
    assert opening is not None
    p = e.inputs[:, PRESSURE_SIGNALS[1 if e.vessel else chamber][1]]
    gas = measured_gas(e, rig, chamber, vessel_volume)
    per_area = mass_flux(rig, opening, e.inputs[:, at.IN_SUPPLY], p)
    return FlowPathData(e, opening, gas.flow, per_area, gas.volume, gas.volume_rate)


def mass_flux(rig: Rig, opening: Array, supply: Array, p: Array) -> Array:
    """Return the mass flow per area in kg/(s m^2) into a chamber at p, filled or vented as an opening (V) does.

    Pressures in Pa, all (n,).
    """
    k = flow_constant(rig.gas_constant, rig.gas_temperature, rig.heat_capacity_ratio)
    b = critical_ratio_of(rig.heat_capacity_ratio)
    upstream, downstream = np.where(opening > 0, supply, p), np.where(opening > 0, p, rig.ambient_pressure)
    return np.asarray(np.where(opening > 0, 1.0, -1.0) * orifice_flows(upstream, downstream, b, k, k))
