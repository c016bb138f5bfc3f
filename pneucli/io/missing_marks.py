"""Marks of missing values: numbers such as -9999, 0 or 65535 that a logger writes where the sensor gave none.

A mark is one exact number that the column jumps to and comes back from. A sensor of finite bandwidth reaches every
number by way of those in between, so the jump, measured in the column's own usual steps, tells the two apart.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection

import numpy as np

from pneucli.arrays import Array, Indices, Mask

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
