"""One colour, one label and one count for one thing, in every chapter and on the page of a plan."""

import re
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.closed_loop.metrics import Metrics
from pneucli.figure import read
from pneucli.messages import diagnose, envelope
from pneucli.messages.plan import Answer
from pneucli.plan.bench import Outcome
from pneucli.plan.power import Difference, Prediction
from pneucli.report import figure, overview
from pneucli.report.page_elements import ZOOM_HINT, Cell, Figure, Grid, Section, ZoomPlot
from pneucli.report.plan_page import plan_page
from pneucli.report.report_data import Check, ReportData, Table
from pneucli.report.sections.closed_loop import METRIC_TITLES
from pneucli.report.sections.closed_loop import section as closed_loop
from pneucli.report.sections.error_location import _states
from pneucli.report.sections.robustness import section as robustness
from pneucli.report.thesis import figures as thesis_laws
from tests.messages.stored_calls import stored
from tests.report.bench import fallen, whole

# the package has sections of the same names
comparison: Any = import_module("pneucli.report.sections.comparison")
diagnosis: Any = import_module("pneucli.report.sections.diagnosis")
CSS = (Path(figure.__file__).parent / "assets" / "page.css").read_text(encoding="utf-8")


def table(**columns: Any) -> Table:
    return Table({name: np.asarray(values) for name, values in columns.items()})


def channel(model: list[float], residual: list[float]) -> Table:
    n = len(model)
    return table(
        time=np.arange(float(n)), unit=["m"] * n, measured=[1.0] * n, model=model, residual=residual, segment=[0] * n
    )


def test_before_and_after_have_the_colours_of_the_figures() -> None:
    light = CSS.partition("@media")[0]
    assert f"--before: {figure.BLUE}" in light
    assert f"--model: {figure.ORANGE}" in light


def test_a_first_model_that_coincides_with_the_present_one_is_left_out() -> None:
    measured = np.linspace(0.0, 1.0, 50)
    now = table(
        time=np.arange(50.0), unit=["m"] * 50, measured=measured, model=measured + 0.01, residual=[-0.01] * 50,
        segment=[0] * 50,
    )  # fmt: skip
    same = Table({**{name: now[name] for name in ("measured", "time")}, "model": now["model"] + 1e-5})
    other = Table({**{name: now[name] for name in ("measured", "time")}, "model": now["model"] + 0.1})
    names = [
        [s.label.partition(",")[0] for s in comparison.channel_panel("x", now, b, 400).series] for b in (same, other)
    ]
    assert names == [["measured", "model"], ["measured", "before", "after"]]


def test_no_line_crosses_a_gap_however_short() -> None:
    values = np.sin(np.arange(5000.0))
    values[2345] = np.nan
    kept = envelope.with_gap_indices(envelope.envelope_indices([np.nan_to_num(values)], 100), values)
    assert 2345 in kept
    assert (np.diff(kept) > 0).all()


def test_curves_of_two_branches_that_coincide_have_no_figure() -> None:
    up = {"coulomb": 10.0, "viscous": 50.0, "static": 10.0, "velocity": 0.01}
    assert not thesis_laws._branches_differ({"accelerating": up, "slowing": {"coulomb": 10.0, "viscous": 50.0}})
    assert thesis_laws._branches_differ({"accelerating": up, "slowing": {"coulomb": 6.0, "viscous": 50.0}})
    assert not thesis_laws._branches_differ({"accelerating": up, "slowing": {}})


def test_a_model_without_stribeck_friction_has_no_figure_of_branches() -> None:
    """Model D of a carriage without Stribeck friction has no velocity."""
    rows = [("D", "accelerating", "coulomb", 1.0), ("D", "slowing", "coulomb", 2.0)]
    columns = dict(zip(("model", "branch", "name", "value"), map(list, zip(*rows, strict=True)), strict=True))
    material: Any = SimpleNamespace(table=lambda name: table(**columns))
    assert list(thesis_laws.friction_laws(material)) == []


def test_a_reason_stands_once_however_many_effects_it_refuses() -> None:
    refused = [{"effect": f"e{i}", "reason": "not-promising", "why": "a. b", "supported": False} for i in range(43)]
    grid = diagnosis._candidates([read(diagnose.CandidateAnswer, one) for one in refused], [])
    assert isinstance(grid, Grid)
    assert grid.caption.startswith("All 43 candidates, 0 of them fitted")
    texts = [cell if isinstance(cell, str) else cell.text for row in grid.rows for cell in row]
    assert texts.count(diagnose.REJECTION_REASONS["not-promising"]) == 1
    assert "e42" in texts[0]


