"""Comparison of control laws: results, the benefit of the inverse map and of each component, figures 7.28 to 7.34."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from matplotlib.ticker import NullLocator, ScalarFormatter

from pneucli.messages import law_comparison
from pneucli.messages.formatting import in_display_unit
from pneucli.report.figure import BLUE, GREEN, GREY, ORANGE, PALETTE, Drawing, drawing, envelope_indices, figures
from pneucli.report.page_elements import Cell, Grid, Note, Part, Section
from pneucli.report.report_data import ReportData, Table
from pneucli.report.sections.closed_loop import format_bounded

Answer = Mapping[str, Any]
MAX_SAMPLES = 800  # samples of a curve
MICROMETRES_PER_METRE = 1e6
THESIS_LAW = "compensated"  # the control law in the figures of the thesis
OBSERVER_CHOICES = ("friction in the observer", "friction compensated")  # of THESIS_LAW; the selected one is absent
PRESSURE_WINDOW = 0.25  # s on each side of a pressure step in the magnified figure


def section(material: ReportData) -> Section | None:
    """Return the comparison of control laws; absent where no controller was designed."""
    design = material.answer("design")
    if not design.get("compare"):
        return None
    signals = material.table("design/comparison_signals")
    tolerance = design["tolerance_um"]
    parts: list[Part] = [_grid("Results of each controller", design["compare"], tolerance)]
    if poor := law_comparison.shortcomings(design["compare"], tolerance):
        parts.append(Note(f"With set-valued friction at rest {'; '.join(poor)}."))
    parts += [Note(f"Not designed: {name}: {why}.", "warning") for name, why in design["not_made"].items()]
    if design["ablation"]:
        parts.append(_grid("Results of best without one component, otherwise unchanged", design["ablation"], tolerance))
    if design.get("variants"):
        parts.append(_grid("Choices of a law that [design] does not select", design["variants"], tolerance))
    parts.append(_grid("The same controllers without the inverse of the valve's map", design["without_map"], tolerance))
    parts += _pressure_control(design)
    parts.append(_titles(design["controllers"]))
    if len(signals):
        parts += figures([*_errors(signals), *_thesis(signals)])
    lead = (
        "The same axis, sensors and scenarios under each control law. Each law follows its equations in the source "
        "thesis and can be exported."
    )
    return Section("bench", "Comparison of controllers", lead, parts, folded=True)


def _grid(caption: str, cases: Answer, tolerance: float) -> Grid:
    rows = [
        [Cell(name, numeric=False), *map(Cell, figures), Cell(verdict, numeric=False)]
        for name, *figures, verdict in law_comparison.table_rows(cases, tolerance)
    ]
    return Grid(f"{caption}: {law_comparison.COLUMN_LEGEND}.", ("controller", *law_comparison.COLUMN_TITLES), rows)


def _pressure_control(design: Answer) -> Iterator[Grid]:
    """Yield settling time and error of pressure control, with and without the inverse valve map."""
    rows = []
    for name, by_scenario in design["compare"].items():
        bare = design["without_map"].get(f"{name}, no map", {})
        for scenario, mapped in by_scenario.items():
            if mapped.get("pressure_rest_pa") is not None:
                pair = (mapped, bare.get(scenario, {}))
                settling = [Cell(format_bounded(one.get("pressure_settling_s"))) for one in pair]
                rest = [Cell(format_bounded(one.get("pressure_rest_pa"))) for one in pair]
                rows.append([Cell(name, numeric=False), *settling, *rest])
    if rows:
        head = ("controller", "settles, s", "without the map", "at rest, Pa", "without the map")
        caption = "Pressure control with the piston clamped: time to within 2 % of a step, and largest error at rest."
        yield Grid(caption, head, rows)


def _titles(titles: Mapping[str, str]) -> Grid:
    rows = [[Cell(name, numeric=False), Cell(title, numeric=False)] for name, title in titles.items()]
    return Grid("The controllers.", ("controller", "control law"), rows, folded=True)


def _errors(signals: Table) -> Iterator[Drawing]:
    """Yield the error of all control laws over time, one figure for each scenario of position control."""
    for (scenario,), rows in signals.groups("scenario"):
        if np.isnan(rows["x_ref"]).all():
            continue
        caption = f"{scenario}: position error under each control law; linear up to 10 µm, logarithmic beyond."
        with drawing(caption, "time in s", "|reference − position| in µm", height=3.4) as one:
            for i, ((name,), mine) in enumerate(rows.groups("controller")):
                error = MICROMETRES_PER_METRE * np.abs(mine["x_ref"] - mine["x"])
                indices = envelope_indices([error], MAX_SAMPLES // 2)
                colour = GREY if name == "best" else PALETTE[(i - 1) % len(PALETTE)]
                width = 2.0 if name == "best" else 0.9
                one.axes.plot(mine["time"][indices], error[indices], color=colour, linewidth=width, label=str(name))
            one.axes.set_yscale("symlog", linthresh=10.0)
            one.axes.yaxis.set_major_formatter(ScalarFormatter())
            one.axes.yaxis.set_minor_locator(NullLocator())
            one.canvas.legend(loc="outside upper center", ncols=4)
        yield one


def _thesis(signals: Table) -> Iterator[Drawing]:
    """Yield figures 7.28 to 7.34 for the control law of the thesis, as far as the scenarios contain them."""
    bare = signals.where(controller=f"{THESIS_LAW}, no map")
    mine = signals.where(controller=THESIS_LAW)
    for (_,), rows in mine.groups("scenario"):
        if np.isnan(rows["x_ref"]).all():
            yield from _pressure(rows, bare)
            break
    if len(steps := mine.where(scenario="steps")):
        yield _position(steps)
        yield _inner(steps)
    loaded = [rows for _, rows in mine.groups("scenario") if np.any(rows["load"] != 0.0)]
    if loaded:
        yield _load(loaded[0], signals.where(scenario=loaded[0].text("scenario")))


def _pressure(rows: Table, bare: Table) -> Iterator[Drawing]:
    yield _pressures("Figure 7.28: pressure control, the piston clamped, with and without the inverse map.", rows, bare)
    jumps = np.flatnonzero(np.abs(np.diff(rows["p1_ref"])) > 0.0)
    if jumps.size:
        begin = float(rows["time"][jumps[0]])
        one = _pressures("Figure 7.29: the same, magnified about the first step.", rows, bare, begin)
        yield one
    further_figures = (
        ("Figure 7.30: voltage of the valve in pressure control.", "u", "valve command in V", 1.0),
        (
            "Figure 7.31: filtered disturbance of the pressure loop, as a gradient before the inverse map.",
            "flow_estimate", "estimate in bar/s", 1e-5,
        ),
    )  # fmt: skip
    for caption, column, title, scale in further_figures:
        with drawing(caption, "time in s", title) as one:
            values = scale * rows[column]
            indices = envelope_indices([values], MAX_SAMPLES)
            one.axes.plot(rows["time"][indices], values[indices], color=BLUE)
        yield one


def _pressures(caption: str, rows: Table, bare: Table, about: float | None = None) -> Drawing:
    with drawing(caption, "time in s", "pressure in bar") as one:
        for table, column, label, colour in (
            (rows, "p1_ref", "reference", GREY),
            (bare, "p1", "without the map", ORANGE),
            (rows, "p1", "with the map", BLUE),
        ):
            if not len(table):
                continue
            window = np.full(len(table), True) if about is None else np.abs(table["time"] - about) < PRESSURE_WINDOW
            one.axes.plot(
                table["time"][window], in_display_unit(table[column][window], "Pa"), color=colour, label=label
            )
        one.axes.legend(loc="upper right")
    return one


def _position(rows: Table) -> Drawing:
    with drawing("Figure 7.32: position control.", "time in s", "position in µm") as one:
        one.axes.plot(rows["time"], MICROMETRES_PER_METRE * rows["x_ref"], color=GREY, label="reference")
        one.axes.plot(rows["time"], MICROMETRES_PER_METRE * rows["x"], color=BLUE, label="position")
        one.axes.legend(loc="upper right")
    return one


def _inner(rows: Table) -> Drawing:
    caption = "Figure 7.33: the pressure of the inner loop and its reference from the position loop."
    with drawing(caption, "time in s", "pressure in bar") as one:
        for column, label, colour in (("p1_ref", "reference", GREY), ("p1", "pressure of chamber 1", BLUE)):
            values = in_display_unit(rows[column], "Pa")
            indices = envelope_indices([values], MAX_SAMPLES)
            one.axes.plot(rows["time"][indices], values[indices], color=colour, label=label, linewidth=0.9)
        one.axes.legend(loc="upper right")
    return one


def _load(rows: Table, signals: Table) -> Drawing:
    caption = (
        "Figure 7.34: the estimate of the disturbance against the known load. An observer with the friction a22(v) "
        "(7.5, 7.6) estimates the load; one without it estimates the sum of load and dry friction."
    )
    titles = [THESIS_LAW, *(f"{THESIS_LAW}, {choice}" for choice in OBSERVER_CHOICES), "best"]
    with drawing(caption, "time in s", "force in N") as one:
        one.axes.plot(rows["time"], rows["load"], color=GREY, linewidth=2.5, label="load")
        for title, colour in zip(titles, (BLUE, ORANGE, ORANGE, GREEN), strict=True):
            if len(table := signals.where(controller=title)):
                kept = envelope_indices([table["load_estimate"]], MAX_SAMPLES)
                one.axes.plot(table["time"][kept], table["load_estimate"][kept], color=colour, label=title)
        one.axes.legend(loc="upper right")
    return one
