"""Errors that say nothing of the model: of segments beside a break-away, and beyond the range of what was fitted.

Whether a piston breaks away before a restart or after it decides on the error of all that follows, up to the next one:
it may be a hundred times that of any other segment, and a few draws of the noise hold too few such segments to know how
frequent and how large they are. All that is known is that the segments of a correct model and those of its draws are
alike, in whatever order of size. Where a restart falls on the break-away itself its velocity is not even known.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.compare.expected_error import MOTION_CHANNELS, TAIL, ExpectedError

SegmentSquares = Mapping[str, Array]  # by channel, the part of each segment in the mean square error, SI


class Excused(NamedTuple):
    """What tells nothing of the model adds to the mean square error of each channel of each recording, SI.

    ``segments``: how many segments beside a break-away are among it.
    """

    squares: Sequence[Mapping[str, float]]
    segments: int


def most_by_chance(observed: int, drawn: int, tail: float = TAIL) -> int:
    """Return how many of the largest of all segments may by chance be observed ones, rather than drawn ones.

    The probability that the k largest are all among the observed ones is that of drawing them without replacement.

    >>> most_by_chance(observed=30, drawn=180), most_by_chance(observed=10, drawn=2000)
    (2, 0)
    """
    count, chance = 0, 1.0
    while count < observed:
        chance *= (observed - count) / (observed + drawn - count)
        if chance < tail:
            break
        count += 1
    return count


def excused_segments(observed: Sequence[SegmentSquares], expected: Sequence[ExpectedError]) -> list[Mask]:
    """Return, for each recording, the segments (S,) whose motion tells nothing of the model.

    They are those that start at an unknown velocity, and those that err more than any drawn one, as chance may have it.
    Where there are more of these than chance allows none is excused: the model, or its state at restarts, is wrong.

    Args:
        observed: Squares of the segments of each recording.
        expected: Error of a correct model in each recording.
    """
    pairs = list(zip(observed, expected, strict=True))
    beyond = [_beyond_population(squares, one) & ~one.undetermined for squares, one in pairs]
    drawn = [next(iter(one.squares.values())) for squares, one in pairs if _motion_channels(squares, one)]
    allowed = most_by_chance(sum(one.shape[1] for one in drawn), sum(one.size for one in drawn))
    are_chance = sum(map(np.count_nonzero, beyond)) <= allowed
    return [(found & are_chance) | one.undetermined for found, one in zip(beyond, expected, strict=True)]


def excused_error(
    observed: Sequence[SegmentSquares], beyond_fitted: Sequence[Mapping[str, float]], expected: Sequence[ExpectedError]
) -> Excused:
    """Return by how much what tells nothing of the model raises errors above those of all other samples.

    Args:
        observed: Squares of the segments of each recording.
        beyond_fitted: What samples beyond the fitted range add, by channel of each recording, SI.
        expected: Error of a correct model in each recording.
    """
    segments = excused_segments(observed, expected)
    squares = [
        {channel: max(_excess(own, those), beyond.get(channel, 0.0)) for channel, own in found.items()}
        for found, those, beyond in zip(observed, segments, beyond_fitted, strict=True)
    ]
    return Excused(squares, int(sum(map(np.count_nonzero, segments))))


def _excess(squares: Array, excused: Mask) -> float:
    those = np.broadcast_to(excused, squares.shape)
    if not those.any() or those.all():
        return 0.0
    return max(float(np.sum(squares[those]) - np.mean(squares[~those]) * np.count_nonzero(those)), 0.0)


def _beyond_population(squares: SegmentSquares, expected: ExpectedError) -> Mask:
    """Return the segments (S,) whose motion errs more than that of all segments of a correct model."""
    channels = _motion_channels(squares, expected)
    if not channels:
        return np.zeros(1, dtype=bool)
    relative = np.mean([squares[c] * squares[c].size / expected.rms[c] ** 2 for c in channels], axis=0)
    return np.asarray(relative > np.mean([expected.population[c] for c in channels], axis=0).max())


def _motion_channels(squares: SegmentSquares, expected: ExpectedError) -> list[str]:
    return [c for c in MOTION_CHANNELS if c in squares and c in expected.population and expected.rms[c] > 0.0]
