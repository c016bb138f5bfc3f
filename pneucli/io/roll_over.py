"""Roll-over of a position counter: the reading jumps by the counter's period, which is undone where it is certain.

A counter that wraps jumps from one end of its range to the other between two samples. Between jumps the position moves
on at its own speed, so that each jump, less the step that its neighbours lead to expect, is the same period. The
period is certain where it is a number that a counter may have: a power of two of the resolution, or a round length or
angle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array, Indices

MIN_JUMP_RANGE = 0.8  # of the column's range, that a jump has at least: less, and the counter does not wrap
MAX_STEP_SHARE = 0.25  # of the period, that any other step has at most: above it a jump might go either way
MAX_PERIOD_SPREAD = 0.02  # of the period, by which single jumps may differ from it
MIN_AGREEMENT = 0.5  # of the motion around the jumps, that goes on against them, less what goes with them
MIN_TRAVEL = 0.02  # of the period, that the position moves once the jumps are taken out: what switches does not
MIN_SAMPLES = 16
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
    """Undoes the roll-over of one column, batch by batch."""

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
    jumps = np.flatnonzero(np.abs(steps) > MIN_JUMP_RANGE * span)
    others = np.delete(steps, jumps)
    if values.size < MIN_SAMPLES or not jumps.size or not span or not others.size:
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
    near = 1.0 - MIN_JUMP_RANGE
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
