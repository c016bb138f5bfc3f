"""The sheets of ``benchmarks.door`` as texts: a page for each layout that recorders and programs write."""

from __future__ import annotations

import datetime
import json
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pneucli.arrays import Array

RATE = 100.0  # Hz
START = datetime.datetime(2026, 3, 11, 9, 15, 2)


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
    above: tuple[str, ...] = ()
    ways: list[str] = field(default_factory=list)

    def cells(self, role: str) -> list[str]:
        """Return the numbers of a role as texts, in its unit."""
        _, one, zero = self.units[role]
        return [f"{(value - zero) / one:.{self.decimals}f}" for value in self.values[role]]

    def title(self, role: str, form: str = "{} [{}]") -> str:
        """Return what the header calls a role."""
        name, unit = self.names[role], self.units[role][0]
        return form.format(name, unit) if unit else name


def stamps(sheet: Sheet, form: str, start: datetime.datetime = START) -> list[str]:
    """Return the clock of a sheet as stamps."""
    return [f"{start + datetime.timedelta(seconds=float(t)):{form}}" for t in sheet.time]


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
    clock = [f"{1e6 * t:.0f}" for t in page.sheet.time]
    header = [name for one in page.header[page.first :] for name in (f"TimeStamp {one}", one)]
    page.rows = [
        [text for one in row[page.first :] for text in (stamp, one)]
        for stamp, row in zip(clock, page.rows, strict=True)
    ]
    return page.text(header)


def _arrow(page: Page) -> str:
    clock, mark = stamps(page.sheet, "%H:%M:%S.%f"), page.sheet.delimiter
    lines = (f"{t[:-3]} -> {mark.join(row[page.first :])}" for t, row in zip(clock, page.rows, strict=True))
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
    clock = stamps(page.sheet, "%Y-%m-%d %H:%M:%S.%f")
    told = (
        " ".join(f"{key}={text}" for key, text in [*zip(keys, row, strict=True)][page.first :]) for row in page.rows
    )
    return "\n".join(f"{stamp[:-3]} INFO {text}" for stamp, text in zip(clock, told, strict=True)) + "\n"


def _line_protocol(page: Page) -> str:
    keys = [re.sub(r"\W+", "_", name).strip("_") for name in page.header]
    clock = (int(1e9 * round(START.timestamp() + t, 3)) for t in page.sheet.time)
    told = (
        ",".join(f"{key}={text}" for key, text in [*zip(keys, row, strict=True)][page.first :]) for row in page.rows
    )
    return "\n".join(f"rig,bench=3 {text} {stamp}" for stamp, text in zip(clock, told, strict=True)) + "\n"


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
    clock = [f"{1e3 * t:.0f}" for t in page.sheet.time]
    heads = [
        [both for text in texts[page.first :] for both in (key, text)]
        for key, texts in (("Name", page.bare), ("Unit", page.units))
    ]
    page.rows = [
        [both for text in row[page.first :] for both in (stamp, text)]
        for stamp, row in zip(clock, page.rows, strict=True)
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
    "csv": lambda page: page.text(page.header, above=page.sheet.above),
    **{"three lines": _three_lines, "value line": _value_line, "channel table": _channel_table, "blanks": _blanks},
    **{"transposed table": _transposed_table, "marks": _with_texts(" -"), "words": _with_texts("BURNOUT")},
    **{"infinity": _with_texts("∞"), "cells": _cells, "ranging": _cells, "stamped": _stamped, "arrow": _arrow},
    **{"long": _long, "long with status": _long, "numbered": _numbered, "again": _again, "repeats": _side_by_side},
    **{"blocks": _blocks, "spreads": _spreads, "keyed": _keyed, "keyed among words": _keyed_among_words},
    **{"uncertainty": _uncertainty, "Fortran": _fortran, "unit beside": _unit_beside},
    **{"line protocol": _line_protocol, "names by pairs": _names_by_pairs},
}


def _long_rows(sheet: Sheet, *, with_status: bool) -> Iterator[list[str]]:
    clock = stamps(sheet, "%Y-%m-%dT%H:%M:%S.%f")
    yield (
        ["NodeId", "SourceTimestamp", "ServerTimestamp", "Value", "StatusCode"]
        if with_status
        else ["tag", "time", "value"]
    )
    cells = {role: sheet.cells(role) for role in sheet.values}
    for n, stamp in enumerate(clock):
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
    if sheet.write == "json series":
        path = folder / "log.json"
        stamps_of = [round(float(t), 3) for t in sheet.time]
        series = [
            {
                "name": sheet.names[role],
                "unit": sheet.units[role][0],
                "data": [*zip(stamps_of, map(float, cells), strict=True)],
            }
            for role, cells in ((role, sheet.cells(role)) for role in sheet.values)
        ]
        path.write_text(json.dumps({"series": series}))
        return path
    path = folder / "run.csv"
    path.write_text(WRITERS[sheet.write](Page.of(sheet)), encoding=sheet.encoding)
    return path


# ---- further layouts


