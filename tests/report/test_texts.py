"""Summary, JUnit XML, numbers as people read them, and fewer samples with every peak kept."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pneucli.messages.envelope import envelope_indices
from pneucli.messages.formatting import format_number, format_quantity
from pneucli.report.report_data import ReportData, Table
from pneucli.report.summaries import to_junit


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
