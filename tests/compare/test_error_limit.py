"""The limit of the error of a correct model."""

from __future__ import annotations

import numpy as np
import pytest

from pneucli.compare import find_error_regions
from pneucli.compare.error_limit import error_limit
from tests.compare.test_channel_errors import comparison, with_limit

SEGMENTS = 30


def drawn(rng: np.random.Generator, draws: int, channels: int = 1) -> list[np.ndarray]:
    """Mean squares of one recording, by draw and segment: the square of one normal number, common to all channels."""
    squares = rng.standard_normal((draws, SEGMENTS)) ** 2 / SEGMENTS
    return [squares] * channels


@pytest.mark.parametrize("channels", [1, 3])
def test_nineteen_of_twenty_correct_models_stay_below(channels: int) -> None:
    rng = np.random.default_rng(5)
    below = []
    for _ in range(400):
        recordings = [drawn(rng, 6, channels) for _ in range(2)]
        limit = error_limit(recordings)
        assert limit is not None
        (one,), (other,) = drawn(rng, 1)[0].sum(axis=1), drawn(rng, 1)[0].sum(axis=1)
        below.append(np.sqrt((one + other) / 2.0) < limit)
    assert np.mean(below) == pytest.approx(0.95, abs=0.04)


def test_few_segments_leave_a_wider_limit_than_many() -> None:
    rng = np.random.default_rng(6)
    few, many = ([drawn(rng, 6) for _ in range(n)] for n in (1, 20))
    assert error_limit(few) > 1.2 > error_limit(many) > 1.0  # type: ignore[operator]


def test_without_a_channel_there_is_no_limit() -> None:
    assert error_limit([]) is None
    assert error_limit([[]]) is None


def test_an_error_within_the_limit_of_a_correct_model_has_no_region() -> None:
    error = np.random.default_rng(7).standard_normal(2000)
    error[900:1000] *= 8.0
    found = comparison(error)
    assert find_error_regions([found])
    assert not find_error_regions([with_limit(found, 1.01 * found.results[0].ratio_to_noise)])
