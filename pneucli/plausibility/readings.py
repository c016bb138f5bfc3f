"""Checks of single readings: what no rig can show, and what stands at ambient pressure."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pneucli.plausibility.rig_check import (
    AMBIENT_SLIP_SHARE,
    UNIT_SLIP_FACTOR,
    Finding,
    RigCheck,
    format_in_display_unit,
)
from pneucli.recording import Recording

PRESSURES = ("p_supply", "p1", "p2")
MAX_PRESSURE = 50e5  # Pa: compressed air ends at 16 bar, blow moulding at 40 bar
MAX_COMMAND = 120.0  # V: extra-low voltage ends there (IEC 61140)
MIN_AMBIENT_PRESSURE, MAX_AMBIENT_PRESSURE = 0.5e5, 1.1e5  # Pa: at 5,500 m, and 600 m below the sea
MIN_ROOM_TEMPERATURE, MAX_ROOM_TEMPERATURE = 200.0, 400.0  # K


def check(rig_check: RigCheck) -> Iterator[Finding]:
    """Yield findings of all recordings."""
    yield from _surroundings(rig_check)
    for one in rig_check.recordings:
        for signal in PRESSURES:
            if signal in one:
                yield from _pressure(one, signal, rig_check)
        yield from _command(one)
        yield from _flow(one)
        yield from _temperature(one, rig_check)
        yield from _supply(one, rig_check)


def gauge_finding(one: Recording, signal: str, found: str) -> Finding:
    """Return the finding that a signal counts from ambient pressure."""
    return Finding(
        "reference", signal, one.name, f"{found}: gauge?", f'write reference = "gauge" in [signals] {signal}'
    )


def absolute_finding(one: Recording, signal: str, found: str) -> Finding:
    """Return the finding that a signal counts from vacuum."""
    mend = f'write reference = "absolute" in [signals] {signal}'
    return Finding("reference", signal, one.name, f"{found}: absolute?", mend)


def _surroundings(bench: RigCheck) -> Iterator[Finding]:
    rig, name = bench.rig, bench.recordings[0].name
    if not MIN_AMBIENT_PRESSURE < rig.ambient_pressure < MAX_AMBIENT_PRESSURE:
        found = (
            f"ambient_pressure is {format_in_display_unit(rig.ambient_pressure, 'p1')}, "
            "which is nowhere in a laboratory"
        )
        yield Finding("rig", "p1", name, found, 'write the air pressure in [rig] ambient_pressure, such as "1.013 bar"')
    if not MIN_ROOM_TEMPERATURE < rig.gas_temperature < MAX_ROOM_TEMPERATURE:
        found = f"gas_temperature is {rig.gas_temperature:.4g} K"
        yield Finding("rig", "temperature", name, found, 'write its unit in [rig] gas_temperature, such as "20 degC"')


def _pressure(one: Recording, signal: str, bench: RigCheck) -> Iterator[Finding]:
    """A chamber behind a valve rests at ambient pressure or above; a closed one may be drawn below it, not below 0."""
    ambient = bench.rig.ambient_pressure
    least, quarter, middle, most = np.nanpercentile(one[signal], (1, 25, 50, 99))
    is_open = signal == "p2" and one.chamber_2 == "open"
    closed = signal == "p2" and one.chamber_2 == "closed"
    if is_open and abs(middle - ambient) > AMBIENT_SLIP_SHARE * ambient:
        yield from _open_chamber(one, middle, ambient)
    elif quarter < (1 - AMBIENT_SLIP_SHARE) * ambient and not closed:
        yield gauge_finding(
            one,
            signal,
            f"{signal} is {format_in_display_unit(quarter, signal)} absolute or less for a quarter of the time",
        )
    elif -AMBIENT_SLIP_SHARE * ambient < least < 0:
        yield gauge_finding(one, signal, f"{signal} goes down to {format_in_display_unit(least, signal)} absolute")
    elif least < 0:
        found = f"{signal} goes down to {format_in_display_unit(least, signal)} absolute, below vacuum"
        yield Finding("reference", signal, one.name, found, f"check unit, offset and reference in [signals] {signal}")
    if most > MAX_PRESSURE:
        found = (
            f"{signal} reaches {format_in_display_unit(most, signal)}, above any "
            f"pneumatic supply ({format_in_display_unit(MAX_PRESSURE, signal)})"
        )
        yield Finding("unit", signal, one.name, found, f"check unit and scale in [signals] {signal}")


def _open_chamber(one: Recording, middle: float, ambient: float) -> Iterator[Finding]:
    found = f"p2 rests at {format_in_display_unit(middle, 'p2')} in an open chamber"
    if middle < ambient:
        yield gauge_finding(one, "p2", found)
    elif middle < (2 + AMBIENT_SLIP_SHARE) * ambient:
        yield absolute_finding(one, "p2", found)
    else:
        mend = f'p1 and p2 swapped, or not chamber_2 = "open" in [[recordings]] {one.name}'
        yield Finding("swapped", "p2", one.name, found, mend)


MAX_FLOW = 6.0  # kg/s: 5 cm^2, the bore of a one-inch port, at 50 bar and 293 K (A p 0.0404 / sqrt(T), choked)


def _flow(one: Recording) -> Iterator[Finding]:
    if "flow" in one and (most := float(np.nanmax(np.abs(one["flow"])))) > MAX_FLOW:
        found = f"flow reaches {most:.3g} kg/s, more than any valve of a rig lets through ({MAX_FLOW:.3g} kg/s)"
        yield Finding("unit", "flow", one.name, found, "check unit and scale in [signals] flow")


def _command(one: Recording) -> Iterator[Finding]:
    for signal in ("u", "u2"):
        if signal in one and (most := float(np.nanmax(np.abs(one[signal])))) > MAX_COMMAND:
            found = (
                f"{signal} reaches {format_in_display_unit(most, signal)}, "
                "more than a valve's electronics take: mV, or another column?"
            )
            yield Finding("unit", signal, one.name, found, f"check column and unit in [signals] {signal}")


def _temperature(one: Recording, bench: RigCheck) -> Iterator[Finding]:
    """Between the isentropic discharge from the highest pressure and the charge of an empty vessel, kappa T."""
    if "temperature" not in one:
        return
    rig, kappa = bench.rig, bench.rig.heat_capacity_ratio
    least, most = np.nanpercentile(one["temperature"], (1, 99))
    highest = max(float(np.nanmax(one["p1"])), rig.ambient_pressure) if "p1" in one else MAX_PRESSURE
    coldest = rig.gas_temperature * (rig.ambient_pressure / highest) ** ((kappa - 1) / kappa)
    if least < coldest or most > kappa * rig.gas_temperature:
        found = f"temperature goes from {least:.3g} K to {most:.3g} K; "
        found += f"air at these pressures stays between {coldest:.3g} K and {kappa * rig.gas_temperature:.3g} K"
        mend = "check the unit in [signals] temperature, degC or K"
        yield Finding("unit", "temperature", one.name, found, mend)


def _supply(one: Recording, bench: RigCheck) -> Iterator[Finding]:
    """The regulator's setting and what was recorded may differ, but not by a unit."""
    stated, ambient = bench.rig.supply_pressure, bench.rig.ambient_pressure
    if stated is None or "p_supply" not in one or one.valve_shut:
        return
    read = float(np.nanmedian(one["p_supply"]))
    ratio = max(read - ambient, 0.0) / max(stated - ambient, 1.0)
    if stated - ambient > 0 and not 1 / UNIT_SLIP_FACTOR < ratio < UNIT_SLIP_FACTOR:
        found = (
            f"p_supply is {format_in_display_unit(read, 'p_supply')}, "
            f"and {format_in_display_unit(stated, 'p_supply')} are stated"
        )
        mend = "check column, unit and reference in [signals] p_supply, and [rig] supply_pressure"
        yield Finding("supply", "p_supply", one.name, found, mend)
