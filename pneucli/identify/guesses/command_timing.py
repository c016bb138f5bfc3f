"""Commands between two samples: where the loop is faster than the logger, only some of them were recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.guesses.chamber_balance import PRESSURE_SIGNALS, Chamber
from pneucli.identify.guesses.flow_paths import FlowPathData, flow_path_data, mass_flux, valve_driven
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment

Array = NDArray[np.float64]

MIN_LOOP_PERIOD = 1e-3  # s: loops of pneumatic axes are no faster, and a logger that is not slower shows every command
MIN_CHANGING_RATIO = 0.5  # of the samples at which a command changes: below, it is a step that is held
AREA_NODES = 16  # of the area over the opening, at equal shares of the samples
JUMP_INSTANTS = np.linspace(0.0, 1.0, 21)  # of a sampling period


class SampleIntervals(NamedTuple):
    """What one recording shows of one chamber between its samples, each (n - 1,) but for the ``opening`` (n,) at them.

    ``flow`` is the mean mass flow in kg/s into the chamber by the readings themselves: smoothing would blur what is
    asked for; ``supply`` and ``p`` in Pa; ``column`` is that of the command among the inputs.
    """

    experiment: Experiment
    column: int
    opening: Array
    flow: Array
    supply: Array
    p: Array


def with_common_command_range(experiments: Sequence[Experiment]) -> list[Experiment]:
    """Return the experiments with one range of commands for all: one table of the valve's area then serves them all."""
    largest = max((e.flags[at.U_MAX] for e in experiments), default=0.0)
    place = np.arange(at.FLAGS) == at.U_MAX
    return [replace(e, flags=np.where(place, largest, e.flags)) for e in experiments]


def with_intersample_commands(experiments: Sequence[Experiment], rig: Rig) -> list[Experiment]:
    """Return the experiments with the commands that stood between the samples, as the flows into the chambers show it.

    A command is held to the next sample, or, where a faster loop went on changing it, near the mean of this sample's
    and the next one's: a shift of nearly half a sampling period lies between the two. The nearer one is taken to the
    shift that leaves least unexplained of what flows in from one sample to the next, by a parabola through commands
    that come half a period later, held ones and the mean. What is later still is an effect's.
    """
    moving = [
        e
        for e in valve_driven(experiments)
        if e.recording.period > 1.5 * MIN_LOOP_PERIOD and _is_changing(e.inputs[:, at.IN_U])
    ]
    known = rig.vessel_volume is not None or not any(e.vessel for e in moving)
    if not moving or not known:
        return list(experiments)
    shown = _all_intervals(moving, rig)
    if not _changes_between_samples(shown):
        return list(experiments)
    return [_with_mean_commands(e, shown) if any(e is one for one in moving) else e for e in experiments]


def _is_changing(u: Array) -> bool:
    return bool(np.mean(np.diff(u) != 0.0) > MIN_CHANGING_RATIO)


def _all_intervals(moving: Sequence[Experiment], rig: Rig) -> list[SampleIntervals]:
    chambers: tuple[Chamber, ...] = (1, 2)
    return [
        _sample_intervals(one, c) for c in chambers for one in flow_path_data(moving, rig, c, rig.vessel_volume or 1.0)
    ]


def _sample_intervals(one: FlowPathData, chamber: Chamber) -> SampleIntervals:
    e = one.experiment
    name, column = PRESSURE_SIGNALS[1 if e.vessel else chamber]
    exponent, p = e.rig.polytropic_exponent or e.rig.heat_capacity_ratio, e.inputs[:, column]
    rise, pushed = _midpoints(one.volume) * np.diff(e.raw[name]), exponent * _midpoints(p) * np.diff(one.volume)
    flow = (rise + pushed) / (exponent * e.rig.gas_constant * e.rig.gas_temperature * np.diff(e.time))
    own = chamber == 2 and not e.vessel and e.flags[at.CHAMBER_2] == at.VALVE_2
    supply = e.inputs[:, at.IN_SUPPLY]
    return SampleIntervals(e, at.IN_U2 if own else at.IN_U, one.opening, flow, _midpoints(supply), _midpoints(p))


def _midpoints(values: Array) -> Array:
    """Return the means of each value and the next (n - 1,)."""
    return np.asarray(0.5 * (values[1:] + values[:-1]))


