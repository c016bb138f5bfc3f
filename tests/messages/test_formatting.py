"""Numbers as people read them: their units, and the digits that the interval supports."""

import math
import re

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from pneucli.figure import Figure
from pneucli.messages.formatting import (
    RESOLUTIONS,
    format_fit,
    format_interval,
    format_noise_ratio,
    format_number,
    format_parameters,
    format_percent,
    format_quantity,
    in_display_unit,
    join_names,
    unit_symbol,
)


@pytest.mark.parametrize(
    ("value", "unit", "ci95", "text"),
    [
        (0.39917, "1", (0.39825, 0.40009), "0.39917 ± 0.00092"),
        (5.2e-8, "m^2", (5.1e-8, 5.3e-8), "0.0520 ± 0.0010 mm²"),
        (14.0056, "N", (13.98, 14.03), "14.006 ± 0.025 N"),
        (1234.6, "N", (1000.0, 1469.2), "1230 ± 230 N"),
        (-3.2, "N", (-3.4, -3.0), "−3.20 ± 0.20 N"),
        (5e-4, "N", (-1.5, 0.5), "0.0 (−1.5 to 0.5) N"),
        (2.0, "N", (1.9, 4.0), "2.0 (1.9 to 4.0) N"),  # not even about its value
        (3e-9, "kg/(s Pa)", (2e-9, 4e-9), "0.30 ± 0.10 g/(s·bar)"),
        (3e-9, "kg", (2e-9, 4e-9), "(3.0 ± 1.0)·10⁻⁹ kg"),
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


UNITS = st.sampled_from(["Pa", "m", "rad", "m/s", "m/s^2", "N", "K", "V", "s", "1", "m^2", "W/K"])


def shown(text: str) -> list[str]:
    """The numbers of a text, with ASCII signs; powers of ten stay with theirs."""
    return re.findall(r"-?\d+(?:\.\d+)?(?:·10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?", text.replace("−", "-"))


def last_place(number: str) -> int:
    """The power of ten of the last digit of a number without a power."""
    return -len(number.partition(".")[2])


@given(st.floats(-1e300, 1e300), UNITS, st.integers(1, 6))
@example(1e-9, "m", 1)  # the resolution itself, whose size in mm is not exact
def test_a_quantity_has_no_exponent_between_a_thousandth_and_a_million(value: float, unit: str, digits: int) -> None:
    text = format_quantity(value, unit, digits)
    exact = abs(in_display_unit(value, unit))
    size = float(f"{exact:.{digits - 1}e}")
    assert "e" not in text.removesuffix(unit_symbol(unit))
    smallest = in_display_unit(RESOLUTIONS.get(unit, 0.0), unit)
    assert ("·10" in text) == (size >= 1e6 or (0.0 < size < 1e-4 and exact >= smallest))


@given(st.floats(1e-3, 9.4e5), st.integers(1, 6))  # larger ones may round to a million
def test_a_number_has_the_digits_that_were_asked_for(value: float, digits: int) -> None:
    (number,) = shown(format_number(value, digits))
    assert float(number) == pytest.approx(value, rel=0.51 * 10.0 ** (1 - digits))
    assert len(number.replace(".", "").strip("0")) <= digits


@given(st.floats(-0.999, 0.999), UNITS.filter(lambda unit: unit in RESOLUTIONS))
def test_a_value_below_the_resolution_of_its_sensors_is_0(share: float, unit: str) -> None:
    value = share * RESOLUTIONS[unit]
    assert format_quantity(value, unit).startswith("0")
    assert shown(format_quantity(value, unit)) == ["0"]
    assert shown(format_quantity(1.5 * RESOLUTIONS[unit], unit)) != ["0"]


@given(st.floats(-1e5, 1e5), st.floats(-12.0, 3.0), st.floats(-0.9, 0.9), UNITS)
def test_no_digit_is_finer_than_the_interval(value: float, decade: float, skew: float, unit: str) -> None:
    """At most the second digit of half its width: one more would be the first that means nothing."""
    value = value / in_display_unit(1.0, unit)
    half = 10.0**decade / in_display_unit(1.0, unit)
    ends = (value - half * (1.0 + skew), value + half * (1.0 - skew))
    assume(ends[1] > ends[0])
    width = 0.5 * in_display_unit(ends[1] - ends[0], unit)
    text = format_interval(value, unit, ends)
    numbers = [number for number in shown(text) if "·" not in number]
    finest = min(map(last_place, numbers), default=0)
    if len(numbers) > 1 and "·10" not in text:
        assert finest >= math.floor(math.log10(width)) - 2  # rounding of 0.0995 to 0.10 may take one digit away
        assert width >= 0.9 * in_display_unit(RESOLUTIONS.get(unit, 0.0), unit)


def test_an_interval_of_rounding_errors_is_none() -> None:
    ends = (-5.039031693674590e-3, -5.039031693674512e-3)
    assert format_interval(-5.039031693674560e-3, "m", ends) == "−5.039 mm"
    assert format_interval(1.1e-10, "N", (1.0e-10, 1.2e-10)) == "0 N"
    assert format_quantity(7.4e-8, "Pa") == "0 bar"
    assert format_quantity(8.0e-13, "m^2") == "0 mm²"


@pytest.mark.parametrize(
    ("share", "text"),
    [(0.0, "0 %"), (1e-9, "less than 0.1 %"), (0.0031, "0.3 %"), (0.5, "50 %"), (1.0, "100 %")],
)
def test_shares_are_per_cent_without_exponents(share: float, text: str) -> None:
    assert format_percent(share) == text


@pytest.mark.parametrize(("fit", "text"), [(None, "–"), (98.76, "98.8 %"), (-3.5e11, "none (hardly varies)")])
def test_a_senseless_fit_is_said_to_be_none(fit: float | None, text: str) -> None:
    assert format_fit(fit) == text


def test_parameters_are_named_with_their_intervals() -> None:
    drop = {"drop": Figure(0.4, 0.39, 0.41, "1")}
    assert format_parameters(drop) == "drop = 0.400 ± 0.010"


@pytest.mark.parametrize(("error", "text"), [(None, "none"), (18.08, "18.1"), (1.026, "1.03"), (0.834, "0.83")])
def test_errors_have_three_digits_and_two_below_the_noise(error: float | None, text: str) -> None:
    assert format_noise_ratio(error) == text


@pytest.mark.parametrize(
    ("names", "text"), [([], ""), (["x"], "x"), (["x", "v"], "x and v"), (["x", "v", "a"], "x, v and a")]
)
def test_names_are_joined_as_in_a_sentence(names: list[str], text: str) -> None:
    assert join_names(names) == text
