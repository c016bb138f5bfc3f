"""Two hundred files as recorders write them, at the front door: ``python -m benchmarks.door [SEED ...]``.

A tank behind a valve whose truth is known is written in each of the ways below and in pairs of ways of different kinds,
drawn by seed. Each file goes through ``init`` and ``ingest``; what a user knows of the rig is filled in. A recording is
right where command and pressures are those of the truth, marked where ``init`` says CHECK, told where ``ingest`` says
something of the signal, asked where a ``?`` waits, refused, or wrong in silence. Printed: the verdicts by way, and how
many are wrong in silence. ``--small`` takes each way once.
"""

import datetime
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from benchmarks.door_pages import FURTHER_LAYOUTS, RATE, START, Sheet, stamps, write
from pneucli.arrays import Array
from pneucli.config import load
from pneucli.errors import InputError
from pneucli.pipeline.graph import Context
from pneucli.stages import ingest, init

COUNT, SUPPLY, AMBIENT = 700, 7.013e5, 1.013e5  # rows, Pa
NOISE = 400.0  # Pa
SITUATIONS = 200  # of a seed: half of them ways by themselves, half pairs
WRONG = "wrong in silence"
VERDICTS = (WRONG, "fault", "refused", "asked", "marked", "told", "right")
FILL_IN = {"bar": "7.013", "l": "0.16", "V": "5"}


def tank(rng: np.random.Generator, count: int = COUNT) -> tuple[Array, dict[str, Array]]:
    """Return a clock and the readings of a tank of 160 cm^3 behind a valve of 1.6 mm^2 at 10 V, isothermal."""
    edges = np.cumsum(rng.uniform(0.3, 0.9, 60))
    levels = rng.choice([-10, -8, -6, -4, 3, 5, 7, 9, 10], 60)
    levels[0] = 5
    time = np.arange(count) / RATE
    u = levels[np.searchsorted(edges, time)].astype(float)
    p, readings = AMBIENT, np.empty(count)
    for n in range(count):
        readings[n] = p
        for _ in range(10):
            area = 1.6e-6 * abs(u[n]) / 10.0
            up, down = (SUPPLY, p) if u[n] > 0 else (p, AMBIENT)
            ratio = max(down / up, 0.528)
            flow = 0.0404 * area * up / np.sqrt(293.15) * np.sqrt(max(1.0 - ((ratio - 0.528) / 0.472) ** 2, 0.0))
            p += (1.0 if u[n] > 0 else -1.0) * flow * 287.0 * 293.15 / 160e-6 * 0.1 / RATE
    noisy = {"p1": readings + NOISE * rng.standard_normal(count)}
    noisy["p_supply"] = SUPPLY + NOISE * rng.standard_normal(count)
    return time, {"u": u, **noisy}


def plain(rng: np.random.Generator) -> Sheet:
    """Return the usual sheet: absolute pressures in bar(a), a command in V, a clock in s."""
    time, values = tank(rng)
    bar = ("bar(a)", 1e5, 0.0)
    sheet = Sheet(time, values, [values], rng, units={"u": ("V", 1.0, 0.0), "p_supply": bar, "p1": bar})
    sheet.clock = {"Time [s]": [f"{t:.3f}" for t in time]}
    return sheet


# ---- ways of a clock


def _date_and_time_and_part(sheet: Sheet) -> None:
    name, per = [("Millitm", 1e3), ("ms", 1e3), ("Fraction [us]", 1e6), ("hundredths", 1e2)][int(sheet.rng.integers(4))]
    parts = [f"{np.floor((t % 1.0) * per + 1e-6):.0f}" for t in sheet.time]
    sheet.clock = {"Date": stamps(sheet, "%m/%d/%Y"), "Time": stamps(sheet, "%H:%M:%S"), name: parts}


def _hours_minutes_seconds(sheet: Sheet) -> None:
    seconds = [f"{(2.0 + t) % 60:.3f}" for t in sheet.time]
    sheet.clock = {"Hour": ["9"] * sheet.time.size, "Minute": ["15"] * sheet.time.size, "Second": seconds}


def _told_as(name: str, form: str, *, cut: int = -3, late: float = 0.0, end: str = "") -> Callable[[Sheet], None]:
    """Return the way of one column of stamps, cut to milliseconds; the first of them ``late`` seconds after START."""

    def way(sheet: Sheet) -> None:
        texts = stamps(sheet, form, START + datetime.timedelta(seconds=late))
        sheet.clock = {name: [text[:cut] + end if cut else text + end for text in texts]}

    return way


