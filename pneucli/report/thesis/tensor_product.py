"""The tensor-product models of friction: weighting functions and vertices."""

from pneucli.messages.formatting import format_quantity, in_display_unit
from pneucli.report.figure import Drawing, drawing, figures
from pneucli.report.page_elements import Grid, Part, Row, Section
from pneucli.report.report_data import ReportData, Table
from pneucli.report.sections.friction import MODELS

PLACE = 30  # on the page
MIN_WEIGHT_RANGE = 0.02


def section(material: ReportData) -> Section | None:
    """Return the weights over velocity and the vertices; absent where there is no tensor-product model."""
    weights = material.table("identify/tp_weights")
    if not len(weights):
        return None
    drawings = [_weights(str(model), str(branch), rows) for (model, branch), rows in weights.groups("model", "branch")]
    parts: list[Part] = [*figures(drawings)]
    if len(vertices := material.table("identify/tp_vertices")):
        parts.append(_vertices(vertices))
    lead = (
        "a22(v), friction over mass and velocity, as a convex combination of vertex systems: at every velocity the "
        "weights are non-negative and sum to one."
    )
    return Section("tensor", "Tensor-product models", lead, parts)


def _weights(model: str, branch: str, rows: Table) -> Drawing:
    of_branch = "" if branch == "both" else f", {branch}"
    caption = f"Weighting functions of model {model} ({MODELS.get(model, '')}){of_branch}, over the range of change."
    with drawing(caption, "velocity in mm/s", "weight", height=2.3) as one:
        for (vertex,), of_vertex in rows.groups("vertex"):
            one.axes.plot(
                in_display_unit(of_vertex["v"], "m/s"), of_vertex["weight"], label=f"vertex {int(vertex) + 1}"
            )
        one.axes.set_xlim(_bend(rows))
        one.axes.set_ylim(-0.03, 1.03)
        one.axes.legend()
    return one


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
