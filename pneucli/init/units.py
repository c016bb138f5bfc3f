"""Part of ``init``: what the numbers themselves say of their unit, and of gauge or absolute."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pneucli.quantities import SIGNALS
from pneucli.units import factor_and_offset, parse_unit

Array = NDArray[np.float64]
AMBIENT_RANGE = (0.94e5, 1.06e5)  # Pa, of laboratories up to some 600 m
MIN_ABSOLUTE_PRESSURE = 0.5e5  # Pa, absolute, that no chamber of a rig has
MIN_PRESSURE_CHANGE = 0.3e5  # Pa, by which a pressure moves that has come from ambient
REST_SHARE = 0.02  # share of the samples that a rest has at least
CLOCK_UNITS = (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9))
MAX_ONE_SECOND_SAMPLES = 3000  # samples: more of them, one a second, would be an hour


def guess_unit(signal: str, values: Array, *, angle: bool) -> tuple[str, str]:
    """Return the unit that numbers without one are most likely in, and why."""
    if signal == "time":
        return _clock(values)
    unit = _most_likely_unit(signal, values, angle)
    low, high = float(values.min()), float(values.max())
    return unit, f"no unit is said: {low:.4g} to {high:.4g} is taken for {unit}"


def _most_likely_unit(signal: str, values: Array, angle: bool) -> str:
    most, span = float(np.abs(values).max()), float(np.ptp(values))
    if SIGNALS[signal].unit == "Pa":
        return "Pa" if most > 3e4 else "kPa" if most > 100 else "bar"
    if signal in ("x", "x_ref"):
        if angle and span > 7:
            return "deg"
        return "m" if span < 3 else "mm"
    if signal == "v":
        return "m/s" if most < 20 else "mm/s"
    if signal == "temperature":
        return "K" if float(np.median(values)) > 150 else "degC"
    return SIGNALS[signal].unit


def _clock(values: Array) -> tuple[str, str]:
    """Take stamps for the largest unit in which they come faster than once a second."""
    period = float(np.median(np.diff(values))) if values.size > 1 else 1.0
    if period == 1.0 and values.size < MAX_ONE_SECOND_SAMPLES:
        return "s", "no unit is said: a sample every 1 may be every second or every millisecond; few, so seconds"
    unit, factor = next(((name, factor) for name, factor in CLOCK_UNITS if period * factor < 0.6), CLOCK_UNITS[0])
    if period < 60 and values.size < 200:
        unit, factor = "s", 1.0
    return unit, f"no unit is said: a sample every {period:.4g} is taken for {1 / (period * factor):.4g} Hz"


def pressure_reference(columns: Sequence[Array], unit: str, stated: str) -> tuple[str, str]:
    """Return whether pressures count from ambient, ``"gauge"``, or ``"absolute"``, and the evidence.

    ``columns`` are those of one sensor, one a recording, in its ``unit``; ``stated`` is what its name says.
    """
    parsed = parse_unit(unit)
    if stated or parsed.gauge or parsed.absolute:
        found = stated or ("gauge" if parsed.gauge else "absolute")
        return found, f"{found}: said by the file"
    pascals = [to_si(values, unit) for values in columns]
    least = min(float(values.min()) for values in pascals)
    if least < MIN_ABSOLUTE_PRESSURE:
        return "gauge", f"gauge: it reads down to {least / 1e5:.4g} bar, and no gas of a rig has so little"
    if rest := next(filter(None, map(ambient_rest_pressure, pascals)), None):
        return (
            "absolute",
            f"absolute: it rests at {rest / 1e5:.4g} bar, which is ambient pressure, and moves from there",
        )
    guess = "absolute" if parsed.factor == 1.0 else "gauge"
    usual = "pascals are mostly absolute" if guess == "absolute" else "sensors are mostly gauge"
    return guess, f"CHECK {guess}: it never reads ambient pressure (least {least / 1e5:.4g} bar); {usual}"


def pressure_reference_from_force(
    pressures: Sequence[Array], forces: Sequence[Array], unit: str
) -> tuple[str, str] | None:
    """Return what the force on a piston says: in proportion with a gauge pressure, nothing at ambient with an absolute.

    Of medians, one a recording; None where too few recordings at different pressures tell.
    """
    p = np.array([np.median(to_si(values, unit)) for values in pressures])
    force = np.array([np.median(values) for values in forces])
    if p.size < 3 or np.ptp(p) < MIN_PRESSURE_CHANGE or abs(np.corrcoef(p, force)[0, 1]) < 0.99:
        return None
    slope, offset = np.polyfit(p, force, 1)
    zero = -offset / slope
    told = f"the force is none at {zero / 1e5:.2g} bar"
    if abs(zero) < MIN_ABSOLUTE_PRESSURE:
        return "gauge", f"gauge: {told}"
    return ("absolute", f"absolute: {told}") if abs(zero - 1e5) < MIN_ABSOLUTE_PRESSURE else None


def to_si(values: Array, unit: str) -> Array:
    """Return numbers in SI; gauge pressures stay gauge."""
    factor, offset = factor_and_offset(unit, 0.0)
    return factor * values + offset


def ambient_rest_pressure(pascals: Array) -> float | None:
    """Return the pressure at which a chamber begins or ends, if that is ambient pressure and it moves in between."""
    if float(np.ptp(pascals)) < MIN_PRESSURE_CHANGE:
        return None
    few = max(1, int(REST_SHARE * pascals.size))
    ends = [float(np.median(part)) for part in (pascals[:few], pascals[-few:])]
    return next((end for end in ends if AMBIENT_RANGE[0] <= end <= AMBIENT_RANGE[1]), None)
