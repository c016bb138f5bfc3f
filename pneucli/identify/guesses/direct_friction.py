"""Friction straight from the balance of forces, without a simulation: where fits and searches start."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.physics.vectorised import stribeck_friction
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment, imposed_motion

VELOCITY_GRID_POINTS = 24
MIN_MOVING_SAMPLES = 100
MIN_SLIDE_SMEARS = 4  # times what smears a stop
MAX_SAMPLES = 5000  # of one recording: more do not move a start
BRANCH_SIGMA = 4.0  # standard deviations of the accelerometer, within which the piston neither speeds up nor slows
MIN_DIRECTION_SHARE = 0.1  # of the moving samples, in either direction: else a constant force passes for friction
TINY = 1e-9  # N


@dataclass(frozen=True)
class ForceSamples:
    """Moving samples of one recording, each of shape (n,): velocity (m/s), friction (N), branch.

    ``branch`` is 1 where the piston speeds up for certain, -1 where it slows, 0 where that is open.
    """

    v: Array
    friction: Array
    branch: Array

    def select(self, mask: Mask) -> ForceSamples:
        """Return the samples that ``mask`` (n,) keeps."""
        return ForceSamples(self.v[mask], self.friction[mask], self.branch[mask])


def has_both_directions(v: Array) -> bool:
    """Return whether moving samples can distinguish a constant force from dry friction: each direction has its share.

    Args:
        v: Velocity in m/s, shape (n,).

    >>> has_both_directions(np.array([0.1, -0.1, 0.1])), has_both_directions(np.array([0.1, 0.1]))
    (True, False)
    """
    return v.size > 0 and bool(MIN_DIRECTION_SHARE <= np.mean(v > 0.0) <= 1.0 - MIN_DIRECTION_SHARE)


def force_samples(experiments: Sequence[Experiment], mass: float) -> ForceSamples:
    """Return the moving samples of all experiments: driving force less inertia.

    Args:
        experiments: The experiments with a piston.
        mass: Moving mass of the rig in kg.

    References:
        Thesis (6.1) to (6.7): the friction force is the driving force less ``m a``.
    """
    parts = [_force_samples(e, mass) for e in experiments]
    none = [ForceSamples(np.zeros(0), np.zeros(0), np.zeros(0))]
    columns = zip(*((s.v, s.friction, s.branch) for s in [*none, *parts]), strict=True)
    return ForceSamples(*(np.concatenate(column) for column in columns))


def _force_samples(e: Experiment, mass: float) -> ForceSamples:
    v, a, (area_1, area_2) = e.inputs[:, at.IN_V], imposed_motion(e)[2], e.rig.piston_areas
    # with an accelerometer the forces are not smoothed: they would lag behind its jumps
    read = e.raw if "a" in e.raw else {}
    p1, p2, force = (read.get(name, e.inputs[:, at.INPUTS.index(name)]) for name in ("p1", "p2", "force"))
    drive = area_1 * (p1 - e.rig.ambient_pressure) - area_2 * (p2 - e.rig.ambient_pressure) + force
    moving = np.flatnonzero(_slides(v, max(round(e.smear_time / e.recording.period), 1)) & e.is_free)
    chosen = moving[:: max(1, moving.size // MAX_SAMPLES)]
    along = np.sign(v) * a
    noise = e.noise["a"].rms if "a" in e.noise else 0.0
    branch = np.where(np.abs(along) > BRANCH_SIGMA * noise, np.sign(along), 0.0)
    friction = drive - (mass + e.recording.added_mass) * a
    return ForceSamples(v[chosen], friction[chosen], branch[chosen])


def _slides(v: Array, smeared: int) -> Mask:
    """Return where the piston slides in one direction for long, shape (n,), but for what smears its stop.

    Shorter motion may be an artefact of smoothing next to a stop.
    """
    edges = np.flatnonzero(np.diff(np.sign(v), prepend=0.0, append=0.0))
    found = np.zeros(v.size, dtype=bool)
    for first, last in itertools.pairwise(edges):
        if v[first] != 0.0 and last - first >= MIN_SLIDE_SMEARS * smeared:
            found[first : last - smeared] = True
    return found


def search_stribeck(v: Array, friction: Array, sigma: Array | float, *, offset: bool) -> Array | None:
    """Return Coulomb, viscous, static friction, Stribeck velocity and, where asked for, a constant force.

    Searches a grid of Stribeck velocities; the rest follows by linear least squares.

    Args:
        v: Velocity in m/s, shape (n,).
        friction: Friction force in N, shape (n,).
        sigma: Standard deviation of the friction force in N.
        offset: Whether to fit a constant force in addition to friction.

    Returns:
        Shape (4,) or (5,); None where friction does not fall with speed.

    References:
        Thesis (3.6).

    """
    speed, weight = np.abs(v), 1.0 / np.broadcast_to(np.asarray(sigma), v.shape)
    best: tuple[float, Array | None] = (np.inf, None)
    for velocity in np.geomspace(max(speed.min(), 1e-3 * speed.max()), 0.5 * speed.max(), VELOCITY_GRID_POINTS):
        shapes = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
        laws = [stribeck_friction(v, *shape, float(velocity)) for shape in shapes]
        design = np.column_stack([*laws, *[np.ones(v.size)] * offset]) * weight[:, None]
        found = np.linalg.lstsq(design, friction * weight)[0]
        cost = float(np.sum((design @ found - friction * weight) ** 2))
        if cost < best[0] and found[2] > found[0] > 0.0:
            best = (cost, np.array([*found[:3], velocity, *found[3:]]))
    return best[1]


def direct_friction(samples: ForceSamples, *, two_branches: bool) -> list[dict[str, float]]:
    """Return starting values of friction, each a set by the names that parameters declare as ``direct``.

    Args:
        samples: Moving samples of all recordings.
        two_branches: Whether friction while slowing is fitted by itself (thesis 6.21). Else one start is from the
            samples in which the piston speeds up, where sampling smears no stop, and one from all of them.

    Returns:
        ``coulomb`` (N) and ``viscous`` (N s/m); ``static`` (N) and ``velocity`` (m/s) where friction falls with
        speed; with two branches ``drop`` (1).

    """
    if samples.v.size < MIN_MOVING_SAMPLES:
        return []
    both, rising, slowing = has_both_directions(samples.v), samples.branch > 0.0, samples.branch < 0.0
    chosen = [rising] if two_branches else [rising, np.ones(samples.v.size, dtype=bool)]
    kept = [samples.select(mask) for mask in chosen if np.count_nonzero(mask) >= MIN_MOVING_SAMPLES]
    found = [_values(s, offset=both) for s in kept]
    if two_branches and np.count_nonzero(slowing) >= MIN_MOVING_SAMPLES:
        level = _coulomb_and_viscous(samples.select(slowing), offset=both)[0]
        found = [one | {"drop": 1.0 - level / max(one["coulomb"], TINY)} for one in found]
    return found


def _values(s: ForceSamples, *, offset: bool) -> dict[str, float]:
    curved = search_stribeck(s.v, s.friction, 1.0, offset=offset)
    if curved is None:
        return dict(zip(("coulomb", "viscous"), _coulomb_and_viscous(s, offset=offset), strict=True))
    coulomb, viscous, static, velocity = (float(value) for value in curved[:4])
    return {"coulomb": coulomb, "viscous": max(viscous, 0.0), "static": static, "velocity": velocity}


def _coulomb_and_viscous(s: ForceSamples, *, offset: bool) -> tuple[float, float]:
    design = np.column_stack([np.sign(s.v), s.v, *[np.ones(s.v.size)] * offset])
    found = np.linalg.lstsq(design, s.friction)[0]
    return max(float(found[0]), 0.0), max(float(found[1]), 0.0)
