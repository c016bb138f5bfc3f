"""Samples of several recordings: where the piston moves, and their mean over bins of velocity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
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
