"""The page holds what the artifacts hold, in one file, and says the worst first."""

import base64
import hashlib
import html
import re
from dataclasses import replace

import numpy as np
import pytest

from pneucli.report.page import to_html
from pneucli.report.page_elements import Cell, Grid, Note, Section, section_tables
from pneucli.report.report_data import ReportData, Table
from pneucli.report.sections import SECTIONS
from pneucli.report.sections.diagnosis import _smooth_terms
from pneucli.report.sections.diagnosis import section as diagnosis
from pneucli.report.sections.error_location import StateSamples, _grid, _maps
from tests.report.bench import without

ANCHORS = {
    "where": "compare",
    "diagnosis": "diagnose",
    "comparison": "compare",
    "flow": None,  # of a steady bench
    "parameters": "identify",
    "relations": None,  # of identify and of compare
    "valve": "identify",
    "friction": "identify",
    "closed-loop": "design",
    "logs": "compare",
    "bench": "design",
    "robustness": "simulate",
    "open-loop": "simulate",
    "measured": "ingest",
    "checks": None,
}


def anchors(page: str) -> list[str]:
    return re.findall(r'<section id="([^"]+)">', page)


def test_every_artifact_has_its_section(page: str) -> None:
    absent = ("logs", "flow")  # no controller runs on this bench, and it is not steady
    assert anchors(page) == [anchor for anchor in ANCHORS if anchor not in absent]


@pytest.mark.parametrize("stage", ["diagnose", "compare", "ingest", "identify", "design", "simulate"])
def test_a_section_is_absent_where_its_stage_never_ran(material: ReportData, stage: str) -> None:
    makers = dict(zip(ANCHORS, SECTIONS, strict=True))
    for anchor, made_by in ANCHORS.items():
        if made_by == stage:
            assert makers[anchor](without(material, stage)) is None


def test_a_report_comes_out_of_ingest_and_identify_alone(material: ReportData) -> None:
    page = to_html(replace(without(material, "compare", "diagnose", "design", "simulate"), checks=[]))
    assert anchors(page) == ["parameters", "relations", "valve", "friction", "measured"]


def test_a_report_comes_out_of_nothing() -> None:
    assert anchors(to_html(ReportData("empty"))) == []


def test_the_page_needs_no_network(page: str) -> None:
    assert re.findall(r'(?:src|href|action)="(?!#|data:)[^"]*"', page) == []
    assert re.findall(r"url\((?!#|data:)[^)]*\)|@import", page) == []


def test_a_warning_is_in_the_chapter_of_its_stage(page: str) -> None:
    chapter = page[page.index('<section id="measured">') :].partition("</section>")[0]
    assert '<p class="note warning">axis_1, p1: 3 samples were lost.</p>' in chapter
    assert page.count("3 samples were lost") == 1
    assert re.search(r"<h2>Measurements</h2>\s*<span>\(1 warning\)</span>", chapter)


def test_nothing_runs_and_nothing_is_fetched_that_is_not_the_pages_own(page: str) -> None:
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    assert policy is not None
    allowed = re.findall(r"'sha256-([^']*)'", html.unescape(policy[1]))
    scripts = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    assert [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts] == allowed
    assert "default-src 'none'" in html.unescape(policy[1])
    assert re.search(r"<[^>]*\son\w+=", page) is None


def test_names_cannot_break_out_of_the_page(page: str) -> None:
    assert "axis_<b>" not in page
    assert "axis_&lt;b&gt;&amp;_$2$" in page


def test_the_same_material_gives_the_same_page(material: ReportData, page: str) -> None:
    fresh = replace(material, tables={**material.tables})
    assert to_html(fresh) == page


def test_figures_take_their_ink_from_the_page(page: str) -> None:
    figures = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    assert len(figures) >= 14
    assert all("currentColor" in figure and 'id="figure' not in figure for figure in figures)


def test_each_figure_has_a_caption(page: str) -> None:
    captions = re.findall(r"<figcaption>(.*?)</figcaption>", page, re.DOTALL)
    assert len(captions) == page.count("<figure>")
    assert all(len(caption) > 20 for caption in captions)


def cloud(fault: np.ndarray, **states: np.ndarray) -> StateSamples:
    rng = np.random.default_rng(0)
    return StateSamples("axis", "x", rng.standard_normal(fault.size) + 6 * fault, states)


