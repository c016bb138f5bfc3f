"""Where the piston moves: samples of several recordings, means over bins of velocity, stick-slip (thesis 6.1.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array, Indices, Integers
from pneucli.distributions import student_t_quantile
from pneucli.identify.friction.kinematics import Motion
from pneucli.quantities import Z95

Branch = Literal["accelerating", "slowing", "both"]
BINS_PER_DIRECTION = 40  # of velocity, narrower toward standstill
MIN_BLOCKS = 3  # of a bin, below which its scatter gives no interval
BRANCH_SIGNS: dict[Branch, tuple[int, ...]] = {"accelerating": (1,), "slowing": (-1,), "both": (-1, 0, 1)}


@dataclass(frozen=True)
class FrictionCurve:
    """Measured friction of one branch, arrays of shape (n,): mean velocity (m/s) and force (N) of each bin.

    ``ci_low`` and ``ci_high`` are the 95 % interval of the mean (N) from the scatter between blocks, which are
    independent while samples within a block are not. ``count`` is the number of samples.
    """

    branch: Branch
    v: Array
    force: Array
    ci_low: Array
    ci_high: Array
    count: NDArray[np.int64]


@dataclass(frozen=True)
class MovingSamples:
    """Moving samples of several recordings, each of shape (n,): velocity (m/s), acceleration (m/s^2), drive (N).

    ``drive`` is without what accelerates a recording's own added mass; ``friction`` is drive - mass a (N), ``sigma``
    its standard deviation (N), ``branch`` as in :class:`Motion`; ``block`` labels the spans
    (:attr:`Motion.block_length`) within which residuals may be correlated.
    """

    v: Array
    a: Array
    drive: Array
    friction: Array
    sigma: Array
    branch: NDArray[np.int8]
    block: NDArray[np.int64]

    def __len__(self) -> int:
        return self.v.size

    def select(self, mask: NDArray[np.bool_]) -> MovingSamples:
        """Return the samples that ``mask`` (n,) keeps."""
        return MovingSamples(*(getattr(self, name)[mask] for name in self.__dataclass_fields__))

    @property
    def both_directions(self) -> bool:
        """Whether each direction has at least a tenth of the samples."""
        forward_share = float(np.mean(self.v > 0)) if self.v.size else 0.0
        return 0.1 <= forward_share <= 0.9


def pool_samples(motions: Sequence[Motion], mass: float) -> MovingSamples:
    """Pool the moving samples of several recordings.

    Args:
        motions: The motions.
        mass: Moving mass in kg.

    Returns:
        The samples.

    """
    parts: list[list[NDArray[Any]]] = []
    for index, motion in enumerate(motions):
        moving = motion.moving
        friction = motion.friction(mass)[moving]
        block = index * 10**6 + ((motion.time[moving] - motion.time[0]) / motion.block_length).astype(np.int64)
        sigma = np.full(friction.size, motion.sigma_friction(mass))
        parts.append(
            [
                motion.v[moving],
                motion.smooth_a[moving],
                motion.friction(0.0)[moving],
                friction,
                sigma,
                motion.branch[moving],
                block,
            ]
        )
    return MovingSamples(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def binned_curve(samples: MovingSamples, branch: Branch) -> FrictionCurve:
    """Average the friction of one branch in bins of velocity.

    Args:
        samples: The moving samples.
        branch: Which branch: accelerating, slowing, or both.

    Returns:
        The curve; bins without a sample are left out.

    """
    s = samples.select(np.isin(samples.branch, BRANCH_SIGNS[branch]))
    if not len(s):
        empty = np.zeros(0)
        return FrictionCurve(branch, empty, empty, empty, empty, np.zeros(0, dtype=np.int64))
    edges = np.abs(s.v).max() * np.linspace(0, 1, BINS_PER_DIRECTION + 1) ** 2
    bins = np.sign(s.v).astype(np.int64) * (
        1 + np.clip(np.searchsorted(edges, np.abs(s.v)) - 1, 0, BINS_PER_DIRECTION - 1)
    )
    rows = np.array([_bin(s.select(bins == k)) for k in np.unique(bins)])
    v, force, half_width, count = rows.T
    return FrictionCurve(branch, v, force, force - half_width, force + half_width, count.astype(np.int64))


def _bin(s: MovingSamples) -> tuple[float, float, float, float]:
    """Return mean velocity, mean force, half its 95 % interval, and the number of samples."""
    mean, n = float(np.mean(s.friction)), len(s)
    _, index = np.unique(s.block, return_inverse=True)
    sums = np.bincount(index, weights=s.friction - mean)
    blocks = sums.size
    if blocks < MIN_BLOCKS:  # the sensors' noise alone, as if it were common to a block
        return float(np.mean(s.v)), mean, float(Z95 * np.mean(s.sigma) / np.sqrt(blocks)), n
    error = np.sqrt(blocks / (blocks - 1) * np.sum(sums**2)) / n
    return float(np.mean(s.v)), mean, float(student_t_quantile(0.975, blocks - 1)) * error, n


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
