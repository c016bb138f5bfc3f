"""Whether a model is good enough for its user: the error of each channel against a tolerance.

The noise floor says whether a better model is possible; a tolerance says whether a better model is needed. A real rig
is seldom described down to its sensors' noise, and seldom has to be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.compare.channel_errors import ChannelResult

DEFAULT_SHARE = 0.05  # of the measured range: a fit of 95 %, which control engineers take for a good one


@dataclass(frozen=True)
class ToleranceUse:
    """One channel of one recording: its rms error ``value`` and the ``tolerance``, both in ``unit`` (SI)."""

    recording: str
    channel: str
    value: float
    tolerance: float
    unit: str

    @property
    def ratio(self) -> float:
        """The error over the tolerance; 1 is the limit."""
        return self.value / self.tolerance


@dataclass(frozen=True)
class Purpose:
    """Whether every channel stays within its tolerance, and the channel that uses most of it."""

    adequate: bool
    worst: ToleranceUse


def assess_purpose(results: Sequence[ChannelResult], tolerances: Mapping[str, float]) -> Purpose | None:
    """Compare the rms error of each channel with its tolerance.

    Args:
        results: errors of all channels of all recordings. Test recordings decide where there are any.
        tolerances: the largest rms error by channel (SI). A channel without one takes ``DEFAULT_SHARE`` of its largest
            measured range over all recordings.

    Returns:
        The verdict with its worst channel; None where no channel has both an error and a tolerance.

    """
    ranges: dict[str, float] = {}
    for r in results:
        ranges[r.channel] = float(np.fmax(ranges.get(r.channel, 0.0), r.measured_range))
    limits = {channel: DEFAULT_SHARE * span for channel, span in ranges.items()} | dict(tolerances)
    test = [r for r in results if r.use == "test"]
    used = [
        ToleranceUse(r.recording, r.channel, r.rmsd, limits[r.channel], r.unit)
        for r in test or results
        if np.isfinite(r.rmsd) and limits[r.channel] > 0.0
    ]
    worst = max(used, key=lambda one: one.ratio, default=None)
    return None if worst is None else Purpose(worst.ratio <= 1.0, worst)
