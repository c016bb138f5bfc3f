"""Manoeuvres of the command at the valve: on a vessel, and on an axis whose piston must not drift to an end."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pneucli.plan.bench import Bench
from pneucli.plan.limits import Limits
from pneucli.plan.manoeuvre import SETTLING_TIME, Manoeuvre, ManoeuvreKind
from pneucli.plan.profile import Profile, Segment, hold, ramp, sine

MIN_PERIODS = 3.0  # of a sine
COMMAND_LEVELS = (0.1, 0.25, 0.5, 1.0)  # of the command's range
COMMAND_FREQUENCIES = (0.5, 3.0, 10.0)  # Hz
RANDOM_DWELLS = (
    0.05,
    0.6,
)  # s, of random steps: shorter and longer than a lag of the valve and the filling of a vessel
RANDOM_TIME = 7.0  # s, of random steps
RANDOM_SEED = 1925
OPENING_REST = 0.3  # s between two openings of a switching valve
VESSEL_OPENINGS = (0.01, 0.03, 0.1, 0.4)  # s, of a switching valve
AXIS_OPENINGS = (0.01, 0.02, 0.04)  # s, of a switching valve that drives a piston


def _command_manoeuvre(
    kind: ManoeuvreKind, bench: Bench, core: Profile, level: float, frequency: float | None = None
) -> Manoeuvre:
    null = bench.rig.valve_null
    body = tuple(Segment(s.duration, null + s.start, null + s.end, s.amplitude, s.frequency) for s in core)
    profile = (hold(null, SETTLING_TIME), *body, hold(null, SETTLING_TIME))
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


def vessel_commands(bench: Bench, limits: Limits) -> Iterator[Manoeuvre]:
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


def axis_commands(bench: Bench, limits: Limits) -> Iterator[Manoeuvre]:
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
