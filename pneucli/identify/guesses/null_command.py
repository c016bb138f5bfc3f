"""A valve's command, from the flow of a chamber: at which it is shut, and which acted between two samples."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.errors import InputError
from pneucli.identify.guesses.flow_paths import (
    PRESSURE_SIGNALS,
    Chamber,
    FlowPathData,
    flow_path_data,
    mass_flux,
    valve_driven,
)
from pneucli.recording import Recording, Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.preparation import prepare

MIN_LOOP_PERIOD = 1e-3  # s: loops of pneumatic axes are no faster; a logger at that rate records every command
MIN_CHANGING_RATIO = 0.5  # share of samples with a new command; below, the command is a sequence of held steps
AREA_NODES = 16  # of the area over the opening, at equal quantiles of the samples
JUMP_INSTANTS = np.linspace(0.0, 1.0, 21)  # of a sampling period


class SampleIntervals(NamedTuple):
    """One chamber of one recording between its samples: arrays (n - 1,), but ``opening`` (n,) at the samples.

    ``flow`` is the mean mass flow into the chamber in kg/s from the raw readings, since smoothing would blur the
    timing; ``supply`` and ``p`` in Pa; ``column`` is the command's column among the inputs.
    """

    experiment: Experiment
    column: int
    opening: Array
    flow: Array
    supply: Array
    p: Array


def with_common_command_range(experiments: Sequence[Experiment]) -> list[Experiment]:
    """Give all experiments the same range of commands, so that one table of the valve's area serves them all.

    Args:
        experiments: The experiments.

    Returns:
        The experiments with the largest range among them.

    """
    largest = max((experiment.flags[at.U_MAX] for experiment in experiments), default=0.0)
    is_u_max = np.arange(at.FLAGS) == at.U_MAX
    return [replace(experiment, flags=np.where(is_u_max, largest, experiment.flags)) for experiment in experiments]


def with_intersample_commands(experiments: Sequence[Experiment], rig: Rig) -> list[Experiment]:
    """Replace sampled commands by their mean over each interval where a faster loop changed them between the samples.

    A logged command is either held until the next sample, or, where a faster loop went on changing it, near the mean of
    this sample and the next: both differ by a shift of nearly half a sampling period. The shift that explains the flow
    between the samples best is estimated by a parabola through three variants: commands half a period late, held
    commands, and their means. The variant nearer to it is used. Any further delay is an effect of the model.

    Args:
        experiments: The experiments.
        rig: The rig with its volumes.

    Returns:
        The experiments; those with held commands are unchanged.

    """
    active = [
        experiment
        for experiment in valve_driven(experiments)
        if experiment.recording.period > 1.5 * MIN_LOOP_PERIOD and _is_changing(experiment.inputs[:, at.IN_U])
    ]
    has_volume = rig.vessel_volume is not None or not any(experiment.vessel for experiment in active)
    if not active or not has_volume:
        return list(experiments)
    intervals = _all_intervals(active, rig)
    if not _changes_between_samples(intervals):
        return list(experiments)
    return [
        _with_mean_commands(experiment, intervals) if any(experiment is one for one in active) else experiment
        for experiment in experiments
    ]


def _is_changing(u: Array) -> bool:
    return bool(np.mean(np.diff(u) != 0.0) > MIN_CHANGING_RATIO)


def _all_intervals(active: Sequence[Experiment], rig: Rig) -> list[SampleIntervals]:
    chambers: tuple[Chamber, ...] = (1, 2)
    return [
        _sample_intervals(path, c)
        for c in chambers
        for path in flow_path_data(active, rig, c, rig.vessel_volume or 1.0)
        if PRESSURE_SIGNALS[1 if path.experiment.vessel else c][0] in path.experiment.raw
    ]


def _sample_intervals(path: FlowPathData, chamber: Chamber) -> SampleIntervals:
    experiment = path.experiment
    name, column = PRESSURE_SIGNALS[1 if experiment.vessel else chamber]
    exponent, p = experiment.rig.polytropic_exponent or experiment.rig.heat_capacity_ratio, experiment.inputs[:, column]
    pressure_term, volume_term = (
        _midpoints(path.volume) * np.diff(experiment.raw[name]),
        exponent * _midpoints(p) * np.diff(path.volume),
    )
    flow = (pressure_term + volume_term) / (
        exponent * experiment.rig.gas_constant * experiment.rig.gas_temperature * np.diff(experiment.time)
    )
    has_own_command = chamber == 2 and not experiment.vessel and experiment.flags[at.CHAMBER_2] == at.VALVE_2
    supply = experiment.inputs[:, at.IN_SUPPLY]
    return SampleIntervals(
        experiment, at.IN_U2 if has_own_command else at.IN_U, path.opening, flow, _midpoints(supply), _midpoints(p)
    )


def _midpoints(values: Array) -> Array:
    """Return the mean of each value and the next, shape (n - 1,)."""
    return np.asarray(0.5 * (values[1:] + values[:-1]))


def _changes_between_samples(intervals: Sequence[SampleIntervals]) -> bool:
    """Return whether the best shift, in samples, is nearer to a fast loop's than to that of held commands."""
    late, held, mean = np.sum([_unexplained_shares(interval) for interval in intervals] or [np.zeros(3)], axis=0)
    curvature = late - 2.0 * held + mean
    loop_shift = (
        -0.5
        * MIN_LOOP_PERIOD
        / float(np.median([interval.experiment.recording.period for interval in intervals] or [MIN_LOOP_PERIOD]))
    )
    return bool(curvature > 0.0 and 0.25 * (late - mean) / curvature - 0.5 > 0.5 * (loop_shift - 0.5))


