"""Checks of the flow into chamber 1 against commands, supply and volumes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pneucli.physics.gas import critical_ratio_of
from pneucli.physics.vectorised import flow_functions
from pneucli.plausibility.blocks import Blocks, fit_linear, resolved_blocks
from pneucli.plausibility.resting_pressure import max_supply_difference, pressure_loop, resting_pressure
from pneucli.plausibility.rig_check import (
    MIN_SIGNAL_TO_NOISE,
    T_QUANTILE,
    UNIT_SLIP_FACTOR,
    Finding,
    RigCheck,
    format_in_display_unit,
)
from pneucli.recording import Recording, Rig

Array = NDArray[np.float64]

MAX_AREA = 5e-4  # m^2: the bore of a one-inch port, wider than any servo valve
MIN_AREA = 1e-8  # m^2: a hole of 0.1 mm, the smallest orifice of a proportional valve
MAX_PRESSURE_RATIO = 0.9  # pressure ratio above which the flow function is too flat to tell an area
MIN_EXPLAINED_VARIANCE = 0.05  # of the area's variance, below which a command has nothing to do with it
MIN_RELATIVE_FLOW = 0.2  # of the largest flow: heat that goes on after a charge moves less
MAX_LEAK_AREA = (
    1e-7  # m^2: the largest leaks that the catalogue calls typical; what flows beyond goes through the valve
)
MIN_NET_FLOW_SHARE = (
    0.3  # of the flows that compressing and moving ask for: what a wrong volume leaves of two that cancel
)
MAX_COMPRESSED_PERCENTILE = 50.0  # of p1 on an axis: a load may press it above the supply in half of the time
COMMAND_BINS, MIN_BLOCKS_PER_BIN = 20, 5  # of the commands, and blocks in each


@dataclass(frozen=True)
class ChamberFlow:
    """Blocks of a recording: command in V, flow into chamber 1 in kg/s, and the area in m^2 that lets it through.

    Areas are positive while charging; NaN where the pressures are too near each other.
    """

    recording: Recording
    u: Array
    p: Array
    supply: Array
    flow: Array
    area: Array


def check(rig_check: RigCheck) -> Iterator[Finding]:
    """Yield findings of all recordings with a valve."""
    driven = [r for r in rig_check.recordings if r.kind.valve and not r.valve_shut and {"u", "p1"} <= r.signals.keys()]
    flows = [flow for one in driven if (flow := _chamber_flow(one, rig_check)) is not None]
    yield from _unresponsive_pressure(driven, rig_check)
    for flow in flows:
        yield from _supply_below_chamber(flow, rig_check)
    vessels = [one for one in driven if one.kind.vessel]
    for one in driven:
        yield from _above_supply(one, rig_check)
    for one in vessels:
        yield from _undersampled(one)
    loop = pressure_loop(vessels, rig_check)
    if loop is not None:  # the command sets no area: what asks after areas and their pressures has no answer
        yield loop
        return
    for flow in flows:
        yield from _command_direction(flow, rig_check.rig)
    for one in vessels:
        yield from resting_pressure(one, rig_check)
    yield from _implausible_areas(flows)
    yield from _vessel_against_cylinder(flows)


def _chamber_flow(one: Recording, bench: RigCheck) -> ChamberFlow | None:
    cut = resolved_blocks(one, "p1", 1)
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
    return ChamberFlow(one, cut.mean("u", 1), p, supply, flow, area)


def _volume(one: Recording, cut: Blocks, bench: RigCheck) -> tuple[Array | float, Array | float]:
    """Return chamber 1's volume in m^3 and how fast it grows in m^3/s; NaN where the file does not say it."""
    if one.kind.vessel:
        return bench.rig.vessel_volume or float("nan"), 0.0
    volume = bench.volume(1, cut.mean("x", 1)) if "x" in one else None
    return (float("nan"), 0.0) if volume is None else (volume, bench.rig.piston_areas[0] * cut.slope("x"))


def _unresponsive_pressure(driven: list[Recording], bench: RigCheck) -> Iterator[Finding]:
    """A command at which p1 moves elsewhere moves it here, too; where it moves nowhere, no command does anything."""
    swings = {one.name: float(np.nanmax(one["u"]) - np.nanmin(one["u"])) for one in driven}
    answered = [swings[one.name] for one in driven if not bench.is_inactive(one, "p1")]
    for one in driven:
        swing = swings[one.name]
        if not bench.is_inactive(one, "p1") or swing == 0.0 or swing < min(answered, default=0.0):
            continue
        found = (
            f"p1 stays at {format_in_display_unit(float(np.nanmedian(one['p1'])), 'p1')} "
            f"while u changes by {format_in_display_unit(swing, 'u')}"
        )
        other = bench.active_signals(one, "p_supply")
        if other:
            found += ", and p_supply moves instead: swapped?"
            yield Finding("swapped", "p1", one.name, found, "exchange the columns in [signals] p1 and p_supply")
        else:
            mend = "a dead sensor or another column? check column and unit in [signals] p1 and u"
            yield Finding("silent", "p1", one.name, found, mend)


def _supply_below_chamber(flow: ChamberFlow, bench: RigCheck) -> Iterator[Finding]:
    """What charges a chamber stands above it, as recorded or as stated."""
    if not np.isfinite(flow.supply).all():
        return
    charging = flow.flow > MIN_RELATIVE_FLOW * float(np.max(flow.flow))
    if not charging.any():
        return
    p, supply = float(np.median(flow.p[charging])), float(np.median(flow.supply[charging]))
    if p - supply > max_supply_difference(supply, bench):
        found = (
            f"p1 is charged at {format_in_display_unit(p, 'p1')} from "
            f"a supply of {format_in_display_unit(supply, 'p_supply')}"
        )
        if "p_supply" in flow.recording:
            mend = "check column, unit and reference in [signals] p_supply and p1"
            yield Finding("supply", "p_supply", flow.recording.name, found, mend)
        elif not flow.recording.kind.vessel:  # which the next check looks at
            mend = "check unit, scale and reference in [signals] p1, and [rig] supply_pressure"
            yield Finding("supply", "p1", flow.recording.name, found, mend)


