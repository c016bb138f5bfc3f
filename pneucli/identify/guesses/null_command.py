"""The null command of a valve, from the flow that fills and vents a chamber."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.identify.guesses.flow_paths import flow_path_data
from pneucli.recording import Recording, Rig
from pneucli.simulate.preparation import prepare

GRID_COMMANDS = 2000  # commands at which the wrong-way flow is evaluated
MIN_DRIFT = 0.01  # of the range of commands; a smaller distance is within the noise of the flow at the null
MAX_WRONG_WAY_FLOW = 0.002  # of all gas that moved: noise, or gas still in the hose
UNIT_VOLUME = 1.0  # m^3, of a vessel; the flow of each recording is normalised


def with_identified_null(recordings: Sequence[Recording], rig: Rig) -> Rig:
    """Identify the null command of the valve where the pipeline file asks for it.

    Commands above the null fill chamber 1 (or the vessel), commands below vent it. The null minimises the gas that
    moves the other way; it is the middle of the interval without such flow (an overlap, or a gap in the recorded
    commands).

    Args:
        recordings: The recordings.
        rig: The rig.

    Returns:
        The rig with ``valve_null`` and its interval in V, for all recordings and for each of them.

    Raises:
        InputError: No recording shows both filling and venting.

    """
    if not rig.null_free:
        return rig
    driven = [recording for recording in recordings if recording.kind.valve and not recording.valve_shut]
    if not driven:
        return rig
    flows = _normalised_flows(driven, replace(rig, valve_null=0.0))
    columns = [np.concatenate(column) for column in zip(*flows.values(), strict=True)]
    interval = _null_interval(columns[0], columns[1]) if columns else None
    if interval is None:
        fault = '"identify", but chamber 1 is never both filled and vented by commands that were recorded'
        raise InputError("[rig.valve] null", fault, "both", "state the command at which nothing flows", code="E065")
    spans = {name: span for name, (u, flow) in flows.items() if (span := _null_interval(u, flow)) is not None}
    return replace(rig, valve_null=0.5 * (interval[0] + interval[1]), null_range=interval, null_ranges=spans)


def drifting_recordings(rig: Rig) -> tuple[str, str] | None:
    """Find two recordings whose null commands cannot be equal.

    Args:
        rig: The rig with the null interval of each recording.

    Returns:
        The recordings with the lowest and the highest null; None where one null fits all.

    """
    spans = rig.null_ranges
    if not spans:
        return None
    low, high = min(spans, key=lambda name: spans[name][1]), max(spans, key=lambda name: spans[name][0])
    min_distance = MIN_DRIFT * (max(top for _, top in spans.values()) - min(bottom for bottom, _ in spans.values()))
    return (low, high) if spans[low][1] + min_distance < spans[high][0] else None


def _null_interval(u: Array, flow: Array) -> tuple[float, float] | None:
    """Return the interval of commands (V) that contains the null; None where nothing is filled, or nothing vented."""
    order = np.argsort(u, kind="stable")
    u, flow = u[order], flow[order]
    inflow, outflow = np.maximum(flow, 0.0), np.maximum(-flow, 0.0)
    if u[0] == u[-1] or not inflow.any() or not outflow.any():
        return None
    candidates = np.linspace(u[0], u[-1], GRID_COMMANDS)
    below = np.searchsorted(u, candidates)
    wrong_way = np.append(0.0, np.cumsum(inflow))[below] + np.sum(outflow) - np.append(0.0, np.cumsum(outflow))[below]
    least_wrong = candidates[
        wrong_way <= wrong_way.min() + MAX_WRONG_WAY_FLOW * float(np.sum(inflow) + np.sum(outflow))
    ]
    return float(least_wrong[0]), float(least_wrong[-1])


def _normalised_flows(recordings: Sequence[Recording], rig: Rig) -> dict[str, tuple[Array, Array]]:
    """Return commands (V) and the normalised flow into chamber 1 at all samples, by recording."""
    experiments = [
        prepare(recording, rig, None)
        for recording in recordings
        if "u" in recording and ("p1" in recording or recording.kind.axis)
    ]
    flows = flow_path_data(experiments, rig, 1, UNIT_VOLUME)
    # each recording counts alike
    return {
        path.experiment.recording.name: (path.opening, path.flow / max(float(np.max(np.abs(path.flow))), 1e-300))
        for path in flows
    }
