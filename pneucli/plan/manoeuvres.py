"""The candidate manoeuvres of each bench: profiles of its command with level, rate, dwell, frequency and position."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from pneucli.plan.bench import Bench, Drive
from pneucli.plan.command_manoeuvres import MIN_PERIODS, axis_commands, vessel_commands
from pneucli.plan.limits import Limits
from pneucli.plan.manoeuvre import GRAVITY, SETTLING_TIME, Manoeuvre, ManoeuvreKind
from pneucli.plan.profile import Profile, Segment, hold, ramp, sine

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


def candidate_manoeuvres(bench: Bench, limits: Limits) -> Iterator[Manoeuvre]:
    """Yield the manoeuvres that a bench can do, within limits of its command; their motion is not checked yet.

    Args:
        bench: The bench.
        limits: The limits of the rig.

    Yields:
        Manoeuvres that begin and end at rest.
    """
    families: dict[Drive, Callable[[Bench, Limits], Iterator[Manoeuvre]]] = {
        "valve": vessel_commands if bench.template.kind.vessel else axis_commands,
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
        begin, end = centres[1] - 0.5 * way, centres[1] + 0.5 * way
        time = way / speed
        core = (ramp(begin, end, time), hold(end, 0.2), ramp(end, begin, time), hold(begin, 0.2))
        repeats = max(1, min(3, int(SINE_TIME / (2.0 * time))))
        yield _motion("strokes", bench, limits, core * repeats, way, None, speed)
    for rate in WIDE_SPEEDS:
        speed, way = min(rate * span, fastest), WIDE_SHARE * span
        begin, end = centres[1] - 0.5 * way, centres[1] + 0.5 * way
        core = (ramp(begin, end, way / speed), hold(end, 0.2), ramp(end, begin, way / speed), hold(begin, 0.2))
        yield _motion("strokes", bench, limits, core, way, None, speed)
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
    low, high = limits.position
    span, rig = high - low, bench.rig
    gauge = (rig.supply_pressure or bench.start.p1) - rig.ambient_pressure
    for pressure in (rig.ambient_pressure + share * gauge for share in PRESSURE_LEVELS):
        for speed in (0.25 * limits.max_speed / 1.5, limits.max_speed / 1.5):
            way = min(0.6 * span, 3.0 * speed)
            begin, end = low + 0.5 * (span - way), low + 0.5 * (span + way)
            core = (ramp(begin, end, way / speed), hold(end, 0.3), ramp(end, begin, way / speed), hold(begin, 0.3))
            one = _motion("machine-strokes", bench, limits, core * 2, way, None, speed)
            yield replace(one, pressure=pressure)


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
