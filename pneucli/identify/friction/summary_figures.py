"""Summary figures of friction: dependence on pressure, break-away force, and repeatability."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pneucli.figure import Figure
from pneucli.identify.friction.imposed_motion import KineticFriction
from pneucli.identify.friction.kinematics import Motion
from pneucli.quantities import Z95

Array = NDArray[np.float64]
MIN_REST_SAMPLES = 5  # at rest before a break-away
BREAKAWAY_SAMPLES = 3  # the last samples at rest, whose mean force is the break-away force
MAX_PRESSURE_DIFFERENCE = 0.1  # of the gauge pressure, within which recordings repeat each other
MAX_SPEED_DIFFERENCE = 0.3  # of the speed, within which kinetic friction changes little
BREAKAWAY_STROKE_RATIO = 0.2  # of a stroke: the part that contains its break-away
MIN_LEVELS = 3  # of pressure, from which a line has a standard error


@dataclass(frozen=True)
class BreakAway:
    """The break-away force (N) of one recording: median over ``count`` break-aways, smallest and largest."""

    recording: str
    force: Figure
    minimum: float
    maximum: float
    count: int


@dataclass(frozen=True)
class PressureDependence:
    """Kinetic friction over the gauge pressure of chamber 1: N at ambient pressure, and N/Pa."""

    at_ambient: Figure
    slope: Figure


@dataclass(frozen=True)
class Repeatability:
    """Recordings at one pressure and speed: mean friction (N), and its standard deviation over the mean."""

    recordings: tuple[str, ...]
    friction: float
    spread: float


def break_away(motion: Motion, mass: float = 0.0) -> BreakAway | None:
    """Return the break-away forces of one recording; None where the piston never rests before it moves.

    Args:
        motion: The motion and what drives it.
        mass: All mass in kg that a machine accelerates with the piston; its inertia is no friction.

    """
    strokes = _breakaway_forces_of_strokes(motion, mass) if motion.imposed else _breakaway_forces_at_rest(motion)
    forces = np.array(list(strokes))
    forces = forces[np.isfinite(forces)]
    if not forces.size:
        return None
    median, error = float(np.median(forces)), 1.2533 * float(np.std(forces)) / np.sqrt(forces.size)  # of a median
    low, high = (median - Z95 * error, median + Z95 * error) if forces.size > 1 else (np.nan, np.nan)
    force = Figure(median, low, high, "N")
    return BreakAway(motion.recording.name, force, float(forces.min()), float(forces.max()), forces.size)


def _breakaway_forces_at_rest(motion: Motion) -> Iterator[float]:
    """Yield the driving force at the end of each rest of a free piston off the ends of its stroke."""
    is_rest = np.abs(motion.v) <= motion.rest_speed
    for k in np.flatnonzero(is_rest[:-1] & ~is_rest[1:] & ~motion.contact[:-1]):
        if k + 1 >= MIN_REST_SAMPLES and is_rest[k + 1 - MIN_REST_SAMPLES : k + 1].all():
            yield abs(float(np.nanmean(motion.drive[k + 1 - BREAKAWAY_SAMPLES : k + 1])))


def _breakaway_forces_of_strokes(motion: Motion, mass: float) -> Iterator[float]:
    """Yield the largest friction at the start of each stroke that a machine makes: it turns before the seal lets go."""
    friction = motion.smooth_drive - mass * motion.smooth_a
    for direction, first, end in _strokes(motion):
        early = slice(max(first - MIN_REST_SAMPLES, 0), first + int(BREAKAWAY_STROKE_RATIO * (end - first)))
        yield float(np.max(direction * friction[early], initial=-np.inf, where=~motion.contact[early]))


def _strokes(motion: Motion) -> list[tuple[float, int, int]]:
    """Return direction, first sample and end of each stroke; faults of the position of a few samples end none."""
    directions = np.where(np.abs(motion.v) > motion.rest_speed, np.sign(motion.v), 0.0)
    edges = np.flatnonzero(np.diff(directions, prepend=0.0, append=0.0)).tolist()
    strokes: list[tuple[float, int, int]] = []
    has_rested = False
    for first, end in pairwise(edges):
        direction, is_short = float(directions[first]), end - first < MIN_REST_SAMPLES
        has_rested |= not direction and not is_short
        if not direction or is_short:
            continue
        if strokes and strokes[-1][0] == direction and not has_rested:
            strokes[-1] = direction, strokes[-1][1], end
        else:
            strokes.append((direction, first, end))
        has_rested = False
    return [one for one in strokes if one[2] - one[1] >= MIN_REST_SAMPLES / BREAKAWAY_STROKE_RATIO]


def pressure_dependence(levels: Sequence[KineticFriction], ambient: float) -> PressureDependence | None:
    """Fit a line to the kinetic friction of recordings over pressure.

    Args:
        levels: Kinetic friction of the recordings.
        ambient: Ambient pressure in Pa.

    Returns:
        The line; None with fewer than three recordings, or at one pressure.

    """
    with_pressure = [k for k in levels if "p1" in k.pressures]
    p = np.array([k.pressures["p1"] - ambient for k in with_pressure])
    if p.size < MIN_LEVELS or np.ptp(p) <= MAX_PRESSURE_DIFFERENCE * np.abs(p).max():
        return None
    design, force = np.column_stack([np.ones(p.size), p / 1e5]), np.array([k.friction.value for k in with_pressure])
    coefficients, squares, *_ = np.linalg.lstsq(design, force, rcond=None)
    errors = np.sqrt(np.diag(np.linalg.inv(design.T @ design)) * float(np.sum(squares)) / (p.size - 2))
    (at_ambient, slope), (e0, e1) = coefficients.tolist(), errors.tolist()
    return PressureDependence(
        Figure(at_ambient, at_ambient - Z95 * e0, at_ambient + Z95 * e0, "N"),
        Figure(1e-5 * slope, 1e-5 * (slope - Z95 * e1), 1e-5 * (slope + Z95 * e1), "N/Pa"),
    )


def repeatability(levels: Sequence[KineticFriction], ambient: float) -> list[Repeatability]:
    """Group recordings at one pressure and speed.

    Args:
        levels: Kinetic friction of the recordings.
        ambient: Ambient pressure in Pa.

    Returns:
        The groups of at least two recordings, in the recordings' order.

    """
    groups: list[list[KineticFriction]] = []
    for level in levels:
        group = next((g for g in groups if _is_repeat(g[0], level, ambient)), None)
        if group is None:
            groups.append([level])
        else:
            group.append(level)
    out = []
    for group in groups:
        values = np.array([k.friction.value for k in group])
        if len(group) > 1:
            spread = float(np.std(values, ddof=1) / values.mean())
            out.append(Repeatability(tuple(k.recording for k in group), float(values.mean()), spread))
    return out


def _is_repeat(one: KineticFriction, other: KineticFriction, ambient: float) -> bool:
    if one.pressures.keys() != other.pressures.keys():
        return False
    pairs = [(one.speed, other.speed, MAX_SPEED_DIFFERENCE)]
    pairs += [(p - ambient, other.pressures[n] - ambient, MAX_PRESSURE_DIFFERENCE) for n, p in one.pressures.items()]
    return all(abs(a - b) <= share * max(abs(a), abs(b), 1e-9) for a, b, share in pairs)
