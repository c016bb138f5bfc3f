"""Logs of a running controller: the predicted and the measured figures of the loop."""

from pneucli.messages import compare
from pneucli.report.page_elements import Grid, Part, Section
from pneucli.report.report_data import ReportData

PLACE = 100  # on the page


def section(material: ReportData) -> Section | None:
    """Return a table for each log; absent where no log belongs to an exported controller."""
    found = material.read(compare.Answer).closed_loop
    parts: list[Part] = [
        Grid(
            f"{one.recording}: controller {one.controller}, {one.precision}, hash {one.hash[:12]}.",
            compare.COLUMN_TITLES,
            [*one.rows],
        )
        for one in found
    ]
    lead = (
        "The model with this controller under the logged references, compared with the machine. Where the command that "
        "is computed from the logged readings equals the logged one (channel u of the comparison), the machine runs "
        "the exported controller, and any difference comes from the axis: the diagnosis names it."
    )
    return Section("logs", "On the machine", lead, parts) if parts else None
