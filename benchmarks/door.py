"""Two hundred files as recorders write them, at the front door: ``python -m benchmarks.door [SEED ...]``.

A tank behind a valve whose truth is known is written in each of the ways below and in pairs of ways of different kinds,
drawn by seed. Each file goes through ``init`` and ``ingest``; what a user knows of the rig is filled in. A recording is
right where command and pressures are those of the truth, marked where ``init`` says CHECK, told where ``ingest`` says
something of the signal, asked where a ``?`` waits, refused, or wrong in silence. Printed: the verdicts by way, and how
many are wrong in silence. ``--small`` takes each way once.
"""

from __future__ import annotations

import datetime
import json
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from pneucli.arrays import Array
from pneucli.config import load
from pneucli.errors import InputError
from pneucli.pipeline.context import Context
from pneucli.stages import ingest, init

RATE, COUNT, SUPPLY, AMBIENT = 100.0, 700, 7.013e5, 1.013e5  # Hz, rows, Pa
NOISE = 400.0  # Pa
SITUATIONS = 200  # of a seed: each way once, the rest pairs
START = datetime.datetime(2026, 3, 11, 9, 15, 2)
WRONG = "wrong in silence"
VERDICTS = (WRONG, "fault", "refused", "asked", "marked", "told", "right")
FILL_IN = {"bar": "7.013", "l": "0.16", "V": "5"}


@dataclass
class Sheet:
    """What is written: a clock and columns by role in SI, and how. ``runs`` has the truth of each recording."""

    time: Array
    values: dict[str, Array]
    runs: list[dict[str, Array]]
    rng: np.random.Generator
    names: dict[str, str] = field(default_factory=lambda: {"u": "U", "p_supply": "P_supply", "p1": "P1"})
    units: dict[str, tuple[str, float, float]] = field(default_factory=dict)  # by role: unit, SI of one, SI of zero
    clock: dict[str, list[str]] = field(default_factory=dict)
    write: str = "csv"
    delimiter: str = ","
    decimals: int = 5
    encoding: str = "utf-8"
    ways: list[str] = field(default_factory=list)

    def cells(self, role: str) -> list[str]:
        """Return the numbers of a role as texts, in its unit."""
        _, one, zero = self.units[role]
        return [f"{(value - zero) / one:.{self.decimals}f}" for value in self.values[role]]

    def title(self, role: str, form: str = "{} [{}]") -> str:
        """Return what the header calls a role."""
        name, unit = self.names[role], self.units[role][0]
        return form.format(name, unit) if unit else name


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


def _milliseconds(sheet: Sheet) -> None:
    sheet.clock = {"t [ms]": [f"{1e3 * t:.0f}" for t in sheet.time]}


def _stamps(sheet: Sheet, form: str) -> list[str]:
    return [f"{START + datetime.timedelta(seconds=float(t)):{form}}" for t in sheet.time]


def _date_and_time_and_part(sheet: Sheet) -> None:
    name, per = [("Millitm", 1e3), ("ms", 1e3), ("Fraction [us]", 1e6), ("hundredths", 1e2)][int(sheet.rng.integers(4))]
    parts = [f"{np.floor((t % 1.0) * per + 1e-6):.0f}" for t in sheet.time]
    sheet.clock = {"Date": _stamps(sheet, "%m/%d/%Y"), "Time": _stamps(sheet, "%H:%M:%S"), name: parts}


def _hours_minutes_seconds(sheet: Sheet) -> None:
    seconds = [f"{(2.0 + t) % 60:.3f}" for t in sheet.time]
    sheet.clock = {"Hour": ["9"] * sheet.time.size, "Minute": ["15"] * sheet.time.size, "Second": seconds}


def _iso_with_zone(sheet: Sheet) -> None:
    sheet.clock = {"Timestamp": [f"{text[:-3]}+01:00" for text in _stamps(sheet, "%Y-%m-%dT%H:%M:%S.%f")]}


def _unix_milliseconds(sheet: Sheet) -> None:
    sheet.clock = {"timestamp": [f"{1.7734e12 + 1e3 * t:.0f}" for t in sheet.time]}


def _over_midnight(sheet: Sheet) -> None:
    start = datetime.datetime(2026, 3, 11, 23, 59, 58)
    late = [start + datetime.timedelta(seconds=float(t)) for t in sheet.time]
    sheet.clock = {"Uhrzeit": [f"{one:%H:%M:%S.%f}"[:-3] for one in late]}