def _number_as(name: str, form: str, one: float, first: float = 0.0) -> Callable[[Sheet], None]:
    """Return the way of a column of numbers, of which ``one`` is a second."""

    def way(sheet: Sheet) -> None:
        sheet.clock = {name: [form.format(first + one * t) for t in sheet.time]}

    return way


def _numbered_rows(name: str, *above: str) -> Callable[[Sheet], None]:
    def way(sheet: Sheet) -> None:
        sheet.clock, sheet.above = {name: [str(n + 1) for n in range(sheet.time.size)]}, above

    return way


def _seconds_and_nanoseconds(sheet: Sheet) -> None:
    ticks = [round(1e9 * t / 1e7) * 10_000_000 for t in sheet.time]
    seconds, parts = [f"{1_773_220_502 + t // 10**9}" for t in ticks], [f"{t % 10**9}" for t in ticks]
    sheet.clock = {"header.stamp.sec": seconds, "header.stamp.nanosec": parts}


def _durations(sheet: Sheet) -> None:
    sheet.clock = {"Time": [f"T#{int(t)}s{1e3 * (t % 1.0):.0f}ms" for t in sheet.time]}


def _steps(sheet: Sheet) -> None:
    sheet.clock = {"dt [ms]": ["0", *["10"] * (sheet.time.size - 1)]}


# ---- ways of units and numbers


def _pressures_in(unit: str, one: float, zero: float) -> Callable[[Sheet], None]:
    def way(sheet: Sheet) -> None:
        sheet.units |= {"p1": (unit, one, zero), "p_supply": (unit, one, zero)}
        sheet.decimals = 2 if one < 100 else 5

    return way


def _unit_at_the_end_of_the_name(sheet: Sheet) -> None:
    sheet.names |= {"p1": "vessel_bar_g", "p_supply": "supply_bar_g", "u": "valve_V"}
    sheet.units |= dict.fromkeys(("p1", "p_supply"), ("", 1e5, AMBIENT)) | {"u": ("", 1.0, 0.0)}


def _scaled(sheet: Sheet) -> None:
    for role in ("p1", "p_supply"):
        low, high = float(sheet.values[role].min()), float(sheet.values[role].max())
        sheet.units[role] = ("", high - low, low)


def _commanded_in(unit: str, one: float) -> Callable[[Sheet], None]:
    def way(sheet: Sheet) -> None:
        sheet.units["u"] = (unit, one, 0.0)

    return way


def _counted(sheet: Sheet) -> None:
    sheet.units = dict.fromkeys(sheet.units, ("counts", 1e5 / 2764.8, 0.0)) | {"u": ("counts", 1 / 2764.8, 0.0)}
    sheet.decimals = 0


def _hexadecimal(kind: str) -> Callable[[Sheet], None]:
    def way(sheet: Sheet) -> None:
        sheet.units = {role: ("", one, zero) for role, (_, one, zero) in sheet.units.items()}
        sheet.write = kind

    return way


def _scores(sheet: Sheet) -> None:
    for role in ("p1", "p_supply"):
        sheet.units[role] = ("", float(sheet.values[role].std()), float(sheet.values[role].mean()))


# ---- ways of names


def _called(u: str, supply: str, p1: str, time: str = "", encoding: str = "utf-8") -> Callable[[Sheet], None]:
    def way(sheet: Sheet) -> None:
        sheet.names, sheet.encoding = {"u": u, "p_supply": supply, "p1": p1}, encoding
        if time and list(sheet.clock) == ["Time [s]"]:
            sheet.clock = {f"{time} [s]": sheet.clock["Time [s]"]}

    return way


# ---- ways of a table


def _written(kind: str) -> Callable[[Sheet], None]:
    def way(sheet: Sheet) -> None:
        sheet.write = kind

    return way


def _semicolons(sheet: Sheet) -> None:
    sheet.delimiter = ";"


def _two_runs(sheet: Sheet) -> None:
    time, again = tank(sheet.rng)
    sheet.runs.append(again)
    sheet.values = {role: np.concatenate([own, again[role]]) for role, own in sheet.values.items()}
    sheet.time = np.concatenate([time, time])
    sheet.clock = {"Time [s]": [f"{t:.3f}" for t in sheet.time]}


def _runs_by_number(sheet: Sheet) -> None:
    _two_runs(sheet)
    sheet.write = "numbered"


def _header_again(sheet: Sheet) -> None:
    _two_runs(sheet)
    sheet.write = "again"


