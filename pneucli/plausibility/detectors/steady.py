"""Checks of the rows of a steady bench: whether flow and pressures can be true together."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pneucli.arrays import Array
from pneucli.plausibility.detectors import Detector
from pneucli.plausibility.rig_check import Finding, RigCheck, excess
from pneucli.recording import Recording

MIN_FLOW = 0.05  # of the largest flow, that counts as flow
MIN_ROWS = 3
MIN_CORRELATION = 0.3
MIN_UPHILL_ROWS = 0.5  # of the rows with flow: fewer are rows at a small difference, or what a pump does


def _check(rig_check: RigCheck) -> Iterator[Finding]:
    """Yield gas that flows toward the higher pressure, of all recordings of steady benches."""
    for one in rig_check.recordings:
        if one.kind.steady and {"flow", "p1", "p_supply"} <= one.signals.keys():
            yield from _uphill(one, rig_check)


def _grows_with(difference: Array, flow: Array) -> bool:
    """Whether the flow grows with the pressure that it flows against: that of a pump falls."""
    if not np.ptp(difference) > 0.0 or not np.ptp(flow) > 0.0:
        return False
    return bool(np.corrcoef(difference, flow)[0, 1] > MIN_CORRELATION)


def _uphill(recording: Recording, bench: RigCheck) -> Iterator[Finding]:
    flow, p1, supply = recording["flow"], recording["p1"], recording["p_supply"]
    flowing = flow > MIN_FLOW * float(np.nanmax(np.abs(flow)))
    uphill = flowing & (p1 > supply)
    exchanged = np.count_nonzero(uphill) >= max(MIN_UPHILL_ROWS * np.count_nonzero(flowing), MIN_ROWS)
    if exchanged and _grows_with((p1 - supply)[uphill], flow[uphill]):
        found = (
            f"in {np.count_nonzero(uphill)} of {np.count_nonzero(flowing)} rows gas flows toward the higher pressure"
        )
        mend = "check whether the columns of p_supply (upstream) and p1 (downstream) are exchanged, or a reference"
        p, from_p = float(np.median(p1[uphill])), float(np.median(supply[uphill]))
        errors = (bench.pressure_error(recording, "p1", p), bench.pressure_error(recording, "p_supply", from_p))
        share = float(np.count_nonzero(uphill) / np.count_nonzero(flowing))
        by = excess(p - from_p, *errors)
        yield from Finding("flow-direction", "flow", recording.name, found, mend, by, share).judged(physics=True)


DETECTOR = Detector(
    _check,
    {
        "flow-direction": ("on a steady bench gas flows toward the higher pressure, the more the higher it is", ""),
    },
    steady=True,
    place=2,
)
