"""Checks and repairs of one recording, batch by batch. Good data pass bit by bit; no value is invented.

Rows are left out by the rules of :mod:`pneucli.io.timestamp_order`, and where they lie outside the stretch that is
wanted; infinite values, spikes and saturated samples become NaN; all with counts. Noticed only: NaN, tiny values,
pressures below none, gaps, a clock that jitters, and frozen channels.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import numpy as np

from pneucli.arrays import Array, Indices, Mask
from pneucli.io.raw_file import Repair
from pneucli.io.signal_repairs import COMMANDS
from pneucli.io.stuck_channels import StuckChannelDetector
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
from pneucli.quantities import axis_unit

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


Batch = dict[str, Array]

PRESSURES = ("p_supply", "p1", "p2")  # absolute: no gas has less than none
GAP_PERIODS = 10.0  # sampling periods
MAX_JITTER = 0.2  # of a sampling period
MIN_MAGNITUDE = 1e-30  # no sensor tells less from zero, in any SI unit


class Cleaner:
    """Carries what must be known of earlier batches; ``place`` tells where a data row stands in the file.

    ``noise`` is the standard deviation of each signal as far as it is known (SI); ``stretch`` the first and the last
    instant that is wanted (s). ``push`` takes a batch and returns the rows that are settled, ``finish`` the rest;
    ``repairs`` then has what was done, ``losses`` the rows that were left out, by kind.
    """

    def __init__(
        self,
        place: RowLocator,
        noise: Mapping[str, float] | None = None,
        stretch: tuple[float | None, float | None] = (None, None),
    ) -> None:
        self._noise, self._stretch = noise or {}, stretch
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
        return self._advance(self._selected_rows(batch, wait=LOOKAHEAD_ROWS), hold=MARGIN_SAMPLES)

    def finish(self) -> Batch:
        """Return the rows that waited."""
        none = {name: values[:0] for name, values in self._waiting.items()}
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
        if name in COMMANDS:
            return values
        if name == "x" and not self._kept and axis_unit("m") == "m":
            stale = find_stale_start(time, finite, self._noise.get(name, 0.0))
            self._count(name, "stale", stale.size)
            values = _with_nan_at(values, stale)
        spikes = _indices_within(find_spikes(finite, self._noise.get(name, 0.0)), start, end)
        self._count(name, "spike", spikes.size)
        values = _with_nan_at(values, spikes)
        if name in PRESSURES:
            self._count(name, "vacuum", int(np.count_nonzero(values[start:end] <= 0.0)))
        saturated = self._runs.setdefault(name, StuckChannelDetector(name)).update(values[start:end])
        return _with_nan_at(values, start + np.flatnonzero(saturated))

    def _count(self, signal: str, kind: str, count: int) -> None:
        if count:
            self._counts[signal, kind] = self._counts.get((signal, kind), 0) + count

    @property
    def period(self) -> float:
        """Median sampling period in s (of the first batch); NaN with fewer than two rows."""
        return self._clock.period

    @property
    def samples(self) -> int:
        """Rows that were handed out."""
        return self._kept

    def repairs(self) -> list[Repair]:
        """Return all that was mended or noticed so far."""
        values = [Repair(*key, count, _MESSAGES[key[1]].format(count)) for key, count in self._counts.items()]
        noticed = [repair for runs in self._runs.values() for repair in runs.repairs()]
        return [*loss_repairs(self.losses), *values, *self._clock.repairs(), *noticed]


_MESSAGES = {
    "infinite": "{} infinite values, or beyond 1e30, became NaN",
    "nan": "{} values are missing (NaN)",
    "tiny": "{} values are neither zero nor as large as 1e-30: computed, or damaged; kept",
    "vacuum": "{} pressures are 0 bar absolute or less, which no gas has; kept",
    "spike": "{} spikes became NaN",
    "stale": "{} samples at the start became NaN: no piston gets from there to the next position in time",
}


ROW_PERIOD = 1.0  # the "time" of rows without a clock counts rows


class RowChecks:
    """Takes batches of rows as :class:`pneucli.io.cleaning.Cleaner` does; only infinite values are repaired.

    Spikes, stuck sensors, gaps and jitter are properties of a time series: two neighbouring rows of a steady bench may
    differ by the whole range, or be alike because one setting was measured twice.
    """

    period = ROW_PERIOD

    def __init__(self) -> None:
        self.samples = 0
        self.losses: Counter[str] = Counter()
        self._counts: Counter[tuple[str, str]] = Counter()

    def push(self, batch: Mapping[str, Array]) -> Batch:
        """Return the rows, with NaN in place of infinite values."""
        self.samples += batch["time"].size
        return {name: values if name == "time" else self._checked(name, values) for name, values in batch.items()}

    def finish(self) -> Batch:
        """Return the rows that waited: none does."""
        return {"time": np.zeros(0)}

    def _checked(self, name: str, values: Array) -> Array:
        infinite = np.abs(values) > MAX_MAGNITUDE
        self._counts[name, "nan"] += int(np.count_nonzero(np.isnan(values)))
        self._counts[name, "infinite"] += int(np.count_nonzero(infinite))
        if name in PRESSURES:
            self._counts[name, "vacuum"] += int(np.count_nonzero(values <= 0.0))
        return np.where(infinite, np.nan, values) if infinite.any() else values

    def repairs(self) -> list[Repair]:
        """Return what was noticed so far."""
        unfitted = {
            kind: f"{_MESSAGES[kind].removesuffix('; kept')}; their rows are not fitted" for kind in ("nan", "vacuum")
        }
        told = _MESSAGES | unfitted
        return [Repair(*key, count, told[key[1]].format(count)) for key, count in self._counts.items() if count]


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
