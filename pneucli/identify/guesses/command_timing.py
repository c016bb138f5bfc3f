"""Commands between two samples: where the loop is faster than the logger, only some of them were recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.guesses.chamber_balance import PRESSURES, Chamber
from pneucli.identify.guesses.flow_paths import Paths, driven, flow_per_area, paths
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment

Array = NDArray[np.float64]

LOOP = 1e-3  # s: loops of pneumatic axes are no faster, and a logger that is not slower shows every command
CHANGING = 0.5  # of the samples at which a command changes: below, it is a step that is held
NODES = 16  # of the area over the opening, at equal shares of the samples
INSTANTS = np.linspace(0.0, 1.0, 21)  # of a sampling period


class Between(NamedTuple):
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


def with_one_range(experiments: Sequence[Experiment]) -> list[Experiment]:
    """Return the experiments with one range of commands for all: one table of the valve's area then serves them all."""
    largest = max((e.flags[at.U_MAX] for e in experiments), default=0.0)
    place = np.arange(at.FLAGS) == at.U_MAX
    return [replace(e, flags=np.where(place, largest, e.flags)) for e in experiments]


def with_commands(experiments: Sequence[Experiment], rig: Rig) -> list[Experiment]:
    """Return the experiments with the commands that stood between the samples, as the flows into the chambers show it.

    A command is held to the next sample, or, where a faster loop went on changing it, near the mean of this sample's
    and the next one's: a shift of nearly half a sampling period lies between the two. The nearer one is taken to the
    shift that leaves least unexplained of what flows in from one sample to the next, by a parabola through commands
    that come half a period later, held ones and the mean. What is later still is an effect's.
    """
    moving = [e for e in driven(experiments) if e.recording.period > 1.5 * LOOP and _changes(e.inputs[:, at.IN_U])]
    known = rig.vessel_volume is not None or not any(e.vessel for e in moving)
    if not moving or not known:
        return list(experiments)
    shown = _shown(moving, rig)
    if not _on_the_way(shown):
        return list(experiments)
    return [_on_its_way(e, shown) if any(e is one for one in moving) else e for e in experiments]


def _changes(u: Array) -> bool:
    return bool(np.mean(np.diff(u) != 0.0) > CHANGING)


def _shown(moving: Sequence[Experiment], rig: Rig) -> list[Between]:
    chambers: tuple[Chamber, ...] = (1, 2)
    return [_between(one, c) for c in chambers for one in paths(moving, rig, c, rig.vessel_volume or 1.0)]


def _between(one: Paths, chamber: Chamber) -> Between:
    e = one.experiment
    name, column = PRESSURES[1 if e.vessel else chamber]
    exponent, p = e.rig.polytropic_exponent or e.rig.heat_capacity_ratio, e.inputs[:, column]
    rise, pushed = _means(one.volume) * np.diff(e.raw[name]), exponent * _means(p) * np.diff(one.volume)
    flow = (rise + pushed) / (exponent * e.rig.gas_constant * e.rig.gas_temperature * np.diff(e.time))
    own = chamber == 2 and not e.vessel and e.flags[at.CHAMBER_2] == at.VALVE_2
    supply = e.inputs[:, at.IN_SUPPLY]
    return Between(e, at.IN_U2 if own else at.IN_U, one.opening, flow, _means(supply), _means(p))


def _means(values: Array) -> Array:
    """Return the means of each value and the next (n - 1,)."""
    return np.asarray(0.5 * (values[1:] + values[:-1]))


def _on_the_way(shown: Sequence[Between]) -> bool:
    """Whether the shift (in samples) that explains the flows best is nearer to a loop's than to held commands."""
    later, held, middle = np.sum([_left(one) for one in shown] or [np.zeros(3)], axis=0)
    curvature = later - 2.0 * held + middle
    of_loop = -0.5 * LOOP / float(np.median([one.experiment.recording.period for one in shown] or [LOOP]))
    return bool(curvature > 0.0 and 0.25 * (later - middle) / curvature - 0.5 > 0.5 * (of_loop - 0.5))


def _left(one: Between) -> Array:
    """Return the share of the flow's power that is unexplained by commands half a sample later, held, their mean (3,).

    Nothing is left of what is not finite: it tells nothing of one way or another.
    """
    u, told = one.opening, ~_jumps(one.opening)
    ways = (_means(np.append(u[0], u[:-1])), u[:-1], _means(u))
    left = [float(np.sum(_unexplained(one, _areas(one, way), way)[told] ** 2)) for way in ways]
    return np.nan_to_num(left) / max(float(np.nansum(one.flow[told] ** 2)), 1e-300)


def _jumps(u: Array) -> NDArray[np.bool_]:
    """Return where a command changes by more than just before and just after together (n - 1,).

    At some instant between two samples: that says nothing of how it changes else.
    """
    change = np.abs(np.diff(u))
    return np.asarray(change > np.append(np.inf, change[:-1]) + np.append(change[1:], np.inf))


def _areas(one: Between, way: Array) -> tuple[Array, Array]:
    """Return nodes of the opening (V) and the areas there (m^2) that explain the flow best, were commands on this way.

    The area is linear between nodes; jumps have no say in it. NaN where a reading is beyond all numbers.
    """
    told, nodes = ~_jumps(one.opening), np.unique(np.quantile(way, np.linspace(0.0, 1.0, NODES)))
    hats = np.column_stack([np.interp(way, nodes, unit) for unit in np.eye(nodes.size)])
    per_area = flow_per_area(one.experiment.rig, way, one.supply, one.p)
    design, flow = (hats * per_area[:, None])[told], one.flow[told]
    if not np.all(np.isfinite(design)) or not np.all(np.isfinite(flow)):
        return nodes, np.full(nodes.size, np.nan)
    return nodes, np.asarray(np.linalg.lstsq(design, flow)[0], dtype=np.float64)


def _unexplained(one: Between, areas: tuple[Array, Array], opening: Array) -> Array:
    """Return what such areas leave of the flow (n - 1,) at openings."""
    per_area = flow_per_area(one.experiment.rig, opening, one.supply, one.p)
    return np.asarray(one.flow - np.interp(opening, *areas) * per_area)


def _on_its_way(e: Experiment, shown: Sequence[Between]) -> Experiment:
    inputs = e.inputs.copy()
    for column in (at.IN_U, at.IN_U2):
        u, mine = inputs[:, column], [one for one in shown if one.experiment is e and one.column == column]
        inputs[:-1, column] = u[:-1] + _share_of_the_way(u, mine) * np.diff(u)
    return replace(e, inputs=inputs)


def _share_of_the_way(u: Array, shown: Sequence[Between]) -> Array:
    """Return how far a command (n,) went on its way to the next one in the mean between both (n - 1,): half of it.

    Where it jumped, the mean over all instants at which it may have done so, as likely as the flows then make them.
    """
    jumps, chance = _jumps(u), np.zeros((INSTANTS.size, u.size - 1))
    for one in shown:
        way = _means(one.opening)
        areas = _areas(one, way)
        steps = one.opening[:-1] + INSTANTS[:, None] * np.diff(one.opening)
        left = np.array([_unexplained(one, areas, step) for step in steps])
        usual = np.mean(_unexplained(one, areas, way)[~jumps] ** 2)
        chance -= np.nan_to_num(0.5 * left**2 / usual)
    weights = np.exp(chance - chance.max(axis=0))
    return np.where(jumps, INSTANTS @ weights / weights.sum(axis=0), 0.5)