def _changes_between_samples(shown: Sequence[SampleIntervals]) -> bool:
    """Whether the shift (in samples) that explains the flows best is nearer to a loop's than to held commands."""
    later, held, middle = np.sum([_unexplained_shares(one) for one in shown] or [np.zeros(3)], axis=0)
    curvature = later - 2.0 * held + middle
    of_loop = (
        -0.5
        * MIN_LOOP_PERIOD
        / float(np.median([one.experiment.recording.period for one in shown] or [MIN_LOOP_PERIOD]))
    )
    return bool(curvature > 0.0 and 0.25 * (later - middle) / curvature - 0.5 > 0.5 * (of_loop - 0.5))


def _unexplained_shares(one: SampleIntervals) -> Array:
    """Return the share of the flow's power that is unexplained by commands half a sample later, held, their mean (3,).

    Nothing is left of what is not finite: it tells nothing of one way or another.
    """
    u, told = one.opening, ~_jumps(one.opening)
    ways = (_midpoints(np.append(u[0], u[:-1])), u[:-1], _midpoints(u))
    left = [float(np.sum(_flow_residual(one, _fitted_areas(one, way), way)[told] ** 2)) for way in ways]
    return np.nan_to_num(left) / max(float(np.nansum(one.flow[told] ** 2)), 1e-300)


def _jumps(u: Array) -> NDArray[np.bool_]:
    """Return where a command changes by more than just before and just after together (n - 1,).

    At some instant between two samples: that says nothing of how it changes else.
    """
    change = np.abs(np.diff(u))
    return np.asarray(change > np.append(np.inf, change[:-1]) + np.append(change[1:], np.inf))


def _fitted_areas(one: SampleIntervals, way: Array) -> tuple[Array, Array]:
    """Return nodes of the opening (V) and the areas there (m^2) that explain the flow best, were commands on this way.

    The area is linear between nodes; jumps have no say in it. NaN where a reading is beyond all numbers.
    """
    told, nodes = ~_jumps(one.opening), np.unique(np.quantile(way, np.linspace(0.0, 1.0, AREA_NODES)))
    hats = np.column_stack([np.interp(way, nodes, unit) for unit in np.eye(nodes.size)])
    per_area = mass_flux(one.experiment.rig, way, one.supply, one.p)
    design, flow = (hats * per_area[:, None])[told], one.flow[told]
    if not np.all(np.isfinite(design)) or not np.all(np.isfinite(flow)):
        return nodes, np.full(nodes.size, np.nan)
    return nodes, np.asarray(np.linalg.lstsq(design, flow)[0], dtype=np.float64)


def _flow_residual(one: SampleIntervals, areas: tuple[Array, Array], opening: Array) -> Array:
    """Return what such areas leave of the flow (n - 1,) at openings."""
    per_area = mass_flux(one.experiment.rig, opening, one.supply, one.p)
    return np.asarray(one.flow - np.interp(opening, *areas) * per_area)


def _with_mean_commands(e: Experiment, shown: Sequence[SampleIntervals]) -> Experiment:
    inputs = e.inputs.copy()
    for column in (at.IN_U, at.IN_U2):
        u, mine = inputs[:, column], [one for one in shown if one.experiment is e and one.column == column]
        inputs[:-1, column] = u[:-1] + _mean_command_fraction(u, mine) * np.diff(u)
    return replace(e, inputs=inputs)


def _mean_command_fraction(u: Array, shown: Sequence[SampleIntervals]) -> Array:
    """Return how far a command (n,) went on its way to the next one in the mean between both (n - 1,): half of it.

    Where it jumped, the mean over all instants at which it may have done so, as likely as the flows then make them.
    """
    jumps, chance = _jumps(u), np.zeros((JUMP_INSTANTS.size, u.size - 1))
    for one in shown:
        way = _midpoints(one.opening)
        areas = _fitted_areas(one, way)
        steps = one.opening[:-1] + JUMP_INSTANTS[:, None] * np.diff(one.opening)
        left = np.array([_flow_residual(one, areas, step) for step in steps])
        usual = np.mean(_flow_residual(one, areas, way)[~jumps] ** 2)
        chance -= np.nan_to_num(0.5 * left**2 / usual)
    weights = np.exp(chance - chance.max(axis=0))
    return np.where(jumps, JUMP_INSTANTS @ weights / weights.sum(axis=0), 0.5)