def test_the_residual_map_is_over_the_pair_with_the_largest_variation() -> None:
    rng = np.random.default_rng(2)
    u, p1, x = rng.uniform(-1, 1, (3, 60_000))
    (one,) = _maps(None, cloud((u > 0.5) & (x > 0.5), u=u, p1=p1, x=x))
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


def test_maps_before_and_after_have_the_axes_and_the_scale_of_the_one_before() -> None:
    rng = np.random.default_rng(4)
    u, p1, x = rng.uniform(-1, 1, (3, 60_000))
    first, now = (cloud(fault, u=u, p1=p1, x=x) for fault in ((u > 0.5) & (x > 0.5), p1 > 0.9))
    before, after = _maps(first, now)
    meshes = [one.axes.collections[0].norm for one in (before, after)]
    assert [(norm.vmin, norm.vmax) for norm in meshes] == [(meshes[0].vmin, meshes[0].vmax)] * 2
    assert before.axes.get_xlabel() == after.axes.get_xlabel() == "valve command in V"
    assert all(6.0 < norm.vmax < 8.0 for norm in meshes)  # a fault of 6 times the noise, with its noise


def test_cells_with_few_samples_stay_empty() -> None:
    ones = np.ones(100)
    u, x = np.append(np.zeros(100), 1.0), np.append(np.zeros(100), 1.0)
    _, _, rms, _ = _grid(StateSamples("axis", "x", np.append(ones, 1e3), {"u": u, "x": x}), "u", "x")
    assert np.isfinite(rms).sum() == 1
    assert np.nanmax(rms) == 1.0


def test_only_what_is_missing_is_marked_among_the_candidates(material: ReportData) -> None:
    first = material.answers["diagnose"]["candidates"][0]
    helped = {**first, "effect": "valve-leak", "why": "It helps alone, but beside piston-leak it is not needed."}
    answer = {**material.answers["diagnose"], "candidates": [first, helped]}
    section = diagnosis(ReportData("bench", {"diagnose": answer}))
    assert section is not None
    grid = next(part for part in section.parts if isinstance(part, Grid))
    assert [(row[1].text, row[1].tone) for row in grid.rows if isinstance(row[1], Cell)] == [
        ("yes", "good"),
        ("yes", ""),
    ]


# --- what no effect accounts for: told in words, and drawn over the signal of which it is a function


def test_the_smooth_term_is_drawn_over_its_signal() -> None:
    texts = {"channel": "force", "acts_as": "dry friction", "variable": "p1", "unit": "N"}
    columns = {name: [text] * 60 for name, text in texts.items()}
    (figure,) = _smooth_terms(Table(columns | {"value": np.linspace(1e5, 5e5, 60), "law": np.linspace(-2.0, 2.0, 60)}))
    assert "pressure of chamber 1 in bar" in figure.svg
    assert "dry friction in N" in figure.svg
    assert "part of force that no effect" in figure.caption


def test_without_data_there_is_no_figure() -> None:
    assert _smooth_terms(Table({})) == []


# --- the tables of the page as data


def test_columns_of_numbers_are_numbers_and_others_are_text() -> None:
    rows = [
        ["best", "1.5", "2·10⁻³", "holds"],
        ["pid", "–", "−4", "∞"],
    ]
    section = Section("bench", "Bench", "", [Note("a note"), Grid("Errors.", ("law", "rest", "load", "so"), rows)])
    (table,) = section_tables([section])
    assert (table.name, table.caption) == ("bench-1", "Errors.")
    assert table.columns["law"] == ["best", "pid"]
    assert np.allclose(table.columns["rest"], [1.5, np.nan], equal_nan=True)
    assert np.allclose(table.columns["load"], [2e-3, -4.0])
    assert table.columns["so"] == ["holds", "∞"]


def test_repeated_and_empty_titles_get_distinct_names_and_empty_tables_none() -> None:
    grids = [Grid("", ("x", "x", ""), [["1", "2", "3"]]), Grid("", ("y",), [])]
    (table,) = section_tables([Section("s", "S", "", grids)])
    assert list(table.columns) == ["x (1)", "x (2)", "column 3"]
