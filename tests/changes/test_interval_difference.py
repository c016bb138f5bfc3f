"""Whether two estimates differ by more than their intervals allow."""

from __future__ import annotations

import numpy as np
import pytest

from pneucli.figure import Figure
from pneucli.quantities import Z95
from pneucli.stages.diff import interval_difference


@pytest.mark.parametrize(
    ("b", "beyond"), [(15.1, True), (14.9, False), (5.1, False), (4.9, True)]
)  # half width of the difference: the root of 3^2 + 4^2
def test_beyond_means_that_the_interval_of_the_difference_excludes_zero(b: float, beyond: bool) -> None:
    found = interval_difference(Figure(10.0, 7.0, 13.0), Figure(b, b - 4.0, b + 4.0))
    assert found is not None
    assert found.excludes(0.0) is beyond
    assert found.high - found.value == pytest.approx(5.0)


def test_the_ends_that_face_each_other_count() -> None:
    """a may be 10 at most, b 40 at least: what lies on the far sides does not matter."""
    found = interval_difference(Figure(8.0, -1e9, 10.0), Figure(43.0, 40.0, 1e9))
    assert found is not None
    assert found.low == pytest.approx(35.0 - np.hypot(2.0, 3.0))
    assert found.excludes(0.0)


def test_without_an_end_of_an_interval_there_is_no_answer() -> None:
    assert interval_difference(Figure(1.0, 0.9, np.inf), Figure(2.0, 1.9, 2.1)) is None


def test_one_in_twenty_repeats_differs_beyond_the_intervals() -> None:
    draws = np.random.default_rng(5).normal(0.0, [1.0, 3.0], (4000, 2))
    found = [interval_difference(Figure(a, a - Z95, a + Z95), Figure(b, b - 3 * Z95, b + 3 * Z95)) for a, b in draws]
    assert np.mean([one is not None and one.excludes(0.0) for one in found]) == pytest.approx(0.05, abs=0.01)


def test_an_interval_that_is_practically_endless_tells_nothing() -> None:
    found = interval_difference(Figure(1.0, 0.9, 1e300), Figure(2.0, 1.9, 2.1))
    assert found is not None
    assert not found.excludes(0.0)
    assert interval_difference(Figure(0.0, -1.7e308, 1.7e308), Figure(1.0, -1.7e308, 1.7e308)) is None
