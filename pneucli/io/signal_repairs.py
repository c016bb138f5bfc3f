"""Repairs of the raw numbers of one signal, before units: marks of missing values, roll-over, and values that are held.

What was replaced, undone or filled in is counted and reported; numbers that need no repair pass bit by bit.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array, Indices, Mask
from pneucli.io.clock import CounterClock
from pneucli.io.raw_file import Channel, ColumnValues, Repair
from pneucli.io.timestamp_order import hold_missing
from pneucli.messages.formatting import format_plain

MIN_CHANGES = 50
MIN_SAME_PHASE = 0.98  # of the changes, that lie a multiple of k rows apart
MIN_FILLED = 0.5  # of the multiples of k at which the reading changes: what rests does not tell k
MAX_ROWS = 1000  # that a sample may be held for


class HeldReadingDetector:
    """Finds a reading that is held and takes its repetitions away, batch by batch.

    ``rows`` is the number of rows for which each sample is held, 1 where the reading is not held; ``removed`` counts
    the repetitions, which are no samples: they become missing. The first batch decides.
    """

    def __init__(self, *, remove: bool = True) -> None:
        self.rows = 0
        self.removed = 0
        self._remove = remove
        self._phase = 0  # rows of the next batch before a new sample

    def thin(self, values: Array) -> Array:
        """Return ``values`` with NaN where a sample is repeated; the same array where none is."""
        if not self.rows:
            self.rows, self._phase = _hold(values)
        if self.rows == 1:
            return values
        sampled = np.zeros(values.size, dtype=np.bool_)
        sampled[self._phase :: self.rows] = True
        self._phase = (self._phase - values.size) % self.rows
        self.removed += int(np.count_nonzero(~sampled & np.isfinite(values)))
        return np.where(sampled, values, np.nan) if self._remove else values


def _hold(values: Array) -> tuple[int, int]:
    """Return for how many rows each sample is held, and the row of the first new sample."""
    changes = np.flatnonzero(values[1:] != values[:-1]) + 1
    changes = changes[np.isfinite(values[changes]) & np.isfinite(values[changes - 1])]
    if changes.size < MIN_CHANGES:
        return 1, 0
    rows = int(np.median(np.diff(changes)))
    if not 1 < rows <= MAX_ROWS:
        return 1, 0
    phases = np.bincount(changes % rows, minlength=rows)
    phase = int(np.argmax(phases))
    regular = phases[phase] >= MIN_SAME_PHASE * changes.size and changes.size >= MIN_FILLED * values.size / rows
    return (rows, phase) if regular else (1, 0)


COMMANDS = ("u", "u2", "x_ref", "p_ref")  # set, not sensed: they hold their value, jump and rest as they like
POSITIONS = ("x", "x_ref")  # whose counter may roll over


def is_held(name: str, channel: Channel) -> bool:
    """Return whether a signal keeps its value until its next stamp: as stated, by default a command does."""
    return name in COMMANDS if channel.hold is None else channel.hold


class SignalRepairs:
    """Repairs one signal batch by batch, in the numbers of its column."""

    def __init__(self, name: str, channel: Channel) -> None:
        self._name = name
        command = name in COMMANDS
        self._held = is_held(name, channel)
        self._marks = MarkDetector(channel.missing, command=command) if name != "time" else None
        self._counter = CounterClock() if name == "time" else None
        self._roll_over = RollOverCorrector() if name in POSITIONS else None
        self._sampling = HeldReadingDetector(remove=not self._held) if channel.hold is None and name != "time" else None
        self._last = np.nan
        self._filled = 0

    def repair(self, values: Array) -> Array:
        """Return the next batch, repaired; the same array where there is nothing to repair."""
        if self._counter is not None:
            return self._counter.unwrap(values)
        if self._marks is not None:
            values = self._marks.replace(values)
        if self._roll_over is not None:
            values = self._roll_over.correct(values)
        if self._sampling is not None:
            values = self._sampling.thin(values)
        if self._held:
            values, filled = hold_missing(values, self._last)
            self._last = float(values[-1]) if values.size else self._last
            self._filled += filled
        return values

    def repairs(self) -> Iterator[Repair]:
        """Yield what was repaired so far."""
        if self._counter is not None and self._counter.count:
            count = self._counter.count
            yield Repair("time", "counter", count, f"the counter of the clock wraps {count} times; undone")
        if self._marks is not None:
            for mark, count in sorted(self._marks.counts.items()):
                message = f"{count} samples are {format_plain(mark, 10)}, a mark of no value: missing"
                yield Repair(self._name, "mark", count, message)
        yield from self._roll_over_repair()
        if (own := self._sampling) is not None and own.rows > 1 and self._held:
            message = f"it changes once in {own.rows} rows: it is set more slowly than logged"
            yield Repair(self._name, "set-slowly", own.rows, message)
        elif own is not None and own.rows > 1:
            message = f"each sample stands in {own.rows} rows: it was held; the {own.removed} repetitions are missing"
            yield Repair(self._name, "held", own.removed, message)
        if self._filled:
            message = f"{self._filled} fields are empty; each holds the value before it"
            yield Repair(self._name, "hold", self._filled, message)

    def _roll_over_repair(self) -> Iterator[Repair]:
        found = self._roll_over.found if self._roll_over is not None else None
        if found is None:
            return
        size = f"{format_plain(found.period)} of its column's unit"
        turns = f"the position jumps by {size}, {found.count} times: a counter rolls over"
        if found.certain:
            message = f"{turns}; undone (its zero may be off by a multiple of that)"
            yield Repair(self._name, "roll-over", found.count, message)
        else:
            yield Repair(self._name, "jumps", found.count, f"{turns}; kept, as its period is not certain")


# what loggers and converters write for "no value"; of these one sample is enough, and it need not come back
_OF_LOGGERS = (-99.0, -999.0, -9999.0, -99999.0, -999999.0, 9999.0, 99999.0, 999999.0, -999.9, -999.99, -999.25)
_ENDS_OF_CONVERTERS = (1023.0, 4095.0, 16383.0, 32767.0, -32768.0, 65535.0, 8388607.0, -8388608.0, 16777215.0)
_ENDS_OF_INTEGERS = (2147483647.0, -2147483648.0, 4294967295.0)
_OF_INSTRUMENTS = (1e10, -1e10, 1e20, -1e20, 9.9e37, 9.91e37)  # 9.9e37 and 9.91e37: SCPI-99, 7.2.1.4
KNOWN_MARKS = frozenset((*_OF_LOGGERS, *_ENDS_OF_CONVERTERS, *_ENDS_OF_INTEGERS, *_OF_INSTRUMENTS))
MIN_JUMP_STEPS = 8.0  # usual steps of the column that a jump to a mark has at least, as for a spike
USUAL_STEP = 0.995  # quantile of the steps between other values that is called usual
CANDIDATE_STEP = 0.9  # the same while it is not known which values are marks, which then are up to a tenth of the steps
MIN_JUMP_RANGE = 0.1  # of the range of the other values
MAX_RETURN_ERROR = 0.25  # of the jump, that the value after a run may differ from the value before
MIN_SAMPLES = 32  # of a column that is judged at all
MIN_SINGLE_RUN = 4  # samples of one run that makes a mark by itself: up to 3 are a spike
MAX_SHARE = 0.5  # of the samples: a number that most samples have is what the column reads
KNOWN_DISTANCE = 2.0  # ranges of the other values, from their middle, beyond which a known mark needs no jump


class MarkDetector:
    """Replaces the marks of one column by NaN, batch by batch; ``counts`` has the samples of each mark.

    A mark is one exact number, such as -9999, that the column jumps to and comes back from. A sensor of finite
    bandwidth reaches every number by way of those in between, so the jump, measured in the column's own usual steps,
    tells the two apart.

    ``stated`` marks are replaced wherever they stand, and nothing else is then looked for. ``commands`` may jump as
    they like: of them only known marks count that lie far from all other values.
    """

    def __init__(self, stated: Collection[float] | None = None, *, command: bool = False) -> None:
        self._stated = stated
        self._command = command
        self._found: set[float] = set()
        self.counts: Counter[float] = Counter()

    def replace(self, values: Array) -> Array:
        """Return ``values`` with NaN at marks; the same array where there are none."""
        if self._stated is not None:
            mask = np.isin(values, np.array([*self._stated], dtype=np.float64))
        else:
            mask = self._marked(values)
        if not mask.any():
            return values
        numbers, counts = np.unique(values[mask], return_counts=True)
        self.counts.update(dict(zip(numbers.tolist(), counts.tolist(), strict=True)))
        self._found |= set(numbers.tolist())
        values = values.copy()
        values[mask] = np.nan
        return values

    def _marked(self, values: Array) -> Mask:
        mask = np.zeros(values.size, dtype=np.bool_)
        finite = np.flatnonzero(np.isfinite(values))
        if finite.size < MIN_SAMPLES:
            return mask
        runs = _Runs(values[finite])
        taken = runs.known(self._found) if self._command else runs.marks(self._found)
        mask[finite[taken]] = True
        return mask


class _Runs:
    """The runs of equal values in finite ``values``, shape ``(n,)``, and the jumps by which each begins and ends."""

    def __init__(self, values: Array) -> None:
        self._values = values
        edges = np.flatnonzero(values[1:] != values[:-1]) + 1
        self._first = np.concatenate([[0], edges])
        self._end = np.concatenate([edges, [values.size]])
        self._level = values[self._first]
        self._before = np.where(self._first > 0, values[np.maximum(self._first - 1, 0)], np.nan)
        self._after = np.where(self._end < values.size, values[np.minimum(self._end, values.size - 1)], np.nan)

    def known(self, found: Collection[float]) -> Mask:
        """Return the samples at known marks that lie far from all other values."""
        candidates = np.isin(self._values, np.array([*(KNOWN_MARKS | set(found))]))
        rest = self._values[~candidates]
        if not candidates.any() or rest.size < MIN_SAMPLES:
            return np.zeros(self._values.size, dtype=np.bool_)
        low, high = float(rest.min()), float(rest.max())
        reach = KNOWN_DISTANCE * max(high - low, abs(high), abs(low))
        return np.asarray(candidates & (np.abs(self._values - 0.5 * (low + high)) > reach))

    def marks(self, found: Collection[float]) -> Mask:
        """Return the samples of all runs at marks."""
        far = self.known(found)
        jumps = np.fmin(np.abs(self._level - self._before), np.abs(self._level - self._after))
        returns = np.abs(self._after - self._before) < MAX_RETURN_ERROR * jumps
        length = self._end - self._first
        at_edge = np.isnan(self._before) | np.isnan(self._after)
        repeated = returns & (length > 1)
        reach = self._reach(far)
        if not found and not np.any(repeated & (jumps > reach)):
            return far
        candidates = repeated & (jumps > max(reach, self._usual_jump(far, CANDIDATE_STEP)))
        marks = far | np.isin(self._values, self._level[candidates])
        enough = jumps > max(self._reach(marks) if candidates.any() else reach, self._usual_jump(marks, USUAL_STEP))
        isolated = enough & returns
        own = np.isin(self._level, self._established(isolated, length, found))
        chosen = own & enough & (isolated | at_edge)
        mask = np.repeat(chosen, length)
        if np.count_nonzero(mask) > MAX_SHARE * mask.size:
            mask[:] = False
        return np.asarray(mask | far)

    def _reach(self, passed_over: Mask) -> float:
        """Return the part of the range of the values that a jump to a mark has at least, but for those passed over."""
        rest = self._values[~passed_over]
        if not rest.size:
            return np.inf
        low, high = np.quantile(rest, (0.01, 0.99))
        return MIN_JUMP_RANGE * float(high - low)

    def _usual_jump(self, passed_over: Mask, quantile: float) -> float:
        """Return how large a jump to a mark is at least by the steps between values; infinite where none differ."""
        steps = np.abs(np.diff(np.where(passed_over, np.nan, self._values)))
        steps = steps[steps > 0]
        return MIN_JUMP_STEPS * float(np.quantile(steps, quantile)) if steps.size else np.inf

    def _established(self, isolated: Mask, length: Indices, found: Collection[float]) -> Array:
        """Return the levels that are marks: of two isolated runs, of a long one, or found before."""
        levels, at = np.unique(self._level[isolated & (length > 1)], return_inverse=True)
        longest = np.zeros(levels.size, dtype=np.intp)
        np.maximum.at(longest, at, length[isolated & (length > 1)])
        count = np.bincount(at, minlength=levels.size)
        marks = levels[(count > 1) | (longest >= MIN_SINGLE_RUN)]
        return np.unique(np.concatenate([marks, np.array([*found], dtype=np.float64)]))


MIN_ROLL_OVER_RANGE = 0.8  # of the column's range, that a jump has at least: less, and the counter does not wrap
MAX_STEP_SHARE = 0.25  # of the period, that any other step has at most: above it a jump might go either way
MAX_PERIOD_SPREAD = 0.02  # of the period, by which single jumps may differ from it
MIN_AGREEMENT = 0.5  # of the motion around the jumps, that goes on against them, less what goes with them
MIN_TRAVEL = 0.02  # of the period, that the position moves once the jumps are taken out: what switches does not
MIN_COUNTED_SAMPLES = 16
_BITS = range(8, 33)
_ROUND = (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)
_TURNS = (np.pi, 2.0 * np.pi, 180.0, 360.0, 3600.0)


@dataclass(frozen=True)
class RollOver:
    """The period of a counter in the column's numbers, how often it wrapped, and whether the period is certain."""

    period: float
    count: int
    certain: bool


