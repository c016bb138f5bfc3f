"""Commands between two samples: where the loop is faster than the logger, only some of them were recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.paths import PRESSURES, Chamber, Paths, driven, flow_per_area, paths
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment

Array = NDArray[np.float64]

LOOP = 1e-3  # s: loops of pneumatic axes are no faster, and a logger that is not slower shows every command
CHANGING = 0.5  # of the samples at which a command changes: below, it is a step that is held
NODES = 16  # of the area over the opening, at equal shares of the samples


def with_commands(experiments: Sequence[Experiment], rig: Rig) -> list[Experiment]:
    """Return the experiments with the commands that stood between the samples, as the flows into the chambers show it.

    A command is held to the next sample, or, where a faster loop went on changing it, near the mean of this sample's
    and the next one's: a shift of nearly half a sampling period lies between the two. The nearer one is taken to the
    shift that leaves least unexplained of what flows in from one sample to the next, by a parabola through commands
    that come half a period later, held ones and the mean. What is later still is an effect's.
    """
    moving = [e for e in driven(experiments) if e.recording.period > 1.5 * LOOP and _changes(e.inputs[:, at.IN_U])]
    known = rig.vessel_volume is not None or not any(e.vessel for e in moving)
    if not moving or not known or not _on_the_way(moving, rig):
        return list(experiments)
    return [_averaged(e) if any(e is one for one in moving) else e for e in experiments]


def _changes(u: Array) -> bool:
    return bool(np.mean(np.diff(u) != 0.0) > CHANGING)


def _on_the_way(moving: Sequence[Experiment], rig: Rig) -> bool:
    """Whether the shift (in samples) that explains the flows best is nearer to a loop's than to held commands."""
    chambers: tuple[Chamber, ...] = (1, 2)
    seen = [(one, c) for c in chambers for one in paths(moving, rig, c, rig.vessel_volume or 1.0)]
    later, held, middle = np.sum([_left(one, c) for one, c in seen] or [np.zeros(3)], axis=0)
    curvature = later - 2.0 * held + middle
    of_loop = -0.5 * LOOP / float(np.median([e.recording.period for e in moving]))
    return bool(curvature > 0.0 and 0.25 * (later - middle) / curvature - 0.5 > 0.5 * (of_loop - 0.5))


def _left(one: Paths, chamber: Chamber) -> Array:
    """Return the share of the flow's power that is unexplained by commands half a sample later, held, their mean (3,).

    Flows are those of the readings themselves from one sample to the next: smoothing would blur what is asked for.
    """
    e, u, flow = one.experiment, one.opening, _entering(one, chamber)
    supply, p = (_means(e.inputs[:, c]) for c in (at.IN_SUPPLY, PRESSURES[1 if e.vessel else chamber][1]))
    ways, told = (_means(np.append(u[0], u[:-1])), u[:-1], _means(u)), ~_jumps(u)
    per_area = [flow_per_area(e.rig, way, supply, p) for way in ways]
    left = [_unexplained(flow[told], f[told], way[told]) for f, way in zip(per_area, ways, strict=True)]
    return np.array(left) / max(float(np.sum(flow[told] ** 2)), 1e-300)


def _jumps(u: Array) -> NDArray[np.bool_]:
    """Return where a command changes by more than just before and just after together (n - 1,).

    At some instant between two samples: that says nothing of how it changes else.
    """
    change = np.abs(np.diff(u))
    return np.asarray(change > np.append(0.0, change[:-1]) + np.append(change[1:], 0.0))


def _entering(one: Paths, chamber: Chamber) -> Array:
    """Return the mean mass flow in kg/s into the chamber between two samples (n - 1,), by the base model's balance."""
    e = one.experiment
    name, column = PRESSURES[1 if e.vessel else chamber]
    exponent, p = e.rig.polytropic_exponent or e.rig.heat_capacity_ratio, e.inputs[:, column]
    rise, pushed = _means(one.volume) * np.diff(e.raw[name]), exponent * _means(p) * np.diff(one.volume)
    return np.asarray((rise + pushed) / (exponent * e.rig.gas_constant * e.rig.gas_temperature * np.diff(e.time)))


def _means(values: Array) -> Array:
    """Return the means of each value and the next (n - 1,)."""
    return np.asarray(0.5 * (values[1:] + values[:-1]))


def _unexplained(flow: Array, per_area: Array, opening: Array) -> float:
    """Return the sum of squares of the flow that no area over the opening explains, the area linear between nodes."""
    nodes = np.unique(np.quantile(opening, np.linspace(0.0, 1.0, NODES)))
    if nodes.size < 2 or not np.all(np.isfinite(flow * per_area)):
        return 0.0  # nothing tells one way from another
    hats = np.column_stack([np.interp(opening, nodes, unit) for unit in np.eye(nodes.size)])
    design = hats * per_area[:, None]
    return float(np.sum((flow - design @ np.linalg.lstsq(design, flow)[0]) ** 2))


def _averaged(e: Experiment) -> Experiment:
    inputs = e.inputs.copy()
    for column in (at.IN_U, at.IN_U2):
        u = inputs[:, column]
        inputs[:, column] = 0.5 * (u + np.append(u[1:], u[-1]))
    return replace(e, inputs=inputs)
