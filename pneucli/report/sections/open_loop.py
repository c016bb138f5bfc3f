"""Open-loop scenarios: a free run of the model from start to end."""

import numpy as np

from pneucli.messages.envelope import envelope_indices
from pneucli.messages.formatting import in_display_unit, unit_symbol
from pneucli.messages.simulate import CHANNEL_TITLES, Answer
from pneucli.report.page_elements import (
    MAX_UNFOLDED_ROWS,
    ZOOM_HINT,
    Grid,
    Panel,
    Part,
    PlotRun,
    Section,
    Series,
    ZoomPlot,
)
from pneucli.report.report_data import ReportData, Table

PLACE = 130  # on the page
MAX_SAMPLES = 800  # samples of a curve


def section(material: ReportData) -> Section | None:
    """Return metrics and zoomable plots of the open-loop scenarios; absent where none was simulated."""
    table = material.table("simulate/open_loop")
    if not len(table):
        return None
    parts: list[Part] = [_zoom(table)]
    rows = [row for one in material.read(Answer).open_loop for row in one.rows]
    if rows:
        parts.insert(0, Grid("Results of each scenario.", CHANNEL_TITLES, rows, folded=len(rows) > MAX_UNFOLDED_ROWS))
    lead = (
        "The model runs freely on its inputs and never restarts from the measurement; errors that the comparison above "
        "forgets at each restart accumulate here."
    )
    return Section("open-loop", "Open loop", lead, parts, folded=True)


def _zoom(table: Table) -> ZoomPlot:
    runs = [
        PlotRun(str(scenario), [_panel(str(channel), part) for (channel,), part in rows.groups("channel")])
        for (scenario,), rows in table.groups("scenario")
    ]
    return ZoomPlot("open-loop", "", runs, ZOOM_HINT)


def _panel(channel: str, rows: Table) -> Panel:
    unit = rows.text("unit")
    role = "input" if channel in ("u", "u2") else "model"
    indices = envelope_indices([rows["value"]], MAX_SAMPLES)
    curves = [Series(role, role, in_display_unit(rows["value"][indices], unit))]
    if np.isfinite(rows["measured"]).any():
        curves.insert(0, Series("measured", "measured", in_display_unit(rows["measured"][indices], unit)))
    return Panel(channel, unit_symbol(unit), rows["time"][indices], curves)