class RollOverCorrector:
    """Undoes the roll-over of one column, batch by batch, where it is certain.

    A counter that wraps jumps from one end of its range to the other between two samples. Between jumps the position
    moves on at its own speed, so that each jump, less the step that its neighbours lead to expect, is the same period.
    It is certain where it is a number that a counter may have: a power of two of the resolution, or a round length or
    angle.
    """

    def __init__(self) -> None:
        self.found: RollOver | None = None
        self._turns = 0
        self._last = np.nan

    def correct(self, values: Array) -> Array:
        """Return ``values`` without jumps by the period, as far as that is certain; else as they are."""
        finite = np.isfinite(values)
        known = values[finite]
        joined = known if np.isnan(self._last) else np.concatenate([[self._last], known])
        found = self.found or find_roll_over(joined)
        if found is None or not found.certain or not known.size:
            self.found = found if self.found is None else self.found
            self._last = known[-1] if known.size else self._last
            return values
        steps = np.diff(joined, prepend=joined[0])[joined.size - known.size :]
        turns = self._turns + np.cumsum(np.where(np.abs(steps) > 0.5 * found.period, -np.sign(steps), 0.0))
        lowest = float(np.min(known + turns * found.period))
        if self.found is None and lowest < -MAX_STEP_SHARE * found.period:  # a position is counted from its smallest
            turns += np.ceil(-lowest / found.period - MAX_STEP_SHARE)
        wraps = int(np.count_nonzero(np.abs(steps) > 0.5 * found.period))
        before = self.found.count if self.found else 0
        self.found = RollOver(found.period, before + wraps, True)
        self._turns, self._last = int(turns[-1]), float(known[-1])
        corrected = values.copy()
        corrected[finite] = known + turns * found.period
        return corrected


