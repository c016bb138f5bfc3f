"""Checks and repairs of one recording, batch by batch. Good data pass bit by bit; no value is invented.

Rows are left out by the rules of :mod:`pneucli.io.timestamp_order`, and where they lie outside the stretch that is
wanted; infinite values, spikes and saturated samples become NaN; all with counts. Noticed only: NaN, tiny values,
pressures below none, gaps, a clock that jitters, and frozen channels.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array, Indices, Mask
from pneucli.io.raw_file import Batch, Repair
from pneucli.io.signal_repairs import COMMANDS
from pneucli.io.timestamp_order import (
    LOOKAHEAD_ROWS,
    MAX_BACKWARD_ROWS,
    MAX_MAGNITUDE,
    RowLocator,
    TimestampCheck,
    count_losses,
    loss_repairs,
)
from pneucli.messages.formatting import format_plain
from pneucli.quantities import SIGNALS, axis_unit

MARGIN_SAMPLES = 16  # samples on either side that a spike is judged against
MAX_SPIKE_SAMPLES = 3
MIN_NOISE_RATIO = 12.0  # times the robust deviation of the whole batch
MAX_SPEED = 30.0  # m/s: seals last to 3 m/s, impact cylinders reach 10 m/s
MIN_STEP_RATIO = 8.0  # times the largest step among the neighbours, so that impacts that ring stay
ROUNDING = 1e-12  # of the largest value: smaller steps come from converting units, not from the sensor


def find_spikes(values: Array, noise: float = 0.0) -> Indices:
    """Return the indices of spikes in ``values``, shape ``(n,)``; ``noise`` is a known standard deviation or 0.

    A spike leaves and returns by more than 12 standard deviations of the noise and 8 times the largest step within 16
    samples around it, and it returns to where it left (within an eighth of its height). Samples within one
    spike's width of either end are never judged. A sensor of finite bandwidth cannot give good data of this shape.
    """
    if values.size < 2 * MARGIN_SAMPLES:
        return np.empty(0, dtype=np.intp)
    steps = np.abs(np.diff(values))
    limit = MIN_NOISE_RATIO * max(_robust_deviation(steps, values), noise)
    before = np.flatnonzero(steps > limit)
    found = []
    for width in range(1, MAX_SPIKE_SAMPLES + 1):
        before = before[before + width + 1 < values.size]
        is_spike = _is_spike(values, steps, before, width, limit)
        found += [before[is_spike] + offset for offset in range(1, width + 1)]
        before = before[~is_spike]
    return np.unique(np.concatenate(found))


def find_stale_start(time: Array, position: Array, noise: float = 0.0) -> Indices:
    """Return the indices of first positions (n,) in m from which no piston reaches the next one in time.

    A recorder that begins hands out what it last held, or its target: up to three samples, then the sensor. Such a
    jump within a recording is no repair's matter, since either side may be right.
    """
    if position.size < 2 * MARGIN_SAMPLES:
        return np.empty(0, dtype=np.intp)
    steps = np.abs(np.diff(position))
    limit = MIN_NOISE_RATIO * max(_robust_deviation(steps, position), noise)
    far = steps[:MARGIN_SAMPLES] > np.maximum(MAX_SPEED * np.diff(time[: MARGIN_SAMPLES + 1]), limit)
    jumps = np.flatnonzero(far)
    first = jumps[0] + 1 if jumps.size == 1 and jumps[0] < MAX_SPIKE_SAMPLES else 0
    return np.flatnonzero(np.isfinite(position[:first]))


def _robust_deviation(steps: Array, values: Array) -> float:
    """Robust standard deviation of one sample, from the steps between neighbours; the resolution at least."""
    stride = max(1, steps.size // 65_536)
    sample = steps[::stride]
    sample = sample[np.isfinite(sample)]
    if not sample.size:
        return np.inf
    moving = sample[sample > ROUNDING * float(np.nanmax(np.abs(values[::stride])))]
    resolution = float(moving.min()) if moving.size else np.inf
    return max(float(np.median(sample)) / 0.954, resolution)  # 0.6745 sqrt(2), normal distribution


def _is_spike(values: Array, steps: Array, before: Indices, width: int, limit: float) -> Mask:
    """Return, for each sample of ``before``, whether a spike of ``width`` samples follows it."""
    start, end = values[before], values[before + width + 1]
    inside = np.stack([values[before + offset] for offset in range(1, width + 1)])
    height = np.minimum(np.abs(inside - start), np.abs(inside - end)).min(axis=0)
    side = np.sign(inside - start)
    is_spike = (np.abs(end - start) < height / MIN_STEP_RATIO) & (height > limit) & (side == side[0]).all(axis=0)
    candidates = np.flatnonzero(is_spike)
    usual_step = _largest_step_around(steps, before[candidates], width)
    is_spike[candidates] = height[candidates] > MIN_STEP_RATIO * usual_step
    return np.asarray(is_spike)


def _largest_step_around(steps: Array, before: Indices, width: int) -> Array:
    """Return the largest step within the margin before and after each spike; infinite where no step is known."""
    offsets = np.concatenate([np.arange(-MARGIN_SAMPLES, 0), width + 1 + np.arange(MARGIN_SAMPLES)])
    at = before[:, None] + offsets
    around = np.where((at >= 0) & (at < steps.size), steps[np.clip(at, 0, steps.size - 1)], np.nan)
    largest = np.fmax.reduce(around, axis=1, initial=-np.inf)
    return np.where(np.isfinite(largest), largest, np.inf)


PRESSURES = ("p_supply", "p1", "p2")  # absolute: no gas has less than none
GAP_PERIODS = 10.0  # sampling periods
MAX_JITTER = 0.2  # of a sampling period
ROW_PERIOD = 1.0  # the "time" of rows without a clock counts rows
MIN_MAGNITUDE = 1e-30  # no sensor tells less from zero, in any SI unit


class Cleaner:
    """Carries what must be known of earlier batches; ``place`` tells where a data row stands in the file.

    ``noise`` is the standard deviation of each signal as far as it is known (SI); ``stretch`` the first and the last
    instant that is wanted (s). ``push`` takes a batch and returns the rows that are settled, ``finish`` the rest;
    ``repairs`` then has what was done, ``losses`` the rows that were left out, by kind.

    Of ``steady`` rows, which no clock orders, only infinite values are repaired. Spikes, stuck sensors, gaps and jitter
    are properties of a time series: two neighbouring rows of a steady bench may differ by the whole range, or be alike
    because one setting was measured twice.
    """

    def __init__(
        self,
        place: RowLocator,
        noise: Mapping[str, float] | None = None,
        stretch: tuple[float | None, float | None] = (None, None),
        *,
        steady: bool = False,
    ) -> None:
        self._noise, self._stretch, self._steady = noise or {}, stretch, steady
        self._order = TimestampCheck(place)
        self._waiting: Batch = {}  # rows whose stamps are not judged yet
        self._held: Batch = {}
        self._context = 0  # leading rows of _held that have been handed out already
        self._counts: dict[tuple[str, str], int] = {}
        self._clock = _Clock()
        self._runs: dict[str, StuckChannelDetector] = {}
        self._kept = 0
        self.losses: Counter[str] = Counter()

    def push(self, batch: Mapping[str, Array]) -> Batch:
        """Return settled rows; the last few wait for their neighbours."""
        if self._steady:
            self._kept += batch["time"].size
            return {name: self._repaired(name, values, batch["time"], 0, values.size) for name, values in batch.items()}
        return self._advance(self._selected_rows(batch, wait=LOOKAHEAD_ROWS), hold=MARGIN_SAMPLES)

    def finish(self) -> Batch:
        """Return the rows that waited."""
        none = {name: values[:0] for name, values in self._waiting.items()} or {"time": np.zeros(0)}
        return self._advance(self._selected_rows(none, wait=0), hold=0)

    def _selected_rows(self, batch: Mapping[str, Array], wait: int) -> Batch:
        """Return the rows that the clock's law and the stretch leave, but for the last few."""
        rows = {name: _append(self._waiting.get(name), values) for name, values in batch.items()}
        time = rows["time"]
        ready = max(0, time.size - wait)
        fates = self._order.classify_rows(time, ready)
        self._waiting = {name: values[ready:].copy() for name, values in rows.items()}
        self.losses.update(count_losses(fates))
        start, end = self._stretch
        inside = np.ones(ready, dtype=np.bool_)
        if start is not None:
            inside &= ~(time[:ready] < start)
        if end is not None:
            inside &= ~(time[:ready] > end)
        kept = fates == 0
        self.losses["outside"] += int(np.count_nonzero(kept & ~inside))
        kept &= inside
        return {name: values[:ready] if kept.all() else values[:ready][kept] for name, values in rows.items()}

    def _advance(self, batch: Mapping[str, Array], hold: int) -> Batch:
        rows = {name: _append(self._held.get(name), values) for name, values in batch.items()}
        start, end = self._context, max(self._context, len(rows["time"]) - hold)
        time = rows["time"]
        rows = {name: self._repaired(name, values, time, start, end) for name, values in rows.items()}
        done = {name: values[start:end] for name, values in rows.items()}
        self._clock.update(done["time"])
        self._kept += end - start
        begin = max(0, end - MARGIN_SAMPLES)
        self._held = {name: values[begin:].copy() for name, values in rows.items()}
        self._context = end - begin
        return done

    def _repaired(self, name: str, values: Array, time: Array, start: int, end: int) -> Array:
        """Return one signal with its rows start..end mended; the same array where nothing is to mend."""
        size = np.abs(values)
        mine = size[start:end]
        self._count(name, "tiny", int(np.count_nonzero((mine < MIN_MAGNITUDE) & (mine > 0))))
        if name == "time":
            return values
        missing, infinite = np.flatnonzero(np.isnan(size)), np.flatnonzero(size > MAX_MAGNITUDE)
        finite = _with_nan_at(values, infinite)
        infinite = _indices_within(infinite, start, end)
        self._count(name, "infinite", infinite.size)
        self._count(name, "nan", _indices_within(missing, start, end).size)
        values = _with_nan_at(values, infinite)
        is_series = name not in COMMANDS and not self._steady
        if is_series:
            values = self._without_jumps(name, values, finite, time, start, end)
        if name in PRESSURES:
            self._count(name, "vacuum", int(np.count_nonzero(values[start:end] <= 0.0)))
        if not is_series:
            return values
        saturated = self._runs.setdefault(name, StuckChannelDetector(name)).update(values[start:end])
        return _with_nan_at(values, start + np.flatnonzero(saturated))

    def _without_jumps(self, name: str, values: Array, finite: Array, time: Array, start: int, end: int) -> Array:
        """Return a signal without its spikes, and a position without what the recorder held before the first one."""
        noise = self._noise.get(name, 0.0)
        if name == "x" and not self._kept and axis_unit("m") == "m":
            stale = find_stale_start(time, finite, noise)
            self._count(name, "stale", stale.size)
            values = _with_nan_at(values, stale)
        spikes = _indices_within(find_spikes(finite, noise), start, end)
        self._count(name, "spike", spikes.size)
        return _with_nan_at(values, spikes)

    def _count(self, signal: str, kind: str, count: int) -> None:
        if count:
            self._counts[signal, kind] = self._counts.get((signal, kind), 0) + count

    @property
    def period(self) -> float:
        """Median sampling period in s (of the first batch); NaN with fewer than two rows."""
        return ROW_PERIOD if self._steady else self._clock.period

    @property
    def samples(self) -> int:
        """Rows that were handed out."""
        return self._kept

    def repairs(self) -> list[Repair]:
        """Return all that was mended or noticed so far."""
        values = [Repair(*key, count, self._message(key[1], count)) for key, count in self._counts.items()]
        noticed = [repair for runs in self._runs.values() for repair in runs.repairs()]
        return [*loss_repairs(self.losses), *values, *self._clock.repairs(), *noticed]

    def _message(self, kind: str, count: int) -> str:
        message = _MESSAGES[kind].format(count)
        unfitted = self._steady and kind in _UNFITTED
        return f"{message.removesuffix('; kept')}; their rows are not fitted" if unfitted else message


