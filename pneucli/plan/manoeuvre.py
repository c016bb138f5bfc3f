"""One manoeuvre: a recording to make, as a profile of the command of a bench, and as a model predicts it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pneucli.plan.bench import Bench
from pneucli.plan.profile import Profile, duration_of

Array = NDArray[np.float64]

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
