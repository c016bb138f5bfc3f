"""The tensor-product models of friction: weighting functions and vertices."""

from typing import Any

from pneucli.messages.formatting import format_quantity, in_display_unit
from pneucli.report.figure import Line, chart
from pneucli.report.page_elements import Figure, Grid, Part, Row, Section
from pneucli.report.report_data import ReportData, Table
from pneucli.report.sections.friction import MODELS

PLACE = 30  # on the page
MIN_WEIGHT_RANGE = 0.02


def section(material: ReportData) -> Section | None:
    """Return the weights over velocity and the vertices; absent where there is no tensor-product model."""
    weights = material.table("identify/tp_weights")
    if not len(weights):
        return None
    groups = weights.groups("model", "branch")
    parts: list[Part] = [_weights(str(model), str(branch), rows) for (model, branch), rows in groups]
    if len(vertices := material.table("identify/tp_vertices")):
        parts.append(_vertices(vertices))
    lead = (
        "a22(v), friction over mass and velocity, as a convex combination of vertex systems: at every velocity the "
        "weights are non-negative and sum to one."
    )
    return Section("tensor", "Tensor-product models", lead, parts)


def _weights(model: str, branch: str, rows: Table) -> Figure:
    of_branch = "" if branch == "both" else f", {branch}"
    caption = f"Weighting functions of model {model} ({MODELS.get(model, '')}){of_branch}, over the range of change."
    lines = [
        Line(in_display_unit(one["v"], "m/s"), one["weight"], f"vertex {int(vertex) + 1}")
        for (vertex,), one in rows.groups("vertex")
    ]
    look: dict[str, Any] = {"legend": "best", "height": 2.3, "xlim": _bend(rows), "ylim": (-0.03, 1.03)}
    return chart(caption, "velocity in mm/s", "weight", *lines, **look)


def _bend(rows: Table) -> tuple[float, float]:
    """Return the range of velocity (mm/s) outside of which no weight changes by more than 2 %."""
    bent = in_display_unit(
        rows["v"][(rows["weight"] > MIN_WEIGHT_RANGE) & (rows["weight"] < 1 - MIN_WEIGHT_RANGE)], "m/s"
    )
    whole = in_display_unit(rows["v"], "m/s")
    if not bent.size:
        return float(whole.min()), float(whole.max())
    return float(max(whole.min(), 1.5 * bent.min())), float(min(whole.max(), 1.5 * bent.max()))


def _vertices(vertices: Table) -> Grid:
    rows: list[Row] = []
    for (model, branch), of_branch in vertices.groups("model", "branch"):
        values = ", ".join(format_quantity(float(a), "1/s") for a in of_branch["a22"])
        rows.append([str(model), str(branch), values])
    return Grid("Vertices a22 of each model.", ("model", "branch", "vertices"), rows)
