"""Commands between two samples: where the loop is faster than the logger, only some of them were recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.paths import Paths, driven, paths
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
    shift that leaves least of the flows unexplained, by a parabola through commands that come half a period late, in
    time and early. What is later still is an effect's.
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
    seen = [one for chamber in (1, 2) for one in paths(moving, rig, chamber, rig.vessel_volume or 1.0)]
    late, middle, early = np.sum([_left(one) for one in seen] or [np.zeros(3)], axis=0)
    curvature = late - 2.0 * middle + early
    of_loop = -0.5 * LOOP / float(np.median([e.recording.period for e in moving]))
    return bool(curvature > 0.0 and 0.25 * (late - early) / curvature > 0.5 * (of_loop - 0.5))


def _left(one: Paths) -> Array:
    """Return the share of the flow's power that is unexplained with commands half a sample late, right, early (3,)."""
    u = one.opening
    before, after = np.append(u[0], u[:-1]), np.append(u[1:], u[-1])
    ways = (0.5 * (before + u), 0.25 * (before + 2.0 * u + after), 0.5 * (u + after))
    return np.array([_unexplained(one, mean) for mean in ways]) / max(float(np.sum(one.flow**2)), 1e-300)


def _unexplained(one: Paths, opening: Array) -> float:
    """Return the sum of squares of the flow that no area over the opening explains, the area linear between nodes."""
    nodes = np.unique(np.quantile(opening, np.linspace(0.0, 1.0, NODES)))
    if nodes.size < 2 or not np.all(np.isfinite(one.flow * one.per_area)):
        return 0.0  # nothing tells one way from another
    hats = np.column_stack([np.interp(opening, nodes, unit) for unit in np.eye(nodes.size)])
    design = hats * one.per_area[:, None]
    return float(np.sum((one.flow - design @ np.linalg.lstsq(design, one.flow)[0]) ** 2))


def _averaged(e: Experiment) -> Experiment:
    inputs = e.inputs.copy()
    for column in (at.IN_U, at.IN_U2):
        u = inputs[:, column]
        inputs[:, column] = 0.5 * (u + np.append(u[1:], u[-1]))
    return replace(e, inputs=inputs)
