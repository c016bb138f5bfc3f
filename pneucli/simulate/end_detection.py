"""The ends of the stroke: as the rig states them, or as recordings show them.

An end carries any force outward and none inward. A recording shows one where the piston rests at an extreme of its
motion, pressed outward by more than friction holds anywhere else. What presses it there is the drive in excess of the
load, and the load is what the drive balances in motion: a preloaded spring that no model states holds a piston on its
end against the pressures.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from pneucli.arrays import Array, Mask

POSITION_SCATTER_SIGMA = 6.0  # standard deviations of the position's noise, within which it is one position
STROKE_TOLERANCE = 0.05  # of the stroke: error of a stated end
END_COMPLIANCE = 2e-3  # of the range of x in all recordings: an end yields by less, also while the piston rebounds
MIN_END_FORCE_RATIO = 2.0  # times the force that friction holds, at an end that nobody states
MIN_MOVING_SAMPLES = 100  # of all recordings, for the load
MIN_DIRECTION_SHARE = 0.1  # of the moving samples, in either direction: else a load passes for dry friction


@dataclass(frozen=True)
class Drive:
    """What drives the piston of one recording, arrays of shape (n,).

    ``x`` in m, ``v`` in m/s (0 at rest), ``a`` in m/s^2; ``force`` in N is that of pressures and drive toward +x,
    NaN where it is unknown.
    Smoothing blurs a stop by ``blurred`` samples; noise scatters the readings of one position within ``scatter`` (m).
    """

    x: Array
    v: Array
    a: Array
    force: Array
    blurred: int
    scatter: float

    @cached_property
    def resting(self) -> Mask:
        """Samples of certain rest.

        A standstill that is shorter than what smoothing blurs is a reversal: the piston rebounds deep in its end, and
        the net force is that of its inertia.
        """
        return np.asarray(self._long_stretches(margin=0) & (self.v == 0.0))

    @cached_property
    def sliding(self) -> Mask:
        """Samples of certain motion."""
        return np.asarray(self._long_stretches(margin=self.blurred) & (self.v != 0.0))

    def _long_stretches(self, margin: int) -> Mask:
        """Return where the direction stays for as long as smoothing blurs, but for a margin at both ends."""
        found = np.zeros(self.v.size, dtype=bool)
        edges = np.flatnonzero(np.diff(np.sign(self.v), prepend=np.nan, append=np.nan))
        for first, last in pairwise(edges.tolist()):
            if last - first >= self.blurred:
                found[first + margin : last - margin] = True
        return found


def detect_ends(drives: Sequence[Drive], stroke: float | None) -> tuple[float, float]:
    """Detect ends of the stroke in recordings.

    Friction is what resists motion, or the largest force held inward or away from the extremes, each less the load. An
    extreme near a stated end is one where friction cannot hold the piston; elsewhere, as where the zero of the position
    is not that of the stroke, the force must be ``MIN_END_FORCE_RATIO`` times as large.

    Args:
        drives: Drives of all recordings with a position.
        stroke: Stated stroke in m, None where it is not known.

    Returns:
        Lower and upper end in m, infinite where recordings show none.
    """
    x, force = (
        np.concatenate([getattr(d, name)[d.resting] for d in drives] or [np.zeros(0)]) for name in ("x", "force")
    )
    if not x.size:
        return -np.inf, np.inf
    lowest, highest = float(x.min()), float(x.max())  # of rests: where the piston bounces it goes beyond
    tolerance = max(end_compliance(drives), *(d.scatter for d in drives))
    if np.isnan(force).any():
        return _ends_reached((lowest, highest), stroke, tolerance)
    low, high = x <= lowest + tolerance, x >= highest - tolerance
    load, resistance = _load_and_resistance(drives, lowest + tolerance, highest - tolerance)
    push = force - load[0] - load[1] * x
    held = np.where(low, np.maximum(push, 0.0), np.where(high, np.maximum(-push, 0.0), np.abs(push)))
    friction = max(float(held.max()), resistance)
    near = max(STROKE_TOLERANCE * (stroke or 0.0), tolerance)
    spans = stroke is not None and abs(highest - lowest - stroke) <= near
    at_low, at_high = (
        bool(mask.any())
        and float(np.max(outward[mask])) > friction * (1.0 if is_stated else MIN_END_FORCE_RATIO)
        and (is_stated or friction > 0.0)
        for mask, outward, is_stated in (
            (low, -push, spans or (stroke is not None and abs(lowest) <= near)),
            (high, push, spans or (stroke is not None and abs(highest - stroke) <= near)),
        )
    )
    return lowest if at_low else -np.inf, highest if at_high else np.inf


def _ends_reached(rests: tuple[float, float], stroke: float | None, tolerance: float) -> tuple[float, float]:
    """Return the stated ends at which the piston rests: all that shows where no force is known, infinite where none.

    >>> _ends_reached((0.0001, 0.15), 0.2, 0.0005)
    (0.0001, inf)
    """
    at_low, at_high = abs(rests[0]) <= tolerance, stroke is not None and abs(rests[1] - stroke) <= tolerance
    return rests[0] if at_low and stroke is not None else -np.inf, rests[1] if at_high else np.inf


def _load_and_resistance(drives: Sequence[Drive], low: float, high: float) -> tuple[tuple[float, float], float]:
    """Return the load that the drive balances between two positions, in N at x = 0 and in N/m, and dry friction in N.

    The load is a line over the position; dry friction includes what neither line nor inertia nor viscosity explain.
    """
    rows = []
    for d in drives:
        moving = d.sliding & (d.x > low) & (d.x < high)
        columns = (np.ones(d.x.size), d.x, np.sign(d.v), d.v, d.a, d.force)
        rows.append(np.column_stack(columns)[moving])
    table = np.vstack(rows)
    forward = float(np.mean(table[:, 2] > 0.0)) if len(table) >= MIN_MOVING_SAMPLES else 0.0
    if not MIN_DIRECTION_SHARE <= forward <= 1.0 - MIN_DIRECTION_SHARE:
        return (0.0, 0.0), 0.0
    sizes = np.maximum(np.abs(table[:, :-1]).max(axis=0), 1e-300)
    found, *_ = np.linalg.lstsq(table[:, :-1] / sizes, table[:, -1])
    misfit = float(np.std(table[:, -1] - table[:, :-1] @ (found / sizes)))
    offset, slope, coulomb, _, _ = (found / sizes).tolist()
    return (offset, slope), max(coulomb, 0.0) + misfit


def stroke_limits(drives: Sequence[Drive], stroke: float | None, detected: tuple[float, float]) -> tuple[float, float]:
    """Return the limits of the position.

    Args:
        drives: Drives of all recordings with a position.
        stroke: Stated stroke in m, None where it is not known.
        detected: Ends that recordings show in m.

    Returns:
        Lowest and highest x in m: detected, else stated, else infinite; never inside the measured range.
    """
    lowest, highest = _extremes(drives)
    stated = np.inf if stroke is None else stroke
    low, high = detected
    return min(low if np.isfinite(low) else 0.0, lowest), max(high if np.isfinite(high) else stated, highest)


def contact_side(x: Array, ends: tuple[float, float], tolerance: float) -> Array:
    """Return the side on which an end may carry the piston.

    Args:
        x: Position in m, shape (n,).
        ends: Lower and upper end in m, infinite where there is none.
        tolerance: Distance in m from an end within which the piston may touch it.

    Returns:
        -1, 0 or 1 for each sample, shape (n,).

    >>> contact_side(np.array([0.0, 0.1, 0.2]), (0.0, np.inf), 0.001).tolist()
    [-1.0, 0.0, 0.0]
    """
    low, high = ends
    return np.where(x >= high - tolerance, 1.0, np.where(x <= low + tolerance, -1.0, 0.0))


def end_compliance(drives: Sequence[Drive]) -> float:
    """Return the distance in m by which an end may yield; a recording at an end does not show the range of x."""
    lowest, highest = _extremes(drives)
    return END_COMPLIANCE * (highest - lowest)


def _extremes(drives: Sequence[Drive]) -> tuple[float, float]:
    """Return the lowest and the highest position in m, 0 where there is none."""
    lowest = min((float(d.x.min()) for d in drives), default=0.0)
    return lowest, max((float(d.x.max()) for d in drives), default=0.0)
