"""Closed loop and robustness: the figures of both controllers side by side, the harmful effects first."""

from dataclasses import replace

from pneucli.closed_loop.metrics import Metrics
from pneucli.report.page_elements import Cell, Grid, Section, ZoomPlot
from pneucli.report.report_data import Check, ReportData
from pneucli.report.sections.closed_loop import METRIC_TITLES
from pneucli.report.sections.closed_loop import section as closed_loop
from pneucli.report.sections.robustness import section as robustness


def texts(grid: Grid) -> dict[str, list[str]]:
    rows = [[c.text if isinstance(c, Cell) else c for c in row] for row in grid.rows]
    return {name: cells for name, *cells in rows}


def grids(section: Section | None) -> list[Grid]:
    assert section is not None
    return [part for part in section.parts if isinstance(part, Grid)]


def test_every_figure_of_the_design_has_a_title() -> None:
    assert set(METRIC_TITLES) == set(Metrics.__annotations__)


def test_the_chapter_has_the_checks_of_design_and_simulation(material: ReportData) -> None:
    failed = Check("simulate.closed_loop.steps.steady_um", "max 3", 4.0, "FAILED")
    found = grids(closed_loop(replace(material, checks=[*material.checks, failed])))
    assert list(texts(found[0])) == [failed.path]


def test_a_second_valve_has_its_panel(material: ReportData) -> None:
    table = material.table("simulate/closed_loop")
    driven = replace(table, columns={**table.columns, "u2": table["u"]})
    section = closed_loop(replace(material, tables={**material.tables, "simulate/closed_loop": driven}))
    assert section is not None
    (zoom,) = (part for part in section.parts if isinstance(part, ZoomPlot))
    assert "command of the second valve" in [panel.title for panel in zoom.runs[0].panels]


def test_without_a_study_there_is_no_robustness(material: ReportData) -> None:
    answers = {**material.answers, "simulate": {"open_loop": []}}
    assert robustness(replace(material, answers=answers)) is None