def find_roll_over(values: Array) -> RollOver | None:
    """Return the roll-over in finite ``values``, shape ``(n,)``; None where nothing jumps like one."""
    steps, span = np.diff(values), float(np.ptp(values)) if values.size else 0.0
    jumps = np.flatnonzero(np.abs(steps) > MIN_ROLL_OVER_RANGE * span)
    others = np.delete(steps, jumps)
    if values.size < MIN_COUNTED_SAMPLES or not jumps.size or not span or not others.size:
        return None
    if float(np.abs(others).max()) > MAX_STEP_SHARE * span or not _goes_on(values, steps, jumps, span):
        return None
    expected = _expected_steps(steps, jumps)
    against = -np.sign(steps[jumps]) * expected
    sizes = np.abs(steps[jumps] - expected)
    period = float(np.median(sizes))
    travel = float(np.ptp(np.cumsum(np.where(np.abs(steps) > 0.5 * period, 0.0, steps))))
    if float(against.sum()) <= MIN_AGREEMENT * float(np.abs(against).sum()) or travel < MIN_TRAVEL * period:
        return None
    if float(np.abs(sizes - period).max()) > MAX_PERIOD_SPREAD * period:
        return None
    tolerance = max(float(np.quantile(np.abs(others), 0.99)), 1e-9 * period)  # near its end noise alone turns a counter
    named = _counter_period(period, values, tolerance)
    return RollOver(named or period, int(jumps.size), named is not None)


