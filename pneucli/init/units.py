"""Part of ``init``: what the numbers themselves say of their unit, and of gauge or absolute."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from pneucli.arrays import Array
from pneucli.init.survey_types import UnitGuess
from pneucli.io.cleaning import MAX_SPEED
from pneucli.io.signal_repairs import MIN_JUMP_STEPS, MIN_SINGLE_RUN, USUAL_STEP
from pneucli.messages.formatting import format_plain, format_signal
from pneucli.plausibility.detectors.readings import MAX_COMMAND, MAX_FLOW, MAX_PRESSURE, MAX_STROKE, MIN_SUPPLY
from pneucli.quantities import SIGNALS
from pneucli.units import ReferenceState, factor_and_offset, parse_quantity, parse_unit, same_dimension

AMBIENT_RANGE = (0.94e5, 1.06e5)  # Pa, of laboratories up to some 600 m
MIN_ABSOLUTE_PRESSURE = 0.5e5  # Pa, absolute, that no chamber of a rig has
MIN_PRESSURE_CHANGE = 0.3e5  # Pa, by which a pressure moves that has come from ambient
REST_SHARE = 0.02  # share of the samples that a rest has at least
DIP_SHARE = 0.005  # share of the samples that a chamber is lowest for a moment at most, as its piston starts fast
R_DRY_AIR = 287.05  # J/(kg K)
REFERENCE_TEMPERATURES = (273.0, 299.0)  # K: those of the standards, 0 to 25 degC
_STATES = re.compile(r"(?i)\b(?:[sn]tp|norm|standard|referen|bezug)")
_DEGREES = re.compile(r"(?i)(-?\d+(?:[.,]\d+)?)\W{0,3}(?:deg)?[ .]?([CFK])\b")
_PRESSURE_UNITS = ("mbar", "bar", "hPa", "kPa", "Pa", "psi", "atm", "Torr", "mmHg")
_PRESSURE = re.compile(rf"(?i)(\d+(?:[.,]\d+)?)\s*({'|'.join(_PRESSURE_UNITS)})a?\b")
LOWEST_GAUGE = -1.013e5  # Pa: below it no gas is left


def guess_unit(signal: str, values: Array, *, angle: bool, written: str = "") -> UnitGuess:
    """Return the unit that numbers without one, or in one ``written`` that is not known, are most likely in.

    It is asked for where it is written, as of it no level but a rest tells, and of pressures that are too large for
    bar and suit several units: kPa, psi, mbar, mmHg.
    """
    if not values.size:
        return UnitGuess(SIGNALS[signal].unit, "CHECK no value, and no unit", bool(written))
    stated = f'the unit "{written}" is not known' if written else "no unit is stated"
    if SIGNALS[signal].unit == "Pa" and (found := _unit_at_ambient(values)):
        unit, how = found
        why = f"CHECK {stated}: taken for {unit}, in which it {how} at ambient pressure and moves from there"
        return UnitGuess(unit, why, bool(written) and (how != "rests" or " or " in written), how)
    unit, low, high = _most_likely_unit(signal, values, angle), float(values.min()), float(values.max())
    why = f"CHECK {stated}: {format_plain(low, 4)} to {format_plain(high, 4)} is taken for {unit}"
    return UnitGuess(unit, why, bool(written) or unit == "kPa")


def told_state(lines: Iterable[str]) -> ReferenceState | None:
    """Return the state of volumes of air that a line tells, such as "STP 25 C, 14.696 PSIA"; None where none does."""
    return next(filter(None, map(read_state, filter(_STATES.search, lines))), None)


def read_state(text: str) -> ReferenceState | None:
    """Return the state of volumes of air that a temperature and a pressure in a text are; None where they are none."""
    degrees, pressure = _DEGREES.search(text), _PRESSURE.search(text)
    if degrees is None or pressure is None:
        return None
    unit = next(unit for unit in _PRESSURE_UNITS if unit.lower() == pressure[2].lower())
    warmth = f"{degrees[1].replace(',', '.')} {'' if degrees[2] in 'kK' else '°'}{degrees[2].upper()}"
    level = f"{pressure[1].replace(',', '.')} {unit}"
    temperature, pascals = parse_quantity(warmth, "K"), parse_quantity(level, "Pa")
    if not REFERENCE_TEMPERATURES[0] <= temperature <= REFERENCE_TEMPERATURES[1] or abs(pascals - 1e5) >= 5e3:
        return None
    return ReferenceState(pascals / (R_DRY_AIR * temperature), f"{warmth} and {level}")


def _unit_at_ambient(values: Array) -> tuple[str, str] | None:
    """Return the unit in which a pressure rests, or is lowest, at ambient pressure, absolute, and moves, and which."""
    pascals = {unit: to_si(values, unit, "Pa") for unit in ("bar", "kPa", "mbar", "Pa", "psi")}
    rests = ((unit, "rests") for unit, own in pascals.items() if ambient_rest_pressure(own) is not None)
    return next(rests, None) or next(((unit, "is lowest") for unit, own in pascals.items() if _is_vented(own)), None)


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


class Reference(NamedTuple):
    """Whether pressures count from ambient, ``"gauge"``, or ``"absolute"``, the evidence, and how certain that is.

    ``certainty``: 0 by custom alone, 1 by what the numbers suggest, 2 certain; ``stated``: the file says it.
    """

    kind: str
    why: str
    certainty: int = 2
    stated: bool = False


def pressure_reference(columns: Sequence[Array], unit: str, stated: str) -> Reference:
    """Return what pressures count from.

    ``columns`` are those of one sensor, one a recording, in its ``unit``, none where that is still asked for;
    ``stated`` is what its name says.
    """
    parsed = parse_unit(unit)
    if stated or parsed.gauge or parsed.absolute:
        found = stated or ("gauge" if parsed.gauge else "absolute")
        return Reference(found, f"{found}: stated by the file", stated=True)
    pascals = [to_si(_without_dropout(values), unit, "Pa") for values in columns]
    least = min((float(values.min()) for values in pascals if values.size), default=np.inf)
    lowest = format_signal(least, "p1", 4)
    if least < LOWEST_GAUGE:
        why = f"CHECK its unit: it reads down to {lowest}, and no gauge pressure is below -1.013 bar"
        return Reference("gauge", why, certainty=0)
    if least < MIN_ABSOLUTE_PRESSURE:
        return Reference("gauge", f"gauge: it reads down to {lowest}, and no gas of a rig has so little")
    if rest := next(filter(None, map(ambient_rest_pressure, pascals)), None):
        why = f"it rests at {format_signal(rest, 'p1', 4)}, which is ambient pressure, and moves from there"
        return Reference("absolute", f"absolute: {why}")
    if any(map(_is_vented, pascals)) and least >= AMBIENT_RANGE[0]:
        why = f"CHECK absolute: where it is lowest it is {lowest}, which is ambient pressure"
        return Reference("absolute", why, certainty=1)
    guess = "absolute" if parsed.factor == 1.0 else "gauge"
    usual = "pascals are mostly absolute" if guess == "absolute" else "sensors are mostly gauge"
    seen = f"it never stays at ambient pressure (least {lowest}); " if np.isfinite(least) else ""
    return Reference(guess, f"CHECK {guess}: {seen}{usual}", certainty=0)


def _is_vented(pascals: Array) -> bool:
    """Return whether a pressure begins, ends or stays lowest at ambient pressure: one that moves may pass by chance."""
    if not pascals.size or float(np.ptp(pascals)) < MIN_PRESSURE_CHANGE or pascals.min() < AMBIENT_RANGE[0]:
        return False
    return bool(min(pascals[0], pascals[-1], np.quantile(pascals, DIP_SHARE)) <= AMBIENT_RANGE[1])


def _without_dropout(values: Array) -> Array:
    """Return readings without their lowest, where only jumps lead there: a channel that was dead tells no reference."""
    low = values == values.min(initial=np.inf)
    steps = np.abs(np.diff(values))
    at_edges, others = steps[low[1:] != low[:-1]], steps[~low[1:] & ~low[:-1]]
    if np.count_nonzero(low) < MIN_SINGLE_RUN or not at_edges.size or not others.size:
        return values
    return values[~low] if at_edges.min() > MIN_JUMP_STEPS * np.quantile(others, USUAL_STEP) else values


def pressure_reference_from_force(pressures: Sequence[Array], forces: Sequence[Array], unit: str) -> Reference | None:
    """Return what the force on a piston says: in proportion with a gauge pressure, nothing at ambient with an absolute.

    Of medians, one a recording; None where too few recordings at different pressures tell.
    """
    p = np.array([np.median(to_si(values, unit, "Pa")) for values in pressures])
    force = np.array([np.median(values) for values in forces])
    if p.size < 3 or np.ptp(p) < MIN_PRESSURE_CHANGE or abs(np.corrcoef(p, force)[0, 1]) < 0.99:
        return None
    slope, offset = np.polyfit(p, force, 1)
    zero = -offset / slope
    evidence = f"the force is none at {format_signal(zero, 'p1', 2)}"
    if abs(zero) < MIN_ABSOLUTE_PRESSURE:
        return Reference("gauge", f"gauge: {evidence}")
    return Reference("absolute", f"absolute: {evidence}") if abs(zero - 1e5) < MIN_ABSOLUTE_PRESSURE else None


def to_si(values: Array, unit: str, wanted: str) -> Array:
    """Return numbers in SI, as what is measured in ``wanted``; gauge pressures stay gauge."""
    factor, offset = factor_and_offset(unit, 0.0, wanted)
    return factor * values + offset


def ambient_rest_pressure(pascals: Array) -> float | None:
    """Return the pressure at which a chamber begins or ends, if that is ambient and it rises more than it falls."""
    if float(np.ptp(pascals)) < MIN_PRESSURE_CHANGE:
        return None
    few = max(1, int(REST_SHARE * pascals.size))
    ends = [float(np.median(part)) for part in (pascals[:few], pascals[-few:])]
    rest = next((end for end in ends if AMBIENT_RANGE[0] <= end <= AMBIENT_RANGE[1]), None)
    rises = rest is not None and float(pascals.max()) - rest >= rest - float(pascals.min())
    return rest if rises else None


LIMITS = {  # in SI, gauge: what no pneumatic rig has, and why
    "x": (-MAX_STROKE, MAX_STROKE, "no cylinder has such a stroke"),
    "v": (-MAX_SPEED, MAX_SPEED, "no piston is so fast"),
    "flow": (-MAX_FLOW, MAX_FLOW, "no valve of a rig lets so much through"),
    "u": (-MAX_COMMAND, MAX_COMMAND, "no valve's electronics take so much"),
    "temperature": (150.0, 600.0, "no gas of a rig is so cold or hot"),
    **dict.fromkeys(("p1", "p2", "p_supply", "p_ref"), (LOWEST_GAUGE, MAX_PRESSURE, "no pneumatic supply has so much")),
}


def implausibility(signal: str, unit: str, values: Array) -> str:
    """Return why numbers in a unit cannot be a signal of a pneumatic rig; nothing where they can."""
    limits = LIMITS.get({"u2": "u", "x_ref": "x"}.get(signal, signal))
    if (
        limits is None
        or not values.size
        or (signal in ("x", "x_ref", "v") and not same_dimension(unit, SIGNALS[signal].unit))
    ):
        return ""
    found = to_si(values, unit, SIGNALS[signal].unit)
    low, high = float(found.min()), float(found.max())
    if signal.startswith("x"):
        low, high = 0.0, high - low
    if signal == "p_supply" and high < MIN_SUPPLY:
        return f"{format_plain(high, 3)} Pa at most, no supply has so little; thousands?"
    if limits[0] <= low and high <= limits[1]:
        return ""
    worst = high if high > limits[1] else low
    why = "no gauge pressure is below -1.013 bar" if worst < 0 and signal.startswith("p") else limits[2]
    return f"{format_plain(worst, 3)} {SIGNALS[signal].unit}, {why}"
