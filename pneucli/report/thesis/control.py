"""The control law of the thesis on this axis: figures 7.28 to 7.34, as far as the scenarios contain them."""

from collections.abc import Iterator

import numpy as np

from pneucli.messages.formatting import in_display_unit
from pneucli.report.figure import BLUE, GREEN, GREY, ORANGE, Line, chart, reduced
from pneucli.report.page_elements import Figure, Section
from pneucli.report.report_data import ReportData, Table

PLACE = 20  # on the page
MAX_SAMPLES = 800  # samples of a curve
MICROMETRES_PER_METRE = 1e6
THESIS_LAW = "compensated"  # the control law in the figures of the thesis
OBSERVER_CHOICES = ("friction in the observer", "friction compensated")  # of THESIS_LAW; the selected one is absent
PRESSURE_WINDOW = 0.25  # s on each side of a pressure step in the magnified figure
TIME, PRESSURE = "time in s", "pressure in bar"


def section(material: ReportData) -> Section | None:
    """Return the figures; absent where the laws were not compared."""
    signals = material.table("design/comparison_signals")
    drawn = [*_figures(signals)] if len(signals) else []
    lead = f"The law {THESIS_LAW} with the observers of the thesis, on this axis."
    return Section("thesis-control", "Control in the thesis", lead, drawn) if drawn else None


def _figures(signals: Table) -> Iterator[Figure]:
    mine, bare = signals.where(controller=THESIS_LAW), signals.where(controller=f"{THESIS_LAW}, no map")
    for (_,), rows in mine.groups("scenario"):
        if np.isnan(rows["x_ref"]).all():
            yield from _pressure(rows, bare)
            break
    if len(steps := mine.where(scenario="steps")):
        yield _position(steps)
        yield _inner(steps)
    if loaded := [rows for _, rows in mine.groups("scenario") if np.any(rows["load"] != 0.0)]:
        yield _load(loaded[0], signals.where(scenario=loaded[0].text("scenario")))


def _pressure(rows: Table, bare: Table) -> Iterator[Figure]:
    yield _pressures("Figure 7.28: pressure control, the piston clamped, with and without the inverse map.", rows, bare)
    jumps = np.flatnonzero(np.abs(np.diff(rows["p1_ref"])) > 0.0)
    if jumps.size:
        begin = float(rows["time"][jumps[0]])
        yield _pressures("Figure 7.29: the same, magnified about the first step.", rows, bare, begin)
    filtered = "Figure 7.31: filtered disturbance of the pressure loop, as a gradient before the inverse map."
    for caption, values, title in (
        ("Figure 7.30: voltage of the valve in pressure control.", rows["u"], "valve command in V"),
        (filtered, 1e-5 * rows["flow_estimate"], "estimate in bar/s"),
    ):
        yield chart(caption, TIME, title, reduced(Line(rows["time"], values, colour=BLUE), MAX_SAMPLES))


def _pressures(caption: str, rows: Table, bare: Table, about: float | None = None) -> Figure:
    lines = []
    for table, column, label, colour in (
        (rows, "p1_ref", "reference", GREY),
        (bare, "p1", "without the map", ORANGE),
        (rows, "p1", "with the map", BLUE),
    ):
        if len(table):
            window = np.full(len(table), True) if about is None else np.abs(table["time"] - about) < PRESSURE_WINDOW
            lines.append(Line(table["time"][window], in_display_unit(table[column][window], "Pa"), label, colour))
    return chart(caption, TIME, PRESSURE, *lines, legend="upper right")


def _position(rows: Table) -> Figure:
    return chart(
        "Figure 7.32: position control.",
        TIME,
        "position in µm",
        Line(rows["time"], MICROMETRES_PER_METRE * rows["x_ref"], "reference", GREY),
        Line(rows["time"], MICROMETRES_PER_METRE * rows["x"], "position", BLUE),
        legend="upper right",
    )


def _inner(rows: Table) -> Figure:
    curves = (("p1_ref", "reference", GREY), ("p1", "pressure of chamber 1", BLUE))
    lines = (
        Line(rows["time"], in_display_unit(rows[c], "Pa"), label, colour, width=0.9) for c, label, colour in curves
    )
    caption = "Figure 7.33: the pressure of the inner loop and its reference from the position loop."
    return chart(caption, TIME, PRESSURE, *(reduced(one, MAX_SAMPLES) for one in lines), legend="upper right")


def _load(rows: Table, signals: Table) -> Figure:
    caption = (
        "Figure 7.34: the estimate of the disturbance against the known load. An observer with the friction a22(v) "
        "(7.5, 7.6) estimates the load; one without it estimates the sum of load and dry friction."
    )
    titles = [THESIS_LAW, *(f"{THESIS_LAW}, {choice}" for choice in OBSERVER_CHOICES), "best"]
    estimates = [
        reduced(Line(table["time"], table["load_estimate"], title, colour), MAX_SAMPLES)
        for title, colour in zip(titles, (BLUE, ORANGE, ORANGE, GREEN), strict=True)
        if len(table := signals.where(controller=title))
    ]
    load = Line(rows["time"], rows["load"], "load", GREY, width=2.5)
    return chart(caption, TIME, "force in N", load, *estimates, legend="upper right")
