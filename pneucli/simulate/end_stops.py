"""The ends of the stroke in experiments: where the model stops, and where an end may carry the measured piston."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.end_detection import Drive, detect_ends, end_compliance, stroke_limits
from pneucli.simulate.experiment import Experiment


def with_end_stops(experiments: Sequence[Experiment], rig: Rig) -> list[Experiment]:
    """Return experiments of one rig with the limits of its stroke and the ends that they show.

    Args:
        experiments: Experiments.
        rig: The rig.

    Returns:
        The experiments in order.
    """
    drives = [_drive(e) for e in experiments if e.recording.kind.cylinder and "x" in e.raw]
    detected = detect_ends(drives, rig.stroke)
    limits, compliance = stroke_limits(drives, rig.stroke, detected), end_compliance(drives)
    return [_with_ends(e, limits, detected, compliance) if e.recording.kind.cylinder else e for e in experiments]


def _with_ends(
    e: Experiment, limits: tuple[float, float], detected: tuple[float, float], compliance: float
) -> Experiment:
    """Return an experiment with its ends; without a position sensor their distance is unknown."""
    if "x" in e.raw or not e.motion_is_known:
        return replace(e, stroke_limits=limits, detected_ends=detected, end_compliance=compliance)
    return replace(e, stroke_limits=(-np.inf, np.inf), detected_ends=(-np.inf, np.inf))


def _drive(e: Experiment) -> Drive:
    """Return the drive of an experiment, with the pressure in place of one without a sensor; NaN without any."""
    v, (area_1, area_2), ambient = e.inputs[:, at.IN_V], e.rig.piston_areas, e.rig.ambient_pressure
    pressures = area_1 * (e.inputs[:, at.IN_P1] - ambient) - area_2 * (e.inputs[:, at.IN_P2] - ambient)
    return Drive(
        x=e.inputs[:, at.IN_X],
        v=v,
        a=np.gradient(v, e.time),
        force=np.full(v.size, np.nan) if e.lacks_pressures else pressures + e.inputs[:, at.IN_FORCE],
        blurred=max(round(e.smear_time / e.recording.period), 1),
        scatter=e.position_scatter,
    )


def in_end_contact(e: Experiment, x: Array, channel: str) -> NDArray[np.bool_]:
    """Return where an end, whose stiffness no model states, determines a channel of the motion.

    Args:
        e: The experiment.
        x: Simulated position in m, shape (n,).
        channel: ``x``, ``v`` or ``a``.

    Returns:
        True where measured and simulated piston touch the same end; for the acceleration, where the measured one does.
    """
    (low, high), tolerance, side = e.detected_ends, e.contact_tolerance, e.contact_side
    if channel == "a":
        return ~e.is_free
    return np.asarray(((side > 0.0) & (x >= high - tolerance)) | ((side < 0.0) & (x <= low + tolerance)))