def _stamped_as(form: str, digits: int = 3) -> Callable[[Sheet], None]:
    def way(sheet: Sheet) -> None:
        late = START.replace(second=57)
        texts = (f"{late + datetime.timedelta(seconds=float(t)):{form}}" for t in sheet.time)
        sheet.clock = {"Stamp": [text[: len(text) - 6 + digits] for text in texts]}

    return way


def _durations(sheet: Sheet) -> None:
    sheet.clock = {"Time": [f"T#{int(t)}s{1e3 * (t % 1.0):.0f}ms" for t in sheet.time]}


def _stamps_by_channel(sheet: Sheet) -> None:
    sheet.write = "stamped"


def _serial_monitor(sheet: Sheet) -> None:
    sheet.write = "arrow"


# ---- ways of units and numbers


def _pressures_in(unit: str, one: float, zero: float) -> Callable[[Sheet], None]:
    def way(sheet: Sheet) -> None:
        sheet.units |= {"p1": (unit, one, zero), "p_supply": (unit, one, zero)}
        sheet.decimals = 2 if one < 100 else 5

    return way


def _unit_at_the_end_of_the_name(sheet: Sheet) -> None:
    sheet.names |= {"p1": "vessel_bar_g", "p_supply": "supply_bar_g", "u": "valve_V"}
    sheet.units |= dict.fromkeys(("p1", "p_supply"), ("", 1e5, AMBIENT)) | {"u": ("", 1.0, 0.0)}


def _unit_in_cells(sheet: Sheet) -> None:
    sheet.write = "cells"


def _unit_that_changes(sheet: Sheet) -> None:
    sheet.write = "ranging"


def _scaled(sheet: Sheet) -> None:
    for role in ("p1", "p_supply"):
        low, high = float(sheet.values[role].min()), float(sheet.values[role].max())
        sheet.units[role] = ("", high - low, low)


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
    **{"milliseconds": _milliseconds, "date, time and part": _date_and_time_and_part},
    **{"hours, minutes, seconds": _hours_minutes_seconds, "zone": _iso_with_zone, "unix ms": _unix_milliseconds},
    **{"midnight": _over_midnight, "durations": _durations, "compact": _stamped_as("%Y%m%dT%H%M%S.%f")},
    **{"digits of a day": _stamped_as("%H%M%S.%f"), "digits": _stamped_as("%Y%m%d%H%M%S%f")},
    **{"German month": _stamped_as("%d. März %Y %H:%M:%S.%f")},
}
UNITS: dict[str, Callable[[Sheet], None]] = {
    **{unit: _pressures_in(unit, one, 0.0) for unit, one in (("psia", 6894.757293), ("kPa", 1e3), ("mbar", 100.0))},
    **{
        unit: _pressures_in(unit, one, AMBIENT)
        for unit, one in (("barg", 1e5), ("psi", 6894.757293), ("mmHg", 133.322))
    },
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
    "Chinese of old": _called("控制电压", "供气压力", "压力1", "时间", "gbk"),
    "Japanese of old": _called("電圧指令", "供給圧力", "圧力1", "時間", "cp932"),
    "inputs": _called("ACH1", "ACH2", "ACH3"),
    "run together": _called("Uvalve", "Psup", "Ptank"),
    "topics": _called("/valve/command/data", "/pressure/supply/fluid_pressure", "/pressure/tank/fluid_pressure"),
    "dotted": _called("Plc.GVL.u", "Plc.GVL.pSupply", "Plc.GVL.p1"),
}
LAYOUTS: dict[str, Callable[[Sheet], None]] = {
    **{
        kind: _written(kind)
        for kind in ("three lines", "value line", "channel table", "transposed table", "long", "blanks")
    },
    **{kind: _written(kind) for kind in ("long with status", "json long", "marks", "words", "infinity")},
    **{"unit in cells": _unit_in_cells, "unit that changes": _unit_that_changes, "semicolons": _semicolons},
    **{"stamps by channel": _stamps_by_channel, "serial monitor": _serial_monitor, "repeats": _repeats},
    **{"runs by number": _runs_by_number, "header again": _header_again, "blocks": _blocks_of_runs},
    **{kind: _written(kind) for kind in ("spreads", "keyed", "keyed among words", "uncertainty", "Fortran")},
    **{kind: _written(kind) for kind in ("unit beside", "line protocol", "names by pairs")},
}
WAYS = CLOCKS | UNITS | NAMES | LAYOUTS
OWN_CLOCK = {"runs by number", "header again", "blocks"}  # which write another clock
NO_NAMES = {"serial monitor"}  # which write none


