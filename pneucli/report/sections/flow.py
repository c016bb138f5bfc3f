"""The steady flow bench: conductance over pressure ratio, flow over pressure, and C, b, m of each opening."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from pneucli.messages.findings import LITRES_PER_MINUTE
from pneucli.messages.flow import FLOW_COLUMNS, LITRES_PER_BAR, Flow
from pneucli.messages.formatting import format_plain, format_quantity, in_display_unit
from pneucli.messages.identify import Answer
from pneucli.report.figure import GREY, Line, chart, evenly_chosen, rank_colour
from pneucli.report.page_elements import Figure, Grid, Note, Part, Section
from pneucli.report.report_data import ReportData, Table
from pneucli.report.sections.uncertainty import budget_tables

PLACE = 40  # on the page
MAX_LABELS = 7  # openings in a legend


def section(material: ReportData) -> Section | None:
    """Return the steady bench; absent where none was recorded."""
    identified, rows = material.read(Answer), material.table("identify/flow_rows")
    if (answer := identified.flow) is None or not len(rows):
        return None
    parts: list[Part] = [Note(f"{one.text}.", "warning") for one in answer.findings]
    parts.append(_table(answer))
    parts += budget_tables(identified.budgets, "valve.")
    parts += [_conductance(rows), _residual(rows)]
    if len(grid := material.table("identify/flow_map")):
        parts.append(_over_pressure(grid))
    lead = (
        "Flow-rate characteristics by ISO 6358-1 from rows of steady flow: sonic conductance C, critical ratio b, "
        "subsonic index m, and the cracking pressure where the rows show one."
    )
    return Section("flow", "Steady flow bench", lead, parts)


def _table(answer: Flow) -> Grid:
    caption = "Intervals: k = 2, lack of fit included. An asterisk: typical values of valves hold it, the rows do not."
    return Grid(caption, FLOW_COLUMNS, [path.row for path in answer.paths])


def _openings(rows: Table) -> list[tuple[str, Any, Table]]:
    """Return name, colour and rows of each flow path."""
    groups = list(rows.groups("path"))
    return [(str(name) or "one opening", rank_colour(i, len(groups)), of) for i, ((name,), of) in enumerate(groups)]


def _conductance(rows: Table) -> Figure:
    lines = []
    for name, colour, of in (openings := _openings(rows)):
        order = np.argsort(of["ratio"])
        ratio = of["ratio"][order]
        measured, fitted = (LITRES_PER_BAR * of[n][order] for n in ("conductance", "conductance_fitted"))
        lines += [Line(ratio, measured, colour=colour, style=".", size=4), Line(ratio, fitted, name, colour, width=1)]
    caption = (
        "Flow over the upstream pressure, at the reference temperature: measured (dots) and by C, b and m (lines). "
        "The flat part is choked flow."
    )
    return _over_ratio(caption, "conductance in l/(s bar)", lines, len(openings))


def _residual(rows: Table) -> Figure:
    openings = _openings(rows)
    lines = [
        Line(of["ratio"], of["residual"] / of["deviation"], name, colour, ".", size=4) for name, colour, of in openings
    ]
    band: Callable[[Axes], object] = lambda axes: axes.axhspan(-2, 2, color=GREY, alpha=0.2, linewidth=0)  # noqa: E731
    caption = "Measured less fitted flow over the scatter of neighbouring rows; the band is twice that scatter."
    return _over_ratio(caption, "residual, × noise", lines, len(openings), extra=band)


def _over_ratio(caption: str, y: str, lines: Sequence[Line], openings: int, **more: Any) -> Figure:
    """Return a chart over the pressure ratio, with a legend where there are few openings."""
    legend = "best" if openings <= MAX_LABELS else ""
    return chart(caption, "downstream / upstream pressure", y, *lines, legend=legend, **more)


def _over_pressure(grid: Table) -> Figure:
    supply = float(np.max(grid["p_supply"]))
    at = grid.where(p_supply=supply)
    levels = np.unique(at["u"][np.isfinite(at["u"])])
    chosen = [*evenly_chosen(levels, MAX_LABELS)] or [None]
    lines = []
    for i, u in enumerate(chosen):
        rows = at if u is None else at.where(u=u)
        low, flow, high = (LITRES_PER_MINUTE * rows[f"flow{end}"] for end in ("_ci_low", "", "_ci_high"))
        label = "one opening" if u is None else f"{format_plain(u, 4)} V"
        p, colour = in_display_unit(rows["p"], "Pa"), rank_colour(i, len(chosen))
        lines.append(Line(p, flow, label, colour, band=(low, high)))
    caption = f"The flow map at a supply of {format_quantity(supply, 'Pa', 3)}, with its 95 % band."
    return chart(caption, "downstream pressure in bar", "flow in l/min ANR", *lines, legend="best")