@pytest.mark.parametrize(
    ("answer", "line"),
    [
        ({"missing": ["piston-leak"], "verdict": "missing-effect", "next_experiment": "Record p2. Slowly."},
         "Next: pneucli add rig.toml --suggested"),
        ({"missing": [], "verdict": "unexplained", "next_experiment": "To test stribeck: Vent both chambers. Pull."},
         "Next: to test stribeck, see the chapter Evidence"),
        ({"missing": [], "verdict": "unexplained", "next_experiment": "In force (mechanics: friction). Record p2."},
         "Next: the experiment in the chapter Evidence"),
        ({"missing": [], "verdict": "adequate", "next_experiment": None}, ""),  # "run" wrote this page
    ],
)  # fmt: skip
def test_the_next_step_is_one_line(answer: dict[str, Any], line: str) -> None:
    material = ReportData("rig", {"diagnose": answer, "simulate": {}}, file="rig.toml")
    assert overview._next_command(material) == line


def test_a_bench_without_an_axis_has_no_card_of_a_controller() -> None:
    assert overview._controller(ReportData("rig", {"simulate": {"open_loop": []}})) is None


def test_maps_may_go_over_the_difference_of_the_pressures() -> None:
    states = _states(table(time=[0.0, 1.0], p1=[3e5, 4e5], p2=[1e5, 1e5]), None)
    np.testing.assert_array_equal(states["p1 - p2"], [2e5, 3e5])


def test_what_only_a_screen_can_do_is_not_printed() -> None:
    sections = Path(figure.__file__).parent / "sections"
    assert "Drag" in ZOOM_HINT
    assert [path.name for path in sections.glob("*.py") if "Drag" in path.read_text(encoding="utf-8")] == []
    assert ".on-screen" in CSS.partition("@media print")[2].partition("display: none")[0]


def test_a_folded_table_says_its_caption_in_its_summary_only(page: str) -> None:
    folded = re.findall(r"<details><summary>(.*?) <span>.*?<caption(.*?)>(.*?)</caption>", page, re.DOTALL)
    assert folded
    for summary, marks, caption in folded:
        assert (summary, marks) == (caption, ' class="said-above"')


def test_the_curves_before_and_after_an_effect_have_the_colours_of_their_models() -> None:
    """Of an effect of the model, the first model's blue and the model's orange; of a proposed one, orange and green."""
    known = {figure.BLUE, figure.ORANGE, figure.GREEN}
    for report, wanted in ((whole(), {figure.ORANGE, figure.GREEN}), (fallen(), {figure.BLUE, figure.ORANGE})):
        found = diagnosis.section(report)
        shapes = [part.svg for part in found.parts if isinstance(part, Figure) and "before and after" in part.caption]
        assert {colour for svg in shapes for colour in known if colour in svg} == wanted


# --- closed loop and robustness: the figures of both controllers side by side, the harmful effects first


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


# --- the page of a plan: drawings that a person can read, and where each rival shows most


RECORDING, ANSWER = (stored("plan")["answers"][f"answer {k}"] for k in (1, 2))
TIME = 1e-3 * np.arange(3000)


def page(differences: dict[str, Difference], **more: Any) -> str:
    answer: dict[str, Any] = ANSWER | {"seconds": 8.0, "expected": [], "rivals": [], "manual": [], "refused": []}
    answer |= {"recordings": [RECORDING]} | more
    readings = {"x_ref": 0.1 + 0.0 * TIME, "x": 0.1 + 0.0 * TIME, "p1": 3e5 + TIME}
    outcome = Outcome(TIME, readings, readings["p1"], readings["p1"], readings["x"], 0.0 * TIME)
    return plan_page(
        read(Answer, answer), [Prediction(outcome, np.zeros((0, 0)), differences)] * len(answer["recordings"])
    )


@pytest.mark.parametrize("size", [0.5, 5.0, 500.0])
def test_the_axis_of_the_differences_has_plain_numbers(size: float) -> None:
    made = page({"leak": Difference("p1", size * np.sin(TIME))})
    assert "leak (p1)" in made
    assert "mathdefault" not in made


def test_each_rival_has_the_recording_that_shows_it_most() -> None:
    expected = [
        {"effect": "leak", "rival": "without leak", "probability_before": 0.2, "power": 0.9},
        {"effect": "lag", "rival": "lag", "probability_before": None, "power": 0.0},  # no bench shows it
    ]
    recordings = [
        RECORDING | {"name": f"plan_{i}", "times_noise": {"leak": size}} for i, size in ((1, 2.0), (2, 7.5), (3, 1.0))
    ]
    made = page({}, rivals=[{"name": "best model"}], expected=expected, recordings=recordings)
    row = made[made.index("without leak") :]
    assert [row.index(text) for text in ("20 %", "90 %", "7.5", "plan_2")] == sorted(
        row.index(text) for text in ("20 %", "90 %", "7.5", "plan_2")
    )
    assert "1 of 2" in made