def _goes_on(values: Array, steps: Array, jumps: Indices, span: float) -> bool:
    """Return whether every jump leads from near one end of the range to near the other."""
    low = float(values.min())
    before, after = (values[jumps] - low) / span, (values[jumps + 1] - low) / span
    near = 1.0 - MIN_ROLL_OVER_RANGE
    up, down = steps[jumps] > 0, steps[jumps] < 0
    return bool(np.all(up == (after > 1 - near)) and np.all(up == (before < near)) and np.all(down != up))


def _expected_steps(steps: Array, jumps: Indices) -> Array:
    """Return the step that the neighbours of each jump lead to expect."""
    plain = steps.copy()
    plain[jumps] = np.nan
    around = jumps[:, None] + np.array([-3, -2, -1, 1, 2, 3])
    inside = (around >= 0) & (around < steps.size)
    near = np.where(inside, plain[np.clip(around, 0, steps.size - 1)], np.nan)
    count = np.count_nonzero(np.isfinite(near), axis=1)
    return np.asarray(np.where(count, np.nansum(near, axis=1) / np.maximum(count, 1), 0.0))


def _counter_period(period: float, values: Array, tolerance: float) -> float | None:
    """Return the number near ``period`` that a counter may have as its period; None where there is none, or several."""
    levels = np.unique(values)
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-9 * period]
    step = float(gaps.min()) if gaps.size else 0.0
    candidates = {step * 2**bits for bits in _BITS} if step else set()
    decade = 10.0 ** np.floor(np.log10(period))
    candidates |= {*_TURNS} | {float(round_ * scale) for round_ in _ROUND for scale in (decade, 10 * decade)}
    near = [one for one in candidates if abs(one - period) <= tolerance]
    return min(near, key=lambda one: abs(one - period)) if near and tolerance < 0.05 * period else None


