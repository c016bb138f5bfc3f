"""Where the piston's stroke ends: as the rig is described, or as the recordings show where it is not or not exactly.

A contact is one-sided: an end carries any force outward and none inward. Where the piston rests at the last position
that it ever rests at, the force outward therefore tells nothing of friction, whether an end is there or not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment

Array = NDArray[np.float64]

INEXACT = 0.05  # of the stroke, by which a stated end may be off
SCATTER = 6.0  # standard deviations of the position's noise, within which rests are at one place
GIVES = 2e-3  # of the way between the outmost rests: an end is stiffer than that, also while the piston rebounds
PUSHED = 2.0  # times what friction holds, to tell an end that nobody stated


def with_ends(experiments: Sequence[Experiment], rig: Rig) -> list[Experiment]:
    """Return the experiments of one rig, knowing where its piston can go and where it ever rests."""
    rests = [x for x, _ in map(_rests, _moving(experiments)) if x.size]
    outmost = (min(float(x.min()) for x in rests), max(float(x.max()) for x in rests)) if rests else (-np.inf, np.inf)
    ends = find_ends(experiments, rig)
    return [replace(e, ends=ends, outmost=outmost) if e.recording.kind.cylinder else e for e in experiments]


def _moving(experiments: Sequence[Experiment]) -> list[Experiment]:
    return [e for e in experiments if e.recording.kind.cylinder and "x" in e.raw]


def find_ends(experiments: Sequence[Experiment], rig: Rig) -> tuple[float, float]:
    """Return the least and the largest x (m) that the piston can have, inf where no end is known.

    A stated end is where the piston rests nearest to it, within ``INEXACT``; one that is not stated is where the piston
    rests outmost under forces that friction does not hold elsewhere.
    """
    moving = _moving(experiments)
    rests = [_rests(e) for e in moving]
    x = np.concatenate([r[0] for r in rests] or [np.zeros(0)])
    push = np.concatenate([r[1] for r in rests] or [np.zeros(0)])
    seen = [e.inputs[:, at.IN_X] for e in moving]
    lowest = min((float(s.min()) for s in seen), default=0.0)
    highest = max((float(s.max()) for s in seen), default=0.0)
    tolerance = max((_tolerance(e) for e in moving), default=0.0)
    stroke = rig.stroke
    low = _end(x, push, -1.0, 0.0, stroke or 0.0, tolerance)
    high = _end(x, push, 1.0, stroke, stroke or 0.0, tolerance)
    return min(low, lowest) if np.isfinite(low) else low, max(high, highest) if np.isfinite(high) else high


def contact(e: Experiment) -> Array:
    """Return -1, 0 or 1 by sample (n,): the side on which an end may carry the piston, at its outmost rests."""
    x, (low, high), give = e.inputs[:, at.IN_X], e.outmost, _give(e)
    return np.where(x >= high - give, 1.0, np.where(x <= low + give, -1.0, 0.0))


def at_ends(e: Experiment, x: Array, channel: str) -> NDArray[np.bool_]:
    """Return where an end, whose hardness no model states, decides on a channel of the motion (n,).

    That is where the recorded piston and one at ``x`` (n,) touch the same end; acceleration, wherever the recorded one
    strikes it.
    """
    (low, high), give, side = e.outmost, _give(e), contact(e)
    if channel == "a":
        return np.asarray(side != 0.0)
    return np.asarray(((side > 0.0) & (x >= high - give)) | ((side < 0.0) & (x <= low + give)))


def _give(e: Experiment) -> float:
    """Return how far from its outmost rest the piston may still touch an end: by noise, or as the end gives way."""
    return max(_tolerance(e), GIVES * (e.outmost[1] - e.outmost[0]) if np.isfinite(e.outmost[0]) else 0.0)


def _tolerance(e: Experiment) -> float:
    return SCATTER * e.noise["x"].rms


def _rests(e: Experiment) -> tuple[Array, Array]:
    """Return position and net force of pressures and drive where the piston rests, each (k,)."""
    resting = e.inputs[:, at.IN_V] == 0.0
    push = e.net_pressure_force() + e.inputs[:, at.IN_FORCE]
    return e.inputs[resting, at.IN_X], push[resting]


def _end(x: Array, push: Array, side: float, stated: float | None, stroke: float, tolerance: float) -> float:
    """Return one end: ``side`` -1 or 1 of positions and forces at rest, each (k,)."""
    unknown = side * np.inf if stated is None else stated
    if not x.size:
        return unknown
    outmost = side * float(np.max(side * x))
    if stated is not None:
        return outmost if abs(outmost - stated) <= max(INEXACT * stroke, tolerance) else stated
    low, high = x <= float(x.min()) + tolerance, x >= float(x.max()) - tolerance
    inward = np.where(low, np.maximum(push, 0.0), np.where(high, np.maximum(-push, 0.0), np.abs(push)))
    outward = side * push[high if side > 0.0 else low]
    friction = float(inward.max())
    return outmost if friction and float(outward.max()) > PUSHED * friction else unknown