# ---- writers


@dataclass
class Page:
    """A sheet as a table of texts: names with and without their units, of which the first are the clock's."""

    sheet: Sheet
    header: list[str]
    bare: list[str]
    units: list[str]
    rows: list[list[str]]

    @classmethod
    def of(cls, sheet: Sheet) -> Page:
        """Return the page of a sheet."""
        roles = list(sheet.values)
        columns = {**sheet.clock, **{sheet.title(role): sheet.cells(role) for role in roles}}
        bare = [re.sub(r"\s*\[.*\]", "", name) for name in sheet.clock] + [sheet.names[role] for role in roles]
        units = [(re.search(r"\[(.*)\]", name) or [""] * 2)[1] for name in sheet.clock]
        units += [sheet.units[role][0] for role in roles]
        return cls(sheet, list(columns), bare, units, [list(row) for row in zip(*columns.values(), strict=True)])

    @property
    def first(self) -> int:
        """The first column behind the clock."""
        return len(self.sheet.clock)

    @property
    def codes(self) -> list[str]:
        """The columns by the numbers of their channels."""
        return [*self.bare[: self.first], *(f"CH{n}" for n in range(1, len(self.header) - self.first + 1))]

    def text(self, *lines: Sequence[str], above: Sequence[str] = ()) -> str:
        """Return lines and rows as text."""
        mark = self.sheet.delimiter
        return "\n".join([*above, _joined(mark, [*lines, *self.rows])])


def _three_lines(page: Page) -> str:
    objects = [""] * page.first + ["valve", "hose", "tank"][: len(page.header) - page.first]
    return page.text(page.bare, page.units, objects)


def _value_line(page: Page) -> str:
    mark = page.sheet.delimiter
    above = [f"Sample rate:{mark}100 Hz" + mark * (len(page.header) - 2), ""]
    return page.text(page.header, ["Value"] * len(page.header), above=above)


def _channel_table(page: Page) -> str:
    channels = zip(page.codes[page.first :], page.bare[page.first :], page.units[page.first :], strict=True)
    table = [[code, f'"{name}"', "10 V", unit] for code, name, unit in channels]
    return page.text(["Model", "Logger 840"], ["CH", "Signal name", "Range", "Unit"], *table, page.codes)


def _transposed_table(page: Page) -> str:
    names = ["Name", *[""] * (page.first - 1), *page.bare[page.first :]]
    return page.text(["Model", "Logger 840"], names, ["Unit", *page.units[1:]], page.codes)


def _with_texts(text: str) -> Callable[[Page], str]:
    def written(page: Page) -> str:
        at = page.header.index(page.sheet.title("p1"))
        for n in page.sheet.rng.choice(np.arange(50, len(page.rows) - 50), 20, replace=False):
            page.rows[n][at] = text
        return page.text(page.header)

    return written


def _blanks(page: Page) -> str:
    page.sheet.delimiter += " "
    return page.text(page.header)


def _cells(page: Page) -> str:
    ranging = page.sheet.write == "ranging"
    for row in page.rows:
        for n, unit in enumerate(page.units[page.first :], page.first):
            plain_unit = unit.replace("(a)", "") or "bar"
            small = ranging and plain_unit == "bar" and float(row[n]) < 2.0
            row[n] = f"{1e3 * float(row[n]):.2f} mbar" if small else f"{row[n]} {plain_unit}"
    return page.text(page.bare)


def _stamped(page: Page) -> str:
    stamps = [f"{1e6 * t:.0f}" for t in page.sheet.time]
    header = [name for one in page.header[page.first :] for name in (f"TimeStamp {one}", one)]
    page.rows = [
        [text for one in row[page.first :] for text in (stamp, one)]
        for stamp, row in zip(stamps, page.rows, strict=True)
    ]
    return page.text(header)


