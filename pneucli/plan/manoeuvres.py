"""The manoeuvres that a bench can carry out, the programme that is drawn from them, and its recordings."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from itertools import zip_longest

import numpy as np

from pneucli.figure import named
from pneucli.messages.plan import PlannedRecording, by_hand_text
from pneucli.plan.bench import (
    GRAVITY,
    SETTLING_TIME,
    Bench,
    Drive,
    Manoeuvre,
    ManoeuvreKind,
    Profile,
    Segment,
    hold,
    ramp,
    shifted,
    sine,
)
from pneucli.plan.limits import Limits
from pneucli.plan.simulation import start_of
from pneucli.simulate.model import Model

CHANGE_OVER_TIME = 2.0  # s of machine time between two manoeuvres, to save a file and start the next
TEST_EVERY = 3  # of the recordings of a bench one is held out: the diagnosis confirms an effect by it
SINE_TIME = 6.0  # s of a sine at least
AMPLITUDE_SHARE = 0.3  # of the stroke, at most
SPEED_SHARE = 0.8  # of the highest speed that is allowed
MOTION_FREQUENCIES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)  # Hz
SLOW_SPEEDS = (0.02, 0.1, 0.4)  # strokes per second
WIDE_SPEEDS = (0.2, 0.6)  # strokes per second, of strokes over nearly the whole range
WIDE_SHARE = 0.9  # of the allowed stroke, for what acts near the ends
REST_TIMES = (0.2, 1.0, 4.0)  # s
START_TIME = 0.7  # s, of a slow start after a rest
REVERSAL_SHARE = 2e-3  # of the stroke
PRESSURE_LEVELS = (0.15, 0.5, 0.9)  # of the supply pressure above ambient
WEIGHT = 2.0  # kg
MIN_PERIODS = 3.0  # of a sine
COMMAND_LEVELS = (0.1, 0.25, 0.5, 1.0)  # of the command's range
COMMAND_FREQUENCIES = (0.5, 3.0, 10.0)  # Hz
# s, of random steps: shorter and longer than a lag of the valve and the filling of a vessel
RANDOM_DWELLS = (0.05, 0.6)
RANDOM_TIME = 7.0  # s, of random steps
RANDOM_SEED = 1925
OPENING_REST = 0.3  # s between two openings of a switching valve
VESSEL_OPENINGS = (0.01, 0.03, 0.1, 0.4)  # s, of a switching valve
AXIS_OPENINGS = (0.01, 0.02, 0.04)  # s, of a switching valve that drives a piston


def candidate_manoeuvres(bench: Bench, limits: Limits) -> Iterator[Manoeuvre]:
    """Yield the manoeuvres that a bench can do, within limits of its command; their motion is not checked yet.

    Args:
        bench: The bench.
        limits: The limits of the rig.

    Yields:
        Manoeuvres that begin and end at rest.
    """
    families: dict[Drive, Callable[[Bench, Limits], Iterator[Manoeuvre]]] = {
        "valve": _vessel_commands if bench.template.kind.vessel else _axis_commands,
        "position": _motions,
        "motion": _motions_at_pressures,
        "machine": _machine_strokes,
    }
    yield from families[bench.drive](bench, limits)


def _motion(
    kind: ManoeuvreKind,
    bench: Bench,
    limits: Limits,
    core: Profile,
    level: float | None = None,
    frequency: float | None = None,
    speed: float | None = None,
) -> Manoeuvre:
    """Return a motion that starts softly at half the stroke and returns there."""
    middle, first, last = bench.middle, core[0].start, core[-1].end
    fastest = SPEED_SHARE * limits.max_speed
    go, back = (max(limits.soft_start, abs(place - middle) / fastest) for place in (first, last))
    before = (hold(middle, SETTLING_TIME), ramp(middle, first, go))
    after = (ramp(last, middle, back), hold(middle, SETTLING_TIME))
    places = [place for s in core for place in (s.start, s.end)]
    centre = 0.5 * (min(places) + max(places))
    return Manoeuvre(kind, bench, (*before, *core, *after), centre, level, frequency, speed)


def _strokes(
    kind: ManoeuvreKind, bench: Bench, limits: Limits, way: float, speed: float, repeats: int = 1, pause: float = 0.2
) -> Manoeuvre:
    """Return strokes to and fro about the middle of the allowed stroke, at constant speed."""
    middle, time = 0.5 * sum(limits.position), way / speed
    begin, end = middle - 0.5 * way, middle + 0.5 * way
    core = (ramp(begin, end, time), hold(end, pause), ramp(end, begin, time), hold(begin, pause))
    return _motion(kind, bench, limits, core * repeats, way, None, speed)


def _motions(bench: Bench, limits: Limits) -> Iterator[Manoeuvre]:
    """Yield motions about three places of the stroke."""
    low, high = limits.position
    span, fastest = high - low, SPEED_SHARE * limits.max_speed
    centres = (low + 0.3 * span, low + 0.5 * span, low + 0.7 * span)
    for frequency in (f for f in MOTION_FREQUENCIES if f <= limits.max_frequency):
        largest = min(AMPLITUDE_SHARE * span, fastest / (2.0 * np.pi * frequency))
        duration = max(SINE_TIME, MIN_PERIODS / frequency)
        for share in (1.0, 0.4):
            wave = (sine(centres[1], share * largest, frequency, duration),)
            yield _motion("motion-sine", bench, limits, wave, share * largest, frequency)
        if frequency in (1.0, 2.0):
            for centre in (centres[0], centres[2]):
                amplitude = min(largest, 0.25 * span)
                wave = (sine(centre, amplitude, frequency, duration),)
                yield _motion("motion-sine", bench, limits, wave, amplitude, frequency)
    for rate in SLOW_SPEEDS:
        speed = min(rate * span, fastest)
        way = min(0.6 * span, 3.0 * speed)
        repeats = max(1, min(3, int(SINE_TIME / (2.0 * (way / speed)))))
        yield _strokes("strokes", bench, limits, way, speed, repeats)
    for rate in WIDE_SPEEDS:
        yield _strokes("strokes", bench, limits, WIDE_SHARE * span, min(rate * span, fastest))
    places = [centres[1] + share * span for share in (0.1, -0.1, 0.2, -0.2, 0.0)]
    travel = max(0.25, 0.4 * span / fastest)  # of the longest step, from 0.2 to -0.2
    steps: list[Segment] = []
    for before, after in zip([centres[1], *places[:-1]], places, strict=True):
        steps += [ramp(before, after, travel), hold(after, 0.5)]
    yield _motion("position-steps", bench, limits, tuple(steps), 0.2 * span)
    slow, rests = 0.05 * span, []
    place = centres[1]
    for number, rest in enumerate(REST_TIMES * 2):
        aim = place + (slow if number % 2 == 0 else -slow)
        rests += [hold(place, rest), ramp(place, aim, max(START_TIME, slow / fastest))]
        place = aim
    yield _motion("starts-after-rests", bench, limits, tuple(rests), slow)
    small = REVERSAL_SHARE * span
    waves = (sine(centres[1], small, 1.0, 5.0), sine(centres[1], 5.0 * small, 1.0, 5.0))
    yield _motion("small-reversals", bench, limits, waves, 5.0 * small, 1.0)


def _motions_at_pressures(bench: Bench, limits: Limits) -> Iterator[Manoeuvre]:
    """Yield motions, and strokes at several pressures of chamber 2, where that is closed."""
    motions = list(_motions(bench, limits))
    yield from motions
    rig = bench.rig
    gauge = (rig.supply_pressure or bench.start.p2) - rig.ambient_pressure
    if bench.template.chamber_2 == "closed":
        strokes = [m for m in motions if m.kind == "strokes"][len(SLOW_SPEEDS) - 1]
        for share in PRESSURE_LEVELS[:-1]:
            yield replace(strokes, kind="strokes-at-pressure", pressure=rig.ambient_pressure + share * gauge)


def _machine_strokes(bench: Bench, limits: Limits) -> Iterator[Manoeuvre]:
    """Yield strokes of a machine at constant speeds and held pressures."""
    rig, span = bench.rig, limits.position[1] - limits.position[0]
    gauge = (rig.supply_pressure or bench.start.p1) - rig.ambient_pressure
    for pressure in (rig.ambient_pressure + share * gauge for share in PRESSURE_LEVELS):
        for speed in (0.25 * limits.max_speed / 1.5, limits.max_speed / 1.5):
            one = _strokes("machine-strokes", bench, limits, min(0.6 * span, 3.0 * speed), speed, 2, pause=0.3)
            yield replace(one, pressure=pressure)


def _command_manoeuvre(
    kind: ManoeuvreKind, bench: Bench, core: Profile, level: float, frequency: float | None = None
) -> Manoeuvre:
    rest = hold(bench.rig.valve_null, SETTLING_TIME)
    profile = (rest, *shifted(core, bench.rig.valve_null), rest)
    return Manoeuvre(kind, bench, profile, None, level, frequency)


def _levels(levels: tuple[float, ...], dwell: float) -> Profile:
    return tuple(hold(level, dwell) for level in levels)


def _random_steps(level: float) -> Profile:
    """Return levels that are uniform on both sides of the null command, each held for a random time."""
    rng = np.random.default_rng(RANDOM_SEED)
    core: list[Segment] = []
    while sum(segment.duration for segment in core) < RANDOM_TIME:
        core.append(hold(level * float(rng.uniform(-1.0, 1.0)), round(float(rng.uniform(*RANDOM_DWELLS)), 3)))
    return tuple(core)


def _vessel_commands(bench: Bench, limits: Limits) -> Iterator[Manoeuvre]:
    """Yield commands of a valve that fills and vents a vessel."""
    if bench.rig.valve_kind == "switching":
        yield from _openings(bench, VESSEL_OPENINGS)
        return
    u = limits.command_range(bench)
    for share in COMMAND_LEVELS:
        level, dwell = share * u, 0.6 if share > 0.3 else 1.5
        yield _command_manoeuvre("steps", bench, _levels((level, 0.0, -level, 0.0), dwell), level)
        yield _command_manoeuvre("hold", bench, (hold(level, 0.4), hold(0.0, 6.0)), level)
    yield _command_manoeuvre("hold", bench, (hold(u, 1.0), hold(-u, 0.3), hold(0.0, 6.0)), -u)
    for share in (0.05, 0.2):
        steps = np.array([1, 2, 3, 4, 3, 2, 1, 0, -1, -2, -3, -4, -3, -2, -1, 0] * 2)
        yield _command_manoeuvre("stairs", bench, _levels(tuple(share * u * steps), 0.09), 4.0 * share * u)
    for share in (0.4, 1.0):
        yield _command_manoeuvre("random-steps", bench, _random_steps(share * u), share * u)
    for frequency in COMMAND_FREQUENCIES:
        for share in (0.2, 0.6):
            wave = (sine(0.0, share * u, frequency, max(4.0, MIN_PERIODS / frequency)),)
            yield _command_manoeuvre("command-sine", bench, wave, share * u, frequency)
    slow = 0.1 * u
    core = (ramp(0.0, slow, 1.0), ramp(slow, -slow, 2.0), ramp(-slow, slow, 2.0), ramp(slow, 0.0, 1.0))
    yield _command_manoeuvre("triangle", bench, core, slow)


def _axis_commands(bench: Bench, limits: Limits) -> Iterator[Manoeuvre]:
    """Yield commands of a valve that drives a piston: it must not drift to an end."""
    if bench.rig.valve_kind == "switching":
        yield from _openings(bench, AXIS_OPENINGS)
        return
    u = limits.command_range(bench)
    for share in (0.2, 0.5, 1.0):
        level = share * u
        pulses = tuple(
            segment
            for sign in (1.0, -1.0, -1.0, 1.0) * 2
            for segment in (hold(sign * level, 0.03 / share), hold(0.0, 0.4))
        )
        yield _command_manoeuvre("pulses", bench, pulses, level)
        yield _command_manoeuvre("hold", bench, (hold(level, 0.05 / share), hold(0.0, 6.0)), level)
        yield _command_manoeuvre("hold", bench, (hold(-level, 0.05 / share), hold(0.0, 6.0)), -level)
    for frequency in (3.0, 10.0):
        for share in (0.2, 0.6):
            core = (sine(0.0, share * u, frequency, 5.0),)
            yield _command_manoeuvre("command-sine", bench, core, share * u, frequency)


def _openings(bench: Bench, times: Sequence[float]) -> Iterator[Manoeuvre]:
    """Yield openings of a valve that is open or shut: trains of short ones, and one after which the gas is enclosed."""
    u = bench.command_range
    for time in times:
        train = [
            segment
            for sign in (1.0, 1.0, 1.0, -1.0, -1.0, -1.0) * 2
            for segment in (hold(sign * u, time), hold(0.0, OPENING_REST))
        ]
        yield _command_manoeuvre("pulses", bench, tuple(train), u)
        for sign in (1.0, -1.0):
            yield _command_manoeuvre("hold", bench, (hold(sign * u, 3.0 * time), hold(0.0, 6.0)), sign * u)


def manual_manoeuvres(bench: Bench, limits: Limits) -> Iterator[Manoeuvre]:
    """Yield manoeuvres for which a person has to do something to the rig.

    A ball valve shuts chamber 1 while it holds pressure: only leaks move the pressure then. A weight over a pulley
    pulls the piston by a known force, toward x = 0 and away from it, during slow strokes.
    """
    template = bench.template
    if bench.drive == "valve" and template.kind.axis:
        null = bench.rig.valve_null
        yield Manoeuvre("shut-valve", bench, (hold(null, 12.0),))
    if bench.drive in ("position", "motion") and np.isfinite(limits.position[1]):
        slow = [m for m in _motions(bench, limits) if m.kind == "strokes"]
        for force in (WEIGHT * GRAVITY, -WEIGHT * GRAVITY):
            yield replace(slow[1], kind="known-force", force=force)


def cost_of(manoeuvre: Manoeuvre) -> float:
    """Return the machine time in s that a manoeuvre takes."""
    return manoeuvre.duration + CHANGE_OVER_TIME


def draw_programme(
    listed: Sequence[Manoeuvre],
    seconds: float,
    is_safe: Callable[[Manoeuvre], bool],
    seed: int,
    by_hand: Sequence[Manoeuvre] = (),
) -> list[Manoeuvre]:
    """Draw manoeuvres until the machine time is used.

    The benches take turns, and on each bench the kinds of manoeuvre: none comes again before every other has come, with
    another amplitude, speed, frequency or place.

    Args:
        listed: What the benches can do.
        seconds: Machine time in s.
        is_safe: Whether a manoeuvre keeps all limits; asked only of what fits into the time.
        seed: Seed of the draw: the same one gives the same programme.
        by_hand: Manoeuvres by hand that are known to keep the limits; they are part of the programme and fitted.

    Returns:
        The manoeuvres, one setup after another, those by hand last on each; one of three on each bench is held out, of
        one alone its repetition.
    """
    left = seconds - sum(map(cost_of, by_hand))
    drawn: list[Manoeuvre] = []
    for one in _in_turn(listed, np.random.default_rng(seed)):
        if cost_of(one) <= left and is_safe(one):
            drawn.append(one)
            left -= cost_of(one)
    uses: dict[str, int] = {}
    for i, one in enumerate(drawn):
        uses[one.bench.name] = uses.get(one.bench.name, 0) + 1
        if uses[one.bench.name] % TEST_EVERY == 2:
            drawn[i] = replace(one, use="test")
    for one in [one for one in drawn if uses[one.bench.name] == 1]:
        if cost_of(one) <= left:
            drawn.append(replace(one, use="test"))
            left -= cost_of(one)
    setups = list(dict.fromkeys(one.bench.setup for one in listed))
    return sorted([*drawn, *by_hand], key=lambda one: setups.index(one.bench.setup))


def _in_turn(listed: Sequence[Manoeuvre], rng: np.random.Generator) -> Iterator[Manoeuvre]:
    """Yield manoeuvres in random order; the benches take turns, and on each its kinds of manoeuvre."""
    kinds: dict[str, dict[tuple[object, ...], list[Manoeuvre]]] = {}
    for one in (listed[i] for i in rng.permutation(len(listed))):
        kinds.setdefault(one.bench.name, {}).setdefault((*one.bench.setup, one.kind), []).append(one)
    queues = [(one for turn in zip_longest(*of_bench.values()) for one in turn if one) for of_bench in kinds.values()]
    yield from (one for turn in zip_longest(*queues) for one in turn if one)


def planned_recordings(programme: Sequence[Manoeuvre], model: Model) -> Iterator[PlannedRecording]:
    """Yield the planned recordings with their times in ``commands.csv``."""
    begin = 0.0
    for number, m in enumerate(programme, 1):
        yield replace(planned_recording(m, model), name=f"plan_{number}_{m.kind}", begin=begin, end=begin + m.duration)
        begin += cost_of(m)


def planned_recording(m: Manoeuvre, model: Model) -> PlannedRecording:
    """Return one manoeuvre as a recording of a rig that a model describes."""
    bench = m.bench
    return PlannedRecording(
        *(m.use, m.kind, bench.name, bench.experiment, bench.drive, bench.quantity),
        *(bench.template.chamber_2, bench.template.chamber, bench.template.imposed),
        valve="shut" if m.kind == "shut-valve" else None,
        start=asdict(start_of(m, model)),
        gain=bench.gain if bench.drive == "position" else None,
        **named(m, "centre level frequency speed pressure force added_mass"),
        by_hand=by_hand_text(m.kind, m.force, m.added_mass) if m.by_hand else None,
    )
