"""The page holds what the artifacts hold, in one file; its first screen and its summary say the worst first."""

import base64
import hashlib
import html
import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pneucli.messages.envelope import envelope_indices
from pneucli.messages.formatting import format_number, format_quantity
from pneucli.report.figure import with_gaps
from pneucli.report.overview import find_worst_recording, overview
from pneucli.report.page import to_html
from pneucli.report.page_elements import Cell, Grid, Note, Section, section_tables
from pneucli.report.report_data import ReportData, Table
from pneucli.report.sections import SECTIONS
from pneucli.report.sections.diagnosis import _smooth_terms
from pneucli.report.sections.diagnosis import section as diagnosis
from pneucli.report.sections.error_location import StateSamples, _grid, _maps
from pneucli.report.summaries import to_junit
from tests.report.bench import fallen, without

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


# --- the first screen: the fall of the error, what is missing, what the controller holds, and the failing stretch


@pytest.fixture(scope="module")
def after() -> ReportData:
    return fallen()


def evidence(report: ReportData) -> Section:
    """The chapter on the diagnosis, the one of these tests: a page of all takes seconds."""
    section = diagnosis(report)
    assert section is not None
    return section


def test_the_picture_shows_the_held_out_recording_with_the_first_models_largest_error(after: ReportData) -> None:
    found = find_worst_recording(after)
    assert found is not None
    assert (*found.channel.key, found.channel.use) == ("axis_<b>&_$2$", "x", "test")
    assert found.first is not None
    assert (found.first.ratio_to_noise, found.channel.ratio_to_noise) == (50.0, 3.0)
    assert found.before is not None
    # the fault is in the last second where x > 0.12 m, sin > 0.5: from 3 + 1/12 to 3 + 5/12 s; bins are of 0.2 s
    assert found.stretch == pytest.approx((3.0, 3.4), abs=0.2)


def test_a_channel_without_noise_is_not_pictured(material: ReportData) -> None:
    compared = material.answers["compare"]
    silent = [{**c, "noise": 0.0, "ratio_to_noise": None} if c["channel"] == "x" else c for c in compared["channels"]]
    found = find_worst_recording(
        replace(material, answers={**material.answers, "compare": {**compared, "channels": silent}})
    )
    assert found is not None
    assert found.channel.channel == "v"


def test_the_verdict_stands_in_the_page_without_any_script(after: ReportData) -> None:
    plain = re.sub(r"<script.*?</script>", "", to_html(after, [evidence(after)]), flags=re.DOTALL)
    top = plain[: plain.index("<nav")]
    for words in (
        "29.3 → 1.93 × noise",
        "nothing further detected",
        "5.0 µm at rest",
        "It failed most in",
        "pneucli export",
    ):
        assert words in top
    assert "cylinder · compared on 2026-11-22 · base model with stribeck and piston-leak · 2 recordings" in top


def test_implausible_findings_come_first(material: ReportData) -> None:
    finding = {"check": "silent", "signal": "p1", "recording": "axis_1", "found": "p1 stays", "mend": "check it"}
    finding |= {"weight": "doubt"}
    other = {**finding, "signal": "p2"}
    answers = {**material.answers, "ingest": {**material.answers["ingest"], "plausibility": [finding, other]}}
    doubted = replace(material, answers=answers)
    assert overview(doubted).doubt == "Doubtful: axis_1, p1 stays; check it. 1 more under Measurements."
    page = to_html(doubted, [])
    assert page.index("Doubtful: axis_1") < page.index('class="tiles"')
    assert overview(material).doubt == ""


def test_a_first_screen_comes_out_of_ingest_alone(material: ReportData) -> None:
    bare = overview(without(material, "identify", "compare", "diagnose", "design", "simulate"))
    assert (bare.tiles, bare.pictures, bare.failed) == ([], {}, "")


def test_a_restart_is_a_gap() -> None:
    assert (
        np.isnan(with_gaps(np.arange(6.0), np.array([0, 0, 0, 1, 1, 1]))).tolist() == [False] * 2 + [True] + [False] * 3
    )


# --- summary, JUnit XML, numbers as people read them, and fewer samples with every peak kept


def test_junit_mirrors_the_checks(material: ReportData) -> None:
    suites = ElementTree.fromstring(to_junit(material.name, material.checks))
    suite = suites.find("testsuite")
    assert suite is not None
    assert (suite.get("tests"), suite.get("failures")) == ("2", "1")
    cases = {case.get("name"): case for case in suite.iter("testcase")}
    assert list(cases) == [check.path for check in material.checks]
    failure = cases["compare.error.test"].find("failure")
    assert failure is not None
    assert "1.94" in failure.get("message", "")
    assert "max 1.5" in failure.get("message", "")
    assert cases["identify.model.effects"].find("failure") is None


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (1.0, "1.000"),
        (-0.5, "−0.5000"),
        (999.96, "1000"),
        (12345.6, "12350"),
        (-3.2e-9, "−3.200·10⁻⁹"),
        (None, "–"),
    ],
)
def test_numbers_have_four_digits_and_powers_of_ten_where_they_must(value: float | None, text: str) -> None:
    assert format_number(value) == text


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [(4e5, "Pa", "4.000 bar"), (0.1, "m", "100.0 mm"), (5.2e-8, "m^2", "0.05200 mm²"), (0.528, "1", "0.5280")],
)
def test_quantities_are_shown_in_the_units_that_people_read(value: float, unit: str, text: str) -> None:
    assert format_quantity(value, unit) == text


@given(st.floats(1e-8, 1e8), st.integers(2, 6))
def test_a_shown_number_is_the_number(value: float, digits: int) -> None:
    mantissa, _, exponent = format_number(value, digits).partition("·10")
    power = int(exponent.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))) if exponent else 0
    # half a unit of the last of so many significant digits
    assert float(mantissa) * 10.0**power == pytest.approx(value, rel=0.5001 * 10.0 ** (1 - digits))


@given(st.integers(1, 3000), st.integers(8, 300), st.integers(1, 3), st.integers(0, 2**32 - 1))
def test_the_envelope_keeps_peaks_ends_and_order_in_few_samples(n: int, most: int, count: int, seed: int) -> None:
    curves = np.random.default_rng(seed).standard_normal((count, n))
    kept = envelope_indices(list(curves), most)
    assert (np.diff(kept) > 0).all()
    assert kept[0] == 0
    assert kept[-1] == n - 1
    assert kept.size <= max(most, 2 * count + 2)
    for curve in curves:
        assert curve[kept].max() == curve.max()
        assert curve[kept].min() == curve.min()


def test_the_envelope_ignores_gaps() -> None:
    curve = np.full(1000, np.nan)
    curve[400:600] = np.arange(200.0)
    kept = envelope_indices([curve], 50)
    assert np.nanmax(curve[kept]) == 199.0
    assert np.nanmin(curve[kept]) == 0.0


def test_groups_gather_scattered_rows_in_order_of_appearance() -> None:
    table = Table({"a": ["x", "y", "x", "y"], "n": [1, 2, 3, 4]})
    assert [(key, rows["n"].tolist()) for key, rows in table.groups("a")] == [(("x",), [1, 3]), (("y",), [2, 4])]
    assert list(Table({}).groups("a")) == []
