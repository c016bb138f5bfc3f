"""Checks of rows without a clock: each row is a steady state by itself, and no row says anything of its neighbours."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import numpy as np

from pneucli.arrays import Array
from pneucli.io.cleaning import PRESSURES
from pneucli.io.raw_file import Repair
from pneucli.io.timestamp_order import MAX_MAGNITUDE

Batch = dict[str, Array]
ROW_PERIOD = 1.0  # the "time" of such a recording counts rows


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
        return [Repair(*key, count, _MESSAGES[key[1]].format(count)) for key, count in self._counts.items() if count]


_MESSAGES = {
    "infinite": "{} infinite values, or beyond 1e30, became NaN",
    "nan": "{} values are missing (NaN); their rows are not fitted",
    "vacuum": "{} pressures are 0 bar absolute or less, which no gas has; their rows are not fitted",
}
