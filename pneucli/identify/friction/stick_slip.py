"""Single stick-slips, cut out and averaged over repeats (thesis 6.1.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.friction.kinematics import Motion

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
BranchName = Literal["accelerating", "slowing"]

MIN_REST_RATIO = 0.1  # of a slide's duration: the rest before and after, without which it is no stick-slip
MIN_SLIDE_SPEED_RATIO = 0.02  # of the highest speed
MIN_SLIDE_SAMPLES = 5  # moving samples
SPEED_NODES = 60


@dataclass(frozen=True)
class StickSlip:
    """One stick-slip: rest, break-away, slide, stop.

    ``start`` (of the rest before), ``breakaway``, ``peak`` (of the speed), ``stop`` and ``end`` (of the rest after) are
    samples of the recording. ``time`` (s) counts from break-away; ``speed`` (m/s) and ``friction`` (N) along the
    motion are those of the slide, shape (n,). ``breakaway_force`` (N) is the driving force that it took.
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
    """The mean friction (N) of repeated cuts over speed (m/s), one branch of one direction; arrays of shape (n,).

    ``error`` is the standard error of the mean from the scatter between cuts (NaN where fewer than two reach that
    speed), ``count`` how many do.
    """

    branch: BranchName
    direction: int
    speed: Array
    friction: Array
    error: Array
    count: NDArray[np.int64]


def find_stick_slips(motion: Motion, mass: float) -> list[StickSlip]:
    """Return every single stick-slip of a recording, for a moving mass in kg.

    A slide counts that the piston rests ``MIN_REST_RATIO`` of its duration before and after; what is slower than
    ``MIN_SLIDE_SPEED_RATIO`` of the recording's highest speed throughout is rest, since velocity from position alone
    rings beside a stop.
    """
    begins, stops = _slides(motion)
    before = np.concatenate([[0], stops])[:-1]
    after = np.concatenate([begins, [motion.v.size]])[1:]
    slides = zip(before, begins, stops, after, strict=True)
    return [
        _stick_slip(motion, mass, start, begin, stop, end)
        for start, begin, stop, end in slides
        if min(begin - start, end - stop) >= MIN_REST_RATIO * (stop - begin) and stop - begin >= MIN_SLIDE_SAMPLES
    ]


def _slides(motion: Motion) -> tuple[Indices, Indices]:
    """Return where slides begin and where they have ended, as samples; a slide keeps its direction."""
    sign = np.where(np.abs(motion.v) > motion.rest_speed, np.sign(motion.v), 0.0)
    edges = np.flatnonzero(np.diff(sign, prepend=0.0, append=0.0))
    begins, stops = edges[:-1], edges[1:]
    fast = MIN_SLIDE_SPEED_RATIO * np.abs(motion.v).max()
    peaks = [np.abs(motion.v[i:j]).max() if sign[i] else 0.0 for i, j in zip(begins, stops, strict=True)]
    keep = np.array(peaks) > fast
    return begins[keep], stops[keep]


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


def average_stick_slips(cuts: Sequence[StickSlip]) -> list[AveragedFriction]:
    """Return the mean friction over speed of cuts, per direction and branch, up to what half of them reach."""
    out = []
    for direction in (1, -1):
        mine = [c for c in cuts if c.direction == direction]
        if mine:
            top = float(np.median([c.peak_speed for c in mine]))
            speed = np.linspace(top / SPEED_NODES, top, SPEED_NODES)
            out += [_mean(mine, direction, "accelerating", speed), _mean(mine, direction, "slowing", speed)]
    return out


def _mean(cuts: Sequence[StickSlip], direction: int, branch: BranchName, speed: Array) -> AveragedFriction:
    """Average over nodes of speed the cuts that reach them; the slide up to its peak, or from it."""
    rows = np.array([_over_speed(c, branch, speed) for c in cuts])
    count = np.sum(~np.isnan(rows), axis=0)
    mean = np.nansum(rows, axis=0) / np.maximum(count, 1)
    spread = np.sqrt(np.nansum((rows - mean) ** 2, axis=0) / np.maximum(count - 1, 1))
    error = np.where(count > 1, spread / np.sqrt(np.maximum(count, 1)), np.nan)
    known = count > 0
    return AveragedFriction(branch, direction, speed[known], mean[known], error[known], count[known])


def _over_speed(one: StickSlip, branch: BranchName, speed: Array) -> Array:
    """Return one cut's friction at ``speed``, NaN where it does not get there."""
    turn = one.peak - one.breakaway
    part = slice(0, turn + 1) if branch == "accelerating" else slice(turn, None)
    order = np.argsort(one.speed[part], kind="stable")
    have, friction = one.speed[part][order], one.friction[part][order]
    return np.interp(speed, have, friction, left=np.nan, right=np.nan)
