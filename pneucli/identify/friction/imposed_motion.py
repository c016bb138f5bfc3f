"""Friction where a machine imposes the motion: kinetic friction of each recording, from both directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.friction.kinematics import Motion
from pneucli.identify.friction.samples import IntervalEstimate
from pneucli.quantities import Z95

Array = NDArray[np.float64]

MIN_STROKE_SPEED_RATIO = 0.5  # of the median speed while moving: slower is turning, not stroking


@dataclass(frozen=True)
class KineticFriction:
    """Friction of one recording that strokes back and forth, and the level of pressure (Pa) at which it did.

    ``forward`` and ``backward`` are medians (N) of the force that is neither pressure's nor inertia's; ``friction`` is
    half their difference, ``offset`` (constant force, or an error of area or load cell) half their sum. ``speed`` is
    the median speed of stroking (m/s); ``pressures`` the medians of p1 and p2 (Pa), as far as recorded.
    """

    recording: str
    pressures: dict[str, float]
    speed: float
    forward: IntervalEstimate
    backward: IntervalEstimate
    friction: IntervalEstimate
    offset: IntervalEstimate


def kinetic_friction(motion: Motion, mass: float) -> KineticFriction | None:
    """Return the kinetic friction of one recording, or None where it does not move in both directions."""
    moving = motion.sliding(1)  # to a median what smoothing does beside a turn is nothing
    if not moving.any():
        return None
    speed = float(np.median(np.abs(motion.v[moving])))
    stroking = moving & (np.abs(motion.v) > MIN_STROKE_SPEED_RATIO * speed)
    sides = [stroking & (np.sign(motion.v) == d) for d in (1, -1)]
    if not all(side.any() for side in sides):
        return None
    friction = motion.friction(mass)
    (forward, e1), (backward, e2) = (
        _bootstrapped_median(friction[side], motion.time[side], motion.block_length) for side in sides
    )
    both = float(np.hypot(e1, e2)) / 2
    return KineticFriction(
        recording=motion.recording.name,
        pressures={n: float(np.nanmedian(motion.recording[n])) for n in ("p1", "p2") if n in motion.recording},
        speed=float(np.median(np.abs(motion.v[stroking]))),
        forward=_with_interval(forward, e1),
        backward=_with_interval(backward, e2),
        friction=_with_interval(0.5 * (forward - backward), both),
        offset=_with_interval(0.5 * (forward + backward), both),
    )


def _bootstrapped_median(force: Array, time: Array, length: float) -> tuple[float, float]:
    """Return the median and its standard error, by a bootstrap of the strokes' blocks of ``length`` s."""
    _, block = np.unique(np.floor(time / length), return_inverse=True)
    order = np.argsort(block, kind="stable")
    pieces = np.split(force[order], np.cumsum(np.bincount(block))[:-1])
    rng = np.random.default_rng(0)
    picks = rng.integers(len(pieces), size=(200, len(pieces)))
    medians = [np.median(np.concatenate([pieces[i] for i in row])) for row in picks]
    return float(np.median(force)), float(np.std(medians))


def _with_interval(value: float, error: float) -> IntervalEstimate:
    return IntervalEstimate(value, value - Z95 * error, value + Z95 * error, "N")
