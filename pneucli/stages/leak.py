"""``leak``: a leak test of a shut vessel, from raw files or a pipeline file, in the units of the trade."""

import math
import re
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.arrays import Array
from pneucli.errors import InputError, UnitError
from pneucli.figure import Figure, named
from pneucli.identify.leak_rate import FLOW_UNIT, normal_flow
from pneucli.identify.leak_test import MIN_BLOCKS, SPREAD, LeakFit, fit_leak, settling_time, shut_stretch
from pneucli.messages.formatting import format_quantity
from pneucli.messages.leak import Answer, Bound, LeakTest
from pneucli.physics.gas import critical_ratio_of, flow_constant, orifice_flow
from pneucli.recording import Recording, Rig
from pneucli.stages import init
from pneucli.stages.look import read_pipeline, write_pipeline
from pneucli.units import parse_quantity, parse_unit, read_quantity

SCHEMA = "pneucli/leak/1"
OPEN_SHARE = 0.02  # of the largest command, beyond which a valve is open
MAX_POINTS = 400  # of a curve
OF_LIMITS = {"kg/s": "flow", "m^3/s": "flow", "Pa/s": "rate", "Pa m^3/s": "throughput", "m^2": "area"}
UNITS = {"rate": "Pa/s", "flow": FLOW_UNIT, "area": "m^2", "throughput": "Pa m^3/s"}


def leak_test(
    files: Sequence[Path], *, volume: str | None = None, limit: str | None = None, drift: str = "0.1 K", **stated: Any
) -> Answer:
    """Return the leaks of shut vessels.

    Args:
        files: Raw files, or one pipeline file, whose ``[rig]`` then states gas, ambient pressure and volume.
        volume: The vessel's volume, with its unit.
        limit: The largest leak that passes: a flow (of air at 100 kPa and 20 degC where no state is stated), a loss of
            pressure over time, that times the volume, or an area.
        drift: Standard uncertainty of the change of the wall's temperature during the test.
        stated: How texts are written, as ``init`` takes it.

    Returns:
        The answer that ``--json`` prints.

    Raises:
        InputError: as ``init`` and ``ingest`` do, where a quantity cannot be read, or where no vessel is shut.

    """
    size = None if volume is None else _quantity("--volume", volume, "m^3")
    wall = _quantity("--drift", drift, "K", difference=True)
    stated_rig = len(files) == 1 and files[0].suffix == ".toml"
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "leak"
        pipeline = files[0] if stated_rig else _written(folder, files, stated)
        folder.mkdir(exist_ok=True)
        try:
            _, recordings, rig = read_pipeline(pipeline, folder)
        except InputError as error:
            where = error.where if stated_rig else str(files[0])
            raise replace(error, where=where, faults=()) from error
    size = size or rig.vessel_volume
    bound = None if limit is None else _limit(limit, size)
    null = rig.valve_null if stated_rig else None
    found = {one.name: _test(one, rig, size, wall, null=null) for one in recordings}
    left = [f"{name}: {one}" for name, one in found.items() if isinstance(one, str)]
    tests = [_judged(one, bound) for one in found.values() if isinstance(one, LeakTest)]
    if not tests:
        raise InputError(
            str(files[0]), left[0] if left else "no recording", "a vessel that is shut and above or below ambient",
            "record the pressure from filling on, and wait", code="E063",
        )  # fmt: skip
    worst = next((one for one in ("fail", "undecided", "pass") if one in {test.verdict for test in tests}), None)
    return Answer(SCHEMA, size, rig.ambient_pressure, rig.gas_temperature, wall, bound, tests, left, worst)


def _written(folder: Path, files: Sequence[Path], stated: dict[str, Any]) -> Path:
    """Write a pipeline file for raw files, in which a vessel without a recorded command is shut; return its path."""
    write_pipeline(folder, files, **stated)
    pipeline = folder / init.NAME
    content = pipeline.read_text(encoding="utf-8")
    if not re.search(r"^(u|valve) += ", content, re.MULTILINE):
        content = content.replace('experiment = "valve"', 'experiment = "valve"\nvalve = "shut"')
    pipeline.write_text(content, encoding="utf-8")
    return pipeline


def _quantity(option: str, text: str, unit: str, *, difference: bool = False) -> float:
    found = read_quantity(text, unit, option, "E001", difference=difference)
    if not found >= 0.0:
        raise InputError(option, f'"{text}"', "a quantity that is not negative", code="E001")
    return found


def _limit(text: str, volume: float | None) -> Bound:
    """Return the limit: its text, the quantity it bounds, and its size in that quantity's unit."""
    unit = next((one for one in OF_LIMITS if _measures(text, one)), None)
    if unit is None:
        raise InputError(
            "--limit", f'"{text}"', 'a leak, such as "0.5 l/min", "20 Pa/s", "1 mbar l/s" or "0.01 mm^2"', code="E001"
        )
    kind, size = OF_LIMITS[unit], _quantity("--limit", text, unit)
    if kind != "rate" and volume is None:
        raise InputError(
            "--limit", f'"{text}" without a volume', "the vessel's volume", 'state it: --volume "2 l"', code="E001"
        )
    per_litre = parse_unit(FLOW_UNIT).factor
    size = size / per_litre if unit == "kg/s" else size / parse_unit("l/min").factor if unit == "m^3/s" else size
    return Bound(text, kind, size, UNITS[kind])


