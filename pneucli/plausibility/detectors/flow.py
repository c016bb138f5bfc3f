"""Checks of the flow into chamber 1 against commands, supply and volumes, and of where a vessel comes to rest.

That is ambient pressure, the supply, or what a pressure loop gives it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.messages.formatting import format_plain, format_quantity, format_signal
from pneucli.physics.gas import critical_ratio_of
from pneucli.physics.vectorised import flow_functions
from pneucli.plausibility.blocks import FOLDS, Blocks, fit_linear, prediction_errors
from pneucli.plausibility.detectors import Detector
from pneucli.plausibility.detectors.readings import reference_finding
from pneucli.plausibility.rig_check import (
    AMBIENT_SLIP_SHARE,
    MAX_EXCESS,
    MIN_DOUBT,
    MIN_SIGNAL_TO_NOISE,
    UNIT_SLIP_FACTOR,
    Finding,
    RigCheck,
    excess,
)
from pneucli.recording import Recording, Rig

MAX_AREA = 5e-4  # m^2: the bore of a one-inch port, wider than any servo valve
MIN_AREA = 1e-8  # m^2: a hole of 0.1 mm, the smallest orifice of a proportional valve
MAX_LEAK_AREA = 1e-7  # m^2: the largest leaks that the catalogue calls typical; more flows through the valve
GEOMETRY_ERROR = 0.1  # of a volume: what hoses and fittings add to it
MAX_PRESSURE_RATIO = 0.9  # pressure ratio above which the flow function is too flat to tell an area
MIN_RELATIVE_FLOW = 0.2  # of the largest flow: heat that goes on after a charge moves less
# of the flows that compressing and moving ask for: what a wrong volume leaves of two that cancel
MIN_NET_FLOW_SHARE = 0.3
MIN_UNEXPLAINED = 0.2  # of the variance of dp/dt, that the pressure leaves to a command
MIN_GAIN = 0.05  # of that, which a command explains that has to do with the flow
MAX_LEVELS, MIN_BLOCKS_PER_LEVEL = 5, 4  # of a command, each with a flow of its own over the pressure
MIN_WRONG_SHARE = 0.9  # of the flow, that goes against a command with its sign wrong: a late one is wrong at times
ROUNDING = 1e-9  # of a command: means of equal numbers differ by less
COMMAND_BINS, MIN_BLOCKS_PER_BIN = 20, 5  # of the commands, and blocks in each


@dataclass(frozen=True)
class ChamberFlow:
    """Blocks of a recording: command in V, pressures in Pa, flow into chamber 1 in kg/s, and its area in m^2.

    Areas are positive while charging; NaN where the pressures are too near each other. ``slope`` is that of p1 in Pa/s.
    ``fills``: gas certainly flows in, whatever volume the file states.
    """

    recording: Recording
    u: Array
    p: Array
    supply: Array
    slope: Array
    flow: Array
    area: Array
    fills: Mask


def _check(rig_check: RigCheck) -> Iterator[Finding]:
    """Yield findings of all recordings with a valve."""
    driven = [r for r in rig_check.recordings if r.kind.valve and not r.valve_shut and {"u", "p1"} <= r.signals.keys()]
    flows = [flow for one in driven if (flow := _chamber_flow(one, rig_check)) is not None]
    yield from _unresponsive_pressure(driven, rig_check)
    for flow in flows:
        yield from _supply_below_chamber(flow, rig_check)
    vessels = [one for one in driven if one.kind.vessel]
    for one in vessels:
        yield from _undersampled(one)
    loop = pressure_loop(vessels, rig_check)
    if loop is not None:  # the command sets no area: what asks after areas and their pressures has no answer
        yield loop
        return
    for flow in flows:
        yield from _dead_command(flow)
        yield from _command_direction(flow, rig_check.rig)
        yield from _unrelated_command(flow, rig_check)
    for one in vessels:
        yield from resting_pressure(one, rig_check)
    yield from _implausible_areas(flows)
    yield from _vessel_against_cylinder(flows)


def _chamber_flow(one: Recording, bench: RigCheck) -> ChamberFlow | None:
    cut = bench.blocks(one, "p1", 1)
    if cut is None:
        return None
    rig, slope, p = bench.rig, cut.slope("p1"), cut.mean("p1", 1)
    volume, swept = _volume(one, cut, bench)
    gas = rig.gas_constant * rig.gas_temperature
    compression, displacement = slope * volume / (rig.heat_capacity_ratio * gas), p * swept / gas
    flow = compression + displacement
    none = np.full(cut.count, np.nan if rig.supply_pressure is None else rig.supply_pressure)
    supply = cut.mean("p_supply", 1) if "p_supply" in one else none
    above, below = np.where(flow > 0, supply, p), np.where(flow > 0, p, rig.ambient_pressure)
    ratio = below / np.maximum(above, 1.0)
    per_area = (
        above * np.sqrt(2 / gas) * flow_functions(np.maximum(ratio, 0.0), critical_ratio_of(rig.heat_capacity_ratio))
    )
    is_determined = (ratio < MAX_PRESSURE_RATIO) & (
        np.abs(flow) > MIN_NET_FLOW_SHARE * np.maximum(np.abs(compression), np.abs(displacement))
    )
    area = np.where(is_determined, flow / np.maximum(per_area, 1e-30), np.nan)
    grows = True if one.kind.vessel else cut.slope("x") >= 0.0 if "x" in one else False
    fills = (slope > MIN_RELATIVE_FLOW * np.max(slope)) & grows
    return ChamberFlow(one, cut.mean("u", 1), p, supply, slope, flow, area, fills)


def _volume(one: Recording, cut: Blocks, bench: RigCheck) -> tuple[Array | float, Array | float]:
    """Return chamber 1's volume in m^3 and how fast it grows in m^3/s; NaN where the file does not say it."""
    if one.kind.vessel:
        return bench.rig.vessel_volume or float("nan"), 0.0
    volume = bench.volume(1, cut.mean("x", 1)) if "x" in one else None
    return (float("nan"), 0.0) if volume is None else (volume, bench.rig.piston_areas[0] * cut.slope("x"))


