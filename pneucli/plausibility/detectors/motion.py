"""Checks of position, velocity and acceleration against each other and against the stroke."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pneucli.io.cleaning import MAX_SPEED
from pneucli.messages.formatting import format_plain, format_signal
from pneucli.plausibility.blocks import Blocks, fit_linear
from pneucli.plausibility.detectors import Detector
from pneucli.plausibility.rig_check import (
    MIN_DOUBT,
    POSITION_GAIN,
    PRESSURE_GAIN,
    UNIT_SLIP_FACTOR,
    Finding,
    RigCheck,
    excess,
)
from pneucli.quantities import axis_unit
from pneucli.recording import Recording

MAX_ZERO_ERROR = 0.05  # of the stroke: x = 0 is set by hand at an end stop; further off it is another zero
MIN_JUMP_NOISE, MIN_JUMP_STEPS = 20.0, 5.0  # times the noise, and steps of its resolution, of a jump of x
MAX_JUMPS = 1000  # that are looked at


def _check(rig_check: RigCheck) -> Iterator[Finding]:
    """Yield findings of all recordings with a piston."""
    moved = [one for one in rig_check.recordings if "x" in one and one.kind.cylinder]
    for one in moved:
        yield from _stroke(one, rig_check)
        yield from [*_speed(one)] or _jumps(one)
        for signal, order in (("v", 1), ("a", 2)):
            if signal in one and (found := rig_check.blocks(one, "x", order)):
                yield from _derivative(one, signal, order, found)
    yield from _motionless(moved, rig_check)


def _stroke(one: Recording, bench: RigCheck) -> Iterator[Finding]:
    """The range of x fits into the stroke. Where x is zero counts only where volumes of gas follow from x."""
    stroke, (low, high) = bench.rig.stroke, np.nanpercentile(one["x"], (0.1, 99.9))
    if stroke is None:
        return
    seen = (
        f"x goes from {format_signal(low, 'x')} to {format_signal(high, 'x')}, "
        f"the stroke is {format_signal(stroke, 'x')}"
    )
    own = bench.calibrations.get("x")
    gain = POSITION_GAIN if own is None else max(own.gain, own.zero / stroke)
    error = float(np.hypot(gain * stroke, one.noise_rms("x")))
    beyond = excess(high - low - stroke, error)
    share = float(np.nanmean((one["x"] < low) | (one["x"] > low + stroke)))
    mend = "check unit and scale in [signals] x, and [rig.cylinder] stroke"
    ranges = [*Finding("stroke", "x", one.name, seen, mend, beyond, share).judged(physics=True)]
    yield from ranges
    outside = max(-low, high - stroke)
    if not ranges and outside > MAX_ZERO_ERROR * stroke and (one.kind.axis or one.chamber_2 == "closed"):
        mend = "x = 0 is where chamber 1 is smallest: write offset in [signals] x"
        if high <= MAX_ZERO_ERROR * stroke:
            mend = f"write scale = -1.0 in [signals] x if it grows toward chamber 1; else {mend}"
        empty = [n for n, end in ((1, low), (2, high)) if (v := bench.volume(n, end)) is not None and v < 0.0]
        if empty:
            seen += f", and chamber {empty[0]} would have less than no volume"
        yield from Finding("stroke", "x", one.name, seen, mend, excess(outside, error), share).judged(
            physics=any(empty)
        )


def _speed(one: Recording) -> Iterator[Finding]:
    """The fastest stretch of eight samples, so that no single sample counts."""
    at = np.flatnonzero(np.isfinite(one["x"]))[::8]
    if at.size < 2:
        return
    speed = float(np.percentile(np.abs(np.diff(one["x"][at]) / np.diff(one.time[at])), 99.0))
    found = f"x moves at {format_signal(speed, 'v')}, faster than any piston ({format_signal(MAX_SPEED, 'v')})"
    by = excess(speed / MAX_SPEED - 1.0, PRESSURE_GAIN)
    yield from Finding("speed", "x", one.name, found, "check the units in [signals] time and x", by).judged()


def _jumps(one: Recording) -> Iterator[Finding]:
    """Steps from one place to another, faster than any piston: lost counts, or two recordings in one."""
    at = np.flatnonzero(np.isfinite(one["x"]))
    x, time, model = one["x"][at], one.time[at], one.noise.get("x")
    steps = np.diff(x)
    least = max(MIN_JUMP_NOISE * model.rms, MIN_JUMP_STEPS * model.step) if model is not None else 0.0
    jumps = np.flatnonzero((np.abs(steps) > MAX_SPEED * np.diff(time)) & (np.abs(steps) > least)) + 1
    places = [(float(np.median(x[max(0, n - 8) : n])), float(np.median(x[n : n + 8]))) for n in jumps[:MAX_JUMPS]]
    stays = [n for n, (a, b) in zip(jumps, places, strict=False) if abs(b - a) > 0.5 * abs(steps[n - 1])]
    if stays and axis_unit("m") == "m":
        first = stays[0]
        jump, period = abs(float(steps[first - 1])), time[first] - time[first - 1]
        times = "once" if len(stays) == 1 else f"{len(stays)} times"
        found = (
            f"x jumps {times}, first by {format_signal(jump, 'x')} in {format_plain(1e3 * period, 3)} ms "
            f"at {format_plain(time[first], 5)} s: no piston is so fast"
        )
        mend = f"lost counts, or two recordings in one? cut with from and to in [[recordings]] {one.name}"
        noise = 0.0 if model is None else model.rms
        by = excess(jump - MAX_SPEED * period, noise, PRESSURE_GAIN * MAX_SPEED * period)
        yield from Finding("speed", "x", one.name, found, mend, by, len(stays) / x.size).judged()


def _derivative(one: Recording, signal: str, order: int, cut: Blocks) -> Iterator[Finding]:
    """Compare what was measured with the derivative of x: their factor is 1, whatever the sensor's offset."""
    derived = cut.slope("x") if order == 1 else cut.curvature("x")
    measured = cut.mean(signal, order)
    line = fit_linear([derived, np.ones_like(derived)], measured)
    if line is None:
        return
    factor, error = float(line.factors[0]), float(line.errors[0])
    found = f"{signal} is {format_plain(factor, 2)} times the {'first' if order == 1 else 'second'} derivative of x"
    check, slip = "derivative", _unit_slip(factor, order, signal)
    mend = f"check the units in [signals] {signal}, x and time ({slip})"
    outside = max(abs(factor) - UNIT_SLIP_FACTOR, 1 / UNIT_SLIP_FACTOR - abs(factor))
    if abs(factor) <= MIN_DOUBT * error:
        check, mend = "silent", f"{signal} is dead, or another column: check the column in [signals] {signal}"
    elif factor < -1 / UNIT_SLIP_FACTOR:
        check, outside = "direction", -factor - 1 / UNIT_SLIP_FACTOR
        mend = f"write scale = -1.0 in [signals] x if x grows toward chamber 1, else in [signals] {signal}"
    yield from Finding(check, signal, one.name, found, mend, excess(outside, error)).judged(physics=True)


