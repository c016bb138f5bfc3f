"""Commands between two samples: a logger slower than the control loop records only some of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.identify.guesses.chamber_balance import PRESSURE_SIGNALS, Chamber
from pneucli.identify.guesses.flow_paths import FlowPathData, flow_path_data, mass_flux, valve_driven
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment

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
