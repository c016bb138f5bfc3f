"""Single stick-slip cycles, and their mean friction over repeats (thesis 6.1.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pneucli.arrays import Array, Indices, Integers
from pneucli.identify.friction.kinematics import Motion

BranchName = Literal["accelerating", "slowing"]

MIN_REST_RATIO = 0.1  # of a slide's duration: the shortest rest before and after a stick-slip
MIN_SLIDE_SPEED_RATIO = 0.02  # of the highest speed of the recording, which a slide reaches
MIN_SLIDE_SAMPLES = 5  # of a slide
SPEED_NODES = 60


@dataclass(frozen=True)
class StickSlip:
    """One stick-slip cycle: rest, break-away, slide, stop.

    ``start`` (of the rest before), ``breakaway``, ``peak`` (of the speed), ``stop`` and ``end`` (of the rest after) are
    samples of the recording. ``time`` (s) counts from break-away; ``speed`` (m/s) and ``friction`` (N) along the motion
    are those of the slide, shape (n,). ``breakaway_force`` (N) is the driving force at break-away.
    """

    recording: str
    direction: int
    start: int
    breakaway: int
    peak: int
    stop: int
    end: int
    time: Array
    speed: Array
    friction: Array
    breakaway_force: float

    @property
    def peak_speed(self) -> float:
        """Highest speed in m/s."""
        return float(self.speed.max())


@dataclass(frozen=True)
class AveragedFriction:
    """The mean friction (N) of repeated cycles over speed (m/s), one branch of one direction; arrays of shape (n,).

    ``error`` is the standard error of the mean from the scatter between cycles (NaN where fewer than two reach that
    speed), ``count`` their number.
    """

    branch: BranchName
    direction: int
    speed: Array
    friction: Array
    error: Array
    count: Integers


def find_stick_slips(motion: Motion, mass: float) -> list[StickSlip]:
    """Find every single stick-slip cycle of a recording.

    A slide counts if the piston rests for ``MIN_REST_RATIO`` of its duration before and after, off the ends of its
    stroke, which would hold it in friction's place. A slide that stays below
    ``MIN_SLIDE_SPEED_RATIO`` of the highest speed is rest, since a velocity from position alone rings next to a stop.

    Args:
        motion: Motion and driving force of the recording.
        mass: Moving mass in kg.

    Returns:
        The cycles in the order of time.

    References:
        Thesis (6.1) to (6.7): one stick-slip is cut out of a motion at constant small opening.
    """
    begins, stops = _slides(motion)
    rest_starts = np.concatenate([[0], stops])[:-1]
    rest_ends = np.concatenate([begins, [motion.v.size]])[1:]
    slides = zip(rest_starts, begins, stops, rest_ends, strict=True)
    return [
        _stick_slip(motion, mass, start, begin, stop, end)
        for start, begin, stop, end in slides
        if min(begin - start, end - stop) >= MIN_REST_RATIO * (stop - begin) and stop - begin >= MIN_SLIDE_SAMPLES
        if not motion.contact[max(begin - 1, 0) : stop + 1].any()
    ]


def _slides(motion: Motion) -> tuple[Indices, Indices]:
    """Return the first samples of slides and those after their ends; a slide keeps its direction."""
    sign = np.where(np.abs(motion.v) > motion.rest_speed, np.sign(motion.v), 0.0)
    edges = np.flatnonzero(np.diff(sign, prepend=0.0, append=0.0))
    begins, stops = edges[:-1], edges[1:]
    min_peak_speed = MIN_SLIDE_SPEED_RATIO * np.abs(motion.v).max()
    peaks = [np.abs(motion.v[i:j]).max() if sign[i] else 0.0 for i, j in zip(begins, stops, strict=True)]
    is_fast = np.array(peaks) > min_peak_speed
    return begins[is_fast], stops[is_fast]


def _stick_slip(motion: Motion, mass: float, start: int, begin: int, stop: int, end: int) -> StickSlip:
    direction = int(np.sign(motion.v[begin]))
    speed = direction * motion.v[begin:stop]
    return StickSlip(
        recording=motion.recording.name,
        direction=direction,
        start=int(start),
        breakaway=int(begin),
        peak=int(begin + np.argmax(speed)),
        stop=int(stop),
        end=int(end),
        time=motion.time[begin:stop] - motion.time[begin],
        speed=speed,
        friction=direction * motion.friction(mass)[begin:stop],
        breakaway_force=float(direction * motion.smooth_drive[max(begin - 1, 0)]),
    )


def average_stick_slips(stick_slips: Sequence[StickSlip]) -> list[AveragedFriction]:
    """Average the friction of cycles over speed, for each direction and branch, up to their median peak speed.

    Args:
        stick_slips: The cycles.

    Returns:
        The mean friction of each direction and branch.

    References:
        Thesis 6.1.1; averaging repeats removes what sensors add to the models C and F.
    """
    out = []
    for direction in (1, -1):
        of_direction = [c for c in stick_slips if c.direction == direction]
        if of_direction:
            peak_speed = float(np.median([c.peak_speed for c in of_direction]))
            speed = np.linspace(peak_speed / SPEED_NODES, peak_speed, SPEED_NODES)
            out += [
                _mean(of_direction, direction, "accelerating", speed),
                _mean(of_direction, direction, "slowing", speed),
            ]
    return out


def _mean(stick_slips: Sequence[StickSlip], direction: int, branch: BranchName, speed: Array) -> AveragedFriction:
    """Average the cycles that reach each speed; one branch ends at the peak, the other starts there."""
    rows = np.array([_over_speed(c, branch, speed) for c in stick_slips])
    count = np.sum(~np.isnan(rows), axis=0)
    mean = np.nansum(rows, axis=0) / np.maximum(count, 1)
    spread = np.sqrt(np.nansum((rows - mean) ** 2, axis=0) / np.maximum(count - 1, 1))
    error = np.where(count > 1, spread / np.sqrt(np.maximum(count, 1)), np.nan)
    reached = count > 0
    return AveragedFriction(branch, direction, speed[reached], mean[reached], error[reached], count[reached])


def _over_speed(one: StickSlip, branch: BranchName, speed: Array) -> Array:
    """Return the friction of one cycle at ``speed``, NaN beyond its own speeds."""
    peak = one.peak - one.breakaway
    part = slice(0, peak + 1) if branch == "accelerating" else slice(peak, None)
    order = np.argsort(one.speed[part], kind="stable")
    own_speed, friction = one.speed[part][order], one.friction[part][order]
    return np.interp(speed, own_speed, friction, left=np.nan, right=np.nan)
