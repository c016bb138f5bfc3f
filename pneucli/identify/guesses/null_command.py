"""The null command of a valve, from the flow that fills and vents a chamber."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.identify.guesses.flow_paths import FlowPathData, flow_path_data, mass_flux
from pneucli.recording import Recording, Rig
from pneucli.simulate import layout as at
from pneucli.simulate.preparation import prepare

GRID_COMMANDS = 2000  # commands at which the wrong-way flow is evaluated
MIN_DRIFT = 0.01  # of the range of commands; a smaller distance is within the noise of the flow at the null
MAX_WRONG_WAY_FLOW = 0.002  # of all gas that moved: noise, or gas still in the hose
UNIT_VOLUME = 1.0  # m^3, of a vessel; the flow of each recording is normalised
REACH = 0.3  # of the largest command: where paths open nearly linearly, and most overlaps end
EDGES = 32  # commands in that range at which a path may begin to open
BLOCKS = 40  # of all samples: what a leak explains must be seen in many of them
MAX_SAMPLES = 100_000  # of all recordings: more do not tell a leak better
MIN_WIDENING = 1.5  # times the interval without a leak: less is within what a wrong flow does to its ends
MIN_EVIDENCE = 3.0  # standard errors of the gain: by the means of blocks, as their squares have long tails


class _Flows(NamedTuple):
    """Commands in V, the flow into chamber 1, and that of an area of 1 m^2 which vents or fills it, or leads to it from
    chamber 2, each (n,).

    Flows are in a unit of each recording, so that each counts alike.
    """

    u: Array
    flow: Array
    venting: Array
    filling: Array
    across: Array

    @classmethod
    def of(cls, path: FlowPathData, rig: Rig) -> _Flows:
        inputs, unit = path.experiment.inputs, max(float(np.max(np.abs(path.flow))), 1e-300)
        opens, p = np.ones(path.flow.size), inputs[:, at.IN_P1]
        venting, filling = (mass_flux(rig, sign * opens, inputs[:, at.IN_SUPPLY], p) for sign in (-1.0, 1.0))
        p2 = inputs[:, at.IN_P2] if "p2" in path.experiment.raw and not path.experiment.vessel else p
        across = mass_flux(rig, opens, p2, p)  # as a supply that may be the lower one
        return cls(path.opening, *(flow / unit for flow in (path.flow, venting, filling, across)))

    @classmethod
    def joint(cls, some: Sequence[_Flows]) -> _Flows:
        return cls(*(np.concatenate(column) for column in zip(*some, strict=True)))


def with_identified_null(recordings: Sequence[Recording], rig: Rig) -> Rig:
    """Identify the null command of the valve where the pipeline file asks for it.

    Commands above the null fill chamber 1 (or the vessel), commands below vent it. The null minimises the gas that
    moves the other way; it is the middle of the interval without such flow (an overlap, or a gap in the recorded
    commands). Gas that leaks from the chamber, or into it, at every command does not count: a controller that holds
    against it stands where the valve opens, not at its null.

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
    flows = _flows_of(driven, replace(rig, valve_null=0.0))
    all_flows = _Flows.joint(list(flows.values())) if flows else None
    interval = None if all_flows is None else _null_interval(all_flows)
    if all_flows is None or interval is None:
        fault = '"identify", but chamber 1 is never both filled and vented by commands that were recorded'
        raise InputError("[rig.valve] null", fault, "both", "state the command at which nothing flows", code="E065")
    beside_leak = _shut_beside_leak(all_flows, interval)
    spans = {name: span for name, own in flows.items() if (span := _null_interval(own)) is not None}
    if beside_leak is not None:
        interval, spans = beside_leak, {}
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


def _shut_beside_leak(flows: _Flows, interval: tuple[float, float]) -> tuple[float, float] | None:
    """Return the commands (V) between which the valve is shut beside a leak; None where there is no sign of a leak.

    Around the ``interval`` (V) without flow the flow is that of two paths, each of which opens linearly from a command
    on, and of a leak to the surroundings, from the supply or past the piston, which takes no notice of the command.
    Where that leaves a much wider range than without a leak, the interval is not where the valve is shut.
    """
    centre = 0.5 * (interval[0] + interval[1])
    reach = REACH * float(np.max(np.abs(flows.u - centre)))
    near = np.flatnonzero((np.abs(flows.u - centre) <= reach) & np.isfinite(np.sum(flows, axis=0)))
    if near.size < BLOCKS:
        return None
    u, flow, venting, filling, across = (column[near[:: -(-near.size // MAX_SAMPLES)]] for column in flows)
    edges = np.linspace(float(u.min()), float(u.max()), EDGES)
    vents = np.maximum(edges - u[:, None], 0.0) * venting[:, None]
    fills = np.maximum(u[:, None] - edges, 0.0) * filling[:, None]
    columns = np.column_stack([vents, fills, venting, filling, across, flow])
    blocks = [part.T @ part for part in np.array_split(columns, BLOCKS)]
    gram = np.sum(blocks, axis=0)
    plain, leaky = (
        min(
            (_Shut.of(gram, i, j, leak) for i in range(EDGES) for j in range(i, EDGES) for leak in leaks),
            key=attrgetter("left"),
        )
        for leaks in ([()], [(2 * EDGES + leak,) for leak in range(3)])
    )
    shut = float(edges[leaky.vent]), float(edges[leaky.fill])
    if not np.isfinite(leaky.left) or shut[1] - shut[0] < MIN_WIDENING * (interval[1] - interval[0]):
        return None
    gains = np.array([plain.left_of(block) - leaky.left_of(block) for block in blocks])
    if np.mean(gains) < MIN_EVIDENCE * np.std(gains) / math.sqrt(BLOCKS):
        return None
    return shut


class _Shut(NamedTuple):
    """A valve that vents below one edge and fills above another one, with a leak or without: sizes of its columns.

    ``left`` is the sum of squares of the flow that it leaves; infinite where a size is negative.
    """

    vent: int
    fill: int
    columns: tuple[int, ...]
    sizes: Array
    left: float

    @classmethod
    def of(cls, gram: Array, vent: int, fill: int, leak: tuple[int, ...]) -> _Shut:
        columns = (vent, EDGES + fill, *leak)
        sizes = np.asarray(
            np.linalg.lstsq(gram[np.ix_(columns, columns)], gram[columns, -1], rcond=None)[0], np.float64
        )
        left = float(gram[-1, -1] - gram[columns, -1] @ sizes) if (sizes >= 0.0).all() else np.inf
        return cls(vent, fill, columns, sizes, left)

    def left_of(self, gram: Array) -> float:
        weights = np.append(self.sizes, -1.0)
        places = (*self.columns, len(gram) - 1)
        return float(weights @ gram[np.ix_(places, places)] @ weights)


def _null_interval(flows: _Flows) -> tuple[float, float] | None:
    """Return the interval of commands (V) that contains the null; None where nothing is filled, or nothing vented."""
    order = np.argsort(flows.u, kind="stable")
    u, flow = flows.u[order], flows.flow[order]
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


def _flows_of(recordings: Sequence[Recording], rig: Rig) -> dict[str, _Flows]:
    """Return commands and flows of chamber 1 by recording."""
    experiments = [
        prepare(recording, rig, None)
        for recording in recordings
        if "u" in recording and ("p1" in recording or recording.kind.axis)
    ]
    paths = flow_path_data(experiments, rig, 1, UNIT_VOLUME)
    return {path.experiment.recording.name: _Flows.of(path, rig) for path in paths}
