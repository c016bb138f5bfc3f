"""The benches of a plan: how each is driven, what it records, where it starts; one manoeuvre on it, as predicted."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pneucli.arrays import Array
from pneucli.experiments import EXPERIMENT_KINDS, ExperimentName
from pneucli.noise import NoiseModel
from pneucli.recording import Recording, Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment

Drive = Literal[
    "valve",  # a command in V at the valve
    "position",  # a position reference; a proportional loop commands the valve
    "motion",  # a position reference that the bench's own drive follows; its valve is not recorded
    "machine",  # a machine imposes the motion while a regulator holds p1
    "pressure",  # both pressures are imposed by regulators
]
LOOP_RANGE = 0.12  # strokes of position error at which a proportional loop gives the full command
LOOP_RANGE_BOTH = 0.24  # the same where the valve drives both chambers: twice the force for a command
LOOP_RANGE_UNKNOWN = 2.0  # the same on a rig whose valve is unknown: it may be twice as fast as typical
SPEED_FACTOR = 1.5  # times the highest recorded speed, which a plan may reach
USUAL_NOISE = {"p1": 500.0, "p2": 500.0, "p_supply": 500.0, "x": 5e-6, "a": 0.1, "force": 0.5}  # of usual sensors, SI
USUAL_SPEED = 1.0  # m/s, of an axis of which nothing is recorded
USUAL_COMMAND = 10.0  # V from a null command of 0 V, at which usual valves are fully open
USUAL_PERIOD = 1e-3  # s, of usual loggers


@dataclass(frozen=True)
class State:
    """Where a manoeuvre starts: x in m, both pressures and that of the supply in Pa, absolute."""

    x: float
    p1: float
    p2: float
    p_supply: float


@dataclass(frozen=True)
class Bench:
    """One bench.

    Attributes:
        template: A recording of it without samples: kind of experiment, chamber 2, imposed motion, chamber, shut valve.
        drive: How it is driven.
        rig: The rig.
        signals: The signals that it records.
        noise: Noise of each sensor.
        period: Sampling period in s.
        command_range: Largest command in V from the null command.
        start: Where recordings on it start.
        speed: Highest recorded speed in m/s; 0 where nothing moves or nothing is recorded.
        loop_range: Strokes of position error at which the proportional loop gives the full command.
    """

    template: Recording
    drive: Drive
    rig: Rig
    signals: tuple[str, ...]
    noise: dict[str, NoiseModel]
    period: float
    command_range: float
    start: State
    speed: float = 0.0
    loop_range: float = LOOP_RANGE

    @property
    def name(self) -> str:
        """The bench in one word: vessel or cylinder."""
        return self.template.kind.bench

    @property
    def experiment(self) -> ExperimentName:
        """The kind of experiment."""
        return self.template.experiment

    @property
    def setup(self) -> tuple[object, ...]:
        """What a person sets up for a recording: the kind of experiment, both chambers, and how the bench is driven."""
        return *_setup_of(self.template), self.drive

    def made(self, recording: Recording) -> bool:
        """Return whether a recording is one of this bench."""
        return _setup_of(recording) == _setup_of(self.template)

    @property
    def quantity(self) -> str:
        """The signal that its commands state."""
        return {"valve": "u", "pressure": "p_ref"}.get(self.drive, "x_ref")

    @property
    def middle(self) -> float:
        """The value of the command at rest: the null command in V, or half the stroke in m."""
        return self.rig.valve_null if self.drive == "valve" else 0.5 * (self.rig.stroke or 0.0)

    @property
    def gain(self) -> float:
        """Gain in V/m of the proportional loop of a bench that is driven by position."""
        return self.command_range / (self.loop_range * (self.rig.stroke or np.inf))

    def balanced_start(self, x: float, load: float = 0.0) -> State:
        """Return the state at rest at x under a load in N: gas enclosed in chamber 2 changes isothermally, and p1
        balances both; a load that pushes outward is balanced by a chamber 2 that the valve fills.
        """
        rig, start = self.rig, self.start
        area_1, area_2 = rig.piston_areas
        p2 = start.p2
        if self.template.chamber_2 == "open":
            p2 = rig.ambient_pressure
        elif self.template.chamber_2 == "closed" and rig.stroke:
            dead = rig.dead_volume_2 or 0.1 * area_2 * rig.stroke
            p2 *= (dead + area_2 * (rig.stroke - start.x)) / (dead + area_2 * (rig.stroke - x))
        p1 = rig.ambient_pressure + area_2 * (p2 - rig.ambient_pressure) / area_1 if area_1 else start.p1
        if load < 0.0 and self.template.chamber_2 == "valve" and area_2:
            p2 -= load / area_2
        elif load:
            p1 = max(p1 + load / area_1, rig.ambient_pressure)
        return State(x, p1, p2, start.p_supply)


def recorded_benches(experiments: Sequence[Experiment]) -> list[Bench]:
    """Return the benches of recordings, each with every way in which it can be driven."""
    groups: dict[tuple[object, ...], list[Experiment]] = {}
    for one in experiments:
        r = one.recording
        if not r.kind.steady:
            groups.setdefault(_setup_of(r), []).append(one)
    return [
        _recorded_bench(members, drive)
        for members in groups.values()
        for drive in _drives(members[0].recording, members[0].rig)
    ]


def _setup_of(recording: Recording) -> tuple[object, ...]:
    return recording.kind.bench, recording.experiment, recording.chamber_2, recording.imposed, recording.chamber


def _drives(recording: Recording, rig: Rig) -> Iterable[Drive]:
    if recording.imposed:
        return ("machine",)
    if recording.valve_shut or (recording.kind.cylinder and not rig.stroke):
        return ()
    if recording.kind.vessel:
        return ("valve",)
    if not recording.kind.valve:
        return ("motion",)
    if recording.kind.controlled:
        return ("position",)
    return _axis_drives(rig)


def _axis_drives(rig: Rig) -> tuple[Drive, ...]:
    """Return how an axis can be driven; a switching valve follows no proportional loop."""
    return ("valve",) if rig.valve_kind == "switching" else ("position", "valve")


def _recorded_bench(members: Sequence[Experiment], drive: Drive) -> Bench:
    one, rig = members[0], members[0].rig
    first = {
        name: float(np.median([m.raw[name][0] for m in members if name in m.raw]))
        for name in ("x", "p1", "p2", "p_supply")
        if any(name in m.raw for m in members)
    }
    ambient = rig.ambient_pressure
    start = State(
        first.get("x", 0.5 * (rig.stroke or 0.0)),
        first.get("p1", ambient),
        first.get("p2", ambient),
        first.get("p_supply", rig.supply_pressure or ambient),
    )
    signals = tuple(n for n in one.raw if all(n in m.raw for m in members))
    empty = replace(
        one.recording,
        name="plan",
        use="train",
        time=np.zeros(0),
        signals={},
        noise={},
        valve_shut=False,
        added_mass=0.0,
    )
    noise = {name: one.noise[name] for name in signals if name in one.noise}
    command = max(float(m.flags[at.U_MAX]) for m in members) if one.recording.kind.valve else 0.0
    speed = max(m.signal_ranges.speed for m in members) if one.recording.kind.cylinder else 0.0
    loop_range = LOOP_RANGE_BOTH if one.recording.chamber_2 == "valve" else LOOP_RANGE
    return Bench(empty, drive, rig, signals, noise, one.recording.period, command, start, speed, loop_range)


def described_benches(rig: Rig, max_command: float | None = None) -> list[Bench]:
    """Return the benches of a rig that is only described: a vessel where one is stated, the axis of a cylinder.

    Args:
        rig: The rig.
        max_command: Largest command in V from the null command; None: as usual valves have it.

    Returns:
        Benches with usual sensors.
    """
    command = max_command or abs(rig.valve_null) or USUAL_COMMAND
    supply, ambient = rig.supply_pressure or rig.ambient_pressure, rig.ambient_pressure
    benches = []
    if rig.vessel_volume is not None:
        start = State(0.0, ambient, ambient, supply)
        benches.append(_described_bench("valve", "valve", rig, None, command, start, ("u", "p_supply", "p1")))
    if rig.has_cylinder and rig.stroke:
        both = rig.arrangement.drives_both
        mean = float(np.sqrt(ambient * supply))
        start = State(0.5 * rig.stroke, mean, mean, supply)
        signals = (*rig.arrangement.commands, "p_supply", "p1", "p2", "x", "a")
        benches += [
            _described_bench("axis", drive, rig, "valve" if both else "closed", command, start, signals)
            for drive in _axis_drives(rig)
        ]
    return benches


def _described_bench(
    experiment: ExperimentName,
    drive: Drive,
    rig: Rig,
    chamber_2: Literal["closed", "open", "valve"] | None,
    command: float,
    start: State,
    signals: tuple[str, ...],
) -> Bench:
    template = Recording("plan", experiment, "train", np.zeros(0), {}, {}, chamber_2)
    noise = {n: NoiseModel(USUAL_NOISE.get(n, 0.0), period=USUAL_PERIOD) for n in signals}
    speed = USUAL_SPEED if EXPERIMENT_KINDS[experiment].cylinder else 0.0
    return Bench(template, drive, rig, signals, noise, USUAL_PERIOD, command, start, speed, LOOP_RANGE_UNKNOWN)


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
