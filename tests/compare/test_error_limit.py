"""The distribution of the error of a correct model."""

from __future__ import annotations

import numpy as np
import pytest

from pneucli.compare import find_error_regions
from pneucli.compare.expected_error import ErrorDistribution, ExpectedError, combined_distribution
from tests.compare.test_channel_errors import comparison, with_limit

SEGMENTS, DRAWS = 30, 6


def expected(rng: np.random.Generator, recordings: int, channels: int = 1) -> list[ExpectedError]:
    """Recordings whose segments have the square of one normal number, common to all channels of a recording."""
    names = [f"p{i}" for i in range(channels)]
    squares = [rng.standard_normal((DRAWS, SEGMENTS)) ** 2 for _ in range(recordings)]
    population = np.concatenate([one.ravel() for one in squares])
    return [
        ExpectedError(dict.fromkeys(names, 1.0), dict.fromkeys(names, one), dict.fromkeys(names, population))
        for one in squares
    ]


def distribution(rows: list[ExpectedError]) -> ErrorDistribution:
    found = combined_distribution([(one.distribution(list(one.rms)), len(one.rms)) for one in rows])
    assert found is not None
    return found


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("tail", [0.05, 0.01])
def test_so_many_correct_models_stay_below_their_limit(channels: int, tail: float) -> None:
    rng = np.random.default_rng(5)
    below = []
    for _ in range(1000):
        one = distribution(expected(rng, 2, channels))
        error = float(np.sqrt(np.mean(rng.standard_normal(2 * SEGMENTS) ** 2)))
        assert (error < one.limit(tail)) == (one.p_value(error) > tail)
        below.append(error < one.limit(tail))
    assert np.mean(below) == pytest.approx(1.0 - tail, abs=0.02)


def test_few_segments_leave_a_wider_limit_than_many() -> None:
    rng = np.random.default_rng(6)
    few, many = (distribution(expected(rng, n)) for n in (1, 20))
    assert few.limit() > 1.25 > many.limit() > 1.0


def test_the_scatter_of_a_recording_without_a_break_away_is_that_of_all_of_its_kind() -> None:
    """A calm recording draws nothing of what happens to it in one segment of a hundred."""
    calm, other = np.full((DRAWS, SEGMENTS), 0.5), np.full((DRAWS, SEGMENTS), 0.5)
    other[0, 0] = 100.0
    population = np.concatenate([calm.ravel(), other.ravel()])
    one = ExpectedError({"x": 1.0}, {"x": calm}, {"x": population})
    assert one.distribution(["x"]).limit() > 1.2
    assert one._replace(population={"x": calm.ravel()}).distribution(["x"]).limit() == pytest.approx(0.5**0.5)


def test_uncertain_parameters_add_one_squared_normal_number() -> None:
    rng = np.random.default_rng(7)
    one = ErrorDistribution(1.0, 0.02).with_uncertain_parameters(3.0)
    noise = 0.01 * rng.chisquare(100.0, 20_000)
    errors = np.sqrt(noise + 3.0 * rng.standard_normal(20_000) ** 2)
    assert np.mean(errors > one.limit(0.05)) == pytest.approx(0.05, abs=0.015)


def test_without_a_channel_there_is_no_distribution() -> None:
    assert combined_distribution([]) is None


def test_an_error_within_the_limit_of_a_correct_model_has_no_region() -> None:
    error = np.random.default_rng(7).standard_normal(2000)
    error[900:1000] *= 8.0
    found = comparison(error)
    assert find_error_regions([found])
    assert not find_error_regions([with_limit(found, 1.01 * found.results[0].ratio_to_noise)])