def _unresponsive_pressure(driven: list[Recording], bench: RigCheck) -> Iterator[Finding]:
    """A command at which p1 moves elsewhere moves it here, too, if it is not at the end that the command leads to."""
    swings = {one.name: float(np.nanmax(one["u"]) - np.nanmin(one["u"])) for one in driven}
    answered = [swings[one.name] for one in driven if not bench.is_inactive(one, "p1")]
    for one in driven:
        swing = swings[one.name]
        if not bench.is_inactive(one, "p1") or swing == 0.0 or swing < min(answered, default=0.0):
            continue
        level = float(np.nanmedian(one["p1"]))
        found = f"p1 stays at {format_signal(level, 'p1')} while u changes by {format_signal(swing, 'u')}"
        by = _distance_to_go(one, level, bench)
        if bench.active_signals(one, "p_supply"):
            mend = "exchange the columns in [signals] p1 and p_supply"
            found += ", and p_supply moves instead: swapped?"
            yield from Finding("swapped", "p1", one.name, found, mend, by).judged()
        else:
            mend = "a dead sensor or another column? check column and unit in [signals] p1 and u"
            yield from Finding("silent", "p1", one.name, found, mend, by).judged()


def _distance_to_go(one: Recording, level: float, bench: RigCheck) -> float:
    """Return how far p1 is from the pressures that the commands lead to, in units of its uncertainty."""
    rig, error = bench.rig, bench.pressure_error(one, "p1", level)
    supply = float(np.nanmedian(one["p_supply"])) if "p_supply" in one else rig.supply_pressure
    to_ambient = abs(level - rig.ambient_pressure) / error
    to_supply = to_ambient if supply is None else abs(supply - level) / error
    command = rig.command_sign(one.chamber) * (one["u"] - rig.valve_null)
    if rig.null_free or supply is None:
        return min(to_ambient, to_supply)
    return max(to_supply if np.nanmax(command) > 0 else 0.0, to_ambient if np.nanmin(command) < 0 else 0.0)


def _supply_below_chamber(flow: ChamberFlow, bench: RigCheck) -> Iterator[Finding]:
    """What fills a chamber stands above it, as recorded or as stated: gas that flows in comes from somewhere.

    Where an ejector draws, ambient air fills.
    """
    one = flow.recording
    if bench.rig.source == "ejector" or not flow.fills.any() or not np.isfinite(flow.supply).all():
        return
    p, supply = float(np.median(flow.p[flow.fills])), float(np.median(flow.supply[flow.fills]))
    errors = bench.pressure_error(one, "p1", p), bench.pressure_error(one, "p_supply", supply)
    found = f"p1 is charged at {format_signal(p, 'p1')} from a supply of {format_signal(supply, 'p_supply')}"
    signal = "p_supply" if "p_supply" in one else "p1"
    mend = "check column, unit and reference in [signals] p_supply and p1"
    if signal == "p1":
        mend = "check unit, scale and reference in [signals] p1, and [rig] supply_pressure"
    share = float(np.mean((flow.p > flow.supply)[flow.fills]))
    by = excess(p - supply, *errors)
    yield from Finding("supply", signal, one.name, found, mend, by, share).judged(physics=True)


