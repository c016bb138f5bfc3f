"""Checks of how much was measured: missing samples, too few of them, too slow, one column twice."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations

import numpy as np

from pneucli.arrays import Array, Indices
from pneucli.messages.formatting import format_percent, format_plain, format_signal
from pneucli.plausibility.detectors import Detector
from pneucli.plausibility.rig_check import Finding, RigCheck, excess
from pneucli.plausibility.signal_summary import missing_share
from pneucli.quantities import CHANNELS
from pneucli.recording import Recording

MAX_MISSING_SHARE = 0.1  # of the time: more than now and then a sample; nothing in the catalogue loses any
MIN_SAMPLES = 8  # samples: fewer do not tell a sensor's noise (pneucli.noise)
STIFFNESS_ERROR = 0.1  # of the piston's frequency on its air: volumes are stated to a fifth or so
CHATTER_STEP, MIN_CHATTER_SHARE = 0.25, 0.05  # of the command's range, and of the samples
MAX_SHORT_HOLDS = 0.1  # of a command's levels, that last one sample: a test's levels last several
MAX_JUMPS = 3  # places where runs were joined
JUMP_RATIO = 3.5  # times the largest other step, from which on a step is a jump: a time constant of 0.8 samples
MIN_RISE_SAMPLES = 15  # samples that a pressure takes over its range at its fastest
MAX_JUMP_PERIODS = 2.5  # of the clock: over a gap a pressure goes where it likes
MIN_CALM_STEPS = 2  # other commands, as large, that caused no such step
MAX_ANGLE = 2.0 * math.pi / 3.0  # rad a sample, of the piston's swing: three samples tell its mean, size and phase
MAX_TURN = 2.0 * math.sin(0.5)  # of differences from sample to sample over the change: a swing of one radian a sample
INITIAL_STATES = {"p1": 1, "p2": 1, "x": 2}  # what a restart takes from a channel: its value, and the velocity of x


def _check(rig_check: RigCheck) -> Iterator[Finding]:
    """Yield findings of all recordings."""
    for one in rig_check.recordings:
        yield from _missing(one)
        yield from _too_few_samples(one)
        yield from _duplicated_columns(one)
        yield from _chattering(one)
        yield from _pressure_jumps(one)
        yield from _undersampled(one, rig_check)


def _missing(one: Recording) -> Iterator[Finding]:
    for signal in one.signals:
        share = missing_share(one, signal)
        if share > MAX_MISSING_SHARE:
            by = excess(share - MAX_MISSING_SHARE, math.sqrt(MAX_MISSING_SHARE / one.time.size))
            found = f"{signal} was not measured in {100 * share:.0f} % of the time"
            mend = f"look at the logger, or take what was measured with from and to in [[recordings]] {one.name}"
            yield from Finding("missing", signal, one.name, found, mend, by, share).judged()


def _too_few_samples(one: Recording) -> Iterator[Finding]:
    """The start of each compared channel is fitted too; effects of [model] come on top."""
    compared = [name for name in CHANNELS if name in one]
    needed = max(MIN_SAMPLES, one.kind.min_parameters + sum(INITIAL_STATES.get(name, 0) for name in compared))
    for signal in compared:
        count = int(np.isfinite(one[signal]).sum())
        if count < needed:
            found = f"{signal} has {count} samples, and {needed} at least are needed for parameters, start and noise"
            mend = f"record for longer or faster, or check from, to and skip_rows of [[recordings]] {one.name}"
            yield Finding("samples", signal, one.name, found, mend, float(needed - count))


def _duplicated_columns(one: Recording) -> Iterator[Finding]:
    """Two sensors never give the same digits, unless neither of them does anything."""
    sensors = [name for name in CHANNELS if name in one] + [name for name in ("p_supply",) if name in one]
    for first, second in combinations(sensors, 2):
        a, b = one[first], one[second]
        if np.nanmin(a) < np.nanmax(a) and np.array_equal(a, b, equal_nan=True):
            found, mend = f"{second} is {first}, digit by digit", f"name the column of {second} in [signals] {second}"
            yield Finding("copy", second, one.name, found, mend, float(np.isfinite(a).sum()))


def _chattering(one: Recording) -> Iterator[Finding]:
    """A command that goes over its range from sample to sample does so between them as well."""
    for signal in (name for name in ("u", "u2") if name in one):
        steps = np.abs(np.diff(one[signal]))
        span = float(np.nanmax(one[signal]) - np.nanmin(one[signal]))
        jumps = np.flatnonzero(steps > CHATTER_STEP * span) if span > 0.0 else np.empty(0, dtype=np.intp)
        short = float(np.mean(np.diff(jumps) == 1)) if jumps.size > MIN_SAMPLES else 0.0
        share = jumps.size / max(steps.size, 1)
        if share > MIN_CHATTER_SHARE and short > MAX_SHORT_HOLDS:
            found = f"{signal} goes over a quarter of its range or more in {format_percent(share)} of the samples, and "
            found += f"{format_percent(short)} of its levels last one sample"
            mend = "it changes between the samples too: log it at the controller's rate, or its mean over each sample"
            by = excess(short - MAX_SHORT_HOLDS, math.sqrt(MAX_SHORT_HOLDS / jumps.size))
            yield from Finding("sampling", signal, one.name, found, mend, by, share).judged()


def _pressure_jumps(one: Recording) -> Iterator[Finding]:
    """A pressure that goes further in one sample than ever otherwise, and not for its command, is of two runs."""
    if "u" not in one or not one.kind.vessel:
        return
    near = np.diff(one.time) < MAX_JUMP_PERIODS * one.period
    commands = np.flatnonzero(np.abs(np.diff(one["u"])) > 0.0)
    for signal in (name for name in ("p1", "p2") if name in one):
        p = one[signal]
        steps = np.where(near, np.abs(np.diff(p)), np.nan)
        order = np.argsort(np.nan_to_num(steps))[::-1]
        if order.size <= MAX_JUMPS + MIN_SAMPLES:
            continue
        rest = float(np.nan_to_num(steps)[order[MAX_JUMPS]])
        if rest * MIN_RISE_SAMPLES > float(np.nanmax(p) - np.nanmin(p)):
            continue  # sampled too slowly to tell a jump from filling
        noise = one.noise_rms(signal)
        for at in sorted(int(n) for n in order[:MAX_JUMPS] if steps[n] > JUMP_RATIO * max(rest, 4.0 * noise)):
            if not _stays(p, at) or _is_answer(one["u"], steps, commands, at):
                continue
            found = f"{signal} jumps by {format_signal(float(steps[at]), signal)} in one sample"
            found += f" at {format_plain(one.time[at + 1], 4)} s, and never otherwise by more than"
            found += f" {format_signal(rest, signal)}: two runs after one another?"
            mend = f"cut the recording there with from and to in [[recordings]] {one.name}"
            by = excess(float(steps[at]) - JUMP_RATIO * rest, max(2.0 * noise, 1e-6 * float(steps[at])))
            yield from Finding("jumps", signal, one.name, found, mend, by).judged()


def _stays(p: Array, at: int) -> bool:
    """Return whether a pressure stays where it jumped to: what comes back was no gas."""
    after = p[at + 1 : at + 4]
    back = float(np.nanmax(np.abs(after - p[at + 1])))
    return bool(after.size > 1 and back < 0.5 * abs(p[at + 1] - p[at]))


def _is_answer(u: Array, steps: Array, commands: Indices, at: int) -> bool:
    """Return whether a command may have caused a jump: it went over a step as others that cause as much, or alone."""
    own = commands[np.abs(commands - at) <= 1]
    if not own.size:
        return False
    size = float(np.max(np.abs(np.diff(u))[own]))
    alike = [n for n in commands if abs(n - at) > MAX_JUMPS and abs(u[n + 1] - u[n]) >= 0.5 * size]
    calm: int = sum(float(np.nanmax(steps[n : n + 3], initial=0.0)) < steps[at] / JUMP_RATIO for n in alike)
    return calm < MIN_CALM_STEPS


def _undersampled(one: Recording, bench: RigCheck) -> Iterator[Finding]:
    """A piston of whose swing the log has less than three samples is not seen moving: a sine has three unknowns.

    It hangs between two springs of air, k = kappa p A^2 / V each. Where the log is slower than that, and what it has
    recorded is smooth, nothing swings between its samples: friction and the valve settle the piston in less.
    """
    rig = bench.rig
    known = rig.piston_area_1 and rig.moving_mass and rig.dead_volume_1 and "x" in one and "p1" in one
    if one.kind.vessel or one.imposed or not known:
        return
    stiffness = sum(_air_spring_stiffness(bench, one, chamber) for chamber in (1, 2))
    omega = float(np.sqrt(max(stiffness, 0.0) / ((rig.moving_mass or 1.0) + one.added_mass)))
    if omega * one.period > MAX_ANGLE and any(_turns(one, name) for name in ("x", "p1", "p2") if name in one):
        by = excess(omega * one.period / MAX_ANGLE - 1.0, STIFFNESS_ERROR)
        rate, swing = 1 / one.period, omega / (2 * np.pi)
        found = (
            f"sampled at {format_plain(rate, 3)} Hz, and the piston swings on its air at {format_plain(swing, 3)} Hz"
        )
        wanted = format_plain(10 * swing, 2)
        mend = f"record at {wanted} Hz or more; if the logger did, mend the unit in [signals] time"
        yield from Finding("sampling", "time", one.name, found, mend, by).judged()


def _turns(one: Recording, signal: str) -> bool:
    """Return whether a signal turns from sample to sample by more than a swing of one radian a sample, beyond noise.

    A sine of w radians a sample has differences that change by 2 sin(w / 2) of their own size.
    """
    noise = one.noise_rms(signal)
    steps, turns = np.diff(one[signal]), np.diff(one[signal], 2)
    moved = float(np.nanvar(steps)) - 2.0 * noise**2  # white noise has 2 and 6 of its variance there
    turned = float(np.nanvar(turns)) - 6.0 * noise**2
    return moved > 2.0 * noise**2 and turned > MAX_TURN**2 * moved


def _air_spring_stiffness(bench: RigCheck, one: Recording, chamber: int) -> float:
    if f"p{chamber}" not in one or (chamber == 2 and one.chamber_2 == "open"):
        return 0.0
    volume = bench.volume(chamber, one["x"])
    if volume is None:
        return 0.0
    area = bench.rig.piston_areas[chamber - 1]
    return float(bench.rig.heat_capacity_ratio * np.nanmedian(one[f"p{chamber}"]) * area**2 / np.nanmedian(volume))


DETECTOR = Detector(
    _check,
    {
        "missing": ("", "more than 10 % of the time without samples (a slower clock of its own misses nothing)"),
        "samples": ("", "fewer samples than noise, start and parameters need"),
        "copy": ("", "two signals that agree digit by digit"),
        "sampling": (
            "",
            "less than three samples per swing of the piston on its air, where neighbours turn; a command that "
            "chatters between the samples",
        ),
        "jumps": ("", "a pressure that jumps in one sample and stays, not for its command"),
    },
    place=3,
)
