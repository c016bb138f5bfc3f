"""The steady flow bench: conductance over pressure ratio, flow over pressure, and C, b, m of each opening."""

from __future__ import annotations

from typing import Any

import numpy as np

from pneucli.messages.findings import LITRES_PER_MINUTE
from pneucli.messages.flow import FLOW_COLUMNS, LITRES_PER_BAR, Flow
from pneucli.messages.formatting import format_plain, format_quantity, in_display_unit
from pneucli.messages.identify import Answer
from pneucli.report.figure import GREY, Drawing, drawing, figures, rank_colour
from pneucli.report.page_elements import Grid, Note, Part, Section
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
    drawings = [_conductance(rows), _residual(rows)]
    if len(grid := material.table("identify/flow_map")):
        drawings.append(_over_pressure(grid))
    parts += figures(drawings)
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


def _legend(one: Drawing, count: int) -> None:
    if count <= MAX_LABELS:
        one.axes.legend()


def _conductance(rows: Table) -> Drawing:
    caption = (
        "Flow over the upstream pressure, at the reference temperature: measured (dots) and by C, b and m (lines). "
        "The flat part is choked flow."
    )
    openings = _openings(rows)
    with drawing(caption, "downstream / upstream pressure", "conductance in l/(s bar)") as one:
        for name, colour, of in openings:
            order = np.argsort(of["ratio"])
            ratio = of["ratio"][order]
            one.axes.plot(ratio, LITRES_PER_BAR * of["conductance"][order], ".", color=colour, markersize=4)
            one.axes.plot(
                ratio, LITRES_PER_BAR * of["conductance_fitted"][order], color=colour, label=name, linewidth=1
            )
        _legend(one, len(openings))
    return one


def _residual(rows: Table) -> Drawing:
    caption = "Measured less fitted flow over the scatter of neighbouring rows; the band is twice that scatter."
    openings = _openings(rows)
    with drawing(caption, "downstream / upstream pressure", "residual, × noise") as one:
        one.axes.axhspan(-2, 2, color=GREY, alpha=0.2, linewidth=0)
        for name, colour, of in openings:
            one.axes.plot(of["ratio"], of["residual"] / of["deviation"], ".", color=colour, markersize=4, label=name)
        _legend(one, len(openings))
    return one


def _over_pressure(grid: Table) -> Drawing:
    supply = float(np.max(grid["p_supply"]))
    at = grid.where(p_supply=supply)
    levels = np.unique(at["u"][np.isfinite(at["u"])])
    chosen = (
        levels[np.unique(np.linspace(0, levels.size - 1, MAX_LABELS).round().astype(int))] if levels.size else [None]
    )
    caption = f"The flow map at a supply of {format_quantity(supply, 'Pa', 3)}, with its 95 % band."
    with drawing(caption, "downstream pressure in bar", "flow in l/min ANR") as one:
        for i, u in enumerate(chosen):
            rows = at if u is None else at.where(u=u)
            p, colour = in_display_unit(rows["p"], "Pa"), rank_colour(i, len(chosen))
            low, high = (LITRES_PER_MINUTE * rows[f"flow_ci_{end}"] for end in ("low", "high"))
            one.axes.fill_between(p, low, high, color=colour, alpha=0.25, linewidth=0)
            label = "one opening" if u is None else f"{format_plain(u, 4)} V"
            one.axes.plot(p, LITRES_PER_MINUTE * rows["flow"], color=colour, label=label)
        one.axes.legend()
    return one
