"""Comparison of control laws: results, the benefit of the inverse map and of each component."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from pneucli.messages.design import ENSEMBLE_TITLES, LAW_LEGEND, LAW_TITLES, Answer, Cases, law_rows, shortcomings
from pneucli.messages.formatting import format_bounded
from pneucli.report.figure import GREY, PALETTE, Line, chart, logarithmic_beyond, reduced
from pneucli.report.page_elements import Figure, Grid, Note, Part, Row, Section
from pneucli.report.report_data import ReportData, Table

PLACE = 110  # on the page
MAX_SAMPLES = 800  # samples of a curve
MICROMETRES_PER_METRE = 1e6


def section(material: ReportData) -> Section | None:
    """Return the comparison of control laws; absent where no controller was designed."""
    design = material.read(Answer)
    if not design.compare:
        return None
    signals = material.table("design/comparison_signals")
    tolerance = design.tolerance_um
    parts: list[Part] = [_grid("Results of each controller", design.compare, tolerance)]
    if poor := shortcomings(design.compare, tolerance):
        parts.append(Note(f"With set-valued friction at rest {'; '.join(poor)}."))
    parts += [Note(f"Not designed: {name}: {why}.", "warning") for name, why in design.not_made.items()]
    if rigs := design.ensemble:
        parts += [Note(line) for line in rigs.promise]
        caption = "Figures over their limits on the rigs of the ensemble, median; worst"
        parts.append(Grid(f"{caption}: 1 × is the limit.", ENSEMBLE_TITLES, [*rigs.rows]))
    if design.ablation:
        parts.append(_grid("Results of best without one component, otherwise unchanged", design.ablation, tolerance))
    if design.variants:
        parts.append(_grid("Choices of a law that [design] does not select", design.variants, tolerance))
    parts.append(_grid("The same controllers without the inverse of the valve's map", design.without_map, tolerance))
    parts += _pressure_control(design)
    parts.append(Grid("The controllers.", ("controller", "control law"), [*design.controllers.items()], folded=True))
    if len(signals):
        parts += _errors(signals)
    lead = (
        "The same axis, sensors and scenarios under each control law. Each law follows its equations in the source "
        "thesis and can be exported."
    )
    return Section("bench", "Comparison of controllers", lead, parts, folded=True)


def _grid(caption: str, cases: Cases, tolerance: float) -> Grid:
    return Grid(f"{caption}: {LAW_LEGEND}.", ("controller", *LAW_TITLES), [*law_rows(cases, tolerance)])


def _pressure_control(design: Answer) -> Iterator[Grid]:
    """Yield settling time and error of pressure control, with and without the inverse valve map."""
    rows: list[Row] = []
    for name, by_scenario in design.compare.items():
        bare = design.without_map.get(f"{name}, no map", {})
        for scenario, mapped in by_scenario.items():
            if mapped.get("pressure_rest_pa") is not None:
                pair = (mapped, bare.get(scenario, {}))
                settling = [format_bounded(one.get("pressure_settling_s")) for one in pair]
                rest = [format_bounded(one.get("pressure_rest_pa")) for one in pair]
                rows.append([name, *settling, *rest])
    if rows:
        head = ("controller", "settles, s", "without the map", "at rest, Pa", "without the map")
        caption = "Pressure control with the piston clamped: time to within 2 % of a step, and largest error at rest."
        yield Grid(caption, head, rows)


def _errors(signals: Table) -> Iterator[Figure]:
    """Yield the error of all control laws over time, one figure for each scenario of position control."""
    for (scenario,), rows in signals.groups("scenario"):
        if np.isnan(rows["x_ref"]).all():
            continue
        caption = f"{scenario}: position error under each control law; linear up to 10 µm, logarithmic beyond."
        lines = []
        for i, ((name,), mine) in enumerate(rows.groups("controller")):
            error = MICROMETRES_PER_METRE * np.abs(mine["x_ref"] - mine["x"])
            look = (GREY, "-", 2.0) if name == "best" else (PALETTE[(i - 1) % len(PALETTE)], "-", 0.9)
            lines.append(reduced(Line(mine["time"], error, str(name), *look), MAX_SAMPLES // 2))
        titles = ("time in s", "|reference − position| in µm")
        far = partial(logarithmic_beyond, linear=10.0)
        yield chart(caption, *titles, *lines, legend="outside upper center", ncols=4, height=3.4, extra=far)
