"""Readings that were sampled slowly and held: the logger repeats each sample until the next one.

A held reading changes at every k-th row and nowhere else. Its repetitions are no samples: they become missing, so that
the reading has the clock on which it was measured.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MIN_CHANGES = 50
MIN_SAME_PHASE = 0.98  # of the changes, that lie a multiple of k rows apart
MIN_FILLED = 0.5  # of the multiples of k at which the reading changes: what rests does not tell k
MAX_ROWS = 1000  # that a sample may be held for


class HeldReadingDetector:
    """Finds a reading that is held and takes its repetitions away, batch by batch.

    ``rows`` is the number of rows for which each sample is held, 1 where the reading is not held; ``removed`` counts
    the repetitions. The first batch decides.
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