def _blocks_of_runs(sheet: Sheet) -> None:
    _two_runs(sheet)
    sheet.write = "blocks"


def _repeats(sheet: Sheet) -> None:
    again = {**sheet.values, "p1": sheet.values["p1"] + NOISE * sheet.rng.standard_normal(sheet.time.size)}
    sheet.runs.append(again)
    sheet.write = "repeats"


CLOCKS: dict[str, Callable[[Sheet], None]] = {
    **{"milliseconds": _number_as("t [ms]", "{:.0f}", 1e3), "date, time and part": _date_and_time_and_part},
    **{"hours, minutes, seconds": _hours_minutes_seconds, "zone": _told_as("At", "%Y-%m-%dT%H:%M:%S.%f", end="+01:00")},
    **{"unix ms": _number_as("timestamp", "{:.0f}", 1e3, 1.7734e12), "durations": _durations},
    "midnight": _told_as("Uhrzeit", "%H:%M:%S.%f", late=53_096.0),
    "comma before milliseconds": _told_as("Time", "%Y-%m-%d %H:%M:%S,%f"),
    "compact": _told_as("Stamp", "%Y%m%dT%H%M%S.%f", late=55.0),
    "digits of a day": _told_as("Stamp", "%H%M%S.%f", late=55.0),
    "digits": _told_as("Stamp", "%Y%m%d%H%M%S%f", late=55.0),
    "German month": _told_as("Stamp", "%d. März %Y %H:%M:%S.%f", late=55.0),
    **{"whole seconds": _told_as("Time", "%H:%M:%S", cut=0, late=0.37), "steps": _steps},
    **{"seconds of a date": _told_as("Stamp", "%Y-%m-%d %H:%M:%S", cut=0, late=0.61)},
    **{"ctime": _told_as("Time", "%a %b %d %H:%M:%S.%f %Y", cut=0), "points": _told_as("Zeit", "%H.%M.%S.%f")},
    **{
        "DB2": _told_as("Stamp", "%Y-%m-%d-%H.%M.%S.%f", cut=0),
        "half days": _told_as("At", "%m/%d/%Y %I:%M:%S.%f", end=" AM"),
    },
    **{"named zone": _told_as("Time", "%Y-%m-%d %H:%M:%S.%f", end=" CET"), "colon": _told_as("Time", "%H:%M:%S:%f")},
    **{
        "days of Excel": _number_as("Time", "{:.9f}", 1 / 86_400, 46_092.385439814812),
        "quoted": _told_as("Time", "'%H:%M:%S.%f"),
    },
    **{"minutes": _number_as("t [min]", "{:.7f}", 1 / 60), "hours": _number_as("t [h]", "{:.9f}", 1 / 3600)},
    **{"trigger": _number_as("Time [s]", "{:.3f}", 1.0, -1.0), "in words": _number_as("Time", "0h 0m {:.3f}s", 1.0)},
    **{"filetime": _number_as("Time", "{:.0f}", 1e7, 134_177_661_020_000_000), "nanosec": _seconds_and_nanoseconds},
    "interval above": _numbered_rows("No.", "Sampling interval,10,ms", ""),
    "rate above": _numbered_rows("Sample", "Sampling Rate [Hz],100"),
    "resolution above": _numbered_rows("", '"HResolution",1.0E-02'),
}
UNITS: dict[str, Callable[[Sheet], None]] = {
    **{unit: _pressures_in(unit, one, 0.0) for unit, one in (("psia", 6894.757293), ("kPa", 1e3), ("mbar", 100.0))},
    **{
        unit: _pressures_in(unit, one, AMBIENT)
        for unit, one in (("barg", 1e5), ("psi", 6894.757293), ("mmHg", 133.322))
    },
    **{
        unit: _pressures_in(unit, one, 0.0)
        for unit, one in (("MPa", 1e6), ("hPa", 100.0), ("kgf/cm2", 98_066.5), ("bara", 1e5), ("kPa abs", 1e3))
    },
    **{"inHg": _pressures_in("inHg", 3386.389, 0.0), "mA": _pressures_in("mA", 1e6 / 16.0, -4e6 / 16.0)},
    **{
        "bar of volts": _pressures_in("V", 1e5, 0.0),
        "mV": _commanded_in("mV", 1e-3),
        "percent": _commanded_in("%", 0.1),
    },
    **{"counts": _counted, **{kind: _hexadecimal(kind) for kind in ("hexadecimal", "bare hexadecimal")}},
    "no unit": _pressures_in("", 1e5, 0.0),
    "unknown unit": _pressures_in("zorps", 1e5, 0.0),
    "unit at the end of the name": _unit_at_the_end_of_the_name,
    **{"scaled": _scaled, "scores": _scores},
}
NAMES: dict[str, Callable[[Sheet], None]] = {
    "Swedish": _called("styrsignal", "matningstryck", "tryck 1", "tid"),
    "German": _called("Ventilspannung", "Versorgungsdruck", "Kammerdruck", "Zeit"),
    "Polish": _called("napięcie", "ciśnienie zasilania", "ciśnienie 1", "czas"),
    "Russian": _called("напряжение", "давление питания", "давление 1", "время"),
    "Chinese": _called("控制电压", "供气压力", "压力1", "时间"),
    "by number": _called("CH1", "CH3", "CH2"),
    "Chinese of old": _called("控制电压", "供气压力", "压力1", "时间", "gb18030"),
    "Japanese of old": _called("電圧指令", "供給圧力", "圧力1", "時間", "cp932"),
    "inputs": _called("ACH1", "ACH2", "ACH3"),
    "run together": _called("Uvalve", "Psup", "Ptank"),
    "topics": _called("/valve/command/data", "/pressure/supply/fluid_pressure", "/pressure/tank/fluid_pressure"),
    "French": _called("tension vanne", "pression alimentation", "pression 1", "temps"),
    "Spanish": _called("tensión válvula", "presión suministro", "presión cámara", "tiempo"),
    "Italian": _called("tensione valvola", "pressione alimentazione", "pressione camera", "tempo"),
    "Turkish": _called("valf gerilimi", "besleme basıncı", "hazne basıncı", "zaman"),
    "Korean": _called("밸브 전압", "공급 압력", "탱크 압력", "시간"),
    "tags": _called("XV-101", "PT-100", "PT-101"),
    "analogue inputs": _called("AO0", "AI1", "AI0"),
    "ETAS": _called("u_valve\\ETKC:1", "p_supply\\ETKC:1", "p_vessel\\ETKC:1"),
    "Simulink": _called("Model/Valve/u:1", "Model/Supply/p:1", "Model/Vessel/p:1"),
    "dSPACE": _called("Model Root/Valve/u/Out1", "Model Root/Supply/p/Out1", "Model Root/Tank/p/Out1"),
    "TwinCAT": _called("MAIN.fbAxis.rValveCmd", "MAIN.fbAxis.rPressureSupply", "MAIN.fbAxis.rPressureA"),
    "numbered and named": _called("Chan 3 - Valve", "Chan 2 - P_sup", "Chan 1 - P1"),
    "dotted": _called("Plc.GVL.u", "Plc.GVL.pSupply", "Plc.GVL.p1"),
}
LAYOUTS: dict[str, Callable[[Sheet], None]] = {
    **{
        kind: _written(kind)
        for kind in ("three lines", "value line", "channel table", "transposed table", "long", "blanks")
    },
    **{kind: _written(kind) for kind in ("long with status", "json long", "json series", "marks", "words", "infinity")},
    **{"unit in cells": _written("cells"), "unit that changes": _written("ranging"), "semicolons": _semicolons},
    **{"stamps by channel": _written("stamped"), "serial monitor": _written("arrow"), "repeats": _repeats},
    **{"runs by number": _runs_by_number, "header again": _header_again, "blocks": _blocks_of_runs},
    **{kind: _written(kind) for kind in ("spreads", "keyed", "keyed among words", "uncertainty", "Fortran")},
    **{kind: _written(kind) for kind in ("unit beside", "line protocol", "names by pairs", *FURTHER_LAYOUTS)},
}
WAYS = CLOCKS | UNITS | NAMES | LAYOUTS
OWN_CLOCK = {
    "runs by number",
    "header again",
    "blocks",
    "LabChart",
    "Yokogawa DL",
    "PicoScope",
    "json series",
}  # which write another clock