def _unexplained_shares(interval: SampleIntervals) -> Array:
    """Return the share of the flow's power that late, held and mean commands leave unexplained, shape (3,).

    A variant that is not finite counts as 0.
    """
    u, is_smooth = interval.opening, ~_jumps(interval.opening)
    variants = (_midpoints(np.append(u[0], u[:-1])), u[:-1], _midpoints(u))
    residual_power = [
        float(np.sum(_flow_residual(interval, _fitted_areas(interval, commands), commands)[is_smooth] ** 2))
        for commands in variants
    ]
    return np.nan_to_num(residual_power) / max(float(np.nansum(interval.flow[is_smooth] ** 2)), 1e-300)


def _jumps(u: Array) -> Mask:
    """Mask the intervals in which a command changes by more than in both neighbours together, shape (n - 1,).

    A jump happens at some instant between two samples and is no evidence on a loop that changes commands throughout.
    """
    change = np.abs(np.diff(u))
    return np.asarray(change > np.append(np.inf, change[:-1]) + np.append(change[1:], np.inf))


def _fitted_areas(interval: SampleIntervals, commands: Array) -> tuple[Array, Array]:
    """Return nodes of the opening (V) and the areas there (m^2) that explain the flow best with these commands.

    The area is linear between nodes; intervals with a jump are left out. NaN where a reading is not finite.
    """
    is_smooth, nodes = ~_jumps(interval.opening), np.unique(np.quantile(commands, np.linspace(0.0, 1.0, AREA_NODES)))
    basis = np.column_stack([np.interp(commands, nodes, unit) for unit in np.eye(nodes.size)])
    flux = mass_flux(interval.experiment.rig, commands, interval.supply, interval.p)
    design, flow = (basis * flux[:, None])[is_smooth], interval.flow[is_smooth]
    if not np.all(np.isfinite(design)) or not np.all(np.isfinite(flow)):
        return nodes, np.full(nodes.size, np.nan)
    return nodes, np.asarray(np.linalg.lstsq(design, flow)[0], dtype=np.float64)


def _flow_residual(interval: SampleIntervals, areas: tuple[Array, Array], opening: Array) -> Array:
    """Return the part of the flow that these areas leave unexplained, shape (n - 1,)."""
    flux = mass_flux(interval.experiment.rig, opening, interval.supply, interval.p)
    return np.asarray(interval.flow - np.interp(opening, *areas) * flux)


def _with_mean_commands(experiment: Experiment, intervals: Sequence[SampleIntervals]) -> Experiment:
    inputs = experiment.inputs.copy()
    for column in (at.IN_U, at.IN_U2):
        u, own = (
            inputs[:, column],
            [interval for interval in intervals if interval.experiment is experiment and interval.column == column],
        )
        inputs[:-1, column] = u[:-1] + _mean_command_fraction(u, own) * np.diff(u)
    return replace(experiment, inputs=inputs)


def _mean_command_fraction(u: Array, intervals: Sequence[SampleIntervals]) -> Array:
    """Return the position of the mean command between a sample's command and the next one's, shape (n - 1,): one half.

    Where the command jumped, the mean over all instants of the jump, weighted by their likelihood given the flow.
    """
    jumps, log_likelihood = _jumps(u), np.zeros((JUMP_INSTANTS.size, u.size - 1))
    for interval in intervals:
        commands = _midpoints(interval.opening)
        areas = _fitted_areas(interval, commands)
        steps = interval.opening[:-1] + JUMP_INSTANTS[:, None] * np.diff(interval.opening)
        residual_power = np.array([_flow_residual(interval, areas, step) for step in steps])
        variance = np.mean(_flow_residual(interval, areas, commands)[~jumps] ** 2)
        log_likelihood -= np.nan_to_num(0.5 * residual_power**2 / variance)
    weights = np.exp(log_likelihood - log_likelihood.max(axis=0))
    return np.where(jumps, JUMP_INSTANTS @ weights / weights.sum(axis=0), 0.5)


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
