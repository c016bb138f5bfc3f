"""Numbers as people read them: their units, and the digits that the interval supports."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pneucli.messages.formatting import format_interval, format_noise_ratio, format_parameters, join_names


@pytest.mark.parametrize(
    ("value", "unit", "ci95", "text"),
    [
        (0.39917, "1", (0.39825, 0.40009), "0.39917 ± 0.00092"),
        (5.2e-8, "m^2", (5.1e-8, 5.3e-8), "0.0520 ± 0.0010 mm²"),
        (14.0056, "N", (13.98, 14.03), "14.006 ± 0.025 N"),
        (1234.6, "N", (1000.0, 1469.2), "1235 ± 235 N"),
        (-3.2, "N", (-3.4, -3.0), "−3.20 ± 0.20 N"),
        (2.0, "N", (1.9, 4.0), "2.0 (1.9 to 4.0) N"),  # not even about its value
        (3e-9, "kg/(s Pa)", (2e-9, 4e-9), "(3.0 ± 1.0)·10⁻⁹ kg/(s Pa)"),
        (2.5e6, "N/m", (2.4e6, 2.6e6), "(2.50 ± 0.10)·10⁶ N/m"),
        (1.0, "N", (None, 2.0), "at most 2.0 N"),
        (2e-6, "m^2", (0.0, 1e304), "2.000 mm²"),  # as good as without an end
        (1.0, "N", (1.0, 1.0), "1.000 N"),  # without width: the value alone
        (None, "N", (None, None), "–"),
    ],
)
def test_digits_are_those_that_the_interval_supports(
    value: float | None, unit: str, ci95: tuple[float | None, float | None], text: str
) -> None:
    assert format_interval(value, unit, ci95) == text


@given(st.floats(-1e5, 1e5).filter(lambda v: abs(v) > 1e-3), st.floats(1e-4, 1.0))
def test_the_shown_interval_contains_the_true_one(value: float, share: float) -> None:
    half = share * abs(value)
    found = re.fullmatch(r"([−\d.]+) ± ([\d.]+)", format_interval(value, "1", (value - half, value + half)))
    assert found is not None
    middle, width = (float(part.replace("−", "-")) for part in found.groups())
    # two digits of the half width: each of both numbers is off by at most half a unit of the second one
    assert middle == pytest.approx(value, abs=0.051 * half)
    assert width == pytest.approx(half, rel=0.051)


def test_parameters_are_named_with_their_intervals() -> None:
    drop = {"drop": {"value": 0.4, "unit": "1", "ci95": [0.39, 0.41]}}
    assert format_parameters(drop) == "drop = 0.400 ± 0.010"


@pytest.mark.parametrize(("error", "text"), [(None, "none"), (18.08, "18.1"), (1.026, "1.03"), (0.834, "0.83")])
def test_errors_have_three_digits_and_two_below_the_noise(error: float | None, text: str) -> None:
    assert format_noise_ratio(error) == text


@pytest.mark.parametrize(
    ("names", "text"), [([], ""), (["x"], "x"), (["x", "v"], "x and v"), (["x", "v", "a"], "x, v and a")]
)
def test_names_are_joined_as_in_a_sentence(names: list[str], text: str) -> None:
    assert join_names(names) == text
