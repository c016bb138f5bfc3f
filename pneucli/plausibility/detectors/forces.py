"""Checks of the force on the piston against its motion: signs, areas, masses, and closed chambers."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array
from pneucli.messages.formatting import format_plain, format_quantity, format_signal
from pneucli.plausibility.blocks import fit_linear
from pneucli.plausibility.detectors import Detector
from pneucli.plausibility.detectors.readings import reference_finding
from pneucli.plausibility.rig_check import (
    AMBIENT_SLIP_SHARE,
    LAG,
    MAX_EXCESS,
    MIN_DIRECTION_SHARE,
    MIN_DOUBT,
    PRESSURE_GAIN,
    UNIT_SLIP_FACTOR,
    Finding,
    RigCheck,
    excess,
)
from pneucli.recording import Recording

# a payload that the description misses may weigh several times what is stated (extra-mass); beyond ten times it is a
# slip of units: g for kg, mm^2 for cm^2. Nothing makes a piston lighter
MAX_MASS_RATIO, MIN_MASS_RATIO = 10.0, 1 / UNIT_SLIP_FACTOR
# exponents below the isotherm's: a closed chamber with twice its volume, such as that of a hose, shows half
MIN_POLYTROPIC_EXPONENT = 0.5
EXPONENT_TOLERANCE = 0.5  # beyond isotherm and isentrope, of an exponent that is fitted beside an offset


@dataclass(frozen=True)
class ForceBalance:
    """What net force = mass x acceleration + friction gives, SI, each with its standard uncertainty."""

    mass: float
    mass_error: float
    drag: float  # N, mean of the friction that resists motion
    drag_error: float
    both_ways: bool


def _check(rig_check: RigCheck) -> Iterator[Finding]:
    """Yield findings of all recordings with a piston."""
    balances: list[tuple[Recording, ForceBalance]] = []
    for one in rig_check.recordings:
        if "x" not in one or one.kind.vessel:
            continue
        closed = ClosedChamber.from_recording(one, rig_check)
        exponent = closed.exponent() if closed else None
        turned = exponent is not None and exponent[0] + MIN_DOUBT * exponent[1] < 0
        if closed and exponent:
            yield from _polytropic_law(one, closed, *exponent, rig_check)
        balance = _force_balance(one, rig_check)
        if balance is not None:
            balances.append((one, balance))
            yield from _direction(one, balance, turned=turned)
    yield from _mass(balances, rig_check)


def _force_balance(one: Recording, bench: RigCheck) -> ForceBalance | None:
    """Fit mass and friction; pressures may read a scale too much, and they may be late (:data:`LAG`)."""
    cut = bench.blocks(one, "x", 2)
    driving = [name for name in ("p1", "p2", "force") if name in one]
    if cut is None:
        return None
    v, a, x = cut.slope("x"), cut.curvature("x"), cut.mean("x", 2)
    one_way = np.abs(v) > np.abs(a) * cut.half_duration  # the motion does not turn within the block
    forces = bench.forces(one, {name: cut.mean(name, 2)[one_way] for name in driving}, bench.rig.ambient_pressure)
    rates = bench.forces(one, {name: cut.slope(name)[one_way] for name in driving}, 0.0)
    v, a, x = v[one_way], a[one_way], x[one_way]
    if v.size == 0 or not forces:
        return None
    columns = [a, np.sign(v), v, x - x.mean(), np.ones_like(v)]
    line, late = fit_linear(columns, sum(forces.values(), 0.0 * v)), fit_linear(columns, sum(rates.values(), 0.0 * v))
    parts = [fit_linear(columns, own) for name, own in forces.items() if name != "force"]
    if line is None or late is None:
        return None
    lag = LAG * float(np.ptp(x)) / float(np.max(np.abs(v)))

    def combined(combination: Array) -> tuple[float, float]:
        value, error = line.combination(combination)
        scales = [PRESSURE_GAIN * part.combination(combination)[0] for part in parts if part is not None]
        return value, math.hypot(error, lag * late.combination(combination)[0], *scales)

    mass, mass_error = combined(np.array([1.0, 0.0, 0.0, 0.0, 0.0]))
    drag, drag_error = combined(np.array([0.0, 1.0, float(np.mean(v**2)) / float(np.mean(np.abs(v))), 0.0, 0.0]))
    forth = float(np.mean(v > 0))
    both_ways = MIN_DIRECTION_SHARE < forth < 1 - MIN_DIRECTION_SHARE
    return ForceBalance(mass - one.added_mass, mass_error, drag, drag_error, both_ways)


def _direction(one: Recording, balance: ForceBalance, *, turned: bool) -> Iterator[Finding]:
    """Friction takes energy out: a force that brakes all motion has a sign wrong.

    Weight, springs and sensors' offsets give back on the way back what they take.
    """
    alone = one.imposed and "force" not in one  # what moves the piston was not measured, and may press on the air
    if alone or not balance.both_ways:
        return
    if "p1" not in one or "p2" not in one:
        mend = "write scale = -1.0 in [signals] x, or in [signals] force, whichever has its sign wrong"
    elif turned:
        mend = "x grows toward chamber 1? write scale = -1.0 in [signals] x"
    else:
        mend = "p1 and p2 swapped? exchange the columns in [signals] p1 and p2; or write scale = -1.0 in [signals] x"
    found = f"the force on the piston brakes its motion by {format_signal(-balance.drag, 'force')} in either direction"
    by = excess(-balance.drag, balance.drag_error)
    yield from Finding("direction", "x", one.name, found, mend, by).judged(physics=True)


def _mass(balances: list[tuple[Recording, ForceBalance]], bench: RigCheck) -> Iterator[Finding]:
    """Pool the recordings, each as far as it knows the mass."""
    stated = bench.rig.moving_mass
    known = [(one, b) for one, b in balances if b.mass_error > 0 and one.imposed is None]
    if stated is None or not known:
        return
    masses, errors = np.array([b.mass for _, b in known]), np.array([b.mass_error for _, b in known])
    weights = (errors.min() / errors) ** 2
    mass = float(np.average(masses, weights=weights))
    scatter = float(np.sqrt(np.sum(((masses - mass) / errors) ** 2) / max(masses.size - 1, 1)))
    error = max(1.0, scatter) * float(errors.min() / np.sqrt(weights.sum()))
    best = known[int(np.argmax(weights))][0]
    moved, known_mass = (format_quantity(one, "kg", 3) for one in (mass, stated))
    found = f"the force on the piston accelerates {moved}, and {known_mass} are stated"
    mend = "check piston_area_1, piston_area_2 and moving_mass in [rig.cylinder], "
    mend += "and the units in [signals] p1, p2, x and time"
    outside = max(mass - MAX_MASS_RATIO * stated, MIN_MASS_RATIO * stated - abs(mass))
    yield from Finding("mass", "x", best.name, found, mend, excess(outside, error)).judged()


@dataclass(frozen=True)
class ClosedChamber:
    """A closed chamber 2 from block to block: changes of ln V2 and of p2 in Pa, p2, and how leaks would change it."""

    squeezed: Array
    change: Array
    p: Array
    leaks: tuple[Array, Array]

    @classmethod
    def from_recording(cls, one: Recording, bench: RigCheck) -> ClosedChamber | None:
        """Return it, or None where chamber 2 is not closed, its volume is not stated, or p2 or x rests."""
        is_usable = one.chamber_2 == "closed" and "p1" in one and bench.active_signals(one, "p2")
        cut = bench.blocks(one, "x", 1) if is_usable else None
        volume = None if cut is None else bench.volume(2, cut.mean("x"))
        if cut is None or volume is None or not np.all(volume > 0):
            return None
        p1, p2, lasts = cut.mean("p1"), cut.mean("p2"), np.diff(cut.time.mean(axis=1)) / _midpoints(volume)
        leaks = (lasts * _midpoints(p1 - p2), lasts)
        return cls(-np.diff(np.log(volume)), np.diff(p2), _midpoints(p2), leaks)

    def exponent(self) -> tuple[float, float] | None:
        """Return n of p2 V2^n = constant, with its error."""
        line = fit_linear([self.squeezed * self.p, *self.leaks], self.change)
        return None if line is None else (float(line.factors[0]), float(line.errors[0]))

    def offset(self, kappa: float) -> tuple[float, float]:
        """Return what has to be added to p2 (Pa) for the chamber's law, with its error.

        With it air goes like V^-n with n between 1 and ``kappa``. Another exponent, such as that of a fast motion of
        which p2 is late, says that an offset is not what is wrong: 0.
        """
        line = fit_linear([self.squeezed * self.p, self.squeezed, *self.leaks], self.change)
        if line is None or not 1.0 - EXPONENT_TOLERANCE <= line.factors[0] <= kappa + EXPONENT_TOLERANCE:
            return 0.0, 1.0
        return float(line.factors[1] / line.factors[0]), max(float(line.errors[1] / line.factors[0]), 1e-300)


def _midpoints(values: Array) -> Array:
    return np.asarray(0.5 * (values[1:] + values[:-1]))


def _polytropic_law(
    one: Recording, closed: ClosedChamber, exponent: float, error: float, bench: RigCheck
) -> Iterator[Finding]:
    """Air in a closed chamber goes between the isotherm, n = 1, and the isentrope, n = kappa.

    A reading that is short of ambient pressure gives a steeper law, by p true over p read; one that has it twice a
    flatter one, which heat transfer may give, too. Both bend it otherwise than volumes do: that tells the offset.
    """
    middle, ambient, kappa = float(np.nanmedian(one["p2"])), bench.rig.ambient_pressure, bench.rig.heat_capacity_ratio
    steepest = kappa * ((middle + ambient) / max(middle, 1.0)) ** 1.5
    outside = max(exponent - steepest, MIN_POLYTROPIC_EXPONENT - exponent)
    if exponent < 0:
        power = format_plain(-exponent, 3)
        found = f"p2 of the closed chamber falls where x grows and makes it smaller (p2 goes like V^{power})"
        mend = "x grows toward chamber 1? write scale = -1.0 in [signals] x"
        yield from Finding("direction", "x", one.name, found, mend, excess(-exponent, error)).judged(physics=True)
    elif excess(outside, error) >= MIN_DOUBT:
        powers = (format_plain(-exponent, 3), format_plain(-kappa, 3))
        found = "p2 of the closed chamber goes like V^{}, air between V^−1 and V^{}".format(*powers)
        mend = "check dead_volume_2, piston_area_2 and stroke in [rig.cylinder], and the units in [signals] x and p2"
        yield Finding("volume", "p2", one.name, found, mend, min(excess(outside, error), MAX_EXCESS))
    else:
        yield from _closed_reference(one, *closed.offset(kappa), middle, ambient)


def _closed_reference(one: Recording, offset: float, error: float, middle: float, ambient: float) -> Iterator[Finding]:
    by = excess(abs(offset) - AMBIENT_SLIP_SHARE * ambient, error)
    at = format_signal(middle, "p2")
    if offset > 0:
        yield from reference_finding(
            "gauge", one, "p2", f"p2 of the closed chamber lacks ambient pressure at {at}", by
        ).judged()
    else:
        found = f"p2 of the closed chamber has ambient pressure twice at {at}"
        yield from reference_finding("absolute", one, "p2", found, by).judged()


DETECTOR = Detector(
    _check,
    {
        "direction": ("a closed chamber grows with its pressure; the net force brakes motion both ways", ""),
        "mass": ("", "net force accelerates more than ten times, or less than a third of, the stated mass"),
        "volume": ("", "a closed chamber is far from V^-1 to V^-kappa"),
        "reference": ("", "the gas law of a closed chamber fits without ambient pressure, or with twice of it"),
    },
    place=6,
)
