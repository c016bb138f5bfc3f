"""Checks of the force on the piston against its motion: signs, areas, masses, and closed chambers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.plausibility.blocks import fit_linear, resolved_blocks
from pneucli.plausibility.readings import absolute_finding, gauge_finding
from pneucli.plausibility.rig_check import (
    AMBIENT_SLIP_SHARE,
    MIN_DIRECTION_SHARE,
    T_QUANTILE,
    UNIT_SLIP_FACTOR,
    Finding,
    RigCheck,
    format_in_display_unit,
)
from pneucli.recording import Recording

Array = NDArray[np.float64]

# a payload that the description misses may weigh several times what is stated (extra-mass); beyond ten times it is a
# slip of units: g for kg, mm^2 for cm^2. Nothing makes a piston lighter
MAX_MASS_RATIO, MIN_MASS_RATIO = 10.0, 1 / UNIT_SLIP_FACTOR
# exponents below the isotherm's: a closed chamber with twice its volume, such as that of a hose, shows half
MIN_POLYTROPIC_EXPONENT = 0.5
EXPONENT_TOLERANCE = 0.5  # beyond isotherm and isentrope, of an exponent that is fitted beside an offset


@dataclass(frozen=True)
class ForceBalance:
    """What net force = mass x acceleration + friction gives, SI, each with its standard error."""

    mass: float
    mass_error: float
    drag: float  # N, mean of the friction that resists motion
    drag_error: float
    both_ways: bool


def check(rig_check: RigCheck) -> Iterator[Finding]:
    """Yield findings of all recordings with a piston."""
    balances: list[tuple[Recording, ForceBalance]] = []
    for one in rig_check.recordings:
        if "x" not in one or one.kind.vessel:
            continue
        closed = ClosedChamber.from_recording(one, rig_check)
        exponent = closed.exponent() if closed else None
        turned = exponent is not None and exponent[0] + T_QUANTILE * exponent[1] < 0
        if closed and exponent:
            yield from _polytropic_law(one, closed, *exponent, rig_check)
        balance = _force_balance(one, rig_check)
        if balance is not None:
            balances.append((one, balance))
            yield from _direction(one, balance, turned=turned)
    yield from _mass(balances, rig_check)


def _force_balance(one: Recording, bench: RigCheck) -> ForceBalance | None:
    cut = resolved_blocks(one, "x", 2)
    if cut is None:
        return None
    force = bench.net_force(one, {name: cut.mean(name, 2) for name in ("p1", "p2", "force") if name in one})
    if force is None:
        return None
    v, a, x = cut.slope("x"), cut.curvature("x"), cut.mean("x", 2)
    one_direction = np.abs(v) > np.abs(a) * cut.half_duration  # of the direction: it does not turn within the block
    v, a, x, force = v[one_direction], a[one_direction], x[one_direction], force[one_direction]
    if v.size == 0:
        return None
    line = fit_linear([a, np.sign(v), v, x - x.mean(), np.ones_like(v)], force)
    if line is None:
        return None
    speed = float(np.mean(np.abs(v)))
    drag, drag_error = line.combination(np.array([0.0, 1.0, float(np.mean(v**2)) / speed, 0.0, 0.0]))
    forth = float(np.mean(v > 0))
    return ForceBalance(
        float(line.factors[0]) - one.added_mass,
        float(line.errors[0]),
        drag,
        drag_error,
        MIN_DIRECTION_SHARE < forth < 1 - MIN_DIRECTION_SHARE,
    )


def _direction(one: Recording, balance: ForceBalance, *, turned: bool) -> Iterator[Finding]:
    """Friction takes energy out: a force that brakes all motion has a sign wrong.

    Weight, springs and sensors' offsets give back on the way back what they take.
    """
    alone = one.imposed and "force" not in one  # what moves the piston was not measured, and may press on the air
    if alone or not balance.both_ways or balance.drag + T_QUANTILE * balance.drag_error > 0:
        return
    if "p1" not in one or "p2" not in one:
        mend = "write scale = -1.0 in [signals] x, or in [signals] force, whichever has its sign wrong"
    elif turned:
        mend = "x grows toward chamber 1? write scale = -1.0 in [signals] x"
    else:
        mend = "p1 and p2 swapped? exchange the columns in [signals] p1 and p2; or write scale = -1.0 in [signals] x"
    found = f"the force on the piston brakes its motion by {-balance.drag:.3g} N in either direction"
    yield Finding("direction", "x", one.name, found, mend)


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
    error = T_QUANTILE * max(1.0, scatter) * float(errors.min() / np.sqrt(weights.sum()))
    best = known[int(np.argmax(weights))][0]
    if mass - error > MAX_MASS_RATIO * stated or abs(mass) + error < MIN_MASS_RATIO * stated:
        found = f"the force on the piston accelerates {mass:.3g} kg, and {stated:.3g} kg are stated"
        mend = "check piston_area_1, piston_area_2 and moving_mass in [rig.cylinder], "
        mend += "and the units in [signals] p1, p2, x and time"
        yield Finding("mass", "x", best.name, found, mend)


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
        cut = resolved_blocks(one, "x", 1) if is_usable else None
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

    def offset_significance(self, offset: float, kappa: float) -> float:
        """Return by how many standard errors the chamber's law wants more than ``offset`` (Pa) added to p2.

        With an offset, air goes like V^-n with n between 1 and ``kappa``. Another exponent, such as that of a fast
        motion of which p2 is late, says that an offset is not what is wrong: 0.
        """
        line = fit_linear([self.squeezed * (self.p + offset), self.squeezed, *self.leaks], self.change)
        if line is None or not 1.0 - EXPONENT_TOLERANCE <= line.factors[0] <= kappa + EXPONENT_TOLERANCE:
            return 0.0
        return float(line.factors[1] / max(line.errors[1], 1e-300))


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
    seen = f"p2 of the closed chamber goes like V^-{exponent:.3g}, air between V^-1 and V^-{kappa:.3g}"
    if exponent < 0 and exponent + T_QUANTILE * error < MIN_POLYTROPIC_EXPONENT:
        found = f"p2 of the closed chamber falls where x grows and makes it smaller (p2 goes like V^{-exponent:.3g})"
        yield Finding("direction", "x", one.name, found, "x grows toward chamber 1? write scale = -1.0 in [signals] x")
    elif exponent - T_QUANTILE * error > steepest or exponent + T_QUANTILE * error < MIN_POLYTROPIC_EXPONENT:
        mend = "check dead_volume_2, piston_area_2 and stroke in [rig.cylinder], and the units in [signals] x and p2"
        yield Finding("volume", "p2", one.name, seen, mend)
    elif closed.offset_significance(AMBIENT_SLIP_SHARE * ambient, kappa) > T_QUANTILE:
        yield gauge_finding(
            one, "p2", f"p2 of the closed chamber lacks ambient pressure at {format_in_display_unit(middle, 'p2')}"
        )
    elif closed.offset_significance(-AMBIENT_SLIP_SHARE * ambient, kappa) < -T_QUANTILE:
        yield absolute_finding(
            one, "p2", f"p2 of the closed chamber has ambient pressure twice at {format_in_display_unit(middle, 'p2')}"
        )