def _arrow(page: Page) -> str:
    stamps, mark = _stamps(page.sheet, "%H:%M:%S.%f"), page.sheet.delimiter
    lines = (f"{t[:-3]} -> {mark.join(row[page.first :])}" for t, row in zip(stamps, page.rows, strict=True))
    return "\n".join(lines) + "\n"


def _long(page: Page) -> str:
    return _joined(page.sheet.delimiter, _long_rows(page.sheet, with_status=page.sheet.write == "long with status"))


def _numbered(page: Page) -> str:
    half = len(page.rows) // 2
    page.rows = [[str(1 + n // half), *row] for n, row in enumerate(page.rows)]
    return page.text(["run", *page.header])


def _again(page: Page) -> str:
    half = len(page.rows) // 2
    page.rows.insert(half, page.header)
    return page.text(page.header)


def _blocks(page: Page) -> str:
    half, mark = len(page.rows) // 2, page.sheet.delimiter
    heads = [
        [[f"Data Acquisition {n}", "", "Time:", "", f"{12 * n}", "s"], ["Station: bench"], page.header] for n in (1, 2)
    ]
    return _joined(mark, [*heads[0], *page.rows[:half], [], *heads[1], *page.rows[half:]])


def _spreads(page: Page) -> str:
    names = [f"{name} {kind}" for name in page.bare[page.first :] for kind in ("AVE", "MIN", "MAX")]
    units = [f" [{unit}]" if unit else "" for unit in page.units[page.first :] for _ in range(3)]
    page.rows = [
        [
            *row[: page.first],
            *(f"{float(text) + more:.5f}" for text in row[page.first :] for more in (0.0, -0.02, 0.02)),
        ]
        for row in page.rows
    ]
    return page.text([*page.header[: page.first], *(a + b for a, b in zip(names, units, strict=True))])


def _keyed(page: Page) -> str:
    keys = [re.sub(r"\W+", "_", name).strip("_") for name in page.header]
    page.rows = [[f"{key}:{text}" for key, text in zip(keys, row, strict=True)] for row in page.rows]
    return page.text(["logger ready"])


def _keyed_among_words(page: Page) -> str:
    keys = [re.sub(r"\W+", "_", name).strip("_") for name in page.bare]
    stamps = _stamps(page.sheet, "%Y-%m-%d %H:%M:%S.%f")
    told = (
        " ".join(f"{key}={text}" for key, text in [*zip(keys, row, strict=True)][page.first :]) for row in page.rows
    )
    return "\n".join(f"{stamp[:-3]} INFO {text}" for stamp, text in zip(stamps, told, strict=True)) + "\n"


def _line_protocol(page: Page) -> str:
    keys = [re.sub(r"\W+", "_", name).strip("_") for name in page.header]
    stamps = (int(1e9 * round(START.timestamp() + t, 3)) for t in page.sheet.time)
    told = (
        ",".join(f"{key}={text}" for key, text in [*zip(keys, row, strict=True)][page.first :]) for row in page.rows
    )
    return "\n".join(f"rig,bench=3 {text} {stamp}" for stamp, text in zip(stamps, told, strict=True)) + "\n"


def _uncertainty(page: Page) -> str:
    page.rows = [[*row[:-1], f"{row[-1]} ± 0.02"] for row in page.rows]
    return page.text(page.header)


def _fortran(page: Page) -> str:
    page.rows = [
        [*row[: page.first], *(f"{float(text):.9E}".replace("E", "D") for text in row[page.first :])]
        for row in page.rows
    ]
    return page.text(page.header)


def _unit_beside(page: Page) -> str:
    units = page.units[page.first :]
    rows, names = [], [both for name in page.bare[page.first :] for both in (name, f"{name} unit")]
    for row in page.rows:
        told = (both for text, unit in zip(row[page.first :], units, strict=True) for both in (text, unit))
        rows.append([*row[: page.first], *told])
    page.rows = rows
    return page.text([*page.header[: page.first], *names])


def _names_by_pairs(page: Page) -> str:
    stamps = [f"{1e3 * t:.0f}" for t in page.sheet.time]
    heads = [
        [both for text in texts[page.first :] for both in (key, text)]
        for key, texts in (("Name", page.bare), ("Unit", page.units))
    ]
    page.rows = [
        [both for text in row[page.first :] for both in (stamp, text)]
        for stamp, row in zip(stamps, page.rows, strict=True)
    ]
    return page.text(["Name", "Scope"], *heads, [])


def _side_by_side(page: Page) -> str:
    sheet = page.sheet
    other = Sheet(sheet.time, sheet.runs[1], [], sheet.rng, units=sheet.units, decimals=sheet.decimals).cells("p1")
    name, unit, at = sheet.names["p1"], sheet.units["p1"][0], page.header.index(sheet.title("p1"))
    page.header[at] = f"{name} run1 [{unit}]"
    page.rows = [[*row, text] for row, text in zip(page.rows, other, strict=True)]
    return page.text([*page.header, f"{name} run2 [{unit}]"])


WRITERS: dict[str, Callable[[Page], str]] = {
    "csv": lambda page: page.text(page.header),
    **{"three lines": _three_lines, "value line": _value_line, "channel table": _channel_table, "blanks": _blanks},
    **{"transposed table": _transposed_table, "marks": _with_texts(" -"), "words": _with_texts("BURNOUT")},
    **{"infinity": _with_texts("∞"), "cells": _cells, "ranging": _cells, "stamped": _stamped, "arrow": _arrow},
    **{"long": _long, "long with status": _long, "numbered": _numbered, "again": _again, "repeats": _side_by_side},
    **{"blocks": _blocks, "spreads": _spreads, "keyed": _keyed, "keyed among words": _keyed_among_words},
    **{"uncertainty": _uncertainty, "Fortran": _fortran, "unit beside": _unit_beside},
    **{"line protocol": _line_protocol, "names by pairs": _names_by_pairs},
}


def _long_rows(sheet: Sheet, *, with_status: bool) -> Iterator[list[str]]:
    stamps = _stamps(sheet, "%Y-%m-%dT%H:%M:%S.%f")
    yield (
        ["NodeId", "SourceTimestamp", "ServerTimestamp", "Value", "StatusCode"]
        if with_status
        else ["tag", "time", "value"]
    )
    cells = {role: sheet.cells(role) for role in sheet.values}
    for n, stamp in enumerate(stamps):
        for role, own in cells.items():
            label = f"ns=2;s=Rig.{sheet.title(role)}" if with_status else sheet.title(role)
            yield [label, stamp, stamp, own[n], "Good"] if with_status else [label, stamp, own[n]]


def _joined(mark: str, rows: Sequence[Sequence[str]] | Iterator[Sequence[str]]) -> str:
    return "\n".join(mark.join(row) for row in rows) + "\n"


def write(sheet: Sheet, folder: Path) -> Path:
    """Write a sheet; return its file."""
    if sheet.write == "json long":
        path = folder / "log.jsonl"
        _, *rows = _long_rows(sheet, with_status=False)
        path.write_text("\n".join(json.dumps({"topic": f"rig/{a}", "timestamp": b, "payload": c}) for a, b, c in rows))
        return path
    path = folder / "run.csv"
    path.write_text(WRITERS[sheet.write](Page.of(sheet)), encoding=sheet.encoding)
    return path


# ---- verdicts


def _filled_in(text: str) -> str:
    return re.sub(r'"\? (\w+)"', lambda m: f'"{FILL_IN[m[1]]} {m[1]}"' if m[1] in FILL_IN else m[0], text)


def verdict(sheet: Sheet, folder: Path) -> tuple[str, str]:
    """Return what became of a sheet at the front door, and why."""
    try:
        answer = init.create(folder / "p", [write(sheet, folder)])
        pipeline = folder / "p" / "pipeline.toml"
        text = re.sub(
            r'"\? (\w+)"',
            lambda m: f'"{FILL_IN[m[1]]} {m[1]}"' if m[1] in FILL_IN else m[0],
            pipeline.read_text("utf-8"),
        )
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
    """Yield sheets: each way by itself, then pairs of ways of different kinds, until there are as many as asked."""
    singles: list[tuple[str, ...]] = [(way,) for way in WAYS]
    kinds = (CLOCKS, UNITS, NAMES, LAYOUTS)
    pairs: list[tuple[str, ...]] = [(a, b) for one, other in combinations(kinds, 2) for a in one for b in other]
    pairs = [pair for pair in pairs if not (pair[0] in CLOCKS and pair[1] in OWN_CLOCK)]
    order = np.random.default_rng([seed, 1]).permutation(len(pairs))
    chosen = [*singles, *(pairs[n] for n in order)][:count]
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
