"""The switches of a recording and the longest step, as the kernel takes them (:mod:`pneucli.simulate.layout`)."""

from collections.abc import Mapping

import numpy as np

from pneucli.arrays import Array
from pneucli.noise import NoiseModel
from pneucli.recording import Recording, Rig
from pneucli.simulate import layout as at

MIN_STEPS_PER_STROKE = 150.0  # while the force of the supply moves the mass over the stroke
MIN_STEPS_PER_FILLING = 300.0  # while a chamber fills at the highest measured rate
MAX_PERIOD_SHARE = 0.5  # of a sampling period: a recording at rest does not show how fast a command fills a chamber
FULL_PERIOD_STEP = 0.5e-3  # s: a shorter sampling period may be one step
SHOWN_FILLING = 0.5  # of the highest pressure: a recording that spans as much shows how fast the chamber fills,
SHOWN_FILLING_STEP = 1e-3  # s, and there a longer one errs by at most 0.03 of the noise (docs/development/internals.md)
STEPS_PER_PERIOD = 4.0  # of a sampling period, where the rig's mass, stroke or supply is unknown
GIVEN_MOTION_STEPS = 8.0  # of a moving piston, where the motion is measured: errs by less than those steps
# times the noise: a half and a quarter of such a change differ from their mean by 2.9, 2.3 standard errors of
# y(T/2) - 3/8 y(T) - 5/8 y(0), which distinguishes them
START_NOISES = 23.0
FILLING_RATE_QUANTILE = 0.99  # of the samples: higher rates are noise or last an instant


def recording_flags(recording: Recording, rig: Rig, raw: Mapping[str, Array], noise: Mapping[str, NoiseModel]) -> Array:
    """Return the switches of a recording.

    Args:
        recording: The recording.
        rig: The rig.
        raw: Signals with gaps filled, each (n,).
        noise: Noise of each sensor.

    Returns:
        Switches in the kernel's layout, shape (9,).
    """
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
    """Return the largest distance of a command from the null command in V; 1 without a command."""
    return max((float(np.abs(raw[n] - rig.valve_null).max()) for n in ("u", "u2") if n in raw), default=0.0) or 1.0


def _chamber_2(recording: Recording, rig: Rig) -> int:
    """Return what closes chamber 2, in the numbers of the kernel; that of a vessel is open."""
    if recording.kind.vessel or recording.chamber_2 == "open":
        return at.OPEN
    if recording.chamber_2 != "valve":
        return at.CLOSED
    return at.MIRRORED if rig.arrangement.chamber_2 == "mirrored" else at.VALVE_2


def _initial_opening(
    command: str, pressure: str, rig: Rig, raw: Mapping[str, Array], noise: Mapping[str, NoiseModel]
) -> float:
    """Return the opening before the recording: closed where nothing moves at its start.

    A chamber as full as the supply, or as empty as the surroundings, rested, however soon a command moves it.
    """
    if command not in raw or pressure not in raw:
        return 0.0
    readings, rms = raw[pressure], noise[pressure].rms
    supply = raw["p_supply"][0] if "p_supply" in raw else rig.supply_pressure
    ends = [end for end in (rig.ambient_pressure, supply) if end is not None]
    rested = any(abs(readings[0] - end) <= START_NOISES * rms for end in ends)
    flows = moves_at_start(readings, rms) and not rested
    slides = "x" in raw and moves_at_start(raw["x"], noise["x"].rms)
    return float(raw[command][0] - rig.valve_null) if flows or slides else 0.0


def moves_at_start(pressure: Array, noise: float) -> bool:
    """Return whether a pressure already moves when its recording starts.

    Until its change stands out of the noise, a pressure that moves all along changes in proportion to time, and one
    that a command sets in motion at the start changes with the square of time, or later.

    Args:
        pressure: Readings in Pa, shape (n,).
        noise: Their rms noise in Pa.

    Returns:
        Whether the change until half that time is nearer to the first.

    >>> time = np.linspace(0.0, 1.0, 101)
    >>> moves_at_start(1e5 + 1e5 * time, 100.0), moves_at_start(1e5 + 1e5 * time**2, 100.0)
    (True, False)
    """
    changes = np.abs(pressure - pressure[0])
    stands_out = np.flatnonzero(changes > START_NOISES * noise)
    if not stands_out.size:
        return False
    last = int(stands_out[0])
    half = last // 2
    share = half / last
    return last < 2 or bool(changes[half] > 0.5 * (share + share**2) * changes[last])


def max_motion_step(rig: Rig, period: float) -> float:
    """Return the longest step for a moving piston: a share of the time in which the supply moves it over the stroke.

    Args:
        rig: The rig.
        period: Sampling period in s, from which the step follows where the rig is not described.

    Returns:
        Step in s.

    >>> rig = Rig(supply_pressure=7e5, piston_area_1=8e-4, stroke=0.2, moving_mass=2.0)
    >>> round(1e6 * max_motion_step(rig, 1e-3), 1)
    192.7
    """
    if not (rig.supply_pressure and rig.piston_area_1 and rig.stroke and rig.moving_mass):
        return period / STEPS_PER_PERIOD
    force = abs(rig.supply_pressure - rig.ambient_pressure) * rig.piston_area_1
    return (
        float(np.sqrt(rig.moving_mass * rig.stroke / force)) / MIN_STEPS_PER_STROKE
        if force > 0.0
        else period / STEPS_PER_PERIOD
    )


def max_filling_step(pressure: Array, slope: Array, period: float) -> float:
    """Return the longest step for a chamber that fills.

    The step is at most half the sampling period, or all of a period that is short: the rate of a logger does not change
    how fast a chamber fills. A recording that does not show that may be one of a full chamber: near equal pressures,
    where the slope of the flow is infinite, it would ring with longer steps.

    Args:
        pressure: Pressure in Pa, shape (n,).
        slope: Its slope in Pa/s, shape (n,).
        period: Sampling period in s.

    Returns:
        Step in s.

    >>> max_filling_step(np.array([6e5]), np.array([1e7]), 1e-3)
    0.0002
    """
    highest = float(pressure.max())
    shows_filling = highest - float(pressure.min()) >= SHOWN_FILLING * highest
    longest = min(max(MAX_PERIOD_SHARE * period, SHOWN_FILLING_STEP if shows_filling else FULL_PERIOD_STEP), period)
    fastest = float(np.quantile(np.abs(slope), FILLING_RATE_QUANTILE))
    return min(longest, highest / (MIN_STEPS_PER_FILLING * fastest)) if fastest > 0.0 else longest
