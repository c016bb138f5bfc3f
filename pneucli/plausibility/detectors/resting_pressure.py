"""Checks of the pressures at which a vessel comes to rest: ambient, the supply, or what a pressure loop gives it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pneucli.messages.formatting import format_signal
from pneucli.plausibility.detectors.readings import reference_finding
from pneucli.plausibility.rig_check import (
    AMBIENT_SLIP_SHARE,
    MAX_EXCESS,
    UNIT_SLIP_FACTOR,
    Finding,
    RigCheck,
    excess,
)
from pneucli.recording import Recording

MIN_COMMAND_STEP = 0.005  # of the commands' range: less is noise of a command that is held
MIN_HELD_SAMPLES = 40  # samples at one command, of which the last two tens tell whether p1 still moves
MIN_PRESSURE_TRAVEL, MAX_RESTING_DRIFT = (
    0.5,
    0.01,
)  # of p1's range: heat moves it less than half of the way, and after 1 % of it p1 rests
MIN_BETWEEN = 0.1  # of supply over ambient, from either: a valve that is open rests a vessel at one of both
MIN_LOOP_COMMANDS = 3  # commands at which p1 rests between both
MIN_LOOP_TRAVEL = 0.2  # of p1's range, at one command: steps to both sides of a middle go over half of it each
MAX_LOOP_SCATTER = 0.03  # of the span of these pressures, about a line over the command


def pressure_loop(vessels: Sequence[Recording], bench: RigCheck) -> Finding | None:
    """Return the finding that p1 comes to rest where the command says, from above and from below.

    Args:
        vessels: Valve tests on a vessel.
        bench: What the checks look at.
    """
    rests = []
    for one in vessels if bench.rig.valve_kind != "pressure" else ():
        supply = float(np.nanmedian(one["p_supply"])) if "p_supply" in one else bench.rig.supply_pressure
        if supply is None:
            continue
        margin = MIN_BETWEEN * (supply - bench.rig.ambient_pressure)
        for charged, level, rows in _resting_levels(one, MIN_LOOP_TRAVEL):
            if bench.rig.ambient_pressure + margin < level < supply - margin:
                rests.append((float(np.nanmedian(one["u"][rows])), level, charged, one.name))
    u, levels = np.array([rest[0] for rest in rests]), np.array([rest[1] for rest in rests])
    if np.unique(np.round(u, 6)).size < MIN_LOOP_COMMANDS or len({charged for _, _, charged, _ in rests}) < 2:
        return None
    slope, offset = np.polyfit(u, levels, 1)
    scatter = float(np.std(levels - slope * u - offset))
    if scatter > MAX_LOOP_SCATTER * float(np.ptp(levels)):
        return None
    lowest, highest = (format_signal(float(level), "p1") for level in (levels.min(), levels.max()))
    found = (
        f"p1 comes to rest between {lowest} and {highest}, {format_signal(abs(slope), 'p1')} for each volt, from "
        "above and from below: the valve controls its pressure, and its command sets no area"
    )
    mend = 'the piston alone shows in recordings with experiment = "friction", whose pressures are inputs'
    by = excess(MAX_LOOP_SCATTER * float(np.ptp(levels)), scatter)
    return Finding("pressure-loop", "u", rests[0][3], found, mend, min(by, MAX_EXCESS))


def resting_pressure(one: Recording, bench: RigCheck) -> Iterator[Finding]:
    """Where a vessel has been vented it rests at ambient pressure, where it has been charged not above the supply."""
    ambient = bench.rig.ambient_pressure
    if bench.rig.source == "ejector" or bench.rig.valve_kind == "pressure":  # it rests where these hold it
        return
    for charged, level, rows in _resting_levels(one, MIN_PRESSURE_TRAVEL):
        error, share = bench.pressure_error(one, "p1", level), (rows.stop - rows.start) / one.time.size
        seen = f"p1 rests at {format_signal(level, 'p1')} in a vented chamber"
        if not charged and level < ambient:  # it cannot vent further than to what it vents to
            yield from reference_finding("gauge", one, "p1", seen, excess(ambient - level, error), share).judged(
                physics=True
            )
        elif not charged and AMBIENT_SLIP_SHARE < level / ambient - 1.0 < 1.0 + AMBIENT_SLIP_SHARE:
            yield from reference_finding("absolute", one, "p1", seen, excess(level - ambient, error), share).judged()
        elif charged and "p_supply" in one:
            yield from _charged(one, level, rows, bench)


def _charged(one: Recording, level: float, rows: slice, bench: RigCheck) -> Iterator[Finding]:
    """A vessel is charged to its supply; where it rests far below, either reads wrong, or the vessel leaks."""
    ambient, supply = bench.rig.ambient_pressure, float(np.nanmedian(one["p_supply"][rows]))
    errors = bench.pressure_error(one, "p1", level), bench.pressure_error(one, "p_supply", supply)
    above, share = excess(level - supply, *errors), (rows.stop - rows.start) / one.time.size
    seen = (
        f"p1 rests at {format_signal(level, 'p1')} in a chamber "
        f"that is charged from {format_signal(supply, 'p_supply')}"
    )
    if above > 0.0 and level - supply < (1 + AMBIENT_SLIP_SHARE) * ambient:
        yield from reference_finding("gauge", one, "p_supply", seen, above, share).judged(physics=True)
        return
    below = excess((supply - ambient) / UNIT_SLIP_FACTOR - (level - ambient), *errors)
    mend = "check column, unit and reference in [signals] p_supply and p1"
    finding = Finding("supply", "p_supply", one.name, seen, mend, max(above, below), share)
    yield from finding.judged(physics=above > 0.0)


def _resting_levels(one: Recording, min_travel: float) -> list[tuple[bool, float, slice]]:
    """Return (charged?, pressure in Pa, rows) where p1 rests after it went over that share of its range."""
    u, p = one["u"], one["p1"]
    span = float(np.nanmax(p) - np.nanmin(p))
    jumps = np.flatnonzero(np.abs(np.diff(u)) > MIN_COMMAND_STEP * max(float(np.ptp(u)), 1e-9)) + 1
    found = []
    for start, stop in zip(np.append(0, jumps), np.append(jumps, u.size), strict=True):
        held = p[start:stop][np.isfinite(p[start:stop])]
        if held.size < MIN_HELD_SAMPLES:
            continue
        first, before, last = (float(np.mean(part)) for part in (held[:2], *np.array_split(held[held.size // 2 :], 2)))
        if abs(last - first) > min_travel * span and abs(last - before) < MAX_RESTING_DRIFT * span:
            found.append((last > first, last, slice(int(start + (stop - start) * 3 // 4), int(stop))))
    return found
