"""Checks of single readings: what no gas can show, what is at ambient pressure, and what is beyond the usual."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pneucli.messages.formatting import format_plain, format_signal
from pneucli.plausibility.detectors import Detector
from pneucli.plausibility.rig_check import (
    AMBIENT_SLIP_SHARE,
    MIN_DOUBT,
    PRESSURE_GAIN,
    PRESSURE_ZERO,
    PRESSURES,
    Finding,
    RigCheck,
    excess,
)
from pneucli.quantities import axis_unit
from pneucli.recording import Recording

MAX_PRESSURE = 50e5  # Pa: compressed air ends at 16 bar, blow moulding at 40 bar
# Pa above or below ambient: a blower's; less is a unit, or a mark between thousands that was not seen
MIN_SUPPLY = 0.05e5
MAX_COMMAND = 120.0  # V: extra-low voltage ends there (IEC 61140)
MAX_FLOW = 6.0  # kg/s: 5 cm^2, the bore of a one-inch port, at 50 bar and 293 K (A p 0.0404 / sqrt(T), choked)
MAX_STROKE = 12.0  # m: rodless cylinders end at 10 m
USUAL_LIMITS = {  # of the readings by signal, and what usually ends there
    **dict.fromkeys(PRESSURES, (MAX_PRESSURE, "pneumatic supplies have")),
    **dict.fromkeys(("u", "u2"), (MAX_COMMAND, "the electronics of valves take")),
    "flow": (MAX_FLOW, "the valves of rigs let through"),
}
MIN_AMBIENT_PRESSURE, MAX_AMBIENT_PRESSURE = 0.5e5, 1.1e5  # Pa: at 5,500 m, and 600 m below the sea
MIN_ROOM_TEMPERATURE, MAX_ROOM_TEMPERATURE = 200.0, 400.0  # K


def _check(rig_check: RigCheck) -> Iterator[Finding]:
    """Yield findings of all recordings."""
    yield from _surroundings(rig_check)
    for one in rig_check.recordings:
        yield from _beyond_usual(one, rig_check)
        for signal in PRESSURES:
            if signal in one:
                yield from _pressure(one, signal, rig_check)
        yield from _temperature(one, rig_check)


def reference_finding(is_meant: str, one: Recording, signal: str, found: str, by: float, share: float = 1.0) -> Finding:
    """Return the finding that a signal counts from ambient pressure ("gauge") or vacuum; ``by`` is its excess."""
    mend = f'write reference = "{is_meant}" in [signals] {signal}'
    return Finding("reference", signal, one.name, f"{found}: {is_meant}?", mend, by, share)


def _surroundings(bench: RigCheck) -> Iterator[Finding]:
    rig, name = bench.rig, bench.recordings[0].name
    if not MIN_AMBIENT_PRESSURE < rig.ambient_pressure < MAX_AMBIENT_PRESSURE:
        found = f"ambient_pressure is {format_signal(rig.ambient_pressure, 'p1')}, as in no laboratory"
        mend = 'write the air pressure in [rig] ambient_pressure, such as "1.013 bar"'
        by = _times_outside(rig.ambient_pressure, MIN_AMBIENT_PRESSURE, MAX_AMBIENT_PRESSURE)
        yield Finding("rig", "p1", name, found, mend, by)
    if not MIN_ROOM_TEMPERATURE < rig.gas_temperature < MAX_ROOM_TEMPERATURE:
        found = f"gas_temperature is {format_plain(rig.gas_temperature, 4)} K"
        mend = 'write its unit in [rig] gas_temperature, such as "20 degC"'
        by = _times_outside(rig.gas_temperature, MIN_ROOM_TEMPERATURE, MAX_ROOM_TEMPERATURE)
        yield Finding("rig", "temperature", name, found, mend, by)


def _times_outside(value: float, low: float, high: float) -> float:
    """Return by how many of its usual widths a value lies outside a usual range."""
    return max(low - value, value - high) / (high - low)


def _beyond_usual(one: Recording, bench: RigCheck) -> Iterator[Finding]:
    """What the file states wins over what rigs usually have."""
    supply, stroke = bench.rig.supply_pressure or 0.0, bench.rig.stroke
    for signal, (limit, usual) in USUAL_LIMITS.items():
        if signal in one:
            most = float(np.nanpercentile(np.abs(one[signal]), 99))
            limit = max(limit, supply) if signal in PRESSURES else limit  # noqa: PLW2901 - of this recording
            found = f"{signal} reaches {format_signal(most, signal)}, "
            found += f"more than {usual} ({format_signal(limit, signal)})"
            mend = f"check column, unit and scale in [signals] {signal}"
            yield from Finding(
                "unit", signal, one.name, found, mend, excess(most / limit - 1.0, PRESSURE_GAIN)
            ).judged()
    if "p_supply" in one and one.kind.valve and not one.valve_shut:
        ambient, most = bench.rig.ambient_pressure, float(np.nanmax(one["p_supply"]))
        found = f"p_supply is {format_signal(most, 'p_supply')} at most, which hardly differs from ambient pressure"
        furthest = max(float(np.nanmax(np.abs(one[name] - ambient))) for name in PRESSURES if name in one)
        by = excess(MIN_SUPPLY - furthest, PRESSURE_ZERO * ambient)  # a chamber may be vented into a supply that is off
        mend = "check column, unit and reference in [signals] p_supply, and thousands where marks part them"
        yield from Finding("unit", "p_supply", one.name, found, mend, by).judged()
    if "x" in one and stroke is None and axis_unit("m") == "m":  # an angle may turn for ever
        travel = float(np.ptp(np.nanpercentile(one["x"], (0.1, 99.9))))
        longest = format_signal(MAX_STROKE, "x")
        found = f"x travels {format_signal(travel, 'x')}, further than any cylinder's stroke ({longest})"
        by = excess(travel / MAX_STROKE - 1.0, PRESSURE_GAIN)
        yield from Finding("unit", "x", one.name, found, "check unit and scale in [signals] x", by).judged()


def _pressure(one: Recording, signal: str, bench: RigCheck) -> Iterator[Finding]:
    """A chamber behind a valve rests at ambient pressure or above; a closed one or an ejector's may be drawn below
    it, not below 0.
    """
    ambient, values = bench.rig.ambient_pressure, one[signal]
    least, quarter, middle = (float(p) for p in np.nanpercentile(values, (1, 25, 50)))
    is_drawn = bench.rig.source == "ejector" or (signal == "p2" and one.chamber_2 == "closed")
    below_vacuum = excess(-least, bench.pressure_error(one, signal, least))
    if signal == "p2" and one.chamber_2 == "open":
        yield from _open_chamber(one, middle, bench)
    elif below_vacuum >= MIN_DOUBT:
        found = f"{signal} goes down to {format_signal(least, signal)} absolute, below vacuum"
        mend = f"check unit, offset and reference in [signals] {signal}"
        share = float(np.nanmean(values < 0.0))
        yield from Finding("reference", signal, one.name, found, mend, below_vacuum, share).judged(physics=True)
    elif least < 0.0 or (quarter < (1 - AMBIENT_SLIP_SHARE) * ambient and not is_drawn):
        seen, share = (least, 0.01) if least < 0.0 else (quarter, 0.25)
        verb, time = ("goes down to", "") if least < 0.0 else ("is", " or less for a quarter of the time")
        found = f"{signal} {verb} {format_signal(seen, signal)} absolute{time}"
        by = excess(ambient - seen, bench.pressure_error(one, signal, seen))
        yield from reference_finding("gauge", one, signal, found, by, share).judged()


def _open_chamber(one: Recording, middle: float, bench: RigCheck) -> Iterator[Finding]:
    ambient, error = bench.rig.ambient_pressure, bench.pressure_error(one, "p2", middle)
    shown, by = 0.0 if abs(middle) < error else middle, abs(middle - ambient) / error
    found = f"p2 rests at {format_signal(shown, 'p2')} in an open chamber"
    share = float(np.nanmean(np.abs(one["p2"] - ambient) > AMBIENT_SLIP_SHARE * ambient))
    if middle < ambient:
        yield from reference_finding("gauge", one, "p2", found, by, share).judged(physics=True)
    elif middle < (2 + AMBIENT_SLIP_SHARE) * ambient:
        yield from reference_finding("absolute", one, "p2", found, by, share).judged(physics=True)
    else:
        mend = f'p1 and p2 swapped, or not chamber_2 = "open" in [[recordings]] {one.name}'
        yield from Finding("swapped", "p2", one.name, found, mend, by, share).judged(physics=True)


def _temperature(one: Recording, bench: RigCheck) -> Iterator[Finding]:
    """Between the isentropic discharge from the highest pressure and the charge of an empty vessel, kappa T."""
    if "temperature" not in one:
        return
    rig, kappa = bench.rig, bench.rig.heat_capacity_ratio
    least, most = np.nanpercentile(one["temperature"], (1, 99))
    highest = max(float(np.nanmax(one["p1"])), rig.ambient_pressure) if "p1" in one else MAX_PRESSURE
    coldest = rig.gas_temperature * (rig.ambient_pressure / highest) ** ((kappa - 1) / kappa)
    hottest = kappa * rig.gas_temperature
    if least < coldest or most > hottest:
        found = f"temperature goes from {format_plain(least, 3)} K to {format_plain(most, 3)} K; "
        found += f"air at these pressures stays between {format_plain(coldest, 3)} K and {format_plain(hottest, 3)} K"
        noise = one.noise_rms("temperature")
        by = excess(max(coldest - least, most - hottest), noise, PRESSURE_GAIN * (hottest - coldest))
        mend = "check the unit in [signals] temperature, degC or K"
        yield from Finding("unit", "temperature", one.name, found, mend, by).judged()


DETECTOR = Detector(
    _check,
    {
        "reference": (
            "a pressure goes below vacuum; p2 of an open chamber is not at ambient pressure",
            "a chamber is below half of ambient pressure for a quarter of the time",
        ),
        "swapped": ("p2 of an open chamber stands at several bar", ""),
        "unit": (
            "",
            "pressures above 50 bar and the stated supply, a supply within 0.05 bar of ambient, "
            "commands above 120 V, flows above 6 kg/s, x over more "
            "than 12 m where no stroke is stated, temperatures that air cannot have at these pressures",
        ),
        "rig": ("", "ambient pressure or gas temperature that no laboratory has"),
    },
    steady=True,
    place=1,
)
