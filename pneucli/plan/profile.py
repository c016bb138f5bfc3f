"""Commands over time as segments, which a spreadsheet, a PLC and a simulation read alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RISE_PERIODS = 1.0  # periods over which the amplitude of a sine rises and falls
MAX_RISE_SHARE = 0.25  # of the segment


@dataclass(frozen=True)
class Segment:
    """A ramp from ``start`` to ``end`` with a sine on it, whose amplitude rises and falls.

    Attributes:
        duration: Duration in s.
        start: Value at the beginning, in the unit of the command.
        end: Value at the end.
        amplitude: Amplitude of the sine; 0: none.
        frequency: Its frequency in Hz.
    """

    duration: float
    start: float
    end: float
    amplitude: float = 0.0
    frequency: float = 0.0

    @property
    def rise(self) -> float:
        """Time in s over which the amplitude rises, and falls at the end."""
        if self.frequency <= 0.0:
            return 0.0
        return min(RISE_PERIODS / self.frequency, MAX_RISE_SHARE * self.duration)

    def values(self, time: Array) -> Array:
        """Return the command at times in s from the beginning of the segment, both (n,).

        >>> Segment(2.0, 0.0, 1.0).values(np.array([0.5, 2.0])).tolist()
        [0.25, 1.0]
        """
        values = self.start + (self.end - self.start) * time / self.duration
        if self.amplitude == 0.0:
            return values
        envelope = np.clip(np.minimum(time, self.duration - time) / self.rise, 0.0, 1.0)
        return np.asarray(values + self.amplitude * envelope * np.sin(2.0 * np.pi * self.frequency * time))


Profile = tuple[Segment, ...]


def hold(value: float, duration: float) -> Segment:
    """Return a segment that holds a value for a duration in s."""
    return Segment(duration, value, value)


def ramp(start: float, end: float, duration: float) -> Segment:
    """Return a segment from one value to another in a duration in s."""
    return Segment(duration, start, end)


def sine(centre: float, amplitude: float, frequency: float, duration: float) -> Segment:
    """Return a sine about a centre."""
    return Segment(duration, centre, centre, amplitude, frequency)


def duration_of(profile: Sequence[Segment]) -> float:
    """Return the duration of a profile in s."""
    return sum(segment.duration for segment in profile)


def sample(profile: Sequence[Segment], period: float) -> Array:
    """Sample a profile.

    Args:
        profile: The segments.
        period: Sampling period in s.

    Returns:
        The command at the samples 0, period, ..., shape (n,), in the unit of the command.

    >>> sample((ramp(0.0, 1.0, 0.2), hold(1.0, 0.2)), 0.1).tolist()
    [0.0, 0.5, 1.0, 1.0]
    """
    count = round(duration_of(profile) / period)
    time = period * np.arange(count)
    ends = np.cumsum([segment.duration for segment in profile])
    place = np.minimum(np.searchsorted(ends, time + 1e-9 * period, side="right"), len(profile) - 1)
    values = np.empty(count)
    for i, segment in enumerate(profile):
        inside = place == i
        values[inside] = segment.values(np.minimum(time[inside] - (ends[i] - segment.duration), segment.duration))
    return values


def shifted(profile: Sequence[Segment], offset: float) -> Profile:
    """Return a profile with an offset added to its values."""
    return tuple(Segment(s.duration, s.start + offset, s.end + offset, s.amplitude, s.frequency) for s in profile)
