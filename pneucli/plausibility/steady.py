"""Checks of the rows of a steady bench: whether flow and pressures can be true together."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pneucli.plausibility.rig_check import Finding, RigCheck
from pneucli.recording import Recording

MIN_FLOW = 0.05  # of the largest flow, that counts as flow
MIN_UPHILL_ROWS = 0.5  # of the rows with flow: fewer are rows at a small difference, or what a pump does


def check(rig_check: RigCheck) -> Iterator[Finding]:
    """Yield gas that flows toward the higher pressure, of all recordings of steady benches."""
    for one in rig_check.recordings:
        if one.kind.steady and {"flow", "p1", "p_supply"} <= one.signals.keys():
            yield from _uphill(one)


def _uphill(recording: Recording) -> Iterator[Finding]:
    flow, p1, supply = recording["flow"], recording["p1"], recording["p_supply"]
    flowing = flow > MIN_FLOW * float(np.nanmax(np.abs(flow)))
    uphill = flowing & (p1 > supply)
    if flowing.any() and np.count_nonzero(uphill) >= MIN_UPHILL_ROWS * np.count_nonzero(flowing):
        found = f"in {np.count_nonzero(uphill)} of {np.count_nonzero(flowing)} rows gas flows toward the higher pressure"
        mend = "check whether the columns of p_supply (upstream) and p1 (downstream) are exchanged, or a reference"
        yield Finding("flow-direction", "flow", recording.name, found, mend)
