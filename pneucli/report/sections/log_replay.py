"""Logs of a running controller: what was foretold of the loop beside what came."""

from __future__ import annotations

from pneucli.messages import controller_logs
from pneucli.report.page_elements import Cell, Grid, Part, Section
from pneucli.report.report_data import ReportData


def section(material: ReportData) -> Section | None:
    """Return a table a log; absent where no controller was logged whose numbers are known."""
    found = material.answer("compare").get("closed_loop", [])
    parts: list[Part] = [
        Grid(
            f"{one['recording']}: controller {one['controller']}, {one['precision']}, hash {one['hash'][:12]}.",
            controller_logs.COLUMN_TITLES,
            [
                [Cell(title, numeric=False), Cell(told), Cell(came)]
                for title, told, came in controller_logs.figure_rows(one)
            ],
        )
        for one in found
    ]
    lead = (
        "The model with this controller in it, under the references that were logged, against the machine. Where the "
        "command that is replayed from the readings is the one that was logged (channel u of the comparison), the "
        "controller is the one that was exported, and what differs is the axis: the diagnosis names it."
    )
    return Section("logs", "On the machine", lead, parts) if parts else None
