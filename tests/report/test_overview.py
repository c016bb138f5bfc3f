"""The first screen: the fall of the error, what is missing, what the controller holds, and the failing stretch."""

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
from pneucli.report.page_elements import Section
from pneucli.report.report_data import ReportData, Table
from pneucli.report.sections.diagnosis import section as diagnosis
from pneucli.report.summaries import to_junit
from tests.report.bench import fallen, without


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