def _measures(text: str, unit: str) -> bool:
    try:
        parse_quantity(text, unit)
    except UnitError:
        return False
    return not text.replace(".", "").strip().isdigit()


def _test(one: Recording, rig: Rig, volume: float | None, drift: float, null: float | None) -> LeakTest | str:
    """Return the leak of one recording, or why it is none; ``null`` is the command that shuts the valve, if known."""
    name = next((signal for signal in ("p1", "p2") if signal in one), None)
    if name is None:
        return "no pressure"
    known = np.isfinite(one[name])
    time, p = one.time[known], one[name][known]
    command = one["u"][known] if "u" in one and not one.valve_shut else None
    stretch = shut_stretch(p, rig.ambient_pressure, command) if p.size >= MIN_BLOCKS else None
    if stretch is None or stretch.stop - stretch.start < MIN_BLOCKS:
        return "nowhere does a shut vessel lose pressure"
    shut = slice(stretch.start, stretch.stop)
    settling = settling_time(float(p[stretch.start]), volume, rig.gas_temperature)
    if reason := _no_test(time[shut], command, shut, null, settling):
        return reason
    measured = "temperature" in one
    if measured:  # as if the gas had kept its mean temperature: what is left to the wall is nothing
        gas = np.interp(time, one.time, one["temperature"])
        p = p * float(np.mean(gas[shut])) / gas
    wall = {"temperature": rig.gas_temperature, "drift": 0.0 if measured else drift, "kappa": rig.heat_capacity_ratio}
    fit = fit_leak(time[shut], p[shut], rig.ambient_pressure, volume=volume, **wall)
    rest = float(np.median(p[stretch.rest : stretch.start])) if stretch.rest < stretch.start else None
    shown = np.linspace(0, p.size - 1, min(p.size, MAX_POINTS)).astype(int)
    return LeakTest(
        recording=one.name,
        signal=name,
        rest=rest,
        shut=[float(time[stretch.start]), float(time[stretch.stop - 1])],
        fitted_from=fit.start,
        pressure=fit.pressure,
        pressure_end=float(fit.curve[-1, 1]),
        **_rates(fit, rig, volume),
        law=fit.law,
        laminar_share=fit.laminar,
        **named(fit, "warmed settling misfit"),
        temperature_measured=measured,
        drift_half_width=fit.drift,
        time=time[shown].tolist(),
        values=p[shown].tolist(),
        model=fit.curve[:, [0, 2]].tolist(),
    )


def _no_test(time: Array, command: Array | None, shut: slice, null: float | None, settling: float) -> str:
    """Return why a stretch is no leak test; empty where it is one."""
    if command is not None and null is not None:
        off = abs(float(np.median(command[shut])) - null)
        if off > OPEN_SHARE * float(np.max(np.abs(command - null))):
            return "the valve is open where the vessel loses pressure"
    seconds = float(np.ptp(time))
    if seconds >= settling * math.exp(-SPREAD):
        return ""
    told, needed = (format_quantity(one, "s", 2) for one in (seconds, settling))
    return f"shut for {told}: the gas takes about {needed} to come to the wall's temperature"


def _rates(fit: LeakFit, rig: Rig, volume: float | None) -> dict[str, Any]:
    """Return the leak at the first pressure as a rate, a flow, an area and a throughput, each with its interval.

    Out of a vessel above ambient, and into one below, it counts as positive.
    """
    sign = 1.0 if fit.pressure >= rig.ambient_pressure else -1.0
    rate, ends = sign * fit.rate.value, sorted((sign * fit.rate.low, sign * fit.rate.high))
    high, low = max(fit.pressure, rig.ambient_pressure), min(fit.pressure, rig.ambient_pressure)
    choked = flow_constant(rig.gas_constant, rig.gas_temperature, rig.heat_capacity_ratio)
    flux = orifice_flow(high, low, critical_ratio_of(rig.heat_capacity_ratio), choked, choked)
    per_rate = None if volume is None else volume / (rig.gas_constant * rig.gas_temperature)
    factors = {
        "rate": 1.0,
        "flow": None if per_rate is None else normal_flow(per_rate, rig),
        "area": None if per_rate is None else per_rate / flux,
        "throughput": volume,
    }
    return {
        name: None if factor is None else Figure(factor * rate, factor * ends[0], factor * ends[1], UNITS[name])
        for name, factor in factors.items()
    }


def _judged(found: LeakTest, limit: Bound | None) -> LeakTest:
    """Return a test with whether it passes, and for how long one must test that did not decide."""
    own: Figure | None = None if limit is None else getattr(found, limit.quantity)
    if limit is None or own is None:
        return found
    low, high = own.low, own.high
    verdict = "pass" if high <= limit.value else "fail" if low > limit.value else "undecided"
    room, seconds = abs(own.value - limit.value), found.shut[1] - found.fitted_from
    needed = seconds * 0.5 * (high - low) / room if verdict == "undecided" and room else math.inf
    return replace(found, verdict=verdict, seconds_to_decide=needed if math.isfinite(needed) else None)
