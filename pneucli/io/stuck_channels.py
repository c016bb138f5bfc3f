"""Channels that stand still exactly: frozen, or saturated at the end of their range.

A saturated sample says only that the quantity lies beyond: it becomes missing. What is frozen is noticed, and kept.

A sensor at rest still shows its noise. So a run of one value is odd only in a channel whose noise is visible elsewhere
and where equal neighbours are rare; a quantised channel at rest, or a chamber at ambient pressure, repeats itself all
the time and is passed over. A piston rests exactly where an encoder reads it, on a stop or anywhere, and its speed is
then 0: a position is only frozen where it stands still and then jumps, which no piston does. What jumps to a value and
stays there was set to it: a sensor reaches the end of its range by way of the values before.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.io.raw_file import Repair
from pneucli.messages.formatting import format_plain
from pneucli.quantities import SIGNALS

MIN_RUN_SAMPLES = 20  # samples
FALSE_ALARM_COUNT = 1e-9  # expected number of such runs in the recording, were each repetition independent
MIN_TURN_SHARE = 0.3  # share of steps that turn round: 2/3 in white noise, about 0 in a smooth curve
MIN_STEP_RESOLUTIONS = 1.5  # steps of the resolution: below, noise hides in the quantisation
MIN_BEND_TURN_SHARE = 0.5  # share of second differences that turn round: 0.73 in white noise, about 0 in a smooth curve
MIN_BEND_RESOLUTIONS = 3.0  # second differences in steps of the resolution: rounding a slope gives up to 2
JUMP_RATIO = 20.0  # times the median step
MOTION = ("x", "v")  # stand still exactly where the piston rests on its end
MAX_STEP_RATIO = 3.0  # times the largest of the steps before, by which a moving and noisy signal goes on
SLOPE_SAMPLES = 8  # steps before a run, whose mean is its slope
MIN_KINK = 10.0  # slope over the bends before it: a signal that comes to rest by itself bends before it does


@dataclass(frozen=True)
class _Run:
    length: int
    value: float
    jump: float  # afterwards
    at_full_speed: bool  # before
    by_jump: bool  # reached


class StuckChannelDetector:
    """Collects the runs of one signal over its batches."""

    def __init__(self, signal: str) -> None:
        self._signal = signal
        self._long: list[_Run] = []
        self._repeats_in_runs = 0  # samples of these runs that equal the one before
        self._equal = self._pairs = self._turns = self._steps = self._bend_turns = self._bends = 0
        self._low, self._high = np.inf, -np.inf
        self._clipped: dict[float, int] = {}  # samples at each end of the range that the sensor clips at
        self._step = self._resolution = self._bend = np.inf

    def update(self, values: Array) -> Mask:
        """Take note of the next samples; return which of them are saturated."""
        if values.size < 2:
            return np.zeros(values.size, dtype=np.bool_)
        steps = np.diff(values[:65_536])
        moving = steps[(steps != 0) & np.isfinite(steps)]
        self._turns += int(np.sum(moving[1:] * moving[:-1] < 0))
        self._steps += moving.size
        if moving.size:
            self._step = min(self._step, float(np.median(np.abs(moving))))
            self._resolution = min(self._resolution, float(np.min(np.abs(moving))))
        self._note_bends(steps)
        self._low = min(self._low, float(np.fmin.reduce(values)))
        self._high = max(self._high, float(np.fmax.reduce(values)))
        self._collect_runs(values)
        ends = {run.value for run in self._long if run.value in (self._low, self._high) and self._is_end(run)}
        saturated = np.isin(values, [*ends]) if ends else np.zeros(values.size, dtype=np.bool_)
        for level in ends:
            self._clipped[level] = self._clipped.get(level, 0) + int(np.count_nonzero(values == level))
        return saturated

    def _note_bends(self, steps: Array) -> None:
        """Take note of second differences, which show the noise of a signal that rises or falls all the time."""
        bends = np.diff(steps)
        bends = bends[(bends != 0) & np.isfinite(bends)]
        self._bend_turns += int(np.sum(bends[1:] * bends[:-1] < 0))
        self._bends += bends.size
        if bends.size:
            self._bend = min(self._bend, float(np.median(np.abs(bends))))

    def _shows_noise(self) -> bool:
        """Return whether neighbours differ by noise that is larger than the resolution, at rest or on a slope."""
        at_rest = (
            self._turns > MIN_TURN_SHARE * self._steps > 0 and self._step > MIN_STEP_RESOLUTIONS * self._resolution
        )
        on_slope = self._bend_turns > MIN_BEND_TURN_SHARE * self._bends > 0
        return at_rest or (on_slope and self._bend > MIN_BEND_RESOLUTIONS * self._resolution)

    def _collect_runs(self, values: Array) -> None:
        same = values[1:] == values[:-1]
        self._pairs += same.size
        self._equal += int(np.count_nonzero(same))
        edges = np.concatenate([[0], np.flatnonzero(same[1:] != same[:-1]) + 1, [same.size]])
        long = np.flatnonzero(np.diff(edges) >= MIN_RUN_SAMPLES)
        for start, end in zip(edges[long], edges[long + 1], strict=True):
            if same[start]:
                jump = abs(values[end + 1] - values[end]) if end + 1 < values.size else 0.0
                self._repeats_in_runs += int(end - start)
                at_full_speed = self._signal not in MOTION and _at_full_speed(values[:start])
                by_jump = _is_reached_by_jump(values[: start + 1])
                self._long.append(_Run(int(end - start) + 1, float(values[start]), float(jump), at_full_speed, by_jump))

    def repairs(self) -> list[Repair]:
        """Return what is odd, as warnings."""
        inner = [run for run in self._long if run.value not in self._clipped and self._is_odd(run)]
        clipped = [self._saturated(level, count) for level, count in sorted(self._clipped.items())]
        return [*clipped, *([self._frozen(inner)] if inner else []), *self._plateaus(inner)]

    def _plateaus(self, told: list[_Run]) -> Iterator[Repair]:
        """Yield a repair for each end of the range at which a signal without noise, at full speed, stands still."""
        for end, level in (("smallest", self._low), ("largest", self._high)):
            runs = [run for run in self._long if run.value == level and run not in told and level not in self._clipped]
            count = sum(run.length for run in runs if run.at_full_speed)
            if count:
                message = (
                    f"{count} samples stand exactly at its {end} value, {self._with_unit(level)}, which it reaches"
                )
                message += " at full speed: the end of the sensor's range, or a valve that closes? kept"
                yield Repair(self._signal, "plateau", count, message)

    def _with_unit(self, level: float) -> str:
        unit = SIGNALS[self._signal].unit if self._signal in SIGNALS else ""
        return f"{format_plain(level, 6)} {unit}".strip()

    def _is_odd(self, run: _Run) -> bool:
        if self._signal == "x":
            return run.jump > JUMP_RATIO * self._step
        return self._is_too_long(run) and not (self._signal == "v" and run.value == 0.0)

    def _is_end(self, run: _Run) -> bool:
        """Return whether a sensor was cut off at the end of its range."""
        return self._signal != "x" and self._is_odd(run) and not run.by_jump

    def _is_too_long(self, run: _Run) -> bool:
        """Return whether a run is longer than the noise of the channel lets any be."""
        inside = self._repeats_in_runs
        repeats = max(self._equal - inside, 1) / max(self._pairs - inside, 1)
        return self._shows_noise() and np.log(self._pairs) + (run.length - 1) * np.log(min(repeats, 1.0)) < np.log(
            FALSE_ALARM_COUNT
        )

    def _saturated(self, level: float, count: int) -> Repair:
        end = self._with_unit(level)
        message = f"saturated: {count} samples stand at the end of the range, {end}; they are missing"
        return Repair(self._signal, "saturated", count, message)

    def _frozen(self, runs: list[_Run]) -> Repair:
        count, longest = sum(run.length for run in runs), max(runs, key=lambda run: run.length)
        stretch = f"{longest.length} at a stretch at {format_plain(longest.value)}"
        message = f"frozen: {count} samples stand still exactly, {stretch}; kept"
        return Repair(self._signal, "frozen", count, message)


def _is_reached_by_jump(values: Array) -> bool:
    """Return whether the last of ``values`` was reached by a step unlike those before it; so is the first of all."""
    steps = np.abs(np.diff(values[-SLOPE_SAMPLES - 1 :]))
    steps = steps[np.isfinite(steps)]
    return steps.size < SLOPE_SAMPLES or bool(steps[-1] > MAX_STEP_RATIO * steps[:-1].max())


def _at_full_speed(values: Array) -> bool:
    """Return whether a signal goes straight on at its end; the step that the end of a range cuts off comes after it."""
    steps = np.diff(values[-SLOPE_SAMPLES - 1 :])
    if steps.size < SLOPE_SAMPLES:
        return False
    slope, bend = abs(float(steps.mean())), float(np.abs(np.diff(steps)).max())
    return slope > MIN_KINK * bend and slope > 0.0
