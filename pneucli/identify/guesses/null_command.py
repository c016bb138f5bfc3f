"""The command at which nothing flows, from what fills a chamber and what vents it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pneucli.errors import InputError
from pneucli.identify.guesses.flow_paths import flow_path_data
from pneucli.recording import Recording, Rig
from pneucli.simulate.preparation import prepare

Array = NDArray[np.float64]

GRID_COMMANDS = 2000
MIN_DRIFT = 0.01  # of the range of commands: less is the noise of flows at the null itself
MAX_WRONG_WAY_FLOW = 0.002  # of all gas that moved: less on the wrong side is noise, or gas on its way
UNIT_VOLUME = 1.0  # m^3, of a vessel: each recording's flow is scaled


def with_identified_null(recordings: Sequence[Recording], rig: Rig) -> Rig:
    """Return the rig with its null command (V) and the range in which that lies, where the file asks to identify it.

    At commands above, chamber 1 (or the vessel) is filled, below it is vented: the null is where the gas that moves the
    other way is least, in the middle of what makes no difference (an overlap, or commands that were never given).
    Raises InputError where no recording shows both filling and venting.
    """
    if not rig.null_free:
        return rig
    driven = [r for r in recordings if r.kind.valve and not r.valve_shut]
    if not driven:
        return rig
    shown = _normalised_flows(driven, replace(rig, valve_null=0.0))
    whole = [np.concatenate(column) for column in zip(*shown.values(), strict=True)]
    found = _null_interval(whole[0], whole[1]) if whole else None
    if found is None:
        lacking = '"identify", but chamber 1 is never both filled and vented by commands that were recorded'
        raise InputError("[rig.valve] null", lacking, "both", "state the command at which nothing flows")
    alone = {name: span for name, (u, flow) in shown.items() if (span := _null_interval(u, flow)) is not None}
    return replace(rig, valve_null=0.5 * (found[0] + found[1]), null_range=found, null_ranges=alone)


def drifting_recordings(rig: Rig) -> tuple[str, str] | None:
    """Return two recordings of which the null commands can't be the same: that of the lowest and of the highest."""
    spans = rig.null_ranges
    if not spans:
        return None
    low, high = min(spans, key=lambda name: spans[name][1]), max(spans, key=lambda name: spans[name][0])
    apart = MIN_DRIFT * (max(top for _, top in spans.values()) - min(bottom for bottom, _ in spans.values()))
    return (low, high) if spans[low][1] + apart < spans[high][0] else None


def _null_interval(u: Array, flow: Array) -> tuple[float, float] | None:
    """Return the commands (V) between which the null lies; None where nothing is filled, or nothing vented."""
    order = np.argsort(u, kind="stable")
    u, flow = u[order], flow[order]
    grown, shrunk = np.maximum(flow, 0.0), np.maximum(-flow, 0.0)
    if u[0] == u[-1] or not grown.any() or not shrunk.any():
        return None
    tried = np.linspace(u[0], u[-1], GRID_COMMANDS)
    below = np.searchsorted(u, tried)
    wrong = np.append(0.0, np.cumsum(grown))[below] + np.sum(shrunk) - np.append(0.0, np.cumsum(shrunk))[below]
    best = tried[wrong <= wrong.min() + MAX_WRONG_WAY_FLOW * float(np.sum(grown) + np.sum(shrunk))]
    return float(best[0]), float(best[-1])


def _normalised_flows(recordings: Sequence[Recording], rig: Rig) -> dict[str, tuple[Array, Array]]:
    """Return commands in V and what flows into chamber 1, as large as it may be, at all samples, by recording."""
    ready = [prepare(r, rig, None) for r in recordings if {"u", "p1"} <= r.signals.keys()]
    shown = flow_path_data(ready, rig, 1, UNIT_VOLUME)
    # each recording counts alike
    return {
        one.experiment.recording.name: (one.opening, one.flow / max(float(np.max(np.abs(one.flow))), 1e-300))
        for one in shown
    }