def _dead_command(flow: ChamberFlow) -> Iterator[Finding]:
    """A command that stays where it is does not charge and vent."""
    area = flow.area[np.isfinite(flow.area)]
    if area.size and np.ptp(flow.u) == 0.0:
        found = f"chamber 1 is charged and vented while u stays at {format_signal(float(flow.u[0]), 'u')}"
        by = excess(min(float(area.max()), -float(area.min())), MAX_LEAK_AREA)
        mend = "a dead channel? check the column in [signals] u"
        yield from Finding("silent", "u", flow.recording.name, found, mend, by).judged()


def _command_direction(flow: ChamberFlow, rig: Rig) -> Iterator[Finding]:
    """The larger u, the more chamber 1 is filled (or port 2 vented).

    Physics is against it where almost all gas flows against the command, so that no delay of a command explains it.
    """
    through = np.abs(flow.area) > MAX_LEAK_AREA
    u, area = flow.u[through], flow.area[through]
    line = fit_linear([u - u.mean(), np.ones_like(u)], area) if u.size else None
    if line is None:
        return
    sense = rig.command_sign(flow.recording.chamber)
    what, does = ("chamber 1", "vented") if sense > 0 else ("port 2", "filled")
    against = sense * (u - rig.valve_null) * area < 0.0
    share = float(np.sum(np.abs(area[against])) / np.sum(np.abs(area)))
    found = f"{what} is {does} the more the larger u is"
    mend = "u > null fills chamber 1: write scale = -1.0 in [signals] u"
    by = excess(-sense * line.factors[0], line.errors[0])
    is_sure = share > MIN_WRONG_SHARE and not rig.null_free
    yield from Finding("direction", "u", flow.recording.name, found, mend, by, share).judged(physics=is_sure)


def _unrelated_command(flow: ChamberFlow, bench: RigCheck) -> Iterator[Finding]:
    """Beside the pressure a command predicts how fast the pressure changes, wherever gas can flow.

    In a full vessel and in an empty one none flows at any command, so these tell nothing. Blocks are predicted from
    others by lines over p1, with and without a line of its own for each level of u.
    """
    one, rig = flow.recording, bench.rig
    error = bench.pressure_error(one, "p1", float(np.median(flow.p)))
    top = np.where(np.isfinite(flow.supply), flow.supply, np.max(flow.p))
    can_flow = (flow.p > rig.ambient_pressure + MIN_DOUBT * error) & (flow.p < top - MIN_DOUBT * error)
    u, p, target = flow.u[can_flow], flow.p[can_flow], flow.slope[can_flow] if one.kind.vessel else flow.flow[can_flow]
    levels = np.unique(np.quantile(u, np.linspace(0.0, 1.0, MAX_LEVELS + 1)[1:-1], method="lower")) if u.size else u
    level = np.searchsorted(levels, u)
    counts = np.bincount(level, minlength=1)
    if u.size < MIN_BLOCKS_PER_LEVEL * MAX_LEVELS or np.count_nonzero(counts >= MIN_BLOCKS_PER_LEVEL) < 2:
        return
    if float(np.ptp(u)) <= ROUNDING * float(np.max(np.abs(u))):
        return  # one command, whose means differ in their last digits
    plain = [np.ones_like(p), p - p.mean()]
    steps = [(level == n).astype(float) for n in range(1, counts.size)]
    without, with_u = prediction_errors(plain, target), prediction_errors([*plain, *steps], target)
    if without.sum() < MIN_UNEXPLAINED * float(np.sum((target - target.mean()) ** 2)):
        return  # the pressure alone says how fast it changes, as through one opening
    gains = (without - with_u) / float(np.mean(without))
    seen = f"{format_signal(float(u.min()), 'u')} to {format_signal(float(u.max()), 'u')}"
    found = f"the flow into chamber 1 has nothing to do with u ({seen})"
    by = excess(MIN_GAIN - float(np.mean(gains)), float(np.std(gains, ddof=1)) / np.sqrt(FOLDS))
    mend = "another column? check the columns in [signals] u and p1"
    yield from Finding("silent", "u", one.name, found, mend, by, float(np.mean(can_flow))).judged()


def _undersampled(one: Recording) -> Iterator[Finding]:
    """A chamber that charges within one sample, by more than in a time constant, is not seen charging."""
    p = one["p1"][np.isfinite(one["p1"])]
    span, step = float(np.ptp(p)), float(np.max(np.abs(np.diff(p)), initial=0.0))
    noise = one.noise_rms("p1")
    if step > max((1 - np.exp(-1.0)) * span, MIN_SIGNAL_TO_NOISE * noise):
        found = f"p1 changes by {format_signal(step, 'p1')} of {format_signal(span, 'p1')} from one sample to the next"
        mend = f"record faster than at {format_plain(1 / one.period, 3)} Hz, or check the unit in [signals] time"
        yield from Finding("sampling", "time", one.name, found, mend, excess(step, noise)).judged()