def _tabled(change: Callable[[Page], list[list[str]]]) -> Callable[[Page], str]:
    """Return the writer of all lines that ``change`` returns."""
    return lambda page: _joined(page.sheet.delimiter, change(page))


def _each(change: Callable[[str], str], *, clock: bool = False) -> Callable[[Page], str]:
    """Return the writer of a table whose cells are changed, those of the clock as well or not."""

    def written(page: Page) -> str:
        first = 0 if clock else page.first
        page.rows = [[*row[:first], *map(change, row[first:])] for row in page.rows]
        return page.text(page.header)

    return written


def _followed_by(text: str) -> Callable[[Page], str]:
    return lambda page: page.text(page.header) + text


def _summary_below(page: Page) -> str:
    numbers = np.array([[float(text) for text in row[page.first :]] for row in page.rows])
    kinds = (("Maximum", numbers.max(axis=0)), ("Minimum", numbers.min(axis=0)), ("Average", numbers.mean(axis=0)))
    below = [[name, *[""] * (page.first - 1), *(f"{one:.4f}" for one in own)] for name, own in kinds]
    return page.text(page.header) + "\n" + _joined(page.sheet.delimiter, below)


def _second_table(page: Page) -> str:
    wide = int(page.sheet.rng.integers(2, 7))
    names = ["Frequency [Hz]", *(f"A{n}" for n in range(1, wide))]
    rows = [[f"{0.5 * n:.1f}", *(f"{1 / (n + k):.4f}" for k in range(1, wide))] for n in range(80)]
    return page.text(page.header) + "\n" + _joined(page.sheet.delimiter, [names, *rows])


def _events_below(page: Page) -> str:
    events = [["Event", "Time", "Comment", "User", "Code"], ["Trigger", "1.0", "start", "", "3"]]
    return page.text(page.header) + "\n" + _joined(page.sheet.delimiter, events)


def _lab_chart(page: Page) -> str:
    heads = [["Interval=", "0.01 s"], ["TimeFormat=", "StartOfBlock"], ["ChannelTitle=", *page.bare[page.first :]]]
    heads += [["Range=", *(f"10.000 {unit}" for unit in page.units[page.first :])]]
    rows = [[f"{t:.2f}", *row[page.first :]] for t, row in zip(page.sheet.time, page.rows, strict=True)]
    return _joined("\t", [*heads, *rows])


def _yokogawa(page: Page) -> str:
    names, units, count = page.bare[page.first :], page.units[page.first :], len(page.bare) - page.first
    heads = [["Header Size", "9"], ["Model Name", "DL850E"], ["TraceName", *names], ["BlockSize", *["700"] * count]]
    heads += [["VUnit", *units], ["SampleRate", *["100"] * count], ["HResolution", *["1.0E-02"] * count]]
    quoted = [[f'"{text}"' if not text[:1].isdigit() else text for text in line] for line in heads]
    return _joined(",", quoted) + "\n" + _joined(",", [["", *row[page.first :]] for row in page.rows])


def _pico_scope(page: Page) -> str:
    heads = [["Time", *page.bare[page.first :]], ["(ms)", *(f"({unit})" for unit in page.units[page.first :])], []]
    rows = [[f"{1e3 * t - 1e3:.6f}", *row[page.first :]] for t, row in zip(page.sheet.time, page.rows, strict=True)]
    return _joined(",", [*heads, *rows])


def _fixed_width(page: Page) -> str:
    lines = [[text.replace(" ", "") for text in page.header], *page.rows]
    return "\n".join("".join(f"{text:>28}" for text in line) for line in lines) + "\n"