def _above_supply(one: Recording, bench: RigCheck) -> Iterator[Finding]:
    """A vessel is filled to the stated supply at most; a piston may press a chamber above it now and then."""
    supply = bench.rig.supply_pressure
    if supply is None or "p_supply" in one:
        return
    highest = float(np.nanpercentile(one["p1"], 99 if one.kind.vessel else MAX_COMPRESSED_PERCENTILE))
    if highest - supply > max_supply_difference(supply, bench):
        reached, stated = format_in_display_unit(highest, "p1"), format_in_display_unit(supply, "p_supply")
        found = f"p1 reaches {reached}, above the supply of {stated}"
        mend = "check unit, scale and reference in [signals] p1, and [rig] supply_pressure"
        yield Finding("supply", "p1", one.name, found, mend)


def _command_direction(flow: ChamberFlow, rig: Rig) -> Iterator[Finding]:
    """The larger u, the more chamber 1 is filled (or port 2 vented); where the null lies does not matter."""
    finite = np.isfinite(flow.area)
    u, area, name = flow.u[finite], flow.area[finite], flow.recording.name
    if u.size < 2 or np.std(area) < MAX_LEAK_AREA:
        return
    if np.ptp(u) == 0.0:
        if area.max() > MAX_LEAK_AREA and area.min() < -MAX_LEAK_AREA:
            found = f"chamber 1 is charged and vented while u stays at {format_in_display_unit(float(u[0]), 'u')}"
            yield Finding("silent", "u", name, found, "a dead channel? check the column in [signals] u")
        return
    line = fit_linear([u - u.mean(), np.ones_like(u)], area)
    if line is None:
        return
    sense = rig.command_sign(flow.recording.chamber)
    if sense * line.factors[0] + T_QUANTILE * line.errors[0] < 0:
        what, does = ("chamber 1", "vented") if sense > 0 else ("port 2", "filled")
        found = f"{what} is {does} the more the larger u is"
        yield Finding("direction", "u", name, found, "u > null fills chamber 1: write scale = -1.0 in [signals] u")
    elif np.corrcoef(u, area)[0, 1] ** 2 < MIN_EXPLAINED_VARIANCE:
        seen = f"{format_in_display_unit(float(u.min()), 'u')} to {format_in_display_unit(float(u.max()), 'u')}"
        found = f"the flow into chamber 1 has nothing to do with u ({seen})"
        yield Finding("silent", "u", name, found, "another column? check the columns in [signals] u and p1")


def _undersampled(one: Recording) -> Iterator[Finding]:
    """A chamber that charges within one sample, by more than in a time constant, is not seen charging."""
    p = one["p1"][np.isfinite(one["p1"])]
    span, step = float(np.ptp(p)), float(np.max(np.abs(np.diff(p)), initial=0.0))
    noise = one.noise["p1"].rms if "p1" in one.noise else 0.0
    if step > max((1 - np.exp(-1.0)) * span, MIN_SIGNAL_TO_NOISE * noise):
        found = (
            f"p1 changes by {format_in_display_unit(step, 'p1')} of "
            f"{format_in_display_unit(span, 'p1')} from one sample to the next"
        )
        mend = f"record faster than at {1 / one.period:.3g} Hz, or check the unit in [signals] time"
        yield Finding("sampling", "time", one.name, found, mend)


def _implausible_areas(flows: list[ChamberFlow]) -> Iterator[Finding]:
    """Bounds of what any valve lets through."""
    largest = [(float(np.nanpercentile(np.abs(f.area), 99)), f) for f in flows if np.isfinite(f.area).any()]
    for vessel in (True, False):
        mine = [(area, f) for area, f in largest if (f.recording.kind.vessel) == vessel]
        if not mine:
            continue
        area, flow = max(mine, key=lambda pair: pair[0])
        opened = any(np.ptp(f.u) > 0 for _, f in mine)  # else what flows may be a leak
        if area > MAX_AREA or (opened and area < MIN_AREA):
            found = f"what flows into chamber 1 needs a hole of {area * 1e6:.3g} mm^2, no valve has one"
            where = "[rig.vessel] volume" if vessel else "dead_volume_1 and piston_area_1 in [rig.cylinder]"
            mend = f"check {where}, and the units in [signals] time and p1"
            yield Finding("volume", "p1", flow.recording.name, found, mend)


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
    if ratio > UNIT_SLIP_FACTOR or 0 < ratio < 1 / UNIT_SLIP_FACTOR:
        found = f"the valve lets {ratio:.2g} times as much into the cylinder as into the vessel, at the same commands"
        mend = "check [rig.vessel] volume, and dead_volume_1 and piston_area_1 in [rig.cylinder]"
        yield Finding("volume", "p1", cylinder[0].recording.name, found, mend)


def _median_areas(edges: Array, *pairs: tuple[Array, Array]) -> list[float]:
    inside = [area[(u >= edges[0]) & (u <= edges[1]) & np.isfinite(area)] for u, area in pairs]
    return [float(np.median(areas)) if areas.size >= MIN_BLOCKS_PER_BIN else float("nan") for areas in inside]