_MESSAGES = {
    "infinite": "{} infinite values, or beyond 1e30, became NaN",
    "nan": "{} values are missing (NaN)",
    "tiny": "{} values are neither zero nor as large as 1e-30: computed, or damaged; kept",
    "vacuum": "{} pressures are 0 bar absolute or less, which no gas has; kept",
    "spike": "{} spikes became NaN",
    "stale": "{} samples at the start became NaN: no piston gets from there to the next position in time",
}
_UNFITTED = ("nan", "vacuum")  # for which a row of a steady bench is not fitted


class _Clock:
    """Median period, gaps and jitter of the time stamps that were handed out."""

    def __init__(self) -> None:
        self.period = float("nan")
        self._last = np.empty(0)
        self._gaps, self._missing, self._uneven, self._intervals = 0, 0.0, 0, 0

    def update(self, time: Array) -> None:
        """Take note of the next stamps."""
        steps = np.diff(np.concatenate([self._last, time]))
        self._last = time[-1:] if time.size else self._last
        if not steps.size:
            return
        if not np.isfinite(self.period):
            self.period = float(np.median(steps))
        wide = steps[steps > GAP_PERIODS * self.period]
        self._gaps += wide.size
        self._missing += float(wide.sum())
        self._uneven += int(np.sum(np.abs(steps - self.period) > MAX_JITTER * self.period)) - wide.size
        self._intervals += steps.size

    def repairs(self) -> list[Repair]:
        """Return gaps and jitter as far as there are any."""
        found = []
        if self._gaps:
            message = f"{self._gaps} gaps, {format_plain(self._missing, 3)} s in all, were left as they are"
            found.append(Repair("time", "gap", self._gaps, message))
        if self._uneven > max(MAX_BACKWARD_ROWS, 0.01 * self._intervals):
            share = f"{100 * self._uneven / self._intervals:.0f} %"
            period = format_plain(self.period, 4)
            message = f"the clock jitters: {share} of the intervals are {100 * MAX_JITTER:.0f} % off {period} s"
            found.append(Repair("time", "jitter", self._uneven, message))
        return found


def _append(held: Array | None, values: Array) -> Array:
    return values if held is None or not held.size else np.concatenate([held, values])


def _indices_within(where: Indices, start: int, end: int) -> Indices:
    return where[(where >= start) & (where < end)]


def _with_nan_at(values: Array, where: Indices) -> Array:
    """Return ``values`` with NaN at ``where``; the same array where there is nothing to do."""
    if not where.size:
        return values
    values = values.copy()
    values[where] = np.nan
    return values


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
    """Collects the runs of one signal that stands still exactly, over its batches: frozen, or at the end of its range.

    A saturated sample says only that the quantity lies beyond: it becomes missing. What is frozen is noticed, and kept.

    A sensor at rest still shows its noise. So a run of one value is odd only in a channel whose noise is visible
    elsewhere and where equal neighbours are rare; a quantised channel at rest, or a chamber at ambient pressure,
    repeats itself all the time and is passed over. A piston rests exactly where an encoder reads it, on a stop or
    anywhere, and its speed is then 0: a position is only frozen where it stands still and then jumps, which no piston
    does. What jumps to a value and stays there was set to it: a sensor reaches the end of its range by way of the
    values before.
    """

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