def _markdown(page: Page) -> str:
    lines = [page.header, ["---"] * len(page.header), *page.rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def _least_and_most(page: Page) -> str:
    page.rows = [
        [*row[: page.first], *(f"{float(text) + off:.5f}" for text in row[page.first :] for off in (0.02, -0.02))]
        for row in page.rows
    ]
    named = zip(page.bare[page.first :], page.units[page.first :], strict=True)
    ends = [f"{name} {end}" + (f" [{unit}]" if unit else "") for name, unit in named for end in ("Max", "Min")]
    return page.text([*page.header[: page.first], *ends])


def _with_status(page: Page) -> list[list[str]]:
    names = [both for name in page.header[page.first :] for both in (name, "Status")]
    rows = [[*row[: page.first], *(both for text in row[page.first :] for both in (text, "OK"))] for row in page.rows]
    return [[*page.header[: page.first], *names], *rows]


def _on_change(page: Page) -> str:
    at, last = page.header.index(page.sheet.title("u")), ""
    for row in page.rows:
        row[at], last = "" if row[at] == last else row[at], row[at]
    return page.text(page.header)


def _scale_line(page: Page) -> list[list[str]]:
    count = len(page.header) - page.first
    scales = [*["1"] * page.first, *["0.001"] * count]
    rows = [["", *row[: page.first], *(f"{1e3 * float(text):.2f}" for text in row[page.first :])] for row in page.rows]
    return [["Name", *page.bare], ["Unit", *page.units], ["Scale", *scales], *rows]


def _scales_below(page: Page) -> list[list[str]]:
    scales = [*["1"] * page.first, *["0.001"] * (len(page.header) - page.first)]
    rows = [[*row[: page.first], *(f"{1e3 * float(text):.2f}" for text in row[page.first :])] for row in page.rows]
    return [page.header, scales, *rows]


def _over_pairs(page: Page) -> list[list[str]]:
    clock, count = [f"{1e3 * t:.0f}" for t in page.sheet.time], len(page.header) - page.first
    names = [both for name in page.header[page.first :] for both in (name, "")]
    rows = [
        [both for text in row[page.first :] for both in (at, text)] for at, row in zip(clock, page.rows, strict=True)
    ]
    return [names, ["t [ms]", "y"] * count, *rows]


def _segments(page: Page) -> list[list[str]]:
    head = [["Channels", "3", "", "", "", ""], ["Delta_X", "0.01", "0.01", "0.01"], ["***End_of_Header***"]]
    parts = [page.rows[n : n + 100] for n in range(0, len(page.rows), 100)]
    return [line for part in parts for line in (*head, page.header, *part)]


def _with_pages(page: Page) -> list[list[str]]:
    parts = [page.rows[n : n + 60] for n in range(0, len(page.rows), 60)]
    return [line for n, part in enumerate(parts) for line in (["Page", str(n + 1)], page.header, *part)]


def _counts(form: str) -> Callable[[Page], str]:
    """Return the writer of counts of 16 bits, 27648 of them being 10 of the unit."""
    return _each(lambda text: form.format(round(float(text) * 2764.8) & 0xFFFF))


_FURTHER: dict[str, Callable[[Page], str]] = {
    "newest first": lambda page: _joined(page.sheet.delimiter, [page.header, *page.rows[::-1]]),
    **{"summary below": _summary_below, "second table": _second_table, "events below": _events_below},
    **{"end of file": _followed_by("EOF\n"), "room left": _followed_by("\0" * 512), "LabChart": _lab_chart},
    **{"Yokogawa DL": _yokogawa, "PicoScope": _pico_scope, "fixed width": _fixed_width, "markdown": _markdown},
    "quoted with commas": lambda page: _joined(
        ",", [page.header, *([f'"{text.replace(".", ",")}"' for text in row] for row in page.rows)]
    ),
    "decimal commas": lambda page: _joined(
        ";", [page.header, *([text.replace(".", ",") for text in row] for row in page.rows)]
    ),
    "ends with a mark": _tabled(lambda page: [[*row, ""] for row in [page.header, *page.rows]]),
    "columns apart": _tabled(
        lambda page: [[both for text in row for both in (text, "")] for row in [page.header, *page.rows]]
    ),
    "sep=": lambda page: "sep=;\n" + _joined(";", [page.header, *page.rows]),
    "comments of %": lambda page: "% logger 3.1\n% rig: bench 3, tank\n" + page.text(page.header),
    "sections": lambda page: "[Header]\nDevice=Logger 3\nChannels=3\n[Data]\n" + page.text(page.header),
    "status by channel": _tabled(_with_status),
    "least and most": _least_and_most,
    "index in front": _tabled(lambda page: [["", *page.header], *([str(n), *row] for n, row in enumerate(page.rows))]),
    "names of rows": _tabled(lambda page: [page.header, *([f'"{n}"', *row] for n, row in enumerate(page.rows, 1))]),
    "in brackets": _each(lambda text: f"({text[1:]})" if text.startswith("-") else text),
    "sign behind": _each(lambda text: f"{text[1:]}-" if text.startswith("-") else text),
    "sign always": _each(lambda text: text if text.startswith("-") else f"+{text}"),
    "powers of ten": _each(lambda text: f"{float(text):.7E}".replace("E", "x10^")),
    "on change": _on_change,
    "clock last": _tabled(lambda page: [[*row[page.first :], *row[: page.first]] for row in [page.header, *page.rows]]),
    "types": _tabled(lambda page: [page.header, ["REAL"] * len(page.header), *page.rows]),
    **{"page heads": _tabled(_with_pages), "scale line": _tabled(_scale_line)},
    **{
        "scales below": _tabled(_scales_below),
        "segments": _tabled(_segments),
        "names over pairs": _tabled(_over_pairs),
    },
    "names with commas": lambda page: _joined(
        ",", [[f'"{n}, {u}"' if u else n for n, u in zip(page.bare, page.units, strict=True)], *page.rows]
    ),
    "ranges": _tabled(lambda page: [page.header, ["Range", *[""] * (page.first - 1), *["10"] * 3], *page.rows]),
    **{"hexadecimal": _counts("0x{:04X}"), "bare hexadecimal": _counts("{:04X}")},
}
WRITERS |= _FURTHER
FURTHER_LAYOUTS = tuple(kind for kind in _FURTHER if "hexadecimal" not in kind)
