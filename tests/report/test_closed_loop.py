"""Closed loop and robustness: the figures of both controllers side by side, the harmful effects first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pneucli.closed_loop.metrics import Metrics
from pneucli.report import Check, ReportData
from pneucli.report.page_elements import Cell, Figure, Grid, Note, Section, ZoomPlot
from pneucli.report.sections.closed_loop import COMPENSATED, METRIC_TITLES, UNCOMPENSATED
from pneucli.report.sections.closed_loop import section as closed_loop
from pneucli.report.sections.robustness import section as robustness
from tests.report.bench import without
from tests.report.controlled import REACH, SCENARIOS


def texts(grid: Grid) -> dict[str, list[str]]:
    rows = [[c.text if isinstance(c, Cell) else c for c in row] for row in grid.rows]
    return {name: cells for name, *cells in rows}


def grids(section: Section | None) -> list[Grid]:
    assert section is not None
    return [part for part in section.parts if isinstance(part, Grid)]


@pytest.fixture(scope="module")
def section(material: ReportData) -> Section:
    found = closed_loop(material)
    assert found is not None
    return found


def test_every_figure_of_the_design_has_a_title() -> None:
    assert set(METRIC_TITLES) == set(Metrics.__annotations__)


def test_the_figures_are_next_to_each_other(section: Section) -> None:
    reached = next(grid for grid in grids(section) if grid.head[0] == "figure")
    assert list(reached.head[1:]) == list(SCENARIOS)
    assert texts(reached)["error at rest, µm"] == ["4.00 / 117", "5.00 / 5.00"]


def test_an_unreached_figure_differs_from_an_absent_one(section: Section) -> None:
    rows = texts(next(grid for grid in grids(section) if grid.head[0] == "figure"))
    # the answer has null for both: the PIDs only do not settle after the steps, and the load has no steps
    assert rows["within 50 µm after, s"] == ["0.750 / ∞", "–"]
    assert rows["load rejected to 50 µm after, s"] == ["–", "0.250 / ∞"]
    assert "reversals of the command, 1/s" not in rows  # which no scenario of these shows


def test_margins_have_a_table_with_the_excluded_points(section: Section) -> None:
    rows = texts(next(grid for grid in grids(section) if grid.head[0] == "loop cut"))
    assert rows["at the command"] == ["× any", "× 0.50", "29°", "2.4 ms", "0.40"]
    notes = [part.text for part in section.parts if isinstance(part, Note)]
    assert "the loop is not stable for small signals at 140 mm." in notes
    assert any("100 mm at any slow speed" in text for text in notes)
    assert "overlap of 0.40 V" in notes[-1]
    assert "play between command and opening" in notes[-1]


def test_the_design_lists_its_warnings_and_violations_of_the_matching_condition(section: Section) -> None:
    warned = [part for part in section.parts if isinstance(part, Note)]
    assert (warned[0].tone, warned[0].text) == ("warning", "no PDC: the input bound is too narrow.")
    rows = texts(next(grid for grid in grids(section) if grid.caption == "Design"))
    assert rows["whole system"] == ["the matching condition does not hold: friction and load acts on v"]
    assert rows["sliding sector"][0].endswith(
        "too steep for the sample time, so the law takes the sector of [design] eta"
    )
    assert rows["PDC, weights NO"] == ["none: infeasible"]
    assert rows["tolerance at rest"] == ["10.0 µm"]  # twice the reach of the bench


def test_the_chapter_has_the_checks_of_design_and_simulation(material: ReportData) -> None:
    failed = Check("simulate.closed_loop.steps.steady_um", "max 3", 4.0, "FAILED")
    found = grids(closed_loop(replace(material, checks=[*material.checks, failed])))
    assert list(texts(found[0])) == [failed.path]


def test_each_scenario_has_its_error_and_a_load_its_estimate(section: Section) -> None:
    captions = [part.caption for part in section.parts if isinstance(part, Figure)]
    assert [caption.split(":")[0] for caption in captions][1:] == ["steps", "load", "load"]
    assert f"± {2e6 * REACH:.1f} µm" in captions[1]


def test_the_plots_hold_the_error_in_micrometres_of_both_controllers(section: Section) -> None:
    (zoom,) = (part for part in section.parts if isinstance(part, ZoomPlot))
    assert [run.name for run in zoom.runs] == list(SCENARIOS)
    panels = {panel.title: panel for panel in zoom.runs[0].panels}
    assert "command of the second valve" not in panels
    error = {curve.label: curve.values for curve in panels["reference − position"].series}
    # the bench's runs are 4 um and 117 um off throughout
    assert np.allclose(error[COMPENSATED], 4.0)
    assert np.allclose(error[UNCOMPENSATED], 117.0)


def test_a_second_valve_has_its_panel(material: ReportData) -> None:
    table = material.table("simulate/closed_loop")
    driven = replace(table, columns={**table.columns, "u2": table["u"]})
    section = closed_loop(replace(material, tables={**material.tables, "simulate/closed_loop": driven}))
    assert section is not None
    (zoom,) = (part for part in section.parts if isinstance(part, ZoomPlot))
    assert "command of the second valve" in [panel.title for panel in zoom.runs[0].panels]


def test_without_a_simulation_only_the_design_is_shown(material: ReportData) -> None:
    found = closed_loop(without(material, "simulate"))
    assert [grid.head[0] for grid in grids(found)] == ["quantity", "loop cut"]


def test_harmful_effects_are_rows_and_the_others_a_sentence(material: ReportData) -> None:
    section = robustness(material)
    rates, medians = grids(section)
    assert texts(rates) == {
        "all runs": ["5 of 6; 120", "2 of 3; ∞"],
        "none": ["2 of 2; 4.00", "1 of 1; 0.300"],
        "presliding": ["1 of 2; 120", "0 of 1; ∞"],
    }
    tones = [[cell.tone for cell in row[1:] if isinstance(cell, Cell)] for row in rates.rows]
    assert tones == [["bad", "bad"], ["", ""], ["bad", "bad"]]
    assert section is not None
    assert [part.text for part in section.parts if isinstance(part, Note)] == ["Every check held with piston-leak."]
    # medians of two runs each: (3 + 4) / 2, (8 + 120) / 2, (4 + 5) / 2; of all six: (4 + 5) / 2
    assert {name: cells[0] for name, cells in texts(medians).items()} == {
        "all runs": "4.50",
        "none": "3.50",
        "presliding": "64.0",
        "piston-leak": "4.50",
    }


def test_without_a_study_there_is_no_robustness(material: ReportData) -> None:
    answers = {**material.answers, "simulate": {"open_loop": []}}
    assert robustness(replace(material, answers=answers)) is None
