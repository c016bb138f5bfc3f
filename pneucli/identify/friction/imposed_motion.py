"""Kinetic friction of a recording whose motion a machine imposes, from both directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array
from pneucli.figure import Figure
from pneucli.identify.friction.kinematics import Motion
from pneucli.quantities import Z95

MIN_STROKE_SPEED_RATIO = 0.5  # of the median speed while moving: slower samples belong to a reversal


@dataclass(frozen=True)
class KineticFriction:
    """Friction of one recording that strokes back and forth, and its pressures (Pa).

    ``forward`` and ``backward`` are medians (N) of the force that remains without pressure forces and inertia;
    ``friction`` is half their difference, ``offset`` (a constant force, or an error of area or load cell) half their
    sum. ``speed`` is the median speed of stroking (m/s); ``pressures`` are the medians of p1 and p2 (Pa), where
    recorded.
    """

    recording: str
    pressures: dict[str, float]
    speed: float
    forward: Figure
    backward: Figure
    friction: Figure
    offset: Figure


def kinetic_friction(motion: Motion, mass: float) -> KineticFriction | None:
    """Compute the kinetic friction of one recording.

    Args:
        motion: Motion and driving force of the recording.
        mass: Moving mass in kg.

    Returns:
        The friction; None where the piston does not move in both directions.

    """
    moving = motion.sliding(1)  # a median is insensitive to smoothing next to a reversal
    if not moving.any():
        return None
    speed = float(np.median(np.abs(motion.v[moving])))
    stroking = moving & (np.abs(motion.v) > MIN_STROKE_SPEED_RATIO * speed)
    directions = [stroking & (np.sign(motion.v) == d) for d in (1, -1)]
    if not all(mask.any() for mask in directions):
        return None
    friction = motion.friction(mass)
    (forward, e1), (backward, e2) = (
        _bootstrapped_median(friction[mask], motion.time[mask], motion.block_length) for mask in directions
    )
    half_error = float(np.hypot(e1, e2)) / 2
    return KineticFriction(
        recording=motion.recording.name,
        pressures={n: float(np.nanmedian(motion.recording[n])) for n in ("p1", "p2") if n in motion.recording},
        speed=float(np.median(np.abs(motion.v[stroking]))),
        forward=_with_interval(forward, e1),
        backward=_with_interval(backward, e2),
        friction=_with_interval(0.5 * (forward - backward), half_error),
        offset=_with_interval(0.5 * (forward + backward), half_error),
    )


def _bootstrapped_median(force: Array, time: Array, block_length: float) -> tuple[float, float]:
    """Return the median and its standard error, by a bootstrap over blocks of ``block_length`` s."""
    _, block = np.unique(np.floor(time / block_length), return_inverse=True)
    order = np.argsort(block, kind="stable")
    parts = np.split(force[order], np.cumsum(np.bincount(block))[:-1])
    rng = np.random.default_rng(0)
    picks = rng.integers(len(parts), size=(200, len(parts)))
    medians = [np.median(np.concatenate([parts[i] for i in row])) for row in picks]
    return float(np.median(force)), float(np.std(medians))


def _with_interval(value: float, error: float) -> Figure:
    return Figure(value, value - Z95 * error, value + Z95 * error, "N")