# ---- verdicts


def _filled_in(text: str) -> str:
    return re.sub(r'"\? (\w+)"', lambda m: f'"{FILL_IN[m[1]]} {m[1]}"' if m[1] in FILL_IN else m[0], text)


def verdict(sheet: Sheet, folder: Path) -> tuple[str, str]:
    """Return what became of a sheet at the front door, and why."""
    try:
        answer = init.create(folder / "p", [write(sheet, folder)])
        pipeline = folder / "p" / "pipeline.toml"
        text = _filled_in(pipeline.read_text("utf-8"))
        pipeline.write_text(text, encoding="utf-8")
        if re.search(r'"[^"#]*\?[^"]*"', "\n".join(line.split("  #")[0] for line in text.splitlines())):
            return "asked", text
        (folder / "out").mkdir()
        read = ingest.run(Context(pipeline, load(pipeline), folder / "out", folder))
    except InputError as error:
        return "refused", str(error).splitlines()[0]
    except Exception as error:  # whatever it is: this is counted
        return "fault", f"{type(error).__name__}: {error}"
    marked = {one.signal for one in answer.columns if "CHECK" in one.why}
    told = {one["signal"] for one in [*read["repairs"], *read["plausibility"]] if one.get("kind") != "unit-said"}
    table = pq.read_table(folder / "out" / "signals.parquet").to_pandas()
    found = [own for _, own in table.groupby("recording", sort=False)]
    seen = []
    for role in sheet.values:
        here = [own for own in found if role in own and own[role].notna().any()]
        right = bool(here) and all(
            any(_agrees(own["time"], own[role], run[role], role) for run in sheet.runs) for own in here
        )
        absent = not here and any(one.signal == "" for one in answer.columns)
        state = (
            "right"
            if right
            else "marked"
            if absent or {role, "time"} & marked
            else "told"
            if {role, "time", ""} & told
            else WRONG
        )
        seen.append(state)
    return min(seen, key=VERDICTS.index), text