def _implausible_areas(flows: list[ChamberFlow]) -> Iterator[Finding]:
    """Bounds of what any valve lets through."""
    largest = [(float(np.nanpercentile(np.abs(f.area), 99)), f) for f in flows if np.isfinite(f.area).any()]
    for vessel in (True, False):
        mine = [(area, f) for area, f in largest if (f.recording.kind.vessel) == vessel]
        if not mine:
            continue
        area, flow = max(mine, key=lambda pair: pair[0])
        opened = any(np.ptp(f.u) > 0 for _, f in mine)  # else what flows may be a leak
        outside = max(area / MAX_AREA, MIN_AREA / max(area, 1e-300) if opened else 0.0) - 1.0
        found = f"what flows into chamber 1 needs a hole of {format_quantity(area, 'm^2', 3)}, no valve has one"
        where = "[rig.vessel] volume" if vessel else "dead_volume_1 and piston_area_1 in [rig.cylinder]"
        mend = f"check {where}, and the units in [signals] time and p1"
        by = excess(outside, GEOMETRY_ERROR)
        yield from Finding("volume", "p1", flow.recording.name, found, mend, by).judged()


def _vessel_against_cylinder(flows: list[ChamberFlow]) -> Iterator[Finding]:
    """One valve lets the same through into the vessel as into the cylinder."""
    vessel, cylinder = ([f for f in flows if (f.recording.kind.vessel) == kind] for kind in (True, False))
    if not vessel or not cylinder:
        return
    u, area = (np.concatenate([getattr(f, part) for f in vessel]) for part in ("u", "area"))
    other_u, other = (np.concatenate([getattr(f, part) for f in cylinder]) for part in ("u", "area"))
    edges = np.linspace(min(u.min(), other_u.min()), max(u.max(), other_u.max()), COMMAND_BINS + 1)
    pairs = np.array([_median_areas(edges[i : i + 2], (u, area), (other_u, other)) for i in range(COMMAND_BINS)])
    pairs = pairs[np.isfinite(pairs).all(axis=1)]
    if not pairs.size:
        return
    ratio = float(np.sum(pairs[:, 0] * pairs[:, 1]) / np.sum(pairs[:, 0] ** 2))
    if ratio > 0.0:
        times = format_plain(ratio, 2)
        found = f"the valve lets {times} times as much into the cylinder as into the vessel, at the same commands"
        mend = "check [rig.vessel] volume, and dead_volume_1 and piston_area_1 in [rig.cylinder]"
        by = excess(max(ratio, 1.0 / ratio) / UNIT_SLIP_FACTOR - 1.0, GEOMETRY_ERROR)
        yield from Finding("volume", "p1", cylinder[0].recording.name, found, mend, by).judged()


def _median_areas(edges: Array, *pairs: tuple[Array, Array]) -> list[float]:
    inside = [area[(u >= edges[0]) & (u <= edges[1]) & np.isfinite(area)] for u, area in pairs]
    return [float(np.median(areas)) if areas.size >= MIN_BLOCKS_PER_BIN else float("nan") for areas in inside]


MIN_COMMAND_STEP = 0.005  # of the commands' range: less is noise of a command that is held
MIN_HELD_SAMPLES = 40  # samples at one command, of which the last two tens tell whether p1 still moves
MIN_PRESSURE_TRAVEL = 0.5  # of p1's range: heat moves it less than half of the way
MAX_RESTING_DRIFT = 0.01  # of p1's range, in which p1 rests
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


DETECTOR = Detector(
    _check,
    {
        "supply": (
            "gas flows into a chamber whose pressure is above the supply, recorded or stated",
            "a charged vessel rests far below the supply",
        ),
        "reference": (
            "a vented vessel rests below ambient pressure; a charged one above its supply",
            "a vented vessel rests near twice ambient pressure",
        ),
        "direction": (
            "nearly all gas flows against u",
            "the flow falls with u, not all the time, or with a null that is to be identified",
        ),
        "silent": (
            "",
            "p1 rests far from where a command leads that moves it elsewhere; a chamber is charged and vented at one"
            " u; u does not help to predict dp1/dt beside p1, where gas can flow",
        ),
        "swapped": ("", "p_supply moves instead of p1"),
        "volume": (
            "",
            "the flow needs a hole above 500 mm² or, where u moves, below 0.01 mm²; vessel and cylinder differ "
            "threefold",
        ),
        "pressure-loop": (
            "",
            "a vessel comes to rest where the command says, in a straight line, from above and from below: the valve"
            " controls a pressure, and its command sets no area",
        ),
        "sampling": ("", "less than one sample per time constant of a charge"),
    },
    place=7,
)
