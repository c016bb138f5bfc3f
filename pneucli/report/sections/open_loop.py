"""Open-loop scenarios: the model alone, from the start to the end."""

from __future__ import annotations

import numpy as np

from pneucli.report.decimate import envelope
from pneucli.report.material import Material, Table
from pneucli.report.parts import Cell, Grid, Panel, Part, Run, Section, Series, Zoom
from pneucli.report.shown import number, quantity, shown, shown_unit

MOST = 800  # samples of a curve


def section(material: Material) -> Section | None:
    """Return metrics and zoomable plots of the open-loop scenarios; absent where none was simulated."""
    table = material.table("simulate/open_loop")
    if not len(table):
        return None
    parts: list[Part] = [_zoom(table)]
    scenarios = material.answer("simulate").get("open_loop", [])
    rows = [
        [
            Cell(one["scenario"], numeric=False),
            Cell(m["channel"], numeric=False),
            Cell(f"{quantity(m['from'], m['unit'], 3)} – {quantity(m['to'], m['unit'], 3)}"),
            Cell(quantity(m["end"], m["unit"], 3)),
            Cell(quantity(m["rmsd"], m["unit"], 3)),
            Cell("–" if m["fit_percent"] is None else f"{number(m['fit_percent'], 3)} %"),
        ]
        for one in scenarios
        for m in one["channels"]
    ]
    if rows:
        head = ("scenario", "channel", "range", "at the end", "RMSD from the recording", "fit")
        parts.insert(0, Grid("What the model does in each scenario.", head, rows, folded=len(rows) > 12))
    lead = (
        "The model runs on its inputs alone and is never set back to the measurement; errors that the comparison "
        "above forgets at each restart add up here."
    )
    return Section("open-loop", "Open loop", lead, parts)


def _zoom(table: Table) -> Zoom:
    runs = []
    for (scenario,), rows in table.groups("scenario"):
        panels = []
        for (channel,), of_channel in rows.groups("channel"):
            unit = of_channel.text("unit")
            kept = envelope([of_channel["value"]], MOST)
            curves = [
                Series(
                    "input" if channel == "u" else "model",
                    "input" if channel == "u" else "model",
                    shown(of_channel["value"][kept], unit),
                )
            ]
            if np.isfinite(of_channel["measured"]).any():
                curves.insert(0, Series("measured", "measured", shown(of_channel["measured"][kept], unit)))
            panels.append(Panel(str(channel), shown_unit(unit), of_channel["time"][kept], curves))
        runs.append(Run(str(scenario), panels))
    return Zoom("open-loop", "Drag over a stretch to zoom in, double-click to see all again.", runs)
