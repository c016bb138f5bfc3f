"""Moving samples of several recordings, and numbers with intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.friction.kinematics import Motion

Array = NDArray[np.float64]


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