_GOOD = re.compile(r"(?i)good|ok|valid|true")
_BAD = re.compile(
    r"(?i)bad|not? ?ok|nok|invalid|false|uncertain|fault|error|fail(?:ed|ure)?|stale|timeout|(?:under|over)-?range"
)
_OPC_GOOD = 192  # quality of OPC DA (0xC0), below which a value is bad or uncertain
JUDGES = re.compile(
    r"(?i)(?:.*/)?(?:(?:opc|data|sample|value|tag)?[\s_]?(quality|status|valid(?:ity)?)[\s_]?(?:code)?|q)"
)


def good_words(texts: Iterable[object], called: str) -> list[str]:
    """Return the words or numbers that call a value good where all others call it bad; none where they do not."""
    words = [str(text).strip() for text in dict.fromkeys(texts)]
    numbers = [float(word) if word.replace(".", "", 1).isdigit() else None for word in words]
    if called in ("quality", "status"):
        good = [n is not None and _OPC_GOOD <= n < 256 for n in numbers]  # a byte: a drive's status word is none
        bad = [n is not None and n < _OPC_GOOD for n in numbers]
    else:
        good, bad = [n == 1.0 for n in numbers], [n == 0.0 for n in numbers]
    good = [one or bool(_GOOD.fullmatch(word)) for one, word in zip(good, words, strict=True)]
    bad = [one or bool(_BAD.fullmatch(word)) for one, word in zip(bad, words, strict=True)]
    told = any(good) and any(bad) and all(a != b for a, b in zip(good, bad, strict=True))
    return [word for word, one in zip(words, good, strict=True) if one and told]


def bad_rows(columns: Mapping[str, ColumnValues | list[str]]) -> tuple[str, Mask] | None:
    """Return the column of a long table that calls rows good or bad, and which rows are bad; None where none does."""
    for name, texts in columns.items():
        called = JUDGES.fullmatch(name.strip())
        if called and (good := good_words(texts, (called[1] or "quality").lower())):
            return name, ~np.isin(np.asarray(texts, dtype=str), good)
    return None
