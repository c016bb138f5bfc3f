"""One manoeuvre: a recording to make, as a profile of the command of a bench, and as a model predicts it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pneucli.arrays import Array
from pneucli.plan.bench import Bench

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
GRAVITY = 9.81  # m/s^2
SETTLING_TIME = 0.3  # s at rest before and after a manoeuvre
ManoeuvreKind = Literal[
    "steps",  # of the command, with rests at the null command between
    "stairs",
    "random-steps",  # of the command, each held for a random time
    "hold",  # a chamber is filled and shut
    "command-sine",
    "triangle",  # slow, of the command
    "pulses",  # short openings to both sides
    "motion-sine",
    "strokes",  # at constant speed
    "position-steps",
    "starts-after-rests",
    "small-reversals",
    "strokes-at-pressure",  # of chamber 2, set before the recording
    "machine-strokes",
    "shut-valve",  # by hand: a ball valve shuts chamber 1
    "known-force",  # by hand: a weight pulls the piston
]


@dataclass(frozen=True)
class Manoeuvre:
    """One recording to make.

    Attributes:
        kind: Its kind.
        bench: The bench on which it is made.
        profile: The command over time, in V or m, raw.
        centre: Position in m about which it moves, where it moves.
        level: Level or amplitude of the command, in V or m, where it has one.
        frequency: Frequency in Hz, where it has one.
        speed: Speed in m/s, where it is constant.
        pressure: Pressure in Pa: held in chamber 1 by a machine's regulator, or set in chamber 2 at the start.
        force: Known force in N toward +x: of a weight that hangs on the piston over a pulley.
        use: Whether the recording is to be fitted or held out.
    """

    kind: ManoeuvreKind
    bench: Bench
    profile: Profile
    centre: float | None = None
    level: float | None = None
    frequency: float | None = None
    speed: float | None = None
    pressure: float | None = None
    force: float = 0.0
    use: Literal["train", "test"] = "train"

    @property
    def duration(self) -> float:
        """Duration in s."""
        return duration_of(self.profile)

    @property
    def added_mass(self) -> float:
        """Mass in kg of the weight, which moves with the piston."""
        return abs(self.force) / GRAVITY

    @property
    def by_hand(self) -> bool:
        """Whether a person has to do something to the rig for it."""
        return self.kind in ("shut-valve", "known-force")


@dataclass(frozen=True)
class Outcome:
    """The prediction of one model, SI, each array of shape (n,).

    Attributes:
        time: Time stamps in s.
        readings: What the bench's sensors and its logger of commands read, without noise.
        p1: True pressure of chamber 1, or of the vessel.
        p2: That of chamber 2; None without a piston.
        x: Position; None without a piston.
        v: Velocity; None without a piston.
        air: Air in kg that the supply gives.
        lowest_pressure: Pressure in Pa below which the prediction makes no sense.
    """

    time: Array
    readings: Mapping[str, Array]
    p1: Array
    p2: Array | None = None
    x: Array | None = None
    v: Array | None = None
    air: float = 0.0
    lowest_pressure: float = 0.0


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
