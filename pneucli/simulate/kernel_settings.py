"""The switches of a recording, as the kernel takes them (:mod:`pneucli.simulate.layout`)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pneucli.noise import NoiseModel
from pneucli.recording import Recording, Rig
from pneucli.simulate import layout as at

Array = NDArray[np.float64]


def recording_flags(recording: Recording, rig: Rig, raw: Mapping[str, Array], noise: Mapping[str, NoiseModel]) -> Array:
    """Return the switches of a recording (9,), from its filled signals and their noise."""
    flags = np.zeros(at.FLAGS)
    flags[at.MECHANICS] = recording.kind.cylinder
    flags[at.PNEUMATICS] = recording.kind.valve
    flags[at.CHAMBER_2] = _chamber_2(recording, rig)
    flags[at.STATED_SUPPLY] = "p_supply" not in recording and rig.supply_pressure is not None
    flags[at.VALVE_SHUT] = recording.valve_shut
    flags[at.U_MAX] = _max_opening(rig, raw)
    flags[at.INITIAL_U] = _initial_opening("u", "p1", rig, raw, noise)
    mirrored = flags[at.CHAMBER_2] == at.MIRRORED
    flags[at.INITIAL_U2] = -flags[at.INITIAL_U] if mirrored else _initial_opening("u2", "p2", rig, raw, noise)
    return flags


def _max_opening(rig: Rig, raw: Mapping[str, Array]) -> float:
    """Return how far in V a command goes from the null one; 1 where there is none."""
    return max((float(np.abs(raw[n] - rig.valve_null).max()) for n in ("u", "u2") if n in raw), default=0.0) or 1.0


def _chamber_2(recording: Recording, rig: Rig) -> int:
    """Return what closes chamber 2, as the kernel counts it; that of a vessel takes no part."""
    if recording.kind.vessel or recording.chamber_2 == "open":
        return at.OPEN
    if recording.chamber_2 != "valve":
        return at.CLOSED
    return at.MIRRORED if rig.arrangement.chamber_2 == "mirrored" else at.VALVE_2


def _initial_opening(
    command: str, pressure: str, rig: Rig, raw: Mapping[str, Array], noise: Mapping[str, NoiseModel]
) -> float:
    """Return where a valve stood before the recording: centred where the pressure has not begun to move."""
    if command not in raw or pressure not in raw or raw[pressure].size < 10:
        return 0.0
    moving = abs(raw[pressure][3] - raw[pressure][0]) > 5 * noise[pressure].rms
    return float(raw[command][0] - rig.valve_null) if moving else 0.0


MIN_STEPS_PER_STROKE = 150.0  # at least, while the supply's force moves the mass over the stroke
MIN_STEPS_PER_FILLING = 300.0  # while a chamber whose volume is known would be filled at the highest rate seen
MAX_PERIOD_SHARE = 0.5  # of a sampling period, at most: a recording at rest does not tell how fast a command fills
FULL_PERIOD_STEP = 0.5e-3  # s: of a step that is shorter, a sampling period may be one
STEPS_PER_PERIOD = 4.0  # of a sampling period, where the rig does not tell how fast its piston may be
FILLING_RATE_QUANTILE = 0.99  # of the samples: what is faster is noise or an instant


def max_motion_step(rig: Rig, period: float) -> float:
    """Return the longest step in s, where a piston moves; from the sampling ``period`` (s) if need be."""
    if not (rig.supply_pressure and rig.piston_area_1 and rig.stroke and rig.moving_mass):
        return period / STEPS_PER_PERIOD
    force = abs(rig.supply_pressure - rig.ambient_pressure) * rig.piston_area_1
    return (
        float(np.sqrt(rig.moving_mass * rig.stroke / force)) / MIN_STEPS_PER_STROKE
        if force > 0.0
        else period / STEPS_PER_PERIOD
    )


def max_filling_step(pressure: Array, slope: Array, period: float) -> float:
    """Return the longest step in s of a chamber that showed such a pressure in Pa and its slope in Pa/s, each (n,).

    At most half the sampling ``period`` (s), or all of one that is short itself: how often a logger samples does not
    change how fast a chamber fills.
    """
    most = min(max(MAX_PERIOD_SHARE * period, FULL_PERIOD_STEP), period)
    fastest = float(np.quantile(np.abs(slope), FILLING_RATE_QUANTILE))
    return min(most, float(pressure.max()) / (MIN_STEPS_PER_FILLING * fastest)) if fastest > 0.0 else most
