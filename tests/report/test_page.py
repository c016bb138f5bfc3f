"""The page holds what the artifacts hold, in one file, and says the worst first."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from pneucli.report import Material, to_html
from pneucli.report.page import verdicts, warnings
from pneucli.report.parts import Cell, Grid
from pneucli.report.sections import SECTIONS
from pneucli.report.sections.diagnosis import section as diagnosis
from pneucli.report.sections.where import Cloud, _grid, _map, _span
from tests.report.bench import without

ANCHORS = {
    "checks": None,
    "diagnosis": "diagnose",
    "comparison": "compare",
    "where": "compare",
    "measured": "ingest",
    "valve": "identify",
    "friction": "identify",
    "tensor": "identify",
    "parameters": "identify",
    "open-loop": "simulate",
    "closed-loop": "design",
    "robustness": "simulate",
}


def anchors(page: str) -> list[str]:
    return re.findall(r'<section id="([^"]+)">', page)


def test_every_artifact_has_its_section(page: str) -> None:
    assert anchors(page) == list(ANCHORS)


@pytest.mark.parametrize("stage", ["diagnose", "compare", "ingest", "identify", "design", "simulate"])
def test_a_section_is_absent_where_its_stage_never_ran(material: Material, stage: str) -> None:
    makers = dict(zip(ANCHORS, SECTIONS, strict=True))
    for anchor, made_by in ANCHORS.items():
        if made_by == stage:
            assert makers[anchor](without(material, stage)) is None


def test_a_report_comes_out_of_ingest_and_identify_alone(material: Material) -> None:
    page = to_html(replace(without(material, "compare", "diagnose", "design", "simulate"), checks=[]))
    assert anchors(page) == ["measured", "valve", "friction", "tensor", "parameters"]


def test_a_report_comes_out_of_nothing() -> None:
    assert anchors(to_html(Material("empty"))) == []


def test_the_page_needs_no_network(page: str) -> None:
    assert re.findall(r'(?:src|href|action)="(?!#|data:)[^"]*"', page) == []
    assert re.findall(r"url\((?!#|data:)[^)]*\)|@import", page) == []


def test_warnings_stand_before_the_verdict_and_the_verdict_before_the_sections(page: str) -> None:
    places = [page.index(text) for text in ('class="warnings"', 'class="verdict', "<nav>", "<section")]
    assert places == sorted(places)
    assert "ingest: axis_1, p1: 3 samples were lost" in page


def test_the_verdict_says_error_and_missing_effect(page: str) -> None:
    verdicts = re.findall(r'<p class="verdict ?\w*">(.*?)</p>', page)
    # sqrt((1 + 9 + 1.21) / 3), the root mean square of the bench's three ratios
    assert verdicts[0].startswith("The model comes near the noise floor: its error on test recordings is 1.93")
    assert verdicts[0].endswith("Worst: x in axis_1, 3.00 × noise.")
    assert verdicts[1].startswith("Missing from the model: piston-leak. The pressures creep")
    assert verdicts[2] == "Failed checks: compare.error.test."


def test_without_test_recordings_it_warns(material: Material) -> None:
    error = {"train": 1.0, "test": None}
    answers = {**material.answers, "compare": {**material.answers["compare"], "error": error}}
    without_test = replace(material, answers=answers)
    assert any("no test recording" in warning for warning in warnings(without_test))
    assert "at the noise floor: its error on train recordings is 1.00" in verdicts(without_test)[0].text


def test_a_mean_at_the_noise_floor_is_not_called_good_where_one_channel_is_far_off(material: Material) -> None:
    answer = {**material.answers["compare"], "error": {"train": 1.0, "test": 1.0}}
    hidden, *_ = verdicts(Material("bench", {"compare": answer}))
    clean = [c for c in answer["channels"] if c["ratio_to_noise"] < 2]
    good, *_ = verdicts(Material("bench", {"compare": {**answer, "channels": clean}}))
    assert (hidden.tone, good.tone) == ("", "good")
    assert "3.00" in hidden.text


def test_names_cannot_break_out_of_the_page(page: str) -> None:
    assert "axis_<b>" not in page
    assert "axis_&lt;b&gt;&amp;_$2$" in page


def test_the_same_material_gives_the_same_page(material: Material, page: str) -> None:
    fresh = replace(material, tables={**material.tables})
    assert to_html(fresh) == page


def test_figures_take_their_ink_from_the_page(page: str) -> None:
    figures = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    assert len(figures) >= 14
    assert all("currentColor" in figure and 'id="figure' not in figure for figure in figures)


def test_each_figure_says_what_to_see(page: str) -> None:
    captions = re.findall(r"<figcaption>(.*?)</figcaption>", page, re.DOTALL)
    assert len(captions) == page.count("<figure>")
    assert all(len(caption) > 20 for caption in captions)


def cloud(fault: np.ndarray, **states: np.ndarray) -> Cloud:
    rng = np.random.default_rng(0)
    return Cloud("axis", "x", rng.standard_normal(fault.size) + 6 * fault, states)


def test_the_residual_map_is_drawn_over_the_pair_that_tells_most() -> None:
    rng = np.random.default_rng(2)
    u, p1, x = rng.uniform(-1, 1, (3, 60_000))
    one = _map(cloud((u > 0.5) & (x > 0.5), u=u, p1=p1, x=x))
    assert one is not None
    assert (one.axes.get_xlabel(), one.axes.get_ylabel()) == ("valve command in V", "piston position in mm")


def test_the_residual_map_shows_error_where_it_is_and_noise_elsewhere() -> None:
    rng = np.random.default_rng(3)
    u, x = rng.uniform(-1, 1, (2, 200_000))
    edges_u, edges_x, rms, _ = _grid(cloud((u > 0.5) & (x > 0.5), u=u, x=x), "u", "x")
    faulty = np.logical_and.outer(edges_u[:-1] >= 0.5, edges_x[:-1] >= 0.5)
    clean = np.logical_or.outer(edges_u[1:] <= 0.5, edges_x[1:] <= 0.5)
    # 200 000 samples in 24 x 24 cells: 347 a cell, so its rms is within 4 / sqrt(2 * 347) of 1, or of sqrt(1 + 36)
    assert np.nanmax(np.abs(rms[clean] - 1)) < 0.18
    assert np.nanmax(np.abs(rms[faulty] - np.sqrt(37))) < 0.4


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [(0.9, 1.0, "toward +x"), (-1.0, -0.9, "toward −x"), (-0.1, 0.0, "at rest"), (-1.0, 0.1, "toward −x or at rest")],
)
def test_directions_are_said_in_words(low: float, high: float, words: str) -> None:
    assert _span({"signal": "direction", "from": low, "to": high, "unit": "1"}) == words


def test_cells_with_few_samples_stay_empty() -> None:
    ones = np.ones(100)
    u, x = np.append(np.zeros(100), 1.0), np.append(np.zeros(100), 1.0)
    _, _, rms, _ = _grid(Cloud("axis", "x", np.append(ones, 1e3), {"u": u, "x": x}), "u", "x")
    assert np.isfinite(rms).sum() == 1
    assert np.nanmax(rms) == 1.0


def test_only_what_is_missing_is_marked_among_the_candidates(material: Material) -> None:
    first = material.answers["diagnose"]["candidates"][0]
    helped = {**first, "effect": "valve-leak", "why": "It helps alone, but beside piston-leak it is not needed."}
    answer = {**material.answers["diagnose"], "candidates": [first, helped]}
    section = diagnosis(Material("bench", {"diagnose": answer}))
    assert section is not None
    grid = next(part for part in section.parts if isinstance(part, Grid))
    assert [(row[1].text, row[1].tone) for row in grid.rows if isinstance(row[1], Cell)] == [
        ("yes", "good"),
        ("yes", ""),
    ]
