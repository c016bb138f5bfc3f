"""Where the piston's stroke ends: as the rig is described, or as the recordings show where it is not or not exactly.

A contact is one-sided: an end carries any force outward and none inward. A recording shows an end where the piston
withstands, at its outmost rests, a force outward that friction holds nowhere.
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

STROKE_TOLERANCE = 0.05  # of the stroke, by which a stated end may be off
POSITION_SCATTER_SIGMA = 6.0  # standard deviations of the position's noise, within which rests are at one place
END_COMPLIANCE = 2e-3  # of the piston's way: an end gives way by less, also while the piston rebounds
MIN_END_FORCE_RATIO = 2.0  # times what friction holds, to tell an end


def with_end_stops(experiments: Sequence[Experiment], rig: Rig) -> list[Experiment]:
    """Return the experiments of one rig, knowing where its piston can go and which ends it is seen to strike."""
    struck = detect_end_stops(experiments, rig)
    ends = estimate_stroke_limits(experiments, rig, struck)
    return [_with_ends(e, ends, struck) if e.recording.kind.cylinder else e for e in experiments]


def _with_ends(e: Experiment, ends: tuple[float, float], struck: tuple[float, float]) -> Experiment:
    """Return an experiment with the ends; without a position sensor nobody knows how far they are."""
    nowhere = (-np.inf, np.inf)
    located = "x" in e.raw or not e.motion_is_known
    return replace(e, stroke_limits=ends if located else nowhere, detected_ends=struck if located else nowhere)


def estimate_stroke_limits(
    experiments: Sequence[Experiment], rig: Rig, detected: tuple[float, float] | None = None
) -> tuple[float, float]:
    """Return the least and the largest x (m) that the piston can have: as it is seen, else as stated; else inf."""
    low, high = detect_end_stops(experiments, rig) if detected is None else detected
    seen = [e.inputs[:, at.IN_X] for e in _with_motion(experiments)]
    lowest = min((float(s.min()) for s in seen), default=0.0)
    highest = max((float(s.max()) for s in seen), default=0.0)
    stated = np.inf if rig.stroke is None else rig.stroke
    return min(low if np.isfinite(low) else 0.0, lowest), max(high if np.isfinite(high) else stated, highest)


def detect_end_stops(experiments: Sequence[Experiment], rig: Rig) -> tuple[float, float]:
    """Return the ends (m) that recordings show, infinite where they show none.

    Friction is what holds inward, or elsewhere. An end that is stated must be near what is seen; where the stroke is
    not stated, friction must have been seen as well.
    """
    moving = _with_motion(experiments)
    parts = [_standstill_forces(e) for e in moving]
    x, push = (np.concatenate([part[k] for part in parts] or [np.zeros(0)]) for k in (0, 1))
    if not x.size:
        return -np.inf, np.inf
    give = max(_contact_tolerance(e) for e in moving)
    low, high = x <= x.min() + give, x >= x.max() - give
    inward = np.where(low, np.maximum(push, 0.0), np.where(high, np.maximum(-push, 0.0), np.abs(push)))
    friction, stroke = float(inward.max()), rig.stroke
    near = max(STROKE_TOLERANCE * (stroke or 0.0), give)
    at_low = float(np.max(-push[low])) > MIN_END_FORCE_RATIO * friction and abs(float(x.min())) <= near
    known = friction > 0.0 if stroke is None else abs(float(x.max()) - stroke) <= near
    at_high = float(np.max(push[high])) > MIN_END_FORCE_RATIO * friction and known
    return float(x.min()) if at_low else -np.inf, float(x.max()) if at_high else np.inf


def contact_side(e: Experiment) -> Array:
    """Return -1, 0 or 1 by sample (n,): the side on which an end that was struck may carry the piston."""
    x, (low, high), give = e.inputs[:, at.IN_X], e.detected_ends, _contact_tolerance(e)
    return np.where(x >= high - give, 1.0, np.where(x <= low + give, -1.0, 0.0))


def in_end_contact(e: Experiment, x: Array, channel: str) -> NDArray[np.bool_]:
    """Return where an end, whose hardness no model states, decides on a channel of the motion (n,).

    That is where the recorded piston and one at ``x`` (n,) touch the same end; acceleration, wherever the recorded one
    touches it.
    """
    (low, high), give, side = e.detected_ends, _contact_tolerance(e), contact_side(e)
    if channel == "a":
        return np.asarray(side != 0.0)
    return np.asarray(((side > 0.0) & (x >= high - give)) | ((side < 0.0) & (x <= low + give)))


def _with_motion(experiments: Sequence[Experiment]) -> list[Experiment]:
    return [e for e in experiments if e.recording.kind.cylinder and "x" in e.raw]


def _contact_tolerance(e: Experiment) -> float:
    """Return how far from an end the piston may still touch it, in m: by noise, or as the end gives way."""
    return max(_position_noise_tolerance(e), END_COMPLIANCE * float(np.ptp(e.inputs[:, at.IN_X])))


def _position_noise_tolerance(e: Experiment) -> float:
    return POSITION_SCATTER_SIGMA * e.noise["x"].rms if "x" in e.noise else 0.0


def _standstill_forces(e: Experiment) -> tuple[Array, Array]:
    """Return position and net force of pressures and drive where the piston rests, each (k,)."""
    resting = e.inputs[:, at.IN_V] == 0.0
    push = e.net_pressure_force() + e.inputs[:, at.IN_FORCE]
    return e.inputs[resting, at.IN_X], push[resting]
