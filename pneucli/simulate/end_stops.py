"""The ends of the stroke: as the rig states them, or as recordings show them.

A contact is one-sided: an end carries any force outward and none inward. A recording shows an end where the piston
rests at its extreme position under an outward force that friction holds nowhere else.
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

STROKE_TOLERANCE = 0.05  # of the stroke: error of a stated end
POSITION_SCATTER_SIGMA = (
    6.0  # standard deviations of the position's noise, within which standstills are at one position
)
END_COMPLIANCE = 2e-3  # of the range of x in all recordings: an end yields by less, also while the piston rebounds
MIN_END_FORCE_RATIO = 2.0  # times the force that friction holds


def with_end_stops(experiments: Sequence[Experiment], rig: Rig) -> list[Experiment]:
    """Return experiments of one rig with the limits of its stroke and the ends that they show.

    Args:
        experiments: Experiments.
        rig: The rig.

    Returns:
        The experiments in order.
    """
    detected = detect_end_stops(experiments, rig)
    limits, compliance = estimate_stroke_limits(experiments, rig, detected), _end_compliance(experiments)
    return [_with_ends(e, limits, detected, compliance) if e.recording.kind.cylinder else e for e in experiments]


def _with_ends(
    e: Experiment, limits: tuple[float, float], detected: tuple[float, float], compliance: float
) -> Experiment:
    """Return an experiment with its ends; without a position sensor their distance is unknown."""
    if "x" in e.raw or not e.motion_is_known:
        return replace(e, stroke_limits=limits, detected_ends=detected, end_compliance=compliance)
    return replace(e, stroke_limits=(-np.inf, np.inf), detected_ends=(-np.inf, np.inf))


def estimate_stroke_limits(
    experiments: Sequence[Experiment], rig: Rig, detected: tuple[float, float] | None = None
) -> tuple[float, float]:
    """Estimate the limits of the position.

    Args:
        experiments: Experiments.
        rig: The rig.
        detected: Ends that recordings show in m; None: detected here.

    Returns:
        Lowest and highest x in m: detected, else stated, else infinite; never inside the measured range.
    """
    low, high = detect_end_stops(experiments, rig) if detected is None else detected
    positions = [e.inputs[:, at.IN_X] for e in _with_motion(experiments)]
    lowest = min((float(x.min()) for x in positions), default=0.0)
    highest = max((float(x.max()) for x in positions), default=0.0)
    stated = np.inf if rig.stroke is None else rig.stroke
    return min(low if np.isfinite(low) else 0.0, lowest), max(high if np.isfinite(high) else stated, highest)


def detect_end_stops(experiments: Sequence[Experiment], rig: Rig) -> tuple[float, float]:
    """Detect ends of the stroke in recordings.

    Friction is the largest force held inward, or away from the extremes. A stated end must lie near the detected one;
    without a stated stroke, friction must have been measured as well.

    Args:
        experiments: Experiments.
        rig: The rig.

    Returns:
        Lower and upper end in m, infinite where recordings show none.
    """
    moving = _with_motion(experiments)
    parts = [_standstill_forces(e) for e in moving]
    x, push = (np.concatenate([part[k] for part in parts] or [np.zeros(0)]) for k in (0, 1))
    if not x.size:
        return -np.inf, np.inf
    tolerance = max(_end_compliance(moving), *map(_position_noise_tolerance, moving))
    low, high = x <= x.min() + tolerance, x >= x.max() - tolerance
    inward = np.where(low, np.maximum(push, 0.0), np.where(high, np.maximum(-push, 0.0), np.abs(push)))
    friction, stroke = float(inward.max()), rig.stroke
    stroke_tolerance = max(STROKE_TOLERANCE * (stroke or 0.0), tolerance)
    at_low = float(np.max(-push[low])) > MIN_END_FORCE_RATIO * friction and abs(float(x.min())) <= stroke_tolerance
    plausible = friction > 0.0 if stroke is None else abs(float(x.max()) - stroke) <= stroke_tolerance
    at_high = float(np.max(push[high])) > MIN_END_FORCE_RATIO * friction and plausible
    return float(x.min()) if at_low else -np.inf, float(x.max()) if at_high else np.inf


def contact_side(e: Experiment) -> Array:
    """Return the side on which an end may carry the piston.

    Args:
        e: The experiment.

    Returns:
        -1, 0 or 1 for each sample, shape (n,).
    """
    x, (low, high), tolerance = e.inputs[:, at.IN_X], e.detected_ends, _contact_tolerance(e)
    return np.where(x >= high - tolerance, 1.0, np.where(x <= low + tolerance, -1.0, 0.0))


def in_end_contact(e: Experiment, x: Array, channel: str) -> NDArray[np.bool_]:
    """Return where an end, whose stiffness no model states, determines a channel of the motion.

    Args:
        e: The experiment.
        x: Simulated position in m, shape (n,).
        channel: ``x``, ``v`` or ``a``.

    Returns:
        True where measured and simulated piston touch the same end; for the acceleration, where the measured one does.
    """
    (low, high), tolerance, side = e.detected_ends, _contact_tolerance(e), contact_side(e)
    if channel == "a":
        return np.asarray(side != 0.0)
    return np.asarray(((side > 0.0) & (x >= high - tolerance)) | ((side < 0.0) & (x <= low + tolerance)))


def _with_motion(experiments: Sequence[Experiment]) -> list[Experiment]:
    return [e for e in experiments if e.recording.kind.cylinder and "x" in e.raw]


def _contact_tolerance(e: Experiment) -> float:
    """Return the distance in m from an end within which the piston may touch it, by noise or compliance."""
    return max(_position_noise_tolerance(e), e.end_compliance)


def _end_compliance(experiments: Sequence[Experiment]) -> float:
    """Return the distance in m by which an end may yield; a recording at an end does not show the range of x."""
    positions = [e.inputs[:, at.IN_X] for e in _with_motion(experiments)]
    return END_COMPLIANCE * float(np.ptp(np.concatenate(positions))) if positions else 0.0


def _position_noise_tolerance(e: Experiment) -> float:
    return POSITION_SCATTER_SIGMA * e.noise["x"].rms if "x" in e.noise else 0.0


def _standstill_forces(e: Experiment) -> tuple[Array, Array]:
    """Return position in m and net force in N of pressures and drive at standstill, each (k,).

    A standstill that is shorter than what smoothing blurs is a reversal: the piston rebounds deep in its end, and the
    net force is that of its inertia.
    """
    resting = e.inputs[:, at.IN_V] == 0.0
    for first, last in np.flatnonzero(np.diff(resting, prepend=False, append=False)).reshape(-1, 2):
        if (last - first) * e.recording.period < e.smear_time:
            resting[first:last] = False
    push = e.net_pressure_force() + e.inputs[:, at.IN_FORCE]
    return e.inputs[resting, at.IN_X], push[resting]