def _unit_slip(factor: float, order: int, signal: str) -> str:
    """Say which slip of a thousand explains a factor."""
    thousands = round(float(np.log10(abs(factor) or 1.0)) / 3)
    slips = {1: f"x in m, or {signal} in mm/s{'^2' if order == 2 else ''}", order: "time in ms"}
    return slips.get(thousands, "none of the usual slips by a thousand")


def _motionless(moved: list[Recording], bench: RigCheck) -> Iterator[Finding]:
    """A piston may stick, be held, or lie on a stop; it does not stick under more than twice what moves it elsewhere.

    From sticking the one way to sticking the other way the force swings by twice the static friction.
    """
    still = [one for one in moved if bench.is_inactive(one, "x") and "x" not in bench.stated.get(one.name, ())]
    others = [one for one in moved if one not in still]
    limit = 2.0 * min([_net_force_range(one, bench) for one in others], default=0.0)
    ends = [float(np.nanpercentile(one["x"], q)) for one in others for q in (0.1, 99.9)]
    stops = [0.0, bench.rig.stroke or 0.0, min(ends, default=0.0), max(ends, default=0.0)]
    reach = POSITION_GAIN * max(bench.rig.stroke or 0.0, float(np.ptp(ends)) if ends else 0.0)
    for one in still:
        swing, x = _net_force_range(one, bench), float(np.nanmedian(one["x"]))
        if others and (min(abs(x - stop) for stop in stops) <= reach or not swing > limit > 0):
            continue
        low, high = (format_signal(float(end), "x", 6) for end in (np.nanmin(one["x"]), np.nanmax(one["x"])))
        pushed = f" while the force on it changes by {format_signal(swing, 'force')}" if np.isfinite(swing) else ""
        found = f"the piston does not move: x stays at {low} to {high}{pushed}"
        mend = "a dead sensor or another column? check [signals] x; "
        mend += f'if the piston was held, write x = "{low}" in [[recordings]] {one.name}'
        by = excess(swing - limit, PRESSURE_GAIN * max(swing, limit)) if np.isfinite(swing) else MIN_DOUBT
        yield from Finding("motionless", "x", one.name, found, mend, by).judged()


def _net_force_range(one: Recording, bench: RigCheck) -> float:
    """Return by how many N the net force changes, in means of a hundredth of the recording; NaN where unknown."""
    width = max(1, one.time.size // 100)
    cut = Blocks.cut(one, "x", width) if width > 1 else None
    if cut is None or not cut.count:
        return float("nan")
    force = bench.net_force(one, {name: cut.mean(name) for name in ("p1", "p2", "force") if name in one})
    return float("nan") if force is None else float(np.ptp(force))


DETECTOR = Detector(
    _check,
    {
        "stroke": (
            "the range of x exceeds the stroke",
            "x leaves the stroke by more than 5 % at either end, where volumes follow from x",
        ),
        "speed": ("", "x is faster than 30 m/s, or jumps from one place to another in one sample"),
        "derivative": ("v or a is not the derivative of x within half a power of ten", ""),
        "direction": ("v or a is against x", ""),
        "silent": ("v or a has nothing to do with x (the signal alone is left out)", ""),
        "motionless": (
            "",
            "the piston moves in no recording, or away from the stops not under twice the force that moves it "
            'elsewhere; state a clamped piston: `x = "100 mm"`',
        ),
    },
    place=5,
)