def _agrees(time: Array, values: Array, truth: Array, role: str) -> bool:
    """Return whether readings are those of the truth, but for a sample of shift: by quantiles and by value."""
    known = np.isfinite(np.asarray(values, dtype=float))
    stamps, own = np.asarray(time, dtype=float)[known], np.asarray(values, dtype=float)[known]
    if own.size < 0.5 * truth.size:
        return False
    slack = 1e-6 if role == "u" else 60.0
    ticks = np.round((stamps - stamps[0]) * RATE).astype(int)
    for shift in range(-2, 3):
        at = ticks + shift
        inside = (at >= 0) & (at < truth.size)
        if inside.mean() > 0.98 and np.mean(np.abs(own[inside] - truth[at[inside]]) <= slack) > 0.97:
            return True
    return False


def situations(seed: int, count: int) -> Iterator[Sheet]:
    """Yield sheets: ways by themselves, then as many pairs of ways of different kinds."""
    singles: list[tuple[str, ...]] = [(way,) for way in WAYS]
    kinds = (CLOCKS, UNITS, NAMES, LAYOUTS)
    pairs: list[tuple[str, ...]] = [(a, b) for one, other in combinations(kinds, 2) for a in one for b in other]
    pairs = [pair for pair in pairs if not (pair[0] in CLOCKS and pair[1] in OWN_CLOCK)]
    rng = np.random.default_rng([seed, 1])
    half = singles if count <= len(singles) else [singles[n] for n in rng.permutation(len(singles))[: count // 2]]
    chosen = [*half, *(pairs[n] for n in rng.permutation(len(pairs)))][:count]
    for number, ways in enumerate(chosen):
        sheet = plain(np.random.default_rng([seed, 2, number]))
        for way in ways:
            WAYS[way](sheet)
        sheet.ways = list(ways)
        yield sheet


def main(arguments: Sequence[str]) -> int:
    """Print verdicts by way, and how many are wrong in silence; return 1 where any is, or a fault."""
    seeds = [int(one) for one in arguments if one.isdigit()] or [1]
    count = len(WAYS) if "--small" in arguments else SITUATIONS
    by_way: dict[str, Counter[str]] = {}
    total: Counter[str] = Counter()
    for seed in seeds[: 1 if "--small" in arguments else None]:
        for sheet in situations(seed, count):
            with tempfile.TemporaryDirectory() as place:
                found, why = verdict(sheet, Path(place))
            total[found] += 1
            for way in sheet.ways:
                by_way.setdefault(way, Counter())[found] += 1
            if found in (WRONG, "fault") or "-v" in arguments:
                print(f"seed {seed}, {' and '.join(sheet.ways)}: {found}\n{why if found == WRONG else why[:300]}")
    print(f"| way | {' | '.join(VERDICTS)} |\n|{' --- |' * (1 + len(VERDICTS))}")
    for way, counts in by_way.items():
        print(f"| {way} | {' | '.join(str(counts[one] or '') for one in VERDICTS)} |")
    print(f"| all | {' | '.join(str(total[one]) for one in VERDICTS)} |")
    return int(bool(total[WRONG] or total["fault"]))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
